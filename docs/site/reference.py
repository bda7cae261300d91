"""Makes docs/reference from the program and its schemas: commands, keys of twincal.toml and of limits, layouts of result.json, fleet.json and design.json.

    python docs/site/reference.py path/to/twincal
"""

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "reference"


def shown(program, *words):
    """What the program prints, on 80 columns."""
    return subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL).stdout.rstrip()


def commands(program):
    """One section per command, with its help."""
    top = shown(program)
    names = re.findall(r"^  ([a-z]+) ", top[top.index("Commands:") :], re.MULTILINE)
    parts = ["# Commands", f"```text\n{top}\n```"]
    parts += [f"## {name}\n```text\n{shown(program, name)}\n```" for name in names]
    return "\n\n".join(parts) + "\n"


def cell(text):
    """Text in a table's cell."""
    return " ".join(str(text).split()).replace("|", "\\|")


def named(schema, reference):
    """The name of a definition and the definition."""
    name = reference.rsplit("/", 1)[-1]
    return name, schema["$defs"][name]


def kind(schema, value):
    """The type of a key in words."""
    if "$ref" in value:
        name, target = named(schema, value["$ref"])
        return f"[{name}](#{name.lower()})" if target.get("properties") or target.get("oneOf") else kind(schema, target)
    for several in ("anyOf", "oneOf"):
        if several in value:
            kinds = [kind(schema, own) for own in value[several]]
            return " or ".join(dict.fromkeys(own for own in kinds if own != "null"))
    if "const" in value:
        return f"`{json.dumps(value['const'])}`"
    if "enum" in value:
        return " or ".join(f"`{json.dumps(own)}`" for own in value["enum"])
    own = value.get("type", "any")
    own = [own] if isinstance(own, str) else own
    if own == ["array"] and isinstance(value.get("items"), dict):
        return f"list of {kind(schema, value['items'])}"
    return " or ".join(word for word in own if word != "null")


def table(schema, properties):
    """Keys with type and meaning."""
    rows = [f"| `{key}` | {cell(kind(schema, value))} | {cell(value.get('description', ''))} |" for key, value in properties.items()]
    return "\n".join(["| key | type | meaning |", "|---|---|---|", *rows])


def definition(schema, name, target):
    """A section on one definition of a schema."""
    parts = [f"## {name}", target.get("description", "").strip()]
    if target.get("properties"):
        parts.append(table(schema, target["properties"]))
    elif target.get("oneOf"):
        parts.append("\n".join(f"- {kind(schema, own)}: {own.get('description', '').strip()}".rstrip(": ") for own in target["oneOf"]))
    return "\n\n".join(part for part in parts if part)


def of_schema(path, title, section):
    """A page on everything that a schema describes; `section` writes the heading of a top-level key."""
    schema = json.loads((ROOT / path).read_text())
    parts = [f"# {title}", schema.get("description", "").strip()]
    for key, value in schema["properties"].items():
        own = named(schema, value["$ref"])[1] if "$ref" in value else value
        body = own.get("properties")
        text = value.get("description") or own.get("description", "")
        parts.append(f"## {section(key)}\n{text.strip()}")
        if body:
            parts.append(table(schema, body))
        elif value.get("type") == "array" and value.get("items", {}).get("properties"):
            parts.append(table(schema, value["items"]["properties"]))
    tops = {value.get("$ref") for value in schema["properties"].values()}
    for name, target in schema.get("$defs", {}).items():
        if f"#/$defs/{name}" not in tops and (target.get("properties") or target.get("oneOf")):
            parts.append(definition(schema, name, target))
    return "\n\n".join(part for part in parts if part) + "\n"


def main():
    program = Path(sys.argv[1]).resolve()
    PAGES.mkdir(exist_ok=True)
    pages = {
        "commands.md": commands(program),
        "config.md": of_schema("schema/twincal.schema.json", "Keys of twincal.toml", lambda key: f"[{key}]"),
        "result.md": of_schema("schema/result.schema.json", "result.json", lambda key: f"`{key}`"),
        "design.md": of_schema("schema/design.schema.json", "design.json", lambda key: f"`{key}`"),
        "limits.md": of_schema("schema/limits.schema.json", "Keys of a limits file", lambda key: f"[{key}]"),
        "fleet.md": of_schema("schema/fleet.schema.json", "fleet.json", lambda key: f"`{key}`"),
    }
    for name, text in pages.items():
        (PAGES / name).write_text(text)


if __name__ == "__main__":
    main()

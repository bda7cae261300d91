"""What users read holds none of the phrases of docs/words.toml: documents, schemas, help, terminal, page, and every text in the Rust sources."""

import html
import json
import re
import subprocess
import tomllib

from conftest import ROOT, program, twincal

WORDS = tomllib.loads((ROOT / "docs" / "words.toml").read_text())["words"]
INSTEAD = {word["phrase"]: word["instead"] for word in WORDS}
PHRASE = re.compile(rf"\b({'|'.join(map(re.escape, INSTEAD))})\b", re.IGNORECASE)
COMMAND = re.compile(r"^  ([a-z]+) ", re.MULTILINE)
# What a scan of Rust has to step over (comments, characters), and what it is after: texts, raw or with escapes.
RUST = re.compile(
    r"""//[^\n]*|/\*.*?\*/|'(?:\\[^\n]+?|[^\\'\n])'|\b(?:br|r)(?P<hashes>\#*)"(?P<raw>.*?)"(?P=hashes)|"(?P<text>(?:\\.|[^"\\])*)\"""",
    re.DOTALL,
)
CODE_SPAN = re.compile(r"`[a-z_.\[\]]+`")  # a key or a name, no prose


def banned(text):
    """The phrases of this text, each with what to write instead."""
    flat = " ".join(CODE_SPAN.sub("`…`", text).split())
    return [f"{m[1]!r} ({INSTEAD[m[1].lower()]}): …{flat[max(0, m.start() - 40) : m.end() + 40]}…" for m in PHRASE.finditer(flat)]


def texts(source):
    """String literals of Rust source, with their lines; a backslash at the end of a line joins it with the next."""
    for match in RUST.finditer(source):
        text = match["raw"] if match["raw"] is not None else match["text"]
        if text is not None:
            yield source.count("\n", 0, match.start()) + 1, re.sub(r"\\\n\s*|\\[nt]", lambda m: " " if len(m[0]) == 2 else "", text)


def visible(page):
    """What a reader of the page sees, plots' labels included."""
    page = re.sub(r"<(script|style)\b.*?</\1>", " ", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", " ", page))


def test_phrases_are_few_and_lower_case():
    assert len(INSTEAD) == len(WORDS) <= 40
    assert all(phrase == " ".join(phrase.lower().split()) and not banned(instead) for phrase, instead in INSTEAD.items())


def test_a_phrase_is_found():
    """In any case, over line breaks of text and source, raw or not; not in comments, names and longer words."""
    source = '// "turns round"\n/* "mends" */ let a = \'"\'; "Turns \\\n   round\\nhere"; r#"say "the" mends"#; "amend, turning_round, `mends`"'
    found = {line: banned(text) for line, text in texts(source)}
    assert found.keys() == {2, 3} and len([text for _, text in texts(source)]) == 3
    assert [len(banned(text)) for _, text in texts(source)] == [1, 1, 0]
    assert banned("the joint stands\n  still") and banned(visible("<p>off <b>uniform</b></p>"))


def test_sources():
    """Every text in the crates, tests beside the code included; and the page's template."""
    found = {}
    for path in sorted(ROOT.glob("crates/*/src/**/*.rs")):
        for line, text in texts(path.read_text()):
            if wrong := banned(text):
                found[f"{path.relative_to(ROOT)}:{line}"] = wrong
    for name in ("report.html", "report.js", "fleet.html", "design.html"):
        if wrong := banned((ROOT / "crates/twincal-io/src/report" / name).read_text()):
            found[name] = wrong
    assert not found, found


def test_documents():
    """Not the decisions and the CHANGELOG, which quote what was."""
    paths = [ROOT / "README.md", *sorted((ROOT / "schema").glob("*.json"))]
    paths += [path for folder in ("docs", "docs/howto") for path in sorted((ROOT / folder).glob("*.md"))]
    found = {path.name: wrong for path in paths if (wrong := banned(path.read_text()))}
    assert not found, found


def test_notebooks():
    """Prose, code and printed text; not the figures, nor tables twice."""
    found = {}
    for path in sorted((ROOT / "docs/notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text())["cells"]
        own = ["".join(cell["source"]) for cell in cells]
        outputs = [output for cell in cells for output in cell.get("outputs", [])]
        own += ["".join(output.get("text", output.get("data", {}).get("text/plain", ""))) for output in outputs]
        if wrong := banned("\n\n".join(own)):
            found[path.name] = wrong
        assert outputs and all(output["output_type"] != "error" for output in outputs), f"{path.name} is not executed"
    assert not found, found


def test_help():
    top = twincal("--help").stdout
    commands = COMMAND.findall(top[top.index("Commands:") :])
    assert {"fit", "doctor", "export"} <= set(commands)
    helps = {"twincal": top} | {name: twincal(name, "--help").stdout for name in commands}
    found = {name: wrong for name, text in helps.items() if (wrong := banned(text))}
    assert not found, found


def test_terminal_and_page(tmp_path):
    done = subprocess.run([program("twincal"), "demo", "-v"], cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr
    page = visible((tmp_path / "twincal-demo" / "report.html").read_text())
    assert "twincal" in page
    found = {"stdout": banned(done.stdout), "stderr": banned(done.stderr), "page": banned(page)}
    assert not any(found.values()), found

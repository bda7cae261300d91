"""Four kinds of damage, twenty of each: cuts, bit flips, hostile beginnings, hostile values of fields.

Cuts and flips are of bytes; hostile beginnings replace or precede the file's first bytes; values are put into the file through its own
format, so that everything around them is right.
"""

import json

import numpy as np

COUNT = 20
# Beginnings of other formats, and of none.
MAGIC = [b"PAR1", b"ARROW1\x00\x00", b"\x89MCAP0\r\n", b"SQLite format 3\x00", b"PK\x03\x04", b"\x1f\x8b\x08\x00", b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18"]


def cuts(data):
    """The file cut after 0, 1/20, … of its bytes; the last one lacks one byte."""
    places = [len(data) * k // COUNT for k in range(COUNT - 1)] + [len(data) - 1]
    return [data[:place] for place in places]


def flips(data, seed):
    """One bit turned at a random place."""
    rng = np.random.default_rng(seed)
    out = []
    for place, bit in zip(rng.integers(0, len(data), COUNT), rng.integers(0, 8, COUNT)):
        changed = bytearray(data)
        changed[place] ^= 1 << bit
        out.append(bytes(changed))
    return out


def beginnings(data, seed):
    """Twenty hostile beginnings of a file."""
    rng = np.random.default_rng(seed)
    over = lambda head: head + data[len(head) :]
    out = [over(magic) for magic in MAGIC]
    out += [over(b"\x00" * 64), over(b"\xff" * 64), over(rng.bytes(64)), over(rng.bytes(1024))]
    out += [b"\xef\xbb\xbf" + data, b"\xff\xfe" + data, data.decode("latin-1").encode("utf-16")]
    out += [b"\x00" * (1 << 20) + data, b"\n" * (1 << 20) + data, b"[" * (1 << 18) + data]
    # lengths near the beginning become huge
    out += [data[:8] + b"\xff\xff\xff\xff\xff\xff\xff\x7f" + data[16:], data[:4] + b"\xff\xff\xff\xff" + data[8:]]
    return out


def tables(good):
    """Twenty tables with hostile numbers; the same for every form that holds numbers."""
    n = len(good["t"])

    def put(values, *names, rows=slice(None)):
        table = {name: column.copy() for name, column in good.items()}
        for name in names:
            table[name][rows] = values
        return table

    one = slice(n // 2, n // 2 + 1)
    sign = np.where(np.arange(n) % 2, 1.0, -1.0)
    return [
        put(np.nan, "q1", rows=one), put(np.inf, "q1", rows=one), put(1e308, "q1", rows=one), put(1e308, "q1"), put(0.0, "q1", "q2"),
        put(-np.inf, "tau1", rows=one), put(np.nan, "tau1", "tau2"), put(5e-324, "tau1"), put(1e300 * sign, "tau1"), put(1e154 * sign, "qd1"),
        put(np.nan, "t", rows=one), put(1e308, "t", rows=one), put(1.0, "t"), put(good["t"][::-1], "t"), put(-1e18, "t"),
        put(good["t"] + 1e15, "t"), put(1e300, "t", rows=slice(n - 1, n)), put(good["t"] * 1e-12, "t"), put(np.inf, "qd1", "qd2"),
        put(sign * 1e200, *good),
    ]  # fmt: skip


def message_changes():
    """Ten hostile messages for bags, in place of the times that a bag cannot hold."""
    many = [f"j{k}" for k in range(10_000)]

    def change(where=200, **parts):
        return lambda row, message: message.update(parts) if where in (row, None) else None

    return [
        change(sec=-(2**31)), change(sec=2**31 - 1, nanosec=2**32 - 1), change(None, sec=0, nanosec=0), change(length=2**32 - 1),
        change(length=2**29), change(names=[]), change(names=("x" * 1_000_000, "elbow")), change(names=("shoulder", b"\xff\xfe\x00a")),
        change(names=many, lists=[[1.0] * 10_000] * 3), change(lists=[[1.0], [], [1.0, 2.0, 3.0]]),
    ]  # fmt: skip


NUMBERS = ["1e308", "-1", "NaN", "inf", "0", "1e-320", "1,5", "", "9" * 400, "0x10"]


def replaced(text, changes):
    """The text with one change each: (old, new); every old must be there."""
    missing = [old for old, _ in changes if old not in text]
    assert not missing, missing
    return [text.replace(old, new, 1).encode("utf-8", "surrogatepass") for old, new in changes]


def urdf_values(text):
    """Twenty hostile values of a URDF."""
    mass, axis = 'mass value="3"', 'axis xyz="0 -1 0"'
    inertial = text[text.index("<inertial>") : text.index("</inertial>") + 11]
    links = "".join(f'<link name="l{k}"/>' for k in range(100_000))
    changes = [(mass, f'mass value="{number}"') for number in NUMBERS]
    changes += [
        (axis, 'axis xyz="0 0 0"'), (axis, 'axis xyz="NaN 0 1e308"'), ('xyz="0.2 0 0"', 'xyz="1e308 0 0"'),
        (inertial, inertial + inertial), ('joint name="elbow"', 'joint name="shoulder"'), ('parent link="upper_arm"', 'parent link="forearm"'),
        ('joint name="elbow"', 'joint name="el&#0;bow"'), ('joint name="elbow"', f'joint name="{"x" * 1_000_000}"'),
        ('type="continuous"', 'type="hostile"'), ("</robot>", links + "</robot>"),
    ]  # fmt: skip
    return replaced(text, changes)


def mjcf_values(text):
    """Twenty hostile values of an MJCF."""
    mass, axis = 'mass="3"', 'axis="0 -1 0"'
    deep = '<body pos="0 0 0">' * 100_000
    changes = [(mass, f'mass="{number}"') for number in NUMBERS]
    changes += [
        (axis, 'axis="0 0 0"'), (axis, 'axis="NaN 0 1e308"'), ('pos="0.2 0 0"', 'pos="1e308 0 0"'), ("diaginertia=", "fullinertia="),
        ('joint name="elbow"', 'joint name="shoulder"'), ("<worldbody>", '<include file="/dev/zero"/><worldbody>'),
        ("<worldbody>", '<include file="model.xml"/><worldbody>'), ('joint name="elbow"', f'joint name="{"x" * 1_000_000}"'),
        ('type="hinge"', 'type="ball"'), ("<worldbody>", f"<worldbody>{deep}"),
    ]  # fmt: skip
    return replaced(text, changes)


def xml_beginnings(text):
    """Twenty hostile beginnings of an XML file."""
    body = text[text.index("<robot") :] if "<robot" in text else text[text.index("<mujoco") :]
    entities = '<!ENTITY a "' + "x" * 1000 + '">' + "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9))
    heads = [
        f"<!DOCTYPE r [{entities}]>", '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>', '<!DOCTYPE r SYSTEM "http://127.0.0.1/x">',
        '<?xml version="1.0" encoding="utf-16"?>', '<?xml version="9.9"?>', "<?xml", "<!--", "<![CDATA[", "<a>" * 100_000, "<?x " * 10_000,
        "<!-- " + "-" * 1_000_000 + " -->", "\x00", "\x1b[2J", "<" * 1_000_000, "&#x110000;",
    ]  # fmt: skip
    out = [(head + body).encode() for head in heads]
    out += [b"\xff\xfe" + body.encode(), b"\xef\xbb\xbf" + body.encode(), body.encode("utf-16"), b"\x00" * 64 + body.encode(), b""]
    return out


def toml_values(text):
    """Twenty hostile values of twincal.toml."""
    lines = [
        "[signal]\ncutoff_hz = nan", "[signal]\ncutoff_hz = -1", "[signal]\ncutoff_hz = 1e308", "[signal]\nrate_hz = 1e-300", "[signal]\nlag = inf",
        "[prior]\nexpected = -5", "[library]\nfamilies = []", "[library]\nfamilies = [\"x\"]", "[library]\nuser = [\"" + "(" * 50_000 + "\"]",
        "[library]\nuser = [\"" + "q1*" * 20_000 + "q1\"]", "[model.locked]\nelbow = nan", "[columns]\nq = \"" + "x" * 1_000_000 + "\"",
        "[columns.factor]\nq = 0.0", "[columns.factor]\nq = 1e308", "[inference]\nseed = -1", "[inference]\nchains = 1000000000",
        "[output]\nfolder = \"/dev/null/x\"", "[noise]\nmodel = \"\\u0000\"", "[hostile]\nkey = 1", "[log]\nrate_hz = 1e308",
    ]  # fmt: skip
    return [f"{text}\n{line}\n".encode() for line in lines]


def toml_beginnings(text):
    """Twenty hostile beginnings of twincal.toml."""
    heads = [
        "a = " + "[" * 100_000, "a = " + "{b=" * 100_000, "a" + ".a" * 100_000 + " = 1", "[" + "a." * 100_000 + "a]", 'a = "' + "x" * 10_000_000 + '"',
        "[model]\n[model]", "[signal]\nx=1\n[signal]", 'a = """', "a = '''", "= 1", "[[log]]\n" * 100_000, "\x00", "\x1b[2J", "a = 1e99999",
        "a = 9" + "9" * 100_000, "# " + "x" * 1_000_000,
    ]  # fmt: skip
    out = [f"{head}\n{text}".encode() for head in heads]
    return out + [b"\xff\xfe" + text.encode(), b"\xef\xbb\xbf" + text.encode(), text.encode("utf-16"), b"\xff" * 64 + text.encode()]


def metadata_values(text):
    """Twenty hostile values of a bag's metadata.yaml."""
    path, version = "- bag_0.mcap", "version: 5"
    listed = "\n".join(["    - bag_0.mcap"] * 20_000)
    changes = [(version, f"version: {number or '~'}") for number in NUMBERS]
    changes += [
        (path, "- ../bag_0.mcap"), (path, "- /dev/zero"), (path, "- /etc/passwd"), ("    - bag_0.mcap", listed), (path, "- bag_0.mcap\n    - bag_0.mcap"),
        ("storage_identifier: mcap", "storage_identifier: ../../x"), ('compression_mode: ""', "compression_mode: FILE"),
        ("compression_format: \"\"", "compression_format: zstd"), ("message_count: 1500", "message_count: 18446744073709551616"),
        ("name: /joint_states", "name: &a [*a, *a, *a]"),
    ]  # fmt: skip
    return replaced(text, changes)


def json_places(tree):
    """Where values stand in a JSON tree, by kind of place: lists of (holder, key), all entries of a list being one kind."""
    kinds = {}

    def walk(node, path):
        for key, child in node.items() if isinstance(node, dict) else enumerate(node):
            here = path + (key if isinstance(node, dict) else "*",)
            kinds.setdefault(here, []).append((node, key))
            if isinstance(child, (dict, list)):
                walk(child, here)

    walk(tree, ())
    return list(kinds.values())


def json_values(text, seed):
    """Twenty hostile values, each in place of one value of a JSON file; the kind of place is drawn first."""
    values = [None, True, -1, 0, 1e308, -1e308, 2**63, 1e-320, "", "x" * 1_000_000, "\x00\x1b[2J", "../../etc/passwd", [], {}, [[]] * 1000,
              [1e308] * 10_000, "nan", -(2**63), 18446744073709551615, {"a": {"b": []}}]  # fmt: skip
    rng = np.random.default_rng(seed)
    out = []
    for value in values:
        tree = json.loads(text)
        kinds = json_places(tree)
        places = kinds[rng.integers(len(kinds))]
        node, key = places[rng.integers(len(places))]
        node[key] = value
        out.append(json.dumps(tree).encode())
    return out

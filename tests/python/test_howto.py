"""The how-to pages (docs/howto) and the tutorial: their commands run in order in an empty folder, and print what the pages quote.

What a page is, for these tests:
- A link to a file of `examples/arm`, or to a script of a study, is a file that the reader copies into the folder. A ```toml
  block is `twincal.toml`, or the file that its first line `# NAME.toml` names.
- A line of an ```sh block is a command. It ends with exit code 0, or with the one that its comment `# exit code N` states.
- A ```text block is what the ```sh block above it prints on standard output; standard error (progress, warnings) is not quoted.
  A line `…` is any number of lines that were left out; nothing else is. In every other line words are equal, spaces apart,
  and numbers to 3 significant digits: they differ by at most one unit of the third digit, or of the last one where there are
  fewer. Nothing is excluded: commands of the pages print neither times nor absolute paths.
- ```python and ```bash blocks, and the ```console block with their output, need the Python package, Ray or GNU parallel;
  crates/twincal-py/tests/test_engine.py runs what needs the package alone.
"""

import importlib.util
import json
import math
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, SHARED, program

EXAMPLES = ROOT / "examples" / "arm"
STUDIES = ROOT / "studies"
PAGES = sorted((ROOT / "docs" / "howto").glob("*.md"))
TUTORIAL = ROOT / "docs" / "tutorial.md"
TRUTH = json.loads((EXAMPLES / "truth.json").read_text())
LINK = re.compile(r"\]\(([^)#]+)[^)]*\)")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
EXIT = re.compile(r"# exit code (\d+)$")
NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
TOML_NAME = re.compile(r"# (\w+\.toml)\n")
OMITTED = "…"


def blocks(page):
    """Kind and text of each block."""
    return [(match[1], match[2]) for match in BLOCK.finditer(page.read_text())]


def commands(text):
    """Lines of an sh block, each with its exit code."""
    return [(line, int(code[1]) if (code := EXIT.search(line)) else 0) for line in text.splitlines() if line.strip()]


def unit(number):
    """One unit of the third significant digit of a number as it is printed, or of its last digit where it has fewer."""
    mantissa, _, exponent = number.lower().partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    size = abs(float(number))
    return max(last, 10.0 ** (math.floor(math.log10(size)) - 2) if size else last)


def alike(quoted, printed):
    """Whether a printed line is the quoted one."""
    if " ".join(NUMBER.sub("#", quoted).split()) != " ".join(NUMBER.sub("#", printed).split()):
        return False
    pairs = zip(NUMBER.findall(quoted), NUMBER.findall(printed), strict=True)
    return all(abs(float(one) - float(other)) <= 1.001 * max(unit(one), unit(other)) for one, other in pairs)


def missing(quoted, printed):
    """The first quoted line that was not printed where the page says; None where all of them were."""
    quoted, printed = quoted.splitlines(), printed.splitlines()
    at, anywhere = 0, False
    for line in quoted:
        if line.strip() == OMITTED:
            anywhere = True
            continue
        places = range(at, len(printed) if anywhere else min(at + 1, len(printed)))
        found = next((place for place in places if alike(line, printed[place])), None)
        if found is None:
            return line
        at, anywhere = found + 1, False
    return None if anywhere or not any(line.strip() for line in printed[at:]) else "(the page ends before the output does)"


@cache
def followed(page, folder):
    """Follows a page in this folder; returns what was printed beside what is quoted, pair by pair."""
    for name in sorted(set(LINK.findall(page.read_text()))):
        file = (page.parent / name).resolve()
        if file.parent == EXAMPLES or (file.suffix == ".py" and STUDIES in file.parents):
            (folder / file.name).write_bytes(file.read_bytes())
    first = [str(Path(file).parent) for file in (program("twincal"), sys.executable)]
    environment = {**os.environ, "PATH": os.pathsep.join([*first, os.environ["PATH"]])}
    pairs, printed = [], None
    for kind, text in blocks(page):
        if kind == "toml":
            named = TOML_NAME.match(text)
            (folder / (named[1] if named else "twincal.toml")).write_text(text)
        elif kind == "sh":
            printed = ""
            for line, code in commands(text):
                done = subprocess.run(["sh", "-c", line], cwd=folder, env=environment, capture_output=True, text=True,
                                      stdin=subprocess.DEVNULL)  # fmt: skip
                assert done.returncode == code, f"{line}\nexit {done.returncode}\n{done.stdout}\n{done.stderr}"
                printed += done.stdout
        elif kind == "text":
            pairs.append((text, printed))
    return pairs


@pytest.fixture(scope="module")
def folder_of(tmp_path_factory):
    """Folder of a page, the same for all tests."""
    return cache(lambda page: tmp_path_factory.mktemp(page.stem))


def effects(folder):
    """Mean and standard deviation of each parameter that a fit found, by component and parameter."""
    done = subprocess.run([program("twincal"), "export", "--twin", folder, "--to", "csv"], capture_output=True, text=True, check=True)
    rows = [line.split(",") for line in done.stdout.splitlines()[1:]]
    return {(row[0], row[1]): (float(row[3]), float(row[4])) for row in rows if row[3]}


def test_lines_are_compared():
    """Words and three digits, not more; and the whole output but for what `…` leaves out."""
    assert alike("mass +0.8024 ± 0.0019 kg", "  mass  +0.8031 ± 0.0018 kg")
    assert not alike("mass +0.8024 kg", "mass +0.8048 kg") and not alike("mass 0.80 kg", "mass 0.80 g")
    assert not alike("x -1.2", "x +1.2") and not alike("RMSE 12.3", "RMSE 12.3 4.5") and alike("6.218e-4", "6.22e-4")
    assert missing("a 1\n…\nc 3\n", "a 1\nb 2\nc 3\n") is None and missing("…\nc 3\n", "b\nc 3") is None
    assert missing("a 1\nc 3\n", "a 1\nb 2\nc 3\n") == "c 3" and missing("b 2\n…\n", "a 1\nb 2\n") == "b 2"
    assert missing("a 1\n", "a 1\nb 2\n") is not None


def test_there_are_seven_pages_of_at_most_five_commands():
    """Every page begins with what one gets and what one needs, has real output, and is linked from the README."""
    assert [page.stem for page in PAGES] == ["before_and_after_a_service", "friction_for_a_controller", "gate_in_ci", "many_logs",
                                             "motion_that_decides", "payload", "torque_is_a_current"]  # fmt: skip
    readme = (ROOT / "README.md").read_text()
    for page in PAGES:
        text = page.read_text()
        typed = [line for kind, block in blocks(page) if kind == "sh" for line, _ in commands(block)]
        assert 1 <= len(typed) <= 5, (page.name, typed)
        assert {kind for kind, _ in blocks(page)} <= {"sh", "text", "toml", "yaml", "python", "bash", "console"}, page.name
        assert re.search(r"^You get [^\n]*(\n[^\n]+)?\n\nYou need ", text, re.MULTILINE) and "\n## When it is not so\n" in text, page.name
        assert max(map(len, text.splitlines())) <= 100, page.name
        assert f"docs/howto/{page.name}" in readme, page.name
        lost = [link for link in LINK.findall(text) if not link.startswith("http") and not (page.parent / link).exists()]
        assert not lost, (page.name, lost)


@pytest.mark.parametrize("page", [*PAGES, TUTORIAL], ids=lambda page: page.stem)
def test_the_page_prints_what_it_quotes(page, folder_of):
    folder = folder_of(page)
    if page == TUTORIAL:
        recordings = SHARED / "double_pendulum"
        if not recordings.exists():
            pytest.skip("../shared/data is not there")
        for file in [*recordings.glob("run*.csv"), recordings / "model_as_published.urdf", ROOT / "examples/double_pendulum/twincal.toml"]:
            (folder / file.name).write_bytes(file.read_bytes())
    pairs = followed(page, folder)
    assert pairs
    for quoted, printed in pairs:
        lost = missing(quoted, printed)
        assert lost is None, f"{page.name} quotes\n{lost}\nand the program printed\n{printed}"


def within(found, truth, standard_errors=4.0):
    """Whether an estimate is its truth; 4 standard errors of a normal error are a false alarm of 6e-5."""
    return abs(found[0] - truth) <= standard_errors * found[1]


def page_named(stem):
    return next(page for page in PAGES if page.stem == stem)


def test_the_payload_is_the_true_one(folder_of):
    page = page_named("payload")
    followed(page, folder_of(page))
    found, truth = effects(folder_of(page) / "twincal-out"), TRUTH["logs"]["tool"]
    for name, value in zip(("mass", "com_x", "com_y", "com_z"), (truth["payload"], *truth["centre"]), strict=True):
        assert within(found["payload", name], value), (name, found["payload", name])


@pytest.mark.parametrize("stem, log", [("friction_for_a_controller", "run"), ("torque_is_a_current", "current")])
def test_friction_is_the_true_one(stem, log, folder_of):
    """Of the joints, from torque and from currents."""
    page = page_named(stem)
    followed(page, folder_of(page))
    found = effects(folder_of(page) / "twincal-out")
    for kind in ("viscous", "coulomb"):
        for joint, value in zip(TRUTH["joints"], TRUTH["logs"][log][kind], strict=True):
            assert within(found[f"{joint}.{kind}", "value"], value), (joint, kind, found[f"{joint}.{kind}", "value"])


def test_the_service_changed_what_diff_says(folder_of):
    page = page_named("before_and_after_a_service")
    folder = folder_of(page)
    followed(page, folder)
    done = subprocess.run([program("twincal"), "diff", folder / "before", folder / "after", "--json"], capture_output=True,
                          text=True, check=True)  # fmt: skip
    components = {one["name"]: one for one in json.loads(done.stdout)["components"]}
    before, after = (TRUTH["logs"][name] for name in ("run", "after"))
    elbow = TRUTH["joints"].index("elbow")
    for name, parameter, value in (("payload", "mass", after["payload"] - before["payload"]),
                                   ("elbow.coulomb", "value", after["coulomb"][elbow] - before["coulomb"][elbow])):  # fmt: skip
        found = next(one for one in components[name]["parameters"] if one["name"] == parameter)
        assert within((found["difference"], found["sd"]), value), found
    became = {name: one["became"] for name, one in components.items() if one["became"] in ("new", "gone", "changed")}
    assert became == {"payload": "new", "elbow.coulomb": "changed"}, became


def test_the_motion_decides_rightly(folder_of):
    """Every effect that the poor log leaves open, the payload among them; and the payload is the true one."""
    page = page_named("motion_that_decides")
    folder = folder_of(page)
    followed(page, folder)
    tutorial = module_of(STUDIES / "design" / "tutorial.py")
    truth = tutorial.World().true
    before, after = ({own["name"]: own["pip"] or 0.0 for own in json.loads((folder / name / "result.json").read_text())["components"]}
                     for name in ("poor", "decided"))  # fmt: skip
    asked = {name for name, pip in before.items() if 0.05 < pip < 0.95}
    assert {"payload", "base.tilt"} < asked
    wrong = {name: after[name] for name in asked if not (after[name] >= 0.95 if name in truth else after[name] <= 0.05)}
    assert not wrong, wrong
    found = effects(folder / "decided")
    for name, value in zip(("mass", "com_x", "com_y", "com_z"), (tutorial.PAYLOAD, *tutorial.CENTRE), strict=True):
        assert within(found["payload", name], value), (name, found["payload", name])


def module_of(path):
    """A script as a module, named after its folder too: other tests import a `simulate`."""
    spec = importlib.util.spec_from_file_location(f"{path.parent.name}_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look for it
    spec.loader.exec_module(module)
    return module


def test_logs_are_what_the_script_makes(tmp_path):
    """The shortest of them, simulated anew: within a count of the encoders and two of the last digit of torque."""
    module = module_of(EXAMPLES / "simulate.py")
    module.write(tmp_path / "friday.csv", module.WORLDS["friday"])
    made, kept = (np.loadtxt(folder / "friday.csv", delimiter=",", skiprows=1) for folder in (tmp_path, EXAMPLES))
    assert np.abs(made - kept).max(0)[:5].max() <= 1.5 * module.COUNT and np.abs(made - kept).max() <= 0.0201
    stated = {name: {key: list(value) if isinstance(value, tuple) else value for key, value in vars(world).items()}
              for name, world in module.WORLDS.items()}  # fmt: skip
    assert stated == TRUTH["logs"]

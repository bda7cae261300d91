"""result.json is what `schema/result.schema.json` says: simulated and real robots, tested and not. Truth: the validator jsonschema."""

import copy
import json
import subprocess

import jsonschema
import pytest
from conftest import ROOT, SHARED, program, twincal

SCHEMA = json.loads((ROOT / "schema" / "result.schema.json").read_text())
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def problems(result):
    return [f"{list(error.absolute_path)}: {error.message[:200]}" for error in VALIDATOR.iter_errors(result)]


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("schema")
    subprocess.run([program("twincal"), "demo"], cwd=folder, check=True, capture_output=True)
    return json.loads((folder / "twincal-demo" / "result.json").read_text())


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


def test_the_demo_is_as_the_schema_says(demo):
    assert problems(demo) == []
    assert set(demo) == set(SCHEMA["required"])
    assessment = demo["assessment"]
    deciding = [claim["code"] for claim in assessment["claims"]]
    assert assessment["reason"] == "passed" or deciding[0] == assessment["reason"]


def test_what_the_schema_forbids_is_found(demo):
    """Each of these is one change of a good result."""

    def changed(change):
        result = copy.deepcopy(demo)
        change(result)
        return problems(result)

    assert changed(lambda r: r["assessment"].update(answer="perhaps"))
    assert changed(lambda r: r["assessment"].pop("reason"))
    assert changed(lambda r: r["assessment"]["claims"][0].update(code="no_such_code"))
    assert changed(lambda r: r["assessment"]["claims"][0]["evidence"].update(words="text"))
    assert changed(lambda r: r.pop("terms"))
    assert changed(lambda r: r["components"][0].update(pip="high"))
    assert changed(lambda r: r["validation"].pop("moving"))


@pytest.mark.parametrize(
    ("robot", "model", "logs"),
    [
        ("ur10", "model.urdf", ["run0.parquet"]),
        ("double_pendulum", "model_as_published.urdf", ["run0.csv", "run1.csv", "run2.csv"]),
    ],
)
def test_real_robots_are_as_the_schema_says(robot, model, logs, tmp_path):
    data = SHARED / robot
    if not data.is_dir():
        pytest.skip(f"../shared/data/{robot} is not there")
    logs = [data / log for log in logs]
    twincal("fit", *logs, "--model", data / model, "--no-config", "-o", tmp_path / "own")
    result = json.loads((tmp_path / "own" / "result.json").read_text())
    assert problems(result) == []
    twincal("statistics", *logs, "--model", data / model, "--no-config", "-o", tmp_path / "st")
    files = sorted((tmp_path / "st").glob("*.arrow"))
    twincal("fit", "--statistics", *files, "--no-config", "-o", tmp_path / "untested")
    untested = json.loads((tmp_path / "untested" / "result.json").read_text())
    assert problems(untested) == []
    assert (untested["assessment"]["answer"], untested["assessment"]["reason"]) == ("not_yet", "not_tested")

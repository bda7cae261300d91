"""result.json is what `schema/result.schema.json` says: of the demo, and where it is not. Real robots: test_statistics.py. Truth: the validator jsonschema."""

import copy
import json
import subprocess

import jsonschema
import pytest
from conftest import ROOT, program

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

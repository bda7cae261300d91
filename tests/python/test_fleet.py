"""`twincal fleet` on twenty simulated robots of which three change in the third of eight weeks: named, right, with their week.

The long form is `studies/fleet/run`. The seed is fixed and no choice was made on it. With the recall that the study asks for, 0.95,
another seed would miss one of three robots with a probability of 14 %.
"""

import importlib.util
import json
import sys
import tomllib
from types import SimpleNamespace

import jsonschema
import numpy as np
import pinocchio as pin
import pytest
from conftest import ROOT, program

FOLDER = ROOT / "studies" / "fleet"
sys.path.append(str(FOLDER))
sys.path.append(str(ROOT / "studies" / "worlds"))

import fleets  # noqa: E402

SEED = 2901


def study():
    """`study.py`, whose modules `judge` and `table` have the names of those of `studies/worlds`."""
    names = ("judge", "table")
    others = {name: sys.modules.pop(name, None) for name in names}
    sys.path.insert(0, str(FOLDER))
    try:
        spec = importlib.util.spec_from_file_location("fleet_study", FOLDER / "study.py")
        loaded = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(loaded)
    finally:
        sys.path.remove(str(FOLDER))
        for name in names:
            sys.modules.pop(name, None)
        sys.modules.update({name: other for name, other in others.items() if other})
    return loaded


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of a fleet, and how it is judged."""
    folder = tmp_path_factory.mktemp("fleet") / "made"
    given = SimpleNamespace(jobs=1, again=False)
    line = study().one(program("twincal"), fleets.Fleet(units=20, seed=SEED), folder, given)
    assert "error" not in line, line
    return folder, line


def test_what_is_wrong_for_all_is_found_and_nothing_else(made):
    _, line = made
    assert line["type"]["found"] == line["type"]["true"] and not line["type"]["false"], line["type"]


def test_the_robots_that_changed_are_named_with_effect_and_week(made):
    _, line = made
    named = [robot for robot in line["robots"] if robot["named"]]
    assert len(named) == 3 and all(robot["deviates"] for robot in line["robots"]), line["robots"]
    for robot in named:
        (planted,) = robot["planted"]
        assert planted["found"] and abs(planted["onset_off"]) <= 1, robot


def test_the_corrected_model_weighs_what_the_robots_weigh(made):
    """Gravity torque of the model file, the corrected one, and the file with the planted adapter, by Pinocchio."""
    folder, _ = made
    truth = json.loads((folder / "truth.json").read_text())
    file = json.loads((folder / "out" / "fleet.json").read_text())["corrected_model"]["file"]
    nominal = tomllib.loads((folder / "twincal.toml").read_text())["model"]["file"]
    models = [pin.buildModelFromUrdf(str(path)) for path in (nominal, folder / "out" / file, nominal)]
    mass, centre = truth["adapter"]
    adapter = pin.Inertia(mass, np.array(centre), np.zeros((3, 3)))
    models[2].appendBodyToJoint(models[2].njoints - 1, adapter, pin.SE3.Identity())
    datas = [model.createData() for model in models]
    rng = np.random.default_rng(3)
    lacks, left = [], []
    for q in rng.uniform(-3.0, 3.0, (20, models[0].nq)):
        before, after, real = (pin.computeGeneralizedGravity(model, data, q) for model, data in zip(models, datas, strict=True))
        lacks.append(real - before)
        left.append(real - after)
    # the mean adapter of twenty robots differs from the planted one by 0.01 / sqrt(20) of it; noise adds as much
    assert np.linalg.norm(left) < 0.02 * np.linalg.norm(lacks)


def test_the_file_is_what_its_schema_says(made):
    folder, _ = made
    schema = json.loads((ROOT / "schema" / "fleet.schema.json").read_text())
    jsonschema.validate(json.loads((folder / "out" / "fleet.json").read_text()), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"schema": 1}, schema)


@pytest.mark.long
def test_the_same_bytes_on_one_thread(made, tmp_path):
    folder, _ = made
    files = sorted(str(path.relative_to(folder)) for path in folder.glob("st/unit0[1-4]/*.arrow"))
    outputs = []
    for threads in (1, 2):
        output = tmp_path / str(threads)
        study().call(folder, program("twincal"), "fleet", *files, "--threads", threads, "-o", output)
        outputs.append((output / "fleet.json").read_bytes())
    assert outputs[0] == outputs[1]

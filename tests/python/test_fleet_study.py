"""The study of fleets in short: sizes against simulated noise, planted deviations, the judge against a hand-made fleet.json.

The whole study is `studies/fleet/run`. Seeds are fixed: those of the study's tables and of development are others.
"""

import importlib.util
import sys

import numpy as np
import pytest
from conftest import ROOT

FOLDER = ROOT / "studies" / "fleet"
sys.path.append(str(FOLDER))
sys.path.append(str(ROOT / "studies" / "worlds"))

import fleets  # noqa: E402
from oracle import THIN, body_columns, friction_columns, low_pass  # noqa: E402
from shared import colored  # noqa: E402
from sizes import zero_columns  # noqa: E402

SEED = 1801


def module(name):
    """A module of the study; `studies/worlds` has others of the same name."""
    spec = importlib.util.spec_from_file_location(f"fleet_{name}", FOLDER / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


judge, table = module("judge"), module("table")


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    """Truth of a fleet of five, of which one has more Coulomb friction on a joint from the third of four windows on."""
    fleet = fleets.Fleet(units=5, windows=4, seconds=10.0, seed=SEED)
    return fleets.make(fleet, tmp_path_factory.mktemp("fleet"))


def planted(truth):
    """The unit that deviates."""
    return next(unit for unit in truth["units"] if unit["deviations"])


def said(truth):
    """A fleet.json without an error."""
    unit = planted(truth)
    one = unit["deviations"][0]
    parameter = lambda value: {"name": "mass", "value": value, "unit": "", "interval95": [value - 0.1, value + 0.1]}
    effect = lambda name, value: {"effect": name, "family": name.rpartition(".")[2], "pip": 1.0, "parameters": [parameter(value)]}
    start = lambda window: (fleets.FIRST + window * fleets.WEEK).isoformat().replace("+00:00", "Z")
    deviation = effect(one["effect"], one["size"]) | {"since": start(2)}
    robots = [{"robot": other["robot"], "deviates": False, "pip": 0.02, "deviations": []} for other in truth["units"]]
    robots[truth["units"].index(unit)] |= {"deviates": True, "pip": 1.0, "deviations": [deviation]}
    return {"windows": [{"start": start(window)} for window in range(4)], "units": robots, "left_out": [],
            "type_effects": [effect(cause["exact"][0], cause["size"]) for cause in truth["type"]]}  # fmt: skip


def test_sizes_are_standard_errors():
    """The spread of a least squares over 400 draws of noise, within 15 %: four standard deviations of a spread of 400."""
    fleet = fleets.Fleet(units=5, windows=3, seed=SEED)
    unit = fleets.Unit(fleet, 1)
    path, model, recorder, sd = unit.path(2, fleet.seconds), unit.model, fleet.recorder, unit.type.noise_sd
    rows = lambda part: (low_pass(part, recorder.rate)[::THIN] / sd[:, None]).reshape(-1, part.shape[2])
    columns = rows(np.concatenate([friction_columns(path.qd), body_columns(model, 5, path, 1), zero_columns(model, path)], axis=2))
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    joint = 2
    estimate = np.linalg.pinv(columns / scale, rcond=1e-9)[len(sd) + joint] / scale[len(sd) + joint]
    rng, found = np.random.default_rng(SEED), []
    for _ in range(400):
        noise = rng.normal(size=path.q.shape) + colored(rng, path.q.shape, recorder.rate, recorder.noise_time)
        found.append(estimate @ rows((sd * 0.5**0.5 * noise)[:, :, None])[:, 0])
    assert np.std(found) == pytest.approx(unit.window_errors("drag", joint)[0], rel=0.15)


@pytest.mark.parametrize("kind", fleets.DEVIATIONS)
def test_a_deviation_begins_with_its_window(kind):
    """Before it the unit is as delivered; from it on its torque differs by what the judge takes for the planted torque."""
    fleet = fleets.Fleet(units=5, windows=4, seconds=10.0, seed=SEED + fleets.DEVIATIONS.index(kind))
    turn = fleets.deviating(fleet)
    unit = fleets.Unit(fleet, fleet.names.index(next(iter(turn))) + 1)
    path = unit.path(2, fleet.seconds)
    at = lambda window: fleets.torque(*unit.state(window), path)
    assert np.array_equal(at(0), at(1))
    assert np.array_equal(at(2), at(3))
    stand_ins = judge.StandIns(fleet, unit.name)
    one = unit.deviations[0]
    assert abs(one["size"]) == pytest.approx(6.0 * np.median(unit.window_errors(one["kind"], one["joint"])))
    assert np.allclose((at(2) - at(0))[:: judge.THIN], stand_ins.planted(one), atol=1e-9)
    assert stand_ins.describes(one, one["effect"], one["family"]) > 0.98


def test_a_fleet_without_an_error(truth):
    found = judge.judged(truth, said(truth))
    assert found["type"] == {"true": 13, "found": 13, "missed": [], "false": [], "inside": 13, "intervals": 13}
    (unit,) = found["robots"]
    assert unit["named"] and [effect["judged"] for effect in unit["effects"]] == ["right"]
    (one,) = unit["planted"]
    assert one["found"] and one["covers"] and one["onset_off"] == 0


def test_every_kind_of_error(truth):
    """Each error alone, in a fleet.json that is right in all else."""
    unit = planted(truth)
    where = truth["units"].index(unit)

    def robots(change):
        report = said(truth)
        change(report)
        return judge.judged(truth, report)

    def named_without_reason(report):
        report["units"][where - 1] |= {"deviates": True, "pip": 0.99, "deviations": report["units"][where]["deviations"]}

    rows = robots(named_without_reason)["robots"]
    assert [row["deviates"] for row in rows].count(False) == 1
    missed = robots(lambda report: report["units"][where].update(deviates=False))["robots"]
    assert not missed[0]["named"] and not missed[0]["planted"][0]["found"]
    early = robots(lambda report: report["units"][where]["deviations"][0].update(since=None))["robots"]
    assert early[0]["planted"][0]["onset_off"] == -2
    narrow = robots(lambda report: report["units"][where]["deviations"][0]["parameters"][0].update(interval95=[7.0, 8.0]))["robots"]
    assert narrow[0]["planted"][0]["covers"] is False
    other = robots(lambda report: report["units"][where]["deviations"][0].update(effect="wrist_3_joint.gain", family="gain"))["robots"]
    assert other[0]["effects"][0]["judged"] == "wrong" and not other[0]["planted"][0]["found"]
    extra = {"effect": "base.tilt", "family": "tilt", "pip": 0.6, "parameters": []}
    assert robots(lambda report: report["type_effects"].append(extra))["type"]["false"] == ["base.tilt"]
    unsure = robots(lambda report: report["type_effects"][0].update(pip=0.98))["type"]
    assert unsure["missed"] == ["payload"] and unsure["found"] == 12
    assert robots(lambda report: report["units"].pop(where))["absent"] == [unit["robot"]]


def test_a_gripper_is_any_level_of_the_flange(truth):
    """`payload` and levels of the links at the last joint are the mass; a link before it is not."""
    mass = {"kind": "mass", "effect": "payload"}
    assert judge.matches(mass, "payload", truth)
    assert judge.matches(mass, "wrist_3_link.mass_moments", truth)
    assert not judge.matches(mass, "wrist_2_link.mass_moments", truth)


def test_limits_leave_two_binomial_deviations():
    """0.95 - 2 sqrt(0.95 0.05 / 60) = 0.894: 54 of 60 pass, 53 do not."""
    assert table.at_least(54, 60, 0.95)[1]
    assert not table.at_least(53, 60, 0.95)[1]
    assert table.at_most(6, 60, 0.05)[1]
    assert not table.at_most(7, 60, 0.05)[1]
    assert table.at_least(0, 0, 0.95) == ("–", None)

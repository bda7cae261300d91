"""Package and program are one code: the same files give the same bytes."""

from __future__ import annotations

import json

import numpy as np
import pytest
import twincal
from conftest import run

FIT = ["run1.csv", "run2.csv", "--model", "arm.urdf", "--heldout", "run3.csv", "--no-config"]


@pytest.fixture(scope="module")
def folder(arm):
    """The folder that the program writes."""
    place = arm.folder / "by_program"
    done = run("fit", *FIT, "--seed", 7, "-o", place, "-q", cwd=arm.folder)
    assert done.returncode in (0, 3), done.stderr
    return place


def test_result_json_of_the_same_files(arm, folder, monkeypatch):
    monkeypatch.chdir(arm.folder)
    robot = twincal.Robot.from_urdf("arm.urdf")
    logs = [twincal.Log.read("run1.csv"), twincal.Log.read("run2.csv")]
    result = twincal.fit(robot, logs, heldout=twincal.Log.read("run3.csv"), seed=7)
    result.save("by_package")
    own = (arm.folder / "by_package/result.json").read_bytes()
    assert own == (folder / "result.json").read_bytes()
    twin = (arm.folder / "by_package/twin.json").read_bytes()
    assert twin == (folder / "twin.json").read_bytes()
    assert run("check", "run3.csv", "--twin", "by_package", cwd=arm.folder).returncode in (0, 3)


def test_a_folder_of_the_program_is_read_and_written_back(arm, folder):
    result = twincal.Calibration.load(folder)
    copy = arm.folder / "copy"
    result.save(copy)
    for name in ("result.json", "twin.json", "report.html", "model.urdf"):
        assert (copy / name).read_bytes() == (folder / name).read_bytes(), name
    with pytest.raises(twincal.Error):
        result.save(copy)
    result.save(copy, force=True)


def test_effects_are_those_of_the_csv(arm, folder):
    done = run("export", "--twin", folder, "--to", "csv")
    lines = done.stdout.decode().splitlines()
    effects = twincal.Calibration.load(folder).effects
    assert len(effects) == len(lines) - 1
    assert effects["component"] == [line.split(",")[0] for line in lines[1:]]


def test_arrays_and_tables_give_the_numbers_of_files(arm, robot):
    file = twincal.fit(robot, twincal.Log.read(arm.folder / "run1.csv"), families=["viscous"])
    arrays = twincal.fit(robot, arm.log("run1"), families=["viscous"])
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(arm.folder / "run1.csv", float_precision="round_trip")
    table = twincal.fit(robot, twincal.Log.from_dataframe(frame), families=["viscous"])
    for other in (arrays, table):
        for column in ("mean", "sd", "pip"):
            assert np.array_equal(other.terms[column], file.terms[column], equal_nan=True)


def test_names_decide_whose_columns_they_are(arm, robot):
    time, q, qd, qdd, tau = arm.runs["run1"]
    turned = [x[:, ::-1] for x in (q, tau, qd, qdd)]
    log = twincal.Log(time, *turned, names=["elbow", "shoulder"], name="run1")
    one, other = (
        twincal.fit(robot, own, families=["viscous"]) for own in (arm.log("run1"), log)
    )
    assert np.array_equal(one.terms["mean"], other.terms["mean"], equal_nan=True)


def test_settings_are_those_of_the_config(arm, robot):
    config = arm.folder / "own.toml"
    config.write_text('[signal]\ncutoff_hz = 0\n[library]\ngeneric = false\nfamilies = ["viscous"]\n')
    place = arm.folder / "configured"
    files = ["run1.csv", "--model", "arm.urdf", "--config", "own.toml", "-q"]
    assert run("fit", *files, "-o", place, cwd=arm.folder).returncode in (0, 3)
    log = twincal.Log.read(arm.folder / "run1.csv")
    own = twincal.fit(robot, log, cutoff_hz=0, generic=False, families=["viscous"])
    theirs = json.loads((place / "result.json").read_text())
    ours = json.loads(own.to_json())
    for key in ("terms", "components", "noise", "validation", "prior"):
        assert ours[key] == theirs[key], key


def test_statistics_merged_give_the_program_s_fit(arm, robot):
    names = ("run1", "run2")
    plan = twincal.Statistics.plan(robot, [arm.log(name) for name in names])
    one, other = (twincal.Statistics.map(robot, arm.log(name), plan) for name in names)
    sum_ = one.merge(other)
    assert sorted(sum_.log_names) == ["run1", "run2"]
    heldout = arm.log("run3")
    forward, backward = (s.fit(heldout=heldout) for s in (sum_, other.merge(one)))
    assert np.array_equal(forward.terms["mean"], backward.terms["mean"], equal_nan=True)
    place = arm.folder / "sum.arrow"
    sum_.write(place)
    done = run("fit", "--statistics", place, "-o", arm.folder / "of_sum", "-q", "--no-config")
    assert done.returncode in (0, 3), done.stderr
    program = twincal.Calibration.load(arm.folder / "of_sum")
    assert np.array_equal(program.terms["mean"], forward.terms["mean"], equal_nan=True)
    with pytest.raises(twincal.Error) as refused:
        sum_.merge(one)
    assert refused.value.remedy

"""Logs are read alike by `fit`, `check` and `predict_log`, and alike from files and data frames."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import twincal
from conftest import SETTINGS


@pytest.fixture(scope="module")
def twin(arm, robot):
    """A fit that was given no payload."""
    return twincal.fit(robot, arm.log("run1"), heldout=arm.log("run2"), **SETTINGS)


def renamed(arm, name: str):
    """A run whose columns have names that only `columns` explains."""
    time, q, qd, qdd, tau = arm.runs["run3"]
    place = arm.folder / f"{name}.csv"
    header = "clock,a,b,va,vb,aa,ab,ta,tb"
    table = np.column_stack([time, q, qd, qdd, tau])
    np.savetxt(place, table, delimiter=",", header=header, comments="", fmt="%.17g")
    channels = {"q": "ab", "qd": ["va", "vb"], "qdd": ["aa", "ab"], "tau": ["ta", "tb"]}
    columns = {key: dict(zip(["shoulder", "elbow"], own)) for key, own in channels.items()}
    return place, columns | {"time": "clock"}


@pytest.mark.parametrize("source", ["file", "arrays"])
def test_a_payload_changes_the_prediction(arm, twin, source):
    """2 kg in the frame of the last link, at its origin: gravity alone needs more torque of the shoulder."""
    payload = {"mass": 2.0, "com": [0.0, 0.0, 0.0]}
    time, q, qd, qdd, tau = arm.runs["run3"]
    if source == "file":
        empty, loaded = (
            twincal.Log.read(arm.folder / "run3.csv", payload=own) for own in (None, payload)
        )
    else:
        empty, loaded = (
            twincal.Log(time, q, tau, qd, qdd, payload=own) for own in (None, payload)
        )
    added = twin.predict_log(loaded).mean - twin.predict_log(empty).mean
    assert np.sqrt((added[:, 0] ** 2).mean()) > 1.0
    errors = [
        max(gate["value"] for gate in twin.check(own)["gates"] if gate["gate"] == "rmse")
        for own in (empty, loaded)
    ]
    assert errors[1] > 2.0 * errors[0]


def test_renamed_columns(arm, twin):
    place, columns = renamed(arm, "renamed")
    with pytest.raises(twincal.Error):
        twin.check(twincal.Log.read(place))
    named = twincal.Log.read(place, columns=columns)
    plain = twincal.Log.read(arm.folder / "run3.csv")
    assert np.array_equal(twin.predict_log(named).mean, twin.predict_log(plain).mean)
    values = [[gate["value"] for gate in twin.check(own)["gates"]] for own in (named, plain)]
    assert values[0] == values[1]


@pytest.mark.parametrize("name", ["-x.csv", "--json", "-"])
def test_a_path_is_no_option(arm, twin, name, monkeypatch):
    (arm.folder / name).write_bytes((arm.folder / "run3.csv").read_bytes())
    monkeypatch.chdir(arm.folder)
    own, plain = (twin.predict_log(twincal.Log.read(path)).mean for path in (name, "run3.csv"))
    assert np.array_equal(own, plain)
    assert "gates" in twin.check(twincal.Log.read(name))


def test_settings_of_the_working_folder_are_not_read(arm, twin, tmp_path, monkeypatch):
    log = twincal.Log.read(arm.folder / "run3.csv")
    time = twin.predict_log(log).time
    (tmp_path / "twincal.toml").write_text("[log]\nrate_hz = 10.0\n")
    monkeypatch.chdir(tmp_path)
    assert np.array_equal(twin.predict_log(log).time, time)


def frames(arm):
    """The first run with one column of another type, by name of the type."""
    pyarrow = pytest.importorskip("pyarrow")
    compute = pytest.importorskip("pyarrow.compute")
    time, q, qd, qdd, tau = (x[:2000] for x in arm.runs["run1"])
    names = ["t", "q1", "q2", "qd1", "qd2", "tau1", "tau2"]
    table = pyarrow.table(dict(zip(names, [time, *q.T, *qd.T, *tau.T])))
    ticks = np.round(1e9 * time).astype("i8")
    rounded = np.round(10.0 * qd[:, 0])
    own = {f"qd1 as {kind}": ("qd1", rounded.astype(kind)) for kind in ("i1", "i2", "i4", "i8")}
    for kind in ("u1", "u2", "u4", "u8"):
        own[f"qd1 as {kind}"] = ("qd1", np.abs(rounded).astype(kind))
    own["tau1 as f2"] = ("tau1", tau[:, 0].astype("f2"))
    own["tau1 as f4"] = ("tau1", tau[:, 0].astype("f4"))
    decimal = compute.cast(pyarrow.array(np.round(tau[:, 0], 3)), pyarrow.decimal128(12, 3))
    own["tau1 as decimal"] = ("tau1", decimal)
    for unit, divisor in [("ms", 10**6), ("us", 10**3), ("ns", 1)]:
        stamps = pyarrow.array(ticks // divisor).cast(pyarrow.timestamp(unit))
        own[f"t in {unit}"] = ("t", stamps)
    known = (np.arange(2000) < 900) | (np.arange(2000) > 920)
    holes = pyarrow.array(np.where(known, tau[:, 0], None), pyarrow.float64())
    own["tau1 with nulls"] = ("tau1", holes)
    for label, (name, values) in own.items():
        yield label, table.set_column(names.index(name), name, pyarrow.array(values))


def test_a_frame_is_read_as_the_same_table_in_a_file(arm, robot, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    for number, (label, table) in enumerate(frames(arm)):
        place = tmp_path / f"{number}.parquet"
        parquet.write_table(table, place)
        logs = twincal.Log.read(place), twincal.Log.from_dataframe(table)
        fits = [twincal.fit(robot, log, **SETTINGS) for log in logs]
        terms = [own.terms["mean"] for own in fits]
        assert np.array_equal(*terms, equal_nan=True), label
        codes = [sorted(set(own.findings["code"])) for own in fits]
        assert codes[0] == codes[1], label
        again = pickle.loads(pickle.dumps(logs[1]))
        assert np.array_equal(twincal.fit(robot, again, **SETTINGS).terms["mean"], terms[0], equal_nan=True)


def test_a_channel_that_is_no_number_is_refused_and_other_columns_are_passed_over(arm, robot):
    pyarrow = pytest.importorskip("pyarrow")
    _, table = next(frames(arm))
    text = pyarrow.array(["x"] * len(table))
    truth = pyarrow.array([True] * len(table))
    beside = table.append_column("note", text)
    fits = [twincal.fit(robot, twincal.Log.from_dataframe(own), **SETTINGS) for own in (table, beside)]
    assert np.array_equal(*(own.terms["mean"] for own in fits), equal_nan=True)
    for values, says in [(text, "text"), (truth, "Boolean"), (text.dictionary_encode(), "dictionary")]:
        log = twincal.Log.from_dataframe(table.set_column(3, "qd1", values))
        for own in (log, pickle.loads(pickle.dumps(log))):
            with pytest.raises(twincal.errors.ContentError, match=f"qd1.*{says}"):
                twincal.fit(robot, own, **SETTINGS)
    with pytest.raises(twincal.errors.ContentError, match="qd1"):
        fits[0].predict_log(log)

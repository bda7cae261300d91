"""`twincal.fleet.fit` gives what `twincal fleet` writes; a small fleet of a planar arm with one robot that changed."""

import json

import numpy as np
import pandas
import pytest
import twincal
from twincal import fleet

MONDAY = 1_767_571_200
WEEK = 7 * 86_400
UNITS, WEEKS = 5, 3


@pytest.fixture(scope="module")
def made(tmp_path_factory, arm):
    """Statistics of five arms over three weeks; `unit4` has more Coulomb friction from the second week on."""
    folder = tmp_path_factory.mktemp("fleet")
    robot = twincal.Robot.from_urdf(arm.model)
    names = robot.joint_names
    for unit in range(UNITS):
        (folder / "logs" / f"unit{unit}").mkdir(parents=True)
        for week in range(WEEKS):
            rng = np.random.default_rng([unit, week])
            time = np.arange(1500) / 100.0
            w = 2 * np.pi * 0.1 * np.arange(1, 6)
            a, b = rng.normal(size=(2, len(names), 5)) / 2.5
            s, c = np.sin(np.outer(time, w)), np.cos(np.outer(time, w))
            q, qd, qdd = s @ a.T + c @ b.T, (c * w) @ a.T - (s * w) @ b.T, -(s * w**2) @ a.T - (c * w**2) @ b.T
            drag = np.full(len(names), 1.0 + 0.02 * unit)
            drag[0] += 1.0 * (unit == 4 and week > 0)
            tau = robot.inverse_dynamics(q, qd, qdd) + drag * np.tanh(qd / 0.01) + 0.1 * rng.normal(size=q.shape)
            start = MONDAY + week * WEEK + 3600 * (8 + unit)
            columns = {"t": ((start + time) * 1e9).astype("datetime64[ns]")}
            for j, name in enumerate(names):
                columns |= {f"{name}.q": q[:, j], f"{name}.qd": qd[:, j], f"{name}.tau": tau[:, j]}
            pandas.DataFrame(columns).to_parquet(folder / "logs" / f"unit{unit}" / f"week{week}.parquet")
    config = folder / "plan.toml"
    config.write_text('[library]\nfamilies = ["viscous", "coulomb", "payload", "offset"]\n')
    some = [folder / "logs" / "unit0" / f"week{week}.parquet" for week in range(WEEKS)]
    plan = fleet.plan(some, arm.model, folder / "plan", config=config)
    files = fleet.statistics(folder / "logs", arm.model, plan, output=folder / "st", workers=2)
    assert not files.faults
    return folder, sorted((folder / "st").rglob("*.arrow"))


def test_the_robot_that_changed_is_named_with_its_window(made):
    folder, files = made
    result = fleet.fit(files, folder / "out")
    assert result.deviating == ["unit4"]
    own = result.units[0]["deviations"][0]
    assert own["family"] == "coulomb" and own["since"] == "2026-01-12T00:00:00Z"
    low, high = own["parameters"][0]["interval95"]
    assert low < 1.0 < high
    assert json.loads((folder / "out" / "fleet.json").read_text())["units"] == result.units
    assert "<script" not in result.report.read_text()
    assert result.corrected_model == folder / "out" / "type.urdf" and result.corrected_model.exists()
    frame = result.to_pandas()
    assert set(frame["robot"]) == {f"unit{unit}" for unit in range(UNITS)}
    assert frame.loc[frame["deviates"], "since"].iloc[0] == pandas.Timestamp("2026-01-12", tz="UTC")
    assert "1 deviate" in repr(result)


def test_bad_arguments_are_errors(made, tmp_path):
    folder, files = made
    with pytest.raises(TypeError, match="list of paths"):
        fleet.fit(files[0], tmp_path / "out")
    with pytest.raises(ValueError, match="empty"):
        fleet.fit([], tmp_path / "out")
    with pytest.raises(TypeError, match="list of paths"):
        fleet.plan("run.csv", "arm.urdf", tmp_path / "plan")
    with pytest.raises(twincal.Error, match="arm.urdf"):
        fleet.plan(["run.csv"], tmp_path / "arm.urdf", tmp_path / "plan")
    with pytest.raises(twincal.Error, match="robots with the same model"):
        fleet.fit(files[:2], tmp_path / "out")
    with pytest.raises(twincal.Error, match="no length of time"):
        fleet.fit(files, tmp_path / "out", window="soon")
    with pytest.raises(twincal.Error, match="between 0 and 1"):
        fleet.fit(files, tmp_path / "out", fdr=2.0)
    assert not (tmp_path / "out").exists()


def test_twins_predict_torque_of_their_robot(made, arm):
    """Coulomb friction of the first joint is 1 + 0.02 × number, of `unit4` another 1 N·m since the second week."""
    folder, files = made
    paths = {"unit4": folder / "twin4", "unit1": folder / "twin1"}
    result = fleet.fit(files, folder / "with-twins", type_twin=folder / "type", twins=paths)
    assert result.units == fleet.Fleet(folder / "out").units
    robot = twincal.Robot.from_urdf(arm.model)
    n = len(robot.joint_names)
    q, qd, qdd = np.zeros((1, n)), np.full((1, n), 0.8), np.zeros((1, n))
    of_model = robot.inverse_dynamics(q, qd, qdd)[0, 0]
    for path, friction in [(paths["unit4"], 2.08), (paths["unit1"], 1.02), (folder / "type", 1.04)]:
        twin = twincal.Calibration.load(path)
        torque = twin.predict(q, qd, qdd)
        assert abs(torque.mean[0, 0] - of_model - friction) < 0.1, (path, torque.mean, of_model)
        assert torque.low[0, 0] < of_model + friction < torque.high[0, 0]
    with pytest.raises(twincal.Error, match="nobody"):
        fleet.fit(files, folder / "none", twins={"nobody": folder / "nobody"})
    assert not (folder / "nobody").exists() and not (folder / "none").exists()

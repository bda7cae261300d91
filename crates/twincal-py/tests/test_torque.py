"""Torque and regressors against Pinocchio, predictions against the program."""

from __future__ import annotations

import numpy as np
import pytest
import twincal
from conftest import SETTINGS, run, torque

pinocchio = pytest.importorskip("pinocchio")


@pytest.fixture(scope="module")
def states():
    return np.random.default_rng(1).uniform(-2.0, 2.0, (3, 5000, 2))


def test_inverse_dynamics_is_pinocchio_s(robot, states):
    expected = torque(1.0, *states)
    assert np.abs(robot.inverse_dynamics(*states) - expected).max() < 1e-11
    one = robot.inverse_dynamics(*states[:, 7])
    assert one.shape == (2,) and np.abs(one - expected[7]).max() < 1e-11
    box = states.reshape(3, 10, 500, 2)
    assert np.array_equal(robot.inverse_dynamics(*box).reshape(-1, 2), robot.inverse_dynamics(*states))
    assert robot.inverse_dynamics(*states[:, :0]).shape == (0, 2)


def test_regressor_is_linear_in_the_parameters(robot, arm, states):
    regressor = robot.regressor(*states)
    assert regressor.shape == (5000, 2, 2, 10)
    tau = np.einsum("sjbp,bp->sj", regressor, robot.parameters)
    assert np.abs(tau - torque(1.0, *states)).max() < 1e-11


def test_regressor_is_pinocchio_s(robot, arm, states):
    model = pinocchio.buildModelFromUrdf(str(arm.model))
    data = model.createData()
    # Pinocchio has Iyy before Ixz
    order = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
    for state in range(20):
        own = robot.regressor(*states[:, state])[..., order].reshape(2, 20)
        theirs = pinocchio.computeJointTorqueRegressor(model, data, *states[:, state])
        assert np.abs(own - theirs).max() < 1e-11


def test_views_and_other_numbers(robot, states):
    expected = robot.inverse_dynamics(*states)
    turned = [np.asfortranarray(x) for x in states]
    assert np.array_equal(robot.inverse_dynamics(*turned), expected)
    for x in turned:
        x.flags.writeable = False
    assert np.array_equal(robot.inverse_dynamics(*turned), expected)
    assert np.array_equal(robot.inverse_dynamics(*states[:, ::2]), expected[::2])
    whole = np.ones((4, 2), dtype=np.int32)
    assert np.array_equal(
        robot.inverse_dynamics(whole, whole, whole), robot.inverse_dynamics(*np.ones((3, 4, 2)))
    )
    assert np.isnan(robot.inverse_dynamics([np.nan, 0.0], [0.0, 0.0], [0.0, 0.0])).any()


def test_models_of_mujoco(arm):
    mujoco = pytest.importorskip("mujoco")
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body name="link"><joint name="hinge" axis="0 1 0"/>'
        '<inertial mass="2" pos="0.3 0 0" diaginertia="0.1 0.1 0.1"/></body></worldbody></mujoco>'
    )
    robot = twincal.Robot.from_mjspec(spec)
    # τ = −m g d cos q about y, with gravity along −z
    assert robot.inverse_dynamics([0.4], [0.0], [0.0])[0] == pytest.approx(
        -2.0 * 9.81 * 0.3 * np.cos(0.4), abs=1e-9
    )
    place = arm.folder / "hinge.xml"
    place.write_text(spec.to_xml())
    assert twincal.Robot.from_mjcf(place).joint_names == ["hinge"]
    with pytest.raises(TypeError):
        twincal.Robot.from_mjspec("hinge.xml")


def test_predictions_are_the_program_s(arm, robot):
    log = twincal.Log.read(arm.folder / "run1.csv")
    result = twincal.fit(robot, log, cutoff_hz=0, families=["payload", "viscous"], generic=False)
    result.save(arm.folder / "unfiltered")
    out = arm.folder / "torque.csv"
    csv = arm.folder / "run3.csv"
    done = run("predict", csv, "--twin", arm.folder / "unfiltered", "-o", out, cwd=arm.folder)
    assert done.returncode in (0, 3), done.stderr
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="", dtype=None)
    _, q, qd, qdd, _ = arm.runs["run3"]
    own = result.predict(q, qd, qdd)
    assert own.mean.shape == q.shape == own.low.shape == own.outside.shape
    for joint, name in enumerate(robot.joint_names):
        for column, values in (("tau", own.mean), ("tau_low95", own.low), ("tau_high95", own.high)):
            theirs = table[f"{name}.{column}"]
            assert np.abs(values[:, joint] - theirs).max() < 1e-9 * (1 + np.abs(theirs).max())
    inside = (own.low < arm.runs["run3"][4]) & (arm.runs["run3"][4] < own.high)
    assert inside.mean() > 0.9


def test_what_was_planted_is_found(result):
    effects = result.effects.to_dict()
    rows = list(zip(effects["component"], effects["parameter"]))
    mass = rows.index(("payload", "mass"))
    assert effects["status"][mass] == "established"
    viscous = rows.index(("elbow.viscous", effects["parameter"][[n for n, _ in rows].index("elbow.viscous")]))
    assert effects["low95"][viscous] < 0.4 < effects["high95"][viscous]
    assert result.assessment.answer and result.assessment.headline


def test_draws_have_the_moments_of_the_terms(result):
    draws = result.draws(20_000, seed=3)
    terms = result.terms.to_dict()
    live = ~np.isnan(terms["pip"])
    names = [name for name, own in zip(terms["term"], live) if own]
    assert draws.terms == names
    error = draws.coefficients.mean(axis=0) - terms["mean"][live]
    # 20 000 draws: 5 standard errors, beyond which one of 20 terms falls with probability 1e-5
    assert np.all(np.abs(error) <= 5.0 * terms["sd"][live] / np.sqrt(20_000) + 1e-12)
    assert np.abs(draws.included.mean(axis=0) - terms["pip"][live]).max() < 0.02
    again = result.draws(20_000, seed=3)
    assert np.array_equal(draws.coefficients, again.coefficients)


def test_torque_of_a_log_is_the_program_s(arm, result, tmp_path):
    time, q, qd, qdd, tau = arm.runs["run3"]
    result.save(tmp_path / "twin")
    done = run("predict", arm.folder / "run3.csv", "--twin", tmp_path / "twin", cwd=tmp_path)
    theirs = [line.split(",") for line in done.stdout.decode().splitlines()[1:]]
    for log in (twincal.Log.read(arm.folder / "run3.csv"), arm.log("run3")):
        own = result.predict_log(log)
        assert len(own.time) == len(theirs) and own.mean.shape == (len(theirs), 2)
        for column, of in ((3, own.mean[:, 0]), (5, own.high[:, 0]), (9, own.low[:, 1])):
            assert np.array_equal([float(row[column]) for row in theirs], of)
        error = np.sqrt(np.mean((own.measured - own.mean) ** 2))
        assert error < 0.05 < np.sqrt(np.mean((own.measured - own.nominal) ** 2))
    # positions alone: the same up to what differentiating them costs
    alone = result.predict_log(twincal.Log(time, q, name="alone"))
    assert np.isnan(alone.measured).all()
    near = np.interp(alone.time, own.time, own.mean[:, 1])
    assert np.sqrt(np.mean((alone.mean[:, 1] - near) ** 2)) < 0.05


def test_torque_of_a_log_where_a_joint_s_name_has_two_lines(arm, tmp_path):
    model = tmp_path / "lines.urdf"
    model.write_text(arm.model.read_text().replace('"elbow"', '"el&#10;bow"'))
    robot = twincal.Robot.from_urdf(model)
    assert "\n" in robot.joint_names[1]
    result = twincal.fit(robot, arm.log("run1"), **SETTINGS)
    own = result.predict_log(arm.log("run3"))
    assert own.mean.shape == (len(own.time), 2) and np.isfinite(own.mean).all()
    assert own.time[0] < 1.0

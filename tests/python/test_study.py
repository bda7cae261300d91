"""The carried logs are what the script makes, and what the script makes is what truth.json says."""

from dataclasses import replace

import arm
import candidates
import numpy as np
import pinocchio
import pyarrow.parquet
import pytest
import simulate
from conftest import ASSETS


def unexplained(log, truth, nominal=arm.NOMINAL):
    """tau - tau_nom - Phi beta_true: what no candidate may explain, N x 2."""
    rest = log.tau - arm.inverse_dynamics(arm.mujoco_model(nominal), log.q, log.qd, log.qdd)
    for name, beta in truth["terms"].items():
        joint, dot, kind = name.partition(".")
        if dot:
            column = candidates.friction_column(kind, arm.JOINTS.index(joint), log.qd, truth["coulomb_velocity"])
        else:
            column = candidates.column(name, log.q, log.qd, log.qdd)
        rest = rest - beta * column
    return rest


def test_carried_logs_are_what_the_script_makes(study):
    for log in study.logs:
        table = pyarrow.parquet.read_table(ASSETS / f"{log.name}.parquet")
        assert table.column_names == list(log.columns())
        for name, values in log.columns().items():
            scale = np.sqrt(np.mean(values**2))
            np.testing.assert_allclose(table[name], values, rtol=1e-9, atol=1e-9 * scale, err_msg=f"{log.name} {name}")


def test_carried_truth_is_what_the_script_makes(study, carried):
    assert carried["joints"] == study.truth["joints"]
    for part in ("terms", "motor_inertia"):
        assert carried[part] == pytest.approx(study.truth[part], rel=1e-12)
    assert carried["coulomb_velocity"] == study.truth["coulomb_velocity"]


def test_residual_minus_truth_is_exactly_the_noise(study, carried):
    for log in study.logs:
        assert np.abs(unexplained(log, carried) - log.noise).max() <= 1e-9
        # and no coefficient is idle: without its largest part the rest is far from noise
        wrong = carried | {"terms": carried["terms"] | {"qd2^2*cos(q2)": 0.0}}
        assert np.abs(unexplained(log, wrong) - log.noise).max() > 1e-2


def test_the_same_for_a_world_that_uses_every_term():
    links = (arm.Link(2.8, (0.19, 0, 0.02), (0.1, 0.05, 0.06)), arm.Link(1.9, (0.16, 0.01, -0.03), (0.1, 0.08, 0.03)))
    real = replace(arm.REAL, links=links, payload_at=(0.3, 0.02, 0.04), gravity=(0.3, 0.2, -9.7))
    hidden = {"q2^2": -1.0, "q1^2": -0.5, "qd1*qd2*sin(q2)": 0.02, "sin(2*q2)": 0.3, "qd1^2*cos(q2)": 0.01}
    study = simulate.simulate(
        real=real, hidden=hidden, duration=2.0, rate_hz=500.0, train=1, heldout=1, coulomb_velocity=0.0, noise_time=0.05
    )
    for log in study.logs:
        assert np.abs(unexplained(log, study.truth) - log.noise).max() <= 1e-9


def test_motor_inertia_convention(carried):
    """D(qd1^2) = 2 qdd1 on joint 1 and nothing else, so the motor inertia that is its alias is twice beta."""
    q, qd, qdd = np.random.default_rng(5).standard_normal((3, 9, 2))
    for j, joint in enumerate(carried["joints"]):
        column = candidates.column(f"qd{j + 1}^2", q, qd, qdd)
        np.testing.assert_allclose(column[:, j], 2 * qdd[:, j])
        assert not column[:, 1 - j].any()
        assert carried["motor_inertia"][f"{joint}.motor_inertia"] == 2 * carried["terms"][f"qd{j + 1}^2"]


def test_urdf_and_mjcf_are_the_same_arm(study):
    """Pinocchio on arm.urdf against MuJoCo on arm.xml."""
    model = pinocchio.buildModelFromUrdf(str(ASSETS / "arm.urdf"))
    columns = [model.joints[model.getJointId(name)].idx_v for name in arm.JOINTS]
    assert columns == [0, 1]
    data = model.createData()
    log = study.logs[0]
    # continuous joints are (cos, sin) in Pinocchio
    angles = np.stack([np.cos(log.q), np.sin(log.q)], axis=2).reshape(len(log.q), 4)
    mine = [pinocchio.rnea(model, data, *row) for row in zip(angles, log.qd, log.qdd)]
    theirs = arm.inverse_dynamics(arm.mujoco_model(arm.NOMINAL), log.q, log.qd, log.qdd)
    np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-12)


def test_noise_has_the_stated_distribution():
    """White and AR(1) noise: sd and lag-1 correlation within 5 standard errors (false alarm 1e-6 each)."""
    settings = simulate.Settings(rate_hz=1000.0, noise_time=0.02)
    n = 40_000
    rng = np.random.default_rng(3)
    for tau, rho in ((0.0, 0.0), (0.02, np.exp(-0.05))):
        noise = simulate._noise(replace(settings, noise_time=tau), rng, n)
        spread = (1 + rho**2) / (1 - rho**2)  # of the sample variance, for an AR(1) process
        assert np.abs(noise.var(0) / settings.noise_sd**2 - 1).max() < 5 * np.sqrt(2 * spread / n)
        lag1 = (noise[1:] * noise[:-1]).mean(0) / noise.var(0)
        assert np.abs(lag1 - rho).max() < 5 * np.sqrt((1 - rho**2) / n) + 1e-12

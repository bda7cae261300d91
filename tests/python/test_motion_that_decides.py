"""Poor log, open effects, `twincal design`, MuJoCo, both logs: decided. Short form; `./check --full` runs studies/design/tutorial.py.

The page docs/howto/motion_that_decides.md has a payload (test_howto.py); these worlds have a base that is not level.
"""

import sys

import numpy as np
import pinocchio as pin
import pytest
from conftest import ROOT, program

sys.path.insert(0, str(ROOT / "studies" / "design"))
import tutorial  # noqa: E402

SECONDS = 6.0


@pytest.fixture(scope="module")
def world():
    """World of seed 2, whose size and noise are drawn."""
    drawn = tutorial.World.drawn("arm", 2)
    assert drawn.cause == "base.tilt"
    return drawn


def test_the_designed_motion_decides(world, tmp_path):
    """All that is open, rightly: the tilt is in, the payload is out."""
    line = tutorial.one(program("twincal"), world, tmp_path, SECONDS)
    assert {"payload", "base.tilt"} <= line["asked"].keys() and line["decided"], line


def test_the_same_motion_again_does_not(world, tmp_path):
    """So it is the motion that decides, and not the longer log."""
    line = tutorial.one(program("twincal"), world, tmp_path, SECONDS, replay=True)
    assert "base.tilt" in line["wrong"] and not line["decided"], line


def test_what_mujoco_computes_is_the_model_with_its_causes():
    """By Pinocchio: the torque at one state, friction and motor inertia included."""
    q, qd, qdd = (np.array([own]) for own in ((0.4, -0.7, 1.1, 0.6), (0.5, -0.8, 0.3, 1.2), (1.5, 2.5, -3.5, 0.5)))
    for seed in (1, 2):
        world = tutorial.World.drawn("arm", seed)
        model = pin.buildModelFromUrdf(str(world.file))
        if world.cause == "payload":
            ball = pin.Inertia(world.size, np.array(tutorial.CENTRE), 0.4 * world.size * tutorial.RADIUS**2 * np.eye(3))
            flange = model.frames[model.getFrameId("tool0")].placement
            model.inertias[4] = model.inertias[4] + flange.act(ball)
        else:
            model.gravity.linear = 9.81 * np.array([-np.sin(world.size), 0.0, -np.cos(world.size)])
        friction = np.array(world.robot.viscous) * qd[0] + np.array(world.robot.coulomb) * np.tanh(qd[0] / tutorial.REVERSAL)
        truth = pin.rnea(model, model.createData(), q[0], qd[0], qdd[0]) + np.array(world.robot.motor) * qdd[0] + friction
        assert np.allclose(world.torque(q, qd, qdd)[0], truth, rtol=1e-6, atol=1e-6)

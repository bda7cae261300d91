"""Our inverse dynamics against MuJoCo's `mj_inverse`, through a built program: model file and states in, torques out."""

import subprocess

import mujoco
import numpy as np
import pytest
from conftest import ASSETS, SHARED, program

# A tree with everything a nominal torque may hold: armature, damping, springs with a rest position, a slider, a branch,
# turned frames, full inertias, gravity that is not straight down, angles in degrees, defaults by class.
TREE = """
<mujoco model="tree">
  <compiler angle="degree" autolimits="true"/>
  <option gravity="0.7 -0.4 -9.6"/>
  <default>
    <joint damping="0.3" armature="0.02"/>
    <default class="stiff"><joint stiffness="4" springref="20" damping="0.8"/></default>
  </default>
  <worldbody>
    <body name="base" pos="0.1 0.2 0.3" euler="10 20 30">
      <joint name="yaw" type="hinge" axis="0.1 0.2 1" range="-170 170"/>
      <inertial pos="0.01 0.02 0.03" mass="4" fullinertia="0.09 0.08 0.05 0.002 -0.003 0.004"/>
      <body name="left" pos="0 0.3 0.1" quat="0.9 0.1 -0.3 0.2">
        <joint name="left_swing" class="stiff" type="hinge" axis="1 0 0" pos="0.05 0 0.02"/>
        <inertial pos="0.1 -0.05 0.02" mass="1.5" diaginertia="0.01 0.02 0.025" quat="0.8 0.2 0.1 0.1"/>
        <body name="probe" pos="0.2 0 0" euler="0 -35 0">
          <joint name="probe_slide" type="slide" axis="0 0 1" armature="0.5" stiffness="30" springref="0.1"/>
          <inertial pos="0 0 0.1" mass="0.7" diaginertia="0.004 0.004 0.001"/>
        </body>
      </body>
      <body name="right" pos="0 -0.3 0.1">
        <joint name="right_swing" type="hinge" axis="0 1 0"/>
        <inertial pos="0.1 0.05 -0.02" mass="1.2" diaginertia="0.01 0.02 0.025"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def ours(model, folder, q, qd, qdd):
    """Nominal torque by the example `nominal_torque`."""
    states = folder / "states.csv"
    n = q.shape[1]
    names = [f"{what}{j + 1}" for what in ("q", "qd", "qdd") for j in range(n)]
    np.savetxt(states, np.hstack([q, qd, qdd]), "%.17g", ",", header=",".join(names), comments="")
    command = [program("examples/nominal_torque"), str(model), str(states)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = done.stdout.splitlines()
    return np.array([[float(x) for x in row.split(",")] for row in rows[1:]])


def mujoco_inverse(model, q, qd, qdd):
    data = mujoco.MjData(model)
    out = []
    for row in zip(q, qd, qdd):
        data.qpos[:], data.qvel[:], data.qacc[:] = row
        mujoco.mj_inverse(model, data)
        out.append(data.qfrc_inverse.copy())
    return np.array(out)


def compare(file, model, folder):
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # limits, contacts, dry friction: not nominal torque
    q, qd, qdd = np.random.default_rng(11).uniform(-3, 3, (3, 500, model.nv))
    theirs = mujoco_inverse(model, q, qd, qdd * 4)
    np.testing.assert_allclose(ours(file, folder, q, qd, qdd * 4), theirs, rtol=0, atol=1e-9 * max(1.0, np.abs(theirs).max() / 100))


@pytest.mark.parametrize("file", ["arm.xml", "arm.urdf"])
def test_the_study_s_arm(file, tmp_path):
    compare(ASSETS / file, mujoco.MjModel.from_xml_path(str(ASSETS / "arm.xml")), tmp_path)


def test_a_tree_with_springs_dampers_and_a_slider(tmp_path):
    file = tmp_path / "tree.xml"
    file.write_text(TREE)
    compare(file, mujoco.MjModel.from_xml_path(str(file)), tmp_path)


@pytest.mark.parametrize("robot", ["double_pendulum", "kuka_kr300", "simple_pendulum", "ur10"])
def test_real_robots(robot, tmp_path):
    file = SHARED / robot / "model.xml"
    if not file.exists():
        pytest.skip(f"../shared/data/{robot}/model.xml is not there")
    compare(file, mujoco.MjModel.from_xml_path(str(file)), tmp_path)

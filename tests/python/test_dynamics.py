"""Inverse dynamics, regressor and base parameters against Pinocchio on every URDF of `example-robot-data`, taken as a
tree on a fixed base, and against MuJoCo's `mj_inverse` on MJCF re-exports of some of them."""

import json
import subprocess
import xml.etree.ElementTree as tree
from importlib.metadata import distribution
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from conftest import program
from test_nominal_torque import compare

PACKAGE = distribution("example-robot-data")
ROBOTS = Path(PACKAGE.locate_file("cmeel.prefix/share/example-robot-data/robots"))
SAMPLES = 1000
RANK_SAMPLES = 40
PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]

# Files that hold no dynamics: what the message must say.
REFUSED = {
    "alex_description/urdf/alex_psyonic_hands.urdf": "mimics `index_q1`, which does not exist",
    "hector_description/robots/quadrotor_base.urdf": "none of its 0 joints can move",
    "iris_description/robots/iris_simple.urdf": "none of its 5 joints can move",
    "ur_description/urdf/ur3.urdf": "has no link",  # an empty <robot>
}
# Files with frames that have a tensor and no mass, which no body has: twincal leaves the tensor out (finding `massless_frame`), Pinocchio keeps
# it. Torque of these tensors at the states of the test, N m.
IGNORED = {"bolt_description/robots/bolt.urdf": 1e-5}
EXPORTED = [
    "a1_description/urdf/a1.urdf",
    "double_pendulum_description/urdf/double_pendulum.urdf",
    "kinova_description/robots/kinova.urdf",
    "panda_description/urdf/panda.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "xarm_description/urdf/xarm7.urdf",
]


def urdfs():
    files = sorted(ROBOTS.rglob("*.urdf"))
    return [str(file.relative_to(ROBOTS)) for file in files]


def ours(file, folder, states):
    """What the example `dynamics` says: header, torque (joint, sample), regressor (pair, parameter, sample)."""
    path = folder / "states.bin"
    np.asarray(states, "<f8").tofile(path)
    done = subprocess.run([program("examples/dynamics"), str(file), str(path)], capture_output=True)
    if done.returncode:
        return done.stderr.decode(), None, None
    line, _, rest = done.stdout.partition(b"\n")
    header = json.loads(line)
    values = np.frombuffer(rest, "<f8")
    dof, pairs = len(header["joints"]), len(header["pairs"])
    tau, regressor = np.split(values, [dof * SAMPLES])
    return header, tau.reshape(dof, SAMPLES), regressor.reshape(pairs, 10, SAMPLES)


def configuration(model, position):
    """Pinocchio's configuration of joints at these positions: a continuous joint is a point on the unit circle."""
    return pin.integrate(model, pin.neutral(model), position)


def moving_joints(file):
    """Names of the joints that are coordinates, in the file's order; needs no reader of ours."""
    joints = tree.parse(file).getroot().findall("joint")
    moves = [j for j in joints if j.get("type") in ("revolute", "continuous", "prismatic")]
    return [j.get("name") for j in moves if j.find("mimic") is None]


def test_the_package_is_there():
    assert len(urdfs()) >= 60


@pytest.mark.parametrize("name", urdfs())
def test_pinocchio(name, tmp_path):
    file = ROBOTS / name
    joints = moving_joints(file)
    rng = np.random.default_rng(5)
    states = rng.uniform(-1, 1, (3, len(joints), SAMPLES)) * np.reshape([np.pi, 2, 5], (3, 1, 1))
    header, tau, regressor = ours(file, tmp_path, states)
    if name in REFUSED:
        assert isinstance(header, str) and REFUSED[name] in header, header
        return
    assert isinstance(header, dict), header
    assert header["joints"] == joints

    # Pinocchio moves mimicking joints on their own: position = G q + c, torque of a coordinate = Gᵀ torque.
    model = pin.buildModelFromUrdf(str(file))
    data = model.createData()
    of_body = [model.frames[model.getFrameId(body, pin.FrameType.BODY)].parentJoint for body in header["bodies"]]
    assert sorted(of_body) == list(range(1, model.njoints))
    gain, offset = np.zeros((model.nv, len(joints))), np.zeros(model.nv)
    for joint, (coordinate, multiplier, shift) in zip(of_body, header["motion"]):
        gain[model.joints[joint].idx_v, coordinate] = multiplier
        offset[model.joints[joint].idx_v] = shift
    q, v, a = (gain @ part for part in states)
    q += offset[:, None]

    coordinates, bodies = np.array(header["pairs"]).T
    columns = 10 * (np.array(of_body)[bodies] - 1)[:, None] + PINOCCHIO_ORDER
    mimics = not np.array_equal(gain, np.eye(model.nv))
    expected_tau = np.empty((len(joints), SAMPLES))
    expected = np.empty((SAMPLES, len(header["pairs"]), 10))
    whole = np.empty((RANK_SAMPLES, len(joints), 10 * (model.njoints - 1)))
    for s in range(SAMPLES):
        at = configuration(model, q[:, s])
        expected_tau[:, s] = gain.T @ pin.rnea(model, data, at, v[:, s], a[:, s])
        full = pin.computeJointTorqueRegressor(model, data, at, v[:, s], a[:, s])
        full = gain.T @ full if mimics else full
        expected[s] = full[coordinates[:, None], columns]
        if s < RANK_SAMPLES:
            whole[s] = full

    scale = np.abs(expected_tau).max()
    np.testing.assert_allclose(tau, expected_tau, rtol=0, atol=1e-10 * scale + IGNORED.get(name, 0.0))

    # Relative to the largest column of the same kind: masses, first moments, tensors. Outside the pairs all is 0.
    for kind in (slice(0, 1), slice(1, 4), slice(4, 10)):
        error = np.abs(regressor[:, kind] - expected[:, :, kind].transpose(1, 2, 0)).max()
        assert error <= 1e-10 * np.abs(expected[:, :, kind]).max(), f"parameters {kind}: {error:.1e}"
    outside = whole.copy()
    outside[:, coordinates[:, None], columns] = 0
    assert np.abs(outside).max() <= 1e-13 * np.abs(whole).max()

    # Rank of the regressor over all states: base parameters.
    stacked = whole.reshape(-1, whole.shape[2])
    lengths = np.linalg.norm(stacked, axis=0)
    used = lengths > 1e-12 * lengths.max()
    assert len(header["unidentifiable"]) == (~used).sum()
    triangle = np.linalg.qr(stacked[:, used] / lengths[used], mode="r")
    singular = np.linalg.svd(triangle, compute_uv=False)
    count = header["base_parameters"]["count"]
    assert count == len(header["base_parameters"]["names"])
    assert count == (singular > 1e-8 * singular[0]).sum(), singular[count - 3 : count + 3]


@pytest.mark.parametrize("name", EXPORTED)
def test_mujoco(name, tmp_path):
    """URDF → MuJoCo → MJCF → our reader, against `mj_inverse`."""
    root = tree.parse(ROBOTS / name).getroot()
    for link in root.iter("link"):
        for shape in link.findall("visual") + link.findall("collision"):
            link.remove(shape)
    for joint in root.iter("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    urdf, file = tmp_path / "robot.urdf", tmp_path / "robot.xml"
    tree.ElementTree(root).write(urdf)
    model = mujoco.MjModel.from_xml_path(str(urdf))
    mujoco.mj_saveLastXML(str(file), model)
    compare(file, mujoco.MjModel.from_xml_path(str(file)), tmp_path)

"""Simulated logs of industrial arms with known defects: what twincal must find, and what it must not.

    python simulate_arms.py --robot ur5 -o folder [--noise-time 0.02] [--seed 1]

The robots are those of the PyPI package `example-robot-data`; Pinocchio computes the torque of the REAL arm, which differs
from the model file by a payload, a drifted link 3, a spring on joint 2 and friction on some joints. Joints move on
Fourier series; training and held-out logs have different ones. Every log holds t, q, qd, qdd (exact) and the measured torque.
"""

import argparse
import json
from dataclasses import dataclass
from importlib import metadata
from math import exp, pi
from pathlib import Path

import numpy as np
import pinocchio as pin

RATE = 1000.0  # of the simulation, Hz
COULOMB_VELOCITY = 0.02  # rad/s
PAYLOAD_MASS = 1.74  # kg
PAYLOAD_COM = np.array([0.01, -0.02, 0.06])  # m, in the frame of the last moving link
PAYLOAD_SIZE = 0.05  # m, radius of a solid ball
DRIFT = 0.25  # of link 3's mass
SPRING = (35.0, 0.2)  # N m/rad and rest position, on joint 2


@dataclass(frozen=True)
class Robot:
    """Where the model lies in example-robot-data, and which joints stand still."""

    path: str
    locked: tuple = ()


ROBOTS = {
    "ur5": Robot("ur_description/urdf/ur5_robot.urdf"),
    "panda": Robot("panda_description/urdf/panda.urdf", ("panda_finger_joint1", "panda_finger_joint2")),
    "xarm7": Robot("xarm_description/urdf/xarm7.urdf"),
    "kinova": Robot("kinova_description/robots/kinova.urdf", ("j2s6s200_joint_finger_1", "j2s6s200_joint_finger_2", "j2s6s200_joint_finger_3")),
}


def model_file(name):
    """Path of the robot's URDF in the installed package (which is data only)."""
    root = metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    return Path(root) / ROBOTS[name].path


def load(name):
    """Pinocchio model with the locked joints removed."""
    model = pin.buildModelFromUrdf(str(model_file(name)))
    locked = [model.getJointId(joint) for joint in ROBOTS[name].locked if model.existJointName(joint)]
    return pin.buildReducedModel(model, locked, pin.neutral(model)) if locked else model


def real_arm(model):
    """The arm that the logs come from: payload at the last joint, link 3 heavier and its centre of mass moved."""
    real = model.copy()
    ball = 0.4 * PAYLOAD_MASS * PAYLOAD_SIZE**2 * np.eye(3)
    real.inertias[real.njoints - 1] = real.inertias[real.njoints - 1] + pin.Inertia(PAYLOAD_MASS, PAYLOAD_COM, ball)
    link = real.inertias[3]
    real.inertias[3] = pin.Inertia(link.mass * (1 + DRIFT), link.lever + np.array([0.0, 0.01, 0.02]), link.inertia)
    return real


def motion(rng, n, samples):
    """Fourier series within about 1 rad and 1.5 rad/s: q, qd, qdd (samples x joints) at RATE."""
    t = np.arange(samples) / RATE
    w = 2 * pi * 0.05 * np.arange(1, 11)
    a, b = rng.normal(size=(2, n, len(w))) / np.arange(1, 11) ** 0.5
    centre = rng.uniform(-0.8, 0.8, n)
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    q = s @ a.T + c @ b.T
    qd = (c * w) @ a.T - (s * w) @ b.T
    qdd = -(s * w**2) @ a.T - (c * w**2) @ b.T
    scale = np.minimum(1.2 / np.abs(q).max(0), 1.5 / np.abs(qd).max(0))
    return t, centre + q * scale, qd * scale, qdd * scale


def noise(rng, samples, n, sd, time):
    """White, or AR(1) with this correlation time in s; the same sd."""
    white = rng.normal(size=(samples, n))
    if time == 0.0:
        return sd * white
    rho = exp(-1.0 / (RATE * time))
    out = np.empty_like(white)
    out[0] = white[0]
    for k in range(1, samples):
        out[k] = rho * out[k - 1] + (1 - rho**2) ** 0.5 * white[k]
    return sd * out


def effects(n, seed):
    """Viscous and Coulomb coefficients: on two of three joints, N m s/rad and N m."""
    rng = np.random.default_rng(1000 + seed)
    size = np.linspace(3.0, 0.6, n)
    has_viscous, has_coulomb = np.arange(n) % 3 != 0, np.arange(n) % 3 != 1
    return has_viscous * size * rng.uniform(0.6, 1.2, n), has_coulomb * size * rng.uniform(0.6, 1.2, n)


def log(model, real, rng, seconds, keep, noise_sd, noise_time, seed):
    """Columns of one log as a dict, and the exact noise."""
    samples = int(seconds * RATE)
    t, q, qd, qdd = motion(rng, model.nv, samples)
    data = real.createData()
    rows = range(0, samples, keep)
    viscous, coulomb = effects(model.nv, seed)
    # joints without limits are circles to Pinocchio
    point = lambda k: pin.integrate(model, pin.neutral(model), q[k])
    tau = np.array([pin.rnea(real, data, point(k), qd[k], qdd[k]) for k in rows])
    tau += viscous * qd[::keep] + coulomb * np.tanh(qd[::keep] / COULOMB_VELOCITY)
    tau[:, 1] += SPRING[0] * (q[::keep, 1] - SPRING[1])
    error = noise(rng, samples, model.nv, noise_sd, noise_time)[::keep]
    columns = {"t": t[::keep]}
    for j in range(model.nv):
        for name, values in (("q", q), ("qd", qd), ("qdd", qdd)):
            columns[f"{name}{j + 1}"] = values[::keep, j]
        columns[f"tau{j + 1}"] = tau[:, j] + error[:, j]
    return columns, error


def write(path, columns):
    """CSV with every digit."""
    names = list(columns)
    table = np.column_stack([columns[name] for name in names])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.17g")


def simulate(name, folder, noise_sd=0.1, noise_time=0.0, seed=1, seconds=20.0, keep=10):
    """Writes train1-3.csv, heldout.csv and truth.json; returns the truth."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    model = load(name)
    real = real_arm(model)
    rng = np.random.default_rng(seed)
    floor = []
    for which in ("train1", "train2", "train3", "heldout"):
        columns, error = log(model, real, rng, seconds, keep, noise_sd, noise_time, seed)
        write(folder / f"{which}.csv", columns)
        floor = (error**2).mean(0) ** 0.5
    viscous, coulomb = effects(model.nv, seed)
    joints = [model.names[j + 1] for j in range(model.nv)]
    truth = {
        "model": str(model_file(name)),
        "locked": [joint for joint in ROBOTS[name].locked if pin.buildModelFromUrdf(str(model_file(name))).existJointName(joint)],
        "joints": joints,
        "payload_mass": PAYLOAD_MASS,
        "friction": sorted([f"{j}.viscous" for j, v in zip(joints, viscous) if v] + [f"{j}.coulomb" for j, v in zip(joints, coulomb) if v]),
        "spring": f"{joints[1]}.spring",
        "drift_joint": joints[2],
        "noise_floor": list(floor),
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    return truth


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--robot", choices=ROBOTS, default="ur5")
    arguments.add_argument("-o", "--output", type=Path, default=Path("logs"))
    arguments.add_argument("--noise-sd", type=float, default=0.1)
    arguments.add_argument("--noise-time", type=float, default=0.0)
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    simulate(given.robot, given.output, given.noise_sd, given.noise_time, given.seed)


if __name__ == "__main__":
    main()

"""The logs of the how-to pages: a table-top arm in MuJoCo under its controller, and what is true of it.

    pip install mujoco==4.0.0 numpy==2.4.6
    python simulate.py [-o FOLDER]          # writes six logs and truth.json (default: this folder)

The real arm is `arm.urdf` with friction and motor inertia in every joint, and what a log adds: a payload, another friction.
MuJoCo integrates at 0.5 ms. A controller at 1 kHz, PD about the torque of `arm.urdf`, follows a Fourier series of 0.05 to
0.5 Hz from rest to rest. Every 8 ms one row is logged: positions in counts of 20 bits per turn, and the torque of the motors
with noise whose correlation time is 12 ms, or their current. Velocities and accelerations are not logged.
"""

import argparse
import json
from dataclasses import asdict, dataclass
from math import exp, pi
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).resolve().parent
STEP = 5e-4  # s, of MuJoCo
CONTROL, ROW = 2, 16  # steps per period of the controller and of the log
REST, FADE = 0.2, 1.0  # s at either end of a motion
JOINTS = ("waist", "shoulder", "elbow", "wrist")
CENTRE = (0.0, 0.3, 1.0, 0.2)  # rad, middle of the motion
REACH, SPEED = 1.3, 1.8  # of a motion: rad from the middle, rad/s; it reaches the first that it meets
STIFFNESS = np.array([900.0, 900.0, 400.0, 60.0])  # of the controller, N m/rad
DAMPING = np.array([60.0, 60.0, 25.0, 2.5])  # N m s/rad
COUNT = 2 * pi / 2**20  # rad, of the encoders
NOISE = np.array([0.25, 0.30, 0.15, 0.06])  # N m, sd
NOISE_TIME = 0.012  # s
VISCOUS = (4.0, 5.0, 2.5, 0.6)  # N m s/rad
COULOMB = (3.0, 4.0, 2.0, 0.5)  # N m
DRAGGING = (3.0, 4.0, 3.0, 0.5)  # N m, with a brake that drags on the elbow
REVERSAL = 0.01  # rad/s: Coulomb friction is F tanh(velocity / REVERSAL)
MOTOR = (0.30, 0.35, 0.12, 0.02)  # kg m^2, motor inertia at the joint
GEAR, DRIVE = (101, 101, 101, 50), (0.12, 0.12, 0.12, 0.10)  # gear ratio; drive constant, N m/A at the motor
RADIUS = 0.04  # m, of the solid ball that a payload is


@dataclass(frozen=True)
class World:
    """What is true of one log."""

    motion: int  # seed
    noise: int  # seed
    seconds: float = 20.0
    torque: str = "joint"  # or current: what the log holds
    payload: float = 0.0  # kg
    centre: tuple = (0.0, 0.0, 0.0)  # m, of the payload in tool0
    viscous: tuple = VISCOUS
    coulomb: tuple = COULOMB
    motor: tuple = MOTOR


NOMINAL = World(0, 0, viscous=(0.0,) * 4, coulomb=(0.0,) * 4, motor=(0.0,) * 4)
WORLDS = {
    "run": World(motion=3, noise=1),
    "after": World(motion=3, noise=2, payload=0.3, centre=(0.03, 0.0, 0.02), coulomb=DRAGGING),
    "tool": World(motion=3, noise=3, payload=0.8, centre=(0.02, 0.0, 0.06)),
    "monday": World(motion=2, noise=4, seconds=12.0),
    "friday": World(motion=2, noise=5, seconds=12.0, coulomb=DRAGGING),
    "current": World(motion=3, noise=6, torque="current"),
}


def arm(world):
    """The model of `arm.urdf` with this world's payload and motor inertia; friction is applied by `simulate`."""
    whole = '<robot name="arm"><mujoco><compiler fusestatic="false"/></mujoco>'  # keeps the link tool0
    spec = mujoco.MjSpec.from_string((HERE / "arm.urdf").read_text().replace('<robot name="arm">', whole))
    for name in JOINTS:
        spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_motor()
    if world.payload:
        ball = spec.body("tool0").add_body(name="payload")
        ball.mass, ball.ipos, ball.inertia = world.payload, world.centre, (0.4 * world.payload * RADIUS**2,) * 3
        ball.explicitinertial = True
    model = spec.compile()
    model.opt.timestep = STEP
    model.dof_armature = world.motor
    return model


def reference(world):
    """q, qd and qdd at every step."""
    rng = np.random.default_rng([world.motion, 7])
    t = np.arange(round(world.seconds / STEP) + 1) * STEP
    k = np.arange(1, 11)
    a, b = rng.normal(size=(2, len(JOINTS), len(k))) / k**0.5
    q = np.sin(2 * pi * 0.05 * np.outer(t, k)) @ a.T + np.cos(2 * pi * 0.05 * np.outer(t, k)) @ b.T
    q -= (q.max(0) + q.min(0)) / 2
    q *= np.minimum(REACH / np.abs(q).max(0), SPEED / np.abs(np.gradient(q, STEP, axis=0)).max(0))
    x = np.clip(np.minimum(t - REST, world.seconds - REST - t) / FADE, 0.0, 1.0)
    q = np.asarray(CENTRE) + (x**3 * (10 - 15 * x + 6 * x**2))[:, None] * q
    qd = np.gradient(q, STEP, axis=0)
    return q, qd, np.gradient(qd, STEP, axis=0)


def noise(rng, rows):
    """Stationary AR(1) noise of the torque, rows x joints."""
    rho = exp(-ROW * STEP / NOISE_TIME)
    values = rng.normal(size=(rows, len(JOINTS)))
    for row in range(1, rows):
        values[row] = rho * values[row - 1] + (1 - rho**2) ** 0.5 * values[row]
    return values * NOISE


def simulate(world):
    """t, q and torque of the motors without noise, at the log's rows; torque is that about the row's time."""
    real, nominal = arm(world), arm(NOMINAL)
    q, qd, qdd = reference(world)
    data, inverse = mujoco.MjData(real), mujoco.MjData(nominal)
    viscous, coulomb = np.array(world.viscous), np.array(world.coulomb)
    data.qpos = q[0]
    rows = []
    for step in range(round(world.seconds / STEP)):
        before = data.ctrl.copy()
        if step % CONTROL == 0:
            inverse.qpos, inverse.qvel, inverse.qacc = q[step], qd[step], qdd[step]
            mujoco.mj_inverse(nominal, inverse)
            data.ctrl = inverse.qfrc_inverse + STIFFNESS * (q[step] - data.qpos) + DAMPING * (qd[step] - data.qvel)
        if step % ROW == 0:
            torque = (before + data.ctrl) / 2 if step else data.ctrl
            rows.append(np.concatenate([[step * STEP], data.qpos, torque]))
        data.qfrc_applied = -(viscous * data.qvel + coulomb * np.tanh(data.qvel / REVERSAL))
        mujoco.mj_step(real, data)
    t, q, torque = np.split(np.array(rows), [1, 1 + len(JOINTS)], axis=1)
    return t, q, torque


def log(world):
    """Rows of a log: t, positions, torque or currents."""
    t, q, torque = simulate(world)
    torque = torque + noise(np.random.default_rng([world.noise, 8]), len(t))
    if world.torque == "current":
        torque = torque / (np.array(GEAR) * np.array(DRIVE))
    return np.hstack([t, np.round(q / COUNT) * COUNT, torque])


def write(path, world):
    """One log as CSV."""
    names = ["t", *(f"{joint}.{what}" for what in ("q", "tau") for joint in JOINTS)]
    digits = ["%.3f", *["%.6f"] * len(JOINTS), *["%.3f" if world.torque == "current" else "%.2f"] * len(JOINTS)]
    np.savetxt(path, log(world), digits, ",", header=",".join(names), comments="")


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=HERE)
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for name, world in WORLDS.items():
        write(folder / f"{name}.csv", world)
    truth = {"mujoco": mujoco.__version__, "numpy": np.__version__, "joints": JOINTS, "reversal_velocity": REVERSAL}
    truth |= {"gear_ratio": GEAR, "drive_constant": DRIVE, "logs": {name: asdict(world) for name, world in WORLDS.items()}}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    main()

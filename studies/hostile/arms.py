"""Simulated logs of real arms: three robots, three motions, three kinds of friction, and the recorders that write them down.

    python arms.py --robot ur5 --motion fourier --friction coulomb --seed 1 [--mistake NAME] -o folder

The arm differs from its model file by a payload at the flange and by friction; Pinocchio computes its torque. Written are
train1.csv, train2.csv, heldout.csv, twincal.toml and truth.json. `--mistake` applies one of `faults.py` (`--mistake list` lists them).

    study = make_study(World(robot="panda", motion="pick_and_place", friction="lugre", seed=3), Recorder(rate=500))
    study.train[0].tau        # samples x joints, N m
"""

import argparse
import json
import sys
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from math import exp, pi
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.signal import cont2discrete, lfilter

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "industrial_arms"))
from simulate_arms import ROBOTS as MODEL_FILES  # noqa: E402
from simulate_arms import load, model_file  # noqa: E402

BASE_RATE = 1000  # Hz, of motion and of friction with a state; every log rate divides it
MOTIONS = ("fourier", "point_to_point", "pick_and_place")
FRICTIONS = ("coulomb", "lugre", "flexible")
RATES = (125, 250, 500, 1000)  # Hz
COULOMB_VELOCITY = 0.01  # rad/s, of tanh
# Coulomb friction of the first and the last joint, N m; viscous friction in N m s/rad is of the same size
FRICTION_SIZE = {"ur5": (6.0, 1.2), "panda": (1.2, 0.4), "xarm7": (4.0, 0.8)}
ROBOTS = tuple(FRICTION_SIZE)


@dataclass(frozen=True)
class World:
    """What moves: robot, motion, friction, payload and base. The seed draws friction and motion."""

    robot: str = "ur5"
    motion: str = "fourier"
    friction: str = "coulomb"
    payload: float = 1.5  # kg at the last joint
    base_rpy: tuple = (0.0, 0.0, 0.0)  # rad; the model file stands upright
    law: str = "quintic"  # of point to point: or "trapezoid"
    speed: float = 1.0  # share of the usual speed
    friction_factor: float = 1.0  # of all friction
    seed: int = 1


@dataclass(frozen=True)
class Recorder:
    """What writes down: rate, encoder, noise of torque, length."""

    rate: int = 250  # Hz
    seconds: float = 12.0
    counts: int = 2**18  # per turn
    at_rest: str = "silent"  # or "dither": the encoder toggles between neighbours at rest
    noise: float = 0.05  # sd of torque noise as share of the joint's Coulomb friction: white and AR(1), half each
    noise_time: float = 0.01  # s, correlation time of the AR(1) part
    velocity: bool = True  # whether velocity is logged


@dataclass
class Log:
    """One log: t in s; q, qd, tau as samples x joints in rad, rad/s, N m. `qd` is None where it is not logged; `qdd` is exact and not written."""

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    qdd: np.ndarray
    truth: dict = field(default_factory=dict)

    def copy(self):
        """The log with arrays of its own."""
        arrays = {name: getattr(self, name) for name in ("t", "q", "qd", "tau", "qdd")}
        return replace(self, truth=dict(self.truth), **{name: None if a is None else a.copy() for name, a in arrays.items()})

    def rows(self, which):
        """The log's rows `which` (slice, mask or indices)."""
        return replace(self, t=self.t[which], q=self.q[which], tau=self.tau[which], qdd=self.qdd[which],
                       qd=None if self.qd is None else self.qd[which], truth=dict(self.truth))  # fmt: skip


@dataclass
class Study:
    """Logs of one robot in one state, as they are given to `twincal fit`."""

    world: World
    recorder: Recorder
    train: list
    heldout: Log
    truth: dict = field(default_factory=dict)

    def copy(self):
        """The study with logs of its own."""
        return replace(self, train=[log.copy() for log in self.train], heldout=self.heldout.copy(), truth=dict(self.truth))


class Arm:
    """The arm of a world: model of the file, real arm, friction coefficients, ranges of its joints."""

    def __init__(self, world):
        self.world = world
        self.model = load(world.robot)
        self.real = self.model.copy()
        radius = 0.05
        ball = pin.Inertia(world.payload, np.array([0.01, -0.02, 0.06]), 0.4 * world.payload * radius**2 * np.eye(3))
        self.real.inertias[self.real.njoints - 1] = self.real.inertias[self.real.njoints - 1] + ball
        turned = pin.rpy.rpyToMatrix(*world.base_rpy).T
        self.real.gravity.linear = turned @ self.model.gravity.linear
        rng = np.random.default_rng(1000 + world.seed)
        n = self.model.nv
        size = np.linspace(*FRICTION_SIZE[world.robot], n) * world.friction_factor
        self.coulomb, self.viscous = size * rng.uniform(0.7, 1.3, n), size * rng.uniform(0.7, 1.3, n)
        self.low = np.maximum(self.model.lowerPositionLimit, -2.6) + 0.1
        self.high = np.minimum(self.model.upperPositionLimit, 2.6) - 0.1
        self.fastest = np.minimum(0.6 * self.model.velocityLimit, 1.6) * world.speed
        self.names = list(self.model.names)[1:]


def fourier(arm, rng, t):
    """Fourier series of a base of 0.1 Hz with five harmonics, within the joints' ranges and speeds: q, qd, qdd."""
    n, w = arm.model.nv, 2 * pi * 0.1 * np.arange(1, 6)
    a, b = rng.normal(size=(2, n, len(w))) / np.arange(1, 6) ** 0.5
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    q, qd = s @ a.T + c @ b.T, (c * w) @ a.T - (s * w) @ b.T
    qdd = -(s * w**2) @ a.T - (c * w**2) @ b.T
    reach = np.minimum(1.2, 0.45 * (arm.high - arm.low))
    scale = np.minimum(reach / np.abs(q).max(0), arm.fastest / np.abs(qd).max(0))
    reached = np.abs(q).max(0) * scale
    centre = rng.uniform(np.maximum(arm.low + reached, -1.5), np.minimum(arm.high - reached, 2.0))
    return centre + q * scale, qd * scale, qdd * scale


LAWS = {
    # largest speed and acceleration of a way of 1 within a time of 1
    "quintic": (1.875, 5.7735),
    "trapezoid": (1.5, 4.5),
}


def time_law(law, u):
    """Share of the way, its first and second derivative, at the share `u` of the time."""
    if law == "quintic":
        return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2, 60 * u * (1 - u) * (1 - 2 * u)
    ramp = 1.0 / 3.0
    top = 1.0 / (1.0 - ramp)
    up, down = u < ramp, u > 1 - ramp
    s = np.where(up, 0.5 * top / ramp * u**2, np.where(down, 1 - 0.5 * top / ramp * (1 - u) ** 2, top * (u - 0.5 * ramp)))
    v = np.where(up, top / ramp * u, np.where(down, top / ramp * (1 - u), top))
    return s, v, np.where(up, top / ramp, np.where(down, -top / ramp, 0.0))


def stops(arm, points, dwells, t):
    """Motion through points with a dwell at each, as fast as the slowest joint allows: q, qd, qdd at the times t."""
    q, qd, qdd = np.empty((len(t), arm.model.nv)), np.zeros((len(t), arm.model.nv)), np.zeros((len(t), arm.model.nv))
    fastest, hardest = LAWS[arm.world.law]
    now = 0.0
    q[:] = points[0]
    for start, end, dwell in zip(points, points[1:], dwells):
        rest = (t >= now) & (t < now + dwell)
        q[rest] = start
        now += dwell
        way = end - start
        lasts = max(0.25, (fastest * np.abs(way) / arm.fastest).max(), (hardest * np.abs(way) / (4.0 * arm.fastest)).max() ** 0.5)
        moves = (t >= now) & (t < now + lasts)
        s, v, a = (x[:, None] for x in time_law(arm.world.law, (t[moves] - now) / lasts))
        q[moves], qd[moves], qdd[moves] = start + s * way, v * way / lasts, a * way / lasts**2
        now += lasts
        q[t >= now] = end
        if now > t[-1]:
            break
    return q, qd, qdd


def some_points(arm, rng, count, reach):
    """Random points at most `reach` from a random home, within the ranges."""
    middle, half = 0.5 * (arm.low + arm.high), 0.5 * (arm.high - arm.low)
    home = middle + rng.uniform(-0.3, 0.3, arm.model.nv) * half
    return [np.clip(home + rng.uniform(-reach, reach, arm.model.nv), arm.low, arm.high) for _ in range(count)]


def point_to_point(arm, rng, t):
    """From random point to random point, with dwells of 0.15 to 0.8 s."""
    count = int(t[-1] / 0.4) + 2
    return stops(arm, some_points(arm, rng, count, 1.0), rng.uniform(0.15, 0.8, count), t)


def pick_and_place(arm, rng, t):
    """Cycles over two pairs of points (above and at the part, above and at the box), all alike, with a dwell of 0.4 s at part and box."""
    above, there = some_points(arm, rng, 2, 0.9)
    down = [rng.uniform(-0.15, 0.15, arm.model.nv) for _ in range(2)]
    clip = lambda q: np.clip(q, arm.low, arm.high)
    cycle = [above, clip(above + down[0]), above, there, clip(there + down[1]), there]
    rounds = int(t[-1] / (6 * 0.25)) + 2
    dwells = [0.0, 0.4, 0.0, 0.0, 0.4, 0.0] * rounds
    dwells[0] = 0.5
    return stops(arm, cycle * rounds + [above], dwells, t)


def lugre(arm, qd):
    """LuGre friction over velocities at BASE_RATE. Its state is integrated exactly for a velocity that is constant over a sample."""
    step = 1.0 / BASE_RATE
    stiffness = arm.coulomb / 0.004  # N m/rad: 4 mrad of presliding
    damping = 0.002 * stiffness
    level = arm.coulomb * (1 + 0.25 * np.exp(-((qd / 0.05) ** 2)))
    decay = np.exp(-np.abs(qd) * stiffness / level * step)
    goal = level / stiffness * np.sign(qd)
    z = np.empty_like(qd)
    state = np.zeros(qd.shape[1])
    for k in range(len(qd)):
        state = goal[k] + (state - goal[k]) * decay[k]
        z[k] = state
    rate = qd * (1 - z * np.sign(qd) * stiffness / level)
    return stiffness * z + damping * rate + arm.viscous * qd


def through_gears(arm, rng, tau, rate):
    """Torque at the motors' side of flexible joints: every joint rings at 12 to 25 Hz with 8 % of critical damping."""
    out = np.empty_like(tau)
    for j, natural in enumerate(2 * pi * rng.uniform(12.0, 25.0, tau.shape[1])):
        top, bottom, _ = cont2discrete(([natural**2], [1.0, 0.16 * natural, natural**2]), 1.0 / rate, "foh")
        out[:, j] = tau[0, j] + lfilter(np.ravel(top), bottom, tau[:, j] - tau[0, j])
    return out


def rigid_torque(model, q, qd, qdd):
    """Inverse dynamics, row by row."""
    data = model.createData()
    return np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd)])


def colored(rng, shape, rate, time):
    """AR(1) noise with an sd of 1."""
    rho = exp(-1.0 / (rate * time))
    return lfilter([(1 - rho**2) ** 0.5], [1.0, -rho], rng.normal(size=shape), axis=0)


def encode(recorder, rng, q, qd):
    """Position and velocity as the encoder shows them."""
    step = 2 * pi / recorder.counts
    shown = q
    if recorder.at_rest == "dither":
        shown = q + 0.5 * step * rng.normal(size=q.shape)
    # a controller's velocity is the filtered change of position: one count per 20 ms of error, none at rest
    moving = np.abs(qd) > 0 if recorder.at_rest == "silent" else np.ones_like(qd, bool)
    return step * np.round(shown / step), qd + 20.0 * step * rng.normal(size=q.shape) * moving


def make_log(world, recorder, which=0, programme=None):
    """Log number `which` of a world. Logs of one `programme` (a seed) have the same path and other noise."""
    arm = Arm(world)
    kind = MOTIONS.index(world.motion)
    path = np.random.default_rng([world.seed, which if programme is None else 100 + programme, kind, ROBOTS.index(world.robot)])
    rng = np.random.default_rng([world.seed, which, 7])
    t = np.arange(int(recorder.seconds * BASE_RATE)) / BASE_RATE
    q, qd, qdd = globals()[world.motion](arm, path, t)
    keep = slice(None, None, BASE_RATE // recorder.rate)
    friction = lugre(arm, qd) if world.friction == "lugre" else arm.viscous * qd + arm.coulomb * np.tanh(qd / COULOMB_VELOCITY)
    t, q, qd, qdd, friction = t[keep], q[keep], qd[keep], qdd[keep], friction[keep]
    rigid = rigid_torque(arm.real, q, qd, qdd)
    if world.friction == "flexible":
        rigid = through_gears(arm, np.random.default_rng(world.seed), rigid, recorder.rate)
    noise = recorder.noise * arm.coulomb * 0.5**0.5
    tau = rigid + friction + noise * (rng.normal(size=q.shape) + colored(rng, q.shape, recorder.rate, recorder.noise_time))
    q_shown, qd_shown = encode(recorder, rng, q, qd)
    truth = {"coulomb": arm.coulomb.tolist(), "viscous": arm.viscous.tolist(), "noise": (recorder.noise * arm.coulomb).tolist(),
             "rest": (qd == 0).mean(0).tolist()}  # fmt: skip
    return Log(t, q_shown, qd_shown if recorder.velocity else None, tau, qdd, truth)


@lru_cache(maxsize=8)
def kept_log(world, recorder, which):
    """A log, made once for the mistakes that are tried on it."""
    return make_log(world, recorder, which)


def make_study(world, recorder=Recorder(), logs=2):
    """A study without a fault: training logs and one held-out log, each with a motion of its own."""
    made = [kept_log(world, recorder, which).copy() for which in range(logs + 1)]
    return Study(world, recorder, made[:-1], made[-1])


def nominal_torque(world, log):
    """Torque of the model file along a log: without payload and friction, standing upright."""
    qd = log.qd if log.qd is not None else np.gradient(log.q, log.t, axis=0)
    return rigid_torque(load(world.robot), log.q, qd, log.qdd)


def gravity_torque(world, log):
    """Torque of gravity of the model file along a log."""
    model = load(world.robot)
    data = model.createData()
    return np.array([pin.computeGeneralizedGravity(model, data, q) for q in log.q])


def write_csv(path, log):
    """CSV with header t, q1 …, qd1 …, tau1 … and ten digits."""
    channels = [("q", log.q), ("qd", log.qd), ("tau", log.tau)]
    columns = [("t", log.t[:, None]), *((name, values) for name, values in channels if values is not None)]
    names = [name if name == "t" else f"{name}{j + 1}" for name, values in columns for j in range(values.shape[1])]
    np.savetxt(path, np.hstack([values for _, values in columns]), delimiter=",", header=",".join(names), comments="", fmt="%.10g")


def write_study(folder, study):
    """Writes CSV files, twincal.toml and truth.json of a study; returns the folder."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for k, log in enumerate(study.train, 1):
        write_csv(folder / f"train{k}.csv", log)
    write_csv(folder / "heldout.csv", study.heldout)
    locked = ", ".join(f'"{joint}" = 0.0' for joint in MODEL_FILES[study.world.robot].locked)
    lines = ["[model]", f'file = "{model_file(study.world.robot)}"', f"locked = {{ {locked} }}" if locked else ""]
    for k in range(1, len(study.train) + 1):
        lines += ["", "[[log]]", f'file = "train{k}.csv"']
    lines += ["", "[[log]]", 'file = "heldout.csv"', "heldout = true"]
    (folder / "twincal.toml").write_text("\n".join(line for line in lines) + "\n")
    truth = {"world": asdict(study.world), "recorder": asdict(study.recorder), **study.truth,
             "heldout": study.heldout.truth, "train": [log.truth for log in study.train]}  # fmt: skip
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    return folder


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--robot", choices=ROBOTS, default="ur5")
    arguments.add_argument("--motion", choices=MOTIONS, default="fourier")
    arguments.add_argument("--friction", choices=FRICTIONS, default="coulomb")
    arguments.add_argument("--law", choices=LAWS, default="quintic")
    arguments.add_argument("--payload", type=float, default=1.5)
    arguments.add_argument("--base-rpy", type=float, nargs=3, default=(0.0, 0.0, 0.0))
    arguments.add_argument("--speed", type=float, default=1.0)
    arguments.add_argument("--rate", type=int, choices=RATES, default=250)
    arguments.add_argument("--seconds", type=float, default=12.0)
    arguments.add_argument("--counts", type=int, default=2**18)
    arguments.add_argument("--at-rest", choices=("silent", "dither"), default="silent")
    arguments.add_argument("--no-velocity", action="store_true")
    arguments.add_argument("--logs", type=int, default=2, help="number of training logs")
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--mistake", default="none")
    arguments.add_argument("-o", "--output", type=Path, default=Path("logs"))
    given = arguments.parse_args()
    import faults

    if given.mistake == "list":
        sys.exit("\n".join(f"{name:<24} {fault.size}" for name, fault in faults.FAULTS.items()))
    world = World(given.robot, given.motion, given.friction, given.payload, tuple(given.base_rpy), given.law, given.speed, seed=given.seed)
    recorder = Recorder(given.rate, given.seconds, given.counts, given.at_rest, velocity=not given.no_velocity)
    write_study(given.output, faults.faulty_study(given.mistake, world, recorder, given.logs))


if __name__ == "__main__":
    main()

"""Fleets: many robots of one type with known differences, their truth and their logs.

    python fleets.py --units 20 --seed 1 -o folder [--kind null] [--sds 3] [--short] [--jobs 2]

Written are unit01-w1.parquet …, one log per unit and weekly window, twincal.toml and truth.json; with `--short` also a log of 10 s of
a unit `new` and new.npz, a motion of 20 s of it without noise. The same arguments give the same files, with any number of jobs.

    all units       adapter at the flange, viscous and Coulomb friction of every joint; the model file has none of these
    every unit      SCATTER: what units of one type differ by without a fault
    some units      one of DEVIATIONS in turn, from window ONSET on, as large as `sizes.py` says
"""

import argparse
import copy
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property, lru_cache
from math import radians
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet

sys.path.append(str(Path(__file__).resolve().parents[1] / "worlds"))
from defects import Defects, torque  # noqa: E402
from defects import Path as Motion  # noqa: E402
from shared import BASE_RATE, MODEL_FILES, MOTIONS, Arm, Log, Recorder, arms, colored, encode, model_file  # noqa: E402
from sizes import columns_of_window, standard_error  # noqa: E402
from worlds import body_cause, joint_causes  # noqa: E402

VERSION = 1  # of the fleets: logs of another version are made anew
KINDS = ("standard", "null")
HELD_BACK = ("panda", "lugre", "warm_up", "two")
DEVIATIONS = ("mass", "drag", "zero")
EFFECTS = {"mass": ("payload", "kg"), "drag": ("coulomb", "N m"), "zero": ("encoder_zero", "rad")}  # family and unit
SHARE = 0.15  # of the units deviate
ONSET = 2  # first window of a deviation, from 0
ADAPTER = 0.8  # kg
# Standard deviation of what differs without a fault: shares of the type's value, and rad
SCATTER = {"friction": 0.10, "adapter": 0.01, "zero": 0.0005}
WARMTH = 0.03  # standard deviation of the factor of a window's friction in `warm_up`
GRIPPER = (0.0, 0.0, 0.10)  # m, centre of the body that is too much, in the last joint's frame
LARGEST_ZERO = radians(2.0)  # a joint whose zero would have to be larger does not get one
SHORT = ("new", 10.0, 20.0)  # name, s of its log, s of its held-out motion
FIRST = datetime(2026, 1, 5, tzinfo=UTC)  # a Monday
WEEK = timedelta(days=7)


@dataclass(frozen=True)
class Fleet:
    """What is simulated."""

    robot: str = "ur5"
    units: int = 40
    windows: int = 8
    seconds: float = 20.0
    rate: int = 200  # Hz
    seed: int = 1
    kind: str = "standard"
    sds: float = 6.0  # size of a deviation, in standard deviations
    of: str = "window"  # whose: the error of one window, or "units": that error and the scatter of the units
    short: bool = False  # whether there is a unit with a short log

    @property
    def recorder(self):
        """Encoders and noise of every unit."""
        return Recorder(self.rate, self.seconds)

    @property
    def names(self):
        """Names of the units with a log per window."""
        return [f"unit{number:02d}" for number in range(1, self.units + 1)]


class Type:
    """What all units have in common: the arm with its friction, and the adapter that the model file lacks."""

    def __init__(self, fleet):
        self.arm = Arm(arms.World(fleet.robot, payload=0.0, seed=fleet.seed))
        self.nominal = self.arm.model
        rng = np.random.default_rng([fleet.seed, 31])
        centre = *rng.uniform(-0.02, 0.02, 2), rng.uniform(0.03, 0.07)
        self.adapter = float(ADAPTER * rng.uniform(0.9, 1.1)), tuple(float(x) for x in centre)
        self.noise_sd = fleet.recorder.noise * self.arm.coulomb

    def causes(self, kind):
        """What is wrong with the model file for all units, as `studies/worlds` states it."""
        nominal, last = self.nominal, self.nominal.nv - 1
        found = [body_cause(nominal, last, "payload", self.adapter[0], "payload", ("payload", "payload.tensor"))]
        found += joint_causes(nominal, self.arm.viscous, "viscous", "N m s/rad", "friction", ["viscous"])
        found += joint_causes(nominal, self.arm.coulomb, "coulomb", "N m", "friction", ["coulomb"])
        if kind == "lugre":
            found += joint_causes(nominal, self.arm.coulomb, "memory", "N m", "lugre", ["hysteresis"], ["stribeck"])
        return found


class Unit:
    """One robot: its scatter, its deviations and its logs."""

    def __init__(self, fleet, number):
        self.fleet, self.number, self.type = fleet, number, type_of(fleet)
        self.name = SHORT[0] if number > fleet.units else fleet.names[number - 1]
        rng = np.random.default_rng([fleet.seed, number, 32])
        n, arm = self.type.nominal.nv, self.type.arm
        self.coulomb = arm.coulomb * np.exp(SCATTER["friction"] * rng.normal(size=n))
        self.viscous = arm.viscous * np.exp(SCATTER["friction"] * rng.normal(size=n))
        self.adapter = float(self.type.adapter[0] * (1.0 + SCATTER["adapter"] * rng.normal()))
        self.zero = SCATTER["zero"] * rng.normal(size=n)
        self.hours = rng.uniform(8.0, 128.0, fleet.windows)

    @cached_property
    def model(self):
        """Pinocchio model of the unit as it was delivered."""
        return Defects(payload=(self.adapter, self.type.adapter[1])).real(self.type.nominal)

    @cached_property
    def deviations(self):
        """Deviations of this unit, with their sizes."""
        kinds = deviating(self.fleet).get(self.name, ())
        rng = np.random.default_rng([self.fleet.seed, self.number, 33])
        return [self.deviation(kind, rng) for kind in kinds]

    def deviation(self, kind, rng):
        """A deviation of a kind, as large as the median standard error of the windows in which it acts says."""
        fleet, family, unit = self.fleet, *EFFECTS[kind]
        joints = list(self.type.nominal.names)[1:]
        errors = {j: self.window_errors(kind, j) for j in (range(len(joints)) if kind != "mass" else (None,))}
        largest = {"zero": LARGEST_ZERO}.get(kind, np.inf)
        possible = [j for j, found in errors.items() if fleet.sds * np.median(found) <= largest]
        joint = possible[rng.integers(len(possible))]
        sign = rng.choice((-1.0, 1.0)) if kind == "zero" else 1.0
        error = float(np.median(errors[joint]))
        spread, beside = self.scatter(kind, joint)
        size = float(sign * fleet.sds * (np.hypot(error, spread) if fleet.of == "units" else error))
        return {"kind": kind, "joint": joint, "effect": "payload" if joint is None else f"{joints[joint]}.{family}", "family": family,
                "size": size, "unit": unit, "standard_error": error, "window_sds": [round(abs(size) / x, 2) for x in errors[joint]],
                "scatter_sds": float(abs(size) / spread), "beside": float(beside), "total": float(size + beside)}  # fmt: skip

    def scatter(self, kind, joint):
        """Standard deviation of the scatter of what a deviation changes, and what this unit has of it beyond the type."""
        common = self.type
        if kind == "mass":
            return SCATTER["adapter"] * common.adapter[0], self.adapter - common.adapter[0]
        if kind == "drag":
            return SCATTER["friction"] * common.arm.coulomb[joint], self.coulomb[joint] - common.arm.coulomb[joint]
        return SCATTER["zero"], self.zero[joint]

    def window_errors(self, kind, joint):
        """Standard errors of a deviation of size 1, one per window in which it acts."""
        return [standard_error(columns, kind, joint) for columns in self.columns]

    @cached_property
    def columns(self):
        """Columns of `sizes.py` of each window in which a deviation acts."""
        paths = [self.thinned(self.path(window, self.fleet.seconds)) for window in range(ONSET, self.fleet.windows)]
        return [columns_of_window(self.model, path, self.fleet.recorder, self.type.noise_sd, GRIPPER) for path in paths]

    @property
    def keep(self):
        """Steps of the motion per row: friction with a state needs BASE_RATE."""
        return BASE_RATE // self.fleet.rate if self.fleet.kind == "lugre" else 1

    def thinned(self, path, every=1):
        """A motion at the rate of the logs, or each `every`-th of its rows."""
        return Motion(*(getattr(path, name)[:: self.keep * every] for name in ("t", "q", "qd", "qdd")))

    def path(self, window, seconds):
        """The motion of a window."""
        rng = np.random.default_rng([self.fleet.seed, self.number, window, 34])
        rate = self.fleet.rate * self.keep
        t = np.arange(int(seconds * rate)) / rate
        return Motion(t, *getattr(arms, MOTIONS[rng.integers(len(MOTIONS))])(self.type.arm, rng, t))

    def state(self, window):
        """Arm and defects of a window: friction with its warmth, and the deviations that act."""
        rng = np.random.default_rng([self.fleet.seed, self.number, window, 36])
        warmth = 1.0 + WARMTH * rng.normal() if self.fleet.kind == "warm_up" else 1.0
        arm, zero, gripper = copy.copy(self.type.arm), self.zero.copy(), None
        arm.model, arm.viscous, arm.coulomb = self.model, self.viscous * warmth, self.coulomb * warmth
        for one in self.deviations if window >= ONSET else ():
            if one["kind"] == "mass":
                gripper = (one["size"], GRIPPER)
            elif one["kind"] == "drag":
                arm.coulomb[one["joint"]] += one["size"]
            else:
                zero[one["joint"]] += one["size"]
        lugre = (1.0,) * len(zero) if self.fleet.kind == "lugre" else None
        return arm, Defects(payload=gripper, zero=tuple(zero), lugre=lugre)

    def log(self, window, seconds):
        """The log of a window, and its torque without noise."""
        recorder, keep = self.fleet.recorder, self.keep
        path = self.path(window, seconds)
        clean = torque(*self.state(window), path, keep)
        rng = np.random.default_rng([self.fleet.seed, self.number, window, 35])
        error = rng.normal(size=clean.shape) + colored(rng, clean.shape, recorder.rate, recorder.noise_time)
        q, qd = encode(recorder, rng, path.q[::keep], path.qd[::keep])
        return Log(path.t[::keep], q, qd, clean + self.type.noise_sd * 0.5**0.5 * error, path.qdd[::keep]), path, clean

    def start(self, window):
        """When the log of a window begins: 8 h after the window does or later, a whole second."""
        return FIRST + window * WEEK + timedelta(seconds=int(3600 * self.hours[window]))

    def write(self, folder):
        """Writes the logs of the unit; returns its truth."""
        windows = range(self.fleet.windows)
        if self.name == SHORT[0]:
            windows = windows[-1:]
            _, path, clean = self.log(self.fleet.windows, SHORT[2])
            np.savez(folder / "new.npz", tau=clean, **vars(self.thinned(path)))
        for window in windows:
            log, _, _ = self.log(window, SHORT[1] if self.name == SHORT[0] else self.fleet.seconds)
            write_parquet(folder / f"{self.name}-w{window + 1}.parquet", log, self.start(window))
        scatter = {"coulomb": self.coulomb.tolist(), "viscous": self.viscous.tolist(), "adapter": self.adapter, "zero": self.zero.tolist()}
        starts = [self.start(window).isoformat() for window in windows]
        return {"robot": self.name, "starts": starts, "scatter": scatter, "deviations": self.deviations}


@lru_cache(maxsize=4)
def type_of(fleet):
    """The type of a fleet."""
    return Type(fleet)


def deviating(fleet):
    """Kinds of deviations per name of a deviating unit. The first kind goes round with the seed."""
    if fleet.kind == "null":
        return {}
    rng = np.random.default_rng([fleet.seed, 37])
    chosen = sorted(rng.choice(fleet.units, max(1, round(SHARE * fleet.units)), replace=False))
    turn = lambda k: DEVIATIONS[(fleet.seed + k) % len(DEVIATIONS)]
    return {fleet.names[unit]: (turn(k), turn(k + 1)) if fleet.kind == "two" else (turn(k),) for k, unit in enumerate(chosen)}


def write_parquet(path, log, start):
    """Parquet with the columns of `arms.write_csv`; `t` counts nanoseconds since 1970."""
    stamps = int(start.timestamp()) * 10**9 + np.round(log.t * 1e9).astype(np.int64)
    columns = {"t": pyarrow.array(stamps, pyarrow.timestamp("ns", tz="UTC"))}
    for name, values in (("q", log.q), ("qd", log.qd), ("tau", log.tau)):
        columns |= {f"{name}{j + 1}": values[:, j] for j in range(values.shape[1])}
    pyarrow.parquet.write_table(pyarrow.table(columns), path, compression="zstd", use_dictionary=False)


def write_unit(fleet, number, folder):
    """Logs and truth of one unit."""
    return Unit(fleet, number).write(folder)


def make(fleet, folder, jobs=1):
    """Writes a fleet; returns its truth."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    tasks = [(fleet, number, folder) for number in range(1, fleet.units + 1 + fleet.short)]
    if jobs > 1:
        with ProcessPoolExecutor(jobs) as pool:
            units = list(pool.map(write_unit, *zip(*tasks)))
    else:
        units = [write_unit(*task) for task in tasks]
    locked = ", ".join(f'"{joint}" = 0.0' for joint in MODEL_FILES[fleet.robot].locked)
    (folder / "twincal.toml").write_text(f'[model]\nfile = "{model_file(fleet.robot)}"\nlocked = {{ {locked} }}\n')
    common = type_of(fleet)
    truth = {"version": VERSION, "fleet": asdict(fleet), "joints": list(common.nominal.names)[1:], "onset": ONSET, "scatter": SCATTER,
             "noise_sd": common.noise_sd.tolist(), "adapter": common.adapter, "type": [asdict(cause) for cause in common.causes(fleet.kind)],
             "units": units}  # fmt: skip
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    return truth


def fleet_of(given, seed):
    """The fleet that arguments ask for; the kind `panda` is a standard fleet of that robot."""
    robot = "panda" if given.kind == "panda" else given.robot
    return Fleet(robot, given.units, given.windows, given.seconds, given.rate, seed, given.kind, given.sds, given.of, given.short)


def add_arguments(arguments):
    """Arguments that say what is simulated, the seed excepted."""
    arguments.add_argument("--robot", choices=arms.ROBOTS, default=Fleet.robot)
    arguments.add_argument("--kind", choices=KINDS + HELD_BACK, default=Fleet.kind)
    arguments.add_argument("--units", type=int, default=Fleet.units)
    arguments.add_argument("--windows", type=int, default=Fleet.windows, help="weeks, at least 3")
    arguments.add_argument("--seconds", type=float, default=Fleet.seconds, help="length of a log")
    arguments.add_argument("--rate", type=int, default=Fleet.rate, help="Hz")
    arguments.add_argument("--sds", type=float, default=Fleet.sds, help="size of a deviation in standard deviations")
    arguments.add_argument("--of", choices=("window", "units"), default=Fleet.of,
                           help="standard deviation of one window's error, or of that and the scatter of the units")  # fmt: skip
    arguments.add_argument("--short", action="store_true", help="one more unit, `new`, with a log of 10 s")
    arguments.add_argument("--jobs", type=int, default=1, help="processes that simulate")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(arguments)
    arguments.add_argument("--seed", type=int, default=Fleet.seed)
    arguments.add_argument("-o", "--output", type=Path, default=Path("fleet"))
    given = arguments.parse_args()
    for unit in make(fleet_of(given, given.seed), given.output, given.jobs)["units"]:
        for one in unit["deviations"]:
            print(f"{unit['robot']}: {one['effect']} {one['size']:+.4g} {one['unit']}, {one['scatter_sds']:.1f} standard deviations of the scatter")


if __name__ == "__main__":
    main()

"""Whether a designed motion decides what a poor log leaves open, beside random motion in the same limits.

    run --program P --seeds FIRST LAST [--count 20] [--robot ur5 panda] [--pair payload gain spring] [--misfit none lugre lugre_usual]
        [--sds 5] [--lines X.jsonl]
    run --read X.jsonl

Per seed: a robot with one of two causes, a poor log that leaves both open, a twin; then 20 s of designed and of random motion, each simulated
and fitted together with the poor log. A question is decided where a PIP leaves 0.05 … 0.95, rightly where the cause is the true one.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from functools import cache, cached_property
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "worlds")]
import poor  # noqa: E402
import sizing  # noqa: E402
import tally  # noqa: E402
from shared import BASE_RATE, MODEL_FILES, load, lugre, model_file  # noqa: E402
from sizing import COULOMB_VELOCITY, NOISE  # noqa: E402

RATE = 200.0  # Hz, of logs
SECONDS = 20.0
RAMP = 2.0  # s, from rest to random motion and back
LIMITS = {"velocity": 1.5, "acceleration": 5.0, "jerk": 60.0}  # rad, s
REACH = 1.2  # rad, about the start
START = {"ur5": (0.0, -1.2, 1.4, -1.0, -0.8, 0.3), "panda": (0.0, -0.4, 0.2, -1.8, 0.3, 1.6, 0.4)}
FRICTION = (1.0, 1.5)  # viscous in N m s/rad and Coulomb in N m, of every joint
LOAD = (2.0, (0.0, 0.0, 0.08))  # kg and m in the frame of the last moving link: the known load of the pair `gain`
DECIDED = (0.05, 0.95)
# Pair: the two effects, their fixed sizes, candidates beside friction.
PAIRS = {
    "payload": {"effects": ("payload", "{before_last}.density"), "sizes": (0.25, 0.25), "families": ["payload", "density"]},
    "gain": {"effects": ("drives.gain", "payload"), "sizes": (0.05, 0.25), "families": ["gain", "payload"]},
    "spring": {"effects": ("{second}.spring", "{second}.potential"), "sizes": (4.0, 4.0), "families": ["spring", "potential"]},
}
USUAL = ("stribeck", "asymmetry", "quadratic_friction", "hysteresis")  # candidates that LuGre friction is near to
KEYS = ("robot", "pair", "misfit", "sds", "scale")  # of a table
# The cause of each effect: what `World.real` and `World.torque` change.
CAUSES = {"payload": ("payload", "density"), "gain": ("gain", "payload"), "spring": ("spring", "potential")}


class World:
    """A robot with one cause of a pair, and its friction; `sds` standard errors large, or as large as PAIRS says."""

    def __init__(self, robot, pair, seed, scale=1.0, sds=None, misfit="none"):
        self.robot, self.pair, self.seed, self.misfit = robot, pair, seed, misfit
        self.file, self.locked = model_file(robot), MODEL_FILES[robot].locked
        self.model = load(robot)
        self.dof = self.model.nv
        self.start = np.array(START[robot])
        self.true = seed % 2
        self.causes = CAUSES[pair]
        self.cause = self.causes[self.true]
        self.joints = list(self.model.names)[1:]
        frames = [(f.name, f.parentJoint) for f in self.model.frames if f.type == pin.FrameType.BODY]
        links = [next(name for name, parent in frames if parent == j + 1) for j in range(self.dof)]
        self.last = links[-1]
        names = {"before_last": links[-2], "second": self.joints[1]}
        self.effects = [name.format(**names) for name in PAIRS[pair]["effects"]]
        self.error = None if sds is None else standard_error(robot, pair, self.true, misfit)
        self.size = scale * (PAIRS[pair]["sizes"][self.true] if sds is None else sds * self.error)
        self.families = ["viscous", "coulomb", *(USUAL if misfit == "lugre_usual" else ()), *PAIRS[pair]["families"]]

    @cached_property
    def real(self):
        """Pinocchio model of the real robot without the known load."""
        real = self.model.copy()
        if self.cause in ("payload", "density"):
            joint = self.dof if self.cause == "payload" else self.dof - 1
            real.inertias[joint] = real.inertias[joint] + sizing.body(self.model, self.cause, self.size)
        return real

    def with_load(self, model):
        """A model that carries the known load."""
        loaded = model.copy()
        loaded.inertias[self.dof] = loaded.inertias[self.dof] + pin.Inertia(LOAD[0], np.array(LOAD[1]), np.zeros((3, 3)))
        return loaded

    def friction(self, qd):
        """Friction torque; LuGre's state is integrated at BASE_RATE."""
        viscous = FRICTION[0] * qd
        if self.misfit == "none":
            return viscous + FRICTION[1] * np.tanh(qd / COULOMB_VELOCITY)
        every = round(BASE_RATE / RATE)
        fine = np.arange((len(qd) - 1) * every + 1) / every
        speed = np.stack([np.interp(fine, np.arange(len(qd)), own) for own in qd.T], axis=1)
        joints = SimpleNamespace(coulomb=np.full(self.dof, FRICTION[1]), viscous=np.full(self.dof, FRICTION[0]))
        return lugre(joints, speed)[::every]

    def missed(self, qd):
        """Friction that no viscous and Coulomb column has; `None` without misfit."""
        if self.misfit == "none":
            return None
        return self.friction(qd) - FRICTION[0] * qd - FRICTION[1] * np.tanh(qd / COULOMB_VELOCITY)

    def torque(self, q, qd, qdd, loaded=False):
        """Torque of the real robot without noise."""
        real = self.with_load(self.real) if loaded else self.real
        data = real.createData()
        tau = np.array([pin.rnea(real, data, *state) for state in zip(q, qd, qdd, strict=True)]) + self.friction(qd)
        if self.cause == "spring":
            tau[:, 1] += self.size * (q[:, 1] - self.start[1])
        elif self.cause == "potential":
            tau[:, 1] += self.size * np.sin(q[:, 1])
        elif self.cause == "gain":
            tau *= 1.0 + self.size
        return tau

    def write(self, path, motion, number, loaded=False):
        """A log of a motion, with noise."""
        t, q, qd, qdd = motion
        rng = np.random.default_rng([self.seed, number, 91])
        tau = self.torque(q, qd, qdd, loaded) + NOISE * rng.normal(size=q.shape)
        names = ["t", *(f"{what}{j + 1}" for what in ("q", "qd", "tau") for j in range(self.dof))]
        np.savetxt(path, np.hstack([t[:, None], q, qd, tau]), delimiter=",", header=",".join(names), comments="", fmt="%.9g")

    def fourier(self, number, moves, share=1.0, ramp=SECONDS / 2):
        """Fourier motion from rest to rest with random coefficients, as large as the limits let it be, times `share`."""
        rng = np.random.default_rng([self.seed, number, 92])
        t = np.arange(round(SECONDS * RATE) + 1) / RATE
        w = 2.0 * np.pi * np.arange(1, 9) / SECONDS
        window = np.sin(0.5 * np.pi * np.clip(np.minimum(t, SECONDS - t) / ramp, 0.0, 1.0)) ** 4
        q = np.zeros((t.size, self.dof))
        for j in moves:
            a, b = rng.normal(size=(2, w.size))
            wave = (np.sin(np.outer(t, w)) @ a + np.cos(np.outer(t, w)) @ b) * window
            first, second, third = (self.derivative(wave, order) for order in (1, 2, 3))
            largest = max(np.abs(wave).max() / REACH, np.abs(first).max() / LIMITS["velocity"],
                          np.abs(second).max() / LIMITS["acceleration"], np.abs(third).max() / LIMITS["jerk"])  # fmt: skip
            q[:, j] = share * wave / largest
        return t, q + self.start, self.derivative(q, 1), self.derivative(q, 2)

    def random(self, number):
        """Random motion of all joints."""
        return self.fourier(number, range(self.dof), ramp=RAMP)

    @staticmethod
    def derivative(x, order):
        for _ in range(order):
            x = np.gradient(x, 1.0 / RATE, axis=0, edge_order=2)
        return x


@cache
def standard_error(robot, pair, true, misfit):
    """Standard error of the size of a cause that random motion gives: one number for all seeds."""
    return sizing.standard_error(World(robot, pair, true, misfit=misfit))


def call(program, folder, *command):
    """Runs twincal; 3 is a result with a warning."""
    done = subprocess.run([str(program), *map(str, command)], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode not in (0, 3):
        raise RuntimeError(f"{command[0]}: {done.stderr[-600:]}")


def fit(program, folder, *logs, to):
    """PIP of every effect after a fit of logs."""
    call(program, folder, "fit", *logs, "-o", to, "--force", "--threads", 1)
    result = json.loads((folder / to / "result.json").read_text())
    return {own["name"]: own["pip"] or 0.0 for own in result["components"]}


def verdict(world, found):
    """Whether both effects of the pair are decided, and whether rightly."""
    said = [found.get(name, 0.0) for name in world.effects]
    want = [world.true == 0, world.true == 1]
    right = all(pip >= DECIDED[1] if is_there else pip <= DECIDED[0] for pip, is_there in zip(said, want, strict=True))
    wrong = any(pip <= DECIDED[0] if is_there else pip >= DECIDED[1] for pip, is_there in zip(said, want, strict=True))
    others = sorted(((pip, name) for name, pip in found.items() if not name.endswith((".viscous", ".coulomb")) and name not in world.effects))
    return {"pips": said, "right": right, "wrong": wrong, "beside": [(name, pip) for pip, name in reversed(others[-3:]) if pip > 0.05]}


def limits_text(world):
    """limits.toml: narrow ones of every joint, and what the robot is known to carry in the motion."""
    lines = [f"load = {{ mass = {LOAD[0]}, com = {list(LOAD[1])} }}"] if world.pair == "gain" else []
    for name, start in zip(world.joints, world.start, strict=True):
        lines += [f'[joint."{name}"]', f"position = [{start - REACH}, {start + REACH}]", f"start = {start}", "torque = 1000.0"]
        lines += [f"{key} = {value}" for key, value in LIMITS.items()]
    return "\n".join(lines) + "\n"


def config_text(world, prior):
    """twincal.toml: the candidates, expected numbers of families, and what the second logs carry."""
    locked = ", ".join(f'"{joint}" = 0.0' for joint in world.locked)
    lines = ["[model]", f'file = "{world.file}"', f"locked = {{ {locked} }}", "[library]", f"families = {json.dumps(world.families)}",
             f'payload_frame = "{world.last}"']  # fmt: skip
    if prior:
        lines += ["[prior.families]", *(f"{family} = {number!r}" for family, number in prior.items())]
    if world.pair == "gain":
        for kind in ("designed", "random"):
            lines += ["[[log]]", f'file = "{kind}.csv"', f"payload = {{ mass = {LOAD[0]}, com = {list(LOAD[1])} }}"]
    return "\n".join(lines) + "\n"


def one(program, world, folder):
    """One seed; its line."""
    (folder / "limits.toml").write_text(limits_text(world))
    line = {"robot": world.robot, "pair": world.pair, "misfit": world.misfit, "seed": world.seed, "true": world.effects[world.true],
            "effects": world.effects, "size": world.size, "error": world.error}  # fmt: skip

    def fit_poor(prior):
        (folder / "twincal.toml").write_text(config_text(world, prior))
        return fit(program, folder, "poor.csv", to="poor")

    search = poor.Search(world, folder, fit_poor)
    line |= search.fixed() if world.error is None else search.searched()
    if not line["kept"]:
        return line
    call(program, folder, "design", "--twin", "poor", "--limits", "limits.toml", "--decide", *world.effects,
         "--duration", SECONDS, "--rate", RATE, "-o", "motion", "--force", "--threads", 1)  # fmt: skip
    line["promises"] = json.loads((folder / "motion" / "design.json").read_text())["promises"]
    table, n = np.loadtxt(folder / "motion" / "motion.csv", delimiter=",", skiprows=1), world.dof
    motions = {"designed": (table[:, 0], *(table[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))), "random": world.random(1)}
    for number, (kind, motion) in enumerate(motions.items(), 1):
        world.write(folder / f"{kind}.csv", motion, number, loaded=world.pair == "gain")
        line[kind] = verdict(world, fit(program, folder, "poor.csv", f"{kind}.csv", to=f"after-{kind}"))
        line[kind]["sds"] = world.size / sizing.error_of(world, motion)
    return line


def seeds_of(given, robot, pair, misfit):
    """Runs the seeds of one table until enough are kept; lines that are there already are not made anew."""
    known = tally.read(given.lines) if given.lines and given.lines.exists() else []
    wanted = (robot, pair, misfit, given.sds, given.scale)
    known = {line["seed"]: line for line in known if tuple(line[key] for key in KEYS) == wanted}
    lines = []
    for seed in range(given.seeds[0], given.seeds[1] + 1):
        if given.count and sum(line["kept"] for line in lines) >= given.count:
            break
        line = known.get(seed)
        if line is None:
            line = new_line(given, robot, pair, misfit, seed)
            if given.lines:
                with given.lines.open("a") as file:
                    file.write(json.dumps(line) + "\n")
        lines.append(line)
        print(tally.sentence(line), flush=True)
    return lines


def new_line(given, robot, pair, misfit, seed):
    """Runs one seed in a separate folder."""
    folder = (given.keep or Path(tempfile.mkdtemp())) / f"{robot}-{pair}-{misfit}-{seed}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    before = time.monotonic()
    line = one(given.program.resolve(), World(robot, pair, seed, given.scale, given.sds or None, misfit), folder)
    if not given.keep:
        shutil.rmtree(folder)
    return line | {"sds": given.sds, "scale": given.scale, "seconds": round(time.monotonic() - before, 1)}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", type=Path, default=Path(os.environ.get("TWINCAL", HERE.parents[1] / "target/release/twincal")))
    arguments.add_argument("--seeds", type=int, nargs=2, metavar=("FIRST", "LAST"))
    arguments.add_argument("--count", type=int, help="stop a table after so many kept seeds")
    arguments.add_argument("--robot", choices=sorted(START), nargs="+", default=["ur5"])
    arguments.add_argument("--pair", choices=list(PAIRS), nargs="+", default=["payload"])
    arguments.add_argument("--misfit", choices=["none", "lugre", "lugre_usual"], nargs="+", default=["none"])
    arguments.add_argument("--sds", type=float, default=5.0, help="size of the cause in standard errors; 0: the sizes of PAIRS, a fixed poor log")
    arguments.add_argument("--scale", type=float, default=1.0, help="factor on the size of the cause")
    arguments.add_argument("--keep", type=Path, help="folder in which all files stay")
    arguments.add_argument("--lines", type=Path, help="file of one line per seed; seeds in it are not run again")
    arguments.add_argument("--read", type=Path, help="print the tables of such a file and run nothing")
    given = arguments.parse_args()
    if given.read:
        return tally.report(tally.read(given.read))
    if not given.seeds:
        arguments.error("give --seeds FIRST LAST or --read FILE")
    tables = [(robot, pair, misfit) for misfit in given.misfit for robot in given.robot for pair in given.pair]
    return tally.report([line for table in tables for line in seeds_of(given, *table)])


if __name__ == "__main__":
    main()

"""Whether a designed motion decides what a poor log leaves open, beside random motion in the same limits.

    run --program P --seeds FIRST LAST [--robot ur5] [--pair payload|spring] [--scale 1] [--keep DIR] [--lines X.jsonl]

Per seed: a robot with one of two causes, a poor log, a twin; then 20 s of designed and of random motion, each simulated and fitted together
with the poor log. A question is decided where a PIP leaves 0.05 … 0.95, rightly where the cause is the true one.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "worlds")]
from shared import model_file  # noqa: E402

RATE = 200.0  # Hz, of logs
SECONDS = 20.0
LIMITS = {"velocity": 1.5, "acceleration": 5.0, "jerk": 60.0}  # rad, s
REACH = 1.2  # rad, about the start
START = {"ur5": (0.0, -1.2, 1.4, -1.0, -0.8, 0.3), "panda": (0.0, -0.4, 0.2, -1.8, 0.3, 1.6, 0.4)}
FRICTION = (1.0, 1.5)  # viscous in N m s/rad and Coulomb in N m, of every joint
COULOMB_VELOCITY = 0.01  # rad/s
NOISE = 0.3  # N m, sd of every joint
DECIDED = (0.05, 0.95)
# Pair: joints that move in the poor log, the two effects, their sizes.
PAIRS = {
    "payload": {"moves": (0, 1, 2), "effects": ("payload", "{before_last}.density"), "sizes": (0.25, 0.25)},
    "spring": {"moves": (1,), "effects": ("{second}.spring", "{second}.potential"), "sizes": (4.0, 4.0)},
}
FAMILIES = ["viscous", "coulomb", "payload", "density", "spring", "potential"]


class World:
    """A robot with one cause of a pair, and its friction."""

    def __init__(self, robot, pair, seed, scale=1.0):
        self.robot, self.pair, self.seed = robot, pair, seed
        self.file = model_file(robot)
        self.model = pin.buildModelFromUrdf(str(self.file))
        self.dof = self.model.nv
        self.start = np.array(START[robot][: self.dof])
        self.true = seed % 2
        joints = list(self.model.names)[1:]
        links = {name: [f.name for f in self.model.frames if f.parentJoint == j + 1 and f.type == pin.FrameType.BODY][0] for j, name in enumerate(joints)}
        names = {"before_last": links[joints[-2]], "second": joints[1]}
        self.effects = [name.format(**names) for name in PAIRS[pair]["effects"]]
        self.real = self.model.copy()
        self.size = size = scale * PAIRS[pair]["sizes"][self.true]
        if self.pair == "payload":
            joint = self.dof if self.true == 0 else self.dof - 1
            own = self.real.inertias[joint]
            extra = pin.Inertia(size, np.array([0.0, 0.0, 0.05]), np.zeros((3, 3))) if self.true == 0 else pin.Inertia(
                size, own.lever, own.inertia * size / own.mass)  # fmt: skip
            self.real.inertias[joint] = own + extra
        self.data = self.real.createData()

    def torque(self, q, qd, qdd):
        """Torque of the real robot without noise."""
        rigid = np.array([pin.rnea(self.real, self.data, *state) for state in zip(q, qd, qdd, strict=True)])
        tau = rigid + FRICTION[0] * qd + FRICTION[1] * np.tanh(qd / COULOMB_VELOCITY)
        if self.pair == "spring":
            away = q[:, 1] - self.start[1]
            tau[:, 1] += self.size * (away if self.true == 0 else np.sin(q[:, 1]))
        return tau

    def write(self, path, motion, number):
        """A log of a motion, with noise."""
        t, q, qd, qdd = motion
        rng = np.random.default_rng([self.seed, number, 91])
        tau = self.torque(q, qd, qdd) + NOISE * rng.normal(size=q.shape)
        names = ["t", *(f"{what}{j + 1}" for what in ("q", "qd", "tau") for j in range(self.dof))]
        np.savetxt(path, np.hstack([t[:, None], q, qd, tau]), delimiter=",", header=",".join(names), comments="", fmt="%.9g")

    def fourier(self, number, moves, share=1.0):
        """Windowed Fourier motion from rest to rest with random coefficients, as large as the limits let it be."""
        rng = np.random.default_rng([self.seed, number, 92])
        t = np.arange(round(SECONDS * RATE) + 1) / RATE
        w = 2.0 * np.pi * np.arange(1, 9) / SECONDS
        window = np.sin(np.pi * t / SECONDS) ** 4
        q = np.zeros((t.size, self.dof))
        for j in moves:
            a, b = rng.normal(size=(2, w.size))
            wave = (np.sin(np.outer(t, w)) @ a + np.cos(np.outer(t, w)) @ b) * window
            first, second, third = (self.derivative(wave, order) for order in (1, 2, 3))
            largest = max(np.abs(wave).max() / REACH, np.abs(first).max() / LIMITS["velocity"],
                          np.abs(second).max() / LIMITS["acceleration"], np.abs(third).max() / LIMITS["jerk"])  # fmt: skip
            q[:, j] = share * wave / largest
        return t, q + self.start, self.derivative(q, 1), self.derivative(q, 2)

    @staticmethod
    def derivative(x, order):
        for _ in range(order):
            x = np.gradient(x, 1.0 / RATE, axis=0, edge_order=2)
        return x


def call(program, folder, *command):
    done = subprocess.run([str(program), *map(str, command)], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode not in (0, 3):
        raise RuntimeError(f"{command[0]}: {done.stderr[-600:]}")


def pips(folder):
    result = json.loads((folder / "result.json").read_text())
    return {own["name"]: own["pip"] or 0.0 for own in result["components"]}


def verdict(world, found):
    """Whether both effects of the pair are decided, and whether rightly."""
    said = [found.get(name, 0.0) for name in world.effects]
    want = [world.true == 0, world.true == 1]
    right = all(pip >= DECIDED[1] if is_there else pip <= DECIDED[0] for pip, is_there in zip(said, want, strict=True))
    wrong = any(pip <= DECIDED[0] if is_there else pip >= DECIDED[1] for pip, is_there in zip(said, want, strict=True))
    return {"pips": said, "right": right, "wrong": wrong}


def limits_text(world):
    names = list(world.model.names)[1:]
    lines = []
    for name, start in zip(names, world.start, strict=True):
        lines += [f'[joint."{name}"]', f"position = [{start - REACH}, {start + REACH}]", f"start = {start}", "torque = 1000.0"]
        lines += [f"{key} = {value}" for key, value in LIMITS.items()]
    return "\n".join(lines) + "\n"


def one(program, world, folder):
    """One seed; its line."""
    config = f'[model]\nfile = "{world.file}"\n[library]\nfamilies = {json.dumps(FAMILIES)}\n'
    (folder / "twincal.toml").write_text(config)
    (folder / "limits.toml").write_text(limits_text(world))
    world.write(folder / "poor.csv", world.fourier(0, PAIRS[world.pair]["moves"], 0.25), 0)
    call(program, folder, "fit", "poor.csv", "-o", "poor", "--force")
    before = pips(folder / "poor")
    call(program, folder, "design", "--twin", "poor", "--limits", "limits.toml", "--decide", *world.effects,
         "--duration", SECONDS, "--rate", RATE, "-o", "motion", "--force")  # fmt: skip
    table = np.loadtxt(folder / "motion" / "motion.csv", delimiter=",", skiprows=1)
    n = world.dof
    world.write(folder / "designed.csv", (table[:, 0], *(table[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))), 1)
    world.write(folder / "random.csv", world.fourier(1, range(n)), 2)
    line = {"robot": world.robot, "pair": world.pair, "seed": world.seed, "true": world.effects[world.true], "effects": world.effects,
            "before": [before.get(name, 0.0) for name in world.effects],
            "promises": json.loads((folder / "motion" / "design.json").read_text())["promises"]}  # fmt: skip
    for kind in ("designed", "random"):
        call(program, folder, "fit", "poor.csv", f"{kind}.csv", "-o", f"after-{kind}", "--force")
        line[kind] = verdict(world, pips(folder / f"after-{kind}"))
    return line


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", type=Path, default=Path(os.environ.get("TWINCAL", HERE.parents[1] / "target/release/twincal")))
    arguments.add_argument("--seeds", type=int, nargs=2, metavar=("FIRST", "LAST"), required=True)
    arguments.add_argument("--robot", choices=sorted(START), default="ur5")
    arguments.add_argument("--pair", choices=sorted(PAIRS), default="payload")
    arguments.add_argument("--scale", type=float, default=1.0, help="factor on the size of the cause")
    arguments.add_argument("--keep", type=Path)
    arguments.add_argument("--lines", type=Path)
    given = arguments.parse_args()
    lines = []
    for seed in range(given.seeds[0], given.seeds[1] + 1):
        folder = (given.keep or Path(tempfile.mkdtemp())) / f"{given.robot}-{given.pair}-{seed}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        line = one(given.program.resolve(), World(given.robot, given.pair, seed, given.scale), folder)
        if not given.keep:
            shutil.rmtree(folder)
        lines.append(line)
        if given.lines:
            with given.lines.open("a") as file:
                file.write(json.dumps(line) + "\n")
        print(f"{seed} {line['true']}: before {np.round(line['before'], 2)}, designed {np.round(line['designed']['pips'], 2)}, "
              f"random {np.round(line['random']['pips'], 2)}", flush=True)  # fmt: skip
    for kind in ("designed", "random"):
        right, wrong = (sum(line[kind][what] for line in lines) for what in ("right", "wrong"))
        print(f"{kind}: decided rightly {right} of {len(lines)}, wrongly {wrong}")


if __name__ == "__main__":
    main()

"""The two logs of docs/howto/motion_that_decides.md, simulated in MuJoCo, and how often the designed motion decides.

    tutorial.py record poor.csv                               # one joint moves a little
    tutorial.py record second.csv --motion motion/motion.csv  # every joint moves as it was designed
    tutorial.py study --program P --seeds 1 10 [--robot arm ur5] [--seconds 20] [--replay]

The real arm is the model file with friction and motor inertia in every joint, and one cause: a payload, or a base that is not level.
MuJoCo computes the torque. A log has positions in counts of 20 bits per turn, and torque with noise whose correlation time is 12 ms.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from math import cos, exp, pi, sin
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).resolve().parent
RATE = 125.0  # Hz, of a log
SECONDS, SIZE, CYCLE = 10.0, 0.3, 4.0  # of the poor log: s; rad and s per cycle of its only motion
COUNT = 2 * pi / 2**20  # rad, of the encoders
NOISE_TIME = 0.012  # s
REVERSAL = 0.02  # rad/s: Coulomb friction is F tanh(velocity / REVERSAL)
CENTRE, RADIUS = (0.02, 0.0, 0.06), 0.04  # m, of the payload: in the frame of the flange; of a solid ball
GRAVITY = 9.81  # m/s²
PAYLOAD = 0.4  # kg
CAUSES = ("payload", "base.tilt")
SPREAD = (0.75, 1.5)  # of a cause's size in the study
DECIDED = (0.05, 0.95)  # PIP of an effect that is out; of one that is in


@dataclass(frozen=True)
class Robot:
    """An arm; numbers per joint."""

    middle: tuple  # rad, of the poor log
    moves: int  # joint that moves in it
    flange: str  # link of the payload
    viscous: tuple  # N m s/rad
    coulomb: tuple  # N m
    motor: tuple  # kg m², motor inertia at the joint
    noise: tuple  # N m, sd
    tilt: float  # rad about the base's y axis
    limits: str = ""  # limits.toml


ARM_LIMITS = """floor = 0.0
[joint]
waist = { velocity = 2.0, acceleration = 8.0 }
shoulder = { velocity = 2.0, acceleration = 8.0 }
elbow = { velocity = 2.0, acceleration = 8.0 }
wrist = { velocity = 2.0, acceleration = 8.0 }
"""
UR5 = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
ROBOTS = {
    "arm": Robot((0.0, 0.3, 1.0, 0.2), 2, "tool0", (4.0, 5.0, 2.5, 0.6), (3.0, 4.0, 2.0, 0.5), (0.30, 0.35, 0.12, 0.02),
                 (0.25, 0.30, 0.15, 0.06), 0.03, ARM_LIMITS),
    "ur5": Robot((0.0, -1.2, 1.4, -1.0, -0.8, 0.3), 2, "tool0", (5.0, 6.0, 4.0, 1.5, 1.2, 1.0), (4.0, 5.0, 3.0, 1.2, 1.0, 0.8),
                 (0.5, 0.6, 0.4, 0.1, 0.1, 0.1), (0.4, 0.5, 0.3, 0.1, 0.1, 0.1), 0.06,
                 "".join(f"[joint.{name}]\nvelocity = 2.0\nacceleration = 8.0\n" for name in UR5)),
}  # fmt: skip


def model_file(robot):
    """URDF of a robot: beside this file, of the examples, or of the package example-robot-data."""
    places = [HERE / f"{robot}.urdf", HERE.parents[1] / "examples" / "arm" / f"{robot}.urdf"]
    if found := next((place for place in places if place.exists()), None):
        return found
    sys.path.insert(0, str(HERE.parent / "industrial_arms"))
    import simulate_arms

    return simulate_arms.model_file(robot)


class World:
    """A real arm with one cause."""

    def __init__(self, robot="arm", seed=1, cause="payload", share=1.0):
        self.name, self.robot, self.seed, self.cause = robot, ROBOTS[robot], seed, cause
        self.file, self.size = model_file(robot), share * (PAYLOAD if cause == "payload" else self.robot.tilt)
        text = re.sub(r"<(visual|collision)>.*?</\1>", "", self.file.read_text(), flags=re.DOTALL)
        compiler = '<mujoco><compiler fusestatic="false"/></mujoco></robot>'  # keeps the flange
        spec = mujoco.MjSpec.from_string(text.replace("</robot>", compiler))
        if cause == "payload":
            ball = spec.body(self.robot.flange).add_body(name="payload")
            ball.mass, ball.ipos, ball.inertia = self.size, CENTRE, (0.4 * self.size * RADIUS**2,) * 3
            ball.explicitinertial = True
        self.model = spec.compile()
        self.joints = [self.model.joint(j).name for j in range(self.model.njnt)]
        self.model.dof_armature = self.robot.motor
        tilt = self.size if cause == "base.tilt" else 0.0
        self.model.opt.gravity = (-GRAVITY * sin(tilt), 0.0, -GRAVITY * cos(tilt))

    @classmethod
    def drawn(cls, robot, seed):
        """World of a seed: odd ones have a payload, even ones a tilt."""
        share = np.random.default_rng([seed, 90]).uniform(*SPREAD)
        return cls(robot, seed, CAUSES[1 - seed % 2], share)

    @property
    def true(self):
        """Effects that are there, each with its parameter and value."""
        own = {f"{joint}.{kind}": ("value", value) for kind in ("viscous", "coulomb", "motor")
               for joint, value in zip(self.joints, getattr(self.robot, kind), strict=True)}  # fmt: skip
        own = {name.replace(".motor", ".motor_inertia"): value for name, value in own.items()}
        return own | {self.cause: ("mass", self.size) if self.cause == "payload" else ("x", -GRAVITY * sin(self.size))}

    def torque(self, q, qd, qdd):
        """Torque of the motors without noise."""
        data, rows = mujoco.MjData(self.model), []
        for data.qpos, data.qvel, data.qacc in zip(q, qd, qdd, strict=True):
            mujoco.mj_inverse(self.model, data)
            rows.append(data.qfrc_inverse.copy())
        return np.array(rows) + np.array(self.robot.viscous) * qd + np.array(self.robot.coulomb) * np.tanh(qd / REVERSAL)

    def record(self, path, motion, number):
        """Log of a motion; logs of other numbers have other noise."""
        t, q, qd, qdd = motion
        rng = np.random.default_rng([self.seed, number, 91])
        rho, noise = exp(-1.0 / RATE / NOISE_TIME), rng.normal(size=q.shape)
        for row in range(1, len(noise)):
            noise[row] = rho * noise[row - 1] + (1.0 - rho**2) ** 0.5 * noise[row]
        table = np.hstack([t[:, None], np.round(q / COUNT) * COUNT, self.torque(q, qd, qdd) + noise * self.robot.noise])
        names = ["t", *(f"{joint}.{what}" for what in ("q", "tau") for joint in self.joints)]
        np.savetxt(path, table, "%.6f", ",", header=",".join(names), comments="")

    def little(self, seconds=SECONDS):
        """Time, q, qd and qdd of the poor log: a sine wave of one joint."""
        t = np.arange(round(seconds * RATE) + 1) / RATE
        w = 2.0 * pi / CYCLE
        moves = np.arange(len(self.joints)) == self.robot.moves
        waves = (SIZE * np.sin(w * t), SIZE * w * np.cos(w * t), -SIZE * w**2 * np.sin(w * t))
        q, qd, qdd = (np.outer(wave, moves) for wave in waves)
        return t, q + self.robot.middle, qd, qdd


def designed(path):
    """Time, q, qd and qdd of motion.csv, at the log's rate."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    t, n = table[:, 0], (table.shape[1] - 1) // 3
    table = table[:: round(1.0 / RATE / (t[1] - t[0]))]
    return table[:, 0], *(table[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))


def call(program, folder, *command):
    """Runs twincal; 3 is a result with a warning."""
    done = subprocess.run([str(program), *map(str, command)], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode not in (0, 3):
        raise RuntimeError(f"{command[0]}: {done.stderr[-600:]}")


def fit(program, world, folder, *logs, to):
    """PIP of every effect after a fit of logs."""
    call(program, folder, "fit", *logs, "--model", world.file, "-o", to, "--force")
    return {own["name"]: own["pip"] or 0.0 for own in json.loads((folder / to / "result.json").read_text())["components"]}


def one(program, world, folder, seconds=20.0, replay=False):
    """One world, from the poor log to the second fit; `replay` records the poor log's motion again instead of the designed one."""
    world.record(folder / "poor.csv", world.little(), 0)
    before = fit(program, world, folder, "poor.csv", to="poor")
    asked = {name: pip for name, pip in before.items() if DECIDED[0] <= pip < DECIDED[1]}
    line = {"robot": world.name, "seed": world.seed, "cause": world.cause, "size": world.size, "open": bool(asked)}
    if not asked:
        return line
    if replay:
        motion = world.little(seconds)
    else:
        (folder / "limits.toml").write_text(world.robot.limits)
        call(program, folder, "design", "--twin", "poor", "--model", world.file, "--limits", "limits.toml", "--duration", seconds,
             "--seed", world.seed, "-o", "motion", "--force")  # fmt: skip
        motion = designed(folder / "motion" / "motion.csv")
    world.record(folder / "second.csv", motion, 1)
    after = fit(program, world, folder, "poor.csv", "second.csv", to="after")
    asked = {name: (pip, after.get(name, 0.0)) for name, pip in asked.items()}
    expected = dict.fromkeys((*CAUSES, *asked))
    wrong = [name for name in expected if not is_right(after.get(name, 0.0), name in world.true)]
    late = [name for name, pip in after.items() if pip > DECIDED[0] and name not in world.true and name not in expected]
    return line | {"asked": asked, "wrong": wrong, "late": late, "decided": not wrong}


def is_right(pip, is_there):
    """Whether an effect is decided, and rightly."""
    return pip >= DECIDED[1] if is_there else pip <= DECIDED[0]


def study(given):
    """Lines of all seeds, and how many worlds are decided of those that the poor log leaves open."""
    for robot in given.robot:
        lines = []
        for seed in range(given.seeds[0], given.seeds[1] + 1):
            began = time.monotonic()
            with tempfile.TemporaryDirectory() as folder:
                line = one(given.program.resolve(), World.drawn(robot, seed), Path(folder), given.seconds, given.replay)
            lines.append(line)
            print(json.dumps(line | {"seconds": round(time.monotonic() - began, 1)}), flush=True)
        count, asked = sum(line.get("decided", False) for line in lines), sum(line["open"] for line in lines)
        print(f"{robot}: of {len(lines)} worlds the poor log leaves {asked} open; all open effects are decided rightly in {count}", flush=True)
        if not asked or count < given.least * asked:
            sys.exit(1)


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True, dest="command")
    record = commands.add_parser("record", help="write a log of the arm that carries something")
    record.add_argument("log", type=Path)
    record.add_argument("--motion", type=Path, help="motion.csv of twincal design; without it the poor log")
    many = commands.add_parser("study", help="count how often the designed motion decides")
    many.add_argument("--program", type=Path, default=Path(os.environ.get("TWINCAL", HERE.parents[1] / "target/release/twincal")))
    many.add_argument("--seeds", type=int, nargs=2, default=(1, 10), metavar=("FIRST", "LAST"))
    many.add_argument("--robot", choices=list(ROBOTS), nargs="+", default=["arm"])
    many.add_argument("--seconds", type=float, default=20.0, help="length of the designed motion")
    many.add_argument("--least", type=float, default=0.8, help="share of the open worlds that must be decided, else exit code 1")
    many.add_argument("--replay", action="store_true", help="record the poor log's motion again instead of the designed one")
    given = parser.parse_args()
    if given.command == "study":
        return study(given)
    world = World()
    world.record(given.log, designed(given.motion) if given.motion else world.little(), int(given.motion is not None))


if __name__ == "__main__":
    main()

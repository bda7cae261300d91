"""Worlds: which defects a seed gives an arm, their truth, and the logs.

    python worlds.py --kind tilt --seed 3 -o folder

Written are train1.csv, train2.csv, heldout.csv (another motion), twincal.toml, truth.json and third.npz: a third motion without noise
with the torque that every cause contributes to it. The same kind and seed give the same files.
"""

import argparse
import json
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from math import radians
from pathlib import Path

import numpy as np
import pinocchio as pin
from defects import Defects, torque
from defects import Path as Motion
from oracle import standard_errors
from shared import BASE_RATE, HERE, MOTIONS, Arm, Log, Recorder, Study, arms, colored, encode, write_study

VERSION = 3  # of the worlds: logs of another version are made anew
ROBOTS = ("ur5", "panda", "xarm7", "planar3")
OTHER_ROBOTS = ("ur10", "z1")  # of the held-back worlds
KINDS = ("null", "payload_link", "ur5_forearm", "tilt", "joint_zero", "gain", "lugre", "warm_up", "flexible", "link_length",
         "small")  # fmt: skip
HELD_BACK = ("spring", "heavier_wrist", "maxwell_slip", "torque_ripple", "load_friction", "other_robot")
# Largest payload drawn, kg; the least is a fifth of it
PAYLOAD = {"ur5": 3.0, "panda": 2.5, "xarm7": 3.0, "planar3": 1.2, "ur10": 6.0, "z1": 1.5}
# Links (by joint, from 0) that may be heavier: neither the first, which an upright arm hardly moves, nor the last two
MIDDLE = {"ur5": (1, 2), "panda": (1, 2, 3), "xarm7": (1, 2, 3), "planar3": (0, 1), "ur10": (1, 2), "z1": (1, 2)}
BODY = ("mass_moments", "tensor", "mass_scale", "density", "com", "centre_of_mass")


@dataclass
class Cause:
    """One thing that is wrong with the model file, and the components that are true because of it."""

    family: str
    subject: str  # joint or link
    size: float
    unit: str
    mechanism: str  # in Defects
    joint: int | None  # whose torque alone it changes; None: all
    exact: list  # names of components that describe it
    true: list  # names of components that count as it
    body: list = field(default_factory=list)  # links of its body: all their levels count


@dataclass(eq=False)
class World:
    """One robot with its defects, and how it is recorded."""

    kind: str
    seed: int
    robot: str
    motion: str
    heldout: str  # kind of motion of the held-out log
    third: str  # kind of the noise-free motion
    torque: str  # what the log says of its torque: joint or current
    recorder: Recorder
    defects: Defects
    causes: list

    @cached_property
    def arm(self):
        """The arm without defects, with its friction."""
        return Arm(arms.World(self.robot, self.motion, payload=0.0, seed=self.seed))


def links_of(model, joint):
    """Names of the links that move with joint number `joint` (from 0) as one body."""
    return [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY and frame.parentJoint == joint + 1]


def body_cause(model, joint, family, size, mechanism, extra=()):
    """A cause that is a body: levels of any link of this joint count."""
    links = links_of(model, joint)
    names = [*extra, *(f"{link}.{level}" for link in links for level in BODY)]
    return Cause(family, links[0], size, "kg", mechanism, None, names, names, links)


def joint_causes(model, sizes, family, unit, mechanism, exact, true=(), only=True):
    """One cause for every joint with a size."""
    names = list(model.names)[1:]
    found = [j for j in range(model.nv) if sizes[j]]
    return [Cause(family, names[j], float(sizes[j]), unit, mechanism, j if only else None,
                  [f"{names[j]}.{end}" for end in exact], [f"{names[j]}.{end}" for end in (*exact, *true)]) for j in found]  # fmt: skip


class Drawer:
    """Draws the defects of one world. Every range that the study states stands in a method of this class."""

    def __init__(self, kind, seed, robot, arm):
        index = (KINDS + HELD_BACK).index(kind)
        self.rng = np.random.default_rng([seed, index, 11])
        self.seed, self.robot, self.arm, self.model = seed, robot, arm, arm.model
        self.defects, self.causes = {}, []

    def sign(self):
        """Plus or minus one."""
        return self.rng.choice((-1.0, 1.0))

    def some(self, joints, low, high):
        """One or two of the joints with a size between low and high, either sign; the others 0."""
        sizes = np.zeros(self.model.nv)
        for j in self.rng.choice(joints, min(len(joints), self.rng.integers(1, 3)), replace=False):
            sizes[j] = self.sign() * self.rng.uniform(low, high)
        return tuple(sizes)

    def seen(self, make):
        """Joints whose defect `make(joint)` changes some joint's torque by more than 1 % of its Coulomb friction on a probe."""
        rng = np.random.default_rng(5)
        q, qd, qdd = rng.uniform(self.arm.low, self.arm.high, (60, self.model.nv)), *rng.normal(size=(2, 60, self.model.nv))
        probe = Motion(np.zeros(60), q, qd, qdd)
        base = torque(self.arm, Defects(), probe)
        size = lambda j: np.sqrt(np.mean((torque(self.arm, make(j), probe) - base) ** 2, 0))
        return [j for j in range(self.model.nv) if (size(j) > 0.01 * self.arm.coulomb).any()]

    def one_joint(self, j, value):
        """A tuple with `value` at joint j."""
        return tuple(value if i == j else 0.0 for i in range(self.model.nv))

    def payload(self):
        """A ball of a fifth to all of the largest payload, 3 to 10 cm out and up to 4 cm beside the last joint."""
        mass = PAYLOAD[self.robot] * self.rng.uniform(0.2, 1.0)
        beside = self.rng.uniform(-0.04, 0.04, 2)
        centre = (float(beside[0]), float(beside[1]), float(self.rng.uniform(0.03, 0.10)))
        self.defects["payload"] = (float(mass), centre)
        self.causes.append(body_cause(self.model, self.model.nv - 1, "payload", float(mass), "payload", ("payload", "payload.tensor")))

    def maybe_payload(self):
        """A payload in half of the worlds."""
        if self.rng.random() < 0.5:
            self.payload()

    def heavier(self, joints):
        """One link with 10 to 30 % more mass, first moments and tensor."""
        joint, factor = int(self.rng.choice(joints)), 1.0 + self.rng.uniform(0.10, 0.30)
        self.defects["heavier"] = (joint, factor)
        mass = self.model.inertias[joint + 1].mass * (factor - 1.0)
        self.causes.append(body_cause(self.model, joint, "body", float(mass), "heavier"))

    def null(self):
        """Nothing but viscous and Coulomb friction."""

    def payload_link(self):
        """A payload, and a middle link with 10 to 30 % more mass, first moments and tensor."""
        self.payload()
        self.heavier(MIDDLE[self.robot])

    def ur5_forearm(self):
        """UR5 with a payload and a forearm with 10 to 30 % more mass, first moments and tensor."""
        self.payload()
        self.heavier((2,))

    def tilt(self):
        """The base leans by 0.5 to 3 degrees about a horizontal axis."""
        self.lean(self.rng.uniform(0.5, 3.0))
        self.maybe_payload()

    def lean(self, degrees):
        """The base leans about a horizontal axis (the joints' own on the planar arm)."""
        angle = radians(degrees)
        around = 0.0 if self.robot == "planar3" else self.rng.uniform(-np.pi, np.pi)
        pitch = self.sign() * angle
        turn = pin.exp3(pitch * np.array([np.sin(around), np.cos(around), 0.0]))
        self.defects["tilt"] = tuple(float(x) for x in pin.rpy.matrixToRpy(turn))
        self.causes.append(Cause("tilt", "base", float(np.degrees(pitch)), "degrees", "tilt", None, ["base.tilt"], ["base.tilt"]))

    def joint_zero(self):
        """0.3 to 1.5 degrees on one or two joints."""
        joints = self.seen(lambda j: Defects(zero=self.one_joint(j, radians(1.0))))
        self.defects["zero"] = sizes = self.some(joints, radians(0.3), radians(1.5))
        self.causes += joint_causes(self.model, sizes, "encoder_zero", "rad", "zero", ["encoder_zero"], only=False)
        self.maybe_payload()

    def gain(self):
        """3 to 10 % on one or two joints, and a payload."""
        joints = self.seen(lambda j: Defects(gain=self.one_joint(j, 0.05)))
        self.defects["gain"] = sizes = self.some(joints, 0.03, 0.10)
        self.causes += joint_causes(self.model, sizes, "gain", "1", "gain", ["gain"])
        self.payload()

    def lugre(self):
        """LuGre friction on every joint: 4 mrad of presliding, a quarter more at breakaway."""
        self.defects["lugre"] = (1.0,) * self.model.nv
        self.causes += joint_causes(self.model, self.arm.coulomb, "memory", "N m", "lugre", ["hysteresis"], ["stribeck"])
        self.maybe_payload()

    def warm_up(self):
        """Friction of every joint falls by 10 to 30 % with a time constant of 6 to 12 s."""
        shares = self.rng.uniform(0.10, 0.30, self.model.nv)
        self.defects["warm_up"] = (float(self.rng.uniform(6.0, 12.0)), tuple(shares))
        self.causes += joint_causes(self.model, shares, "warm_up", "1", "warm_up", ["warm_up"])
        self.maybe_payload()

    def flexible(self):
        """Every joint rings at 12 to 25 Hz."""
        self.defects["flexible"] = self.seed
        self.causes.append(Cause("flexible", "all joints", 1.0, "1", "flexible", None, [], []))
        self.maybe_payload()

    def link_length(self):
        """One link is 1 to 2 % longer or shorter."""
        far = [j for j in range(1, self.model.nv) if np.linalg.norm(self.model.jointPlacements[j + 1].translation) > 0.05]
        seen = self.seen(lambda j: Defects(length=(j, 1.015)) if j in far else Defects())
        joint, change = int(self.rng.choice(seen)), self.sign() * self.rng.uniform(0.01, 0.02)
        self.defects["length"] = (joint, 1.0 + change)
        self.causes.append(Cause("link_length", links_of(self.model, joint - 1)[0], float(change), "1", "length", None, [], []))
        self.maybe_payload()

    def small(self):
        """Two of payload, heavier link and tilt, each scaled to 8 to 40 standard errors."""
        for which in self.rng.choice(3, 2, replace=False):
            (self.payload, lambda: self.heavier(MIDDLE[self.robot]), lambda: self.lean(1.0))[which]()

    def spring(self):
        """A cable that pulls: twice to six times the Coulomb friction per rad, at rest within 0.5 rad."""
        joint = int(self.rng.integers(self.model.nv))
        stiffness = self.arm.coulomb[joint] * self.rng.uniform(2.0, 6.0)
        self.defects["spring"] = (joint, float(stiffness), float(self.rng.uniform(-0.5, 0.5)))
        self.causes += joint_causes(self.model, self.one_joint(joint, stiffness), "spring", "N m/rad", "spring", ["spring"])
        self.maybe_payload()

    def heavier_wrist(self):
        """The last link but one has 10 to 30 % more mass."""
        self.heavier((self.model.nv - 2,))
        self.maybe_payload()

    def maxwell_slip(self):
        """Friction with memory of another kind: four elastic sliders per joint, 5 to 30 mrad of presliding."""
        self.defects["slip"] = tuple(self.rng.uniform(0.005, 0.03, self.model.nv).tolist())
        self.causes += joint_causes(self.model, self.arm.coulomb, "memory", "N m", "slip", ["hysteresis"], ["stribeck"])
        self.maybe_payload()

    def torque_ripple(self):
        """A sine of the position, 20 to 60 periods per turn, of a fifth to three fifths of the Coulomb friction, on one joint."""
        joint, periods = int(self.rng.integers(self.model.nv)), int(self.rng.integers(20, 61))
        height = self.arm.coulomb[joint] * self.rng.uniform(0.2, 0.6)
        self.defects["ripple"] = (joint, periods, float(height))
        self.causes += joint_causes(self.model, self.one_joint(joint, height), "ripple", "N m", "ripple", ["ripple"])
        self.maybe_payload()

    def load_friction(self):
        """Friction grows by 5 to 15 % of the torque of one or two joints."""
        joints = self.seen(lambda j: Defects(load=self.one_joint(j, 0.1)))
        self.defects["load"] = sizes = tuple(np.abs(self.some(joints, 0.05, 0.15)))
        self.causes += joint_causes(self.model, sizes, "load_friction", "1", "load", ["load_friction"])
        self.maybe_payload()

    def other_robot(self):
        """A payload and a heavier middle link on a robot that no development world has."""
        self.payload()
        self.heavier(MIDDLE[self.robot])


def draw(kind, seed):
    """The world of a kind and a seed. Robots and motions go round with the seed."""
    index = (KINDS + HELD_BACK).index(kind)
    turn = seed + index
    robot = {"ur5_forearm": "ur5", "other_robot": OTHER_ROBOTS[seed % 2]}.get(kind, ROBOTS[turn % 4])
    rng = np.random.default_rng([seed, index, 12])
    motion = MOTIONS[turn % 3]
    other = [name for name in MOTIONS if name != motion]
    heldout = rng.choice(other) if rng.random() < 0.5 else motion
    recorder = Recorder(seconds=30.0 if kind == "warm_up" else 12.0, counts=2 ** int(rng.integers(17, 21)),
                        at_rest=str(rng.choice(("silent", "dither"))), noise=float(rng.uniform(0.03, 0.08)))  # fmt: skip
    says = "current" if kind == "gain" and rng.random() < 0.5 else "joint"
    world = World(kind, seed, robot, motion, str(heldout), str(rng.choice(other)), says, recorder, Defects(), [])
    drawer = Drawer(kind, seed, robot, world.arm)
    getattr(drawer, kind)()
    world.defects, world.causes = Defects(**drawer.defects), drawer.causes
    if kind == "small":
        scale_to(world, rng.uniform(np.log(8.0), np.log(40.0), len(world.causes)))
    return world


def scale_to(world, logarithms):
    """Scales payload, heavier link and tilt to sizes in standard errors; these grow in proportion to the defect as long as it is small."""
    for _ in range(2):
        for cause, now, log in zip(world.causes, sizes_of(world), logarithms):
            factor, value = float(np.exp(log) / now), getattr(world.defects, cause.mechanism)
            changed = {"payload": lambda: (value[0] * factor, value[1]), "heavier": lambda: (value[0], 1.0 + (value[1] - 1.0) * factor),
                       "tilt": lambda: tuple(factor * x for x in value)}[cause.mechanism]()  # fmt: skip
            world.defects = replace(world.defects, **{cause.mechanism: changed})
            cause.size *= factor


def sizes_of(world):
    """Size of every cause in standard errors."""
    keep = BASE_RATE // world.recorder.rate
    paths = [path_of(world, which) for which in range(2)]
    return standard_errors(world, paths, [contributions(world, path, keep) for path in paths], noise_sd(world))


@lru_cache(maxsize=8)
def path_of(world, which):
    """Motion number `which`: 0 and 1 training, 2 held out, 3 the third."""
    kind = (world.motion, world.motion, world.heldout, world.third)[which]
    rng = np.random.default_rng([world.seed, which, MOTIONS.index(kind), 21])
    t = np.arange(int(world.recorder.seconds * BASE_RATE)) / BASE_RATE
    return Motion(t, *getattr(arms, kind)(world.arm, rng, t))


def record(world, path, which):
    """The log of a motion: torque with noise, position and velocity as the encoder shows them."""
    recorder, arm = world.recorder, world.arm
    rng = np.random.default_rng([world.seed, which, 22])
    keep = BASE_RATE // recorder.rate
    clean = torque(arm, world.defects, path, keep)
    noise = noise_sd(world) * 0.5**0.5
    error = rng.normal(size=clean.shape) + colored(rng, clean.shape, recorder.rate, recorder.noise_time)
    shown, speed = encode(recorder, rng, path.q[::keep], path.qd[::keep])
    return Log(path.t[::keep], shown, speed, clean + noise * error, path.qdd[::keep])


def noise_sd(world):
    """Standard deviation of each joint's torque noise, N m."""
    return world.recorder.noise * world.arm.coulomb


def contributions(world, path, keep):
    """Torque of every cause along a motion: that of the arm less that of the arm without it. Causes x samples x joints."""
    arm, all_in = world.arm, torque(world.arm, world.defects, path, keep)
    parts = {name: all_in - torque(arm, world.defects.without(name), path, keep) for name in world.defects.present()}
    own = [np.zeros_like(all_in) if cause.joint is not None else parts[cause.mechanism].copy() for cause in world.causes]
    for cause, part in zip(world.causes, own):
        if cause.joint is not None:
            part[:, cause.joint] = parts[cause.mechanism][:, cause.joint]
        elif cause.family == "encoder_zero":
            part[:] = zero_part(world, cause, path, keep, all_in)
    return np.array(own).reshape(len(own), *all_in.shape)


def zero_part(world, cause, path, keep, all_in):
    """Torque of one joint's zero where two are off."""
    names = list(world.arm.model.names)[1:]
    rest = tuple(0.0 if name == cause.subject else size for name, size in zip(names, world.defects.zero))
    defects = world.defects.without("zero") if not any(rest) else Defects(**{**vars(world.defects), "zero": rest})
    return all_in - torque(world.arm, defects, path, keep)


def make(kind, seed, folder):
    """Writes one world; returns its truth."""
    world = draw(kind, seed)
    paths = [path_of(world, which) for which in range(4)]
    logs = [record(world, path, which) for which, path in enumerate(paths[:3])]
    keep = BASE_RATE // world.recorder.rate
    third = Motion(*(getattr(paths[3], name)[::keep] for name in ("t", "q", "qd", "qdd")))
    effects = contributions(world, paths[3], keep)
    clean = torque(world.arm, world.defects, paths[3], keep)
    nominal = world.arm.model
    truth = {
        "version": VERSION, "kind": kind, "seed": seed, "motion": world.motion, "heldout_motion": world.heldout, "third_motion": world.third,
        "torque": world.torque, "defects": {name: getattr(world.defects, name) for name in world.defects.present()},
        "causes": [{**asdict(cause), "standard_errors": size} for cause, size in zip(world.causes, sizes_of(world))],
        "joints": list(nominal.names)[1:], "links": {link: j for j in range(nominal.nv) for link in links_of(nominal, j)},
        "noise_sd": noise_sd(world).tolist(), "coulomb": world.arm.coulomb.tolist(), "viscous": world.arm.viscous.tolist(),
        "nominal_mass": [body.mass for body in nominal.inertias][1:],
    }  # fmt: skip
    base = arms.World(world.robot, world.motion, payload=0.0, seed=seed)
    write_study(folder, Study(base, world.recorder, logs[:2], logs[2], truth))
    if world.torque == "current":
        say_current(folder, nominal)
    np.savez(Path(folder) / "third.npz", t=third.t, q=third.q, qd=third.qd, qdd=third.qdd, tau=clean, effects=effects)
    return truth


def say_current(folder, model):
    """The log's torque is a current, with drive constants of 1 N m/A from the catalogue."""
    constants = ", ".join(f'"{name}" = 1.0' for name in list(model.names)[1:])
    path = Path(folder) / "twincal.toml"
    lines = f'[[log]]\ntorque = "current"\ndrive_constant = {{ {constants} }}\n'
    path.write_text(path.read_text().replace("[[log]]\n", lines))


def kept(kind, seed, folder=HERE.parents[1] / "target" / "worlds"):
    """Folder of a world, made where it is not there yet; its truth."""
    folder = Path(folder) / f"{kind}-{seed}"
    path = folder / "truth.json"
    if path.exists():
        truth = json.loads(path.read_text())
        if truth.get("version") == VERSION:
            return folder, truth
    make(kind, seed, folder)
    return folder, json.loads(path.read_text())


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--kind", choices=KINDS + HELD_BACK, default="payload_link")
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("-o", "--output", type=Path, default=Path("world"))
    given = arguments.parse_args()
    for cause in make(given.kind, given.seed, given.output)["causes"]:
        print(f"{cause['subject']}: {cause['family']} {cause['size']:+.4g} {cause['unit']}, {cause['standard_errors']:.1f} standard errors")


if __name__ == "__main__":
    main()

"""Designed motions in MuJoCo: no limit broken, no contact of the robot with itself, with a table or with the floor.

    contacts.py --program P --seeds FIRST LAST [--robot ur5 panda] [--keep DIR] [--lines X.jsonl]

Per robot and seed: `twincal design` from a random start, with a floor and a box on every other seed. Position, velocity and acceleration are
compared with the limits at every sample, torque by Pinocchio, distances by MuJoCo on the hulls of the robot's own meshes at 1 kHz.
"""

import argparse
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "worlds")]
from shared import model_file  # noqa: E402

SECONDS = 20.0
RATE = 1000.0  # Hz
MARGIN = 0.02  # m
TOLERANCE = 0.005  # m, of what MuJoCo finds
TRIES = 50  # random starts


def mujoco_model(urdf):
    """The URDF in MuJoCo with its collision meshes, each link a separate body."""
    text = urdf.read_text()
    root = next(above for above in urdf.parents if above.name == "example-robot-data")
    text = text.replace("package://example-robot-data", str(root))
    text = re.sub(r"<visual>.*?</visual>", "", text, flags=re.DOTALL)
    compiler = '<mujoco><compiler strippath="false" fusestatic="false" discardvisual="true"/></mujoco>'
    return mujoco.MjModel.from_xml_string(text.replace("</robot>", compiler + "</robot>"))


class Robot:
    """A robot in Pinocchio and in MuJoCo."""

    def __init__(self, name):
        self.name = name
        self.file = model_file(name)
        self.pin = pin.buildModelFromUrdf(str(self.file))
        self.data = self.pin.createData()
        self.follows = {"panda_finger_joint2": "panda_finger_joint1"} if name == "panda" else {}
        self.all = list(self.pin.names)[1:]
        self.names = [joint for joint in self.all if joint not in self.follows]
        self.mujoco = mujoco_model(Path(self.file))
        self.state = mujoco.MjData(self.mujoco)
        self.places = [self.mujoco.joint(joint).qposadr[0] for joint in self.all]
        self.columns = [self.names.index(self.follows.get(joint, joint)) for joint in self.all]

    def torque(self, motion):
        """Torque of every joint; that of a joint that follows counts for the one that it follows."""
        motion = (part[:, self.columns] for part in motion)
        torque = np.array([pin.rnea(self.pin, self.data, *state) for state in zip(*motion, strict=True)])
        return np.stack([torque[:, [c == k for c in self.columns]].sum(axis=1) for k in range(len(self.names))], axis=1)

    def geoms(self):
        """Geoms by the link that they belong to."""
        bodies = [self.mujoco.body(self.mujoco.geom_bodyid[g]).name for g in range(self.mujoco.ngeom)]
        return {link: [g for g, body in enumerate(bodies) if body == link] for link in dict.fromkeys(bodies)}

    def pairs(self, clearance):
        """Pairs of geoms that the design looked at: not of one link, not beside each other, not left out by name."""
        left_out = {frozenset(own["between"]) for own in clearance["ignored"]}
        by_link = self.geoms()
        weld = self.mujoco.body_weldid
        for (one, first), (other, second) in itertools.combinations(by_link.items(), 2):
            a, b = (self.mujoco.body(link).id for link in (one, other))
            parents = [weld[self.mujoco.body_parentid[weld[x]]] for x in (a, b)]
            beside = weld[a] == weld[b] or parents[0] == weld[b] or parents[1] == weld[a]
            if not beside and frozenset((one, other)) not in left_out:
                yield from itertools.product(first, second)

    def smallest(self, q, clearance):
        """Smallest distance of any pair over all samples, m."""
        pairs = list(self.pairs(clearance))
        fromto = np.zeros(6)
        best = (np.inf, None)
        for sample, position in enumerate(q):
            self.state.qpos[self.places] = position[self.columns]
            mujoco.mj_kinematics(self.mujoco, self.state)
            for pair in pairs:
                distance = mujoco.mj_geomDistance(self.mujoco, self.state, *pair, 0.5, fromto)
                if distance < best[0]:
                    names = [self.mujoco.body(self.mujoco.geom_bodyid[g]).name for g in pair]
                    best = (distance, [*names, sample / RATE])
        return best, len(pairs)

    def around(self, q, clearance):
        """Smallest height above the floor and distance from the boxes over all samples, by the corners of meshes and boxes."""
        best = np.inf
        model = self.mujoco
        moving = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] != 0]
        corners = {}
        for g in moving:
            if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX:
                corners[g] = model.geom_size[g] * np.array(list(itertools.product((-1, 1), repeat=3)))
                continue
            mesh = model.geom_dataid[g]
            first = model.mesh_vertadr[mesh]
            corners[g] = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        for position in q[::10]:
            self.state.qpos[self.places] = position[self.columns]
            mujoco.mj_kinematics(model, self.state)
            for g, own in corners.items():
                there = own @ self.state.geom_xmat[g].reshape(3, 3).T + self.state.geom_xpos[g]
                if clearance["floor"] is not None:
                    best = min(best, there[:, 2].min() - clearance["floor"])
                for box in clearance["boxes"]:
                    away = np.maximum(np.maximum(box["low"] - there, there - np.array(box["high"])), 0.0)
                    best = min(best, np.sqrt((away**2).sum(axis=1)).min())
        return best


def limits_text(robot, start, with_table):
    lines = [f"margin = {MARGIN}"]
    if with_table:
        lines += ["floor = -0.05", "[[box]]", 'name = "table"', "low = [0.35, -0.6, -0.1]", "high = [0.9, 0.6, 0.15]"]
    for name, at in zip(robot.names, start, strict=True):
        lines += [f'[joint."{name}"]', f"start = {at}"]
    return "\n".join(lines) + "\n"


def one(program, robot, seed, folder):
    """The motion of one seed from a random start that is free; its line."""
    rng = np.random.default_rng([seed, 77])
    moving = [robot.all.index(joint) for joint in robot.names]
    low, high = (np.clip(x, -2.8, 2.8)[moving] for x in (robot.pin.lowerPositionLimit, robot.pin.upperPositionLimit))
    for _ in range(TRIES):
        start = low + (high - low) * rng.uniform(0.1, 0.9, len(robot.names))
        (folder / "limits.toml").write_text(limits_text(robot, start, seed % 2 == 0))
        command = [program, "design", "--model", robot.file, "--limits", "limits.toml", "--duration", SECONDS, "--rate", RATE,
                   "--seed", seed, "-o", "motion", "--force", "--json"]  # fmt: skip
        done = subprocess.run([str(x) for x in command], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if done.returncode == 0:
            break
        if done.returncode != 4:
            raise RuntimeError(done.stderr[-600:])
    else:
        raise RuntimeError(f"no free start in {TRIES}: {done.stderr[-300:]}")
    return measured(robot, seed, json.loads(done.stdout), folder)


def measured(robot, seed, said, folder):
    table = np.loadtxt(folder / "motion" / "motion.csv", delimiter=",", skiprows=1)
    n = len(robot.names)
    q, qd, qdd = (table[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))
    clearance = said["clearance"]
    (closest, where), pairs = robot.smallest(q, clearance)
    jerk = np.diff(qdd, axis=0) * RATE
    most = {"velocity": np.abs(qd), "acceleration": np.abs(qdd), "jerk": np.abs(jerk), "torque": np.abs(robot.torque((q, qd, qdd)))}
    broken = [f"{own['joint']} {key}" for j, own in enumerate(said["limits"]) for key, x in most.items()
              if own[key] is not None and x[:, j].max() > own[key] * (1.0 + 1e-9)]  # fmt: skip
    broken += [f"{own['joint']} position" for j, own in enumerate(said["limits"])
               if q[:, j].min() < own["position"][0] - 1e-9 or q[:, j].max() > own["position"][1] + 1e-9]  # fmt: skip
    around = robot.around(q, clearance) if clearance["floor"] is not None else None
    return {"robot": robot.name, "seed": seed, "broken": broken, "mujoco": closest, "where": where, "pairs": pairs, "around": around,
            "said": clearance["closest"], "ignored": [own["between"] for own in clearance["ignored"]], "condition": said["condition"],
            "too_close": bool(closest < MARGIN - TOLERANCE or (around is not None and around < MARGIN - TOLERANCE))}  # fmt: skip


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", type=Path, default=Path(os.environ.get("TWINCAL", HERE.parents[1] / "target/release/twincal")))
    arguments.add_argument("--seeds", type=int, nargs=2, metavar=("FIRST", "LAST"), required=True)
    arguments.add_argument("--robot", nargs="+", choices=["ur5", "panda"], default=["ur5", "panda"])
    arguments.add_argument("--keep", type=Path)
    arguments.add_argument("--lines", type=Path)
    given = arguments.parse_args()
    lines = []
    for robot in map(Robot, given.robot):
        for seed in range(given.seeds[0], given.seeds[1] + 1):
            folder = (given.keep or Path(tempfile.mkdtemp())) / f"contacts-{robot.name}-{seed}"
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            line = one(given.program.resolve(), robot, seed, folder)
            if not given.keep:
                shutil.rmtree(folder)
            lines.append(line)
            if given.lines:
                with given.lines.open("a") as file:
                    file.write(json.dumps(line) + "\n")
            around = "" if line["around"] is None else f", floor and box {line['around']:.4f} m"
            print(f"{robot.name} {seed}: smallest distance {line['mujoco']:.4f} m {line['where']}{around}, limits broken: {line['broken']}", flush=True)
    print(f"{len(lines)} motions, {sum(bool(line['broken']) for line in lines)} with a broken limit, "
          f"{sum(line['mujoco'] <= 0.0 for line in lines)} with a contact, "
          f"{sum(line['too_close'] for line in lines)} closer than the margin less 5 mm")  # fmt: skip


if __name__ == "__main__":
    main()

"""Writes robots.json beside this file: the robots of the dynamics bench, from Pinocchio models of `example-robot-data`.

    python crates/twincal/benches/peers/robots.py

UR5, Panda (seven joints, fingers locked) and a tree with sliders: kinematics and inertias as numbers, no geometry.
"""

import json
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).parent
PACKAGE = distribution("example-robot-data")
ROBOTS = Path(PACKAGE.locate_file("cmeel.prefix/share/example-robot-data/robots"))
AXES = {"JointModelRX": 0, "JointModelRY": 1, "JointModelRZ": 2, "JointModelPX": 0, "JointModelPY": 1, "JointModelPZ": 2}


def description(name, model):
    """What the core reads: one link per joint, its frame that of the joint."""
    links, joints = [{"name": "base", "inertia": None}], []
    for j in range(1, model.njoints):
        joint, inertia, placement = model.joints[j], model.inertias[j], model.jointPlacements[j]
        kind = joint.shortname()
        axis = np.eye(3)[AXES[kind]] if kind in AXES else np.array(joint.extract().axis)
        parent = model.parents[j]
        links.append({"name": f"{model.names[j]}_link", "inertia": {
            "mass": inertia.mass, "com": inertia.lever.tolist(), "tensor": inertia.inertia.tolist()}})  # fmt: skip
        joints.append({
            "name": model.names[j], "kind": "prismatic" if "P" in kind[10:] else "revolute",
            "parent": f"{model.names[parent]}_link" if parent else "base", "child": f"{model.names[j]}_link",
            "placement": {"rotation": placement.rotation.tolist(), "translation": placement.translation.tolist()},
            "axis": axis.tolist(), "armature": 0, "damping": 0, "stiffness": 0, "spring_reference": 0, "mimic": None,
            "limits": {"lower": None, "upper": None, "effort": None, "velocity": None},
        })  # fmt: skip
    return {"name": name, "gravity": [0, 0, -9.81], "links": links, "joints": joints, "allow_unphysical": True}


def tree():
    """A gantry (three sliders) that carries two arms of three joints, one ending in a slider."""
    rng = np.random.default_rng(3)
    model = pin.Model()
    last = 0
    for k, axis in enumerate(np.eye(3)):
        last = add(model, rng, last, pin.JointModelPrismaticUnaligned(axis), f"gantry{k + 1}")
    for arm, kinds in (("left", "RRR"), ("right", "RRP")):
        parent = last
        for k, kind in enumerate(kinds):
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
            joint = pin.JointModelRevoluteUnaligned(axis) if kind == "R" else pin.JointModelPrismaticUnaligned(axis)
            parent = add(model, rng, parent, joint, f"{arm}{k + 1}")
    return model


def add(model, rng, parent, joint, name):
    placement = pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-3, 3, 3)), rng.normal(size=3) * 0.3)
    index = model.addJoint(parent, joint, placement, name)
    points = rng.normal(size=(6, 3)) * 0.1
    mass = float(rng.uniform(1, 5))
    tensor = sum(p @ p * np.eye(3) - np.outer(p, p) for p in points) * mass / 6
    model.appendBodyToJoint(index, pin.Inertia(mass, rng.normal(size=3) * 0.1, tensor), pin.SE3.Identity())
    return index


def main():
    ur5 = pin.buildModelFromUrdf(str(ROBOTS / "ur_description/urdf/ur5_robot.urdf"))
    panda = pin.buildModelFromUrdf(str(ROBOTS / "panda_description/urdf/panda.urdf"))
    fingers = [panda.getJointId(name) for name in panda.names if "finger" in name]
    panda = pin.buildReducedModel(panda, fingers, pin.neutral(panda))
    cases = [{"name": name, "description": description(name, model)} for name, model in (("ur5", ur5), ("panda", panda), ("tree", tree()))]  # fmt: skip
    (HERE / "robots.json").write_text(json.dumps({"command": "python crates/twincal/benches/peers/robots.py", "cases": cases}))


if __name__ == "__main__":
    main()

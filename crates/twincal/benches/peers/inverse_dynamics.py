"""Pinocchio's least time per call of rnea and of computeJointTorqueRegressor, ns, for a robot of robots.json.

    python inverse_dynamics.py NAME FOLDER

Builds inverse_dynamics.cpp in FOLDER against the wheel's headers and libraries (needs g++ and the package cmeel-eigen)
and runs it on the same joints and inertias. Called by inverse_dynamics.rs.
"""

import json
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).parent
# What Pinocchio's own CMake files define for users of the library.
DEFINES = ["BOOST_MPL_LIMIT_LIST_SIZE=30", "BOOST_MPL_LIMIT_VECTOR_SIZE=30", "BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
           "BOOST_FUSION_INVOKE_MAX_ARITY=12", "PINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION", "NDEBUG"]  # fmt: skip
ALIGNED = {
    "revolute": [pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ],
    "prismatic": [pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ],
}


def joint_model(joint):
    axis = np.array(joint["axis"])
    if np.count_nonzero(axis) == 1 and axis.max() == 1:
        return ALIGNED[joint["kind"]][int(axis.argmax())]()
    return pin.JointModelRevoluteUnaligned(axis) if joint["kind"] == "revolute" else pin.JointModelPrismaticUnaligned(axis)


def build(description):
    """The Pinocchio model of a description as the core reads it."""
    model, index = pin.Model(), {description["links"][0]["name"]: 0}
    links = {link["name"]: link for link in description["links"]}
    for joint in description["joints"]:
        placement = pin.SE3(np.array(joint["placement"]["rotation"]), np.array(joint["placement"]["translation"]))
        number = model.addJoint(index[joint["parent"]], joint_model(joint), placement, joint["name"])
        inertia = links[joint["child"]]["inertia"]
        body = pin.Inertia(inertia["mass"], np.array(inertia["com"]), np.array(inertia["tensor"]))
        model.appendBodyToJoint(number, body, pin.SE3.Identity())
        index[joint["child"]] = number
    return model


def main():
    name, folder = sys.argv[1], Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    cases = json.loads((HERE / "robots.json").read_text())["cases"]
    build(next(case["description"] for case in cases if case["name"] == name)).saveToBinary(str(folder / f"{name}.bin"))
    program = folder / "pinocchio_peer"
    if not program.exists():
        prefix = Path(distribution("libpinocchio").locate_file("cmeel.prefix"))
        eigen = Path(distribution("cmeel-eigen").locate_file("cmeel.prefix"))
        command = ["g++", "-std=c++17", "-O3", *(f"-D{define}" for define in DEFINES), f"-I{prefix}/include",
                   f"-I{eigen}/include/eigen3", str(HERE / "inverse_dynamics.cpp"), "-o", str(program), f"-L{prefix}/lib",
                   "-lpinocchio_default", "-lboost_serialization", f"-Wl,-rpath,{prefix}/lib"]  # fmt: skip
        subprocess.run(command, check=True)
    print(subprocess.run([program, folder / f"{name}.bin"], check=True, capture_output=True, text=True).stdout)


if __name__ == "__main__":
    main()

"""What the studies share: arms, motions, friction, encoder and writer of `studies/hostile/arms.py`, and two more robots."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(HERE.parent / "hostile"), str(HERE.parent / "industrial_arms")]

import arms  # noqa: E402
from arms import (BASE_RATE, COULOMB_VELOCITY, MOTIONS, Arm, Log, Recorder, Study, colored, encode, lugre,  # noqa: E402, F401
                  rigid_torque, through_gears, write_csv, write_study)  # fmt: skip
from simulate_arms import ROBOTS as MODEL_FILES  # noqa: E402
from simulate_arms import Robot, load, model_file  # noqa: E402, F401

MODEL_FILES |= {
    "planar3": Robot(str(HERE / "assets" / "planar3.urdf")),
    "ur10": Robot("ur_description/urdf/ur10_robot.urdf"),
    "z1": Robot("z1_description/urdf/z1.urdf", ("jointGripper",)),
}
arms.FRICTION_SIZE |= {"planar3": (3.0, 0.5), "ur10": (12.0, 2.0), "z1": (1.5, 0.5)}

"""Speed of the Python package: inverse dynamics, regressor and predictions of arrays, one core and all of them.

    RAYON_NUM_THREADS=1 python benches/peers/package.py MODEL [TWIN [PROGRAM]]

MODEL is a URDF; TWIN, the folder of a result, adds predictions; PROGRAM, the example torque_speed of twincal-io, the same in Rust.
Each line is the best of five runs.
"""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
import twincal

STATES = 1_000_000


def best(call) -> float:
    """Seconds of the fastest of five calls."""
    seconds = []
    for _ in range(5):
        began = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - began)
    return min(seconds)


def main() -> None:
    robot = twincal.Robot.from_urdf(sys.argv[1])
    joints = len(robot.joint_names)
    states = np.random.default_rng(1).uniform(-1.0, 1.0, (3, STATES, joints))
    seconds = best(lambda: robot.inverse_dynamics(*states))
    print(f"inverse dynamics: {1e9 * seconds / STATES:.1f} ns per state of {joints} joints")
    few = states[:, :20_000]
    seconds = best(lambda: robot.regressor(*few))
    print(f"regressor: {1e9 * seconds / few.shape[1]:.0f} ns per state")
    try:
        import pinocchio
    except ImportError:
        pass
    else:
        model = pinocchio.buildModelFromUrdf(sys.argv[1])
        data = model.createData()
        some = states[:, :20_000]
        seconds = best(lambda: [pinocchio.rnea(model, data, *own) for own in zip(*some)])
        print(f"pinocchio.rnea in a loop of Python: {1e9 * seconds / some.shape[1]:.0f} ns per state")
    if len(sys.argv) > 2:
        twin = twincal.Calibration.load(sys.argv[2])
        joints = len(twin.joint_names)
        places = 0.618033988749895 * np.arange(STATES * joints)
        states = [(2.0 * ((start + places) % 1.0) - 1.0).reshape(STATES, joints) for start in (0.1, 0.4, 0.7)]
        seconds = best(lambda: twin.predict(*states))
        print(f"predict: {1e9 * seconds / STATES:.0f} ns per state of {joints} joints")
        if len(sys.argv) > 3:
            told = subprocess.run([sys.argv[3], sys.argv[2], str(STATES)], capture_output=True, check=True, text=True)
            rust = float(told.stdout)
            print(f"Twin::torque: {1e9 * rust / STATES:.0f} ns per state; rows per second of Python over Rust: {rust / seconds:.2f}")


if __name__ == "__main__":
    main()

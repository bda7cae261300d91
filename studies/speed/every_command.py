"""What a fit costs where there are many logs, or many joints: CPU seconds and memory of one run.

    python every_command.py --twincal ../../target/release/twincal [-o folder] [--joints ur5 talos] [--logs 500]

Pinocchio computes the torque of robots of the PyPI package `example-robot-data` on smooth motion, with viscous and Coulomb friction
and white noise. `ur5`: N logs of 2.5 s at 250 Hz beside one log of the same length. `talos`: 44 joints on a fixed base, 10 s at 500 Hz.
"""

import argparse
import resource
import subprocess
import sys
import time
from importlib import metadata
from math import pi
from pathlib import Path

import numpy as np
import pinocchio as pin

VS = 0.02  # rad/s, width of a reversal of Coulomb friction
MODELS = {
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "talos": "talos_data/robots/talos_full_v2.urdf",
}


def model_file(robot):
    """Path of a robot's URDF in the installed package (which is data only)."""
    root = metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    return Path(root) / MODELS[robot]


def motion(rng, low, high, fast, samples, rate, base=0.05):
    """Fourier series within the joints' limits of position and speed: q, qd, qdd (samples x joints)."""
    t = np.arange(samples) / rate
    w = 2 * pi * base * np.arange(1, 11)
    a, b = rng.normal(size=(2, len(low), len(w))) / np.arange(1, 11) ** 0.5
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    q = s @ a.T + c @ b.T
    qd = (c * w) @ a.T - (s * w) @ b.T
    qdd = -(s * w**2) @ a.T - (c * w**2) @ b.T
    middle, half = 0.5 * (low + high), 0.4 * (high - low)
    scale = np.minimum(np.minimum(half, 1.2) / np.abs(q).max(0), fast / np.abs(qd).max(0))
    return t, middle + q * scale, qd * scale, qdd * scale


def simulate(robot, path, seed, seconds, rate, noise=0.02, friction_seed=0):
    """Writes one CSV: t, q, qd, tau of every joint."""
    model = pin.buildModelFromUrdf(str(model_file(robot)))
    data = model.createData()
    n = model.nv
    low, high = np.maximum(model.lowerPositionLimit[:n], -2.0), np.minimum(model.upperPositionLimit[:n], 2.0)
    fast = np.minimum(np.where(model.velocityLimit[:n] > 0, 0.7 * model.velocityLimit[:n], 1.5), 1.5)
    t, q, qd, qdd = motion(np.random.default_rng(seed), low, high, fast, int(seconds * rate), rate)
    tau = np.array([pin.rnea(model, data, q[k], qd[k], qdd[k]) for k in range(len(t))])
    size = np.maximum(0.05 * np.abs(tau).max(0), 0.05)
    if friction_seed is not None:
        of = np.random.default_rng(1000 + friction_seed)
        size = np.linspace(3.0, 0.6, n) if robot == "ur5" else np.minimum(size, 3.0)
        tau += size * of.uniform(0.6, 1.2, n) * qd + size * of.uniform(0.6, 1.2, n) * np.tanh(qd / VS)
    tau += noise * np.maximum(size, 0.1) * np.random.default_rng(seed + 10**6).normal(size=tau.shape)
    names = [name for name in model.names[1:]]
    head = ["t"] + [f"{channel}_{name}" for channel in ("q", "qd", "tau") for name in names]
    np.savetxt(path, np.column_stack([t, q, qd, tau]), delimiter=",", header=",".join(head), comments="", fmt="%.9g")


def measured(command, cwd):
    """CPU and wall seconds, peak memory in MB and exit code of a command."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run(["/usr/bin/time", "-f", "%M", *command], cwd=cwd, capture_output=True, text=True)
    after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic() - start
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, wall, int(done.stderr.splitlines()[-1]) / 1e3, done.returncode, done.stderr


def line(what, numbers):
    cpu, wall, memory, code, _ = numbers
    print(f"{what:44} {cpu:8.1f} s CPU {wall:8.1f} s {memory:8.0f} MB   exit {code}", flush=True)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--twincal", type=Path, default=Path("../../target/release/twincal"))
    arguments.add_argument("-o", "--output", type=Path, default=Path("every_command"))
    arguments.add_argument("--robots", nargs="+", default=["ur5", "talos"], choices=MODELS)
    arguments.add_argument("--logs", type=int, default=500)
    arguments.add_argument("--only-simulate", action="store_true")
    given = arguments.parse_args()
    twincal = given.twincal.resolve()
    given.output.mkdir(parents=True, exist_ok=True)
    for robot in given.robots:
        folder = given.output / robot
        folder.mkdir(exist_ok=True)
        if robot == "ur5":
            logs = [f"short{k:03}.csv" for k in range(given.logs)]
            for k, name in enumerate(logs):
                if not (folder / name).exists():
                    simulate(robot, folder / name, k, 2.5, 250.0)
            whole = f"long{given.logs}.csv"
            if not (folder / whole).exists():
                simulate(robot, folder / whole, 10**5, 2.5 * given.logs, 250.0)
            runs = {f"{given.logs} logs of 2.5 s": logs, f"one log of {2.5 * given.logs} s": [whole]}
        else:
            if not (folder / "run.csv").exists():
                simulate(robot, folder / "run.csv", 1, 10.0, 500.0)
            runs = {"44 joints, 10 s": ["run.csv"]}
        if given.only_simulate:
            continue
        for what, logs in runs.items():
            for command in ("inspect", "doctor", "fit"):
                more = ["-o", "out", "--force"] if command == "fit" else []
                line(f"{robot}, {what}: {command}", measured([twincal, command, *logs, "--model", model_file(robot), *more], folder))
            for command, more in (("check", []), ("predict", ["-o", "out.csv", "--force"])):
                line(f"{robot}, {what}: {command}", measured([twincal, command, *logs, "--twin", "out", *more], folder))


if __name__ == "__main__":
    sys.exit(main())

"""What `twincal check` says of a robot that changed since its twin was fitted, and of one that did not.

    python check_changes.py --twincal ../../target/release/twincal [--robots ur5 panda] [--seeds 10] [-o folder]

A twin is fitted to three logs of 20 s. Then each case is checked on logs of 20 s with motions and noise of their own: nothing
changed; friction of one joint + 50 %; a payload of 5 % of the moved mass at the tool; the zero of one joint off by 1 degree.
The joint changes with the seed, among those whose change has torque. In every world a torque of the position acts that no
candidate describes. Then logs of the unchanged robot whose torque is not what it is said to be: of all joints turned, of one
joint turned, of two joints exchanged, of all joints 60 ms late. Prints in how many logs `check` fails (exit code 1), and in
how many it is inconclusive (3); a good log is one more case.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
from simulate_arms import COULOMB_VELOCITY, RATE, ROBOTS, load, model_file, motion, write

SECONDS, KEEP, NOISE = 20.0, 4, 0.1  # s, samples of 1 kHz per logged one, N m
HIDDEN = 0.15  # N m, of a torque sin(9 q) on every joint


def log(model, real, rng, friction, zero):
    """Columns of one log; `zero`: what each encoder reads too much, rad."""
    n, samples = model.nv, int(SECONDS * RATE)
    t, q, qd, qdd = motion(rng, n, samples)
    rows = slice(0, samples, KEEP)
    t, q, qd, qdd = t[rows], q[rows], qd[rows], qdd[rows]
    data = real.createData()
    neutral = pin.neutral(real)
    tau = np.array([pin.rnea(real, data, pin.integrate(real, neutral, q[k]), qd[k], qdd[k]) for k in range(len(t))])
    tau += friction[0] * qd + friction[1] * np.tanh(qd / COULOMB_VELOCITY) + HIDDEN * np.sin(9 * q)
    tau += NOISE * rng.normal(size=tau.shape)
    columns = {"t": t}
    for j in range(n):
        for name, values in (("q", q + zero), ("qd", qd), ("tau", tau)):
            columns[f"{name}{j + 1}"] = values[:, j]
    return columns


def misread(columns, n, seed):
    """The log with torque columns that are not what they are said to be, by case; joints change with the seed."""
    torque = [f"tau{j + 1}" for j in range(n)]
    one, other = np.random.default_rng(seed).choice(n, 2, replace=False)
    rows = round(0.06 * RATE / KEEP)
    late = {name: np.concatenate([np.repeat(columns[name][:1], rows), columns[name][:-rows]]) for name in torque}
    return {
        "torque turned": columns | {name: -columns[name] for name in torque},
        "one joint turned": columns | {torque[one]: -columns[torque[one]]},
        "joints exchanged": columns | {torque[one]: columns[torque[other]], torque[other]: columns[torque[one]]},
        "torque 60 ms late": columns | late,
    }


def seen_zeros(model):
    """Joints whose position moves some torque by more than 20 N m/rad (rms over random positions): the others' zeros are not seen."""
    rng, data, n = np.random.default_rng(0), model.createData(), model.nv
    square = np.zeros(n)
    for _ in range(50):
        q = pin.integrate(model, pin.neutral(model), rng.uniform(-1, 1, n))
        gradient, _, _ = pin.computeRNEADerivatives(model, data, q, np.zeros(n), np.zeros(n))
        square += (gradient**2).max(0)
    return [j for j in range(n) if (square[j] / 50) ** 0.5 > 20.0]


def loaded(model, mass):
    """The robot with a ball of `mass` kg at the tool."""
    real = model.copy()
    ball = pin.Inertia(mass, np.array([0.0, 0.0, 0.08]), 0.4 * mass * 0.05**2 * np.eye(3))
    real.inertias[real.njoints - 1] = real.inertias[real.njoints - 1] + ball
    return real


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--twincal", type=Path, default=Path("../../target/release/twincal"))
    arguments.add_argument("--robots", nargs="+", default=["ur5"], choices=ROBOTS)
    arguments.add_argument("--seeds", type=int, default=10)
    arguments.add_argument("--first-seed", type=int, default=1000)
    arguments.add_argument("-o", "--output", type=Path, default=Path("check_changes"))
    given = arguments.parse_args()
    twincal = given.twincal.resolve()
    wrong = False
    for robot in given.robots:
        folder = given.output / robot
        folder.mkdir(parents=True, exist_ok=True)
        model = load(robot)
        n = model.nv
        size = np.linspace(3.0, 0.6, n)
        of = np.random.default_rng(7)
        friction = np.array([size * of.uniform(0.6, 1.2, n), size * of.uniform(0.6, 1.2, n)])
        moved = sum(inertia.mass for inertia in model.inertias[1:])
        config = ["--config", "../locked.toml"] if ROBOTS[robot].locked else []
        if config:
            joints = ", ".join(f"{joint} = 0.0" for joint in ROBOTS[robot].locked)
            (given.output / "locked.toml").write_text(f"[model]\nlocked = {{ {joints} }}\n")
        run = lambda *words: subprocess.run([twincal, *words], cwd=folder, capture_output=True, text=True)
        nothing = np.zeros(n)
        logs = [f"train{k}.csv" for k in range(3)]
        for k, name in enumerate(logs):
            write(folder / name, log(model, model, np.random.default_rng(k), friction, nothing))
        done = run("fit", *logs, "--model", model_file(robot), *config, "-o", "twin", "--force")
        if done.returncode not in (0, 3):
            sys.exit(done.stderr)
        zeros = seen_zeros(model)
        counts = {"good": [], "friction + 50 %": [], "payload 5 %": [], "joint zero 1°": []}
        wrong_logs = {}
        own = [run("check", name, "--twin", "twin").returncode for name in logs]
        for seed in range(given.first_seed, given.first_seed + given.seeds):
            more = friction.copy()
            more[:, seed % n] *= 1.5
            off = np.zeros(n)
            off[zeros[seed % len(zeros)]] = np.deg2rad(1.0)
            cases = {
                "good": (model, friction, nothing),
                "friction + 50 %": (model, more, nothing),
                "payload 5 %": (loaded(model, 0.05 * moved), friction, nothing),
                "joint zero 1°": (model, friction, off),
            }
            for k, (case, (real, forces, zero)) in enumerate(cases.items()):
                write(folder / "log.csv", log(model, real, np.random.default_rng([seed, k]), forces, zero))
                counts[case].append(run("check", "log.csv", "--twin", "twin").returncode)
            good = log(model, model, np.random.default_rng([seed, len(cases)]), friction, nothing)
            for case, columns in misread(good, n, seed).items():
                write(folder / "log.csv", columns)
                wrong_logs.setdefault(case, []).append(run("check", "log.csv", "--twin", "twin").returncode)
        print(f"{robot}: check of the fit's own logs ends with {own}")
        for case, codes in counts.items():
            failed = codes.count(1)
            print(f"{robot}: {case:16} fails in {failed} of {len(codes)}; exit codes {codes}", flush=True)
            wrong |= failed > 1 if case == "good" else failed < 0.9 * len(codes)
        for case, codes in wrong_logs.items():
            print(f"{robot}: {case:17} is inconclusive in {codes.count(3)} of {len(codes)}; exit codes {codes}", flush=True)
            wrong |= codes.count(3) < 0.9 * len(codes)
        wrong |= any(own)  # the logs of the fit pass
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())

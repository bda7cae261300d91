"""What the calibration must reach on this study, measured: `python acceptance.py [--long] [--only WORLD]`.

Simulates worlds, runs `twincal fit` on them as a user would, and prints one line per world: true terms missed, false
terms, coverage of the 95 % coefficient intervals, held-out error and coverage. The short form (few seeds) is part of
the checks; `--long` is 20 seeds per world, and its last table stands in README.md.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import candidates
from arm import ASSETS, GENERIC, JOINTS, NOMINAL, inverse_dynamics, mujoco_model
from simulate import Settings, simulate, write

RELEASE = Path(__file__).resolve().parents[2] / "target" / "release"
PROGRAM = Path(os.environ.get("TWINCAL_BIN_DIR", RELEASE)) / "twincal"

# Seven terms of the user's own beside the 17 generic ones: 24 candidates.
USER = ["sin(2*q1)", "cos(2*q1)", "sin(2*q2)", "cos(2*q2)", "q1*q2", "q1^3", "q2^3"]
CONSERVATIVE = f"[library]\nterms = {json.dumps(USER)}\nfriction = []\noffset = false\nmotor_inertia = false\n"
# 17 generic, four friction, two offsets, one user term: 24 candidates.
FRICTION = '[library]\nterms = ["sin(2*q2)"]\nmotor_inertia = false\ncoulomb_velocity = 0.02\n'
EXACT = "[signal]\ncutoff_hz = 0\n"


@dataclass(frozen=True)
class World:
    """One row of the table: what is simulated and what `twincal` is told."""

    name: str
    settings: Settings
    config: str = ""
    full: bool = False  # exact rows: least squares on the full library says what can be seen at all


FRICTIONLESS = {"viscous": (0.0, 0.0), "coulomb": (0.0, 0.0)}
ONE_LOG = {"train": 1, "heldout": 2}  # 2000 x 2 rows at 100 Hz
RAW = {"train": 1, "heldout": 1, "rate_hz": 1000.0}


def worlds():
    """Every world of the table."""
    slow = [("20 ms", 0.02), ("100 ms", 0.1)]
    encoders = [1e-5, 1e-4, 1e-3]
    out = [
        World("white noise", Settings(**ONE_LOG, **FRICTIONLESS), CONSERVATIVE + EXACT, True),
        World("white noise, the paper's likelihood", Settings(**ONE_LOG, **FRICTIONLESS),
              CONSERVATIVE + EXACT + '[noise]\nmodel = "iid"\nper_joint = false\n', True),  # fmt: skip
        World("white noise, friction", Settings(**ONE_LOG), FRICTION + EXACT, True),
    ]
    for label, time in slow:
        world = Settings(**RAW, noise_time=time)
        out.append(World(f"AR(1) {label}, default", world, FRICTION))
        out.append(World(f"AR(1) {label}, ar1", world, FRICTION + '[noise]\nmodel = "ar1"\n'))
        out.append(World(f"AR(1) {label}, the paper's", world, FRICTION + EXACT + '[noise]\nmodel = "iid"\n'))
    out += [World(f"encoder only, {sd:g} rad", Settings(**RAW, encoder_sd=sd), FRICTION) for sd in encoders]
    return out


def design(log, names, coulomb_velocity):
    """Columns of the named terms on one log, (2N) x K."""
    columns = []
    for name in names:
        joint, dot, kind = name.partition(".")
        if dot:
            column = candidates.friction_column(kind, JOINTS.index(joint), log.qd, coulomb_velocity)
        else:
            column = candidates.column(name, log.q, log.qd, log.qdd)
        columns.append(column.ravel())
    return np.stack(columns, 1)


def residual(log):
    """Measured minus nominal torque, 2N."""
    return (log.tau - inverse_dynamics(mujoco_model(NOMINAL), log.q, log.qd, log.qdd)).ravel()


def true_coefficient(truth, name):
    """Exact coefficient of a term; 0 for a user's term that the world does not hold."""
    return truth["motor_inertia"].get(name, truth["terms"].get(name, 0.0))


def fit(study, config, *arguments):
    """`twincal fit` on a study's logs; returns result.json."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        paths = write(study, folder, "parquet")
        (folder / "twincal.toml").write_text(config)
        train = [path for name, path in paths.items() if name.startswith("train")]
        heldout = [path for name, path in paths.items() if name.startswith("heldout")]
        command = [PROGRAM, "fit", *train, "--model", ASSETS / "arm.urdf", "--config", folder / "twincal.toml"]
        command += ["-o", folder / "out", *arguments] + (["--heldout", *heldout] if heldout else [])
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if done.returncode not in (0, 3):
            raise RuntimeError(f"twincal fit: exit {done.returncode}\n{done.stdout}\n{done.stderr}")
        return json.loads((folder / "out" / "result.json").read_text())


def measure(world, seed):
    """One run: a flat dict of numbers."""
    study = simulate(replace(world.settings, seed=seed))
    result = fit(study, world.config)
    live = [term for term in result["terms"] if term["pip"] is not None]
    names = [term["name"] for term in live]
    beta = np.array([true_coefficient(study.truth, name) for name in names])
    pip = np.array([term["pip"] for term in live])
    mean, sd = (np.array([term[key] for term in live]) for key in ("mean", "sd"))
    low, high = np.array([term["interval95"] for term in live]).T
    slack = 1e-12 * np.maximum(np.abs(beta), 1.0)
    inside = (low - slack <= beta) & (beta <= high + slack)
    true = beta != 0
    friction = np.array([name.endswith((".viscous", ".coulomb")) for name in names]) & true
    scores = result["validation"]["filtered"] if "filtered" in result["validation"] else result["validation"]
    out = {
        "candidates": len(names),
        "true": int(true.sum()),
        "missed": int((true & (pip < 0.5)).sum()),
        "false": int((~true & (pip >= 0.5)).sum()),
        "coverage_true": float(inside[true].mean()),
        "coverage_all": float(inside.mean()),
        "friction_z": float(np.max(np.abs(mean - beta)[friction] / sd[friction])) if friction.any() else 0.0,
        "rmse": scores["rmse_calibrated"],
        "heldout_coverage": [joint["coverage95"] for joint in scores["joints"]],
    }
    if world.full:
        logs = {role: [log for log in study.logs if log.role == role] for role in ("train", "heldout")}
        v_s = study.truth["coulomb_velocity"]
        phi = np.concatenate([design(log, names, v_s) for log in logs["train"]])
        y = np.concatenate([residual(log) for log in logs["train"]])
        scale = np.sqrt(np.mean(phi**2, axis=0))
        full = np.linalg.lstsq(phi / scale, y, rcond=None)[0] / scale
        sigma2 = np.sum((y - phi @ full) ** 2) / (len(y) - len(names))
        error = np.sqrt(sigma2 * np.diag(np.linalg.inv((phi / scale).T @ (phi / scale)))) / scale
        visible = np.abs(beta) > 8 * error
        support = np.linalg.lstsq(phi[:, true] / scale[true], y, rcond=None)[0] / scale[true]
        rest = np.concatenate([residual(log) - design(log, names, v_s)[:, true] @ support for log in logs["heldout"]])
        out["visible"] = int(visible.sum())
        out["visible_pip"] = float(pip[visible].min())
        out["rmse_ratio"] = out["rmse"] / float(np.sqrt(np.mean(rest**2)))
    return out


def run(world, seeds):
    """All seeds of one world."""
    return [measure(world, seed) for seed in seeds]


def line(world, runs):
    """One row of the table."""

    def mean(key):
        return np.mean([run[key] for run in runs])

    coverage = np.mean([run["heldout_coverage"] for run in runs], axis=0)
    cells = [world.name, len(runs), f"{mean('missed'):.2f} of {mean('true'):.0f}", f"{mean('false'):.2f}",
             f"{mean('coverage_true'):.3f}", f"{mean('coverage_all'):.3f}", f"{mean('rmse'):.4f}",
             " ".join(f"{c:.3f}" for c in coverage)]  # fmt: skip
    cells.append(f"{max(run['friction_z'] for run in runs):.1f}")
    cells.append(f"{min(run['visible_pip'] for run in runs):.4f}" if world.full else "")
    cells.append(f"{max(run['rmse_ratio'] for run in runs):.4f}" if world.full else "")
    return "| " + " | ".join(map(str, cells)) + " |"


HEADER = """\
| world | runs | missed | false | coverage (true) | (all) | held-out RMSE | coverage | friction max abs z | least PIP of visible | RMSE / true support |
|---|---|---|---|---|---|---|---|---|---|---|"""


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--long", action="store_true", help="20 seeds per world instead of 3")
    parser.add_argument("--only", default="", help="worlds whose name contains this")
    options = parser.parse_args()
    print(HEADER)
    for world in worlds():
        if options.only in world.name:
            print(line(world, run(world, range(1, 21 if options.long else 4))))
            sys.stdout.flush()


if __name__ == "__main__":
    main()

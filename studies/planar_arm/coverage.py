"""Do 95 % intervals hold what they promise? `python coverage.py [--seeds 200] [--jobs 1] [-o FOLDER]`, resumable.

Every world adds its own noise to the same motions of 20 s at 1 kHz, one log to fit and one held out per seed, and runs `twincal fit`
on them as a user would. Counted are

- *coefficients*: true terms with |beta| above 8 of the reported sd that are in; is the truth inside `interval95`?
- *torque*: rows of the held-out log inside the predicted 95 % interval, per joint.

A share p of n rows or terms that hang together within a log is told with the standard error over logs.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import repeat
from math import exp, sqrt
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
from scipy.signal import lfilter

from acceptance import FRICTION, FRICTIONLESS, PROGRAM
from arm import ASSETS
from simulate import Settings, simulate

LOGS = {"train": 1, "heldout": 1, "rate_hz": 1000.0}
SD = 0.1  # of the torque noise, N m
CLEAR = 8.0  # standard errors above which a true term counts
PLAIN = '[library]\nterms = ["sin(2*q2)"]\nfriction = []\noffset = false\nmotor_inertia = false\n'


@dataclass(frozen=True)
class World:
    """What is added to the torque, what is logged, and what `twincal` is told."""

    name: str
    times: tuple = (0.0,)  # time constants of the noise, s; 0: white
    sds: tuple = (SD,)  # its parts' sds
    joints: tuple = (1.0, 1.0)  # factor of shoulder and elbow
    outliers: float = 0.0  # share of samples with 20 times the noise
    encoder_sd: float = 0.0
    friction: bool = False
    config: str = ""


WORLDS = [
    World("white"),
    World("AR(1) 5 ms", (0.005,)),
    World("AR(1) 20 ms", (0.02,)),
    World("AR(1) 100 ms", (0.1,)),
    World("AR(1) 5 ms, ar1", (0.005,), config='[noise]\nmodel = "ar1"\n'),
    World("AR(1) 20 ms, ar1", (0.02,), config='[noise]\nmodel = "ar1"\n'),
    World("AR(1) 100 ms, ar1", (0.1,), config='[noise]\nmodel = "ar1"\n'),
    World("white and slow (1 s, half as large)", (0.0, 1.0), (SD, 0.5 * SD)),
    World("joint noises 0.3 and 0.03 N m", joints=(3.0, 0.3)),
    World("2 % outliers, robust", outliers=0.02, config="[noise]\nrobust = true\n"),
    World("friction", friction=True),
    World("only positions, 1e-5 rad", encoder_sd=1e-5, friction=True),
    World("only positions, 1e-4 rad", encoder_sd=1e-4, friction=True),
]


def noise(world, rng, rows):
    """Torque noise, rows x 2."""
    total = np.zeros((rows, 2))
    for time, sd in zip(world.times, world.sds):
        white = rng.standard_normal((rows, 2))
        if time > 0:
            rho = exp(-1.0 / (LOGS["rate_hz"] * time))
            start = rho * rng.standard_normal((1, 2))  # stationary from the first sample on
            white, _ = lfilter([sqrt(1 - rho * rho)], [1, -rho], white, axis=0, zi=start)
        total += sd * white
    hit = rng.random((rows, 2)) < world.outliers
    return np.where(hit, 20 * SD * rng.standard_normal((rows, 2)), total) * world.joints


def measure(seed, index):
    """One run: flat numbers."""
    world = WORLDS[index]
    friction = {} if world.friction else FRICTIONLESS
    study = simulate(Settings(**LOGS, **friction, noise_sd=0.0, seed=seed))
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for number, log in enumerate(study.logs):
            rng = np.random.default_rng([seed, index, number])
            log = replace(log, noise=noise(world, rng, len(log.t)), encoder_only=world.encoder_sd > 0,
                          q_logged=log.q + world.encoder_sd * rng.standard_normal(log.q.shape))  # fmt: skip
            columns = log.columns()
            if not log.encoder_only:
                columns = {name: x for name, x in columns.items() if not name.startswith("qdd")}
            pyarrow.parquet.write_table(pyarrow.table(columns), folder / f"{log.role}.parquet")
        (folder / "twincal.toml").write_text((FRICTION if world.friction else PLAIN) + world.config)
        command = [PROGRAM, "fit", folder / "train.parquet", "--heldout", folder / "heldout.parquet", "--model",
                   ASSETS / "arm.urdf", "--config", folder / "twincal.toml", "-o", folder / "out", "--threads", 1]  # fmt: skip
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if done.returncode not in (0, 3):
            return {"seed": seed, "world": world.name, "exit": done.returncode, "error": done.stderr[-400:]}
        result = json.loads((folder / "out" / "result.json").read_text())
    out = {"seed": seed, "world": world.name, "exit": done.returncode, "held": 0, "clear": 0, "false": 0, "missed": 0}
    for term in result["terms"]:
        if term["pip"] is None:
            continue
        beta = study.truth["terms"].get(term["name"], 0.0)
        chosen = term["pip"] >= 0.5
        out["missed"] += beta != 0 and not chosen
        out["false"] += beta == 0 and chosen
        if beta != 0 and chosen and abs(beta) > CLEAR * term["conditional_sd"]:
            low, high = term["interval95"]
            out["clear"] += 1
            out["held"] += low <= beta <= high
    out["torque"] = [joint["coverage95"] for joint in result["validation"]["joints"]]
    return out


def seed_of_all(seed, known, only):
    """The worlds of one seed that are not known yet: their motions are the same."""
    asked = [i for i, world in enumerate(WORLDS) if not only or world.name in only]
    return [measure(seed, i) for i in asked if (seed, WORLDS[i].name) not in known]


def pooled(values):
    """Mean and its standard error over logs."""
    values = np.asarray(values, float)
    return f"{values.mean():.3f} ± {values.std(ddof=1) / sqrt(len(values)):.3f}"


def share(runs):
    """Covered share of the clear terms and its standard error over logs (ratio estimator)."""
    held, clear = (np.array([run[key] for run in runs], float) for key in ("held", "clear"))
    p = held.sum() / clear.sum()
    return f"{p:.3f} ± {np.sqrt(((held - p * clear) ** 2).sum()) / clear.sum():.3f}"


def table(runs):
    """Rows of Markdown."""
    lines = ["| world | logs | false | missed | coefficients | torque of shoulder | of elbow |", "|---|---|---|---|---|---|---|"]
    for world in WORLDS:
        own = [run for run in runs if run["world"] == world.name and run["exit"] in (0, 3)]
        refused = sum(run["world"] == world.name for run in runs) - len(own)
        if len(own) < 2:
            continue
        cells = [world.name, f"{len(own)}" + (f" ({refused} refused)" if refused else "")]
        cells += [f"{np.mean([run[key] for run in own]):.2f}" for key in ("false", "missed")]
        cells += [share(own)] + [pooled([run["torque"][joint] for run in own]) for joint in range(2)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--only", action="append", choices=[world.name for world in WORLDS], help="this world (repeatable)")
    parser.add_argument("-o", "--output", type=Path, default=Path("target/coverage"), help="runs that are done are kept here")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    kept = options.output / "runs.jsonl"
    runs = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    known = {(run["seed"], run["world"]) for run in runs}
    with ProcessPoolExecutor(options.jobs) as pool, kept.open("a") as file:
        for more in pool.map(seed_of_all, range(1, options.seeds + 1), repeat(known), repeat(options.only)):
            runs += more
            file.writelines(json.dumps(run) + "\n" for run in more)
            file.flush()
            print(f"\r{len(runs)} runs", end="", file=sys.stderr)
    print(file=sys.stderr)
    print(table(runs))


if __name__ == "__main__":
    main()

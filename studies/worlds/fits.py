"""Fits worlds with one program and writes a JSON line per fit, then the table.

    run --program twincal --seeds 1 3 [--worlds tilt,gain] [--held-back] [--robots ur5,panda] [--keep DIR] [--lines fits.jsonl] [--judge-again]

Logs are made once in the folder of `--keep` (default target/worlds), so that several programs are compared on the same logs. Fits that the
lines have already, by the same program file, are not repeated. `compare.py a.jsonl b.jsonl` shows what two programs do differently.
"""

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from judge import judged
from shared import ROOT
from table import markdown
from worlds import HELD_BACK, KINDS, draw, kept

PROGRAM = Path(os.environ.get("TWINCAL", ROOT / "target/release/twincal"))
LIMIT = 300.0  # s, for one fit
BASELINE = '\n[library]\nfamilies = ["viscous", "coulomb", "motor_inertia"]\n'


def fingerprint(program):
    """First digits of the program's checksum."""
    return hashlib.sha256(Path(program).read_bytes()).hexdigest()[:12]


def spent():
    """CPU seconds of all child processes so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fit(program, folder, config, out):
    """Runs one fit: exit code, errors, result or None, CPU seconds, wall seconds."""
    before, began = spent(), time.monotonic()
    command = [str(program), "fit", "--config", config, "-o", out, "--force"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return -1, "out of time", None, spent() - before, LIMIT
    path = folder / out / "result.json"
    result = json.loads(path.read_text()) if done.returncode in (0, 3) and path.exists() else None
    return done.returncode, done.stderr[-2000:], result, spent() - before, time.monotonic() - began


def friction_only(program, folder, name):
    """The fit with nominal torque, friction and motor inertia alone, made once per program."""
    path = folder / f"friction-{name}.json"
    if not path.exists():
        (folder / "friction.toml").write_text((folder / "twincal.toml").read_text() + BASELINE)
        _, _, result, _, _ = fit(program, folder, "friction.toml", f"friction-{name}")
        path.write_text(json.dumps({"validation": {"moving": result["validation"]["moving"]}} if result else None))
    return json.loads(path.read_text())


def prediction(program, folder, out):
    """What the twin predicts along the third motion, as `judge` asks for it."""

    def predict(path, joints):
        names = ["t", *(f"{name}{j + 1}" for name in ("q", "qd", "qdd", "tau") for j in range(len(joints)))]
        motion = np.hstack([path.t[:, None], path.q, path.qd, path.qdd, np.zeros_like(path.q)])
        np.savetxt(folder / "third.csv", motion, delimiter=",", header=",".join(names), comments="")
        command = [str(program), "predict", "third.csv", "--twin", out, "-o", f"third-{out}.csv", "--force"]
        subprocess.run(command, cwd=folder, capture_output=True, stdin=subprocess.DEVNULL, timeout=LIMIT)
        with (folder / f"third-{out}.csv").open() as file:
            header = file.readline().strip().split(",")
            said = np.loadtxt(file, delimiter=",", usecols=[0, *(header.index(f"{joint}.tau") for joint in joints)])
        return np.searchsorted(path.t, said[:, 0] - 1e-6), said[:, 1:]

    return predict


def one(program, kind, seed, keep):
    """Makes, fits and judges one world; its line."""
    folder, truth = kept(kind, seed, keep)
    name = fingerprint(program)
    code, error, result, cpu, wall = fit(program, folder, "twincal.toml", f"out-{name}")
    line = {"world": kind, "seed": seed, "robot": truth["world"]["robot"], "motion": truth["motion"], "heldout_motion": truth["heldout_motion"],
            "program": name, "code": code, "cpu": round(cpu, 2), "wall": round(wall, 2)}  # fmt: skip
    if result is None:
        return line | {"error": error[max(error.find("error:"), 0) :].strip()}
    return line | judged(truth, result, friction_only(program, folder, name), folder, prediction(program, folder, f"out-{name}"))


def judge_again(program, line, keep):
    """A line judged anew, from the result that its fit left in the folder of the logs."""
    folder, truth = kept(line["world"], line["seed"], keep)
    out = f"out-{line['program']}"
    path = folder / out / "result.json"
    if "error" in line or not path.exists():
        return line
    friction = json.loads((folder / f"friction-{line['program']}.json").read_text())
    return line | judged(truth, json.loads(path.read_text()), friction, folder, prediction(program, folder, out))


def read(path):
    """Lines of a file, none if it is not there."""
    path = Path(path) if path else None
    return [json.loads(text) for text in path.read_text().splitlines() if text.strip()] if path and path.exists() else []


def wanted(given):
    """Kinds and seeds that are asked for."""
    kinds = given.worlds.split(",") if given.worlds else list(HELD_BACK if given.held_back else KINDS)
    unknown = [kind for kind in kinds if kind not in KINDS + HELD_BACK]
    if unknown:
        sys.exit(f"unknown worlds {unknown}; there are {', '.join(KINDS + HELD_BACK)}")
    first, last = given.seeds
    cells = [(kind, seed) for seed in range(first, last + 1) for kind in kinds]
    robots = given.robots.split(",") if given.robots else None
    return [cell for cell in cells if robots is None or draw(*cell).robot in robots]


def made(program, todo, given):
    """Lines of the worlds to do, one after the other; with more jobs in other processes, in the same order."""
    tasks = [(program, *cell, given.keep.resolve()) for cell in todo]
    if given.jobs <= 1:
        yield from (one(*task) for task in tasks)
        return
    with ProcessPoolExecutor(given.jobs) as pool:
        yield from pool.map(one, *zip(*tasks)) if tasks else []


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", type=Path, default=PROGRAM)
    arguments.add_argument("--seeds", type=int, nargs=2, default=(1, 3), metavar=("FIRST", "LAST"))
    arguments.add_argument("--worlds", default="", help="kinds, with commas")
    arguments.add_argument("--held-back", action="store_true", help="the kinds that nobody tunes on")
    arguments.add_argument("--robots", default="", help="only worlds of these robots, with commas")
    arguments.add_argument("--jobs", type=int, default=1)
    arguments.add_argument("--keep", type=Path, default=ROOT / "target/worlds", help="folder of the logs")
    arguments.add_argument("--lines", type=Path, help="JSON lines of every fit; fits that are there are not repeated")
    arguments.add_argument("--judge-again", action="store_true", help="judge the lines anew from the results that are kept with the logs")
    arguments.add_argument("--quiet", action="store_true", help="no line per fit on standard error")
    given = arguments.parse_args()
    program = given.program.resolve()
    name = fingerprint(program)
    cells = wanted(given)
    kept_lines = read(given.lines)
    mine = lambda line: line["program"] == name and (line["world"], line["seed"]) in cells
    lines = [line for line in kept_lines if mine(line)]
    if given.judge_again:
        lines = [judge_again(program, line, given.keep.resolve()) for line in lines]
        others = [line for line in kept_lines if not mine(line)]
        given.lines.write_text("".join(json.dumps(line) + "\n" for line in others + lines))
    there = {(line["world"], line["seed"]) for line in lines}
    todo = [cell for cell in cells if cell not in there]
    for line in made(program, todo, given):
        lines.append(line)
        if given.lines:
            with given.lines.open("a") as file:
                file.write(json.dumps(line) + "\n")
        if not given.quiet:
            print(summary(line), file=sys.stderr, flush=True)
    print(markdown(lines))
    return 0


def summary(line):
    """One fit in a line."""
    head = f"{line['world']} {line['seed']} {line['robot']} {line['motion']}, {line['cpu']} s:"
    if "error" in line:
        return f"{head} {line['error'][:200]}"
    claims = [f"{row['name']} {row['judged']}" for row in line["components"] if row["status"] == "established"]
    claims += [f"{{{' | '.join(one['members'])}}} {one['judged']}" for one in line["sets"]]
    missed = [f"{c['subject']} {c['family']} ({c['standard_errors']:.0f} se)" for c in line["causes"] if not (c["established"] or c["in_set"])]
    return f"{head} {', '.join(claims) or 'nothing'}" + (f"; not established: {', '.join(missed)}" if missed else "")


if __name__ == "__main__":
    sys.exit(main())

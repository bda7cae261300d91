"""Simulates fleets, makes their statistics, runs `twincal fleet` and judges it: one JSON line per fleet, then the table.

    run --program P --seeds FIRST LAST [--units 40] [--kind standard] [--sds 6] [--short] [--keep DIR] [--lines fleets.jsonl] [--judge-again]

With `--keep` logs and statistics stay in DIR, so that several programs get the same logs; without it they are removed after each fleet.
Fleets that the lines have already, by the same program file, are not repeated.
"""

import argparse
import hashlib
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
from fleets import SHORT, VERSION, Fleet, add_arguments, fleet_of, make
from judge import judged, pooling
from table import markdown

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("TWINCAL", ROOT / "target/release/twincal"))
LIMIT = 3600.0  # s, for one command
PLAN_LOGS = 6  # so many logs of the first unit make the plan: a plan takes what robots differ in for noise
CONFIG = ("--config", "twincal.toml")
POOLED = Path("pooled")  # the twin of the short unit that `fleet` writes


def fingerprint(program):
    """First digits of the program's checksum."""
    return hashlib.sha256(Path(program).read_bytes()).hexdigest()[:12]


def spent():
    """CPU seconds of this process and of all that it waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


class Failed(Exception):
    """A command that did not do its work."""


def call(folder, *command):
    """Runs a command in a folder; its errors are those of the program."""
    try:
        done = subprocess.run([str(one) for one in command], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=LIMIT)
    except subprocess.TimeoutExpired as late:
        raise Failed(f"{command[1]}: out of time") from late
    if done.returncode not in (0, 3):
        raise Failed(f"{command[1]}: {done.stderr[max(done.stderr.find('error:'), 0) :].strip()[-600:]}")


def truth_of(fleet, folder):
    """Truth of a fleet that the folder holds; None where it holds none, or another one."""
    path = folder / "truth.json"
    truth = json.loads(path.read_text()) if path.exists() else None
    return truth if truth and truth["version"] == VERSION and truth["fleet"] == asdict(fleet) else None


def simulated(fleet, folder, jobs):
    """Truth of a fleet that is made in the folder."""
    # complete or absent: a fleet of which a part was written has no truth.json
    shutil.rmtree(folder, ignore_errors=True)
    make(fleet, folder, jobs)
    return truth_of(fleet, folder)


def make_statistics(program, folder, truth, force):
    """Statistics of every unit in st/UNIT, with one plan from logs of several units."""
    again = ("--force",) if force else ()
    robots = [unit["robot"] for unit in truth["units"]]
    plan = folder / "st" / "plan"
    if force or not (plan / "plan.json").exists():
        shutil.rmtree(plan, ignore_errors=True)
        some = [f"{robots[0]}-w{week}.parquet" for week in range(1, PLAN_LOGS + 1)]
        call(folder, program, "statistics", *some, *CONFIG, "--plan", "fleet", "-o", plan, *again)
        # these logs come again with the name of their unit
        for extra in plan.glob("*.arrow"):
            extra.unlink()
    for robot in robots:
        if not force and any((folder / "st" / robot).glob("*.arrow")):
            continue
        logs = sorted(path.name for path in folder.glob(f"{robot}-w*.parquet"))
        call(folder, program, "statistics", *logs, *CONFIG, "--robot", robot, "--plan", plan / "plan.json", "-o", f"st/{robot}", *again)


def predicted(program, folder, motion, twin):
    """Rows of a motion and the torque that a twin predicts there."""
    n = motion["q"].shape[1]
    names = ["t", *(f"{name}{j + 1}" for name in ("q", "qd", "qdd", "tau") for j in range(n))]
    table = np.hstack([motion["t"][:, None], motion["q"], motion["qd"], motion["qdd"], np.zeros_like(motion["q"])])
    np.savetxt(folder / "new.csv", table, delimiter=",", header=",".join(names), comments="")
    call(folder, program, "predict", "new.csv", "--twin", twin, "-o", "new-predicted.csv", "--force")
    with (folder / "new-predicted.csv").open() as file:
        header = file.readline().strip().split(",")
        columns = [k for k, name in enumerate(header) if name.endswith(".tau")]
        said = np.loadtxt(file, delimiter=",", usecols=[0, *columns])
    return np.searchsorted(motion["t"], said[:, 0] - 1e-6), said[:, 1:]


def short_unit(program, folder, truth):
    """Held-out errors of the unit with the short log, from the same statistics: fitted alone, and by the fleet."""
    motion = np.load(folder / "new.npz")
    files = sorted(str(path.relative_to(folder)) for path in folder.glob(f"st/{SHORT[0]}/*.arrow"))
    call(folder, program, "fit", "--statistics", *files, "-o", "alone", "--force")
    both = [predicted(program, folder, motion, twin) for twin in ("alone", POOLED)]
    return pooling(truth, motion, *both)


def one(program, fleet, folder, given):
    """Simulates, runs and judges one fleet; its line."""
    line = asdict(fleet) | {"program": fingerprint(program), "cpu": {}}
    began = [spent()]

    def clock(what):
        began.append(spent())
        line["cpu"][what] = round(began[-1] - began[-2], 1)

    kept = truth_of(fleet, folder)
    truth = kept or simulated(fleet, folder, given.jobs)
    if not kept:
        clock("simulate")
    try:
        make_statistics(program, folder, truth, given.again)
        clock("statistics")
        files = sorted(str(path.relative_to(folder)) for path in folder.glob("st/*/*.arrow"))
        twin = ("--twin", f"{SHORT[0]}={POOLED}") if fleet.short else ()
        call(folder, program, "fleet", *files, "--by", "robot", "--window", "7d", *twin, "-o", "out", "--force")
        clock("fleet")
        return line | judgement(program, folder, truth)
    except Failed as why:
        return line | {"error": str(why)}


def judgement(program, folder, truth):
    """What is judged of the folder's fleet.json, and the short unit where there is one."""
    found = judged(truth, json.loads((folder / "out" / "fleet.json").read_text()))
    return found | ({"pooling": short_unit(program, folder, truth)} if truth["fleet"]["short"] else {})


def read(path):
    """Lines of a file, none if it is not there."""
    return [json.loads(text) for text in path.read_text().splitlines() if text.strip()] if path and path.exists() else []


def summary(line):
    """One fleet in a line."""
    cpu = ", ".join(f"{what} {seconds} s" for what, seconds in line["cpu"].items())
    head = f"{time.strftime('%H:%M:%S')} {line['kind']} {line['seed']} {line['robot']} ({cpu}):"
    if "error" in line:
        return f"{head} {line['error']}"
    true = [unit for unit in line["robots"] if unit["deviates"]]
    false = [unit["robot"] for unit in line["robots"] if not unit["deviates"]]
    said = f"{head} {sum(unit['named'] for unit in true)} of {len(true)} units named, {line['type']['found']} of {line['type']['true']} type effects"
    return said + (f"; false: {', '.join(false + line['type']['false'])}" if false or line["type"]["false"] else "")


def parsed():
    """What the command line asks for."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(arguments)
    arguments.add_argument("--program", type=Path, default=PROGRAM)
    arguments.add_argument("--seeds", type=int, nargs=2, default=(1, 1), metavar=("FIRST", "LAST"))
    arguments.add_argument("--keep", type=Path, help="folder of logs and statistics")
    arguments.add_argument("--again", action="store_true", help="statistics are made anew where they are kept")
    arguments.add_argument("--lines", type=Path, help="JSON lines of every fleet; fleets that are there are not repeated")
    arguments.add_argument("--judge-again", action="store_true", help="judge kept results anew, without a run of the program")
    return arguments.parse_args()


def main():
    given = parsed()
    program = given.program.resolve()
    key = lambda line: tuple(line[name] for name in (*Fleet.__dataclass_fields__, "program"))
    lines, shown = {key(line): line for line in read(given.lines)}, []
    for seed in range(given.seeds[0], given.seeds[1] + 1):
        fleet = fleet_of(given, seed)
        mine = key(asdict(fleet) | {"program": fingerprint(program)})
        with tempfile.TemporaryDirectory(prefix="fleet-") as away:
            name = f"{fleet.kind}-{fleet.robot}-{seed}-{fleet.units}x{fleet.windows}-{fleet.sds:g}-{fleet.of}{'-short' * fleet.short}"
            folder = (given.keep or Path(away)).resolve() / name
            if given.judge_again and mine in lines and (folder / "out" / "fleet.json").exists():
                lines[mine] = lines[mine] | judgement(program, folder, json.loads((folder / "truth.json").read_text()))
                lines[mine].pop("error", None)
            elif mine not in lines:
                lines[mine] = one(program, fleet, folder, given)
                print(summary(lines[mine]), file=sys.stderr, flush=True)
            if given.lines:
                given.lines.write_text("".join(json.dumps(line) + "\n" for line in lines.values()))
        shown.append(lines[mine])
    print(markdown(shown))
    return 0


if __name__ == "__main__":
    sys.exit(main())

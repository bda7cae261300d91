"""How many plausible mistakes does `twincal fit` find, and how many wrong logs get a "Yes"?

    python mistakes.py [--program twincal] [--seeds 1] [--first-seed 1] [--only joint_degrees,copy_noisy] [--good 20] [--keep runs.jsonl]

Every mistake of `faults.py` on three robots x three motions x seeds; the seed also chooses friction and recorder. Good studies are all
robots, motions and frictions in turn. Printed as Markdown, per mistake:

    found      the share of runs with a finding of the mistake's codes on the right log or joint (or an error that names it)
    "Yes"      runs whose answer is yes, at most with exceptions, though a mistake stands that is not repaired: must be 0
    "… yes"    runs whose answer is yes but for the intervals or for standstill
    change ×   median of what the mistake changes: held-out error of the worst joint, or the payload's mass

and for good studies findings of these codes per 100 (severity note left out). `--keep` stores every run and goes on from there.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from faults import FAULTS, GOOD, REPAIRED, faulty_study
from arms import FRICTIONS, MOTIONS, ROBOTS, Arm, Recorder, World, write_study

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("TWINCAL", ROOT / "target/release/twincal"))
LIMIT = 120.0  # s, for one fit


@dataclass
class Run:
    """What one fit said."""

    fault: str
    robot: str
    motion: str
    seed: int
    code: int  # exit code; -1: out of time
    headline: str
    error: str
    findings: list  # of result.json
    rmse: list  # held-out, joint by joint, of moving rows
    seconds: float
    log: str  # where the mistake is
    joint: str
    found: list = None  # names of the components that were found
    payload: float = None  # kg
    rows: int = 0  # of training, over all joints
    truth: dict = None  # of the training logs: repeats, contact
    rest: list = None  # share of training rows masked at rest, and the share of samples truly at rest
    answer: str = None  # assessment.answer and its reason
    reason: str = None

    @property
    def key(self):
        return (self.fault, self.robot, self.motion, self.seed)


def world_of(robot, motion, seed):
    """World and recorder of a cell: friction, rate and encoder go round with the seed."""
    turn = seed + ROBOTS.index(robot) + MOTIONS.index(motion)
    world = World(robot, motion, FRICTIONS[turn % 3], law=("quintic", "trapezoid")[turn % 2], seed=seed)
    recorder = Recorder(rate=(250, 125, 500)[turn % 3], counts=2 ** (17 + turn % 4), at_rest=("silent", "dither")[turn // 2 % 2])
    return world, recorder


def headline(text):
    """May the twin be used? The first line on the terminal."""
    return text.partition("\n")[0].strip()


def fit(program, folder):
    """Runs `twincal fit` in a folder; exit code, terminal, errors, result.json or None, seconds."""
    began = time.monotonic()
    command = [str(program), "fit", "--config", "twincal.toml", "-o", "out", "--force"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return -1, "", "out of time", None, LIMIT
    path = folder / "out" / "result.json"
    result = json.loads(path.read_text()) if done.returncode in (0, 3) and path.exists() else None
    return done.returncode, done.stdout, done.stderr, result, time.monotonic() - began


def one(program, fault, robot, motion, seed):
    """Simulates and fits one study."""
    world, recorder = world_of(robot, motion, seed)
    study = faulty_study(fault, world, recorder)
    with tempfile.TemporaryDirectory() as name:
        folder = write_study(Path(name), study)
        code, out, error, result, seconds = fit(program, folder)
    joint = study.truth.get("joint")
    scores = (result or {}).get("validation") or {}
    rmse = [row.get("rmse_calibrated") for row in (scores.get("moving") or scores).get("joints") or []]
    findings = (result or {}).get("findings") or []
    components = (result or {}).get("components") or []
    masses = [p["mean"] for c in components if c["name"] == "payload" for p in c["parameters"] if p["name"] == "mass"]
    fitted = [log for log in (result or {}).get("logs") or [] if log["role"] == "fit"]
    rows, masked = (sum(sum(log[key]) for log in fitted) for key in ("rows", "standstill"))
    rest = [masked / max(rows + masked, 1), float(np.mean([log.truth["rest"] for log in study.train]))]
    truth = {key: [log.truth.get(key) for log in study.train] for key in ("repeats", "missing", "contact")}
    return Run(fault, robot, motion, seed, code, headline(out), "" if result else error[max(error.find("error:"), 0) :].strip()[:2000],
               findings, rmse, round(seconds, 2), study.truth.get("log") or "", "" if joint is None else Arm(world).names[joint],
               sorted(c["name"] for c in components if c["status"] == "established"), masses[0] if masses else None, rows, truth, rest,
               *((result or {}).get("assessment", {}).get(key) for key in ("answer", "reason")))  # fmt: skip


def names_it(run, text):
    """Whether a text names what `faults.py` wants named: the log, the joint, or nothing in particular."""
    wanted = {"log": run.log, "joint": run.joint, "any": ""}[FAULTS[run.fault].subject]
    return wanted.removesuffix(".csv") in text


def found(run):
    """The mistake is named: a finding of its codes (a note only where it is repaired) on the right log or joint, or an error that says so."""
    fault = FAULTS[run.fault]
    for finding in run.findings:
        if finding["severity"] == "note" and run.fault not in REPAIRED:
            continue
        if finding["code"] in fault.codes and names_it(run, f"{finding['subject']} {finding['message']}"):
            return True
    return bool(run.error and fault.error and re.search(fault.error, run.error) and names_it(run, run.error))


# Reasons of `yes_within_limits` that take back the intervals or standstill, and those that say little for the twin.
HALF = ["narrow_intervals", "narrow_intervals_in_motion", "worse_at_rest", "distribution_wide", "distribution_narrow"]
HALF += ["torque_above_prediction", "torque_below_prediction"]
POOR = ["nothing_found", "large_error", "large_error_on_most_joints", "unphysical_links", "joint_torque_worse"]


def said_yes(run):
    """The answer is yes, at most with exceptions on single joints or with intervals that are too wide."""
    return run.answer in ("yes", "yes_within_limits") and run.reason not in HALF + POOR


def half_yes(run):
    """The answer is yes, but for the intervals or for standstill."""
    return run.answer == "yes_within_limits" and run.reason in HALF


def alarms(run):
    """Findings of a good study that a mistake's table has, notes left out; an error counts as well."""
    codes = {code for fault in FAULTS.values() for code in fault.codes}
    said = [f["code"] for f in run.findings if f["code"] in codes and f["severity"] != "note"]
    return said + (["error"] if run.error else [])


def worse(run, good):
    """Held-out error of the worst joint over that of the study without the mistake, or the payload's mass over its, whichever changed more."""
    clean = good.get(("none", *run.key[1:]))
    if clean is None or not clean.rmse or not run.rmse or None in run.rmse:
        return None
    ratio = float(np.max(np.array(run.rmse) / np.array(clean.rmse)))
    mass = abs(run.payload / clean.payload - 1) if run.payload and clean.payload else 0.0
    return max(ratio, 1 + mass)


def timed(run):
    """Contacts of the training logs whose begin and end are both right within 0.1 s, and how many there are."""
    right = total = 0
    for number, contact in enumerate((run.truth or {}).get("contact") or [], 1):
        if contact is None:
            continue
        total += 1
        said = [f["message"] for f in run.findings if f["code"] in FAULTS[run.fault].codes and f["subject"] == f"train{number}.csv"]
        spans = [tuple(map(float, span)) for message in said for span in re.findall(r"from (-?[\d.]+) s to (-?[\d.]+) s", message)]
        right += any(abs(begin - contact[0]) <= 0.1 and abs(end - contact[1]) <= 0.1 for begin, end in spans)
    return right, total


def repaired(runs):
    """Lines on mistakes that are repaired: what the repair costs beside the study without the mistake."""
    lines = ["| repaired | counted / true | rows / clean | error × (90 %) | same effects | begin and end ± 0.1 s |", "|---|---|---|---|---|---|"]
    for name in REPAIRED:
        rows = [(run, runs[("none", *run.key[1:])]) for run in runs.values() if run.fault == name and ("none", *run.key[1:]) in runs]
        rows = [(run, clean) for run, clean in rows if run.rmse and clean.rmse and run.rows and clean.rows]
        if not rows:
            continue
        true = sum(sum(n or 0 for n in (run.truth or {}).get("repeats") or []) for run, _ in rows)
        right, contacts = (sum(part) for part in zip(*(timed(run) for run, _ in rows)))
        counted = sum(f["count"] for run, _ in rows for f in run.findings if f["code"] in FAULTS[name].codes and f["subject"] != "heldout.csv")
        ratios = np.array([np.sqrt(np.mean(np.square(run.rmse)) / np.mean(np.square(clean.rmse))) for run, clean in rows])
        kept = np.median([run.rows / clean.rows for run, clean in rows])
        same = sum(run.found == clean.found for run, clean in rows)
        share = f"{counted / true:.2f}" if true else "–"
        times = f"{right}/{contacts}" if contacts else "–"
        lines.append(f"| `{name}` | {share} | {kept:.2f} | {np.median(ratios):.2f} ({np.quantile(ratios, 0.9):.2f}) | {same}/{len(rows)} | {times} |")
    return lines


def read_kept(path):
    """Runs that a file has from before."""
    if path is None or not path.exists():
        return {}
    fields = Run.__dataclass_fields__
    lines = [json.loads(line) for line in path.read_text().splitlines() if line.strip()]
    # Runs of before answers were kept are made again.
    rows = [Run(**{key: value for key, value in line.items() if key in fields}) for line in lines if "answer" in line]
    return {row.key: row for row in rows}


def wanted_runs(given):
    """Keys of the runs asked for: mistakes, their good counterparts, more good studies."""
    only = given.only.split(",") if given.only else list(FAULTS)
    seeds = range(given.first_seed, given.first_seed + given.seeds)
    cells = [(robot, MOTIONS[(k + turn) % 3], seed) for seed in seeds for turn in range(3) for k, robot in enumerate(ROBOTS)]
    cells = [cell for cell in cells if given.robot in cell[0] and given.motion in cell[1]]
    keys = [(fault, *cell) for cell in cells for fault in (["none"] if given.clean else []) + [f for f in only if f not in GOOD]]
    turns = [(robot, motion, 500 + given.first_seed + k // 9) for k, (robot, motion) in
             enumerate([(r, m) for r in ROBOTS for m in MOTIONS] * (given.good // 9 + 1))][: given.good]  # fmt: skip
    return keys + [(("none", "same_programme")[k % 4 == 3], *cell) for k, cell in enumerate(turns)]


def table(runs):
    """Markdown table of the mistakes."""
    by_fault = defaultdict(list)
    for run in runs.values():
        by_fault[run.fault].append(run)
    lines = ["| mistake | size | found | \"Yes\" | \"… yes\" | refused | change × |", "|---|---|---|---|---|---|---|"]
    wrong = 0
    for name, fault in FAULTS.items():
        rows = by_fault.get(name, [])
        if name in GOOD or not rows:
            continue
        yes = sum(said_yes(run) for run in rows)
        wrong += yes if name not in REPAIRED else 0
        ratios = [r for r in (worse(run, runs) for run in rows) if r is not None]
        ratio = f"{np.median(ratios):.2f}" if ratios else "–"
        mark = " (repaired)" if name in REPAIRED else ""
        refused = sum(run.code not in (0, 3) for run in rows)
        lines.append(f"| `{name}` | {fault.size} | {sum(map(found, rows))}/{len(rows)} | {yes}{mark} | {sum(map(half_yes, rows))} | {refused} | {ratio} |")
    return lines, wrong


def good_table(runs):
    """Lines on good studies: false alarms by code and the runs that have them."""
    good = [run for run in runs.values() if run.fault in GOOD]
    if not good:
        return [], 0.0
    with_alarm = [run for run in good if alarms(run)]
    count = defaultdict(int)
    for run in with_alarm:
        for code in set(alarms(run)):
            count[code] += 1
    share = 100.0 * len(with_alarm) / len(good)
    what = ", ".join(f"`{code}` {n}" for code, n in sorted(count.items(), key=lambda item: -item[1])) or "none"
    yes = sum(said_yes(run) for run in good)
    moved = [run for run in good if run.rest and run.rows]
    fourier = [run.rest[0] - run.rest[1] for run in moved if run.motion == "fourier"]
    dwells = [run.rest[0] - run.rest[1] for run in moved if run.motion != "fourier"]
    rest = "".join(f" Masked as rest less truly at rest, {name}: median {np.median(x):+.3f}, worst {max(x, key=abs):+.3f}."
                   for name, x in (("Fourier", fourier), ("with dwells", dwells)) if x)  # fmt: skip
    return [f"Good studies: {len(good)}; with a false alarm: {len(with_alarm)} ({share:.1f} of 100): {what}. Answer \"Yes\": {yes}.{rest}"], share


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", type=Path, default=PROGRAM)
    arguments.add_argument("--seeds", type=int, default=1)
    arguments.add_argument("--first-seed", type=int, default=1)
    arguments.add_argument("--only", default="", help="mistakes, with commas")
    arguments.add_argument("--robot", default="")
    arguments.add_argument("--motion", default="")
    arguments.add_argument("--good", type=int, default=18, help="good studies for false alarms")
    arguments.add_argument("--no-clean", dest="clean", action="store_false", help="no good counterpart of each cell")
    arguments.add_argument("--keep", type=Path, help="JSON lines with every run; runs that are there are not repeated")
    arguments.add_argument("--strict", action="store_true", help="exit 1 if a wrong study gets a Yes")
    given = arguments.parse_args()
    runs = read_kept(given.keep)
    for key in wanted_runs(given):
        if key in runs:
            continue
        runs[key] = one(given.program.resolve(), *key)
        if given.keep:
            with given.keep.open("a") as file:
                file.write(json.dumps(asdict(runs[key])) + "\n")
    lines, wrong = table(runs)
    good, _ = good_table(runs)
    print("\n".join([*lines, "", *repaired(runs), "", *good]))
    return 1 if given.strict and wrong else 0


if __name__ == "__main__":
    sys.exit(main())

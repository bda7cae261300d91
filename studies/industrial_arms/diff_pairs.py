"""What `twincal diff` tells of a UR5 that did not change between two logs, and of one that took up 2.8 kg.

    python diff_pairs.py [--twincal PROGRAM] [--pairs 20] [--loads 10] [--first-seed 1]

Logs of 20 s differ in motion and noise; on every joint a function of its position acts that is outside the candidate library (`check_changes.py`).
Each log is fitted separately. Prints every change that is reported of an unchanged robot (new, gone, changed; ≤ 1 in 20
pairs is asked), and the payload's mass where it was taken up (within 10 % in 9 of 10).
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from check_changes import loaded, log
from simulate_arms import load, model_file, write

LOAD = 2.8  # kg
CHANGES = ("new", "gone", "changed")


def twin(twincal, folder, name, columns):
    """Fits one log."""
    write(folder / f"{name}.csv", columns)
    command = [twincal, "fit", f"{name}.csv", "--model", model_file("ur5"), "-o", name, "--force"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode not in (0, 3):
        sys.exit(done.stderr)


def compared(twincal, folder):
    """What `diff` says of the two."""
    done = subprocess.run([twincal, "diff", "before", "after", "--json"], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr)
    return json.loads(done.stdout)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--twincal", type=Path, default=Path("../../target/release/twincal"))
    arguments.add_argument("--pairs", type=int, default=20)
    arguments.add_argument("--loads", type=int, default=10)
    arguments.add_argument("--first-seed", type=int, default=1)
    given = arguments.parse_args()
    twincal, model = given.twincal.resolve(), load("ur5")
    n = model.nv
    size, nothing, pairs_with, right = np.linspace(3.0, 0.6, n), np.zeros(n), 0, 0
    for seed in range(given.first_seed, given.first_seed + given.pairs + given.loads):
        of = np.random.default_rng([seed, 3])
        friction = np.array([size * of.uniform(0.6, 1.2, n), size * of.uniform(0.6, 1.2, n)])
        changes = seed >= given.first_seed + given.pairs
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            for k, name in enumerate(("before", "after")):
                real = loaded(model, LOAD) if changes and name == "after" else model
                twin(twincal, folder, name, log(model, real, np.random.default_rng([seed, k]), friction, nothing))
            told = compared(twincal, folder)
        components = [own for own in told["components"] if own["became"] in CHANGES]
        names = [f"{own['name']} {own['became']}" for own in components]
        if not changes:
            pairs_with += bool(names)
            print(f"seed {seed}, unchanged: {', '.join(names) or 'nothing'}", flush=True)
            continue
        payload = next((own for own in told["components"] if own["name"] == "payload"), None)
        masses = [p["median"] for p in (payload or {}).get("parameters", []) if p["name"] == "mass"]
        right += bool(masses) and abs(masses[0] - LOAD) <= 0.1 * LOAD
        print(f"seed {seed}, + {LOAD} kg: {masses}; {', '.join(names)}", flush=True)
    print(f"pairs of an unchanged robot with a change: {pairs_with} of {given.pairs}; mass within 10 %: {right} of {given.loads}")
    return int(pairs_with > 1 or right < 0.9 * given.loads)


if __name__ == "__main__":
    sys.exit(main())

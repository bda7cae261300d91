"""Which method finds what is there and nothing else? All of them in one run, on the same data: docs/selection.md.

    benches/selection/run                         every problem, 30 seeds; then table and figure into docs/
    benches/selection/run --seeds 3 --only white  fewer
    benches/selection/run --first 31 --seeds 60   others

Every (problem, seed) is one line of JSON in target/selection/runs: an interrupted run goes on where it stopped; a run with
another program or another code wants --fresh.
"""

import os

for variable in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"]:
    os.environ[variable] = "1"

import argparse  # noqa: E402
import json  # noqa: E402
import shutil  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
import pyarrow  # noqa: E402
import pyarrow.parquet  # noqa: E402

import program  # noqa: E402
import rows  # noqa: E402
from problems import PLANAR, PROBLEMS  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]


def simulated(problem, seed, store):
    """The data of a problem; the module of its arm is loaded when it is needed."""
    if problem.arm == PLANAR:
        from planar import Data
    else:
        from ur5 import Data
    return Data(problem, seed, store)


def write(path, motion, rate):
    """One log for the program: (q, qd, qdd, tau), those that are None left out."""
    columns = {"t": np.arange(len(motion[0])) / rate}
    for key, values in zip(("q", "qd", "qdd", "tau"), motion):
        if values is not None:
            columns |= {f"{key}{j + 1}": values[:, j] for j in range(values.shape[1])}
    pyarrow.parquet.write_table(pyarrow.table(columns), path)
    return path


def inside(data, chosen):
    """A component of several columns is in when any of them is."""
    return np.array([bool(chosen[part].any()) for part in data.parts])


def wrong(data, found):
    """Names of the components that are on the wrong side."""
    return [name for name, f, t, i in zip(data.names, found, data.true, data.ignored) if f != t and not i]


def score(data, answer, heldout, seconds, verdict=None):
    """Flat numbers of one method on one problem; with `verdict` what the program says of components decides."""
    x, y, clean = heldout
    beta = answer["beta"]
    if verdict is None:
        chosen = answer["chance"] >= 0.5 if "chance" in answer else beta != 0
        found = inside(data, chosen)
        chance = [float(answer["chance"][part].max()) for part in data.parts] if "chance" in answer else None
    else:
        said = [verdict.get(name, (False, 0.0)) for name in data.names]
        found, chance = np.array([s[0] for s in said]), [s[1] for s in said]
    true, counted = data.true, ~data.ignored
    out = {
        "false": int((found & ~true & counted).sum()),
        "missed": int((~found & true).sum()),
        "hit": int((found & true).sum()),
        "wrong": wrong(data, found),
        "rmse": float(np.sqrt(np.mean((y - x @ beta) ** 2))),
        "rmse_clean": float(np.sqrt(np.mean((clean - x @ beta) ** 2))),
        "seconds": seconds,
    }
    if chance is not None:
        out["chance"] = [round(c, 6) for c, counts in zip(chance, counted) if counts]
        out["is_true"] = [bool(t) for t, counts in zip(true, counted) if counts]
    if "low" in answer:
        there = (data.truth != 0) & np.isfinite(data.truth)
        slack = 1e-12 * np.abs(data.truth)
        covered = (answer["low"] - slack <= data.truth) & (data.truth <= answer["high"] + slack)
        out["covered"] = [int(covered[there].sum()), int(there.sum())]
    return out


def usual_band(result):
    """Cut-offs and rate of a fit as they are where it did not go on in the wider band: a quarter of what it says if it did."""
    signal, factor = result["signal"], 4 if any(found["code"] == "wider_band" for found in result["findings"]) else 1
    return {key: value / factor if key in ("cutoff_hz", "rate_hz", "motion_cutoff_hz") else value for key, value in signal.items()}


def measure(data, seed, options, folder):
    """Every method on one problem with one seed. Torque is scored in the usual band, whatever the band of the fit."""
    logs = {}
    for role, log in data.logs.items():
        logs[role] = write(folder / f"{role}.parquet", [log[key] for key in ("q", "qd", "qdd", "tau")], data.rate)

    def ours(config, which=logs):
        return program.fit(options.twincal, data.model, [which["train"]], [which["heldout"]], data.config() + config, folder)

    results = {("twincal", "filtered"): ours(options.settings.replace("\\n", "\n"))}
    if not options.quick:
        results["twincal, ar1", "filtered"] = ours('[noise]\nmodel = "ar1"\n')
        results["the paper's", "filtered"] = ours(program.PAPER)
    said = next(result for result, _ in results.values() if result)  # one of them may refuse
    signal, usual = said["signal"], usual_band(said)
    sampled = {role: data.samples(role, usual["motion_cutoff_hz"]) for role in data.logs}
    if not options.quick:
        whole = logs
        if data.logs["train"]["qd"] is None:
            whole = {role: write(folder / f"{role}_whole.parquet", sampled[role][3], data.rate) for role in sampled}
        results["the paper's", "raw"] = ours(program.OFF + program.PAPER, whole)
        if signal != usual:
            results["the paper's", "wider"] = ours(f"[signal]\ncutoff_hz = {signal['cutoff_hz']}\n" + program.PAPER)

    def through(values, band=usual):
        return rows.filtered(values, data.rate, band["cutoff_hz"], band["rate_hz"])

    def flat(x, *others):
        return (x.reshape(-1, x.shape[2]), *(v.ravel() for v in others))

    x, y, clean, _ = sampled["heldout"]
    heldout = flat(through(x), through(y), through(clean))
    x, y, _, _ = sampled["train"]
    sets = {"filtered": flat(through(x), through(y)), "raw": flat(x, y)}
    if signal != usual:
        sets["wider"] = flat(through(x, signal), through(y, signal))
    scores = {}
    for (method, kind), (result, seconds) in results.items():
        scores[f"{method}|{kind}"] = score(data, program.answer(result, data.columns), heldout, seconds, program.verdicts(result))
        scores[f"{method}|{kind}"]["refused"] = result is None
    if not (options.quick or options.ours):
        import peers

        for kind, (x, y) in sets.items():
            for method, answer, seconds in peers.answers(x, y, seed, lambda chosen: len(wrong(data, inside(data, chosen)))):
                scores[f"{method}|{kind}"] = score(data, answer, heldout, seconds)
    sized = sets["filtered"][0] / np.sqrt(np.mean(sets["filtered"][0] ** 2, axis=0))
    return {
        "problem": data.problem.name,
        "seed": seed,
        "settings": asked(options),
        "cutoff_hz": signal["cutoff_hz"],
        "wider_band": signal != usual,
        "own_rmse": said["validation"]["rmse_calibrated"],
        "rows": {kind: list(x.shape) for kind, (x, _) in sets.items()},
        "condition": float(np.linalg.cond(sized)),
        "scores": scores,
    }


def asked(options):
    """What runs in one folder have in common."""
    return ("quick " if options.quick else "ours " if options.ours else "") + options.settings


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = os.environ.get("TWINCAL", ROOT / "target" / "release" / "twincal")
    parser.add_argument("--twincal", type=Path, default=default, help="program (default: $TWINCAL or target/release/twincal)")
    parser.add_argument("--seeds", type=int, default=30, help="last seed")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--only", nargs="*", default=[], help="names of problems")
    parser.add_argument("--work", type=Path, default=ROOT / "target" / "selection", help="folder of runs and motions")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="folder of selection.svg; what is not the whole comparison is drawn in --work")
    parser.add_argument("--fresh", action="store_true", help="forget earlier runs")
    parser.add_argument("--quick", action="store_true", help="only twincal as it comes, with a --work of its own")
    parser.add_argument("--ours", action="store_true", help="the program with all its settings and no other method, with a --work of its own")
    parser.add_argument("--settings", default="", help="TOML for twincal beside the library, with --quick and a --work of its own")
    parser.add_argument("--table", action="store_true", help="only table and figure, of the runs there are")
    options = parser.parse_args()
    problems = {name: p for name, p in PROBLEMS.items() if not options.only or name in options.only}
    if options.fresh:
        shutil.rmtree(options.work / "runs", ignore_errors=True)
    for folder in ("runs", "motions"):
        (options.work / folder).mkdir(parents=True, exist_ok=True)
    for name in problems:
        path = options.work / "runs" / f"{name}.jsonl"
        runs = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
        if any(run.get("settings", "") != asked(options) for run in runs):
            sys.exit(f"{path} holds runs with other --settings, --quick or --ours: give these a --work of their own")
    for seed in range(options.first, options.first if options.table else options.seeds + 1):
        for name, problem in problems.items():
            path = options.work / "runs" / f"{name}.jsonl"
            runs = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
            if any(run["seed"] == seed for run in runs):
                continue
            print(f"seed {seed}, {name}", file=sys.stderr, flush=True)
            with tempfile.TemporaryDirectory() as folder:
                run = measure(simulated(problem, seed, options.work / "motions"), seed, options, Path(folder))
            with open(path, "a") as file:
                file.write(json.dumps(run) + "\n")
    import table  # matplotlib takes a second

    whole = not (options.only or options.quick or options.ours or options.settings) and (options.first, options.seeds) == (1, 30)
    table.show(problems, options.work / "runs", (options.docs if whole else options.work) / "selection.svg")


if __name__ == "__main__":
    main()

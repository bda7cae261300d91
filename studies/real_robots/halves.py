"""Do two parts of one robot's logs claim the same effects?

    python studies/real_robots/halves.py [--data ../shared/data] [--program target/release/twincal]

Each real robot is fitted twice, to two halves of its log or to two runs. An effect beyond viscous and Coulomb friction is claimed where its PIP is
above 0.95; a claim is contradicted where the other fit has it below 0.5. Prints both counts, robot by robot, and in all; then the same of established
effects alone.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import pyarrow.parquet
from real_robots import PROGRAM, ROOT

# folder, cut-off in Hz, the logs of either fit; a float is the share of the run where it is cut.
PARTS = [
    ("ur10", 10, "run0.parquet", None),
    ("staubli_tx40", 40, "run0.parquet", None),
    ("kuka_kr300", 5, "run0.parquet", None),
    ("kuka_kr300", 5, "run1.parquet", None),
    ("kuka_kr300", 5, ["run0.parquet"], ["run1.parquet"]),
    ("double_pendulum", None, [f"run{k}.csv" for k in range(4)], [f"run{k}.csv" for k in range(4, 8)]),
]
BESIDE = (".viscous", ".coulomb")


def cut(path, folder):
    """Both halves of a log, as files."""
    table = pyarrow.parquet.read_table(path)
    middle = table.num_rows // 2
    halves = [folder / "first.parquet", folder / "second.parquet"]
    pyarrow.parquet.write_table(table.slice(0, middle), halves[0])
    pyarrow.parquet.write_table(table.slice(middle), halves[1])
    return [[half] for half in halves]


def fitted(program, logs, model, cutoff, folder):
    """PIP and status by component; `None` where nothing was concluded."""
    config = folder / "twincal.toml"
    config.write_text(f"[signal]\ncutoff_hz = {cutoff}\n" if cutoff else "")
    command = [program, "fit", *logs, "--model", model, "--config", config, "-o", folder / "out", "--force"]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        return None
    components = json.loads((folder / "out" / "result.json").read_text())["components"]
    own = {c["name"]: (c["pip"], c["status"]) for c in components if c["pip"] is not None}
    return {name: said for name, said in own.items() if not name.endswith(BESIDE)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared/data")
    parser.add_argument("--program", type=Path, default=PROGRAM)
    given = parser.parse_args()
    print("| robot | parts | claims | contradicted | established | contradicted |\n|---|---|---|---|---|---|")
    claims, against = [0, 0], [0, 0]
    for folder, cutoff, first, second in PARTS:
        data = given.data / folder
        model = data / ("model_as_published.urdf" if folder == "double_pendulum" else "model.urdf")
        if not model.exists():
            print(f"{folder}: no data, skipped", file=sys.stderr)
            continue
        with tempfile.TemporaryDirectory() as work:
            work = Path(work)
            parts = cut(data / first, work) if second is None else [[data / name for name in own] for own in (first, second)]
            pips = [fitted(given.program, own, model, cutoff, work) for own in parts]
        if None in pips:
            print(f"| {folder} | {first if second is None else 'runs'} | refused | | | |")
            continue
        counts = []
        for least in ((lambda said: said[0] > 0.95), (lambda said: said[1] == "established")):
            own, other = 0, []
            for a, b in (pips, pips[::-1]):
                claimed = [name for name, said in a.items() if least(said)]
                own += len(claimed)
                other += [name for name in claimed if b.get(name, (0.0,))[0] < 0.5]
            counts.append((own, other))
        for k, (own, other) in enumerate(counts):
            claims[k] += own
            against[k] += len(other)
        (own, other), (sure, wrong) = counts
        parts = f"halves of {first}" if second is None else "runs"
        print(f"| {folder} | {parts} | {own} | {len(other)}: {', '.join(other)} | {sure} | {len(wrong)} |", flush=True)
    for what, own, other in zip(("claims", "established effects"), claims, against):
        print(f"{other} of {own} {what} contradicted: {100 * other / max(own, 1):.0f} %")


if __name__ == "__main__":
    main()

"""What twincal reaches on real robots, with one command and no settings but the cut-off.

    python studies/real_robots/real_robots.py [--data ../shared/data] [--only ur10] [--motor-inertia]

Every row is one `twincal fit`. Held-out torque: RMSE divided by the standard deviation of the measured torque, joint by joint,
low-passed like the training rows. The baseline is the nominal model plus least-squares viscous and Coulomb friction and
offset, by the same program (every candidate in, wide slab, independent rows). With --motor-inertia it has the motors' inertia as well, which no model
file of these robots has; its ratios have no limit.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("TWINCAL", ROOT / "target/release/twincal"))

BASELINE = """
[library]
generic = false
families = ["viscous", "coulomb", "offset"]
nonnegative = false
[prior]
slab = { scaled_variance = 1e6 }
inclusion = { probability = 0.999 }
[noise]
model = "iid"
"""


@dataclass
class Split:
    """One robot, one way to hold data out, and what the held-out RMSE / sd must not exceed."""

    name: str
    folder: str
    model: str
    fit: list
    heldout: list
    cutoff_hz: float
    rows: str  # "all" or "moving"
    limits: list  # RMSE / sd, or RMSE in N m where `absolute`
    absolute: bool = False
    config: str = ""
    found: list = field(default_factory=list)  # components that must be found
    absent: list = field(default_factory=list)  # endings of components that must not be found
    group: list = field(default_factory=list)  # at least one of them, with this probability


SPLITS = [
    Split("ur10", "ur10", "model.urdf", ["run0.parquet"], [], 10, "all", [0.10, 0.09, 0.06, 0.10, 0.18, 0.19]),
    Split("staubli_tx40", "staubli_tx40", "model.urdf", ["run0.parquet"], [], 40, "moving",
          [0.10, 0.10, 0.14, 0.17, 0.66, 0.30], found=["joint_5+joint_6.coupled_friction"],
          absent=[f"{pair}.coupled_{kind}" for pair in ("-joint_6", "-joint_5", "joint_4+joint_5") for kind in ("friction", "inertia")]),
    Split("kuka_kr300 0 to 1", "kuka_kr300", "model.urdf", ["run0.parquet"], ["run1.parquet"], 5, "moving",
          [0.13, 0.30, 0.18, 0.25, 0.23, 0.23]),
    Split("kuka_kr300 1 to 0", "kuka_kr300", "model.urdf", ["run1.parquet"], ["run0.parquet"], 5, "moving", [math.inf] * 6),
    Split("double_pendulum 2-7 to 0-1", "double_pendulum", "model_as_published.urdf",
          [f"run{i}.csv" for i in range(2, 8)], ["run0.csv", "run1.csv"], 5, "all", [0.15, 0.09], absolute=True, absent=[".mass_moments"]),
    Split("double_pendulum 0-5 to 6-7", "double_pendulum", "model_as_published.urdf",
          [f"run{i}.csv" for i in range(6)], ["run6.csv", "run7.csv"], 5, "all", [0.17, 0.11], absolute=True),
]


def fit(split, data, config, folder):
    """result.json of one fit."""
    (folder / "twincal.toml").write_text(f"[signal]\ncutoff_hz = {split.cutoff_hz}\n{config}")
    paths = lambda names: [data / split.folder / name for name in names]
    command = [PROGRAM, "fit", *paths(split.fit), "--model", data / split.folder / split.model,
               "--config", folder / "twincal.toml", "-o", folder / "out", "--force"]
    if split.heldout:
        command += ["--heldout", *paths(split.heldout)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in (0, 3):
        sys.exit(f"{split.name}: exit code {done.returncode}\n{done.stderr}")
    return json.loads((folder / "out" / "result.json").read_text())


def scores(result, rows):
    """Per joint: RMSE of the calibrated and of the nominal torque, sd of the measured torque, coverage."""
    table = result["validation"] if rows == "all" else result["validation"][rows]
    return [(j["rmse_calibrated"], j["rmse_nominal"], j["torque_sd"], j["coverage95"]) for j in table["joints"]]


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--data", type=Path, default=ROOT.parent / "shared/data")
    arguments.add_argument("--only", default="")
    arguments.add_argument("--motor-inertia", action="store_true", help="the baseline has the motors' inertia as well")
    given = arguments.parse_args()
    rotors = given.motor_inertia
    base_config = BASELINE.replace('"offset"', '"offset", "motor_inertia"') if rotors else BASELINE
    limit_of_ratio = math.inf if rotors else 1.25
    ratios, missed, pooled = [], [], {}
    print("| robot, split | joint | RMSE/sd | limit | against friction only | in 95 % interval |\n|---|---|---|---|---|---|")
    for split in SPLITS:
        if given.only not in split.name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            result = fit(split, given.data, split.config, folder)
            friction = fit(split, given.data, base_config, folder)
        baseline = scores(friction, split.rows)
        table = result["validation"] if split.rows == "all" else result["validation"][split.rows]
        inside, rows = pooled.get(split.folder, (0, 0))
        inside += sum(j["coverage95"] * j["rows"] for j in table["joints"])
        pooled[split.folder] = inside, rows + sum(j["rows"] for j in table["joints"])
        for joint, (own, base, limit) in enumerate(zip(scores(result, split.rows), baseline, split.limits), 1):
            rmse, _, sd, coverage = own
            ratio = rmse / base[0]
            ratios.append(ratio)
            value = rmse if split.absolute else rmse / sd
            unit = " N·m" if split.absolute else ""
            asked = f"{limit:.2f}{unit}" if math.isfinite(limit) else "–"
            print(f"| {split.name} | {joint} | {value:.3f}{unit} | {asked} | {ratio:.2f} | {100 * coverage:.0f} % |")
            if value > limit or ratio > limit_of_ratio:
                missed.append(f"{split.name} joint {joint}: {value:.3f} (limit {limit}), ratio {ratio:.2f}")
        found = {c["name"]: c for c in result["components"] if c["status"] == "established"}
        print(f"\n{split.name}, method {result['inference']['method']}: " + "; ".join(c["words"] for c in found.values()))
        for group in result["groups"]:
            print(f"  one of {', '.join(group['members'])}: {group['pip']:.3f}")
        print()
        missed += [f"{split.name}: {name} not found" for name in split.found if found.get(name, {"pip": 0})["pip"] < 0.99]
        missed += [f"{split.name}: {name} found" for name in found if name.endswith(tuple(split.absent) or "\0")]
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
    print(f"geometric mean of RMSE against nominal + least-squares friction{' + motor inertia' if rotors else ''}: {mean:.3f}, worst {max(ratios):.2f}"
          + ("" if rotors else " (limits 0.50 and 1.25)"))
    for name, (inside, rows) in pooled.items():
        print(f"{name}: {100 * inside / rows:.1f} % of {rows} held-out rows in their 95 % intervals")
    for line in missed:
        print("missed:", line)
    return bool(missed)


if __name__ == "__main__":
    sys.exit(main())

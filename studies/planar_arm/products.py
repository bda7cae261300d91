"""Effects that multiply each other: `python products.py [--seeds 100] [--jobs 2] [--program twincal]`.

The base leans, the upper arm is denser than the model, and the second of two logs carries a payload that the model lacks: gravity acts on all of it.
Every seed draws the sizes and its own motion. Counted are 95 % intervals that hold the truth, of effects that were found.
"""

import argparse
import json
import subprocess
import tempfile
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from math import sqrt
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet

from acceptance import FRICTIONLESS, PROGRAM
from arm import ASSETS, NOMINAL, Link, tilted_gravity
from simulate import Settings, simulate

CONFIG = """[library]
generic = false
families = ["payload", "density", "mass_moments", "tensor", "tilt", "viscous", "coulomb", "offset"]
[signal]
cutoff_hz = 0
[[log]]
file = "carries.parquet"
payload = "unknown"
"""


def world(seed):
    """The real arm without and with its payload, and the truth by component and parameter."""
    rng = np.random.default_rng([seed, 7])
    degrees, denser, payload = rng.choice([-1, 1]) * rng.uniform(1, 4), rng.uniform(0.05, 0.3), rng.uniform(0.3, 0.9)
    upper, forearm = NOMINAL.links
    heavier = Link((1 + denser) * upper.mass, upper.com, tuple((1 + denser) * x for x in upper.inertia))
    gravity = tilted_gravity(degrees)
    free = replace(NOMINAL, links=(heavier, forearm), gravity=gravity)
    truth = {
        ("base.tilt", "x"): gravity[0],
        ("base.tilt", "z"): gravity[2] + 9.81,
        ("upper_arm.density", "value"): denser,
        ("payload", "mass"): payload,
        ("payload", "mx"): None,
    }
    return free, replace(free, payload=payload, payload_inertia=3e-4), truth


def measure(program, seed):
    """Of one seed: `{(component, parameter): (found, held, error in sd)}`."""
    free, carries, truth = world(seed)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for number, (name, real) in enumerate((("free", free), ("carries", carries))):
            settings = Settings(train=1, heldout=0, real=real, hidden={}, seed=1000 * number + seed, **FRICTIONLESS)
            log = simulate(settings).logs[0]
            pyarrow.parquet.write_table(pyarrow.table(log.columns()), folder / f"{name}.parquet")
        (folder / "twincal.toml").write_text(CONFIG)
        command = [program, "fit", folder / "free.parquet", folder / "carries.parquet", "--model", ASSETS / "arm.urdf",
                   "--config", folder / "twincal.toml", "-o", folder / "out", "--threads", 1]  # fmt: skip
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if done.returncode not in (0, 3):
            raise SystemExit(f"seed {seed}: exit {done.returncode}: {done.stderr[-600:]}")
        result = json.loads((folder / "out" / "result.json").read_text())
    components = {component["name"]: component for component in result["components"]}
    out = {}
    for (name, parameter), value in truth.items():
        component = components[name]
        own = next((p for p in component["parameters"] if p["name"] == parameter), None)
        if value is None or own is None:
            continue
        low, high = own["interval95"]
        out[f"{name} {parameter}"] = (component["pip"] >= 0.5, low <= value <= high, (own["mean"] - value) / own["sd"])
    false = [name for name, own in components.items() if own["status"] == "established" and name not in
             {component for component, _ in truth}]  # fmt: skip
    return out, false


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--program", default=str(PROGRAM))
    arguments = parser.parse_args()
    counts, errors, false = defaultdict(lambda: [0, 0]), defaultdict(list), defaultdict(int)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for out, others in pool.map(partial(measure, arguments.program), range(1, arguments.seeds + 1)):
            for name, (found, held, error) in out.items():
                if found:
                    counts[name][0] += 1
                    counts[name][1] += held
                    errors[name].append(error)
            for name in others:
                false[name] += 1
    print("| parameter | found | 95 % interval holds | rms error / sd |\n|---|---|---|---|")
    for name, (found, held) in counts.items():
        share, rms = held / found, sqrt(np.mean(np.square(errors[name])))
        print(f"| `{name}` | {found} of {arguments.seeds} | {share:.2f} | {rms:.2f} |")
    print(f"\nestablished and false: {dict(false) or 'none'}")


if __name__ == "__main__":
    main()

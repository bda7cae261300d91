"""Does the simulator follow the robot? Position error after 1 s under recorded torque: nominal, exported, with the residual.

    python studies/real_robots/roll_out.py [--data ../shared/data]

The planar arm of the study (held-out log) and a UR10 (its first 70 % fitted, the rest rolled out) in MuJoCo, from the recorded
state, without feedback. The residual is what `twincal export --to python --beyond mjcf` writes.
"""

import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pyarrow.parquet as parquet

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("TWINCAL", ROOT / "target/release/twincal"))


def twincal(*arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        sys.exit(f"{' '.join(map(str, arguments))}\n{done.stderr}")


def roll_out(model, log, first, seconds, every, residual=None):
    """Position errors at the end, starts x joints; `residual(q, qd, qdd)` is torque that the model lacks."""
    data = mujoco.MjData(model)
    joints = model.nv
    q, qd, tau = (np.column_stack([log[f"{kind}{j + 1}"] for j in range(joints)]) for kind in ("q", "qd", "tau"))
    interval = float(np.median(np.diff(log["t"])))
    rows, steps = round(seconds / interval), round(interval / model.opt.timestep)
    errors = []
    for start in range(first, len(q) - rows - 1, every):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q[start], qd[start]
        for row in range(start, start + rows):
            for k in range(steps):
                share = (k + 0.5) / steps
                data.qfrc_applied[:] = (1 - share) * tau[row] + share * tau[row + 1]
                if residual is not None:
                    data.qfrc_applied[:] -= residual(data.qpos, data.qvel, data.qacc)[0]
                mujoco.mj_step(model, data)
        errors.append(data.qpos - q[start + rows])
    return np.array(errors)


def load(path):
    table = parquet.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def study(name, model, train, log, first, config, every, with_residual):
    """Prints one row per model; a residual that is steep in velocity or acceleration is unstable when it is fed step by step."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        (folder / "twincal.toml").write_text(config)
        twincal("fit", *train(folder), "--model", model, "--config", folder / "twincal.toml", "-o", folder / "out")
        twincal("export", "--twin", folder / "out", "--to", "mjcf", "-o", folder / "exported.xml", "--allow", "worse-than-model")
        twincal("export", "--twin", folder / "out", "--to", "python", "--beyond", "mjcf", "-o", folder / "rest.py")
        spec = importlib.util.spec_from_file_location("rest", folder / "rest.py")
        rest = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(rest)
        load_model = lambda file: mujoco.MjModel.from_xml_path(str(file))
        rows = [("nominal", load_model(model), None), ("exported", load_model(folder / "exported.xml"), None),
                ("exported + residual", load_model(folder / "exported.xml"), rest.evaluate)]  # fmt: skip
        for label, loaded, residual in rows[: 3 if with_residual else 2]:
            errors = roll_out(loaded, log, first, 1.0, every, residual)
            middle = np.median(np.abs(errors), axis=0)
            print(f"| {name} | {label} | {len(errors)} | {' '.join(f'{x:.3f}' for x in middle)} |", flush=True)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--data", type=Path, default=ROOT.parent / "shared/data")
    given = arguments.parse_args()
    print("| robot | model | starts | median position error after 1 s per joint, rad |\n|---|---|---|---|")
    assets = ROOT / "crates/twincal-cli/assets"
    study("planar arm", assets / "arm.xml", lambda _: [assets / f"train{k}.parquet" for k in (1, 2, 3)],
          load(assets / "heldout1.parquet"), 0, "[library]\ngeneric = false\n", 50, True)  # fmt: skip
    ur10 = given.data / "ur10"
    if ur10.is_dir():
        table = parquet.read_table(ur10 / "run0.parquet")
        cut = int(0.7 * table.num_rows)

        def train(folder):
            parquet.write_table(table.slice(0, cut), folder / "train.parquet")
            return [folder / "train.parquet"]

        study("UR10", ur10 / "model.xml", train, load(ur10 / "run0.parquet"), cut, "[signal]\ncutoff_hz = 10\n", 25, False)


if __name__ == "__main__":
    main()

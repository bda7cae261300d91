"""Does the simulator follow the robot? MuJoCo from recorded states, 1 s under the recorded torque, no feedback.

    pip install mujoco numpy pyarrow
    python simulate.py calibrated.urdf run0.csv          # MODEL (URDF or MJCF), LOG (CSV or Parquet: t, q1 ..., qd1 ..., tau1 ...)

Prints the median absolute position error of each joint after 1 s, over starts 0.2 s apart. A URDF that uses a link `world` without
defining it gets one: MuJoCo wants it. Meshes are not loaded.
"""

import csv
import re
import sys

import mujoco
import numpy as np

SECONDS, APART = 1.0, 0.2


def load(path):
    """The model without meshes, and with the link `world` where it is used."""
    text = open(path, encoding="utf-8").read()
    if "<robot" in text:
        text = re.sub(r"<(visual|collision)\b.*?</\1>", "", text, flags=re.S)
        if 'link="world"' in text and '<link name="world"' not in text:
            text = re.sub(r"(<robot\b[^>]*>)", r'\1<link name="world"/>', text, count=1)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep = 1e-3
    return model


def read(path):
    """Columns by name."""
    if path.endswith(".parquet"):
        import pyarrow.parquet

        table = pyarrow.parquet.read_table(path)
        return {name: table[name].to_numpy() for name in table.column_names}
    with open(path, newline="") as rows:
        table = list(csv.DictReader(rows))
    return {name: np.array([float(row[name]) for row in table]) for name in table[0]}


def main(model_path, log_path):
    model, log = load(model_path), read(log_path)
    t = log["t"]
    q, qd, tau = (np.column_stack([log[f"{kind}{j + 1}"] for j in range(model.nv)]) for kind in ("q", "qd", "tau"))
    errors = []
    for begin in np.arange(t[0], t[-1] - SECONDS, APART):
        start = np.searchsorted(t, begin)
        data = mujoco.MjData(model)
        data.qpos, data.qvel = q[start], qd[start]
        while data.time < SECONDS:
            data.qfrc_applied = tau[min(np.searchsorted(t, t[start] + data.time), len(t) - 1)]
            mujoco.mj_step(model, data)
        errors.append(np.abs(data.qpos - q[min(np.searchsorted(t, t[start] + SECONDS), len(t) - 1)]))
    print(f"{model_path}: rad after {SECONDS:g} s:", *np.median(errors, axis=0).round(3))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])

"""How long a fit of a long log takes, and how much memory: from Parquet or MCAP to result.json and report.

    python studies/speed/long_log.py [--robot panda] [--minutes 10] [--threads 2] [--repeat 3] [--families payload,tensor,…] [--mcap [--apart]]

The arm is that of studies/industrial_arms with its defects, logged at 1 kHz as joint positions, velocities and torques. Every repeat
is one run of `twincal fit` in a new process, with default settings or with the candidate families named; printed are the median wall time and the largest memory.
`--apart`: motion and torque on
topics of their own, torque 0.3 ms later. The time of `simulate` is not counted.
"""

import argparse
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import pyarrow as pa
import pyarrow.parquet as pq

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "studies/industrial_arms"))
sys.path.insert(0, str(ROOT / "examples/bags"))
import simulate_arms as arms  # noqa: E402

PROGRAM = Path(os.environ.get("TWINCAL", ROOT / "target/release/twincal"))


def log(name, minutes, seed=1):
    """Columns of one long log: sums of 12 sines per joint up to 0.6 Hz, torque of the real arm, white noise of 0.1 N m."""
    rng = np.random.default_rng(seed)
    model = arms.load(name)
    real = arms.real_arm(model)
    data = real.createData()
    samples, n = int(minutes * 60 * arms.RATE), model.nv
    t = np.arange(samples) / arms.RATE
    w = 2 * np.pi * rng.uniform(0.03, 0.6, (n, 12))
    phase = rng.uniform(0, 2 * np.pi, (n, 12))
    size = rng.uniform(0.5, 1.0, (n, 12))
    q, qd, qdd = (np.empty((samples, n)) for _ in range(3))
    for j in range(n):
        scale = min(1.2 / size[j].sum(), 1.5 / (size[j] * w[j]).sum()) * 2
        q[:, j], qd[:, j], qdd[:, j] = rng.uniform(-0.8, 0.8), 0.0, 0.0
        for a, b, p in zip(size[j] * scale, w[j], phase[j]):
            angle = b * t + p
            q[:, j] += a * np.sin(angle)
            qd[:, j] += a * b * np.cos(angle)
            qdd[:, j] -= a * b * b * np.sin(angle)
    circles = model.nq != model.nv  # joints without limits are circles to Pinocchio
    neutral = pin.neutral(model)
    tau = np.empty((samples, n))
    for k in range(samples):
        point = pin.integrate(model, neutral, q[k]) if circles else q[k]
        tau[k] = pin.rnea(real, data, point, qd[k], qdd[k])
    viscous, coulomb = arms.effects(n, seed)
    tau += viscous * qd + coulomb * np.tanh(qd / arms.COULOMB_VELOCITY)
    tau[:, 1] += arms.SPRING[0] * (q[:, 1] - arms.SPRING[1])
    tau += 0.1 * rng.normal(size=tau.shape)
    columns = {"t": t}
    for j in range(n):
        columns |= {f"q{j + 1}": q[:, j], f"qd{j + 1}": qd[:, j], f"tau{j + 1}": tau[:, j]}
    return columns


def write(name, minutes, file, apart, seed=1):
    """The log as a file: columns, or one JointState message per row in chunks packed by zstd; two on topics of their own if `apart`."""
    columns = log(name, minutes, seed)
    if file.suffix == ".parquet":
        pq.write_table(pa.table(columns), file)
        return
    from csv_to_mcap import record

    joints = list(arms.load(name).names)[1:]
    channels = [np.stack([columns[f"{short}{j + 1}"] for j in range(len(joints))], axis=1).tolist() for short in ("q", "qd", "tau")]
    rows = zip(columns["t"].tolist(), *channels)
    if apart:
        parts = lambda t, q, qd, tau: ((t, q, qd, [], "/motion"), (t + 3e-4, [], [], tau, "/torque"))  # noqa: E731
        rows = (part for row in rows for part in parts(*row))
    record(file, joints, rows)


def measured(command):
    """Wall time in s, largest resident memory in MB, and the standard error of one run."""
    began = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    text = child.stderr.read().decode()
    _, status, usage = os.wait4(child.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 3):
        sys.exit(text)
    return time.perf_counter() - began, usage.ru_maxrss / 1024, text


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--robot", choices=arms.ROBOTS, default="panda")
    arguments.add_argument("--minutes", type=float, default=10)
    arguments.add_argument("--threads", type=int, default=2)
    arguments.add_argument("--repeat", type=int, default=3)
    arguments.add_argument("--folder", type=Path, help="keep the log here and use it again")
    arguments.add_argument("--families", help="[library] families, with commas between [default: all that are on by default]")
    arguments.add_argument("--mcap", action="store_true", help="as MCAP instead of Parquet")
    arguments.add_argument("--apart", action="store_true", help="with --mcap: motion and torque on topics of their own")
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        ending = ("apart.mcap" if given.apart else "mcap") if given.mcap else "parquet"
        file = folder / f"{given.robot}-{given.minutes:g}.{ending}"
        if not file.exists():
            # In a process of its own: a child's largest memory counts what its parent had when it was started.
            maker = multiprocessing.get_context("spawn").Process(target=write, args=(given.robot, given.minutes, file, given.apart))
            maker.start()
            maker.join()
        locked = ", ".join(f'"{joint}" = 0.0' for joint in arms.ROBOTS[given.robot].locked)
        config = f"[model]\nlocked = {{ {locked} }}\n"
        if given.apart:
            config += '[[log]]\ntopic = ["/motion", "/torque"]\n'
        if given.families:
            config += f"[library]\nfamilies = {json.dumps(given.families.split(','))}\n"
        (folder / "twincal.toml").write_text(config)
        command = [PROGRAM, "fit", file, "--model", arms.model_file(given.robot), "--config", folder / "twincal.toml",
                   "-o", folder / "out", "--force", "--threads", str(given.threads)]
        runs = [measured([str(part) for part in command]) for _ in range(given.repeat)]
        result = json.loads((folder / "out/result.json").read_text())
        live = [term for term in result["terms"] if term["pip"] is not None]
        components = [c for c in result["components"] if c["pip"] is not None]
        print(f"{given.robot}, {given.minutes:g} min at 1 kHz, {len(live)} columns in {len(components)} components, {given.threads} threads: "
              f"{statistics.median(r[0] for r in runs):.2f} s (of {len(runs)}), {max(r[1] for r in runs):.0f} MB")


if __name__ == "__main__":
    main()

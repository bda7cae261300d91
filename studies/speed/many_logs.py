"""How fast logs become statistics, per core, and what adding many files of statistics costs.

    python studies/speed/many_logs.py [--robot panda] [--minutes 2] [--logs 4] [--folder DIR]
    python studies/speed/many_logs.py --merge 250 500 1000 [--folder DIR]

Needs the Python package and what studies/speed/long_log.py needs. First: logs of that arm at 1 kHz as MCAP (zstd) and as Parquet by
`twincal.fleet.statistics`, one and two processes. MB are 10^6 bytes of the files; "per core" divides by CPU seconds of the workers, start
included, so that other load on the machine matters less. Second: files of statistics of a two-joint arm with friction and payload as
the only candidates, merged by `twincal merge` 32 at a time, as a tree.
"""

import argparse
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from twincal import Robot, fleet

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "studies/speed"))
PROGRAM = str(os.environ.get("TWINCAL", ROOT / "target/release/twincal"))
FAN = 32
# A child's largest memory counts what its parent had when it was started: this parent is small.
LAUNCHER = """import os, sys
_, status, usage = os.wait4(os.spawnv(os.P_NOWAIT, sys.argv[1], sys.argv[1:]), 0)
print(usage.ru_maxrss)
sys.exit(status != 0)"""
TWO_JOINTS = """<robot name="two"><link name="base"/>{links}
  <joint name="one" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit effort="99" velocity="9" lower="-3" upper="3"/></joint>
  <joint name="two" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit effort="99" velocity="9" lower="-3" upper="3"/></joint></robot>"""
LINK = """<link name="{}"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
  <inertia ixx="0.002" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


def cpu():
    """CPU seconds of processes that ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def large(robot, minutes, number, folder):
    """One log as both formats."""
    import long_log

    for ending in ("parquet", "mcap"):
        file = folder / ending / f"log{number}.{ending}"
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            long_log.write(robot, minutes, file, apart=False, seed=number + 1)


def plan(logs, model, config, folder):
    """Writes the plan of these logs."""
    command = [PROGRAM, "statistics", *logs, "--model", model, "--config", config, "-o", folder]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert done.returncode in (0, 3), done.stderr


def scaling(given, folder):
    """Table of formats and processes."""
    import long_log

    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.starmap(large, [(given.robot, given.minutes, number, folder) for number in range(given.logs)])
    locked = ", ".join(f'"{joint}" = 0.0' for joint in long_log.arms.ROBOTS[given.robot].locked)
    config = folder / "twincal.toml"
    config.write_text(f"[model]\nlocked = {{ {locked} }}\n")
    model = long_log.arms.model_file(given.robot)
    if not (folder / "planned/plan.json").exists():
        plan([folder / "parquet/log0.parquet"], model, config, folder / "planned")
    rows = given.logs * given.minutes * 60 * 1000
    print(f"{given.robot}, {given.logs} logs of {given.minutes:g} min at 1 kHz")
    print("format   workers  MB      s      MB/s   MB/s per core  rows/s per core")
    for ending in ("mcap", "parquet"):
        size = sum(file.stat().st_size for file in (folder / ending).iterdir()) / 1e6
        for workers in (1, 2):
            with tempfile.TemporaryDirectory() as out:
                before, began = cpu(), time.perf_counter()
                made = fleet.statistics(folder / ending, model, folder / "planned/plan.json", output=out, config=config,
                                        workers=workers)  # fmt: skip
                seconds, used = time.perf_counter() - began, cpu() - before
                assert len(made.files) == given.logs, made.faults
                print(f"{ending:8} {workers:<8} {size:<7.0f} {seconds:<6.1f} {size / seconds:<6.1f} {size / used:<14.1f} {rows / used:.0f}")


def small(number, robot, folder):
    """A log of 20 s of the two joints."""
    file = folder / "small" / f"log{number:05}.parquet"
    if file.exists():
        return
    rng = np.random.default_rng(number)
    t = np.arange(2000) / 100
    w, phase = 2 * np.pi * rng.uniform(0.05, 0.5, (2, 5)), rng.uniform(0, 2 * np.pi, (2, 5))
    angle = t[:, None, None] * w + phase
    q, qd, qdd = 0.2 * np.sin(angle).sum(-1), 0.2 * (w * np.cos(angle)).sum(-1), -0.2 * (w**2 * np.sin(angle)).sum(-1)
    tau = robot.inverse_dynamics(q, qd, qdd) + 0.3 * qd + 0.2 * np.sign(qd) + 0.02 * rng.standard_normal(q.shape)
    named = {f"{short}{j + 1}": own[:, j] for short, own in zip(("q", "qd", "tau"), (q, qd, tau)) for j in range(2)}
    pq.write_table(pa.table({"t": t + 60 * number, **named}), file)


def merged(files, folder, fan):
    """The tree: wall time in s and the largest memory of one `twincal merge` in MB."""
    began, peak, level = time.perf_counter(), 0.0, 0
    while len(files) > 1:
        groups = [files[start : start + fan] for start in range(0, len(files), fan)]
        files = []
        for number, group in enumerate(groups):
            files.append(folder / f"{level}-{number}.arrow")
            command = [sys.executable, "-S", "-c", LAUNCHER, PROGRAM, "merge", *group, "-o", files[-1]]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
            peak = max(peak, int(done.stdout.splitlines()[-1]) / 1024)
        level += 1
    return time.perf_counter() - began, peak, files[0].stat().st_size / 1e6


def merging(counts, fan, folder):
    """Table of numbers of files."""
    model = folder / "two.urdf"
    (folder / "small").mkdir(parents=True, exist_ok=True)
    model.write_text(TWO_JOINTS.format(links=LINK.format("upper") + LINK.format("fore")))
    robot = Robot.from_urdf(model)
    for number in range(max(counts)):
        small(number, robot, folder)
    config = folder / "small.toml"
    config.write_text('[library]\ngeneric = false\nfamilies = ["payload", "viscous", "coulomb"]\n')
    if not (folder / "small-plan/plan.json").exists():
        plan(sorted((folder / "small").iterdir())[:3], model, config, folder / "small-plan")
    before, began = cpu(), time.perf_counter()
    made = fleet.statistics(folder / "small", model, folder / "small-plan/plan.json", output=folder / "small-statistics", config=config)
    seconds, used, new = time.perf_counter() - began, cpu() - before, sum(file.made for file in made.files)
    files = [Path(own.file) for own in made.files]
    print(f"{new} files of statistics made in {seconds:.1f} s with {1e3 * used / max(new, 1):.0f} ms of CPU each; the largest has {max(file.stat().st_size for file in files) / 1e3:.0f} kB")
    print("files    s      largest process, MB   merged file, MB")
    for count in counts:
        with tempfile.TemporaryDirectory(dir=folder) as tree:
            seconds, peak, size = merged(files[:count], Path(tree), fan)
        print(f"{count:<8} {seconds:<6.1f} {peak:<21.0f} {size:.0f}")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--robot", default="panda")
    arguments.add_argument("--minutes", type=float, default=2)
    arguments.add_argument("--logs", type=int, default=4)
    arguments.add_argument("--merge", type=int, nargs="+", metavar="N", help="merge so many files of statistics instead")
    arguments.add_argument("--fan", type=int, default=FAN, metavar="N", help="so many at a time, as a tree")
    arguments.add_argument("--folder", type=Path, help="keep the logs here and use them again")
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if given.merge:
            merging(given.merge, given.fan, folder)
        else:
            scaling(given, folder)


if __name__ == "__main__":
    main()

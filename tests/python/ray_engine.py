"""Statistics of 60 logs of 20 s in an S3-compatible store by Ray equal those of local processes, byte for byte.

A cluster of two cores with an object store of 500 MB. While the first driver runs, a worker is killed in the middle of a log;
then the driver kills itself, and a second one finishes. One log is corrupt, one is missing. Truth: the local engine.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import twincal
from pyarrow.fs import FileSystem, FileType
from twincal import fleet

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples/bags"))
from csv_to_mcap import record  # noqa: E402

MODEL = ROOT / "examples/arm/arm.urdf"
LOGS, ROBOTS, SECONDS, RATE = 60, 3, 20, 100
CORRUPT, MISSING = 17, 33
KEYS = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}
DRIVER_DIES_AFTER, WORKER_DIES_AFTER = 30, 10


def name_of(number):
    """Path of a log: MCAP and Parquet in turn, a folder per robot."""
    return f"robot{number % ROBOTS}/log{number:02}.{'mcap' if number % 2 else 'parquet'}"


def columns(robot, number):
    """A motion of sines under the model's torque, with friction and noise; stamps of two logs do not overlap."""
    rng = np.random.default_rng(number)
    n = len(robot.joint_names)
    t = np.arange(SECONDS * RATE) / RATE
    w, phase = 2 * np.pi * rng.uniform(0.05, 0.5, (n, 5)), rng.uniform(0, 2 * np.pi, (n, 5))
    angle = t[:, None, None] * w + phase
    q, qd = 0.2 * np.sin(angle).sum(-1), 0.2 * (w * np.cos(angle)).sum(-1)
    qdd = -0.2 * (w**2 * np.sin(angle)).sum(-1)
    tau = robot.inverse_dynamics(q, qd, qdd) + 0.3 * qd + 0.2 * np.sign(qd) + 0.02 * rng.standard_normal(q.shape)
    return t + 60.0 * number, q, qd, tau


def write(robot, number, file):
    """A log as a file."""
    t, *channels = columns(robot, number)
    if file.suffix == ".mcap":
        record(file, robot.joint_names, zip(t.tolist(), *(own.tolist() for own in channels)))
        return
    named = {f"{short}{j + 1}": own[:, j] for short, own in zip(("q", "qd", "tau"), channels) for j in range(own.shape[1])}
    pq.write_table(pa.table({"t": t, **named}), file)


def free_port():
    with socket.socket() as own:
        own.bind(("127.0.0.1", 0))
        return own.getsockname()[1]


def served(port):
    """The store, when it answers."""
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for _ in range(200):
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{port}/moto-api/", timeout=1).close()
            return server
        except OSError:
            time.sleep(0.1)
    server.terminate()
    sys.exit("the S3 server does not answer")


def clustered(port):
    """A cluster of two cores and its address."""
    command = ["ray", "start", "--head", "--block", "--num-cpus=2", "--object-store-memory=500000000", f"--port={port}",
               "--node-ip-address=127.0.0.1", "--include-dashboard=false", "--disable-usage-stats"]  # fmt: skip
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def working():
    """Processes of Ray that have a log in work: their title is the task's."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if (place / "cmdline").read_bytes().startswith(b"ray::twincal"):
                found.append(int(place.name))
        except OSError:
            continue
    return found


def drive(arguments):
    """The driver: a separate process, which may kill a worker and itself."""
    dataset, plan, output, worker_dies, driver_dies = json.loads(arguments)
    began, done_last = time.monotonic(), None

    def watch(_, done, parts):
        nonlocal worker_dies, done_last
        done_last = done
        if worker_dies and done >= WORKER_DIES_AFTER and (pids := working()):
            os.kill(pids[0], signal.SIGKILL)
            print("a worker was killed", flush=True)
            worker_dies = False
        if driver_dies and done >= DRIVER_DIES_AFTER:
            os.kill(os.getpid(), signal.SIGKILL)

    made = fleet.statistics(dataset, MODEL, plan, "ray", output=output, robot=robot_of, progress=watch)
    with open("/proc/self/status") as status:
        [peak] = [line.split()[1] for line in status if line.startswith("VmHWM")]
    print(json.dumps({"files": made.files, "faults": made.faults, "stale": made.stale, "done": done_last,
                      "MB": int(peak) // 1024, "s": time.monotonic() - began}))  # fmt: skip


def robot_of(log):
    return log.split("/")[0]


def driver(*arguments, expect):
    command = [sys.executable, __file__, "--drive", json.dumps(arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=280)
    assert done.returncode == expect, done
    return done.stdout.splitlines()


def main():
    os.environ |= KEYS
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        robot = twincal.Robot.from_urdf(MODEL)
        for number in range(LOGS):
            file = folder / "logs" / name_of(number)
            file.parent.mkdir(parents=True, exist_ok=True)
            write(robot, number, file)
        size = sum(file.stat().st_size for file in (folder / "logs").rglob("*.*"))
        print(f"{LOGS} logs of {SECONDS} s, {size / 1e6:.0f} MB")
        first = [str(folder / "logs" / name_of(number)) for number in (0, 3)]
        subprocess.run(["twincal", "statistics", *first, "--model", MODEL, "--no-config", "-o", folder / "planned"],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        port = free_port()
        server = served(port)
        cluster = clustered(cluster_port := free_port())
        os.environ["RAY_ADDRESS"] = f"127.0.0.1:{cluster_port}"
        try:
            compare(folder, port)
        finally:
            for own in (cluster, server):
                own.terminate()
                own.wait(timeout=60)


def compare(folder, port):
    """Both engines over the same objects."""
    store = f"?endpoint_override=127.0.0.1:{port}&scheme=http&allow_bucket_creation=true"
    files, bucket = FileSystem.from_uri(f"s3://fleet{store}")
    files.create_dir(bucket)
    for number in range(LOGS):
        data = (folder / "logs" / name_of(number)).read_bytes()
        data = data[: len(data) // 2] if number == CORRUPT else data
        if number != MISSING:
            with files.open_output_stream(f"fleet/logs/{name_of(number)}") as to:
                to.write(data)
    dataset = [f"s3://fleet/logs/{name_of(number)}{store}" for number in range(LOGS)]
    plan = folder / "planned/plan.json"
    began = time.monotonic()
    local = fleet.statistics(dataset, MODEL, plan, output=folder / "local", robot=robot_of, workers=2)
    print(f"local: {len(local.files)} files, {len(local.faults)} faults in {time.monotonic() - began:.1f} s")
    assert [own.log for own in local.faults] == sorted([name_of(CORRUPT), name_of(MISSING)]), local.faults
    codes = {own.log: own.code for own in local.faults}
    assert codes == {name_of(CORRUPT): "content", name_of(MISSING): "missing"}, codes
    assert len(local.files) == LOGS - 2

    output = f"s3://fleet/statistics{store}"
    said = driver(dataset, str(plan), output, True, True, expect=-signal.SIGKILL)
    assert "a worker was killed" in said, said
    made = json.loads(driver(dataset, str(plan), output, False, False, expect=0)[-1])
    kept = sum(not own[3] for own in made["files"])
    print(f"Ray: driver killed after {DRIVER_DIES_AFTER} logs; the second one kept {kept} files and made {len(made['files']) - kept} "
          f"in {made['s']:.1f} s with {made['MB']} MB")  # fmt: skip
    assert kept >= DRIVER_DIES_AFTER - 2 and made["done"] == LOGS
    assert made["faults"] == [list(own) for own in local.faults] and made["stale"] == []
    ours = {path.relative_to(folder / "local").as_posix(): path.read_bytes() for path in (folder / "local").rglob("*.*")}
    theirs = {}
    for info in files.get_file_info(_all("fleet/statistics")):
        if info.type == FileType.File:
            theirs[info.path.removeprefix("fleet/statistics/")] = files.open_input_stream(info.path).read()
    assert ours.keys() == theirs.keys() and len(ours) == LOGS - 2 + 1
    assert all(ours[name] == theirs[name] for name in ours)
    other_library(folder, port, local)


def other_library(folder, port, local):
    """The folder of one robot by fsspec: every good log is made; its path below that folder is its name."""
    import s3fs

    store = s3fs.S3FileSystem(endpoint_url=f"http://127.0.0.1:{port}")
    made = fleet.statistics((store, "fleet/logs/robot1"), MODEL, folder / "planned/plan.json", output=folder / "fsspec",
                            robot="robot1", workers=2)  # fmt: skip
    listed = [number for number in range(LOGS) if number % ROBOTS == 1 and number != MISSING and number != CORRUPT]
    assert len(made.files) == len(listed) and not made.faults, made.faults
    sums = {own.log: own.file for own in local.files}
    for own in made.files:
        one, other = (twincal.Statistics.read(file) for file in (own.file, sums[f"robot1/{own.log}"]))
        assert one.log_names == [own.log] and other.log_names == [f"robot1/{own.log}"]


def _all(folder):
    from pyarrow.fs import FileSelector

    return FileSelector(folder, recursive=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--drive"]:
        drive(sys.argv[2])
    else:
        main()

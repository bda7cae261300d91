"""Logs that are longer than memory should hold: the truth comes out, and memory does not grow with the file."""

import json
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.feather
import pyarrow.parquet
import pytest
from conftest import ASSETS, program

RATE = 1000.0
VISCOUS, COULOMB, PAYLOAD = 0.6, 0.4, (0.5, 0.25)  # shoulder, elbow; kg and m along the forearm
CONFIG = """[library]
families = ["payload", "viscous", "coulomb", "offset"]
"""


MEASURED = """
import os, subprocess, sys, tempfile
with tempfile.TemporaryFile() as words:
    child = subprocess.Popen(sys.argv[1:], stdout=words)
    _, status, usage = os.wait4(child.pid, 0)
    words.seek(0)
    print(usage.ru_maxrss / 1024)
    print(words.read().decode(), end="")
sys.exit(os.waitstatus_to_exitcode(status))
"""


def log(minutes, seed=1):
    """The arm of the study with something in its hand: closed form of two links about parallel axes, white noise of 0.2 N m."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(60 * minutes * RATE)) / RATE
    q, qd, qdd = np.zeros((3, 2, t.size))
    for j in range(2):
        for a, f in zip(rng.uniform(0.2, 0.4, 4), rng.uniform(0.05, 0.7, 4)):
            w, phase = 2 * np.pi * f, rng.uniform(0, 2 * np.pi)
            q[j] += a * np.sin(w * t + phase)
            qd[j] += a * w * np.cos(w * t + phase)
            qdd[j] -= a * w * w * np.sin(w * t + phase)
    # arm.urdf: mass, centre and tensor of both links; the load is a point.
    first, length, (load, at) = 3 * 0.2**2 + 0.042, 0.4, PAYLOAD
    mass, moment, second = 2 + load, 2 * 0.15 + load * at, 2 * 0.15**2 + 0.021 + load * at**2
    c, s = np.cos(q[1]), np.sin(q[1])
    coupled = second + length * moment * c
    gravity = 9.81 * moment * np.cos(q[0] + q[1])
    shoulder = (
        (first + mass * length**2 + second + 2 * length * moment * c) * qdd[0]
        + coupled * qdd[1]
        - length * moment * s * (2 * qd[0] + qd[1]) * qd[1]
        + 9.81 * (3 * 0.2 + mass * length) * np.cos(q[0])
        + gravity
    )
    elbow = coupled * qdd[0] + second * qdd[1] + length * moment * s * qd[0] ** 2 + gravity
    shoulder += VISCOUS * qd[0]
    elbow += COULOMB * np.tanh(qd[1] / 0.02)
    columns = {"t": t}
    for j, tau in enumerate([shoulder, elbow]):
        columns |= {f"q{j + 1}": q[j], f"qd{j + 1}": qd[j], f"tau{j + 1}": tau + 0.2 * rng.normal(size=t.size)}
    return pa.table(columns)


def run(*command, threads=2, code=0):
    """What a command prints, and the largest memory that it took, MB."""
    command = [program("twincal"), *map(str, command), "--threads", str(threads)]
    # Through a small process: the largest memory of a child counts what its parent had when it was started.
    done = subprocess.run([sys.executable, "-c", MEASURED, *command], capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    memory, _, words = done.stdout.partition("\n")
    return words, float(memory)


def fitted(folder, file, threads=2):
    """result.json of a fit, and the largest memory that it took, MB."""
    (folder / "twincal.toml").write_text(CONFIG)
    config = folder / "twincal.toml"
    _, memory = run("fit", file, "--model", ASSETS / "arm.urdf", "--config", config, "-o", folder / "out", "--force", threads=threads)
    return json.loads((folder / "out/result.json").read_text()), memory


def agrees(result):
    """Three effects and no other, each within 4.5 sd (false alarm 3e-5 in all, the seed is fixed)."""
    found = {c["name"]: c["parameters"][0] for c in result["components"] if c["status"] == "established"}
    truth = {"payload": PAYLOAD[0], "shoulder.viscous": VISCOUS, "elbow.coulomb": COULOMB}
    assert found.keys() == truth.keys()
    for name, value in truth.items():
        assert abs(found[name]["mean"] - value) < 4.5 * found[name]["sd"], (name, found[name], value)


@pytest.fixture(scope="module")
def long_log():
    """51 minutes, 172 MB of numbers: a long log."""
    return log(51)


@pytest.mark.long
def test_memory_does_not_grow_with_the_log(tmp_path, long_log):
    memory = {}
    for minutes, table in [(51, long_log), (204, log(204))]:
        pa.parquet.write_table(table, tmp_path / "run.parquet")
        # With two threads what both hold at a time differs by some 12 MB from run to run, with one by 2 MB.
        result, memory[minutes] = fitted(tmp_path, tmp_path / "run.parquet", threads=1)
        agrees(result)
        assert result["logs"][0]["samples"] == table.num_rows
        assert any(finding["code"] == "chapters" for finding in result["findings"])
    assert memory[204] - memory[51] < 20, memory
    # In memory the numbers alone would be 685 MB.
    assert memory[204] < 250, memory


@pytest.mark.parametrize("form", ["csv", "arrow"])
def test_other_forms_come_in_chapters_too(tmp_path, long_log, form):
    file = tmp_path / f"run.{form}"
    if form == "csv":
        pa.csv.write_csv(long_log, file)
    else:
        pa.feather.write_feather(long_log, file, compression="lz4")
    result, memory = fitted(tmp_path, file)
    agrees(result)
    assert result["logs"][0]["samples"] == long_log.num_rows
    assert any(finding["code"] == "chapters" for finding in result["findings"])
    assert memory < 270, memory


@pytest.mark.long
def test_all_commands_take_long_logs_in_chapters(tmp_path, long_log):
    """Twice the log, the same memory; every row predicted, as by a twin that reads the same rows as a short log."""
    table, model, config = long_log, ASSETS / "arm.urdf", tmp_path / "twincal.toml"
    short, long, longer = (tmp_path / f"{name}.parquet" for name in ("short", "long", "longer"))
    pa.parquet.write_table(table, long)
    end = table["t"][-1].as_py() + 1 / RATE
    again = table.set_column(0, "t", pc.add(table["t"], end))
    pa.parquet.write_table(pa.concat_tables([table, again]), longer)
    fitted(tmp_path, long)
    memory = {}  # on one thread: what two hold at a time differs by 20 MB from run to run
    for file in (long, longer):
        for command in (["predict", file, "--twin", tmp_path / "out", "-o", tmp_path / f"of_{file.name}", "--force"],
                        ["check", file, "--twin", tmp_path / "out", "--json"],
                        ["inspect", model, file, "--config", config, "--json"],
                        ["doctor", file, "--model", model, "--config", config, "--json"]):  # fmt: skip
            words, memory[command[0], file.stem] = run(*command, threads=1)
            if command[0] in ("inspect", "doctor"):
                (seen,) = json.loads(words)["logs"]
                assert (seen["samples"], seen["segments"]) == (pa.parquet.read_metadata(file).num_rows, 1)
                for j in range(2):
                    assert abs(seen["joints"][j]["q_sd"] / np.std(table[f"q{j + 1}"].to_numpy()) - 1) < 1e-3
    for command in ("predict", "check", "inspect", "doctor"):
        assert memory[command, "longer"] - memory[command, "long"] < 20, memory
    # What lies around the place where the first two chapters meet, as a log of its own.
    rows = np.arange(100_000, 500_000)
    pa.parquet.write_table(table.take(rows), short)
    run("predict", short, "--twin", tmp_path / "out", "-o", tmp_path / "of_short.parquet")
    whole, part = (pa.parquet.read_table(tmp_path / f"of_{name}.parquet") for name in ("long", "short"))
    # Only the ends of the log have no prediction: no row is lost where chapters meet.
    assert len(whole) > len(table) - 500 and np.diff(whole["t"].to_numpy()).max() < 1.5 / RATE
    place = np.searchsorted(whole["t"].to_numpy(), part["t"].to_numpy())
    for name in part.column_names:
        wanted, got = part[name].to_numpy(), whole[name].to_numpy()[place]
        # Columns are evaluated on a coarse clock that begins elsewhere.
        assert np.abs(wanted.astype(float) - got.astype(float)).max() < 1e-4, name

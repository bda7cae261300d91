"""Statistics of many logs on processes of this machine: the files are the program's, whatever happens to a worker."""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from threading import Event, Thread

import pytest
import twincal
from conftest import ROOT, run
from twincal import fleet
from twincal._engine import _logs
from twincal._store import Item, LocalStore

LOGS = ["one/day1/run1.csv", "one/day2/run1.csv", "two/run2.csv", "two/run3.csv"]


class Fleet:
    """A folder of logs and the plan that they share."""

    def __init__(self, folder: Path, arm) -> None:
        self.logs, self.model, self.plan = folder / "logs", arm.model, folder / "plan.json"
        for name in LOGS:
            (self.logs / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(arm.folder / Path(name).name, self.logs / name)
        arguments = ["run1.csv", "--model", "arm.urdf", "--no-config", "-o", folder / "planned"]
        done = run("statistics", *arguments, cwd=arm.folder)
        assert done.returncode in (0, 3), done.stderr
        shutil.copy(folder / "planned/plan.json", self.plan)

    def make(self, output: object, dataset: object = None, **more):
        return fleet.statistics(
            self.logs if dataset is None else dataset, self.model, self.plan, output=output, **more
        )


@pytest.fixture(scope="module")
def shared(arm, tmp_path_factory):
    return Fleet(tmp_path_factory.mktemp("fleet"), arm)


@pytest.fixture(scope="module")
def made(shared, tmp_path_factory):
    """All logs by the local engine."""
    return shared.make(tmp_path_factory.mktemp("made"), workers=2)


def contents(result) -> dict[str, bytes]:
    return {own.log: Path(own.file).read_bytes() for own in result.files}


def children() -> list[int]:
    """Workers of this process."""
    found = []
    for task in Path("/proc/self/task").iterdir():
        for pid in (task / "children").read_text().split():
            if b"_engine_local" in Path(f"/proc/{pid}/cmdline").read_bytes():
                found.append(int(pid))
    return found


def leftovers(output: Path) -> list[Path]:
    scratch = Path(tempfile.gettempdir()).glob("twincal-fleet-*")
    return [*scratch, *output.rglob(".*.part")]


@pytest.fixture
def own_temporary(tmp_path, monkeypatch):
    """A temporary folder without those of other programs."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setattr(tempfile, "tempdir", None)


def test_files_are_those_of_the_program(shared, made, tmp_path):
    assert [own.log for own in made.files] == LOGS and not made.faults and not made.stale
    assert [own.robot for own in made.files] == ["one", "one", "two", "two"]
    for own in made.files:
        place = tmp_path / own.log.replace("/", "_")
        arguments = ["--model", shared.model, "--plan", shared.plan, "--robot", own.robot]
        done = run("statistics", own.log, *arguments, "--no-config", "-o", place, cwd=shared.logs)
        assert done.returncode in (0, 3), done.stderr
        [file] = place.glob("*.arrow")
        assert Path(own.file).read_bytes() == file.read_bytes()
    parts = [twincal.Statistics.read(own.file) for own in made.files if own.robot == "two"]
    assert parts[0].merge(parts[1]).log_names == ["two/run2.csv", "two/run3.csv"]


def test_a_second_run_keeps_what_is_there(shared, tmp_path):
    logs = tmp_path / "logs"
    shutil.copytree(shared.logs, logs)
    first = shared.make(tmp_path / "out", logs, workers=2)
    stamps = {own.file: os.stat(own.file).st_mtime_ns for own in first.files}
    Path(first.files[2].file).unlink()
    second = shared.make(tmp_path / "out", logs, workers=1)
    assert [own.made for own in second.files] == [False, False, True, False]
    assert [own.file for own in second.files] == [own.file for own in first.files]
    kept = [own.file for own in second.files if not own.made]
    assert all(os.stat(file).st_mtime_ns == stamps[file] for file in kept)
    shutil.copy(logs / LOGS[2], logs / LOGS[0])
    third = shared.make(tmp_path / "out", logs, workers=1)
    assert [own.made for own in third.files] == [True, False, False, False]
    assert [str(tmp_path / "out" / name) for name in third.stale] == [first.files[0].file]


def test_faults_are_named_and_stop_nothing(shared, made, tmp_path):
    logs = tmp_path / "logs"
    shutil.copytree(shared.logs, logs)
    (logs / "two/bad.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    (logs / "two/empty.csv").write_bytes(b"")
    places = [logs / "one", logs / "two", logs / "two/none.csv"]
    result = shared.make(tmp_path / "out", places, robot=lambda log: log.split("/")[0], workers=2)
    assert [(own.log, own.code) for own in result.faults] == [
        ("two/bad.mcap", "content"),
        ("two/empty.csv", "content"),
        ("two/none.csv", "missing"),
    ]
    assert all(own.log in own.problem and own.remedy for own in result.faults)
    assert contents(result) == contents(made)


def test_a_log_that_is_written_meanwhile_is_a_fault(shared, tmp_path):
    logs = tmp_path / "logs"
    shutil.copytree(shared.logs, logs)

    def write(_: str, done: int, __: int) -> None:
        if done == 1:
            with open(logs / LOGS[-1], "a") as file:
                file.write("\n")

    result = shared.make(tmp_path / "out", logs, workers=1, progress=write)
    assert [(own.log, own.code) for own in result.faults] == [(LOGS[-1], "changed")]
    assert not shared.make(tmp_path / "out", logs, workers=1).faults


def test_unfinished_files_of_a_run_end_with_it(tmp_path):
    """Those of another run that goes on stay, until they are an hour old."""
    store = LocalStore(str(tmp_path))
    started = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", lambda part, name: started.append(Path(part)))
        store.put("day1/one", b"1")
        LocalStore(str(tmp_path)).put("day1/two", b"2")
    assert [part.exists() for part in started] == [True, True]
    store.sweep()
    assert [part.exists() for part in started] == [True, True]
    pickle.loads(pickle.dumps(store)).sweep(own=True)
    assert [part.exists() for part in started] == [False, True]
    os.utime(started[1], (0, 0))
    store.sweep()
    assert not started[1].exists()


def test_a_killed_worker_costs_nothing(shared, made, tmp_path, own_temporary):
    killed = []

    def kill(stage: str, done: int, parts: int) -> None:
        assert stage == "statistics" and parts == len(LOGS)
        if done == 1:
            killed.extend(children())
            for pid in killed:
                os.kill(pid, signal.SIGKILL)

    result = shared.make(tmp_path / "out", workers=2, progress=kill)
    assert len(killed) == 2 and not result.faults
    assert contents(result) == contents(made)
    assert not leftovers(tmp_path / "out") and not children()


def test_a_log_that_kills_every_worker_is_a_fault(shared, tmp_path):
    over, killed = Event(), []

    def kill() -> None:
        while not over.wait(0.02):
            for pid in set(children()) - set(killed):
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)

    thread = Thread(target=kill)
    thread.start()
    result = shared.make(tmp_path / "out", shared.logs / LOGS[0], workers=1, retries=2)
    over.set()
    thread.join()
    [fault] = result.faults
    assert (fault.log, fault.code, len(killed)) == ("run1.csv", "worker", 3)
    assert "3 times" in fault.problem and not result.files


def test_a_run_goes_on_after_its_process_was_killed(shared, made, tmp_path):
    out = tmp_path / "out"
    code = "import sys; from twincal import fleet; fleet.statistics(*sys.argv[1:4], output=sys.argv[4], workers=1)"
    child = subprocess.Popen([sys.executable, "-c", code, shared.logs, shared.model, shared.plan, out])
    until = time.monotonic() + 60
    while not list(out.rglob("*.arrow")) and time.monotonic() < until:
        time.sleep(0.005)
    child.kill()
    child.wait()
    before = len(list(out.rglob("*.arrow")))
    assert 1 <= before <= len(LOGS)
    result = shared.make(out, workers=2)
    assert sum(not own.made for own in result.files) >= before
    assert contents(result) == contents(made)


@pytest.mark.parametrize("library", ["pyarrow", "fsspec"])
def test_other_file_systems_give_the_same_bytes(shared, made, tmp_path, library):
    if library == "pyarrow":
        files = pytest.importorskip("pyarrow.fs")
        own = files.SubTreeFileSystem(str(tmp_path.parent), files.LocalFileSystem())
    else:
        files = pytest.importorskip("fsspec.implementations.dirfs")
        own = files.DirFileSystem(str(tmp_path.parent))
    shutil.copytree(shared.logs, tmp_path / "logs")
    dataset, output = (own, f"{tmp_path.name}/logs"), (own, f"{tmp_path.name}/out")
    result = shared.make(output, dataset, workers=2)
    files = {own.log: next((tmp_path / "out").glob(f"{own.log}-*.arrow")) for own in result.files}
    assert {log: file.read_bytes() for log, file in files.items()} == contents(made)
    assert not any(own.made for own in shared.make(output, dataset, workers=2).files)


def test_a_folder_of_a_bag_is_one_log():
    names = ["a/bag/metadata.yaml", "a/bag/bag_0.mcap", "a/bag/bag_1.mcap", "a/run.PARQUET"]
    items = [Item(name, 1, "") for name in [*names, "a/notes.txt", ".cache/run.csv"]]
    logs = _logs(items)
    assert {log: len(own) for log, own in logs.items()} == {"a/bag": 3, "a/run.PARQUET": 1}


def test_outputs_within_the_dataset_are_no_logs(shared, made, tmp_path):
    logs = tmp_path / "logs"
    shutil.copytree(shared.logs, logs)
    for _ in range(2):
        result = shared.make(logs / "st", logs, workers=2)
        assert [own.log for own in result.files] == LOGS


def test_what_is_wrong_for_all_logs_is_an_error(shared, arm, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(twincal.errors.SystemError):
        fleet.statistics(shared.logs, tmp_path / "none.urdf", shared.plan, output=out)
    with pytest.raises(twincal.errors.ContentError):
        fleet.statistics(shared.logs, shared.model, shared.model, output=out)
    (tmp_path / "wrong.toml").write_text("[signal]\ncutof_hz = 1\n")
    with pytest.raises(twincal.Error, match="cutoff_hz"):
        shared.make(out, config=tmp_path / "wrong.toml")
    (tmp_path / "empty").mkdir()
    with pytest.raises(twincal.errors.UsageError):
        shared.make(out, tmp_path / "empty")
    with pytest.raises(twincal.errors.UsageError):
        shared.make(shared.logs)
    with pytest.raises(twincal.errors.UsageError):
        shared.make(out, [shared.logs / "one", shared.logs / "two"])
    with pytest.raises(twincal.errors.UsageError):
        shared.make(out, robot={"one/day1/run1.csv": "one"})
    assert not out.exists()
    for more in ({"engine": "spark"}, {"workers": 0}, {"retries": -1}):
        with pytest.raises(ValueError):
            shared.make(out, **more)
    for more in ({"robot": 3}, {"dataset": 3}, {"dataset": (None, "a")}, {"progress": 3}):
        with pytest.raises(TypeError):
            shared.make(out, **more)
    other = json.loads(shared.plan.read_text())
    other["version"] = 10**6
    shared.make(out, shared.logs / LOGS[0])
    (out / "plan.json").write_text(json.dumps(other))
    with pytest.raises(twincal.errors.UsageError, match="another plan"):
        shared.make(out)


def test_a_worker_of_another_version_ends_the_run(shared, tmp_path, monkeypatch):
    monkeypatch.setattr("twincal._engine._twincal.version", lambda: "0.0.0")
    with pytest.raises(twincal.errors.UsageError, match="0.0.0"):
        shared.make(tmp_path / "out", workers=2)
    assert not children()


def test_without_ray_the_error_says_what_to_install(shared, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(twincal.errors.UsageError) as refused:
        shared.make(tmp_path / "out", engine="ray")
    assert "twincal[ray]" in refused.value.remedy


PAGE = ROOT / "docs/howto/many_logs.md"


@pytest.mark.skipif(not PAGE.exists(), reason="the documents are not beside the tests")
def test_the_page_prints_what_it_quotes(tmp_path):
    for name in ("arm.urdf", "run.csv", "monday.csv", "friday.csv"):
        shutil.copy(ROOT / "examples/arm" / name, tmp_path)
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE.read_text(), flags=re.S)
    first = {kind: next(text for own, text in blocks if own == kind) for kind, _ in blocks}
    done = run(*first["sh"].split()[1:], cwd=tmp_path)
    assert done.stdout.decode() == first["text"], done.stderr
    subprocess.run(["sh", "-c", first["bash"]], cwd=tmp_path, check=True)
    code = [sys.executable, "-c", first["python"]]
    done = subprocess.run(code, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout == first["console"], done.stderr

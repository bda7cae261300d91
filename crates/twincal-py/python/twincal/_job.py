"""One log to its file of statistics, in whichever process: fetched, mapped, put."""

from __future__ import annotations

import fcntl
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager, suppress
from functools import partial
from typing import NamedTuple

from twincal import _twincal
from twincal._store import Item, LocalStore, Store, persist
from twincal.errors import Error, UsageError

# A temporary folder: PREFIX…/WORK, and PREFIX…/LOCK that its process holds.
_PREFIX, _WORK, _LOCK = "twincal-fleet-", "work", "lock"


class Fault(NamedTuple):
    """Why a log has no statistics."""

    log: str
    """Path below the dataset."""
    code: str
    """That of the error (`twincal.errors`); `missing`, `changed`, or `worker` for one that died."""
    problem: str
    """What is wrong: culprit and number."""
    remedy: str
    """How to fix it."""


class File(NamedTuple):
    """Statistics of a log."""

    log: str
    """Path below the dataset."""
    robot: str | None
    """The robot that was logged; `None`: the model's name."""
    file: str
    """Path or URI."""
    made: bool
    """False if an earlier run made it."""


class Task(NamedTuple):
    """A log and where its statistics go."""

    log: str
    robot: str | None
    items: tuple[Item, ...]
    """The file, or all files of a bag; empty where there is none."""
    target: str
    """Name of the output."""


class Job(NamedTuple):
    """What all logs of a run share."""

    source: Store
    output: Store
    model: tuple[str, bytes]
    """Name and bytes."""
    plan: bytes
    config: bytes | None
    version: str


def run(job: Job, task: Task) -> File | Fault:
    """Makes the statistics of a log; what is wrong with it is a result, not an exception.

    Raises
    ------
    twincal.errors.UsageError
        If this process has another version of twincal.
    """
    if job.version != _twincal.version():
        raise UsageError(
            f"a worker has twincal {_twincal.version()}, the driver {job.version}",
            "install one version on all machines",
        )
    # Before the extension starts its threads: a core has one log.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    try:
        data = _statistics(job, task)
        persist(partial(job.output.put, task.target, data))
    except Error as error:
        return Fault(task.log, error.code, error.problem, error.remedy)
    except _Changed:
        problem = f"{task.log}: changed while it was read"
        return Fault(task.log, "changed", problem, "run again when it is complete")
    except FileNotFoundError:
        problem = f"{task.log}: there is no such file"
        return Fault(task.log, "missing", problem, "restore it, or leave it out")
    except OSError as error:
        problem = f"{task.log}: {error}"
        return Fault(task.log, "system", problem, "check store, permissions and disk; run again")
    except Exception as error:
        problem = f"{task.log}: {type(error).__name__}: {error}"
        return Fault(task.log, "internal", problem, "please report it")
    return File(task.log, task.robot, job.output.shown(task.target), True)


class _Changed(Exception):
    """A log is not the one that was listed."""


def _statistics(job: Job, task: Task) -> bytes:
    """The file of a log."""
    _require(job.source, task)
    with scratch() as folder:
        if isinstance(job.source, LocalStore):
            logs = job.source.root
        else:
            logs = os.path.join(folder, "logs")
            for item in task.items:
                to = os.path.join(logs, *item.name.split("/"))
                os.makedirs(os.path.dirname(to), exist_ok=True)
                persist(partial(job.source.fetch, item.name, to))
        robot = [] if task.robot is None else ["--robot", task.robot]
        # The log's path below the dataset is its name in the statistics.
        with chdir(logs):
            _twincal.call([*_command(job, folder), *robot, "--", task.log])
        _require(job.source, task)
        [made] = [name for name in os.listdir(_output(folder)) if name.endswith(".arrow")]
        with open(os.path.join(_output(folder), made), "rb") as file:
            return file.read()


def _require(source: Store, task: Task) -> None:
    """Refuses a log that is missing, or another one than was listed."""
    if not task.items:
        raise FileNotFoundError(task.log)
    for item in task.items:
        now = persist(partial(source.items, item.name))
        if not now:
            raise FileNotFoundError(item.name)
        if now != [item]:
            raise _Changed


def require_usable(job: Job) -> None:
    """Refuses model, plan and settings before any log is read.

    Raises
    ------
    twincal.Error
        Those of the program.
    """
    with scratch() as folder:
        nothing = os.path.join(folder, "nothing.csv")
        try:
            _twincal.call([*_command(job, folder), "--", nothing])
        except Error:
            # The program writes the plan when model, settings and plan are read, then asks for the log.
            if not os.path.exists(os.path.join(_output(folder), "plan.json")):
                raise


def _output(folder: str) -> str:
    return os.path.join(folder, "made")


def _command(job: Job, folder: str) -> list[str]:
    """Arguments of the program but for robot and log."""
    given = os.path.join(folder, "given")
    os.mkdir(given)
    name, model = job.model
    paths = [os.path.join(given, own) for own in (name, "plan.json", "twincal.toml")]
    for path, data in zip(paths, (model, job.plan, job.config), strict=True):
        if data is not None:
            with open(path, "wb") as file:
                file.write(data)
    config = ["--no-config"] if job.config is None else ["--config", paths[2]]
    places = ["--model", paths[0], "--plan", paths[1], "-o", _output(folder)]
    return ["statistics", *places, *config]


@contextmanager
def scratch() -> Iterator[str]:
    """A temporary folder; those of processes that were killed are removed first."""
    sweep()
    place = tempfile.mkdtemp(prefix=_PREFIX)
    with open(os.path.join(place, "new"), "wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        # Named when it is locked: a folder without a lock is one that is being made.
        os.rename(lock.name, os.path.join(place, _LOCK))
        folder = os.path.join(place, _WORK)
        os.mkdir(folder)
        try:
            yield folder
        finally:
            _remove(place)


def sweep() -> None:
    """Removes temporary folders of this user whose process is no more: nobody holds their lock.

    Others may put anything into the temporary folder: links and files that block are left alone.
    """
    base = tempfile.gettempdir()
    for name in os.listdir(base):
        if name.startswith(_PREFIX):
            place = os.path.join(base, name)
            with suppress(OSError):
                about = os.lstat(place)
                if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid():
                    continue
                flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK
                lock = os.open(os.path.join(place, _LOCK), flags)
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    _remove(place)
                finally:
                    os.close(lock)


def _remove(place: str) -> None:
    """The lock goes last, so that a removal that was interrupted is taken up again."""
    shutil.rmtree(os.path.join(place, _WORK), ignore_errors=True)
    with suppress(OSError):
        os.unlink(os.path.join(place, _LOCK))
        os.rmdir(place)

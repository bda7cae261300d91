"""Statistics of many logs: on processes of this machine, or on a Ray cluster."""

from __future__ import annotations

import hashlib
import json
import os
import posixpath
import tempfile
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from typing import Any, Literal, NamedTuple

from twincal import _twincal
from twincal._calibration import Progress, _progress
from twincal._job import Fault, File, Job, Task, require_usable
from twincal._statistics import Plan
from twincal._store import Item, LocalStore, Place, Store, store_of
from twincal.errors import SystemError, UsageError

Robots = str | Mapping[str, str] | Callable[[str], str | None]

_ENDINGS = (".mcap", ".db3", ".parquet", ".csv", ".arrow", ".arrows", ".feather", ".npz")
_BAG = "metadata.yaml"
_PLAN = "plan.json"
_DIGITS = 12
"""Hexadecimal digits of the content's hash in names of outputs."""


class FleetStatistics(NamedTuple):
    """Files of statistics, and logs that have none; both in the order of the logs' names."""

    files: list[File]
    faults: list[Fault]
    stale: list[str]
    """Outputs of earlier runs whose log, model or settings have changed: leave them out of a merge."""

    def __repr__(self) -> str:
        made = sum(file.made for file in self.files)
        return (
            f"<twincal.fleet.FleetStatistics: files {len(self.files)} (made now {made}), "
            f"faults {len(self.faults)}, stale {len(self.stale)}>"
        )


def statistics(
    dataset: Place | list[Place],
    model: Place,
    plan: Place,
    engine: Literal["local", "ray"] = "local",
    *,
    output: Place,
    robot: Robots | None = None,
    config: Place | None = None,
    workers: int | None = None,
    retries: int = 3,
    progress: Progress | bool | None = None,
) -> FleetStatistics:
    """Makes a file of statistics for every log of a dataset, as `twincal statistics` does for one.

    A log that cannot be used is a fault; the others go on. Files are complete or absent. The same
    call again makes what is missing and keeps what is there, also after this process was killed.
    Names and bytes of the files depend on neither the engine nor the order of work.

    Parameters
    ----------
    dataset : path, URI, (file system, path), or list of them
        Folder of logs with all folders below it: MCAP, Parquet, CSV, Arrow, NPZ, folders of rosbag2.
        URIs and file systems are those of `pyarrow.fs` or fsspec. A list has one file system.
    model : path, URI, or (file system, path)
        URDF or MJCF without includes.
    plan : path, URI, or (file system, path)
        A `plan.json` that `twincal statistics` wrote.
    engine : "local" or "ray"
        Processes of this machine, or tasks of Ray: those of the cluster that is connected, that of
        `RAY_ADDRESS`, or one on this machine. Workers of a cluster read a local path on their own.
    output : path, URI, or (file system, path)
        Folder for `plan.json` and the files: path of the log, hash of its size, time of change or
        entity tag, model, plan, settings and version, `.arrow`.
    robot : str, dict or callable, optional
        Which robot a log is of, by the log's path below the dataset. Default: the first folder of
        that path; for logs without a folder the model's name.
    config : path, URI, or (file system, path), optional
        A `twincal.toml` with `[model]`, `[[log]]` and `[columns]`; the plan decides the rest.
    workers : int, optional
        Logs in work at a time. Default: one per core; of Ray, two per core of the cluster, where the
        second one waits.
    retries : int
        How often a log is tried again whose worker was killed.
    progress : callable or bool, optional
        As for `twincal.fit`.

    Returns
    -------
    FleetStatistics

    Raises
    ------
    TypeError, ValueError
        For arguments of another kind.
    twincal.errors.UsageError
        For a dataset without logs, an output folder of another plan, and where Ray is missing.
    twincal.Error
        For model, plan or settings that cannot be used.
    """
    if isinstance(plan, Plan):
        raise TypeError("plan is a twincal.Plan; give the plan.json that `twincal statistics` wrote")
    if engine not in ("local", "ray"):
        raise ValueError(f'engine is {engine!r}; give "local" or "ray"')
    count, attempts = _counts(workers, retries)
    source, listed = _listing(dataset, robot)
    job = Job(
        source=source,
        output=store_of("output", output),
        model=_read("model", model),
        plan=_read("plan", plan)[1],
        config=None if config is None else _read("config", config)[1],
        version=_twincal.version(),
    )
    require_usable(job)
    tasks = _tasks(job, listed)
    there = _prepared(job)
    todo = [task for task in tasks if task.target not in there]
    results: list[File | Fault] = [
        File(task.log, task.robot, job.output.shown(task.target), False)
        for task in tasks
        if task.target in there
    ]
    with _progress(progress) as watch, closing(_engine(engine)(job, todo, count, attempts)) as made:
        for result in made:
            results.append(result)
            if watch is not None:
                watch("statistics", len(results), len(tasks))
    results.sort(key=lambda own: own.log)
    return FleetStatistics(
        files=[own for own in results if isinstance(own, File)],
        faults=[own for own in results if isinstance(own, Fault)],
        stale=_stale(tasks, there),
    )


def _counts(workers: int | None, retries: int) -> tuple[int | None, int]:
    from twincal._arrays import whole

    count = None if workers is None else whole("workers", workers)
    if count == 0:
        raise ValueError("workers is 0; give 1 or more")
    return count, whole("retries", retries)


def _engine(name: str) -> Any:
    """The generator of results; modules of an engine are imported when it is used."""
    import importlib

    return importlib.import_module(f"twincal._engine_{name}").results


# ---- inputs


def _listing(dataset: Place | list[Place], robot: Robots | None) -> tuple[Store, list[Task]]:
    """The store and its logs; targets are not known yet."""
    places = dataset if isinstance(dataset, list) else [dataset]
    stores = [store_of("dataset", place) for place in places]
    if not stores:
        raise UsageError("dataset is an empty list", "give a folder of logs")
    store = stores[0]
    files = [getattr(own, "files", None) for own in stores]
    if any(type(own) is not type(store) for own in stores) or any(own != files[0] for own in files):
        raise UsageError("dataset has several file systems", "call once for each of them")
    if len(stores) > 1 and robot is None:
        raise UsageError(
            "dataset is a list, and no folder says which robot a log is of",
            "give robot=, a name or a function of the log's path",
        )
    roots = sorted({own.root for own in stores})
    logs = _logs(store.items()) if len(roots) == 1 else {}
    if len(roots) > 1 or "." in logs:
        # Paths of several places, or of a single file or bag, begin behind their common folder.
        store.root = posixpath.commonpath([posixpath.dirname(root) for root in roots])
        below = [posixpath.relpath(root, store.root or ".") for root in roots]
        logs = {}
        for name in below:
            items = store.items(name)
            is_file = [item.name for item in items] == [name]
            logs |= {name: items} if is_file or not items else _logs(items)
    name_of = _robots(robot)
    return store, [Task(log, name_of(log), tuple(logs[log]), "") for log in sorted(logs)]


def _logs(items: Iterable[Item]) -> dict[str, list[Item]]:
    """Files that are logs, by name; those of a rosbag2 folder are one log."""
    items = list(items)
    bags = {
        posixpath.dirname(item.name) for item in items if posixpath.basename(item.name) == _BAG
    }
    logs: dict[str, list[Item]] = {}
    for item in items:
        folder = posixpath.dirname(item.name)
        is_hidden = any(part.startswith(".") and part != "." for part in item.name.split("/"))
        if folder in bags:
            logs.setdefault(folder or ".", []).append(item)
        elif item.name == "." or (item.name.lower().endswith(_ENDINGS) and not is_hidden):
            logs[item.name] = [item]
    return logs


def _robots(robot: Robots | None) -> Callable[[str], str | None]:
    """The function from a log's path to its robot."""
    if robot is None:
        return lambda log: log.split("/")[0] if "/" in log else None
    if isinstance(robot, str):
        return lambda _: robot
    if isinstance(robot, Mapping):

        def named(log: str) -> str:
            if log not in robot:
                raise UsageError(f"robot has no entry for log `{log}`", "add it, or give a function")
            return robot[log]

        return named
    if callable(robot):
        return robot
    raise TypeError(f"robot is of {type(robot).__name__}; give text, a dict or a function")


def _read(what: str, place: Place) -> tuple[str, bytes]:
    """Name and bytes of a file."""
    store = store_of(what, place)
    store.root, name = posixpath.split(store.root)
    with tempfile.TemporaryDirectory() as folder:
        copy = os.path.join(folder, "file")
        try:
            store.fetch(name, copy)
        except OSError as error:
            problem = f"{what} {store.shown(name)}: cannot be read: {error}"
            raise SystemError(problem, "give an existing file") from None
        with open(copy, "rb") as file:
            return name, file.read()


# ---- outputs


def _tasks(job: Job, listed: list[Task]) -> list[Task]:
    """Logs with the names of their outputs, without those in the output folder."""
    if type(job.output) is type(job.source):
        own = posixpath.relpath(job.output.root or ".", job.source.root or ".") + "/"
        if own == "./":
            raise UsageError("output is the folder of the dataset", "give another folder")
        listed = [task for task in listed if not task.log.startswith(own)]
    if not listed:
        raise UsageError(
            f"dataset {job.source.shown('')}: holds no log",
            f"give a folder with files that end in {', '.join(_ENDINGS)}",
        )
    digest = hashlib.sha256(job.version.encode())
    for data in (job.model[0].encode(), job.model[1], job.plan, job.config or b""):
        digest.update(hashlib.sha256(data).digest())
    shared = digest.hexdigest()

    def target(task: Task) -> str:
        identity = json.dumps([shared, task.log, task.robot, task.items])
        own = hashlib.sha256(identity.encode()).hexdigest()[:_DIGITS]
        return f"{task.log}-{own}.arrow"

    return [task._replace(target=target(task)) for task in listed]


def _prepared(job: Job) -> set[str]:
    """Names of outputs that are there; the folder holds the plan of this run."""
    if isinstance(job.output, LocalStore):
        job.output.sweep()
    there = {item.name for item in job.output.items()}
    if _PLAN not in there:
        job.output.put(_PLAN, job.plan)
        return there
    with tempfile.TemporaryDirectory() as folder:
        copy = os.path.join(folder, _PLAN)
        job.output.fetch(_PLAN, copy)
        with open(copy, "rb") as file:
            known = file.read()
    if json.loads(known) != json.loads(job.plan):
        raise UsageError(
            f"{job.output.shown('')} holds another plan",
            "give another output folder: statistics of two plans do not add",
        )
    return there


def _stale(tasks: list[Task], there: set[str]) -> list[str]:
    """Outputs of the same logs that this run would not make."""
    logs, targets = {task.log for task in tasks}, {task.target for task in tasks}
    ending = _DIGITS + len("-.arrow")
    return sorted(name for name in there - targets if name[:-ending] in logs)

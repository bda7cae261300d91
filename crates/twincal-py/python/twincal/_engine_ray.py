"""Tasks of a Ray cluster, one per log. Only paths and faults travel through its object store."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any

from twincal._engine_local import died
from twincal._job import Fault, File, Job, Task, run
from twincal.errors import Error, UsageError

_OLDEST = (2, 60)


def results(
    job: Job, tasks: list[Task], workers: int | None, retries: int
) -> Iterator[File | Fault]:
    """Results in the order in which they are ready."""
    ray = _ray()
    is_ours = not ray.is_initialized()
    if is_ours:
        ray.init()
    work = ray.remote(num_cpus=1, max_retries=retries)(run)
    shared, waiting = ray.put(job), iter(tasks)
    flying: dict[Any, Task] = {}
    try:
        while True:
            # Anew each time: nodes come and go.
            most = workers or 2 * max(1, int(ray.cluster_resources().get("CPU", 1)))
            for task in islice(waiting, max(0, most - len(flying))):
                flying[work.options(name=f"twincal {task.log}").remote(shared, task)] = task
            if not flying:
                return
            ready, _ = ray.wait(list(flying), num_returns=1)
            for reference in ready:
                yield _result(ray, reference, flying.pop(reference).log, retries)
    finally:
        for reference in flying:
            ray.cancel(reference, force=True)
        if is_ours:
            ray.shutdown()


def _result(ray: Any, reference: Any, log: str, retries: int) -> File | Fault:
    """What became of a log."""
    try:
        result = ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        if isinstance(error.cause, Error):
            raise error.cause from None
        problem = f"a worker of Ray cannot make statistics: {error.cause}"
        raise UsageError(problem, "install the same twincal on all machines") from error
    except ray.exceptions.RayError as error:
        return died(log, retries + 1, type(error).__name__)
    assert isinstance(result, (File, Fault))
    return result


def _ray() -> Any:
    """The module; refused where it is missing or older than what was tested."""
    try:
        import ray
    except ImportError:
        problem = 'engine "ray" needs Ray, which is not installed'
        raise UsageError(problem, "pip install 'twincal[ray]'") from None
    if tuple(int(part) for part in ray.__version__.split(".")[:2]) < _OLDEST:
        problem = f'engine "ray" needs Ray 2.60 or newer; this is {ray.__version__}'
        raise UsageError(problem, "pip install --upgrade 'twincal[ray]'")
    return ray

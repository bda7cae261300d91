"""Processes of this machine, each with one log at a time. A process that dies loses its log alone."""

from __future__ import annotations

import os
import pickle
import selectors
import signal
import subprocess
import sys
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import suppress

from twincal._job import Fault, File, Job, Task, run, sweep
from twincal._store import LocalStore

# Not multiprocessing: its children import the caller's script anew, which fails without a guard.
_START = "import sys; sys.path[:] = sys.argv[1:]; from twincal._engine_local import serve; serve()"


def results(
    job: Job, tasks: list[Task], workers: int | None, retries: int
) -> Iterator[File | Fault]:
    """Results in the order in which they are ready."""
    most = workers or len(os.sched_getaffinity(0))
    waiting, deaths = deque(tasks), Counter[str]()
    busy: set[_Worker] = set()
    idle: list[_Worker] = []
    with selectors.DefaultSelector() as ready:
        try:
            while waiting or busy:
                while waiting and len(busy) < most:
                    worker = idle.pop() if idle else _Worker(job, ready)
                    busy.add(worker)
                    worker.begin(waiting.popleft())
                for key, _ in ready.select():
                    worker = key.data
                    if worker not in busy:
                        # It died between two logs.
                        idle.remove(worker)
                        worker.end()
                        continue
                    result = worker.result()
                    busy.remove(worker)
                    if result is not None:
                        idle.append(worker)
                        yield result
                        continue
                    task, code = worker.task, worker.end()
                    deaths[task.log] += 1
                    if deaths[task.log] <= retries:
                        waiting.append(task)
                        continue
                    yield died(task.log, deaths[task.log], f"exit code {code}")
        finally:
            for worker in (*busy, *idle):
                worker.end()
            sweep()
            if isinstance(job.output, LocalStore):
                job.output.sweep(own=True)


def died(log: str, times: int, how: str) -> Fault:
    """The fault of a log whose worker dies every time."""
    problem = f"{log}: its worker died {times} times ({how})"
    return Fault(log, "worker", problem, "give workers more memory, or leave the log out")


class _Worker:
    """A process that makes statistics, one log after the other."""

    def __init__(self, job: Job, ready: selectors.BaseSelector) -> None:
        command = [sys.executable, "-c", _START, *sys.path]
        self._child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self._child.stdin is not None and self._child.stdout is not None
        self._to, self._from, self._ready = self._child.stdin, self._child.stdout, ready
        ready.register(self._from, selectors.EVENT_READ, self)
        self._send(job)
        self.task: Task

    def _send(self, message: Job | Task) -> None:
        # A process that died is seen where its answer is read.
        with suppress(BrokenPipeError):
            pickle.dump(message, self._to)
            self._to.flush()

    def begin(self, task: Task) -> None:
        """Gives it a log."""
        self.task = task
        self._send(task)

    def result(self) -> File | Fault | None:
        """What became of the log; `None` if the process died."""
        try:
            result = pickle.load(self._from)
        except (EOFError, pickle.UnpicklingError):
            return None
        if isinstance(result, Exception):
            raise result
        assert isinstance(result, (File, Fault))
        return result

    def end(self) -> int:
        """Ends the process; returns its exit code, a negative one for a signal."""
        self._ready.unregister(self._from)
        with suppress(BrokenPipeError):
            self._to.close()
        self._from.close()
        self._child.terminate()
        return self._child.wait()


def serve() -> None:
    """The worker: a job, then logs from standard input; results to standard output."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What libraries print must not come between the results.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with suppress(EOFError, BrokenPipeError):
        job = pickle.load(sys.stdin.buffer)
        while True:
            task = pickle.load(sys.stdin.buffer)
            try:
                answer: object = run(job, task)
            except Exception as error:
                answer = error
            pickle.dump(answer, answers)
            answers.flush()

"""Threads, forks, interrupts, imports and memory."""

from __future__ import annotations

import os
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import twincal
from conftest import SETTINGS, python

FIT = """
import sys, twincal
robot = twincal.Robot.from_urdf(sys.argv[1])
log = twincal.Log.read(sys.argv[2])
def work(_=None):
    return float(twincal.fit(robot, log, families=["payload", "viscous"], generic=False).terms["mean"][0])
"""


def test_eight_threads(arm, robot, result):
    states = np.random.default_rng(2).uniform(-1.0, 1.0, (3, 3000, 2))
    expected, fitted = result.predict(*states), result.terms["mean"]

    def work(number: int) -> bool:
        own = result.predict(*states)
        same = np.array_equal(own.low, expected.low)
        if number % 4 == 0:
            logs = [arm.log(name) for name in ("run1", "run2")]
            again = twincal.fit(robot, logs, heldout=arm.log("run3"), **SETTINGS)
            same &= np.array_equal(again.terms["mean"], fitted, equal_nan=True)
        return bool(same)

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(work, range(8)))


@pytest.mark.parametrize("method", ["fork", "spawn", "loky"])
def test_processes(arm, method, tmp_path):
    if method == "loky":
        pytest.importorskip("joblib")
    script = tmp_path / "work.py"
    run = {
        "loky": "import joblib; own = joblib.Parallel(2)(joblib.delayed(work)() for _ in range(2))",
    }.get(
        method,
        f"""import multiprocessing
    with multiprocessing.get_context("{method}").Pool(2) as pool:
        own = pool.map(work, range(2))""",
    )
    text = FIT + f'\nif __name__ == "__main__":\n    first = work()\n    {run}\n    print(own == [first] * 2)\n'
    script.write_text(text)
    import subprocess

    done = subprocess.run(
        [sys.executable, script, arm.model, arm.folder / "run1.csv"],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stdout.strip() == "True", done.stderr


INTERRUPTED = """
import os, pathlib, signal, sys, tempfile, threading, time
import numpy as np
import twincal
# A shell that starts the tests behind it leaves SIGINT ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
robot = twincal.Robot.from_urdf(sys.argv[2])
log = twincal.Log.read(sys.argv[3])
few = {"families": ["payload", "viscous", "coulomb"], "generic": False}
gibbs = {"method": "gibbs", "draws": 400_000}

def regression(method):
    X = np.random.default_rng(1).standard_normal((500, 60))
    return lambda: getattr(twincal.SpikeSlabRegressor(**gibbs), method)(X, X[:, 0] + X[:, 1])

def statistics():
    made = twincal.Statistics.map(robot, log, twincal.Statistics.plan(robot, log, **few))
    return lambda: made.fit(**gibbs)

def predict():
    states = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 10_000_000, 2))
    result = twincal.fit(robot, log, **few)
    return lambda: result.predict(*states)

def design():
    folder = pathlib.Path(tempfile.mkdtemp())
    (folder / "limits.toml").write_text(
        "".join(f'[joint."{name}"]\\nvelocity = 0.9\\ntorque = 1000\\n' for name in robot.joint_names)
    )
    def call():
        global left
        left = folder / "motion" / "design.json"
        twincal.design(left.parent, model=sys.argv[2], limits=folder / "limits.toml", duration=120)
    return call

left = None
call = {
    "design": design,
    "fit": lambda: lambda: twincal.fit(robot, log, **few, **gibbs),
    "Statistics.fit": statistics,
    "SpikeSlabRegressor.fit": lambda: regression("fit"),
    "Calibration.predict": predict,
}[sys.argv[1]]()
sent = []

def interrupt():
    sent.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)

try:
    threading.Timer(0.4, interrupt).start()
    call()
    print("ended by itself", flush=True)
except KeyboardInterrupt:
    seconds = time.monotonic() - sent[0]
    if left is not None:
        # what goes on beside Python ends at its next look
        for _ in range(200):
            names = [(task / "comm").read_text().strip() for task in pathlib.Path("/proc/self/task").iterdir()]
            if "twincal" not in names:
                break
            time.sleep(0.05)
        else:
            sys.exit("the work goes on")
        assert not left.exists(), "a result that nobody waits for"
    print(seconds, flush=True)
os._exit(0)
"""


@pytest.mark.parametrize(
    "call",
    ["design", "fit", "Statistics.fit", "SpikeSlabRegressor.fit", "Calibration.predict"],
)
def test_ctrl_c_ends_a_call_within_a_second(arm, call):
    """0.4 s after the call, when it samples, predicts or searches; a motion that was given up is not written."""
    if call.startswith("Spike"):
        pytest.importorskip("sklearn")
    done = python(INTERRUPTED, call, arm.model, arm.folder / "run1.csv")
    assert float(done.stdout) < 1.0, done.stderr


APART = """
import pathlib, signal, sys, tempfile, threading
import os
import twincal
signal.signal(signal.SIGINT, signal.default_int_handler)
robot = twincal.Robot.from_urdf(sys.argv[1])
log = twincal.Log.read(sys.argv[2])
folder = pathlib.Path(tempfile.mkdtemp())
(folder / "limits.toml").write_text(
    "".join(f'[joint."{name}"]\\nvelocity = 0.9\\ntorque = 1000\\n' for name in robot.joint_names)
)
ended = 0
for number in range(10):
    threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    try:
        twincal.design(folder / str(number), model=sys.argv[1], limits=folder / "limits.toml", duration=120)
    except KeyboardInterrupt:
        pass
    twincal.fit(robot, log, families=["payload", "viscous", "coulomb"], generic=False)
    ended += 1
print(ended, flush=True)
os._exit(0)
"""


def test_a_call_that_was_given_up_ends_no_other(arm):
    """A fit at once after a search that was interrupted and still runs on the same threads, ten times."""
    done = python(APART, arm.model, arm.folder / "run1.csv")
    assert done.stdout.strip() == "10", done.stderr


def test_progress_is_called_and_may_stop(arm, robot):
    heard = []
    twincal.fit(robot, arm.log("run1"), progress=lambda *own: heard.append(own), **SETTINGS)
    assert len({stage for stage, _, _ in heard}) >= 3
    twincal.fit(robot, arm.log("run1"), progress=True, **SETTINGS)

    class Enough(Exception):
        pass

    def stop(*_):
        raise Enough

    with pytest.raises(Enough):
        twincal.fit(robot, arm.log("run1"), progress=stop, **SETTINGS)
    with pytest.raises(TypeError):
        twincal.fit(robot, arm.log("run1"), progress=3)


def test_other_threads_run_during_a_fit(arm, robot):
    from threading import Event, Thread

    ended, counted = Event(), []

    def count():
        while not ended.is_set():
            counted.append(None)
            time.sleep(0.001)

    thread = Thread(target=count)
    thread.start()
    began = time.monotonic()
    twincal.fit(robot, [arm.log("run1"), arm.log("run2")], **SETTINGS)
    seconds = time.monotonic() - began
    ended.set()
    thread.join()
    assert len(counted) > 50 * seconds


def test_import_is_quick_and_light():
    code = """
import sys, time
import numpy
began = time.perf_counter()
import twincal
print(time.perf_counter() - began)
heavy = {"sklearn", "arviz", "matplotlib", "pandas", "polars", "xarray", "scipy", "tqdm"}
twincal.fit
print(sorted(heavy & set(sys.modules)))
"""
    best = []
    for _ in range(5):
        seconds, heavy = python(code).stdout.splitlines()
        assert heavy == "[]"
        best.append(float(seconds))
    assert min(best) < 0.2, best


def test_memory_does_not_grow(arm):
    code = FIT + textwrap.dedent(
        """
        def rss():
            with open("/proc/self/statm") as file:
                return int(file.read().split()[1]) * 4096 / 1e6
        sizes = []
        for count in range(1, 121):
            work()
            if count in (20, 120):
                sizes.append(rss())
        print(sizes[1] - sizes[0])
        """
    )
    if not os.path.exists("/proc/self/statm"):
        pytest.skip("memory is read from /proc")
    done = python(code, arm.model, arm.folder / "run1.csv")
    assert float(done.stdout) < 10.0, done.stderr

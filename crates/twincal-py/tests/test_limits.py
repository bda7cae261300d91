"""Numbers beyond what a machine holds are refused before anything is allocated or started."""

from __future__ import annotations

import time

import numpy as np
import pytest
import twincal
from conftest import SETTINGS, python

REGRESSION = """
import sys
import numpy as np
from twincal import SpikeSlabRegressor
X = np.random.default_rng(1).standard_normal((50, 3))
try:
    SpikeSlabRegressor(method="gibbs", **{sys.argv[1]: int(sys.argv[2])}).fit(X, X[:, 0])
except Exception as error:
    print(type(error).__name__, error)
"""


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("draws", 10**10, "SettingError"),
        ("draws", 99, "SettingError"),
        ("chains", 10**12, "SettingError"),
        ("chains", 1, "SettingError"),
        ("chains", 10**30, "ValueError"),
        ("draws", -5, "ValueError"),
    ],
)
def test_draws_and_chains_of_a_regression(key, value, says):
    """In another process: a failed allocation ends it."""
    pytest.importorskip("sklearn")
    done = python(REGRESSION, key, value)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(says) and str(value) in done.stdout, done.stdout


def test_draws_that_the_memory_does_not_hold():
    """10¹⁰ draws of 3 coefficients have 120 GB as 4-byte numbers alone."""
    pytest.importorskip("sklearn")
    from twincal import SpikeSlabRegressor

    X = np.random.default_rng(1).standard_normal((50, 3))
    regressor = SpikeSlabRegressor(method="gibbs", chains=1024, draws=10**7)
    with pytest.raises(twincal.Error, match="memory") as error:
        regressor.fit(X, X[:, 0])
    assert error.value.remedy
    # the sum over all models draws nothing
    regressor.set_params(method="auto").fit(X, X[:, 0])


@pytest.mark.parametrize("threads", [0, 4097, 10**6])
def test_threads(arm, robot, threads):
    log = arm.log("run1")
    plan = twincal.Statistics.plan(robot, log, **SETTINGS)
    statistics = twincal.Statistics.map(robot, log, plan)
    for call in (
        lambda: twincal.fit(robot, log, threads=threads, **SETTINGS),
        lambda: twincal.Statistics.plan(robot, log, threads=threads),
        lambda: statistics.fit(threads=threads),
    ):
        began = time.monotonic()
        with pytest.raises(twincal.errors.SettingError, match=f"threads.*{threads}") as error:
            call()
        assert time.monotonic() - began < 1.0 and "4096" in error.value.remedy

"""The study's acceptance numbers, short form: few fixed seeds through the command line.

The long form, 20 seeds per world, is `python studies/planar_arm/acceptance.py --long`; its table stands in the study's
README. Seeds are fixed, so a run repeats exactly; the stated chances are those of a fresh set of seeds for a correct
program.
"""

from math import sqrt

import acceptance
import numpy as np
import pytest

WORLDS = {world.name: world for world in acceptance.worlds()}


@pytest.mark.parametrize("name", ["white noise", "white noise, the paper's likelihood", "white noise, friction"])
def test_exact_rows(name):
    """24 candidates, 2000 x 2 rows: false alarm about 2 % per seed (|z| > 3 of four frictions, false PIPs)."""
    for run in acceptance.run(WORLDS[name], (1, 2)):
        assert run["candidates"] == 24 and run["visible"] >= 7
        assert run["visible_pip"] > 0.99, run
        assert run["false"] == 0, run
        assert run["rmse_ratio"] <= 1.01, run
        assert all(0.93 <= coverage <= 0.97 for coverage in run["heldout_coverage"]), run
        assert run["friction_z"] <= 3.0, run


@pytest.mark.parametrize(
    "name",
    ["AR(1) 20 ms, default", "AR(1) 20 ms, ar1", "AR(1) 100 ms, default", "AR(1) 100 ms, ar1"]
    + [name for name in WORLDS if name.startswith("encoder only")],
)
def test_filtered_rows(name):
    """Coloured torque noise and raw encoder data at 1 kHz: no false term; coverage not below 92 % by 3 standard errors."""
    runs = acceptance.run(WORLDS[name], (1, 2))
    assert sum(run["false"] for run in runs) == 0, runs
    trials = sum(run["true"] for run in runs)
    coverage = np.mean([run["coverage_true"] for run in runs])
    assert coverage >= 0.92 - 3 * sqrt(0.92 * 0.08 / trials), runs

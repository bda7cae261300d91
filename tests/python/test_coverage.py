"""A short form of `studies/planar_arm/coverage.py`: intervals of held-out torque under white noise, neither too narrow nor too wide."""

import coverage
import numpy as np

SEEDS = range(1, 9)


def test_intervals_of_held_out_torque_hold_what_they_promise():
    """Coverage differs by 0.018 from log to log, 0.1 correlated between joints; the mean of 8 logs and 2 joints is within 4.5 standard errors: false alarm 7e-6."""
    runs = [coverage.measure(seed, 0) for seed in SEEDS]
    assert all(run["exit"] in (0, 3) for run in runs), runs
    assert sum(run["false"] + run["missed"] for run in runs) == 0, runs
    held = np.array([run["torque"] for run in runs])
    assert abs(held.mean() - 0.95) < 4.5 * 0.018 * np.sqrt(1.1 / held.size), held

"""Finds the physics that is missing from a robot's digital twin.

>>> import twincal
>>> robot = twincal.Robot.from_urdf("arm.urdf")
>>> result = twincal.fit(robot, [twincal.Log.read("run1.csv")])
>>> result.effects.to_pandas()

======================  ==================================================================
`Robot`                 a model: torque of a motion, regressor
`Log`                   a recording: a file, arrays or a data frame
`fit`                   robot and logs to a `Calibration`
`Calibration`           assessment, effects, torque with intervals, files
`Statistics`            what a fit takes of each log, which adds
`SpikeSlabRegressor`    the same regression for any columns, as scikit-learn has it
`design`                the motion to record: what decides open effects, within limits
`decoys`                functions of a joint's motion that show what no column describes
`fleet`                 many logs of many robots, on all cores or a Ray cluster
`plot`                  figures of matplotlib
======================  ==================================================================

Units are SI and radians. Errors are those of `twincal.errors`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twincal import errors
from twincal._calibration import Calibration, Draws, LogTorque, Torque, fit
from twincal._decoys import decoys
from twincal._design import Motion, design
from twincal._log import Log
from twincal._robot import Robot
from twincal._statistics import Plan, Statistics
from twincal._table import Assessment, Table
from twincal._twincal import version as _version
from twincal.errors import Error

if TYPE_CHECKING:
    from twincal import fleet, plot
    from twincal.regressor import SpikeSlabRegressor

__version__ = _version()

__all__ = [
    "Assessment",
    "Calibration",
    "Draws",
    "Error",
    "Log",
    "LogTorque",
    "Motion",
    "Plan",
    "Robot",
    "SpikeSlabRegressor",
    "Statistics",
    "Table",
    "Torque",
    "decoys",
    "design",
    "errors",
    "fit",
    "fleet",
    "plot",
]


def __getattr__(name: str) -> Any:
    """Imports what needs other packages when it is first used."""
    import importlib

    if name == "SpikeSlabRegressor":
        return importlib.import_module("twincal.regressor").SpikeSlabRegressor
    if name in ("fleet", "plot"):
        return importlib.import_module(f"twincal.{name}")
    raise AttributeError(f"module 'twincal' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), "SpikeSlabRegressor", "fleet", "plot"])

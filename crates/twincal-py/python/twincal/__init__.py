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

# Nothing is imported here, `typing` included: what stands before the command `twincal` is a time in
# which Ctrl-C ends it with a traceback.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from twincal import errors, fleet, plot
    from twincal._calibration import Calibration, Draws, LogTorque, Torque, fit
    from twincal._decoys import decoys
    from twincal._design import Motion, design
    from twincal._log import Log
    from twincal._robot import Robot
    from twincal._statistics import Plan, Statistics
    from twincal._table import Assessment, Table
    from twincal.errors import Error
    from twincal.regressor import SpikeSlabRegressor

    __version__: str

# The module of each name, imported when the name is first used: the command `twincal` needs none of
# them, and NumPy alone takes a fifth of a second.
_MODULE_OF = {
    "Assessment": "_table",
    "Calibration": "_calibration",
    "Draws": "_calibration",
    "Error": "errors",
    "Log": "_log",
    "LogTorque": "_calibration",
    "Motion": "_design",
    "Plan": "_statistics",
    "Robot": "_robot",
    "SpikeSlabRegressor": "regressor",
    "Statistics": "_statistics",
    "Table": "_table",
    "Torque": "_calibration",
    "decoys": "_decoys",
    "design": "_design",
    "fit": "_calibration",
}

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
    from importlib import import_module

    if name in _MODULE_OF:
        value = getattr(import_module(f"twincal.{_MODULE_OF[name]}"), name)
    elif name in ("errors", "fleet", "plot"):
        value = import_module(f"twincal.{name}")
    elif name == "__version__":
        value = import_module("twincal._twincal").version()
    else:
        raise AttributeError(f"module 'twincal' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})

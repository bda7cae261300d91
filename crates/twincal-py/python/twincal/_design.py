"""The motion to record: `twincal design` from Python."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from twincal import _twincal


class Motion:
    """A designed motion, from rest to rest. Simulated only: run it at 10 % speed first.

    Attributes
    ----------
    folder : pathlib.Path
        Where `motion.csv`, `motion.parquet`, `trajectory.yaml`, `keyframes.xml`, `design.json` and `design.html` are.
    joint_names : list of str
        Joints, in the order of the columns.
    t : numpy.ndarray, shape (samples,)
        Time, s.
    q, qd, qdd : numpy.ndarray, shape (samples, joints)
        Position, velocity and acceleration; rad, rad/s and rad/s² (m for sliders).
    condition : float
        Condition number of the rows on the base parameters.
    promises : list of dict
        For each open effect: `effect`, `pip`, `right`, `wrong`, `sd`, `structural`, `decided_by`.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        read: dict[str, Any] = json.loads((self.folder / "design.json").read_text(encoding="utf-8"))
        self.joint_names: list[str] = [own["joint"] for own in read["limits"]]
        self.condition: float = read["condition"]
        self.promises: list[dict[str, Any]] = read["promises"]
        with (self.folder / "motion.csv").open(encoding="utf-8") as file:
            table = np.loadtxt(file, delimiter=",", skiprows=1, ndmin=2)
        n = len(self.joint_names)
        self.t: npt.NDArray[np.float64] = table[:, 0]
        self.q: npt.NDArray[np.float64] = table[:, 1 : 1 + n]
        self.qd: npt.NDArray[np.float64] = table[:, 1 + n : 1 + 2 * n]
        self.qdd: npt.NDArray[np.float64] = table[:, 1 + 2 * n : 1 + 3 * n]

    def __repr__(self) -> str:
        return f"<twincal.Motion of {len(self.joint_names)} joints, {self.t[-1]:g} s>"


def design(
    output: str | os.PathLike[str],
    *,
    model: str | os.PathLike[str] | None = None,
    twin: str | os.PathLike[str] | None = None,
    decide: Iterable[str] = (),
    criterion: Literal["determinant", "condition"] = "determinant",
    after: Iterable[str | os.PathLike[str]] = (),
    config: str | os.PathLike[str] | None = None,
    duration: float = 20.0,
    rate: float = 500.0,
    limits: str | os.PathLike[str] | None = None,
    seed: int = 1,
    force: bool = False,
) -> Motion:
    """The motion to record, within the limits of the robot, as `twincal design` finds it.

    Parameters
    ----------
    output : path
        Folder of the result.
    model : path, optional
        Robot model (URDF, MJCF): the motion is to show body, motors and friction.
    twin : path, optional
        Folder of a fit: the motion is to decide what it leaves open. With `model` beside it, the
        meshes of that file are checked for collisions.
    decide : iterable of str
        Effects to decide; without them those with a probability of 0.05 to 0.95.
    criterion : {"determinant", "condition"}
        What the motion maximises without a twin: information on all base parameters, or, at the
        price of wider intervals, the same with a smaller condition number.
    after : iterable of path
        Logs that are recorded already, beside those of the twin: what they show the motion need
        not show again. Their torque is not looked at.
    config : path, optional
        Settings file: how the base of `model` stands, and how logs of `after` are read.
    duration : float
        Length, s.
    rate : float
        The controller's rate, Hz.
    limits : path, optional
        TOML file of limits over those of the model; `load` in it is what the robot is known to carry.
    seed : int
        Seed of all random numbers.
    force : bool
        Replace an earlier result.

    Returns
    -------
    Motion

    Raises
    ------
    twincal.Error
        For limits that are missing or wrong, a start that cannot be held, unknown names.
    """
    if isinstance(decide, str):
        raise TypeError("decide is one name; give a list of names")
    if isinstance(after, (str, os.PathLike)):
        raise TypeError("after is one path; give a list of paths")
    if model is None and twin is None:
        raise ValueError("give model or twin, at least one of them")
    arguments = ["design", "--json", "-o", os.fspath(output), "--seed", str(int(seed))]
    arguments += ["--duration", repr(float(duration)), "--rate", repr(float(rate))]
    for flag, path in (("--model", model), ("--twin", twin), ("--limits", limits), ("--config", config)):
        if path is not None:
            arguments += [flag, os.fspath(path)]
    if criterion != "determinant":
        arguments += ["--criterion", criterion]
    names = list(decide)
    arguments += ["--decide", *names] if names else []
    logs = [os.fspath(path) for path in after]
    arguments += ["--after", *logs] if logs else []
    _twincal.call([*arguments, *(["--force"] if force else [])])
    return Motion(output)

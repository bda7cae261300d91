"""Figures of a calibration with matplotlib: each takes `ax=` and returns the Axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from twincal._arrays import Floats, floats, whole
from twincal._calibration import Calibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["law", "pair", "pip", "residual", "torque"]

_BLUE, _ORANGE, _GREY = "#0072B2", "#D55E00", "#999999"


def _axes(ax: Axes | None) -> Axes:
    from matplotlib import pyplot
    from matplotlib.axes import Axes

    if ax is None:
        made: Axes = pyplot.subplots()[1]
        return made
    if not isinstance(ax, Axes):
        raise TypeError(f"ax is of {type(ax).__name__}; give Axes of matplotlib")
    return ax


def _require(calibration: Calibration) -> None:
    if not isinstance(calibration, Calibration):
        raise TypeError(f"calibration is of {type(calibration).__name__}; give a twincal.Calibration")


def _joint(calibration: Calibration, joint: int | str) -> int:
    _require(calibration)
    names = calibration.joint_names
    if isinstance(joint, str):
        if joint not in names:
            raise ValueError(f"there is no joint {joint!r}; joints are {', '.join(names)}")
        return names.index(joint)
    number = whole("joint", joint)
    if number >= len(names):
        raise ValueError(f"there is no joint {number}; there are {len(names)}, counted from 0")
    return number


def _samples(
    calibration: Calibration, rows: int | None, **channels: npt.ArrayLike
) -> list[Floats]:
    """Channels of all joints, shape (N, n) each; `rows`: N, where it is known."""
    own, joints = [], len(calibration.joint_names)
    for name, values in channels.items():
        array = floats(name, values)
        rows = len(array) if rows is None and array.ndim == 2 else rows
        if array.shape != (rows, joints):
            wanted = "samples" if rows is None else rows
            raise ValueError(f"{name} has shape {array.shape}; give ({wanted}, {joints})")
        own.append(array)
    return own


def pip(calibration: Calibration, *, most: int = 20, ax: Axes | None = None) -> Axes:
    """Posterior inclusion probabilities of the effects, the most probable first.

    Parameters
    ----------
    calibration : Calibration
    most : int
        How many effects are shown.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    _require(calibration)
    ax, most = _axes(ax), whole("most", most)
    effects = calibration.effects.to_dict()
    found = {
        name: float(value)
        for name, value in zip(effects["component"], effects["pip"], strict=True)
        if np.isfinite(value)
    }
    shown = sorted(found.items(), key=lambda item: -item[1])[:most]
    names = [name for name, _ in shown][::-1]
    values = [value for _, value in shown][::-1]
    ax.barh(names, values, color=[_BLUE if value >= 0.5 else _GREY for value in values])
    ax.axvline(0.5, color="black", linewidth=0.8, linestyle=":")
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel("posterior inclusion probability")
    return ax


def torque(
    calibration: Calibration,
    time: npt.ArrayLike,
    q: npt.ArrayLike,
    qd: npt.ArrayLike,
    qdd: npt.ArrayLike,
    tau: npt.ArrayLike | None = None,
    *,
    joint: int | str = 0,
    ax: Axes | None = None,
) -> Axes:
    """Torque of one joint over time with its 95 % interval, beside the measured one.

    Parameters
    ----------
    calibration : Calibration
    time : array_like, shape (N,)
        s.
    q, qd, qdd : array_like, shape (N, n)
        rad, rad/s, rad/s² (m for a slider).
    tau : array_like, shape (N, n), optional
        Measured torque, N·m or N.
    joint : int or str
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    own = _joint(calibration, joint)
    stamps = floats("time", time)
    if stamps.ndim != 1:
        raise ValueError(f"time has shape {stamps.shape}; give one stamp per sample")
    predicted = calibration.predict(*_samples(calibration, len(stamps), q=q, qd=qd, qdd=qdd))
    measured = [] if tau is None else _samples(calibration, len(stamps), tau=tau)
    ax = _axes(ax)
    ax.fill_between(
        stamps,
        predicted.low[:, own],
        predicted.high[:, own],
        color=_BLUE,
        alpha=0.25,
        linewidth=0.0,
        label="95 % interval",
    )
    ax.plot(stamps, predicted.mean[:, own], color=_BLUE, label="calibrated")
    for values in measured:
        ax.plot(stamps, values[:, own], color=_ORANGE, linewidth=0.8, label="measured")
    ax.set_xlabel("time [s]")
    ax.set_ylabel(_label(calibration, own, "torque"))
    ax.legend()
    return ax


def residual(
    calibration: Calibration,
    q: npt.ArrayLike,
    qd: npt.ArrayLike,
    qdd: npt.ArrayLike,
    tau: npt.ArrayLike,
    *,
    joint: int | str = 0,
    ax: Axes | None = None,
) -> Axes:
    """Measured less calibrated torque of one joint over its position.

    Parameters
    ----------
    calibration : Calibration
    q, qd, qdd, tau : array_like, shape (N, n)
        As in `torque`.
    joint : int or str
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    own = _joint(calibration, joint)
    *states, measured = _samples(calibration, None, q=q, qd=qd, qdd=qdd, tau=tau)
    left = measured - calibration.predict(*states).mean
    ax = _axes(ax)
    ax.plot(states[0][:, own], left[:, own], ".", markersize=2, color=_BLUE)
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.set_xlabel(_motion_label(calibration, own, "position"))
    ax.set_ylabel(_label(calibration, own, "residual torque"))
    return ax


def pair(
    calibration: Calibration,
    x: str,
    y: str,
    *,
    draws: int = 2000,
    seed: int = 1,
    ax: Axes | None = None,
) -> Axes:
    """Joint posterior draws of two coefficients.

    Parameters
    ----------
    calibration : Calibration
    x, y : str
        Names of terms.
    draws, seed : int
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    _require(calibration)
    drawn = calibration.draws(draws, seed=seed)
    for name in (x, y):
        if name not in drawn.terms:
            raise ValueError(f"there is no term {name!r}; see calibration.terms")
    ax = _axes(ax)
    columns = [drawn.coefficients[:, drawn.terms.index(name)] for name in (x, y)]
    ax.plot(*columns, ".", markersize=2, color=_BLUE, alpha=0.5)
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    return ax


def law(
    calibration: Calibration, joint: int | str = 0, *, along: str = "velocity", ax: Axes | None = None
) -> Axes:
    """Torque that was found on one joint as a function of its own position or velocity.

    Parameters
    ----------
    calibration : Calibration
    joint : int or str
    along : {"velocity", "position"}
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        Where no such law was found.
    """
    if along not in ("velocity", "position"):
        raise ValueError(f"along is {along!r}; give 'velocity' or 'position'")
    name = calibration.joint_names[_joint(calibration, joint)]
    curves = calibration._calibration.curves()
    own = [curve for curve in curves if curve[0] == name and curve[1] == along]
    if not own:
        raise ValueError(f"no effect of {name} depends on its {along} alone")
    _, _, components, x, mean, low, high = own[0]
    ax = _axes(ax)
    ax.fill_between(x, low, high, color=_BLUE, alpha=0.25, linewidth=0.0, label="95 % interval")
    ax.plot(x, mean, color=_BLUE, label=", ".join(components))
    number = calibration.joint_names.index(name)
    ax.set_xlabel(_motion_label(calibration, number, along))
    ax.set_ylabel(_label(calibration, number, "torque found"))
    ax.legend()
    return ax


def _label(calibration: Calibration, joint: int, what: str) -> str:
    names: list[Any] = [calibration.joint_names[joint], calibration.torque_units[joint]]
    return f"{what} of {names[0]} [{names[1]}]"


def _motion_label(calibration: Calibration, joint: int, along: str) -> str:
    """Position or velocity with its unit, of a slider in m."""
    unit = "m" if calibration.torque_units[joint] == "N" else "rad"
    return f"{along} of {calibration.joint_names[joint]} [{unit}{'/s' if along == 'velocity' else ''}]"

"""Decoys of a joint's motion."""

from __future__ import annotations

import numpy.typing as npt

from twincal import _twincal
from twincal._arrays import Floats, floats


def decoys(q: npt.ArrayLike, qd: npt.ArrayLike) -> Floats:
    """Functions of one joint's motion that no physical candidate is made of.

    {1, cos k q, sin k q; k = 1 … 8}, each alone and times tanh(q̇ / 0.02): what a model leaves
    along them comes again with the motion, and more rows of the same motion do not average it out.

    Parameters
    ----------
    q, qd : array_like, shape (n_samples,)
        Position, rad, and velocity, rad/s, of the joint whose torque is explained.

    Returns
    -------
    ndarray, shape (n_samples, 34)
        `decoys` of `SpikeSlabRegressor.fit`.

    Raises
    ------
    TypeError, ValueError
        For what is no array of numbers of that shape.
    """
    position, velocity = floats("q", q), floats("qd", qd)
    if position.ndim != 1 or position.shape != velocity.shape or not len(position):
        raise ValueError(
            f"q has shape {position.shape} and qd {velocity.shape}; "
            "give one position and one velocity per sample of one joint"
        )
    return _twincal.decoys(position, velocity).reshape(-1, len(position)).T

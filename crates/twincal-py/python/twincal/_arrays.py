"""Arrays of users as the contiguous doubles that the extension takes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def floats(name: str, values: npt.ArrayLike) -> Floats:
    """Numbers as doubles, without a copy where they are contiguous doubles already.

    Parameters
    ----------
    name : str
        What messages call the argument.
    values : array_like of numbers
        Any shape.

    Returns
    -------
    ndarray of float64
        C-contiguous, same shape.

    Raises
    ------
    TypeError
        For text, objects, complex numbers and ragged lists.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} is no array of numbers: {error}") from None
    if array.dtype.kind not in "fiub":
        raise TypeError(f"{name} is an array of {array.dtype}; give real numbers")
    return np.ascontiguousarray(array, dtype=np.float64).reshape(array.shape)


def states(dof: int, q: Any, qd: Any, qdd: Any) -> tuple[tuple[int, ...], list[Floats]]:
    """Positions, velocities and accelerations as one-dimensional arrays.

    Parameters
    ----------
    dof : int
        Number of moving joints n.
    q, qd, qdd : array_like, shape (..., n)
        The same shape.

    Returns
    -------
    shape : tuple of int
        Shape of q.
    arrays : list of three ndarray of float64
        One-dimensional, state * n + joint.

    Raises
    ------
    TypeError
        As `floats`.
    ValueError
        For a last dimension other than n and shapes that differ.
    """
    arrays = [floats(name, own) for name, own in (("q", q), ("qd", qd), ("qdd", qdd))]
    shape = arrays[0].shape
    for name, array in zip(("q", "qd", "qdd"), arrays, strict=True):
        if array.ndim == 0 or array.shape[-1] != dof:
            raise ValueError(
                f"{name} has shape {array.shape}; its last dimension must be the {dof} joints"
            )
        if array.shape != shape:
            raise ValueError(f"{name} has shape {array.shape}, q has {shape}; give equal shapes")
    return shape, [array.reshape(-1) for array in arrays]


def plain(value: Any) -> Any:
    """Settings without arrays and scalars of numpy, paths and tuples.

    Parameters
    ----------
    value : object
        A setting.

    Returns
    -------
    object
        What `json.dumps` takes.
    """
    import os

    if isinstance(value, dict):
        return {str(key): plain(own) for key, own in value.items() if own is not None}
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, (list, tuple, set, frozenset)):
        items = sorted(value) if isinstance(value, (set, frozenset)) else value
        return [plain(own) for own in items]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value


def as_json(settings: dict[str, Any]) -> str:
    """Settings as an object of JSON.

    Parameters
    ----------
    settings : dict
        By name; `None` leaves a setting out.

    Returns
    -------
    str

    Raises
    ------
    TypeError
        For a value that is no number, text, list or dict.
    ValueError
        For NaN and infinity.
    """
    import json

    try:
        return json.dumps(plain(settings), allow_nan=False)
    except TypeError as error:
        raise TypeError(f"a setting has a value of the wrong type: {error}") from None
    except RecursionError:
        raise ValueError("a setting holds itself") from None


def whole(name: str, value: object) -> int:
    """A whole number from 0 on.

    Parameters
    ----------
    name : str
        What messages call the argument.
    value : int

    Returns
    -------
    int

    Raises
    ------
    TypeError, ValueError
        For anything else.
    """
    import operator

    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{name} is of {type(value).__name__}; give a whole number") from None
    if not 0 <= number < 1 << 63:
        raise ValueError(f"{name} is {number}; give a whole number from 0 on")
    return number

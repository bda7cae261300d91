"""Logs: a file, arrays or a data frame."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from twincal import _twincal
from twincal._arrays import as_json, floats

_CHANNELS = ("q", "tau", "qd", "qdd")


class Log:
    """A recording of one motion: time, positions and torque of each joint.

    Parameters
    ----------
    time : array_like, shape (N,)
        Time stamps, s.
    q, tau : array_like, shape (N, n)
        Positions, rad or m, and measured torque, N·m or N; `tau=None` for a log that is only to be
        predicted.
    qd, qdd : array_like, shape (N, n), optional
        Velocities and accelerations; without them they are derived.
    names : sequence of str, optional
        Whose columns they are; without names they belong to the robot's joints in order.
    name : str
        What results and messages call the log.
    payload : dict or "unknown", optional
        What the robot carried: `{"mass": kg, "com": [x, y, z]}` in m.

    Raises
    ------
    TypeError, ValueError
        For arrays of other types and shapes.
    """

    def __init__(
        self,
        time: npt.ArrayLike,
        q: npt.ArrayLike,
        tau: npt.ArrayLike | None = None,
        qd: npt.ArrayLike | None = None,
        qdd: npt.ArrayLike | None = None,
        *,
        names: Sequence[str] | None = None,
        name: str = "log",
        payload: Mapping[str, Any] | str | None = None,
    ) -> None:
        columns = _columns(time, (q, tau, qd, qdd), names)
        own = _entry(payload=payload)
        self._log = _twincal.Log.arrays(_text("name", name), columns, [], own, "{}")

    @classmethod
    def _of(cls, log: _twincal.Log) -> Log:
        made = cls.__new__(cls)
        made._log = log
        return made

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        topic: str | Sequence[str] | None = None,
        columns: Mapping[str, Any] | None = None,
        payload: Mapping[str, Any] | str | None = None,
        **entry: Any,
    ) -> Log:
        """A log in a file: CSV, Parquet, Arrow, NPZ, MCAP, or the folder of a rosbag2.

        The file is read when a robot is there to match its columns with, that is by `fit`.

        Parameters
        ----------
        path : path
            The file or folder.
        topic : str or sequence of str, optional
            Topics of a bag.
        columns : dict, optional
            `[columns]` of `twincal.toml`: which column is which channel.
        payload : dict or "unknown", optional
            As for `Log`.
        **entry
            Other keys of `[[log]]`: `rate_hz`, `lenient`, `preset`, `torque`, `gear_ratio` …

        Returns
        -------
        Log

        Raises
        ------
        twincal.errors.SystemError
            If there is no such file.
        """
        from twincal.errors import SystemError

        place = os.fspath(path)
        if not isinstance(place, str):
            raise TypeError("path is of bytes; give text or a pathlib.Path")
        if "\0" in place or not os.path.exists(place):
            raise SystemError(f"{place}: there is no such file or folder", "give an existing log")
        topic = [topic] if isinstance(topic, str) else topic
        own = _entry(topic=topic, payload=payload, **entry)
        return cls._of(_twincal.Log.file(place, own, as_json(dict(columns or {}))))

    @classmethod
    def from_dataframe(
        cls,
        frame: Any,
        *,
        name: str = "table",
        columns: Mapping[str, Any] | None = None,
        payload: Mapping[str, Any] | str | None = None,
    ) -> Log:
        """A log in a data frame of pandas, polars, pyarrow or DuckDB.

        Columns are named as in files: `t`, `q1` …, `tau1` … or `elbow.q`, `elbow.tau`. Types are
        those of Parquet files: whole numbers, floats, decimals, and time stamps with their unit.
        Columns of other types are passed over, unless a channel has their name: then `fit` refuses.

        Parameters
        ----------
        frame : object
            With `__arrow_c_stream__` (Arrow PyCapsule interface), or a mapping of names to arrays.
        name : str
            What results and messages call the log.
        columns, payload
            As for `read`.

        Returns
        -------
        Log

        Raises
        ------
        TypeError
            For something that is no table.
        """
        said, own = as_json(dict(columns or {})), _entry(payload=payload)
        name = _text("name", name)
        is_frame = type(frame).__module__.split(".")[0] == "pandas"
        if hasattr(frame, "__arrow_c_stream__") and not (is_frame and not _has("pyarrow")):
            stream = frame.__arrow_c_stream__()
            return cls._of(_twincal.Log.table(name, stream, own, said))
        if isinstance(frame, Mapping) or is_frame:
            named = [
                (_text("a column's name", key), np.ravel(floats(f"column {key!r}", frame[key])))
                for key in frame
            ]
            return cls._of(_twincal.Log.arrays(name, named, [], own, said))
        raise TypeError(f"{type(frame).__name__} is no table; give a data frame with Arrow support")

    def __reduce__(self) -> tuple[Any, ...]:
        log = self._log
        path = self.path
        columns = (log.in_memory(), log.others()) if path is None else None
        return (_restored, (path or log.name, columns, log.entry, log.columns))

    @property
    def name(self) -> str:
        """Name as it was given."""
        return self._log.name

    @property
    def path(self) -> str | None:
        """The file; `None` for what is in memory."""
        path = self._log.path
        return None if path is None else os.fspath(path)

    def __repr__(self) -> str:
        return f"<twincal.Log {self.name!r}>"


def _restored(
    name: str,
    columns: tuple[list[tuple[str, Any]], list[tuple[str, str]]] | None,
    entry: str,
    said: str,
) -> Log:
    """A log that was pickled; `columns` are those with numbers and the others."""
    if columns is None:
        return Log._of(_twincal.Log.file(name, entry, said))
    return Log._of(_twincal.Log.arrays(name, *columns, entry, said))


def _has(module: str) -> bool:
    from importlib.util import find_spec

    return find_spec(module) is not None


def _text(what: str, value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{what} is of {type(value).__name__}; give text")
    return value


def _entry(**keys: Any) -> str:
    """Keys of `[[log]]` as an object of JSON."""
    return as_json({key: value for key, value in keys.items() if value is not None})


def _columns(
    time: npt.ArrayLike,
    channels: tuple[npt.ArrayLike | None, ...],
    names: Sequence[str] | None,
) -> list[tuple[str, npt.NDArray[np.float64]]]:
    """Arrays as named columns, as a table has them."""
    stamps = floats("time", time)
    if stamps.ndim != 1:
        raise ValueError(f"time has shape {stamps.shape}; give one stamp per sample")
    if channels[0] is None:
        raise TypeError("q is None; give positions")
    if isinstance(names, str):
        raise TypeError("names is text; give a list of joint names")
    own_names = None if names is None else [_text("a name", own) for own in names]
    columns = [("t", stamps)]
    joints = None
    for channel, values in zip(_CHANNELS, channels, strict=True):
        if values is None:
            continue
        array = floats(channel, values)
        array = array[:, None] if array.ndim == 1 else array
        if array.ndim != 2 or len(array) != len(stamps):
            raise ValueError(
                f"{channel} has shape {array.shape}; give {len(stamps)} samples × joints"
            )
        joints = array.shape[1] if joints is None else joints
        if array.shape[1] != joints:
            raise ValueError(f"{channel} has {array.shape[1]} joints, q has {joints}")
        if own_names is not None and len(own_names) != joints:
            raise ValueError(f"{len(own_names)} names for {joints} joints")
        for joint in range(joints):
            label = f"{channel}{joint + 1}" if own_names is None else f"{own_names[joint]}.{channel}"
            columns.append((label, np.ascontiguousarray(array[:, joint])))
    if own_names is not None and len(set(own_names)) != len(own_names):
        raise ValueError("two joints have one name")
    return columns

"""A fit and its result."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from io import StringIO
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from twincal import _twincal, errors
from twincal._arrays import Floats, as_json, states, whole
from twincal._log import Log
from twincal._robot import Robot
from twincal._table import Assessment, Table

if TYPE_CHECKING:
    import xarray

Progress = Callable[[str, int, int], object]


class Torque(NamedTuple):
    """Torque of states with its 95 % interval; all arrays have the shape of q."""

    mean: Floats
    """Model plus the mean of what was found, N·m or N."""
    low: Floats
    """Lower end of the central 95 % interval of measured torque."""
    high: Floats
    """Upper end."""
    outside: npt.NDArray[np.bool_]
    """The joint is where the logs have not been, or its torque is less certain than the noise."""


class LogTorque(NamedTuple):
    """Torque of a log, filtered as in the fit; N rows and n joints."""

    time: Floats
    """s, shape (N,)."""
    measured: Floats
    """Torque of the log, shape (N, n); NaN where there is none."""
    nominal: Floats
    """Torque of the model alone."""
    mean: Floats
    """Model plus the mean of what was found, N·m or N."""
    low: Floats
    """Lower end of the central 95 % interval of measured torque."""
    high: Floats
    """Upper end."""
    outside: npt.NDArray[np.bool_]
    """Some joint is where the logs of the fit have not been, shape (N,)."""


class Draws(NamedTuple):
    """Independent draws from the posterior."""

    coefficients: Floats
    """β, shape (draws, terms); exactly 0 where the term is out."""
    included: npt.NDArray[np.bool_]
    """Whether the term is in, shape (draws, terms)."""
    noise: Floats
    """Variance φ of each draw, (N·m)², shape (draws,)."""
    terms: list[str]
    """Names of the terms."""


def robot_of(robot: Robot) -> _twincal.Robot:
    """The robot of the extension."""
    if not isinstance(robot, Robot):
        raise TypeError(f"robot is of {type(robot).__name__}; give a twincal.Robot")
    return robot._robot


def logs_of(what: str, logs: Log | Iterable[Log]) -> list[Log]:
    """Logs as a list, whether one or several were given."""
    if isinstance(logs, Log):
        return [logs]
    if isinstance(logs, (str, bytes, os.PathLike)) or not isinstance(logs, Iterable):
        raise TypeError(f"{what} is of {type(logs).__name__}; give twincal.Log.read(path) or a list")
    own = list(logs)
    for log in own:
        if not isinstance(log, Log):
            raise TypeError(f"{what} holds a {type(log).__name__}; give twincal.Log objects")
    return own


def fit(
    robot: Robot,
    logs: Log | Iterable[Log],
    *,
    heldout: Log | Iterable[Log] = (),
    progress: Progress | bool | None = None,
    **settings: Any,
) -> Calibration:
    """Finds what the robot's model misses in logs, and says how well the calibrated model predicts.

    Other threads of Python run meanwhile. Ctrl-C ends it.

    Parameters
    ----------
    robot : Robot
    logs : Log or sequence of Log
        Logs that are fitted.
    heldout : Log or sequence of Log
        Logs that are predicted and never fitted; without any, parts of the fitted ones are left out
        in turn.
    progress : callable or bool, optional
        Called with a stage and how many of how many of its parts are done. `True`: a bar of tqdm,
        where that is installed.
    **settings
        Keys of `twincal.toml`: `cutoff_hz=0`, `generic=False`, `seed=7`. A key that several tables
        have goes into its table: `prior={"families": {"spring": 0.5}}`.

    Returns
    -------
    Calibration

    Raises
    ------
    TypeError, ValueError
        For arguments that are no robot, logs or settings.
    twincal.errors.SettingError
        For a setting that does not exist, with the nearest name, or is out of range.
    twincal.errors.RefusedError
        Where the data cannot answer.
    """
    own = [log._log for log in logs_of("logs", logs)]
    held_out = [log._log for log in logs_of("heldout", heldout)]
    said = as_json(settings)
    with _progress(progress) as watch:
        return Calibration(_twincal.fit(robot_of(robot), own, held_out, said, watch))


@contextmanager
def _progress(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """The callable that hears of stages."""
    if progress is None or progress is False:
        yield None
    elif callable(progress):
        yield progress
    elif progress is True:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            yield None
            return
        with tqdm(total=1, unit="part", leave=False) as bar:

            def show(stage: str, done: int, parts: int) -> None:
                bar.set_description(stage)
                bar.total = max(parts, 1)
                bar.n = done
                bar.refresh()

            yield show
    else:
        raise TypeError(f"progress is of {type(progress).__name__}; give a callable or True")


class Calibration:
    """The result of a fit: what is missing from the model, and torque with intervals.

    Made by `fit`, `Statistics.fit` or `Calibration.load`.
    """

    def __init__(self, calibration: _twincal.Calibration) -> None:
        if not isinstance(calibration, _twincal.Calibration):
            raise TypeError("a Calibration is made by twincal.fit or Calibration.load")
        self._calibration = calibration

    # ---- files

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Calibration:
        """Reads the folder that `save` or the program wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        Calibration

        Raises
        ------
        twincal.errors.SystemError, twincal.errors.ContentError
            For a folder that holds no result, or a damaged one.
        """
        return cls(_twincal.Calibration.load(os.fspath(path)))

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Writes the folder that the program writes, complete or not at all.

        Parameters
        ----------
        path : path
            A folder that is not there yet.
        force : bool
            Replace an earlier result there.

        Raises
        ------
        twincal.errors.SystemError, twincal.errors.ContentError
            For a folder that is there, or cannot be written.
        """
        self._calibration.save(os.fspath(path), force)

    def to_json(self) -> str:
        """The result as a program reads it.

        Returns
        -------
        str
            The text of result.json, as `save` writes it.
        """
        return self._calibration.result_json()

    def report(self, path: str | os.PathLike[str] | None = None) -> str:
        """The report as one page of HTML that needs no network.

        Parameters
        ----------
        path : path, optional
            Where it is written too.

        Returns
        -------
        str
            The page.

        Raises
        ------
        twincal.errors.SystemError
            For a file that cannot be written.
        """
        place = None if path is None else os.fspath(path)
        page = self._calibration.html()
        if place is not None:
            try:
                with open(place, "w", encoding="utf-8") as file:
                    file.write(page)
            except OSError as error:
                problem = f"{place}: cannot be written: {error.strerror}"
                raise errors.SystemError(problem, "give the path of a file") from None
        return page

    # ---- tables

    @property
    def joint_names(self) -> list[str]:
        """Names of the n moving joints."""
        return self._calibration.joint_names

    @property
    def torque_units(self) -> list[str]:
        """Unit of each joint's torque, "N·m" or "N"."""
        return self._calibration.torque_units

    @property
    def assessment(self) -> Assessment:
        """May the twin be used, and why."""
        return Assessment(*self._calibration.assessment())

    @property
    def effects(self) -> Table:
        """One row for each parameter of each candidate effect.

        Columns: component, family, status, pip, parameter, unit, mean, sd, median, low95, high95,
        words. Numbers are given that the effect is in.
        """
        return Table(self._calibration.effects())

    @property
    def terms(self) -> Table:
        """One row for each term of the regression.

        Columns: term, family, unit, pip, pip_mcse, mean, sd, low95, high95, conditional_mean,
        conditional_sd, observable, words. `mean`, `sd` and the interval are over all models.
        """
        return Table(self._calibration.terms())

    @property
    def validation(self) -> Table:
        """Held-out scores, one row for each joint and set of rows (`rows_of`).

        Columns: joint, rows_of, rows, rmse_nominal, rmse_calibrated, bias, coverage95,
        mean_width95, interval_score95, torque_sd, epistemic_share; N·m or N, shares 0 … 1.
        """
        return Table(self._calibration.validation())

    @property
    def findings(self) -> Table:
        """What was dropped, assumed or doubted: code, severity, subject, message, count."""
        return Table(self._calibration.findings())

    # ---- torque and draws

    def predict(self, q: npt.ArrayLike, qd: npt.ArrayLike, qdd: npt.ArrayLike) -> Torque:
        """Torque of states by the calibrated model.

        Parameters
        ----------
        q, qd, qdd : array_like, shape (..., n)
            Positions, velocities, accelerations: rad, rad/s, rad/s² (m for a slider).

        Returns
        -------
        Torque
            mean, low, high, outside; each of the shape of q.

        Raises
        ------
        TypeError, ValueError
            For arrays of other types and shapes.
        twincal.errors.SettingError
            For a number that is not finite.
        """
        shape, (own_q, own_qd, own_qdd) = states(len(self.joint_names), q, qd, qdd)
        mean, low, high, outside = self._calibration.predict(own_q, own_qd, own_qdd)
        return Torque(
            mean.reshape(shape), low.reshape(shape), high.reshape(shape), outside.reshape(shape)
        )

    def draws(self, n: int = 1000, *, seed: int = 1) -> Draws:
        """Independent draws of the coefficients.

        Parameters
        ----------
        n : int
            How many.
        seed : int
            The same seed gives the same draws.

        Returns
        -------
        Draws

        Raises
        ------
        ValueError
            For a negative number.
        """
        count, start = whole("n", n), whole("seed", seed)
        names = self._calibration.column_names
        beta, noise, _ = self._calibration.draws(count, start)
        beta = beta.reshape(count, len(names))
        return Draws(beta, beta != 0.0, noise, names)

    # ---- the program's other commands

    def export(
        self, path: str | os.PathLike[str], *, to: str, force: bool = False, draws: int | None = None
    ) -> dict[str, Any]:
        """Writes the calibrated model, code, or the table of effects, as `twincal export` does.

        Parameters
        ----------
        path : path
            File, or with `draws` folder.
        to : str
            "urdf", "mjcf", "c", "rust", "python", "json" or "csv".
        force : bool
            Replace what is there.
        draws : int, optional
            Write so many models drawn from the posterior.

        Returns
        -------
        dict
            What `twincal export --json` prints.

        Raises
        ------
        twincal.Error
            Why it could not be written.
        """
        with self._folder() as twin:
            more = ["--draws", str(whole("draws", draws))] if draws is not None else []
            arguments = ["export", "--twin", twin, "--to", to, "-o", os.fspath(path), "--json"]
            return _run([*arguments, *more, *(["--force"] if force else [])])[1]

    def predict_log(self, log: Log) -> LogTorque:
        """Torque of a log, as `twincal predict` does: velocity and acceleration where it has none.

        Parameters
        ----------
        log : Log
            Positions over time; torque is not needed. It is read as by `fit`: `columns`, `payload`
            and the other keys of the log hold.

        Returns
        -------
        LogTorque

        Raises
        ------
        twincal.Error
            For a log that cannot be used.
        """
        with self._folder() as twin, _files(logs_of("log", log)) as files:
            place = twin + ".csv"
            _twincal.call(["predict", "--twin", twin, "--output", place, *files])
            with open(place, encoding="utf-8", newline="") as file:
                next(csv.reader(file))  # names, which may hold line feeds
                text = file.read()
        text = text.replace("false", "0").replace("true", "1")
        while ",," in text:  # no measured torque
            text = text.replace(",,", ",nan,")
        rows = np.loadtxt(StringIO(text), delimiter=",", ndmin=2)
        joints = rows[:, 1:-1].reshape(len(rows), len(self.joint_names), 5)
        measured, nominal, mean, low, high = np.ascontiguousarray(np.moveaxis(joints, 2, 0))
        return LogTorque(rows[:, 0].copy(), measured, nominal, mean, low, high, rows[:, -1] == 1.0)

    def check(self, logs: Log | Iterable[Log]) -> dict[str, Any]:
        """Scores the twin on new logs, as `twincal check` does.

        Parameters
        ----------
        logs : Log or sequence of Log
            Read as by `fit`: `columns`, `payload` and the other keys of each log hold.

        Returns
        -------
        dict
            What `twincal check --json` prints; `passed` is the answer.

        Raises
        ------
        twincal.Error
            For logs that cannot be used.
        """
        with self._folder() as twin, _files(logs_of("logs", logs)) as files:
            return _run(["check", "--twin", twin, "--json", *files])[1]

    def diff(self, other: Calibration) -> dict[str, Any]:
        """What changed from this twin to another one of the same robot, as `twincal diff` says it.

        Parameters
        ----------
        other : Calibration

        Returns
        -------
        dict
            What `twincal diff --json` prints.

        Raises
        ------
        twincal.Error
            For twins of different robots.
        """
        if not isinstance(other, Calibration):
            raise TypeError(f"other is of {type(other).__name__}; give a Calibration")
        with self._folder() as before, other._folder() as after:
            return _run(["diff", before, after, "--json"])[1]

    @contextmanager
    def _folder(self) -> Iterator[str]:
        """The result in a folder of its own."""
        from tempfile import TemporaryDirectory

        with TemporaryDirectory(prefix="twincal-") as folder:
            place = os.path.join(folder, "twin")
            self.save(place)
            yield place

    # ---- ArviZ, notebooks

    def to_datatree(
        self, log: tuple[Any, ...] | None = None, *, draws: int = 1000, chains: int = 4, seed: int = 1
    ) -> xarray.DataTree:
        """The result in the schema of ArviZ.

        Parameters
        ----------
        log : tuple of array_like (time, q, qd, qdd, tau), optional
            States and measured torque, shapes (N,) and (N, n), for the groups posterior_predictive
            and observed_data.
        draws, chains : int
            Independent draws in as many chains.
        seed : int
            The same seed gives the same draws.

        Returns
        -------
        xarray.DataTree
            Groups posterior (`beta`: chain, draw, term; `included`: chain, draw, component),
            sample_stats, constant_data; with a log posterior_predictive and observed_data
            (`tau`: chain, draw, time, joint).

        Raises
        ------
        ImportError
            Without xarray.
        """
        from twincal._datatree import datatree

        return datatree(self, log, (chains, draws), seed)

    def __repr__(self) -> str:
        return f"<twincal.Calibration of {self._calibration.robot_name!r}: {self.assessment.headline}>"

    def _repr_html_(self) -> str:
        return self.assessment._repr_html_() + self.effects._repr_html_()


def _run(arguments: list[str]) -> tuple[int, dict[str, Any]]:
    """A command of the program: exit code and what it prints as JSON."""
    code, text = _twincal.call(arguments)
    return code, json.loads(text)


@contextmanager
def _files(logs: list[Log]) -> Iterator[list[str]]:
    """Last arguments of a command that reads logs: how they are read, then their paths.

    Logs in memory are written for as long as it takes.
    """
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(prefix="twincal-") as folder:
        paths, read_as = [], []
        for number, log in enumerate(logs):
            path = log.path
            if path is None:
                path = os.path.join(folder, f"{number}.npz")
                np.savez(path, allow_pickle=False, **_arrays(log))
            paths.append(path)
            # Paths in a config are relative to its folder.
            place = os.path.abspath(path)
            read_as.append(_twincal.Log.file(place, log._log.entry, log._log.columns))
        config = os.path.join(folder, "twincal.toml")
        with open(config, "w", encoding="utf-8") as file:
            file.write(_twincal.log_settings(read_as))
        yield ["--config", config, "--", *paths]


def _arrays(log: Log) -> dict[str, npt.NDArray[Any]]:
    """Columns of a log in memory by name; those that hold no numbers as text, which readers refuse."""
    own: dict[str, npt.NDArray[Any]] = dict(log._log.in_memory())
    rows = max((len(values) for values in own.values()), default=0)
    return own | {name: np.full(rows, what) for name, what in log._log.others()}

"""Statistics of logs: what a fit takes of each, which adds."""

from __future__ import annotations

import os
from collections.abc import Iterable
from functools import reduce
from typing import Any

from twincal import _twincal
from twincal._arrays import as_json
from twincal._calibration import Calibration, logs_of, robot_of
from twincal._log import Log
from twincal._robot import Robot


class Plan:
    """How logs of one robot become statistics: filters, rates, candidates. Made by `Statistics.plan`."""

    def __init__(self, plan: _twincal.Plan) -> None:
        if not isinstance(plan, _twincal.Plan):
            raise TypeError("a Plan is made by Statistics.plan")
        self._plan = plan

    def __repr__(self) -> str:
        return "<twincal.Plan>"


class Statistics:
    """Sums over the rows of one log or of several: a fit needs nothing else of them.

    `Statistics.plan` chooses how logs become statistics, `Statistics.map` makes those of one log,
    `merge` adds, `fit` fits. The order of merging changes no bit of the result.

    Attributes
    ----------
    log_names : list of str
        The logs behind the sums.
    """

    def __init__(self, statistics: _twincal.Statistics) -> None:
        if not isinstance(statistics, _twincal.Statistics):
            raise TypeError("Statistics are made by Statistics.map, merge or read")
        self._statistics = statistics

    @staticmethod
    def plan(robot: Robot, logs: Log | Iterable[Log], **settings: Any) -> Plan:
        """Chooses how these logs, and others of the same robot, become statistics.

        Parameters
        ----------
        robot : Robot
        logs : Log or sequence of Log
        **settings
            As for `fit`.

        Returns
        -------
        Plan

        Raises
        ------
        twincal.Error
            As `fit`.
        """
        own = [log._log for log in logs_of("logs", logs)]
        return Plan(_twincal.plan(robot_of(robot), own, as_json(settings)))

    @classmethod
    def map(cls, robot: Robot, log: Log, plan: Plan) -> Statistics:
        """Statistics of one log under a plan.

        Parameters
        ----------
        robot : Robot
        log : Log
        plan : Plan

        Returns
        -------
        Statistics

        Raises
        ------
        twincal.Error
            For a log that cannot be used.
        """
        if not isinstance(log, Log) or not isinstance(plan, Plan):
            raise TypeError("give one Log and the Plan that Statistics.plan returned")
        return cls(_twincal.Statistics.map(robot_of(robot), log._log, plan._plan))

    def merge(self, *others: Statistics) -> Statistics:
        """Adds statistics of other logs with the same plan.

        Parameters
        ----------
        *others : Statistics

        Returns
        -------
        Statistics
            The sum; this object stays as it is.

        Raises
        ------
        twincal.errors.UsageError
            For another plan or robot, and for a log that is in both.
        """
        if not all(isinstance(other, Statistics) for other in others):
            raise TypeError("give Statistics")
        own = (other._statistics for other in others)
        return Statistics(reduce(lambda sum_, one: sum_.merge(one), own, self._statistics))

    def fit(self, *, heldout: Log | Iterable[Log] = (), **settings: Any) -> Calibration:
        """Fits the statistics.

        Parameters
        ----------
        heldout : Log or sequence of Log
            Logs that are predicted and never fitted.
        **settings
            As for `fit`; what the plan decided stays.

        Returns
        -------
        Calibration

        Raises
        ------
        twincal.Error
            As `fit`.
        """
        own = [log._log for log in logs_of("heldout", heldout)]
        return Calibration(_twincal.fit_statistics(self._statistics, own, as_json(settings)))

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Statistics:
        """Reads a file that `write` or `twincal statistics` wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        Statistics

        Raises
        ------
        twincal.errors.SystemError, twincal.errors.ContentError
            For a file that cannot be read, is damaged, or of another format.
        """
        return cls(_twincal.Statistics.read(os.fspath(path)))

    def write(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Writes a file, complete or not at all.

        Parameters
        ----------
        path : path
            A file that is not there yet.
        force : bool
            Replace an earlier one.

        Raises
        ------
        twincal.errors.SystemError, twincal.errors.ContentError
            For a file that is there, or cannot be written.
        """
        self._statistics.write(os.fspath(path), force)

    @property
    def log_names(self) -> list[str]:
        """Names of the logs behind the sums."""
        return self._statistics.log_names

    def __repr__(self) -> str:
        return f"<twincal.Statistics of {', '.join(self.log_names)}>"

"""The posterior of a fleet: `twincal fleet` from Python."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twincal import _twincal

if TYPE_CHECKING:
    import pandas as pd

_JSON = "fleet.json"
_PAGE = "fleet.html"


class Fleet:
    """Posterior of a fleet: what is wrong for all robots, which robots deviate, since when.

    Attributes
    ----------
    folder : pathlib.Path
        Where `fleet.json` and `fleet.html` are.
    type_effects : list of dict
        What is wrong with the model file of all robots, most likely first: `effect`, `family`,
        `story`, `pip`, `parameters`, `scatter`.
    units : list of dict
        Robots, those that deviate first: `robot`, `deviates`, `pip`, `deviations`, `rows`, `logs`.
    left_out : list of dict
        Logs that do not count: `robot`, `log`, `code`, `reason`.
    windows : list of dict
        Windows that hold logs: `start`.
    corrected_model : pathlib.Path or None
        The model file with what is established for all robots; None where no physical one was found.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        read: dict[str, Any] = json.loads((self.folder / _JSON).read_text(encoding="utf-8"))
        self.type_effects: list[dict[str, Any]] = read["type_effects"]
        self.units: list[dict[str, Any]] = read["units"]
        self.left_out: list[dict[str, Any]] = read["left_out"]
        self.windows: list[dict[str, Any]] = read["windows"]
        file: str | None = read["corrected_model"]["file"]
        self.corrected_model: Path | None = self.folder / file if file else None

    @property
    def deviating(self) -> list[str]:
        """Names of the robots that deviate, most likely first."""
        return [unit["robot"] for unit in self.units if unit["deviates"]]

    @property
    def report(self) -> Path:
        """The page, `fleet.html`."""
        return self.folder / _PAGE

    def to_pandas(self) -> pd.DataFrame:
        """One row per robot and deviation; a robot without one has a row with its probability.

        Returns
        -------
        pandas.DataFrame
            Columns `robot`, `deviates`, `pip`, `effect`, `effect_pip`, `parameter`, `value`, `unit`,
            `low`, `high` (95 %), `since` (UTC).
        """
        import pandas as pd

        frame = pd.DataFrame(
            [row for unit in self.units for row in _rows(unit)],
            columns=["robot", "deviates", "pip", "effect", "effect_pip", "parameter", "value", "unit",
                     "low", "high", "since"],
        )  # fmt: skip
        frame["since"] = pd.to_datetime(frame["since"], utc=True)
        return frame

    def __repr__(self) -> str:
        return f"<twincal.fleet.Fleet of {len(self.units)} robots: {len(self.deviating)} deviate>"


def _rows(unit: dict[str, Any]) -> list[dict[str, Any]]:
    about = {key: unit[key] for key in ("robot", "deviates", "pip")}
    rows = []
    for own in unit["deviations"]:
        effect = {"effect": own["effect"], "effect_pip": own["pip"], "since": own["since"]}
        for value in own["parameters"] or [{}]:
            low, high = value.get("interval95", (None, None))
            rows.append(about | effect | {"parameter": value.get("name"), "value": value.get("value"),
                                          "unit": value.get("unit"), "low": low, "high": high})  # fmt: skip
    return rows or [about]


def plan(
    logs: Iterable[str | os.PathLike[str]],
    model: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    config: str | os.PathLike[str] | None = None,
) -> Path:
    """How logs of a fleet become statistics, from some logs of one robot: `twincal statistics --plan fleet`.

    Parameters
    ----------
    logs : iterable of paths
        Logs of one robot. Of several robots the plan is worse: what robots differ in looks like noise.
    model : path
        URDF or MJCF.
    output : path
        Folder for `plan.json` and the statistics of these logs.
    config : path, optional
        A `twincal.toml`.

    Returns
    -------
    pathlib.Path
        `plan.json`, for `statistics`.

    Raises
    ------
    twincal.Error
        For logs or a model that cannot be used.
    """
    settings = ["--no-config"] if config is None else ["--config", os.fspath(config)]
    arguments = ["statistics", "--plan", "fleet", "--model", os.fspath(model), *settings]
    paths = [os.fspath(path) for path in _paths("logs", logs)]
    _twincal.call([*arguments, "-o", os.fspath(output), "--", *paths])
    return Path(output) / "plan.json"


def _paths(
    name: str, paths: Iterable[str | os.PathLike[str]]
) -> list[str | os.PathLike[str]]:
    """A list of at least one path."""
    if isinstance(paths, (str, bytes, os.PathLike)):
        raise TypeError(f"{name} is one path; give a list of paths")
    given = list(paths)
    if not given:
        raise ValueError(f"{name} is empty; give at least one path")
    return given


def fit(
    statistics: Iterable[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    window: str = "7d",
    fdr: float = 0.05,
    seed: int = 1,
    type_twin: str | os.PathLike[str] | None = None,
    twins: Mapping[str, str | os.PathLike[str]] | None = None,
    force: bool = False,
) -> Fleet:
    """One posterior over the robots of a type, as `twincal fleet` computes it.

    Parameters
    ----------
    statistics : iterable of paths
        Local files of `twincal statistics`, `Statistics.write` or `twincal.fleet.statistics`, of
        three robots at least, all with one plan.
    output : path
        Folder for `fleet.json` and `fleet.html`.
    window : str
        Length of a window; a change begins with one: "7d", "12h".
    fdr : float
        Expected share of named robots that do not deviate, at most.
    seed : int
        Seed of all random numbers.
    type_twin : path, optional
        Folder for the twin of the type: what a robot does of which no log is there.
        `Calibration.load` reads it.
    twins : mapping of robot to path, optional
        Folders for the twins of these robots, each as it is in its last window.
    force : bool
        Replace an earlier result.

    Returns
    -------
    Fleet

    Raises
    ------
    twincal.Error
        For files that are none, fewer than three robots, a folder that is there already.
    """
    files = [os.fspath(path) for path in _paths("statistics", statistics)]
    arguments = ["fleet", "--json", "-o", os.fspath(output), "--window", window]
    arguments += ["--fdr", repr(float(fdr)), "--seed", str(int(seed))]
    if type_twin is not None:
        arguments += ["--type-twin", os.fspath(type_twin)]
    for robot, folder in (twins or {}).items():
        arguments += ["--twin", f"{robot}={os.fspath(folder)}"]
    _twincal.call([*arguments, *(["--force"] if force else []), "--", *files])
    return Fleet(output)

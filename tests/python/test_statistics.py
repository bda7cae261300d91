"""Statistics of real logs: a fit to them is the fit to the logs. Truth: the fit to the logs themselves, and the schema."""

import json

import pytest
from conftest import ROOT, SHARED, twincal
from test_result_schema import problems

CASES = {
    "ur10": ("model.urdf", ["run0.parquet"], [], None),
    "double_pendulum": (
        "model_as_published.urdf",
        [f"run{number}.csv" for number in range(2, 8)],
        ["run0.csv", "run1.csv"],
        ROOT / "examples" / "double_pendulum" / "twincal.toml",
    ),
}


def pairs(a, b, place=""):
    """Every number of two values of the same form."""
    if isinstance(a, dict):
        assert a.keys() == b.keys(), place
        for key in a:
            yield from pairs(a[key], b[key], f"{place}/{key}")
    elif isinstance(a, list):
        assert len(a) == len(b), place
        for index, (x, y) in enumerate(zip(a, b)):
            yield from pairs(x, y, f"{place}/{index}")
    elif isinstance(a, (int, float)) and not isinstance(a, bool) and b is not None:
        yield place, a, b
    else:
        assert a == b, place


@pytest.mark.parametrize("robot", CASES)
def test_a_fit_to_statistics_is_the_fit_to_the_logs(robot, tmp_path):
    data = SHARED / robot
    if not data.is_dir():
        pytest.skip(f"../shared/data/{robot} is not there")
    model, logs, heldout, config = CASES[robot]
    logs, heldout = [data / log for log in logs], [data / log for log in heldout]
    settings = ["--config", config] if config else ["--no-config"]
    tested = ["--heldout", *heldout] if heldout else []
    twincal("statistics", *logs, "--model", data / model, *settings, "-o", tmp_path / "st")
    files = sorted((tmp_path / "st").glob("*.arrow"))
    assert len(files) == len(logs) and all(file.stat().st_size < 5e6 for file in files)
    twincal("fit", *logs, "--model", data / model, *settings, *tested, "-o", tmp_path / "whole")
    twincal("fit", "--statistics", *files, *settings, *tested, "-o", tmp_path / "own")
    whole, own = (json.loads((tmp_path / name / "result.json").read_text()) for name in ("whole", "own"))
    same = ["components", "terms", "groups", "noise", "prior", "likelihood", "curves", "inference"]
    for key in same + (["validation"] if heldout else []):
        for place, a, b in pairs(whole[key], own[key], key):
            # 1e-11: a centre of mass of -1 mm has an interval of ± 2 m
            assert a == pytest.approx(b, rel=1e-9, abs=1e-11), place
    assert problems(whole) == problems(own) == []
    assert not [finding for finding in whole["findings"] if finding["code"].startswith("ripple_")]
    assert own["validation"]["split"] == ("heldout_logs" if heldout else "not_tested")
    assert own["assessment"]["answer"] in ("yes", "yes_within_limits", "not_yet", "no")
    if not heldout:
        assert (own["assessment"]["answer"], own["assessment"]["reason"]) == ("not_yet", "not_tested")

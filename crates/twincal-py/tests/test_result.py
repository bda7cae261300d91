"""Tables, figures, ArviZ, exports and commands on a result."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import twincal
from conftest import SETTINGS


def test_tables_are_those_of_result_json(result):
    theirs = json.loads(result.to_json())
    terms = result.terms.to_dict()
    assert terms["term"] == [own["name"] for own in theirs["terms"]]
    for own, value in zip(theirs["terms"], terms["pip"], strict=True):
        assert own["pip"] == value or (own["pip"] is None and np.isnan(value))
    assert result.assessment.answer == theirs["assessment"]["answer"]
    rows = result.validation.to_dict()
    filtered = theirs["validation"]["joints"]
    own = [x for x, of in zip(rows["rmse_calibrated"], rows["rows_of"]) if of == "filtered"]
    assert own == [joint["rmse_calibrated"] for joint in filtered]
    with pytest.raises(KeyError):
        result.terms["none"]


def test_tables_in_other_libraries(result):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    pyarrow = pytest.importorskip("pyarrow")
    for table in (result.effects, result.terms, result.validation, result.findings, result.assessment):
        frame, other, arrow = table.to_pandas(), table.to_polars(), pyarrow.table(table)
        assert isinstance(frame, pandas.DataFrame) and isinstance(other, polars.DataFrame)
        assert list(frame.columns) == other.columns == arrow.column_names == table.column_names
        assert len(frame) == other.height == arrow.num_rows == len(table)
    terms = pyarrow.table(result.terms)["mean"].to_numpy()
    assert np.array_equal(terms, result.terms["mean"], equal_nan=True)
    assert "<table>" in result._repr_html_() and repr(result) and repr(result.terms)


def test_a_table_in_the_memory_of_others_is_a_log(arm, robot):
    polars, pyarrow = pytest.importorskip("polars"), pytest.importorskip("pyarrow")
    frame = polars.read_csv(arm.folder / "run1.csv")
    fits = [
        twincal.fit(robot, twincal.Log.from_dataframe(own), **SETTINGS)
        for own in (frame, frame.to_arrow(), pyarrow.table(frame).slice(0, len(frame)))
    ]
    for other in fits[1:]:
        assert np.array_equal(other.terms["mean"], fits[0].terms["mean"], equal_nan=True)
    for wrong in (frame["t"], frame.select("t"), frame.head(0), 3):
        with pytest.raises((TypeError, ValueError, twincal.Error)):
            twincal.fit(robot, twincal.Log.from_dataframe(wrong))


def test_exports_and_gates(arm, result):
    for to, ending in [("urdf", "urdf"), ("c", "c"), ("python", "py"), ("json", "json"), ("csv", "csv")]:
        place = arm.folder / f"out.{ending}"
        said = result.export(place, to=to)
        assert place.stat().st_size > 100 and said["schema"] == 1
        with pytest.raises(twincal.Error):
            result.export(place, to=to)
    with pytest.raises(twincal.Error):
        result.export(arm.folder / "out.x", to="usd")
    passed = result.check([arm.log("run3")])
    assert {"passed", "gates", "verdict"} <= set(passed)
    file = result.check(twincal.Log.read(arm.folder / "run3.csv"))
    assert [gate["value"] for gate in file["gates"]] == [gate["value"] for gate in passed["gates"]]
    same = result.diff(result)
    assert same["schema"] == 1 and all(own["became"] == "as_before" for own in same["components"])
    page = result.report(arm.folder / "page.html")
    assert page.startswith("<!") and (arm.folder / "page.html").read_text() == page
    for folder in (arm.folder, arm.folder / "none" / "page.html"):
        with pytest.raises(twincal.errors.SystemError, match=re.escape(str(folder))) as error:
            result.report(folder)
        assert error.value.remedy


def test_figures(arm, result):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot
    from twincal import plot

    time, q, qd, qdd, tau = arm.runs["run3"]
    terms = result.draws(1).terms
    ax = pyplot.subplots()[1]
    assert plot.pip(result, ax=ax) is ax
    assert len(ax.patches) == min(20, len(set(result.effects["component"])))
    band = plot.torque(result, time, q, qd, qdd, tau, joint="elbow")
    assert np.array_equal(band.lines[1].get_ydata(), tau[:, 1])
    left = plot.residual(result, q, qd, qdd, tau, joint=1)
    assert np.abs(left.lines[0].get_ydata()).mean() < 0.1
    assert len(plot.pair(result, terms[0], terms[1]).lines[0].get_xdata()) == 2000
    law = plot.law(result, "elbow")
    x, y = law.lines[0].get_data()
    # 0.4 N·m·s/rad were planted, up to Coulomb friction that the fit may add
    assert np.polyfit(x, y, 1)[0] == pytest.approx(0.4, abs=0.05)
    for wrong in ("wrist", 2):
        with pytest.raises(ValueError):
            plot.law(result, wrong)
    refusals = [
        (TypeError, "joint", lambda: plot.law(result, 1.0)),
        (TypeError, "Calibration", lambda: plot.pip(3)),
        (TypeError, "Calibration", lambda: plot.pair(3, terms[0], terms[1])),
        (TypeError, "ax", lambda: plot.pip(result, ax=3)),
        (ValueError, "along", lambda: plot.law(result, along="speed")),
        (ValueError, "tau", lambda: plot.torque(result, time, q, qd, qdd, tau[:, 0])),
        (ValueError, "tau", lambda: plot.torque(result, time, q, qd, qdd, tau[1:])),
        (ValueError, "q", lambda: plot.torque(result, time, q[0], qd[0], qdd[0])),
        (ValueError, "q", lambda: plot.torque(result, time[1:], q, qd, qdd, tau)),
        (ValueError, "tau", lambda: plot.residual(result, q, qd, qdd, tau[:, :1])),
        (ValueError, "qd", lambda: plot.residual(result, q, qd[1:], qdd, tau)),
        (ValueError, "time", lambda: plot.torque(result, q, q, qd, qdd)),
    ]
    for kind, says, call in refusals:
        with pytest.raises(kind, match=says):
            call()
    pyplot.close("all")


def test_arviz_takes_the_tree(arm, result):
    """Summary, forest, pair and posterior predictive plots; before ArviZ 1 by its own container."""
    arviz = pytest.importorskip("arviz")
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    time, q, qd, qdd, tau = (x[::20] for x in arm.runs["run3"])
    tree = result.to_datatree((time, q, qd, qdd, tau), draws=250)
    new = int(arviz.__version__.split(".")[0]) >= 1
    data = tree if new else arviz.InferenceData.from_datatree(tree)
    terms = result.draws(1).terms
    assert len(arviz.summary(data, var_names=["beta"])) == len(terms)
    # those that are in: a coefficient that is always 0 has no density
    chosen = {"term": [term for term in terms if "viscous" in term]}
    assert chosen["term"]
    assert arviz.plot_forest(data, var_names=["beta"], coords=chosen) is not None
    assert arviz.plot_pair(data, var_names=["beta"], coords=chosen) is not None
    predictive = arviz.plot_ppc_dist if new else arviz.plot_ppc
    assert predictive(data) is not None
    pyplot.close("all")


def test_datatree(arm, result):
    pytest.importorskip("xarray")
    time, q, qd, qdd, tau = (x[::20] for x in arm.runs["run3"])
    tree = result.to_datatree((time, q, qd, qdd, tau), draws=250)
    groups = {"posterior", "posterior_predictive", "observed_data", "sample_stats", "constant_data"}
    assert groups <= set(tree.children)
    assert tree["posterior"]["beta"].dims == ("chain", "draw", "term")
    predicted = tree["posterior_predictive"]["tau"]
    assert predicted.dims == ("chain", "draw", "time", "joint")
    own = result.predict(q, qd, qdd)
    mean = predicted.mean(("chain", "draw")).values
    spread = (own.high - own.low) / 3.92
    assert np.abs(mean - own.mean).max() < 5.0 * (spread / np.sqrt(1000)).max() + 0.2 * spread.max()
    low, high = np.quantile(predicted.values.reshape(1000, -1), [0.025, 0.975], axis=0)
    width = (high - low) / (own.high - own.low).ravel()
    assert 0.9 < np.median(width) < 1.1

"""Whatever is given: TypeError, ValueError or an error of twincal with code and remedy, never a panic."""

from __future__ import annotations

import numpy as np
import pytest
import twincal
from conftest import SETTINGS
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

SHAPES = arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4)
DTYPES = st.sampled_from(
    ["f8", "f4", "i4", "u1", "?", "c16", "U3", "O", "M8[s]", ">f8", "V4"]
)
ARRAYS = st.one_of(
    st.tuples(DTYPES, SHAPES).map(lambda own: np.zeros(own[1], dtype=own[0])),
    arrays.arrays("f8", SHAPES, elements=st.floats(allow_nan=True, allow_infinity=True)),
    st.none(),
    st.text(max_size=3),
    st.lists(st.one_of(st.floats(), st.text(max_size=2), st.none()), max_size=4),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=2),
    st.integers(),
    st.lists(st.lists(st.floats(), max_size=3), max_size=3),
)
VALUES = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=5),
        st.binary(max_size=3),
        st.just(object()),
    ),
    lambda own: st.one_of(
        st.lists(own, max_size=3), st.dictionaries(st.text(max_size=4), own, max_size=3)
    ),
    max_leaves=5,
)
KEYS = st.one_of(
    st.text(min_size=1, max_size=8),
    st.sampled_from(
        ["cutoff_hz", "rate_hz", "families", "generic", "seed", "threads", "prior", "noise", "output"]
        + ["chains", "terms", "model", "log", "columns", "lag", "ripple", "robust", "gravity"]
    ),
)
ALLOWED = (TypeError, ValueError, twincal.Error)


def refused(call) -> bool:
    """Runs it; an exception must be one that is allowed, and of ours with code and remedy.

    Returns whether the extension was reached: it gave a result or an error of ours.
    """
    try:
        call()
    except twincal.Error as error:
        assert error.code not in ("internal", "error") and isinstance(error.remedy, str), error
        assert error.problem
    except ALLOWED:
        return False
    return True


LAYOUTS = {
    "C": np.ascontiguousarray,
    "Fortran": np.asfortranarray,
    "backwards": lambda own: own[::-1, ::-1],
    "every second": lambda own: np.repeat(np.repeat(own, 2, axis=0), 2, axis=1)[::2, ::2],
    "read-only": lambda own: own,
}
SPOILED = st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -1e-300, 0.0])


@st.composite
def channels(draw):
    """Time (N,) and positions, velocities, accelerations and torque (N, 2) of one length, some of it spoiled."""
    rows = draw(st.integers(1, 200))
    random = np.random.default_rng(draw(st.integers(0, 1000)))
    time = 0.01 * np.arange(rows)
    if draw(st.integers(0, 4)) == 0:
        time = draw(st.sampled_from([time[::-1], random.permutation(time), 0.0 * time]))
    own = []
    for _ in range(4):
        values = random.uniform(-1.0, 1.0, (rows, 2))
        for _ in range(draw(st.integers(0, 2))):
            place = draw(st.integers(0, rows - 1)), draw(st.integers(0, 1))
            values[place] = draw(SPOILED)
        dtype = draw(st.sampled_from(["f8", "f8", "f8", ">f8", "f4", "f2", "i4", "u1", "?"]))
        layout = draw(st.sampled_from(sorted(LAYOUTS)))
        with np.errstate(all="ignore"):
            values = LAYOUTS[layout](values.astype(dtype))
        values.flags.writeable = layout != "read-only"
        own.append(values)
    return time, *own


def test_arrays_that_fit_together_reach_the_extension(robot, result):
    """Most of 200 cases; that no array is changed is looked at too."""
    reached = []

    @settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
    @given(channels(), st.booleans())
    def run(own, named):
        time, q, qd, qdd, tau = own
        before = [np.array(x) for x in own]
        names = robot.joint_names if named else None
        reached.append([
            refused(lambda: robot.inverse_dynamics(q, qd, qdd)),
            refused(lambda: robot.regressor(q, qd, qdd)),
            refused(lambda: result.predict(q, qd, qdd)),
            refused(lambda: twincal.fit(robot, twincal.Log(time, q, tau, qd, qdd, names=names))),
            refused(lambda: twincal.fit(robot, twincal.Log(time, q, tau))),
        ])  # fmt: skip
        assert all(np.array_equal(x, y, equal_nan=True) for x, y in zip(own, before, strict=True))

    run()
    assert np.mean(reached, axis=0).min() > 0.9, np.mean(reached, axis=0)


@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
@given(ARRAYS, ARRAYS, ARRAYS, ARRAYS, KEYS, VALUES)
def test_arguments_of_any_kind(robot, result, q, qd, qdd, time, key, value):
    refused(lambda: robot.inverse_dynamics(q, qd, qdd))
    refused(lambda: robot.regressor(q, qd, qdd))
    refused(lambda: result.predict(q, qd, qdd))
    refused(lambda: twincal.Log(time, q, qd, qdd))
    refused(lambda: twincal.fit(robot, twincal.Log(time, q, qd, names=value)))
    refused(lambda: twincal.fit(value, q))
    refused(lambda: twincal.Log.from_dataframe(q))
    refused(lambda: twincal.Log.from_dataframe({"t": time, "q1": q, "tau1": qd}))
    refused(lambda: result.draws(value))
    refused(lambda: twincal.fit(robot, [], **{key: value}))


@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
@given(KEYS, VALUES)
def test_settings_of_any_kind(arm, key, value):
    if key in ("path", "cls"):
        return
    refused(lambda: twincal.Robot.from_urdf(arm.model, **{key: value}))


@pytest.mark.parametrize(
    ("keywords", "says"),
    [
        ({"cutof_hz": 0}, "cutoff_hz"),
        ({"prior": {"famlies": {}}}, "families"),
        ({"families": ["springs"]}, "spring"),
        ({"cutoff_hz": -1}, "cutoff_hz"),
        ({"seed": "one"}, "seed"),
    ],
)
def test_errors_suggest(arm, robot, keywords, says):
    with pytest.raises(twincal.Error, match=says) as error:
        twincal.fit(robot, arm.log("run1"), **keywords)
    assert error.value.code in ("setting", "content") and error.value.remedy
    assert isinstance(error.value, ValueError)


def test_wrong_lists(arm, robot):
    for logs in ("run1.csv", ["run1.csv"], 3, None, [arm.log("run1"), None]):
        with pytest.raises(TypeError):
            twincal.fit(robot, logs)
    with pytest.raises(TypeError):
        twincal.fit(str(arm.model), arm.log("run1"))
    with pytest.raises(twincal.Error):
        twincal.fit(robot, [arm.log("run1"), arm.log("run1")])
    with pytest.raises(twincal.errors.SystemError):
        twincal.Log.read("none.csv")
    with pytest.raises(twincal.Error):
        twincal.Calibration.load(arm.folder)
    time, q, qd, qdd, tau = arm.runs["run1"]
    with pytest.raises(twincal.Error, match="elbow"):
        twincal.fit(robot, twincal.Log(time, q, tau, names=["shoulder", "elbw"]), **SETTINGS)


def test_errors_survive_pickle():
    import pickle

    error = twincal.errors.SettingError("key `a`: 3", "give 4")
    again = pickle.loads(pickle.dumps(error))
    assert (again.problem, again.remedy, again.code) == (error.problem, error.remedy, "setting")

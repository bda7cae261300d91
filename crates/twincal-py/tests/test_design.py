"""`twincal.design` gives what `twincal design` writes."""

import numpy as np
import pytest
import twincal


def test_a_motion_of_arrays_within_its_limits(tmp_path, arm):
    names = twincal.Robot.from_urdf(arm.model).joint_names
    limits = tmp_path / "limits.toml"
    limits.write_text("".join(f'[joint."{name}"]\nvelocity = 0.9\ntorque = 1000\n' for name in names))
    motion = twincal.design(tmp_path / "motion", model=arm.model, limits=limits, duration=6, rate=100)
    assert motion.joint_names == list(names)
    assert motion.q.shape == motion.qd.shape == motion.qdd.shape == (601, len(names))
    assert motion.t[-1] == 6.0 and np.abs(motion.qd).max() <= 0.9
    assert np.abs(np.gradient(motion.q, motion.t, axis=0, edge_order=2) - motion.qd).max() < 0.02
    assert motion.promises == [] and motion.condition > 1.0
    again = twincal.design(tmp_path / "again", model=arm.model, limits=limits, duration=6, rate=100)
    assert np.array_equal(again.q, motion.q)


def test_wrong_calls_say_what_is_wrong(tmp_path, arm):
    with pytest.raises(ValueError, match="one of them"):
        twincal.design(tmp_path / "motion")
    with pytest.raises(TypeError, match="list of names"):
        twincal.design(tmp_path / "motion", twin=tmp_path, decide="payload")
    with pytest.raises(twincal.Error, match="duration"):
        twincal.design(tmp_path / "motion", model=arm.model, duration=-1)
    assert not (tmp_path / "motion").exists()

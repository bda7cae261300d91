"""A real robot: the double pendulum of ../shared/data with the makers' own model, whose inertias are wrong.

Torques in N m, low-passed at 5 Hz. The numbers to reach lie between the nominal model's error and what full least
squares reaches on the same split (in comments). No randomness: the data are fixed, the seed is the default.
"""

import importlib.util

import pytest
from conftest import ROOT, SHARED, fit

DATA = SHARED / "double_pendulum"
EXAMPLE = ROOT / "examples" / "double_pendulum"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data/double_pendulum is not there")
CONFIG = (EXAMPLE / "twincal.toml").read_text()


def runs(*numbers):
    return [DATA / f"run{number}.csv" for number in numbers]


def calibrate(folder, train, heldout=()):
    arguments = ["--heldout", *heldout] if heldout else []
    return fit(folder, train, CONFIG, *arguments, model=DATA / "model_as_published.urdf")


def scores(result, key):
    return [joint[key] for joint in result["validation"]["joints"]]


def test_first_two_runs_held_out(tmp_path):
    """Published 0.66/0.91, corrected 0.21/0.19, corrected with fitted friction 0.137/0.080, least squares 0.138/0.071."""
    result = calibrate(tmp_path, runs(2, 3, 4, 5, 6, 7), runs(0, 1))
    assert result["validation"]["signal"] == "filtered" and result["validation"]["split"] == "heldout_logs"
    assert scores(result, "rmse_nominal") == pytest.approx([0.66, 0.91], abs=0.03)
    shoulder, elbow = scores(result, "rmse_calibrated")
    assert shoulder <= 0.15 and elbow <= 0.09
    # what docs/tutorial.md prints: both tensors wrong by the parallel-axis term, each in a set of at most three, and no mass established
    status = {c["name"]: c["status"] for c in result["components"]}
    assert sorted(name for name in status if status[name] == "established") == ["Joint1.coulomb", "Joint2.coulomb"]
    assert [group["members"] for group in result["groups"]] == [["Link2.tensor", "payload"], ["Link1.tensor", "Link1.density", "Link1.mass_moments"]]
    assert all(group["pip"] > 0.999 and group["alike"] == "every_motion" for group in result["groups"])
    found = {c["name"]: c["parameters"][0] for c in result["components"] if (c["pip"] or 0) > 0.5}
    for name, (median, sd) in {"Joint1.coulomb": (0.272, 0.043), "Joint2.coulomb": (0.153, 0.027),
                               "Link1.tensor": (-0.0193, 0.0030), "Link2.tensor": (-0.0395, 0.0016)}.items():  # fmt: skip
        assert found[name]["median"] == pytest.approx(median, abs=0.1 * sd), name
    pips = {c["name"]: c["pip"] for c in result["components"]}
    said = {"Link1.tensor": 0.738, "Link1.density": 0.315, "Link2.tensor": 0.863, "payload": 0.148}
    assert {name: pips[name] for name in said} == pytest.approx(said, abs=0.01)
    assert [shoulder, elbow] == pytest.approx([0.1007, 0.0608], rel=0.01)


def test_last_two_runs_held_out(tmp_path):
    """Published 0.285/0.232, least squares 0.154/0.098; the elbow is not driven in 5-7: that is said."""
    result = calibrate(tmp_path, runs(0, 1, 2, 3, 4, 5), runs(6, 7))
    assert scores(result, "rmse_nominal") == pytest.approx([0.285, 0.232], abs=0.02)
    shoulder, elbow = scores(result, "rmse_calibrated")
    assert shoulder <= 0.17 and elbow <= 0.11
    assert [shoulder, elbow] == pytest.approx([0.140, 0.0989], rel=0.01)
    said = {(finding["code"], finding["subject"]) for finding in result["findings"]}
    assert ("joint_stands_still", "run5.csv") in said
    assert {subject for code, subject in said if code == "joint_not_driven"} >= {"run5.csv", "run6.csv", "run7.csv"}


def test_leave_one_run_out(tmp_path):
    result = calibrate(tmp_path, runs(*range(8)))
    assert result["validation"]["split"] == "leave_one_log_out"
    assert 0.94 <= result["validation"]["coverage95"] <= 0.985


# ---- the converter of the tutorial, on a miniature of the makers' folder

MAKERS = """\
time,pos_meas1,pos_meas2,vel_meas1,vel_meas2,pos_filt1,pos_filt2,vel_filt1,vel_filt2,tau_con1,tau_con2,tau_fric1,tau_fric2,tau_meas1,tau_meas2
0.000000000000000000e+00,1.907377737087045944e-04,1.907377737087045944e-04,5.494505494507251342e-03,5.494505494507251342e-03,1.907377737087045944e-04,1.907377737087045944e-04,5.494505494507251342e-03,5.494505494507251342e-03,-4.310956498470415671e-04,3.963874500883888263e-01,0.000000000000000000e+00,0.000000000000000000e+00,2.930402930402919992e-03,8.791208791208759976e-03
3.695726394653320312e-03,1.907377737087045944e-04,1.907377737087045944e-04,0.000000000000000000e+00,0.000000000000000000e+00,1.907377737087045944e-04,1.907377737087045944e-04,0.000000000000000000e+00,0.000000000000000000e+00,1.077247129967417311e-02,3.972775955933219860e-01,0.000000000000000000e+00,0.000000000000000000e+00,2.930402930402919992e-03,2.930402930402919992e-03
6.507635116577148438e-03,1.907377737087045944e-04,5.722133211261137831e-04,0.000000000000000000e+00,1.356642711917101229e-01,1.907377737087045944e-04,5.722133211261137831e-04,0.000000000000000000e+00,1.356642711917101229e-01,1.928489326527877898e-02,3.974655804988395102e-01,0.000000000000000000e+00,0.000000000000000000e+00,8.791208791208759976e-03,1.611721611721605996e-01
"""


def test_converter_reproduces_the_shared_run(tmp_path):
    """The first rows of the makers' record 143524 become the first rows of run1.csv, digit by digit."""
    spec = importlib.util.spec_from_file_location("convert", EXAMPLE / "convert.py")
    convert = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(convert)
    for stamp in convert.RECORDS:
        record = tmp_path / f"data/experiment_records/design_C.1/sys_id/20230629/20230629-{stamp}/trajectory.csv"
        record.parent.mkdir(parents=True)
        record.write_text(MAKERS)
    model = tmp_path / "data/system_identification/identified_parameters" / convert.MODEL
    model.parent.mkdir(parents=True)
    model.write_bytes((DATA / "model_as_published.urdf").read_bytes())
    convert.main(tmp_path, tmp_path / "out")
    assert (tmp_path / "out" / "run1.csv").read_text().splitlines() == (DATA / "run1.csv").read_text().splitlines()[:4]
    assert (tmp_path / "out" / "model_as_published.urdf").exists()

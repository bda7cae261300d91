"""`twincal design`: limits hold between samples (by Pinocchio), the tables agree, and what is impossible is refused with its cause."""

import importlib.util
import json
import re
import signal
import subprocess
import time
import tomllib

import browser
import jsonschema
import numpy as np
import pandas as pd
import pinocchio as pin
import pyarrow.parquet as pq
import pytest
from conftest import ROOT, program

ARM = ROOT / "examples" / "arm" / "arm.urdf"


def design(folder, *flags, code=0):
    command = [program("twincal"), "design", "--model", ARM, "-o", folder / "motion", "--force", *flags]
    done = subprocess.run([str(one) for one in command], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == code, done.stderr
    return done


def table(folder):
    lines = (folder / "motion" / "motion.csv").read_text().splitlines()
    return lines[0].split(","), np.array([[float(x) for x in line.split(",")] for line in lines[1:]])


def limits(folder, text):
    (folder / "limits.toml").write_text(text)
    return "--limits", folder / "limits.toml"


@pytest.fixture(scope="module")
def names():
    return list(pin.buildModelFromUrdf(str(ARM)).names)[1:]


@pytest.fixture(scope="module")
def stated(names):
    """Limits of every joint, narrow ones."""
    one = 'position = [-1.0, 0.8]\nvelocity = 1.1\nacceleration = 4.0\njerk = 50.0\ntorque = {torque}\nstart = 0.1\n'
    return lambda torque: "".join(f'[joint."{name}"]\n{one.format(torque=torque)}' for name in names)


@pytest.fixture(scope="module")
def made(tmp_path_factory, stated):
    folder = tmp_path_factory.mktemp("design")
    model = pin.buildModelFromUrdf(str(ARM))
    rest = np.abs(pin.computeGeneralizedGravity(model, model.createData(), np.full(model.nq, 0.1)))
    torque = 1.5 * float(rest.max()) + 2.0
    design(folder, "--duration", 10, "--rate", 250, *limits(folder, stated(torque)))
    return folder, torque


def test_no_limit_is_broken(made):
    """Derivatives are those of q, and jerk is that of q̈ between samples; torque by Pinocchio."""
    folder, most = made
    header, rows = table(folder)
    n = (len(header) - 1) // 3
    assert header == ["t", *(f"{what}{j + 1}" for what in ("q", "qd", "qdd") for j in range(n))]
    t, q, qd, qdd = rows[:, 0], *(rows[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))
    assert np.allclose(np.diff(t), 1 / 250) and t[-1] == 10.0
    assert np.abs(np.gradient(q, t, axis=0, edge_order=2) - qd).max() < 2e-3
    assert np.abs(np.gradient(qd, t, axis=0, edge_order=2) - qdd).max() < 2e-2
    assert q.min() >= -1.0 and q.max() <= 0.8
    assert np.abs(qd).max() <= 1.1 and np.abs(qdd).max() <= 4.0
    assert np.abs(np.diff(qdd, axis=0)).max() * 250 <= 50.0
    assert np.all(np.ptp(q, axis=0) > 0.3)
    for end in (0, -1):
        assert np.allclose(q[end], 0.1) and np.allclose(qd[end], 0.0, atol=1e-9) and np.allclose(qdd[end], 0.0, atol=1e-9)
    model = pin.buildModelFromUrdf(str(ARM))
    data = model.createData()
    torque = np.array([pin.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)])
    assert np.abs(torque).max() <= most


def test_the_other_forms_say_the_same(made, names):
    folder, _ = made
    _, rows = table(folder)
    n = len(names)
    lines = (folder / "motion" / "trajectory.yaml").read_text().splitlines()
    assert "10 % speed" in lines[0]
    said = [json.loads(line.strip()[2:]) for line in lines[2 : 2 + n]]
    assert said == names
    positions = [json.loads(line.split(":", 1)[1]) for line in lines if "positions:" in line]
    times = [float(line.split("sec: ")[1].split(",")[0]) + 1e-9 * float(line.split("nanosec: ")[1].rstrip("}")) for line in lines if "sec: " in line]
    picked = np.round(np.array(times) * 250).astype(int)
    assert picked[0] == 0 and picked[-1] == len(rows) - 1
    assert np.array_equal(np.array(positions), rows[picked, 1 : 1 + n])
    about = json.loads((folder / "motion" / "design.json").read_text())
    assert about["samples"] == len(rows) and "10 % speed" in about["warning"]


def test_parquet_holds_the_same_doubles(made, names):
    """By pandas and PyArrow; the joints' names stand in the metadata."""
    folder, _ = made
    header, rows = table(folder)
    read = pd.read_parquet(folder / "motion" / "motion.parquet")
    assert list(read.columns) == header and set(map(str, read.dtypes)) == {"float64"}
    assert np.array_equal(read.to_numpy(), rows)
    kept = pq.read_schema(folder / "motion" / "motion.parquet").metadata
    assert json.loads(kept[b"joints"]) == names and kept[b"rate"] == b"250" and b"10 % speed" in kept[b"warning"]


def schema(name):
    read = json.loads((ROOT / "schema" / f"{name}.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(read)
    return jsonschema.Draft202012Validator(read)


def test_files_are_what_their_schemas_say(made):
    folder, _ = made
    about = json.loads((folder / "motion" / "design.json").read_text())
    assert schema("design").is_valid(about)
    assert not schema("design").is_valid({**about, "samples": "many"}) and not schema("design").is_valid({"schema": 1})
    stated = tomllib.loads((folder / "limits.toml").read_text())
    assert schema("limits").is_valid(stated)
    for wrong in ({"velocty": 1.0}, {"velocity": -1.0}, {"position": [1.0]}):
        assert not schema("limits").is_valid({"joint": {"elbow": wrong}})


@pytest.mark.skipif(browser.installed() is None, reason="no browser: install chromium")
def test_the_page_fits_a_desk_and_a_phone(made, names, tmp_path):
    """The warning is on the first screen, every joint has three curves, nothing is fetched or refused, nothing scrolls sideways."""
    folder, _ = made
    chromium = browser.Browser(tmp_path / "profile")
    try:
        for width, height in ((1280, 900), (390, 844)):
            chromium.open(folder / "motion" / "design.html", width, height)
            assert chromium.value("document.documentElement.scrollWidth") <= width
            assert chromium.value("document.getElementById('warning').getBoundingClientRect().bottom") <= height
            assert chromium.value("document.querySelectorAll('.curves svg').length") == 3 * len(names)
            assert chromium.value("document.scripts.length + document.images.length") == 0
            for quiet in ("Log.entryAdded", "Runtime.exceptionThrown", "Runtime.consoleAPICalled"):
                assert chromium.happened(quiet) == []
            urls = [event["request"]["url"] for event in chromium.happened("Network.requestWillBeSent")]
            assert all(url.startswith("file:") for url in urls) and len(urls) == 1
    finally:
        chromium.close()


@pytest.fixture(scope="module")
def shown(names):
    """ln det and condition number of the rows of Pinocchio's regressor in base coordinates, each column of size 1 at random states."""
    model = pin.buildModelFromUrdf(str(ARM))
    data, n = model.createData(), len(names)
    rng = np.random.default_rng(5)
    anywhere = [rng.uniform(-1, 1, n) * scale for _ in range(200) for scale in (1.0, 1.1, 4.0)]
    stack = lambda states: np.vstack([pin.computeJointTorqueRegressor(model, data, *state) for state in states])
    general = stack(zip(anywhere[0::3], anywhere[1::3], anywhere[2::3], strict=True))
    scale = np.linalg.norm(general, axis=0)
    kept = np.flatnonzero(scale > 1e-9)
    _, values, basis = np.linalg.svd(general[:, kept] / scale[kept], full_matrices=False)
    basis = basis[values > 1e-8 * values[0]]

    def of(q, qd, qdd):
        own = stack(zip(q[::10], qd[::10], qdd[::10], strict=True))[:, kept] / scale[kept] @ basis.T
        return np.linalg.slogdet(own.T @ own / len(own))[1], np.linalg.cond(own)

    return of


def states(folder):
    _, rows = table(folder)
    return np.split(rows[:, 1:], 3, axis=1)


def test_more_is_shown_than_by_random_motion(made, names, shown):
    """ln det: more than the best of twenty random motions in the limits of motion."""
    folder, _ = made
    designed, _ = shown(*states(folder))
    t, n = table(folder)[1][:, 0], len(names)
    rng = np.random.default_rng(6)
    others = []
    for _ in range(20):
        w = 2 * np.pi * np.arange(1, 9) / t[-1]
        a, b = rng.normal(size=(2, n, w.size))
        q = (np.sin(np.outer(t, w)) @ a.T + np.cos(np.outer(t, w)) @ b.T) * np.sin(np.pi * t / t[-1])[:, None] ** 2
        qd = np.gradient(q, t, axis=0)
        qdd = np.gradient(qd, t, axis=0)
        parts = [(q, 0.9), (qd, 1.1), (qdd, 4.0), (np.gradient(qdd, t, axis=0)[5:-5], 50.0)]
        largest = np.maximum.reduce([np.abs(x).max(0) / most for x, most in parts])
        others.append(shown(q / largest - 0.1, qd / largest, qdd / largest)[0])
    assert designed > max(others) + 1.0, (designed, others)


def test_a_criterion_is_what_is_made_large(made, tmp_path, stated, shown):
    """A smaller condition number by `condition`, more information by `determinant`, by Pinocchio's rows and by what the result says."""
    folder, torque = made
    design(tmp_path, "--duration", 10, "--rate", 250, "--criterion", "condition", *limits(tmp_path, stated(torque)))
    both = {"determinant": folder, "condition": tmp_path}
    said = {name: json.loads((own / "motion" / "design.json").read_text()) for name, own in both.items()}
    by_pinocchio = {name: shown(*states(own)) for name, own in both.items()}
    assert all(own["criterion"] == name for name, own in said.items())
    assert said["condition"]["condition"] < 0.5 * said["determinant"]["condition"], said
    assert by_pinocchio["condition"][1] < 0.8 * by_pinocchio["determinant"][1], by_pinocchio
    assert said["condition"]["log_determinant"] < said["determinant"]["log_determinant"]
    assert by_pinocchio["condition"][0] < by_pinocchio["determinant"][0]


def test_the_same_bytes_for_a_seed_on_any_number_of_threads(tmp_path, stated):
    motions = []
    for threads, seed in ((1, 7), (2, 7), (2, 8)):
        folder = tmp_path / f"{threads}-{seed}"
        folder.mkdir()
        design(folder, "--duration", 5, "--rate", 100, "--seed", seed, "--threads", threads, *limits(folder, stated(500)))
        motions.append((folder / "motion" / "motion.csv").read_bytes())
    assert motions[0] == motions[1] != motions[2]


@pytest.mark.parametrize(
    ("change", "code", "says"),
    [
        (("velocity = 1.1", "velocity = -1.1"), 2, "velocity"),
        (("position = [-1.0, 0.8]", "position = [0.8, -1.0]"), 2, "positions"),
        (("start = 0.1", "start = 3.0"), 2, "starts at 3"),
        (("start = 0.1", "strat = 0.1"), 2, "strat"),
        (("torque = 500", "torque = 0.001"), 4, "torque"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, stated, names, change, code, says):
    done = design(tmp_path, *limits(tmp_path, stated(500).replace(*change)), code=code)
    assert says in done.stderr and not (tmp_path / "motion").exists()
    if code == 4:
        assert names[0] in done.stderr or names[1] in done.stderr


def test_what_is_used_is_what_the_motion_has(made):
    """By the samples: range, shares of velocity and acceleration, and of torque by Pinocchio."""
    folder, torque = made
    said = json.loads((folder / "motion" / "design.json").read_text())
    model = pin.buildModelFromUrdf(str(ARM))
    q, qd, qdd = states(folder)
    tau = np.array([pin.rnea(model, model.createData(), *state) for state in zip(q, qd, qdd, strict=True)])
    for joint, used in enumerate(said["used"]):
        assert used["position"] == pytest.approx([q[:, joint].min(), q[:, joint].max()], abs=1e-6)
        for own, limit, share in ((qd, 1.1, used["share"][0]), (qdd, 4.0, used["share"][1]), (tau, torque, used["torque"])):
            assert np.abs(own[:, joint]).max() / limit == pytest.approx(share, rel=1e-3, abs=1e-5)
        jerk = np.abs(np.diff(qdd[:, joint])).max() * 250
        assert jerk / 50 == pytest.approx(used["share"][2], rel=1e-3) and used["share"][2] <= 1.0


def test_a_limit_beyond_that_of_the_model_is_named(tmp_path, names):
    stated = f'[joint."{names[0]}"]\nvelocity = 57.3\nacceleration = 300.0\n'
    done = design(tmp_path, "--duration", 4, "--rate", 100, *limits(tmp_path, stated))
    said = f"warning: the velocity limit of {names[0]} is beyond that of the model file; check its unit"
    assert said in " ".join(done.stderr.split()), done.stderr
    found = json.loads((tmp_path / "motion" / "design.json").read_text())
    assert [own["beyond_model"] for own in found["limits"]] == [["velocity"]] + [[]] * (len(names) - 1)


def test_a_joint_without_a_velocity_limit_is_named(tmp_path, names):
    text = ARM.read_text()
    assert "velocity=" in text
    (tmp_path / "slow.urdf").write_text(re.sub(r'velocity="[^"]*"', 'velocity="0"', text))
    command = [program("twincal"), "design", "--model", tmp_path / "slow.urdf", "-o", tmp_path / "motion"]
    done = subprocess.run([str(one) for one in command], capture_output=True, text=True)
    assert done.returncode == 2 and names[0] in done.stderr and "velocity" in done.stderr
    done = design(tmp_path, *limits(tmp_path, '[joint.nobody]\nvelocity = 1.0\n'), code=2)
    assert "nobody" in done.stderr


def test_ctrl_c_keeps_the_best_motion(tmp_path, stated):
    (tmp_path / "limits.toml").write_text(stated(500))
    command = [program("twincal"), "design", "--model", ARM, "--limits", tmp_path / "limits.toml", "-o", tmp_path / "motion",
               "--threads", 1, "--duration", 60]  # fmt: skip
    running = subprocess.Popen([str(one) for one in command], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    for line in running.stderr:
        if "searching" in line:
            break
    time.sleep(0.5)
    running.send_signal(signal.SIGINT)
    out, _ = running.communicate(timeout=60)
    if running.returncode == 0 and "ended early" not in out:
        pytest.skip("the search was faster than the signal")
    assert running.returncode == 0, out
    about = json.loads((tmp_path / "motion" / "design.json").read_text())
    assert about["stopped"] and about["samples"] == 60 * 500 + 1


@pytest.fixture(scope="module")
def decided(tmp_path_factory):
    """One robot of the study (long form: `studies/design/run`): 30 g more of a link, which a poor log leaves open."""
    spec = importlib.util.spec_from_file_location("design_study", ROOT / "studies" / "design" / "study.py")
    study = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(study)
    folder = tmp_path_factory.mktemp("study")
    return folder, study.one(program("twincal"), study.World("ur5", "payload", 21, 0.12), folder)


def test_the_motion_decides_what_a_poor_log_leaves_open(decided):
    """Seed 21 was not used to choose anything; of the eight that were, the designed motion decides seven."""
    _, line = decided
    assert line["true"] == "wrist_2_link.density" and 0.05 < line["before"][1] < 0.95, line
    assert line["designed"]["right"] and not line["designed"]["wrong"], line
    # a payload's tensor is no question of its own
    assert [own["effect"] for own in line["promises"]] == line["effects"]
    for own in line["promises"]:
        assert own["right"] + own["wrong"] <= 1.0 and not own["structural"], own


def test_what_a_log_shows_need_not_be_shown_again(made, tmp_path):
    """A motion after a recorded one is another one, for the same seed too; what was counted is named. What both show: recorded.rs."""
    folder, _ = made
    alone = json.loads((folder / "motion" / "design.json").read_text())
    limits_of = ("--limits", folder / "limits.toml", "--duration", 10, "--rate", 250)
    done = design(tmp_path, *limits_of, "--after", folder / "motion" / "motion.csv")
    assert "of 1 log recorded before" in done.stdout
    after = json.loads((tmp_path / "motion" / "design.json").read_text())
    (log,) = after["after"]
    assert log["log"] == "motion.csv" and 7.0 < log["seconds"] <= 10.1 and alone["after"] == []
    assert after["log_determinant"] != alone["log_determinant"]
    assert not np.allclose(table(tmp_path)[1], table(folder)[1], atol=0.05)
    again = design(tmp_path, *limits_of, "--after", folder / "motion" / "motion.csv", "--json")
    assert json.loads(again.stdout) == after


def test_a_log_is_given_once(made, tmp_path):
    folder, _ = made
    log = folder / "motion" / "motion.csv"
    done = design(tmp_path, "--limits", folder / "limits.toml", "--after", log, log, code=2)
    assert "the same log" in done.stderr and not (tmp_path / "motion").exists()


def test_a_log_that_the_twin_knows_is_refused(decided, tmp_path):
    folder, _ = decided
    log = next(folder.glob("poor*.csv"))
    command = [program("twincal"), "design", "--twin", folder / "poor", "--after", log, "-o", tmp_path / "motion"]
    done = subprocess.run([str(one) for one in command], capture_output=True, text=True)
    assert done.returncode == 2 and "was fitted to this log" in done.stderr, done.stderr


def test_an_effect_that_is_none_is_refused_by_name(decided, tmp_path):
    folder, _ = decided
    command = [program("twincal"), "design", "--twin", folder / "poor", "--decide", "nobody", "-o", tmp_path / "motion"]
    command += ["--limits", folder / "limits.toml"]
    done = subprocess.run([str(one) for one in command], capture_output=True, text=True)
    assert done.returncode == 2 and "nobody" in done.stderr
    assert not (tmp_path / "motion").exists()


def test_limits_in_the_docs_are_limits(names):
    text = (ROOT / "docs" / "design.md").read_text()
    block = text.split("```toml\n")[1].split("```")[0]
    keys = {key for own in tomllib.loads(block)["joint"].values() for key in own}
    assert keys == {"position", "velocity", "acceleration", "jerk", "torque", "start"}


def clearance(folder):
    return json.loads((folder / "motion" / "design.json").read_text())["clearance"]


def test_geometry_that_is_missing_is_assumed_and_said(tmp_path, stated):
    """The example's links have no geometry: capsules, of 8 % of its reach."""
    said = design(tmp_path, "--duration", 3, *limits(tmp_path, stated(200.0)))
    own = clearance(tmp_path)
    assert own["assumed"] and all(one["reason"] == "the model has no geometry" for one in own["assumed"])
    assert len({one["radius"] for one in own["assumed"]}) == 1
    assert "capsule of radius" in said.stdout and "no geometry" in said.stdout


def test_what_stands_around_is_kept_clear(tmp_path, stated):
    """A wall in front of where the free motion was: the motion ends before it."""
    model = pin.buildModelFromUrdf(str(ARM))
    data, tip = model.createData(), model.nframes - 1

    def reach(folder):
        _, rows = table(folder)
        places = []
        for q in rows[::5, 1 : 1 + model.nq]:
            pin.framesForwardKinematics(model, data, q)
            places.append(data.oMf[tip].translation.copy())
        return np.array(places)

    text = stated(200.0)
    design(tmp_path, "--duration", 6, *limits(tmp_path, text))
    free = reach(tmp_path)
    name = model.frames[tip].name
    axis = int(np.argmax(np.ptp(free, axis=0)))
    wall = float(free[0, axis] + 0.5 * (free[:, axis].max() - free[0, axis]))
    low, high = [-9.0, -9.0, -9.0], [9.0, 9.0, 9.0]
    high[axis] = wall
    box = f'[[box]]\nname = "cell"\nlow = {low}\nhigh = {high}\nkeep = "inside"\nlinks = ["{name}"]\n'
    design(tmp_path, "--duration", 6, *limits(tmp_path, "margin = 0.01\n" + text + box))
    assert free[:, axis].max() > wall
    assert reach(tmp_path)[:, axis].max() <= wall - 0.01 + 1e-4


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        ("floor = 30.0\n", 4, "`floor`"),
        ("margin = -1.0\n", 2, "-1 m"),
        ('ignore = [["nolink", "x"]]\n', 2, "nolink"),
        ('[[box]]\nname = "b"\nlow = [0, 0, 0]\nhigh = [1, -1, 1]\n', 2, "`b`"),
        ('[[box]]\nname = "b"\nlow = [0, 0, 0]\n', 2, "high"),
    ],
)
def test_impossible_surroundings_are_refused(tmp_path, stated, text, code, says):
    own = stated(200.0)
    own = text + own if "[[" not in text or "ignore" in text else own + text
    done = design(tmp_path, "--duration", 3, *limits(tmp_path, own), code=code)
    assert says in done.stderr
    assert not (tmp_path / "motion").exists()


def test_a_start_that_is_not_free_is_moved_unless_it_is_stated(tmp_path, names):
    """A box around where the tip usually starts."""
    model = pin.buildModelFromUrdf(str(ARM))
    data, tip = model.createData(), model.nframes - 1
    design(tmp_path, "--duration", 3, *limits(tmp_path, "margin = 0.01\n"))
    usual = table(tmp_path)[1][0, 1 : 1 + model.nq]
    pin.framesForwardKinematics(model, data, usual)
    at, name = data.oMf[tip].translation.copy(), model.frames[tip].name
    low, high = (at - 0.05).tolist(), (at + 0.05).tolist()
    box = f'[[box]]\nname = "post"\nlow = {low}\nhigh = {high}\nlinks = ["{name}"]\n'
    said = design(tmp_path, "--duration", 3, *limits(tmp_path, "margin = 0.01\n" + box))
    moved = table(tmp_path)[1][0, 1 : 1 + model.nq]
    assert not np.allclose(moved, usual) and "start assumed" in said.stdout
    pin.framesForwardKinematics(model, data, moved)
    there = data.oMf[tip].translation
    assert np.linalg.norm(np.maximum(np.maximum(low - there, there - np.array(high)), 0.0)) >= 0.01 - 1e-6
    stated = "".join(f'[joint."{joint}"]\nstart = {q}\n' for joint, q in zip(names, usual, strict=True))
    done = design(tmp_path, "--duration", 3, *limits(tmp_path, "margin = 0.01\n" + box + stated), code=4)
    assert "`post`" in done.stderr


@pytest.mark.parametrize("robot", ["ur5"])
def test_meshes_do_not_touch_in_mujoco(tmp_path, monkeypatch, robot):
    """One motion of the study: from a random start, over a floor and beside a box, distances by MuJoCo on the same meshes."""
    spec = importlib.util.spec_from_file_location("contacts", ROOT / "studies" / "design" / "contacts.py")
    contacts = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(contacts)
    monkeypatch.setattr(contacts, "SECONDS", 4.0)
    line = contacts.one(program("twincal"), contacts.Robot(robot), 2, tmp_path)
    assert line["broken"] == [] and not line["too_close"], line
    assert line["pairs"] > 10 and abs(min(line["mujoco"], line["around"]) - line["said"]["distance"]) < 0.005, line


def test_a_known_load_counts_in_the_torque(tmp_path, names, stated):
    """Torque by Pinocchio with a point mass in the frame of the tool."""
    model = pin.buildModelFromUrdf(str(ARM))
    mass, com = 1.5, [0.05, 0.0, 0.1]
    tool = model.frames[model.getFrameId("tool0")]
    model.appendBodyToJoint(tool.parentJoint, pin.Inertia(mass, np.array(com), np.zeros((3, 3))), tool.placement)
    data = model.createData()
    rest = np.abs(pin.computeGeneralizedGravity(model, data, np.full(model.nq, 0.1)))
    torque = 1.2 * float(rest.max()) + 1.0
    load = f"load = {{ mass = {mass}, com = {com} }}\n"
    design(tmp_path, "--duration", 5, *limits(tmp_path, load + stated(torque)))
    _, rows = table(tmp_path)
    n = model.nq
    states = (rows[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))
    needed = np.array([pin.rnea(model, data, *state) for state in zip(*states, strict=True)])
    assert np.abs(needed).max() <= torque
    assert json.loads((tmp_path / "motion" / "design.json").read_text())["load"] == {"frame": "tool0", "mass": mass, "com": com}
    done = design(tmp_path, *limits(tmp_path, load.replace("1.5", "150") + stated(torque)), code=4)
    assert "at the start joint" in done.stderr


TURNTABLE = """<robot name="turntable"><link name="base"/>
<link name="plate"><inertial><origin xyz="0.1 0.02 0"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="plate"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="4" effort="50"/></joint></robot>
"""


def turntable(folder, file, load=0.0):
    """20 s of a plate on a vertical axis, 8 % harder to turn than its model, with a point mass at a radius of 0.3 m."""
    t = np.arange(0.0, 20.0, 0.004)
    w = np.array([2.1, 4.7, 6.9])
    q = (np.sin(np.outer(t, w)) / w).sum(axis=1)
    qd, qdd = np.cos(np.outer(t, w)).sum(axis=1), -(w * np.sin(np.outer(t, w))).sum(axis=1)
    inertia = 1.08 * (0.02 + 2 * (0.1**2 + 0.02**2)) + load * 0.3**2
    tau = inertia * qdd + 0.1 * qd + 0.02 * np.random.default_rng(5).normal(size=t.size)
    pd.DataFrame({"t": t, "turn.q": q, "turn.qd": qd, "turn.qdd": qdd, "turn.tau": tau}).to_csv(folder / file, index=False)
    (folder / "turntable.urdf").write_text(TURNTABLE)


def call(folder, *command, codes=(0,)):
    command = [program("twincal"), *map(str, command)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode in codes, done.stderr
    return done


def test_what_decides_where_no_motion_does_is_said(tmp_path):
    """A vertical axis feels no gravity: density, gain and motor inertia of its only joint all are torque along q̈. On a wall the plate's
    weight distinguishes them. A known load does so for the drive's gain, since it is in what the gain multiplies; with that load in the motion
    to come nothing is structural. Density it leaves as it is."""
    turntable(tmp_path, "log.csv")
    said = {}
    for other, name in (("density", "plate.density"), ("gain", "turn.gain")):
        (tmp_path / "twincal.toml").write_text(f'[library]\nfamilies = ["viscous", "motor_inertia", "{other}"]\n')
        call(tmp_path, "fit", "log.csv", "--model", "turntable.urdf", "--config", "twincal.toml", "-o", f"twin_{other}", codes=(0, 3))
        for load in (0.0, 1.5):
            (tmp_path / "limits.toml").write_text(f"load = {{ mass = {load}, com = [0.3, 0.0, 0.0] }}\n" if load else "")
            call(tmp_path, "design", "--twin", f"twin_{other}", "--decide", "turn.motor_inertia", name, "--limits", "limits.toml",
                 "--duration", 6, "-o", "motion", "--force")  # fmt: skip
            promises = json.loads((tmp_path / "motion" / "design.json").read_text())["promises"]
            said[other, load] = [own["decided_by"] if own["structural"] else None for own in promises]
    assert said == {
        ("density", 0.0): [["other_base"]] * 2,
        ("density", 1.5): [["other_base"]] * 2,
        ("gain", 0.0): [["known_load", "other_base"]] * 2,
        ("gain", 1.5): [None] * 2,
    }


def test_a_load_decides_in_the_motion_to_come_and_not_in_what_is_recorded(tmp_path):
    """Gain and motor inertia are open alike. A motion with the load decides between them; one without does not, nor does a motion that hardly
    moves, whatever the robot did before without the load."""
    turntable(tmp_path, "log.csv")
    prior = '[library]\nfamilies = ["viscous", "motor_inertia", "gain"]\n[prior.families]\ngain = 0.2\nmotor_inertia = 0.3\n'
    (tmp_path / "twincal.toml").write_text(prior)
    call(tmp_path, "fit", "log.csv", "--model", "turntable.urdf", "--config", "twincal.toml", "-o", "twin", codes=(0, 3))
    load, still = "load = { mass = 1.5, com = [0.3, 0.0, 0.0] }\n", "[joint.turn]\nposition = [-0.002, 0.002]\nvelocity = 0.01\n"
    right = {}
    for name, text in (("loaded", load), ("empty", ""), ("still", load + still)):
        (tmp_path / "limits.toml").write_text(text)
        after = ("--after", tmp_path / "empty" / "motion.csv") if name == "still" else ()
        call(tmp_path, "design", "--twin", "twin", "--decide", "turn.gain", "--limits", "limits.toml", *after, "-o", name)
        (promise,) = json.loads((tmp_path / name / "design.json").read_text())["promises"]
        assert 0.05 < promise["pip"] < 0.95, promise
        right[name] = promise["right"]
    assert right["loaded"] > 0.9 and right["empty"] < 0.5 and right["still"] < 0.5, right
    motions = [(tmp_path / name / "motion.csv").read_text() for name in ("loaded", "empty")]
    assert motions[0] != motions[1]


def test_a_twin_holds_its_load_within_its_torque(tmp_path):
    """On a wall: the plate's 2 kg at 0.1 m and a load of 2 kg at 0.3 m need 7.85 N·m at the start."""
    t = np.arange(0.0, 20.0, 0.004)
    q, qd, qdd = 0.9 * np.sin(2 * t), 1.8 * np.cos(2 * t), -3.6 * np.sin(2 * t)
    gravity = 9.81 * 2 * (0.1 * np.cos(q) - 0.02 * np.sin(q))
    tau = 0.0408 * qdd + gravity + 0.3 * qd + 0.02 * np.random.default_rng(6).normal(size=t.size)
    pd.DataFrame({"t": t, "turn.q": q, "turn.qd": qd, "turn.qdd": qdd, "turn.tau": tau}).to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "turntable.urdf").write_text(TURNTABLE)
    (tmp_path / "twincal.toml").write_text('[model]\nbase = { rpy = [1.5707963, 0.0, 0.0] }\n[library]\nfamilies = ["viscous", "payload"]\n')
    call(tmp_path, "fit", "log.csv", "--model", "turntable.urdf", "--config", "twincal.toml", "-o", "twin", codes=(0, 3))
    stated = "[joint.turn]\nstart = 0.0\ntorque = {}\n"
    for torque, code in ((7.5, 4), (20.0, 0)):
        (tmp_path / "limits.toml").write_text("load = { mass = 2.0, com = [0.3, 0.0, 0.0] }\n" + stated.format(torque))
        done = call(tmp_path, "design", "--twin", "twin", "--decide", "payload", "--limits", "limits.toml", "--duration", 4, "-o", "motion",
                    codes=(code,))  # fmt: skip
    assert "The robot carries 2.00" in done.stdout and "plate. Its shape" in done.stdout
    done = call(tmp_path, "design", "--twin", "twin", "--config", "twincal.toml", "-o", "other", codes=(2,))
    assert "--config says nothing of a twin" in done.stderr


def test_a_payload_that_acts_elsewhere_and_one_that_is_not_counted(tmp_path):
    """Beside a known load a payload of logs with an unknown one does not act; what a log of --after carries is not counted, and said so."""
    turntable(tmp_path, "log.csv")
    turntable(tmp_path, "other.csv", load=1.0)
    unknown = '[library]\nfamilies = ["viscous", "payload"]\n[[log]]\nfile = "other.csv"\npayload = "unknown"\n'
    (tmp_path / "twincal.toml").write_text(unknown)
    call(tmp_path, "fit", "log.csv", "other.csv", "--model", "turntable.urdf", "--config", "twincal.toml", "-o", "twin", codes=(0, 3))
    (tmp_path / "limits.toml").write_text("load = { mass = 2.0, com = [0.3, 0.0, 0.0] }\n")
    done = call(tmp_path, "design", "--twin", "twin", "--decide", "payload", "--limits", "limits.toml", "-o", "motion", codes=(2,))
    assert 'payload is "unknown"' in done.stderr
    done = call(tmp_path, "design", "--model", "turntable.urdf", "--config", "twincal.toml", "--after", "other.csv", "--duration", 3, "-o", "motion")
    assert "other.csv: what it carries is not counted" in done.stderr


def test_the_base_of_a_model_stands_as_its_settings_say(tmp_path):
    """On a wall the plate weighs 2 N·m at the start, more than the drive has; upright it weighs nothing."""
    (tmp_path / "turntable.urdf").write_text(TURNTABLE)
    (tmp_path / "twincal.toml").write_text("[model]\nbase = { rpy = [1.5707963, 0.0, 0.0] }\n")
    stated = limits(tmp_path, "[joint.turn]\ntorque = 1.0\nstart = 0.0\n")
    command = [program("twincal"), "design", "--model", tmp_path / "turntable.urdf", *stated, "--duration", 4, "-o", tmp_path / "motion"]
    for given, code in (((), 0), (("--config", tmp_path / "twincal.toml"), 4)):
        done = subprocess.run([str(one) for one in (*command, *given, "--force")], capture_output=True, text=True)
        assert done.returncode == code, done.stderr
    assert "`turn` needs 1.96" in done.stderr

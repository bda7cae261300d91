"""The study of worlds in short: the simulator against MuJoCo and closed forms, the judge against hand-made results, and 12 fits.

The whole study is `studies/worlds/run` (docs/worlds.md). Seeds are fixed: those of the study's tables and of development are others.
"""

import json
import sys
import xml.etree.ElementTree as tree
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from conftest import ROOT, program

sys.path.insert(0, str(ROOT / "studies" / "worlds"))

import fits  # noqa: E402
import judge  # noqa: E402
import table  # noqa: E402
import worlds  # noqa: E402
from columns import Formulas, component_torque  # noqa: E402
from defects import Defects, torque  # noqa: E402
from defects import Path as Motion  # noqa: E402
from oracle import low_pass, standard_errors  # noqa: E402
from shared import COULOMB_VELOCITY, colored, model_file  # noqa: E402

SEED = 1701
SHORT = [(kind, SEED + k) for k, kind in enumerate(worlds.KINDS)] + [("payload_link", SEED + 20)]


def motion(world, samples=40):
    """Random states within the joints' ranges."""
    rng = np.random.default_rng(SEED)
    n = world.arm.model.nv
    q = rng.uniform(world.arm.low, world.arm.high, (samples, n))
    return Motion(0.1 * np.arange(samples), q, rng.normal(size=(samples, n)), rng.normal(size=(samples, n)))


def mujoco_spec(robot):
    """A robot's model file in MuJoCo: joints and inertias as the file states them, no shapes."""
    root = tree.parse(model_file(robot)).getroot()
    for link in root.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    settings = tree.SubElement(tree.SubElement(root, "mujoco"), "compiler", fusestatic="false", balanceinertia="false")
    settings.set("discardvisual", "true")
    return mujoco.MjSpec.from_string(tree.tostring(root, encoding="unicode"))


def mujoco_torque(spec, q, qd, qdd):
    """Inverse dynamics without what the file states of damping and friction."""
    for joint in spec.joints:
        joint.damping, joint.frictionloss, joint.armature = 0.0 * np.asarray(joint.damping), 0.0, 0.0
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    model = spec.compile()
    data, tau = mujoco.MjData(model), np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        tau[k] = data.qfrc_inverse
    return tau


def test_torque_is_mujocos():
    """UR5 with payload, heavier forearm, longer upper arm, tilted base and moved zero: each given to MuJoCo in its own words."""
    world = worlds.draw("null", SEED)
    world = replace(world, robot="ur5")
    path, payload, zero = motion(world), (1.3, (0.02, -0.01, 0.07)), (0.0, 0.02, 0.0, -0.01, 0.0, 0.0)
    tilt = (0.03, -0.02, 0.01)
    defects = Defects(payload=payload, heavier=(2, 1.2), length=(2, 1.015), tilt=tilt, zero=zero)
    spec = mujoco_spec("ur5")
    forearm = spec.body("forearm_link")
    forearm.mass, forearm.fullinertia = 1.2 * forearm.mass, 1.2 * np.asarray(forearm.fullinertia)
    forearm.pos = 1.015 * np.asarray(forearm.pos)
    load = spec.body("wrist_3_link").add_body(name="load", pos=payload[1])
    load.mass, load.ipos, load.inertia, load.explicitinertial = payload[0], (0.0, 0.0, 0.0), (0.4 * payload[0] * 0.05**2,) * 3, True
    roll, pitch, yaw = tilt
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    turn = turn @ np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    turn = turn @ np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    spec.option.gravity = turn.T @ np.array([0.0, 0.0, -9.81])
    theirs = mujoco_torque(spec, path.q + np.array(zero), path.qd, path.qdd)
    arm = world.arm
    ours = torque(arm, defects, path) - arm.viscous * path.qd - arm.coulomb * np.tanh(path.qd / COULOMB_VELOCITY)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


def test_what_acts_on_one_joint_is_its_formula():
    """Spring, ripple, load friction, warm-up and gain, each against its closed form."""
    world = replace(worlds.draw("null", SEED), robot="panda")
    arm, path = world.arm, motion(world)
    plain = torque(arm, Defects(), path)
    friction = arm.viscous * path.qd + arm.coulomb * np.tanh(path.qd / COULOMB_VELOCITY)
    gain = np.array([0, 0.05, 0, 0, -0.1, 0, 0])
    shares = np.linspace(0.1, 0.3, 7)
    cases = {
        "spring": ((1, 8.0, 0.2), 8.0 * (path.q - 0.2) * np.eye(7)[1]),
        "ripple": ((3, 30, 0.4), 0.4 * np.sin(30 * path.q) * np.eye(7)[3]),
        "load": ((0, 0.1, 0, 0, 0, 0, 0), 0.1 * np.abs(plain - friction) * np.tanh(path.qd / COULOMB_VELOCITY) * np.eye(7)[1]),
        "warm_up": ((7.0, tuple(shares)), -friction * shares * (1 - np.exp(-path.t[:, None] / 7.0))),
        "gain": (tuple(gain), gain * plain),
    }
    for name, (value, extra) in cases.items():
        np.testing.assert_allclose(torque(arm, Defects(**{name: value}), path) - plain, extra, atol=1e-10, err_msg=name)


def memory_cycle(name, value, amplitude):
    """Arm, torque in place of Coulomb's after 0.75 rad of sliding, and work lost in one cycle of this amplitude, J."""
    arm, t = replace(worlds.draw("null", SEED), robot="panda").arm, np.arange(4000) / 1000.0
    q = np.where(t < 2.0, 0.5 * t, 1.0 + amplitude * np.sin(2 * np.pi * 2 * (t - 2.0)))[:, None] * np.ones(7)
    path = Motion(t, q, np.gradient(q, t, axis=0), np.zeros_like(q))
    beyond = torque(arm, Defects(**{name: (value,) * 7}), path) - torque(arm, Defects(), path)
    force, last = beyond + arm.coulomb * np.tanh(path.qd / COULOMB_VELOCITY), slice(3500, 4000)
    return arm, beyond[1500], (force[last] * path.qd[last]).sum(0) * 0.001


def test_maxwell_slip_loses_what_its_elements_slip():
    """Of four elements the first alone, 5 mrad, slips in a swing of 16 mrad: 2 x a quarter of Coulomb friction x (16 - 10) mrad per cycle."""
    arm, sliding, lost = memory_cycle("slip", 0.02, 0.008)
    np.testing.assert_allclose(sliding / arm.coulomb, 0.0, atol=1e-9)
    np.testing.assert_allclose(lost / arm.coulomb, 0.003, rtol=0.03)


def test_lugre_slides_as_coulomb_and_loses_less_within_its_presliding():
    arm, sliding, lost = memory_cycle("lugre", 1.0, 0.002)
    assert (np.abs(sliding) < 0.03 * arm.coulomb).all()
    assert (lost > 0).all() and (lost < 0.9 * 4 * 0.002 * arm.coulomb).all()


def test_a_log_is_clean_torque_and_noise():
    """sd of the noise within 10 % (3000 samples of white and AR(1) noise: a standard error of 2 %), none in what is stored as truth."""
    world = worlds.draw("payload_link", SEED)
    path = worlds.path_of(world, 0)
    log = worlds.record(world, path, 0)
    noise = log.tau - torque(world.arm, world.defects, path, 4)
    np.testing.assert_allclose(noise.std(0), worlds.noise_sd(world), rtol=0.1)


def test_contributions_add_up_where_causes_do():
    """A payload and a spring change torque by the sum of what each does; a gain beside a payload by more."""
    world = worlds.draw("payload_link", SEED)
    path = motion(world)
    plain, all_in = torque(world.arm, Defects(), path), torque(world.arm, world.defects, path)
    np.testing.assert_allclose(worlds.contributions(world, path, 1).sum(0), all_in - plain, atol=1e-9)


def test_two_zeros_contribute_what_each_does():
    """To first order: the sum is within 2 % of both together, and neither is the other's."""
    world = replace(worlds.draw("null", SEED), robot="ur5", defects=Defects(zero=(0.0, 0.02, -0.01, 0.0, 0.0, 0.0)))
    sizes = world.defects.zero
    world.causes = worlds.joint_causes(world.arm.model, sizes, "encoder_zero", "rad", "zero", ["encoder_zero"], only=False)
    path = motion(world)
    effects = worlds.contributions(world, path, 1)
    both = torque(world.arm, world.defects, path) - torque(world.arm, Defects(), path)
    assert np.linalg.norm(effects.sum(0) - both) < 0.02 * np.linalg.norm(both)
    alone = torque(world.arm, Defects(zero=(0.0, 0.02, 0.0, 0.0, 0.0, 0.0)), path) - torque(world.arm, Defects(), path)
    assert np.linalg.norm(effects[0] - alone) < 0.02 * np.linalg.norm(alone)


def test_every_kind_draws_within_its_ranges_and_again_the_same():
    for kind in worlds.KINDS + worlds.HELD_BACK:
        for seed in range(SEED, SEED + (1 if kind == "small" else 4)):
            world, again = worlds.draw(kind, seed), worlds.draw(kind, seed)
            assert (world.defects, world.causes) == (again.defects, again.causes)
            payload = [cause.size for cause in world.causes if cause.family == "payload"]
            assert all(0 < mass <= worlds.PAYLOAD[world.robot] for mass in payload), (kind, seed, payload)
            assert kind in ("null",) or world.causes, (kind, seed)


def test_standard_errors_are_those_of_least_squares():
    """400 simulated fits of one gain beside friction: the estimate's sd is 1 over the size, within 12 % (3.5 standard errors)."""
    world = worlds.draw("null", SEED)
    world = replace(world, robot="planar3", defects=Defects(gain=(0.05, 0.0, 0.0)), motion="fourier")
    world.causes = worlds.joint_causes(world.arm.model, (0.05, 0.0, 0.0), "gain", "1", "gain", ["gain"])
    path, sd = worlds.path_of(world, 0), worlds.noise_sd(world)
    effect = worlds.contributions(world, path, 4)
    size = standard_errors(world, [path], [effect], sd)[0]
    qd = path.qd[::4, 0]
    columns = low_pass(np.stack([effect[0, :, 0], qd, np.tanh(qd / COULOMB_VELOCITY)], axis=1), 250)
    rng = np.random.default_rng(SEED)
    noise = rng.normal(size=(len(qd), 400)) + colored(rng, (len(qd), 400), 250, world.recorder.noise_time)
    estimates = np.linalg.lstsq(columns, low_pass(sd[0] * 0.5**0.5 * noise, 250), rcond=None)[0][0]
    assert estimates.std() == pytest.approx(1 / size, rel=0.12)


def component(name, pip, family=None, **more):
    """A row of components[] as result.json has it."""
    family = family or name.rpartition(".")[2]
    return {"name": name, "family": family, "pip": pip, "selected": pip >= 0.5, "verdict": "found", "parameters": [], "columns": []} | more


def test_the_judge_on_results_made_by_hand():
    cause = {"family": "body", "subject": "forearm", "size": 0.4, "unit": "kg", "mechanism": "heavier", "joint": None,
             "exact": ["forearm.mass_moments"], "true": ["forearm.mass_moments"], "body": ["forearm", "sleeve"], "standard_errors": 20.0}  # fmt: skip
    wear = cause | {"family": "memory", "subject": "elbow", "exact": ["elbow.hysteresis"], "true": ["elbow.hysteresis", "elbow.stribeck"], "body": []}
    truth = {"causes": [cause, wear]}
    result = {"components": [component("elbow.viscous", 1.0), component("forearm.mass_moments", 0.99), component("sleeve.tensor", 0.97),
                             component("hand.tensor", 0.96), component("elbow.stribeck", 0.98), component("wrist.stribeck", 0.3),
                             component("elbow.hysteresis", 0.01), component("upper.tensor", 0.5), component("upper.mass_moments", 0.49)],
              "groups": [{"members": ["upper.tensor", "upper.mass_moments"], "pip": 0.99}]}  # fmt: skip
    rows, candidate = judge.judge_components(truth, result, None)
    said = {row["name"]: (row["status"], row["judged"]) for row in rows}
    assert candidate == [True, True]
    assert said == {"forearm.mass_moments": ("established", "true"), "sleeve.tensor": ("established", "true"), "hand.tensor": ("established", "false"),
                    "elbow.stribeck": ("established", "true"), "wrist.stribeck": ("tentative", "false"),
                    "upper.tensor": ("equivalent", "false"), "upper.mass_moments": ("equivalent", "false")}  # fmt: skip
    sets = judge.judge_sets(truth, result, rows)
    assert [(one["judged"], one["inertial"]) for one in sets] == [("false", True)]
    line = {"components": rows, "sets": sets, "causes": judge.judge_causes(truth, result, rows, candidate)}
    assert table.false_claims(line) == 2 and table.false_claims(line, inertial=True) == 2 and table.found(line) == (2, 2)
    # a program with statuses is taken at its word
    assert judge.status_of(component("a.spring", 0.99, status="tentative"), []) == "tentative"


def test_bounds_are_binomial():
    """Published one-sided 99 % bounds (Clopper and Pearson): 0 of 20 below 0.2057, 19 of 20 above 0.7711 (tail sums of the binomial)."""
    assert table.bounds99(0, 20)[1] == pytest.approx(1 - 0.01 ** (1 / 20))
    low = table.bounds99(19, 20)[0]
    assert 20 * low**19 * (1 - low) + low**20 == pytest.approx(0.01)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("worlds")


@pytest.fixture(scope="module")
def lines(folder):
    """Short fits of several kinds of worlds."""
    return [fits.one(program("twincal"), kind, seed, folder) for kind, seed in SHORT]


def fitted(line, folder):
    """Folder, truth, result and formulas along the third motion of a line."""
    place, truth = worlds.kept(line["world"], line["seed"], folder)
    result = json.loads((place / f"out-{line['program']}" / "result.json").read_text())
    third = np.load(place / "third.npz")
    path = Motion(third["t"], third["q"], third["qd"], third["qdd"])
    return place, truth, result, Formulas(truth["world"]["robot"], path, result["signal"]["coulomb_velocity"])


def test_the_parts_of_a_twin_add_up_to_its_prediction(lines, folder):
    """Stand-ins are judged by formulas of our own: summed over all components they are what `twincal predict` says of joints that move.

    Within 1 % of the largest torque: bodies go by their reported parameters, and the centre of mass is a median.
    """
    compared = 0
    for line in lines:
        if "error" in line or line["robot"] == "planar3":
            continue
        place, truth, result, formulas = fitted(line, folder)
        parts = {c["name"]: component_torque(formulas, result, c["name"], mean="mean") for c in result["components"]}
        weight = {c["name"]: c["pip"] or 0.0 for c in result["components"]}
        if any(part is None and weight[name] > 1e-3 for name, part in parts.items()):
            continue  # a family whose torque depends on the past has no formula here
        rows, said = fits.prediction(program("twincal"), place, f"out-{line['program']}")(formulas.path, truth["joints"])
        total = formulas.nominal + sum(part for part in parts.values() if part is not None)
        for j, joint in enumerate(truth["joints"]):
            moving = np.abs(formulas.path.qd[rows, j]) > 0.2
            gap = (said[:, j] - total[rows, j])[moving]
            assert np.sqrt(np.mean(gap**2)) < 1e-2 * max(np.abs(total[:, j]).max(), 1.0), (line["world"], joint)
        compared += 1
    assert compared >= 2


def test_a_component_without_formula_is_what_the_prediction_has_beyond_the_others(lines, folder, monkeypatch):
    """Viscous friction of one joint, its formula taken away, comes out of `twincal predict` as the formula has it."""
    line = next(line for line in lines if line["world"] == "ur5_forearm")
    place, truth, result, formulas = fitted(line, folder)
    name = f"{truth['joints'][1]}.viscous"
    true = component_torque(formulas, result, name)[:, 1]
    known = lambda formulas, result, which, mean="conditional_mean": None if which == name else component_torque(formulas, result, which, mean)
    monkeypatch.setattr(judge, "component_torque", known)
    missing = judge.StandIns(truth, result, place, [0], fits.prediction(program("twincal"), place, f"out-{line['program']}"))
    moving = np.abs(formulas.path.qd[:, 1]) > 0.2
    moving[:100] = moving[-100:] = False
    np.testing.assert_allclose(missing.remainder(name)[moving, 1], true[moving], atol=2e-2 * np.abs(true).max())


def test_a_count_above_its_limit_is_missed():
    """Of 12 fits with a mean of 0.1 at most, five or more have a false effect in less than 1 of 100 studies (binomial: 0.0043)."""
    assert table.exceeds([1] * 5 + [0] * 7, 0.1) and not table.exceeds([1] * 2 + [0] * 10, 0.1)
    assert not table.exceeds([0] * 12, 0.1)


def test_twelve_fits_reach_the_limits(lines):
    """No limit but one is missed by its one-sided 99 % bound: one of the eight fails by chance in less than 8 of 100 changes of the seeds, which are fixed.

    Bins of probabilities and the worst world need more fits than 12 and are left to the study, where false effects per fit miss their limit.
    """
    assert len(lines) == 12
    left = ("PIP 0.", "… worst world", "established and false")
    missed = [row[:3] for row in table.limits(lines) if row[-1] == "missed" and not row[0].startswith(left)]
    assert not missed, table.markdown(lines)

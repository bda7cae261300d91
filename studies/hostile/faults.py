"""Plausible mistakes of logs, each a function of a study, with its smallest size: the one table that the study and its tests read.

    study = faulty_study("joint_degrees", World("panda"), Recorder())

A size is the smallest at which the held-out error or a mass changes by more than 10 % on most of the nine worlds (`python mistakes.py --sizes`
prints the changes).
"""

from dataclasses import dataclass, replace

import numpy as np
from arms import Log, Recorder, Study, World, gravity_torque, make_log, make_study, nominal_torque


@dataclass(frozen=True)
class Fault:
    """A mistake: its size in words, what applies it, and the world and recorder it needs beside those asked for."""

    size: str
    apply: object  # function of (study, rng)
    codes: tuple = ()  # of findings; one of them must be there
    subject: str = "any"  # what the finding must name: "log", "joint" or anything
    error: str = ""  # pattern of an error that names it as well, where the program refuses the log
    world: dict = None
    recorder: dict = None


def elbow(study):
    """Joint that a mistake of one joint is made on: the third, or the fourth of seven."""
    return 2 if study.heldout.q.shape[1] == 6 else 3


def names(study, log, joint=None):
    """Notes in the truth where the fault is: the log's file and the joint's index."""
    study.truth.update(log=log, joint=joint)


def logs(study):
    """All logs of a study."""
    return [*study.train, study.heldout]


# --- held-out or fitted logs that are copies -----------------------------------------------------


def copy_exact(study, rng):
    """The held-out log is the first training log."""
    study.heldout = study.train[0].copy()
    names(study, "heldout.csv")


def copy_shifted(study, rng):
    """The same, its first 0.3 s cut off and its clock 1000 s later."""
    kept = study.train[0].rows(study.train[0].t >= 0.3)
    study.heldout = replace(kept, t=kept.t - kept.t[0] + 1000.0)
    names(study, "heldout.csv")


def copy_cut(study, rng):
    """The middle 60 % of the first training log."""
    whole = study.train[0]
    n = len(whole.t)
    study.heldout = whole.rows(slice(n // 5, n - n // 5))
    study.heldout.t = study.heldout.t - study.heldout.t[0]
    names(study, "heldout.csv")


def copy_rounded(study, rng):
    """Position and velocity rounded to 1e-4, torque to 0.01 N m."""
    log = study.train[0].copy()
    study.heldout = replace(log, q=log.q.round(4), qd=None if log.qd is None else log.qd.round(4), tau=log.tau.round(2))
    names(study, "heldout.csv")


def copy_noisy(study, rng):
    """Torque noise of half the log's own is added."""
    log = study.train[0].copy()
    log.tau += 0.5 * np.array(log.truth["noise"]) * rng.normal(size=log.tau.shape)
    study.heldout = log
    names(study, "heldout.csv")


def copy_fitted(study, rng):
    """The second training log is the first one, 0.3 s cut off."""
    kept = study.train[0].rows(study.train[0].t >= 0.3)
    study.train[1] = replace(kept, t=kept.t - kept.t[0])
    names(study, "train2.csv")


# --- units, columns, clocks ----------------------------------------------------------------------


def joint_degrees(study, rng):
    """One joint in degrees, in all logs."""
    j = elbow(study)
    for log in logs(study):
        log.q[:, j] = np.degrees(log.q[:, j])
        if log.qd is not None:
            log.qd[:, j] = np.degrees(log.qd[:, j])
    names(study, None, j)


def torque_other_column(study, rng):
    """One joint's torque column is a copy of the joint's before it, in all logs."""
    j = elbow(study)
    for log in logs(study):
        log.tau[:, j] = log.tau[:, j - 1]
    names(study, None, j)


def torque_constant(study, rng):
    """One joint's torque column is constant, in all logs."""
    j = elbow(study)
    for log in logs(study):
        log.tau[:, j] = log.tau[:, j].mean()
    names(study, None, j)


def torque_held(study, rng):
    """One joint's torque is written anew every 200 ms only, in one log."""
    j, log = elbow(study), study.train[0]
    step = int(round(0.2 * study.recorder.rate))
    log.tau[:, j] = log.tau[(np.arange(len(log.t)) // step) * step, j]
    names(study, "train1.csv", j)


def in_one_log(change, share=None):
    """A fault of the torque of all joints in the first training log."""

    def apply(study, rng):
        study.train[0].tau = change(study, study.train[0], study.train[0].tau)
        names(study, "train1.csv")

    return apply


def in_one_joint(change):
    """A fault of the torque of one joint in all logs."""

    def apply(study, rng):
        j = elbow(study)
        for log in logs(study):
            log.tau[:, [j]] = change(study, log, log.tau[:, [j]])
        names(study, None, j)

    return apply


def in_all(change):
    """A fault of the torque of all joints in all logs."""

    def apply(study, rng):
        for log in logs(study):
            log.tau = change(study, log, log.tau)
        names(study, None)

    return apply


def exchanged(study, rng):
    """Two neighbouring joints have each other's torque, in the first training log."""
    j, log = elbow(study), study.train[0]
    log.tau[:, [j - 1, j]] = log.tau[:, [j, j - 1]]
    names(study, "train1.csv", j)


def not_recorded(study, rng):
    """One joint's torque is 0 throughout the first training log."""
    j = elbow(study)
    study.train[0].tau[:, j] = 0.0
    names(study, "train1.csv", j)


def turned(study, log, tau):
    """Torque of the other sign."""
    return -tau


def scaled(factor):
    """Torque times a factor."""
    return lambda study, log, tau: factor * tau


def at_times(log, tau, t):
    """Torque between samples, linearly; the ends hold."""
    return np.column_stack([np.interp(t, log.t, column) for column in tau.T])


def late(seconds):
    """Torque written this much later."""
    return lambda study, log, tau: at_times(log, tau, log.t - seconds)


def drifting(share):
    """Torque on a clock that runs slower by this share."""
    return lambda study, log, tau: at_times(log, tau, log.t * (1 - share))


def less_model(study, log, tau):
    """Measured torque minus the model's."""
    return tau - nominal_torque(study.world, log)


def less_gravity(study, log, tau):
    """Measured torque minus the model's gravity."""
    return tau - gravity_torque(study.world, log)


def slow_clock(factor):
    """Time stamps stretched by a factor; velocity is what the robot says."""

    def apply(study, rng):
        for log in logs(study):
            log.t = log.t * factor
        names(study, None)

    return apply


def zero_moved(size):
    """One joint's encoder zero moves by this angle in the middle of the first training log."""

    def apply(study, rng):
        j, log = elbow(study), study.train[0]
        log.q[len(log.t) // 2 :, j] += size
        names(study, "train1.csv", j)

    return apply


def encoder_stuck(seconds):
    """One joint's position holds its value for this time while the joint moves, in the first training log."""

    def apply(study, rng):
        j, log = elbow(study), study.train[0]
        rows = int(seconds * study.recorder.rate)
        path = np.abs(np.diff(log.q[:, j], prepend=log.q[0, j])).cumsum()
        moved = path[rows:] - path[:-rows]
        begin = int(np.argmax(moved))
        log.q[begin : begin + rows, j] = log.q[begin, j]
        names(study, "train1.csv", j)

    return apply


def heldout_of(**changed):
    """The held-out log is of the same robot in another state."""

    def apply(study, rng):
        study.heldout = make_log(replace(study.world, **changed), study.recorder, len(study.train))
        names(study, "heldout.csv")

    return apply


# --- repeated samples, contacts ------------------------------------------------------------------


def polled(log, rng):
    """A stream of 1 kHz polled by a receiver: its stamps jitter, some samples come twice, as many are missing."""
    n = len(log.t)
    late = np.minimum(rng.exponential(0.12, n), 0.8)
    # the receiver's clock is 0.02 % slow and wanders, so that all phases occur
    phase = 0.5 + 2e-4 * np.arange(n) + 0.4 * np.sin(2 * np.pi * np.arange(n) / 2500.0)
    at = np.arange(n) + phase + late
    at = at[0] + np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(at), 0.7))])
    at -= np.maximum.accumulate(at - (np.arange(n) + phase + 0.8)).clip(0)
    which = np.floor(at).astype(int)
    kept = (which >= 0) & (which < n)
    out = log.rows(which[kept])
    out.t = np.round((at[kept] - at[kept][0]) * 1e-3, 6)
    repeats = int((np.diff(which[kept]) == 0).sum())
    out.truth["repeats"] = repeats
    out.truth["missing"] = int((np.diff(which[kept]) > 1).sum())
    return out


def polled_stream(study, rng):
    """Every log is polled."""
    study.train = [polled(log, rng) for log in study.train]
    study.heldout = polled(study.heldout, rng)
    names(study, None)


def repeated_rows(share, columns):
    """Single rows repeat the row before, with good stamps: in q alone or in all columns."""

    def apply(study, rng):
        for log in logs(study):
            rows = 1 + np.flatnonzero(rng.uniform(size=len(log.t) - 1) < share)
            rows = rows[np.diff(rows, prepend=-9) > 1]
            for values in (log.q,) if columns == "q" else (log.q, log.qd, log.tau):
                if values is not None:
                    values[rows] = values[rows - 1]
            log.truth["repeats"] = len(rows)
        names(study, None)

    return apply


def plateau(log, begin, seconds, edge):
    """Shape of a contact: from 0 to 1 and back within `edge` seconds at both ends."""
    up = np.clip((log.t - log.t[0] - begin) / edge, 0, 1)
    down = np.clip((begin + seconds - (log.t - log.t[0])) / edge, 0, 1)
    return 0.5 - 0.5 * np.cos(np.pi * np.minimum(up, down))


def contact(seconds, times):
    """Contact of the first training log: torque of `times` x Coulomb friction on one joint, away from the ends."""

    def apply(study, rng):
        j, log = elbow(study), study.train[0]
        begin = rng.uniform(2.0, study.recorder.seconds - 2.5)
        size = times * log.truth["coulomb"][j] * rng.choice([-1.0, 1.0])
        log.tau[:, j] += size * plateau(log, begin, seconds, 0.02)
        log.truth["contact"] = [begin, begin + seconds]
        names(study, "train1.csv", j)

    return apply


def pushed_by_hand(study, rng):
    """In every log somebody pushes the arm for 3 s: 6 N m on one joint, some on its neighbours."""
    j = elbow(study)
    for log in logs(study):
        begin = rng.uniform(2.0, study.recorder.seconds - 5.5)
        shape = plateau(log, begin, 3.0, 0.3)
        for joint, share in ((j, 1.0), (j - 1, 0.5), (j + 1, 0.3)):
            log.tau[:, joint] += 6.0 * share * shape
        log.truth["contact"] = [begin, begin + 3.0]
    names(study, None, j)


def nothing(study, rng):
    """A good study."""
    names(study, None)


def same_programme(study, rng):
    """All logs are recordings of one programme: another day's noise, no copies."""
    count = len(study.train)
    made = [make_log(study.world, study.recorder, which, programme=0) for which in range(count + 1)]
    study.train, study.heldout = made[:-1], made[-1]
    names(study, None)


COPY = ("copied_log",)
LAG = ("torque_lag",)
REPEATED = ("repeated_samples",)
CONTACT = ("contact", "torque_spike")
FAULTS = {
    "none": Fault("good logs", nothing),
    "same_programme": Fault("good logs of one programme", same_programme),
    "copy_exact": Fault("held-out log is a training log", copy_exact, COPY, "log", "fitted and held out"),
    "copy_shifted": Fault("the same, 0.3 s cut, clock + 1000 s", copy_shifted, COPY, "log"),
    "copy_cut": Fault("the middle 60 % of a training log", copy_cut, COPY, "log"),
    "copy_rounded": Fault("q to 1e-4 rad, torque to 0.01 N·m", copy_rounded, COPY, "log"),
    "copy_noisy": Fault("+ half the log's own torque noise", copy_noisy, COPY, "log"),
    "copy_fitted": Fault("a training log twice, 0.3 s cut", copy_fitted, COPY, "log", "given twice|same recording"),
    "joint_degrees": Fault("one joint, all logs", joint_degrees, ("degrees",), "joint", "degrees"),
    "torque_other_column": Fault("one joint has its neighbour's torque", torque_other_column, ("torque_copied",), "joint"),
    "torque_constant": Fault("one joint, all logs", torque_constant, ("constant_torque", "torque_constant"), "joint"),
    "torque_held": Fault("one joint, one log, new every 200 ms", torque_held, ("torque_held", "stale_torque"), "joint"),
    "zero_one_log": Fault("0 throughout, one joint, one log", not_recorded, ("constant_torque", "torque_constant"), "joint"),
    "exchanged_one_log": Fault("two joints' torque, one log", exchanged, ("log_torque_exchanged",), "log"),
    "turned_one_log": Fault("all joints of one log", in_one_log(turned), ("sign_flip", "log_torque_factor"), "log"),
    "turned_one_joint": Fault("one joint, all logs", in_one_joint(turned), ("sign_flip", "joint_torque_factor"), "joint"),
    "scaled_one_log": Fault("× 1.2, all joints of one log", in_one_log(scaled(1.2)), ("torque_scale", "log_torque_factor"), "log"),
    "scaled_one_joint": Fault("× 1.3, one joint, all logs", in_one_joint(scaled(1.3)), ("torque_scale", "joint_torque_factor"), "joint"),
    "late_one_log": Fault("60 ms, all joints of one log", in_one_log(late(0.06)), ("torque_lag", "log_torque_lag"), "log"),
    "late_one_joint": Fault("60 ms, one joint, all logs", in_one_joint(late(0.06)), ("torque_lag", "joint_torque_lag"), "joint"),
    "late_all": Fault("40 ms, all joints, all logs", in_all(late(0.04)), LAG),
    "torque_drift": Fault("0.1 % over 60 s, all logs", in_all(drifting(0.001)), ("clock_drift",), recorder={"seconds": 60.0, "rate": 125}),
    "less_model": Fault("measured minus model", in_all(less_model), ("model_torque",)),
    "less_gravity": Fault("gravity-compensated", in_all(less_gravity), ("gravity_compensated",)),
    "scaled_all": Fault("× 1.2, all joints, all logs", in_all(scaled(1.2)), ("torque_scale", "common_factor")),
    "slow_clock": Fault("stamps × 1.1, all logs", slow_clock(1.1), ("clock_scale", "common_factor")),
    "upside_down": Fault("base turned by 180° about x", nothing, ("base_orientation",), world={"base_rpy": (np.pi, 0.0, 0.0)}),
    "on_the_wall": Fault("base turned by 90° about y", nothing, ("base_orientation",), world={"base_rpy": (0.0, np.pi / 2, 0.0)}),
    "zero_moved": Fault("0.1 rad, one joint, mid of one log", zero_moved(0.1), ("position_step", "encoder_reset", "zero_moved"), "joint"),
    "encoder_stuck": Fault("1 s, one joint, one log", encoder_stuck(1.0), ("encoder_stuck",), "joint"),
    "other_friction": Fault("held-out log: friction × 1.5", heldout_of(friction_factor=1.5), ("another_state",), "log"),
    "other_payload": Fault("held-out log: payload 1.5 → 3 kg", heldout_of(payload=3.0), ("another_state",), "log"),
    "polled": Fault("1 kHz, 6 % repeated, stamps 0.7–1.8 ms", polled_stream, REPEATED, recorder={"rate": 1000}),
    "repeated_q": Fault("1 % of rows, q alone", repeated_rows(0.01, "q"), REPEATED),
    "repeated_all": Fault("1 % of rows, all columns", repeated_rows(0.01, "all"), REPEATED),
    "contact": Fault("0.3 s, 5 × Coulomb, one joint, one log", contact(0.3, 5.0), CONTACT, "joint"),
    "pushed_by_hand": Fault("3 s, 6 N·m, every log", pushed_by_hand, CONTACT, "log"),
}
# Mistakes that are repaired and said: the answer may be "Yes" beside their finding.
REPAIRED = ("polled", "repeated_q", "repeated_all", "contact", "pushed_by_hand", "late_all", "late_one_joint")
GOOD = ("none", "same_programme")


def faulty_study(name, world=World(), recorder=Recorder(), count=2):
    """A study of this world with the fault `name`."""
    fault = FAULTS[name]
    study = make_study(replace(world, **(fault.world or {})), replace(recorder, **(fault.recorder or {})), count)
    study.truth["fault"] = name
    fault.apply(study, np.random.default_rng([world.seed, list(FAULTS).index(name)]))
    return study

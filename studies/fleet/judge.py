"""Is what `twincal fleet` reports true? Effects of the type and deviations of units are judged against the truth of the fleet.

    right      the effect that was planted: same joint and family, or any level of the body at the flange
    stand_in   another effect whose columns describe 80 % or more of the planted torque, weighted by the noise
    wrong      all else

A unit is named where `deviates` says so, its effects from a PIP of 0.5 on, or the likeliest where none reaches it. `judged` returns a row for JSON lines.
"""

import sys
from datetime import datetime
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "worlds"))
from columns import INERTIAL, MOMENTS, TENSOR, Formulas, column_torque  # noqa: E402
from defects import Defects, torque  # noqa: E402
from fleets import GRIPPER, ONSET, Fleet, Unit, type_of  # noqa: E402
from shared import COULOMB_VELOCITY  # noqa: E402
from worlds import links_of  # noqa: E402

MOVING = 0.05  # rad/s: slower than this a joint may be about to turn
NAMED = 0.5  # PIP
SURE = 0.99  # PIP of a true effect of the type
STAND_IN = 0.8
THIN = 10
# Columns of a family with more than one
COLUMNS = {"tilt": "xyz", "spring": ("k", "offset"), "potential": ("sin", "cos", "sin2", "cos2"), "asymmetry": ("viscous", "coulomb"),
           "coupled_friction": ("viscous", "coulomb"), "density": ("value",), "mass_scale": ("value",), "mass_moments": MOMENTS,
           "com": MOMENTS[1:], "centre_of_mass": MOMENTS[1:], "tensor": TENSOR}  # fmt: skip


def is_true(cause, name):
    """Whether an effect of this name is the cause: `true` of `studies/worlds`, or a level of its body."""
    return name in cause["true"] or (name.rpartition(".")[0] in cause["body"] and name.rpartition(".")[2] in INERTIAL)


def matches(one, name, truth):
    """Whether an effect of this name is a planted deviation."""
    return is_true(truth["type"][0], name) if one["kind"] == "mass" else name == one["effect"]


class StandIns:
    """Which effects describe the torque of a planted deviation, along the motion of its first window."""

    def __init__(self, fleet, robot):
        self.unit = Unit(fleet, fleet.names.index(robot) + 1)
        self.path = self.unit.thinned(self.unit.path(ONSET, fleet.seconds), THIN)
        self.formulas = Formulas(fleet.robot, self.path, COULOMB_VELOCITY)
        self.scale = 1.0 / type_of(fleet).noise_sd

    def planted(self, one):
        """Torque of a deviation."""
        arm, as_delivered = self.unit.state(0)
        if one["kind"] == "drag":
            return one["size"] * np.tanh(self.path.qd / COULOMB_VELOCITY) * np.eye(len(arm.coulomb))[one["joint"]]
        zero = np.array(as_delivered.zero)
        if one["kind"] == "zero":
            zero[one["joint"]] += one["size"]
        gripper = (one["size"], GRIPPER) if one["kind"] == "mass" else None
        base = Defects(zero=as_delivered.zero)
        return torque(arm, Defects(zero=tuple(zero), payload=gripper), self.path) - torque(arm, base, self.path)

    def columns(self, effect, family):
        """Columns of an effect, (samples joints) x columns; None where there is no formula."""
        if effect.partition(".")[0] == "payload":
            flange = links_of(self.formulas.model, self.formulas.model.nv - 1)[0]
            found = [self.formulas.body(flange, lambda joint, placement, k=k: np.eye(10)[k]) for k in range(10)]
        elif family in INERTIAL:
            component = lambda name: {"name": effect, "parameters": [{"name": name, "mean": 1.0}]}
            found = [self.formulas.inertial(component(name), True) for name in COLUMNS[family]]
        else:
            terms = [f"{effect}.{column}" for column in COLUMNS.get(family, ("",))]
            found = [column_torque(self.formulas, {"name": effect, "family": family}, term) for term in terms]
        return None if any(part is None for part in found) else np.stack([(part * self.scale).ravel() for part in found], axis=1)

    def describes(self, one, effect, family):
        """Share of a deviation's mean square that the effect's columns take off."""
        columns, goal = self.columns(effect, family), (self.planted(one) * self.scale).ravel()
        if columns is None or not goal.any():
            return 0.0
        rest = goal - columns @ np.linalg.lstsq(columns, goal, rcond=None)[0]
        return float(1.0 - (rest @ rest) / (goal @ goal))


def value_of(effect, one):
    """The reported parameter that a deviation's size is compared with: the mass of a body, else the first."""
    names = ("mass", "m") if one["kind"] == "mass" else ()
    found = [p for p in effect["parameters"] if not names or p["name"] in names]
    return found[0] if found else None


def inside(parameter, value):
    """Whether the 95 % interval holds a value; None where there is no interval."""
    low, high = parameter["interval95"] if parameter and parameter.get("interval95") else (None, None)
    return None if low is None or high is None else bool(low <= value <= high)


def window_of(windows, time):
    """Index of the window in which a time lies; the first where `time` is None."""
    starts = [datetime.fromisoformat(window["start"]) for window in windows]
    return 0 if time is None else max(sum(start <= datetime.fromisoformat(time) for start in starts) - 1, 0)


def judge_type(truth, said):
    """Effects of the type: how many of the true ones are sure, which are missing, which named ones are false, and true values inside."""
    causes = truth["type"]
    candidates = [cause for cause in causes if cause["family"] in ("payload", "viscous", "coulomb")]
    pip = lambda cause: max((effect["pip"] for effect in said if is_true(cause, effect["effect"])), default=0.0)
    missed = [cause["exact"][0] for cause in candidates if pip(cause) <= SURE]
    false = [effect["effect"] for effect in said if effect["pip"] >= NAMED and not any(is_true(cause, effect["effect"]) for cause in causes)]
    held = []
    for effect in said:
        for cause in candidates:
            if is_true(cause, effect["effect"]) and effect["pip"] >= NAMED:
                kind = "mass" if cause["family"] == "payload" else "other"
                held.append(inside(value_of(effect, {"kind": kind}), cause["size"]))
    held = [one for one in held if one is not None]
    return {"true": len(candidates), "found": len(candidates) - len(missed), "missed": missed, "false": false, "inside": sum(held), "intervals": len(held)}


def judge_effects(truth, planted, named, stand_ins):
    """Named effects of one unit, each right, stand_in or wrong."""
    rows = []
    for effect in named:
        row = {"effect": effect["effect"], "pip": effect["pip"], "judged": "wrong"}
        if any(matches(one, effect["effect"], truth) for one in planted):
            row["judged"] = "right"
        elif planted:
            row["describes"] = max(stand_ins().describes(one, effect["effect"], effect["family"]) for one in planted)
            row["judged"] = "stand_in" if row["describes"] >= STAND_IN else "wrong"
        rows.append(row)
    return rows


def judge_deviation(truth, windows, unit, one, named):
    """One planted deviation: size, whether it is named, by how many windows its onset is off, whether the interval covers it."""
    row = {name: one[name] for name in ("kind", "effect", "size", "standard_error", "scatter_sds", "total")}
    mine = [effect for effect in named if matches(one, effect["effect"], truth)]
    best = max(mine or named, key=lambda effect: effect["pip"], default=None)
    row["found"] = bool(mine)
    if mine:
        parameter = value_of(best, one)
        row |= {"pip": best["pip"], "covers": inside(parameter, one["size"]), "covers_total": inside(parameter, one["total"]),
                "value": parameter and parameter["value"], "interval95": parameter and parameter["interval95"]}  # fmt: skip
    first = window_of(windows, unit["starts"][truth["onset"]])
    row["onset_off"] = None if best is None else window_of(windows, best["since"]) - first
    return row


def named_effects(said):
    """Deviations of a unit from a PIP of 0.5 on, or the likeliest one where none reaches it."""
    sure = [effect for effect in said["deviations"] if effect["pip"] >= NAMED]
    return sure or sorted(said["deviations"], key=lambda effect: -effect["pip"])[:1]


def judge_unit(truth, fleet, windows, unit, said):
    """One unit that deviates, is named, or both."""
    planted = unit["deviations"]
    named = named_effects(said) if said["deviates"] else []
    made = []

    def stand_ins():
        if not made:
            made.append(StandIns(fleet, unit["robot"]))
        return made[0]

    return {"robot": unit["robot"], "deviates": bool(planted), "named": said["deviates"], "pip": said["pip"],
            "effects": judge_effects(truth, planted, named, stand_ins),
            "planted": [judge_deviation(truth, windows, unit, one, named) for one in planted]}  # fmt: skip


def judged(truth, said):
    """The judgement of one fleet.json."""
    fleet = Fleet(**truth["fleet"])
    reported = {unit["robot"]: unit for unit in said["units"]}
    rows, absent = [], []
    for unit in truth["units"]:
        own = reported.get(unit["robot"])
        if own is None:
            absent.append(unit["robot"])
            own = {"deviates": False, "pip": 0.0, "deviations": []}
        if unit["deviations"] or own["deviates"]:
            rows.append(judge_unit(truth, fleet, said["windows"], unit, own))
    return {"type": judge_type(truth, said["type_effects"]), "robots": rows, "absent": absent, "left_out": len(said.get("left_out", []))}


def pooling(truth, motion, alone, pooled):
    """Held-out error of the short unit's twin from the fleet over that of the twin fitted to its log alone.

    `alone` and `pooled` are rows of the motion and torque there. Errors are against the torque without noise, in standard deviations of
    each joint's noise, over the rows that both predict and in which a joint has been moving for 0.1 s and goes on for 0.1 s: about a
    reversal both err by what the plan's filter makes of the jump of dry friction.
    """
    sd, clean = np.array(truth["noise_sd"]), motion["tau"]
    common, first, second = np.intersect1d(alone[0], pooled[0], return_indices=True)
    reach = round(0.1 / (motion["t"][1] - motion["t"][0]))
    padded = np.pad(np.abs(motion["qd"]), ((reach, reach), (0, 0)), mode="edge")
    slowest = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=0).min(axis=-1)
    moves = slowest[common] > MOVING
    error = lambda said, rows: float(np.sqrt(np.mean((((said[rows] - clean[common]) / sd) ** 2)[moves])))
    own, shared = error(alone[1], first), error(pooled[1], second)
    return {"alone": own, "pooled": shared, "ratio": shared / own}

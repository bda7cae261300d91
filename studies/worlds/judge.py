"""Is what a fit reports true? Every component beyond viscous and Coulomb friction is judged against the truth of its world.

    true       the cause acts: same joint or link, same family; levels of a body count as that body; friction with memory is
               hysteresis or Stribeck friction of that joint
    stand_in   only where a cause has no candidate: the component takes 80 % or more off the mean square of the torque of these
               causes on the third, noise-free motion, over the joints on which the component acts, viscous and Coulomb friction
               being free in both (they would take their part of it anyway)
    false      all else

`judged` returns a row for JSON lines; nothing in it is read from words.
"""

import numpy as np
from columns import INERTIAL, Formulas, component_torque
from defects import Path as Motion

FRICTION = ("viscous", "coulomb")
ESTABLISHED, FULL_SET = 0.95, 4
STAND_IN = 0.8
KEPT = 0.02  # components below this PIP are not kept in the row


def status_of(component, groups):
    """`components[].status`; for programs without it what comes nearest, from PIP, `selected` and unsettled groups."""
    if "status" in component:
        return component["status"]
    pip = component["pip"] or 0.0
    if pip >= ESTABLISHED and component["selected"]:
        return "established"
    named = any(component["name"] in g["members"] and g["pip"] >= ESTABLISHED and len(g["members"]) <= FULL_SET and not g.get("settled") for g in groups)
    if named and pip >= 0.05:
        return "equivalent"
    if component.get("verdict") == "not_seen":
        return "unidentifiable"
    return "absent" if pip < 0.2 else "tentative"


def is_true(cause, name):
    """Whether a component of this name counts as the cause."""
    subject, _, family = name.rpartition(".")
    return name in cause["true"] or (subject in cause["body"] and family in INERTIAL) or (subject == "payload" and "payload" in cause["true"])


def has_candidate(cause, names):
    """Whether the program looks for it: some component of the result describes it exactly."""
    return bool(set(cause["exact"]) & set(names))


class StandIns:
    """Judges components where causes have no candidate."""

    def __init__(self, truth, result, folder, missing, predict):
        third = np.load(folder / "third.npz")
        self.result, self.predict, self.parts = result, predict, None
        motion = Motion(third["t"], third["q"], third["qd"], third["qdd"])
        self.formulas = Formulas(truth["world"]["robot"], motion, result["signal"]["coulomb_velocity"])
        self.replaced = self.beyond_friction(sum(third["effects"][k] for k in missing))

    def beyond_friction(self, torque):
        """What viscous and Coulomb friction of each joint cannot explain of a torque."""
        rest = torque.copy()
        for j in range(torque.shape[1]):
            columns = np.stack([self.formulas.path.qd[:, j], self.formulas.turn[:, j]], axis=1)
            rest[:, j] -= columns @ np.linalg.lstsq(columns, torque[:, j], rcond=None)[0]
        return rest

    def remainder(self, name):
        """Torque of a component of one joint without a formula: what the twin's prediction has there beyond nominal torque and all formulas.

        None where several such components of that joint are likely, or it is no joint's.
        """
        if self.parts is None:
            self.parts = {c["name"]: component_torque(self.formulas, self.result, c["name"], mean="mean") for c in self.result["components"]}
        pips = {c["name"]: c["pip"] or 0.0 for c in self.result["components"]}
        joint = name.rpartition(".")[0]
        beside = [other for other, part in self.parts.items() if part is None and other.rpartition(".")[0] == joint and pips[other] >= KEPT]
        if beside != [name] or joint not in self.formulas.names:
            return None
        j, out = self.formulas.names.index(joint), np.zeros_like(self.formulas.nominal)
        rows, predicted = self.predict(self.formulas.path, self.formulas.names)
        known = self.formulas.nominal + sum(part for part in self.parts.values() if part is not None)
        out[rows, j] = (predicted[:, j] - known[rows, j]) / pips[name]
        return out

    def share(self, name):
        """Share of the mean square that a component takes off; None where its torque is not known."""
        torque = component_torque(self.formulas, self.result, name)
        if torque is None and (torque := self.remainder(name)) is None:
            return None
        own = self.beyond_friction(torque)
        acts = np.sqrt((own**2).mean(0)) > 1e-3 * max(np.sqrt((own**2).mean(0)).max(), 1e-12)
        goal = (self.replaced[:, acts] ** 2).sum()
        return float(1.0 - ((self.replaced[:, acts] - own[:, acts]) ** 2).sum() / goal) if goal > 0 else 0.0


def judge_components(truth, result, folder, predict=None):
    """Rows of components and whether each cause has a candidate."""
    names = [c["name"] for c in result["components"]]
    candidate = [has_candidate(cause, names) for cause in truth["causes"]]
    missing = [k for k, there in enumerate(candidate) if not there]
    stand_ins, rows = None, []
    for component in result["components"]:
        pip = component["pip"]
        status = status_of(component, result["groups"])
        if component["family"] in FRICTION or pip is None or (pip < KEPT and status in ("absent", "unidentifiable")):
            continue
        row = {"name": component["name"], "family": component["family"], "pip": round(pip, 6), "status": status,
               "verdict": component.get("verdict"), "judged": "false"}  # fmt: skip
        if any(is_true(cause, component["name"]) for cause in truth["causes"]):
            row["judged"] = "true"
        elif missing and pip >= 0.5:
            stand_ins = stand_ins or StandIns(truth, result, folder, missing, predict)
            row["takes_off"] = stand_ins.share(component["name"])
            if row["takes_off"] is not None and row["takes_off"] >= STAND_IN:
                row["judged"] = "stand_in"
        rows.append(row)
    return rows, candidate


def judge_sets(truth, result, rows):
    """Sets that are claims: at most four members, probability 0.95 or more, none established, none viscous or Coulomb friction; once each."""
    status = {row["name"]: row["status"] for row in rows}
    judged = {row["name"]: row["judged"] for row in rows}
    sets = []
    for group in result["groups"]:
        members = group["members"]
        families = {c["family"] for c in result["components"] if c["name"] in members}
        if group["pip"] is None or group["pip"] < ESTABLISHED or len(members) > FULL_SET or families & set(FRICTION):
            continue
        if any(status.get(member) == "established" for member in members):
            continue
        holds = any(is_true(cause, member) for cause in truth["causes"] for member in members)
        stands = any(judged.get(member) == "stand_in" for member in members)
        sets.append({"members": members, "pip": round(group["pip"], 6), "judged": "true" if holds else "stand_in" if stands else "false",
                     "inertial": families <= set(INERTIAL)})  # fmt: skip
    return sets


def judge_causes(truth, result, rows, candidate):
    """Per cause: its size, whether it has a candidate, and whether it is established or in a set of at most three."""
    out = []
    for cause, there in zip(truth["causes"], candidate):
        mine = [row for row in rows if is_true(cause, row["name"])]
        groups = [g for g in result["groups"] if (g["pip"] or 0.0) >= ESTABLISHED and len(g["members"]) <= 3]
        in_set = any(is_true(cause, member) for group in groups for member in group["members"])
        out.append({"family": cause["family"], "subject": cause["subject"], "size": cause["size"], "standard_errors": round(cause["standard_errors"], 2),
                    "candidate": there, "established": any(row["status"] == "established" for row in mine), "in_set": in_set,
                    "pip": max((row["pip"] for row in mine), default=0.0)})  # fmt: skip
    return out


def masses(truth, result):
    """Reported masses of bodies that are really there: {family: [reported, truth, low, high, PIP]} of the likeliest level with a mass."""
    out = {}
    for cause in truth["causes"]:
        if cause["family"] not in ("payload", "body"):
            continue
        nominal, found = truth["nominal_mass"][truth["links"][cause["body"][0]]], []
        for component in result["components"]:
            if not is_true(cause, component["name"]) or (component["pip"] or 0.0) < 0.5:
                continue
            for parameter in component["parameters"]:
                scaled = nominal if component["family"] in ("mass_scale", "density") else None
                factor = 1.0 if parameter["name"] in ("mass", "m") else scaled
                if factor and parameter["interval95"][0] is not None:
                    low, high = (factor * end for end in parameter["interval95"])
                    found.append([component["name"], factor * parameter["mean"], cause["size"], low, high, component["pip"]])
                    break
        out[cause["family"]] = max(found, key=lambda one: one[5], default=None)
    return out


def heldout(result, friction):
    """Moving held-out rows: joints' rows, coverage, error, and the error with nominal torque, friction and motor inertia alone."""
    scores = result["validation"]["moving"]["joints"]
    base = {row["joint"]: row["rmse_calibrated"] for row in friction["validation"]["moving"]["joints"]} if friction else {}
    return [{"joint": row["joint"], "rows": row["rows"], "coverage": row["coverage95"], "rmse": row["rmse_calibrated"],
             "rmse_friction": base.get(row["joint"])} for row in scores]  # fmt: skip


def judged(truth, result, friction, folder, predict):
    """The judgement of one fit. `predict(path, joints)` gives rows of a motion and the twin's torque there."""
    rows, candidate = judge_components(truth, result, folder, predict)
    return {"components": rows, "sets": judge_sets(truth, result, rows), "causes": judge_causes(truth, result, rows, candidate),
            "well_specified": all(candidate), "masses": masses(truth, result), "heldout": heldout(result, friction)}  # fmt: skip

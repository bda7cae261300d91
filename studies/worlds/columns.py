"""Torque of a reported component along a motion, from the numbers in result.json and Pinocchio.

    component_torque(Formulas("ur5", path, 0.01), result, "elbow_joint.spring")     # samples x joints, N m; None without a formula here

The formulas are those of docs/components.md, with the coefficients of `terms[]`; bodies go by `components[].parameters`.
`tests/python/test_worlds.py` compares their sum with `twincal predict`.
"""

import xml.etree.ElementTree as tree
from functools import lru_cache

import numpy as np
import pinocchio as pin
import sympy
from shared import load, model_file, rigid_torque

MOMENTS = ("m", "mx", "my", "mz")
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
INERTIAL = ("payload", "payload_tensor", "mass_moments", "tensor", "mass_scale", "density", "com", "centre_of_mass")


class Formulas:
    """Columns of a robot along a motion; what several columns need is worked out once."""

    def __init__(self, robot, path, coulomb_velocity):
        self.robot, self.model, self.path, self.v_s = robot, load(robot), path, coulomb_velocity
        model = self.model
        self.names = list(model.names)[1:]
        self.data = model.createData()
        self.nominal = rigid_torque(model, path.q, path.qd, path.qdd)
        self.turn = np.tanh(path.qd / coulomb_velocity) if coulomb_velocity else np.sign(path.qd)
        self.regressors = None

    def body(self, link, inertia_of):
        """Torque of an inertia that is added to the body of a link; `inertia_of` gives its ten parameters about the joint's frame."""
        if self.regressors is None:
            rows = zip(self.path.q, self.path.qd, self.path.qdd)
            self.regressors = np.array([pin.computeJointTorqueRegressor(self.model, self.data, *row).copy() for row in rows])
        frame = self.model.frames[self.model.getFrameId(link)]
        joint = frame.parentJoint
        return self.regressors[:, :, 10 * (joint - 1) : 10 * joint] @ inertia_of(joint, frame.placement)

    def inertial(self, component, whole):
        """Torque of payload or of a level of a body, from its parameters: those are physical whatever columns the program has for them.

        `whole`: the levels are about the centre of mass of all links that are fixed to each other, not of the named link alone.
        """
        link, _, level = component["name"].rpartition(".")
        values = {p["name"]: p["mean"] for p in component["parameters"] if p["mean"] is not None}

        def parameters(joint, placement):
            if level in ("mass_scale", "density"):
                return values["value"] * self.model.inertias[joint].toDynamicParameters()
            centre = placement.actInv(self.model.inertias[joint].lever) if whole else own_inertial(self.robot, link).lever
            return moved(sum(size * own_inertia(name, centre) for name, size in values.items()), placement)

        return self.body(link, parameters)

    def payload(self, component):
        """Torque of a payload from mass, centre of mass (or first moments) and tensor, all about the origin of its frame."""
        link = component["story"].removeprefix("payload at ")
        values = {p["name"]: p["mean"] for p in component["parameters"] if p["mean"] is not None}
        mass = values.get("mass", 0.0)
        moments = [values.get(f"m{axis}", mass * values.get(f"com_{axis}", 0.0)) for axis in "xyz"]
        tensor = sum(values.get(name, 0.0) * tensor_parameters(name) for name in TENSOR)
        return self.body(link, lambda joint, placement: moved(np.concatenate([[mass], moments, np.zeros(6)]) + tensor, placement))

    def gravity(self, axis):
        """Torque per unit of gravity."""
        turned = self.model.copy()
        turned.gravity.linear = np.eye(3)["xyz".index(axis)]
        data = turned.createData()
        return np.array([pin.computeGeneralizedGravity(turned, data, q).copy() for q in self.path.q])

    def encoder_zero(self, joint):
        """Derivative of the nominal torque by one position."""
        step = np.zeros(len(self.names))
        step[joint] = 1e-5
        ahead, behind = (rigid_torque(self.model, self.path.q + s * step, self.path.qd, self.path.qdd) for s in (1, -1))
        return (ahead - behind) / 2e-5

    def on_joint(self, family, j, column):
        """Torque that acts on joint j alone."""
        q, qd, qdd, turn = self.path.q[:, j], self.path.qd[:, j], self.path.qdd[:, j], self.turn[:, j]
        if family == "spring":
            return {"k": q, "stiffness": q, "slope": q}.get(column, np.ones_like(q))
        if family == "potential":
            order = 2 if "2" in column else 1
            return -order * np.sin(order * q) if "cos" in column else order * np.cos(order * q)
        if family == "asymmetry":
            return qd * turn if "viscous" in column else turn**2
        return {
            "viscous": qd, "coulomb": turn, "offset": np.ones_like(q), "motor_inertia": qdd, "stribeck": turn * np.exp(-((qd / 0.1) ** 2)),
            "quadratic_friction": qd * np.abs(qd), "load_friction": np.abs(self.nominal[:, j]) * turn, "gain": self.nominal[:, j],
        }.get(family)  # fmt: skip


@lru_cache(maxsize=64)
def own_inertial(robot, link):
    """A link's own inertia in its frame, as the model file states it: without the links that are fixed to it."""
    single = tree.Element("robot", name="one")
    single.append(next(e for e in tree.parse(model_file(robot)).getroot().iter("link") if e.get("name") == link))
    return pin.buildModelFromXML(tree.tostring(single, encoding="unicode"), pin.JointModelFreeFlyer()).inertias[1]


@lru_cache(maxsize=512)
def expression(text, joints):
    """Euler-Lagrange torque of an expression in q1 ..., qd1 ...: a function of q, qd, qdd (each a list of arrays) per joint."""
    q, qd, qdd = ([sympy.Symbol(f"{name}{j + 1}") for j in range(joints)] for name in ("q", "qd", "qdd"))
    phi = sympy.sympify(text.replace("^", "**"))
    torque = [sum(phi.diff(qd[k], qd[j]) * qdd[j] + phi.diff(qd[k], q[j]) * qd[j] for j in range(joints)) - phi.diff(q[k]) for k in range(joints)]
    return sympy.lambdify([q, qd, qdd], torque, "numpy")


def own_inertia(column, centre):
    """Ten parameters (m, moments, tensor in Pinocchio's order) about a frame of a column of a link, whose centre of mass is at `centre`."""
    if column in TENSOR:
        return tensor_parameters(column)
    return mass_at_centre(centre) if column == "m" else moment_about(column, centre)


def tensor_parameters(column):
    """A unit entry of the tensor. Pinocchio's order is xx, xy, yy, xz, yz, zz."""
    out = np.zeros(10)
    out[4 + ("ixx", "ixy", "iyy", "ixz", "iyz", "izz").index(column)] = 1.0
    return out


def mass_at_centre(centre):
    """A point of 1 kg at the centre of mass."""
    return pin.Inertia(1.0, np.array(centre), np.zeros((3, 3))).toDynamicParameters()


def moment_about(column, centre):
    """A unit first moment about the centre of mass with no tensor about it: about the frame the tensor is 2 (h.c) E - h c' - c h'."""
    h = np.eye(3)[MOMENTS.index(column) - 1]
    tensor = 2 * (h @ centre) * np.eye(3) - np.outer(h, centre) - np.outer(centre, h)
    return np.concatenate([[0.0], h, [tensor[0, 0], tensor[0, 1], tensor[1, 1], tensor[0, 2], tensor[1, 2], tensor[2, 2]]])


def moved(parameters, placement):
    """Ten parameters about a frame, about the joint's frame in which it stands at `placement`."""
    mass, h, rest = parameters[0], parameters[1:4], parameters[4:]
    tensor = np.array([[rest[0], rest[1], rest[3]], [rest[1], rest[2], rest[4]], [rest[3], rest[4], rest[5]]])
    turn, p = placement.rotation, placement.translation
    h, tensor = turn @ h, turn @ tensor @ turn.T
    moments = h + mass * p
    steiner = (2 * (h @ p) + mass * (p @ p)) * np.eye(3) - np.outer(h, p) - np.outer(p, h) - mass * np.outer(p, p)
    tensor = tensor + steiner
    return np.concatenate([[mass], moments, [tensor[0, 0], tensor[0, 1], tensor[1, 1], tensor[0, 2], tensor[1, 2], tensor[2, 2]]])


def coupled(formulas, name, column):
    """Column of `<a>+<b>.coupled_friction` or `.coupled_inertia`."""
    pair, _, family = name.rpartition(".")
    for sign, mark in ((1.0, "+"), (-1.0, "-")):
        for a in formulas.names:
            b = pair.removeprefix(a + mark)
            if pair.startswith(a + mark) and b in formulas.names:
                i, j = formulas.names.index(a), formulas.names.index(b)
                rates = formulas.path.qdd if family == "coupled_inertia" else formulas.path.qd
                speed = rates[:, i] + sign * rates[:, j]
                own = np.tanh(speed / formulas.v_s) if "coulomb" in column else speed
                return i, j, sign, own
    return None


def column_torque(formulas, component, term):
    """Torque per unit of one term of a component; None where there is no formula."""
    name, family = component["name"], component["family"]
    subject, _, _ = name.rpartition(".")
    column = term.removeprefix(name).lstrip(".")
    n = len(formulas.names)
    if family == "tilt":
        return formulas.gravity(column)
    if family in ("coupled_friction", "coupled_inertia"):
        found = coupled(formulas, name, column)
        if found is None:
            return None
        out = np.zeros_like(formulas.path.q)
        out[:, found[0]], out[:, found[1]] = found[3], found[2] * found[3]
        return out
    if family == "generic":
        values = expression(name, n)(formulas.path.q.T, formulas.path.qd.T, formulas.path.qdd.T)
        return np.stack([np.broadcast_to(value, len(formulas.path.t)) for value in values], axis=1)
    if name == "drives.gain":
        return formulas.nominal
    if subject not in formulas.names:
        return None
    joint = formulas.names.index(subject)
    if family == "encoder_zero":
        return formulas.encoder_zero(joint)
    own = formulas.on_joint(family, joint, column)
    return None if own is None else own[:, None] * np.eye(n)[joint]


def component_torque(formulas, result, name, mean="conditional_mean"):
    """Torque of a component with the numbers of result.json (given that it is in, or `mean="mean"`: averaged); None without a formula."""
    component = next(c for c in result["components"] if c["name"] == name)
    if component["family"] in INERTIAL:
        if not any(p["mean"] for p in component["parameters"]):
            return np.zeros_like(formulas.path.q)
        whole = any(c["family"] == "density" for c in result["components"])
        own = formulas.payload(component) if name == "payload" else formulas.inertial(component, whole)
        return own * (component["pip"] or 0.0) if mean == "mean" else own
    terms = {term["name"]: term for term in result["terms"]}
    total = np.zeros_like(formulas.path.q)
    for column in component["columns"]:
        size = terms.get(column, {}).get(mean)
        if not size:
            continue
        own = column_torque(formulas, component, column)
        if own is None:
            return None
        total = total + size * own
    return total

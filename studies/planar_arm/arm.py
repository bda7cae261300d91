"""The arm: its parameters, its MuJoCo model, and the coefficients of its Lagrangian in the candidate library.

Both links move in the vertical x-z plane. With R(a) the rotation by a in that plane, e1 = R(q1)(1, 0) and
w = qd1 + qd2, the Lagrangian of links i with mass m_i, centre of mass c_i = (x_i, z_i) in the link's frame, inertia
J_i about the joint axis, upper-arm length l and gravity g = (gx, gz) is

    L = J1 qd1^2 / 2 + J2 w^2 / 2 + m2 l^2 qd1^2 / 2 + m2 l qd1 w (x2 cos q2 - z2 sin q2)
        + m1 g.R(q1) c1 + m2 g.(l e1 + R(q1 + q2) c2)

It is linear in the parameters, so the difference between two arms is a list of coefficients: `coefficients`.
"""

from dataclasses import dataclass, replace
from math import cos, radians, sin
from pathlib import Path

import mujoco
import numpy as np

ASSETS = Path(__file__).resolve().parents[2] / "crates/twincal-cli/assets"
JOINTS = ("shoulder", "elbow")
BODIES = ("upper_arm", "forearm")

# The built-in generic family of a planar arm with two revolute joints, in twincal's grammar.
GENERIC = tuple(
    factor + shape for shape in ("", "*cos(q2)", "*sin(q2)") for factor in ("qd1^2", "qd1*qd2", "qd2^2")
) + ("sin(q1)", "cos(q1)", "sin(q2)", "cos(q2)", "sin(q1+q2)", "cos(q1+q2)", "q1^2", "q2^2")


@dataclass(frozen=True)
class Link:
    """One rigid body: kg, m, kg m^2 (about the centre of mass, axes of the link)."""

    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, float, float]


@dataclass(frozen=True)
class Arm:
    """Everything that fixes the rigid-body torque of an arm."""

    links: tuple[Link, Link]
    length: float = 0.4
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    payload: float = 0.0
    payload_at: tuple[float, float, float] = (0.35, 0.0, 0.0)
    payload_inertia: float = 0.0


NOMINAL = Arm(
    links=(
        Link(3.0, (0.2, 0.0, 0.0), (0.004, 0.042, 0.042)),
        Link(2.0, (0.15, 0.0, 0.0), (0.002, 0.021, 0.021)),
    )
)


def tilted_gravity(degrees, magnitude=9.81):
    """Gravity as seen by an arm whose base leans forward by this angle about the joint axes."""
    return (magnitude * sin(radians(degrees)), 0.0, -magnitude * cos(radians(degrees)))


# Inertial drift of both links, a payload at the tool, and a base that leans by 1.5 degrees.
REAL = replace(
    NOMINAL,
    links=(
        Link(3.12, (0.21, 0.0, 0.0), (0.0044, 0.0462, 0.0462)),
        Link(2.1, (0.158, 0.0, 0.0), (0.0022, 0.0231, 0.0231)),
    ),
    payload=0.5,
    payload_inertia=3e-4,
    gravity=tilted_gravity(1.5),
)


def mujoco_model(arm):
    """The demo's `arm.xml` with this arm's numbers written into it, compiled."""
    spec = mujoco.MjSpec.from_file(str(ASSETS / "arm.xml"))
    spec.option.gravity = arm.gravity
    for name, link in zip(BODIES, arm.links):
        body = spec.body(name)
        body.mass, body.ipos, body.inertia = link.mass, link.com, link.inertia
        body.explicitinertial = True
    spec.body("forearm").pos = (arm.length, 0.0, 0.0)
    if arm.payload > 0.0:
        load = spec.body("forearm").add_body(name="payload", pos=arm.payload_at)
        load.mass, load.ipos, load.inertia = arm.payload, (0.0, 0.0, 0.0), (arm.payload_inertia,) * 3
        load.explicitinertial = True
    return spec.compile()


def inverse_dynamics(model, q, qd, qdd):
    """Torque of MuJoCo's `mj_inverse` for samples in rows, N x 2, N m."""
    data = mujoco.MjData(model)
    tau = np.empty_like(q)
    for i in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[i], qd[i], qdd[i]
        mujoco.mj_inverse(model, data)
        tau[i] = data.qfrc_inverse
    return tau


def _moments(arm):
    """(J1 + m2 l^2, J2, m2 l x2, m2 l z2, first moments of all that turns with q1, of all that turns with q1 + q2)."""
    upper, fore = arm.links
    mass = fore.mass + arm.payload
    first = [fore.mass * fore.com[a] + arm.payload * arm.payload_at[a] for a in (0, 2)]
    j1 = upper.inertia[1] + upper.mass * (upper.com[0] ** 2 + upper.com[2] ** 2)
    j2 = fore.inertia[1] + fore.mass * (fore.com[0] ** 2 + fore.com[2] ** 2)
    j2 += arm.payload_inertia + arm.payload * (arm.payload_at[0] ** 2 + arm.payload_at[2] ** 2)
    h1 = (upper.mass * upper.com[0] + mass * arm.length, upper.mass * upper.com[2])
    return j1 + mass * arm.length**2, j2, arm.length * first[0], arm.length * first[1], h1, tuple(first)


def coefficients(arm):
    """Coefficient of every generic term in the arm's Lagrangian; the spring and q2 terms of a rigid arm are zero."""
    j1, j2, cx, cz, h1, h2 = _moments(arm)
    gx, _, gz = arm.gravity
    beta = dict.fromkeys(GENERIC, 0.0)
    beta |= {"qd1^2": (j1 + j2) / 2, "qd1*qd2": j2, "qd2^2": j2 / 2}
    beta |= {"qd1^2*cos(q2)": cx, "qd1*qd2*cos(q2)": cx, "qd1^2*sin(q2)": -cz, "qd1*qd2*sin(q2)": -cz}
    beta |= {"cos(q1)": gx * h1[0] + gz * h1[1], "sin(q1)": gz * h1[0] - gx * h1[1]}
    beta |= {"cos(q1+q2)": gx * h2[0] + gz * h2[1], "sin(q1+q2)": gz * h2[0] - gx * h2[1]}
    return beta

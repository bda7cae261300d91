"""What a simulated arm has beyond its model file, and the torque that follows.

    defects = Defects(payload=(1.2, (0.0, 0.01, 0.06)), gain=(0.0, 0.05, 0.0, 0.0, 0.0, 0.0))
    torque(arm, defects, path)                                  # samples x joints, N m, as it is logged
    torque(arm, defects, path) - torque(arm, defects.without("gain"), path)    # what the gain contributes

Viscous and Coulomb friction belong to the arm (`arms.Arm`) and always act. A mechanism that is None does not act.
"""

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
import pinocchio as pin
from shared import BASE_RATE, COULOMB_VELOCITY, lugre, rigid_torque, through_gears

PAYLOAD_RADIUS = 0.05  # m, of a solid ball


@dataclass(frozen=True, eq=False)
class Path:
    """A motion as the encoders show it, without their error: t in s, q, qd, qdd as samples x joints at BASE_RATE."""

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray


@dataclass(frozen=True)
class Defects:
    """Mechanisms. Joints count from 0; a tuple with one number per joint is 0 where nothing is wrong."""

    payload: tuple = None  # mass in kg, centre of mass in the last joint's frame in m
    heavier: tuple = None  # joint whose link is heavier, factor of its mass and tensor
    tilt: tuple = None  # roll, pitch and yaw of the base, rad
    zero: tuple = None  # rad: the joint really stands at q + zero
    gain: tuple = None  # the logged torque is (1 + gain) times the torque
    lugre: tuple = None  # 1 where friction is LuGre's instead of Coulomb's
    warm_up: tuple = None  # time constant in s, and per joint the share of friction that is lost
    flexible: int = None  # seed of the joints' frequencies
    length: tuple = None  # joint whose distance from the joint before is off, factor
    spring: tuple = None  # joint, stiffness in N m/rad, rest position in rad
    slip: tuple = None  # presliding range in rad of Maxwell-slip elements, per joint; 0: Coulomb's friction
    ripple: tuple = None  # joint, periods per turn, amplitude in N m
    load: tuple = None  # share of the rigid torque's size that is added to Coulomb friction

    def without(self, mechanism):
        """The same arm without one mechanism."""
        return replace(self, **{mechanism: None})

    def present(self):
        """Names of the mechanisms that act."""
        return [field.name for field in fields(self) if getattr(self, field.name) is not None]

    def real(self, model):
        """Pinocchio model of the real arm."""
        real = model.copy()
        if self.heavier:
            joint, factor = self.heavier
            link = real.inertias[joint + 1]
            real.inertias[joint + 1] = pin.Inertia(link.mass * factor, link.lever, link.inertia * factor)
        if self.payload:
            mass, centre = self.payload
            ball = pin.Inertia(mass, np.array(centre), 0.4 * mass * PAYLOAD_RADIUS**2 * np.eye(3))
            real.inertias[model.njoints - 1] = real.inertias[model.njoints - 1] + ball
        if self.tilt:
            real.gravity.linear = pin.rpy.rpyToMatrix(*self.tilt).T @ model.gravity.linear
        if self.length:
            joint, factor = self.length
            placement = real.jointPlacements[joint + 1]
            real.jointPlacements[joint + 1] = pin.SE3(placement.rotation, factor * placement.translation)
        return real


@lru_cache(maxsize=8)
def lugre_memory(arm, path):
    """LuGre friction without its viscous part."""
    return lugre(arm, path.qd) - arm.viscous * path.qd


@lru_cache(maxsize=8)
def maxwell_slip(arm, path, ranges):
    """Four elastic sliders per joint with equal shares of Coulomb friction, which slip after a quarter, two quarters … of `ranges` rad."""
    out = np.zeros_like(path.q)
    steps = np.diff(path.q, axis=0)
    for part in np.arange(1, 5) / 4.0:
        reach = np.maximum(part * np.asarray(ranges), 1e-9)
        state = np.zeros(path.q.shape[1])
        for k, step in enumerate(steps, 1):
            state = np.clip(state + step, -reach, reach)
            out[k] += 0.25 * state / reach
    return arm.coulomb * out


def sliding(arm, defects, path):
    """Friction at BASE_RATE, without what depends on load and time."""
    coulomb = arm.coulomb * np.tanh(path.qd / COULOMB_VELOCITY)
    if defects.lugre:
        coulomb = np.where(np.asarray(defects.lugre) > 0, lugre_memory(arm, path), coulomb)
    if defects.slip:
        coulomb = np.where(np.asarray(defects.slip) > 0, maxwell_slip(arm, path, defects.slip), coulomb)
    return arm.viscous * path.qd + coulomb


def torque(arm, defects, path, keep=1):
    """Torque as it is logged, without noise: every `keep`-th sample."""
    some = slice(None, None, keep)
    zero = np.asarray(defects.zero or 0.0)
    qd = path.qd[some]
    rigid = rigid_torque(defects.real(arm.model), path.q[some] + zero, qd, path.qdd[some])
    if defects.flexible is not None:
        rigid = through_gears(arm, np.random.default_rng(defects.flexible), rigid, BASE_RATE / keep)
    friction = sliding(arm, defects, path)[some]
    if defects.warm_up:
        time, shares = defects.warm_up
        friction = friction * (1.0 - np.asarray(shares) * (1.0 - np.exp(-path.t[some, None] / time)))
    if defects.load:
        friction = friction + np.asarray(defects.load) * np.abs(rigid) * np.tanh(qd / COULOMB_VELOCITY)
    tau = rigid + friction
    if defects.spring:
        joint, stiffness, rest = defects.spring
        tau[:, joint] += stiffness * (path.q[some, joint] - rest)
    if defects.ripple:
        joint, periods, height = defects.ripple
        tau[:, joint] += height * np.sin(periods * path.q[some, joint])
    return tau * (1.0 + np.asarray(defects.gain or 0.0))

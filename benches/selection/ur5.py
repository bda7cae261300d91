"""A UR5 with known defects, by Pinocchio: the payload, spring and friction of studies/industrial_arms, and one heavier link.

Candidates are stories of one or several columns: a payload (10), every link's mass (1), a spring (2), and per joint viscous and
Coulomb friction, Stribeck friction and motor inertia (1 each). A story is true or false with all its columns.
"""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin

import rows
from problems import PROBLEMS, noise

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "studies" / "industrial_arms"))
import simulate_arms as arms  # noqa: E402

RATE = 250.0  # of every log, Hz
SECONDS = 20.0
HEAVIER = ("forearm_link", 3, 0.25)  # link, its joint, share of its inertia
LINKS = ("shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link")
PAYLOAD = ("m", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz")  # in Pinocchio's order
# Seen by no motion apart from others: a heavier first link turns like a motor inertia, a heavier last one is a payload.
ALIASES = ("shoulder_link.density", "wrist_3_link.density")
KINDS = ("viscous", "coulomb", "stribeck")


class Data:
    """One problem with one seed: as `planar.Data`."""

    def __init__(self, problem, seed, store):
        self.problem, self.model, self.rate = problem, arms.model_file("ur5"), RATE
        self.nominal = arms.load("ur5")
        self.joints = [self.nominal.names[j + 1] for j in range(6)]
        stories = {"payload": [f"payload.{p}" for p in PAYLOAD]}
        stories |= {f"{link}.density": [f"{link}.density"] for link in LINKS}
        stories |= {f"{j}.spring": [f"{j}.spring.stiffness", f"{j}.spring.preload"] for j in self.joints}
        self.kinds = (KINDS if problem.friction else ()) + ("motor_inertia",)
        stories |= {f"{j}.{kind}": [f"{j}.{kind}"] for kind in self.kinds for j in self.joints}
        self.names, self.columns, self.parts = list(stories), [], []
        for columns in stories.values():
            self.parts.append(list(range(len(self.columns), len(self.columns) + len(columns))))
            self.columns += columns
        viscous, coulomb = arms.effects(6, seed)
        true = {"payload", f"{HEAVIER[0]}.density", f"{self.joints[1]}.spring"}
        true |= {f"{j}.viscous" for j, v in zip(self.joints, viscous) if v} | {f"{j}.coulomb" for j, v in zip(self.joints, coulomb) if v}
        self.true = np.array([name in true for name in self.names])
        self.ignored = np.array([name in ALIASES for name in self.names])
        # Coverage counts the single numbers; the payload's ten are known only in the combinations that turn some joint.
        truth = {name: np.nan for name in stories["payload"]} | {f"{HEAVIER[0]}.density": HEAVIER[2]}
        stiffness, rest = arms.SPRING
        truth |= {f"{self.joints[1]}.spring.stiffness": stiffness, f"{self.joints[1]}.spring.preload": -stiffness * rest}
        truth |= {f"{j}.viscous": v for j, v in zip(self.joints, viscous)} | {f"{j}.coulomb": v for j, v in zip(self.joints, coulomb)}
        self.truth = np.array([truth.get(name, 0.0) for name in self.columns])
        self.logs = {}
        for index, role in enumerate(("train", "heldout")):
            rng = np.random.default_rng([seed, index, 0])
            _, q, qd, qdd = (values[:: round(arms.RATE / RATE)] for values in arms.motion(rng, 6, int(SECONDS * arms.RATE)))
            if problem.poor:
                q, qd, qdd = q.mean(0) + 0.3 * (q - q.mean(0)), 0.3 * qd, 0.3 * qdd
            clean = rigid(real_arm(self.nominal), q, qd, qdd)
            clean += viscous * qd + coulomb * np.tanh(qd / arms.COULOMB_VELOCITY)
            clean[:, 1] += arms.SPRING[0] * (q[:, 1] - arms.SPRING[1])
            rng = np.random.default_rng([seed, list(PROBLEMS).index(problem.name), index])
            tau = clean + noise(rng, q.shape, RATE, problem)
            if problem.encoder:
                q, qd, qdd = q + problem.encoder * rng.standard_normal(q.shape), None, None
            self.logs[role] = {"q": q, "qd": qd, "qdd": qdd, "tau": tau, "clean": clean}

    def config(self):
        """`[library]` for the program: the same stories as the peers' columns."""
        families = ["payload", "density", "spring", *self.kinds]
        words = ", ".join(f'"{family}"' for family in families)
        return f'[library]\nfamilies = [{words}]\npayload_frame = "{LINKS[-1]}"\ncoulomb_velocity = {arms.COULOMB_VELOCITY}\n'

    def samples(self, role, motion_cutoff):
        """Columns (samples x joints x K), residual torque and the same without noise, at every sample; and the motion."""
        log = self.logs[role]
        q, qd, qdd, tau, clean = (log[key] for key in ("q", "qd", "qdd", "tau", "clean"))
        if qd is None:
            (q, qd, qdd), lost = rows.derive(q, RATE, motion_cutoff)
            tau, clean = tau[lost:-lost], clean[lost:-lost]
        data = self.nominal.createData()
        bodies = [inertia.toDynamicParameters() for inertia in list(self.nominal.inertias)[1:]]
        regressor = np.array([pin.computeJointTorqueRegressor(self.nominal, data, *x) for x in zip(q, qd, qdd)])
        links = np.stack([regressor[:, :, 10 * j : 10 * j + 10] @ bodies[j] for j in range(6)], axis=2)
        own = lambda values: values[:, :, None] * np.eye(6)  # column j acts on joint j
        spring = np.concatenate([own(q)[..., None], own(np.ones_like(q))[..., None]], axis=3).reshape(len(q), 6, 12)
        side = np.tanh(qd / arms.COULOMB_VELOCITY)
        kinds = {"viscous": qd, "coulomb": side, "stribeck": side * np.exp(-((qd / 0.1) ** 2)), "motor_inertia": qdd}
        x = np.concatenate([regressor[:, :, -10:], links, spring, *(own(kinds[kind]) for kind in self.kinds)], axis=2)
        tau_nom = links.sum(axis=2)
        return x, tau - tau_nom, clean - tau_nom, (q, qd, qdd, tau)


def real_arm(model):
    """The arm that the logs come from: a solid ball in the last link's frame, and a link that is heavier as it is."""
    real = model.copy()
    ball = 0.4 * arms.PAYLOAD_MASS * arms.PAYLOAD_SIZE**2 * np.eye(3)
    real.inertias[6] = real.inertias[6] + pin.Inertia(arms.PAYLOAD_MASS, arms.PAYLOAD_COM, ball)
    _, joint, share = HEAVIER
    link = real.inertias[joint]
    real.inertias[joint] = pin.Inertia(link.mass * (1 + share), link.lever, link.inertia * (1 + share))
    return real


def rigid(model, q, qd, qdd):
    """Torque of a rigid arm, samples x joints."""
    data = model.createData()
    return np.array([pin.rnea(model, data, *x) for x in zip(q, qd, qdd)])

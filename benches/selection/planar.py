"""The planar arm of studies/planar_arm: logs by MuJoCo, columns by SymPy's Euler-Lagrange operator, without the program.

`Data` is what every arm gives: logs for the program, and for the peers columns and residual torque at every sample.
"""

import json
import sys
from pathlib import Path

import numpy as np

import rows
from problems import PROBLEMS, noise

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "studies" / "planar_arm"))
import candidates  # noqa: E402
from arm import ASSETS, GENERIC, JOINTS, NOMINAL, coefficients  # noqa: E402
from simulate import Settings, simulate, truth  # noqa: E402

RATE = 1000.0  # of every log, Hz
V_S = 0.02  # of Coulomb friction, rad/s
FRICTION = tuple(f"{joint}.{kind}" for kind in ("viscous", "coulomb") for joint in JOINTS)
OFFSETS = tuple(f"{joint}.offset" for joint in JOINTS)
# 17 generic, four friction, two offsets, one of the user's own.
WITH_FRICTION = (("sin(2*q2)",), FRICTION + OFFSETS)
# 17 generic, seven of the user's own.
CONSERVATIVE = (("sin(2*q1)", "cos(2*q1)", "sin(2*q2)", "cos(2*q2)", "q1*q2", "q1^3", "q2^3"), ())


def motion(seed, harmonics, store):
    """Training and held-out log without noise, MuJoCo's; kept in `store`, for it takes longest."""
    path = store / f"planar_{harmonics}_{seed}.npz"
    if not path.exists():
        study = simulate(Settings(train=1, heldout=1, rate_hz=RATE, harmonics=harmonics, seed=seed))
        arrays = {f"{log.role}_{key}": getattr(log, key) for log in study.logs for key in ("q", "qd", "qdd", "clean")}
        partial = path.with_suffix(".part.npz")
        np.savez(partial, **arrays)
        partial.rename(path)
    return np.load(path)


class Data:
    """One problem with one seed."""

    def __init__(self, problem, seed, store):
        user, rest = self.library = WITH_FRICTION if problem.friction else CONSERVATIVE
        harmonics = 1 if problem.poor else 5
        self.problem, self.model, self.rate = problem, ASSETS / "arm.urdf", RATE
        self.columns = list(user + GENERIC + rest)
        terms = truth(Settings())["terms"]
        self.truth = np.array([terms.get(name, 0.0) for name in self.columns])
        if problem.weak:
            self.truth = weak_truth(self.columns, motion(seed, harmonics, store), problem, seed)
        self.true = self.truth != 0
        self.parts = [[k] for k in range(len(self.columns))]  # one column, one component
        self.names, self.ignored = self.columns, np.zeros(len(self.columns), dtype=bool)
        self.logs = {}
        arrays = motion(seed, harmonics, store)
        for index, role in enumerate(("train", "heldout")):
            q, qd, qdd, clean = (arrays[f"{role}_{key}"] for key in ("q", "qd", "qdd", "clean"))
            if problem.weak:
                x, tau_nom = design(self.columns, q, qd, qdd)
                clean = tau_nom + x @ self.truth
            rng = np.random.default_rng([seed, list(PROBLEMS).index(problem.name), index])
            if problem.stribeck:
                clean = clean + problem.stribeck * np.tanh(qd / V_S) * np.exp(-((qd / 0.1) ** 2))
            tau = clean + noise(rng, q.shape, RATE, problem)
            if problem.encoder:
                q, qd, qdd = q + problem.encoder * rng.standard_normal(q.shape), None, None
            self.logs[role] = {"q": q, "qd": qd, "qdd": qdd, "tau": tau, "clean": clean}

    def config(self):
        """`[library]` for the program: the same columns as the peers'."""
        user, rest = self.library
        friction = '["viscous", "coulomb"]' if rest else "[]"
        return (f"[library]\nterms = {json.dumps(user)}\nfriction = {friction}\noffset = {str(bool(rest)).lower()}\n"
                f"motor_inertia = false\ncoulomb_velocity = {V_S}\n")  # fmt: skip

    def samples(self, role, motion_cutoff):
        """Columns (samples x joints x K), residual torque and the same without noise, at every sample; and the motion."""
        log = self.logs[role]
        q, qd, qdd, tau, clean = (log[key] for key in ("q", "qd", "qdd", "tau", "clean"))
        if qd is None:
            (q, qd, qdd), lost = rows.derive(q, RATE, motion_cutoff)
            tau, clean = tau[lost:-lost], clean[lost:-lost]
        x, tau_nom = design(self.columns, q, qd, qdd)
        return x, tau - tau_nom, clean - tau_nom, (q, qd, qdd, tau)


def weak_truth(columns, arrays, problem, seed):
    """Two of five candidates, each of 4 to 40 of its own standard errors in least squares on all columns, log-uniform.

    Standard errors for the noise's long-run variance. Friction is positive: all methods may know that no joint has less.
    """
    rng = np.random.default_rng([seed, 1000])
    x, _ = design(columns, *(arrays[f"train_{key}"] for key in ("q", "qd", "qdd")))
    x = x.reshape(-1, len(columns))
    rho = np.exp(-1 / (RATE * problem.noise_time)) if problem.noise_time else 0.0
    scale = np.sqrt(np.mean(x**2, axis=0))
    covariance = np.linalg.inv((x / scale).T @ (x / scale)) * problem.noise_sd**2 * (1 + rho) / (1 - rho)
    size = np.exp(rng.uniform(np.log(4), np.log(40), len(columns))) * rng.choice([-1, 1], len(columns))
    size = np.where([name in FRICTION for name in columns], np.abs(size), size)
    return np.where(rng.uniform(size=len(columns)) < 0.4, size * np.sqrt(np.diag(covariance)) / scale, 0.0)


def design(columns, q, qd, qdd):
    """Columns (samples x joints x K), and nominal torque as what they give with the nominal arm's coefficients."""
    x = np.stack([column(name, q, qd, qdd) for name in columns], axis=2)
    nominal = coefficients(NOMINAL)
    first = columns.index(GENERIC[0])
    return x, x[:, :, first : first + len(GENERIC)] @ np.array([nominal[name] for name in GENERIC])


def column(name, q, qd, qdd):
    """Torque column of a candidate, samples x joints."""
    joint, dot, kind = name.partition(".")
    if dot:
        return candidates.friction_column(kind, JOINTS.index(joint), qd, V_S)
    return candidates.column(name, q, qd, qdd)

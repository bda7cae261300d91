"""Writes enumeration.json: posteriors over all 2^K models by another formula than the crate's.

A model z is one multivariate t density of the data, with a dense covariance of the rows:

    y | z  ~  t with 2 a0 degrees of freedom, location 0, scale (b0/a0) S_z,     S_z = C + X_z V_z X_z'

C is diag(1/w) for weighted rows and the stationary AR(1) covariance for correlated ones. No Gram matrix, no Schur
complement, no p x p factor: slogdet and solve of an n x n matrix for every model.

    python crates/twincal/tests/reference/infer/make.py
"""

import itertools
import json
import math
import pathlib

import numpy as np
import scipy
from scipy.linalg import block_diag
from scipy.special import betaln, gammaln, logsumexp

HERE = pathlib.Path(__file__).resolve().parent


def log_prior(z, family, inclusion, size):
    if "probability" in inclusion:
        p = inclusion["probability"]
        return sum(math.log(p) if k else math.log1p(-p) for k in z)
    b = size / inclusion["expected_terms"] - 1.0
    total = 0.0
    for f in set(family):
        count = sum(1 for g in family if g == f)
        inside = sum(k for k, g in zip(z, family) if g == f)
        total += betaln(1 + inside, b + count - inside) - betaln(1, b)
    return total


def stationary(rho, runs):
    return block_diag(*[rho ** np.abs(np.subtract.outer(range(n), range(n))) / (1 - rho**2) for n in runs])


def enumerate_models(x, y, covariance, slab, family, inclusion, a0, b0):
    n, size = x.shape
    logs, inside, means, seconds, noises = [], [], [], [], []
    for z in itertools.product([0, 1], repeat=size):
        members = [k for k in range(size) if z[k]]
        xz, v = x[:, members], slab[members]
        s = covariance + (xz * v) @ xz.T
        sign, log_det = np.linalg.slogdet(s)
        assert sign > 0
        q = y @ np.linalg.solve(s, y)
        log_t = (
            gammaln(a0 + n / 2)
            - gammaln(a0)
            - n / 2 * math.log(2 * math.pi * b0)
            - log_det / 2
            - (a0 + n / 2) * math.log1p(q / (2 * b0))
        )
        phi = (b0 + q / 2) / (a0 + n / 2 - 1)
        gain = np.linalg.solve(s, xz * v).T
        mean = np.zeros(size)
        variance = np.zeros(size)
        mean[members] = gain @ y
        variance[members] = phi * np.diag(np.diag(v) - gain @ (xz * v))
        logs.append(log_t + log_prior(z, family, inclusion, size))
        inside.append(z)
        means.append(mean)
        seconds.append(mean**2 + variance)
        noises.append(phi)
    logs = np.array(logs)
    log_evidence = logsumexp(logs)
    weight = np.exp(logs - log_evidence)
    mean = weight @ np.array(means)
    best = int(np.argmax(weight))
    return {
        "pip": (weight @ np.array(inside, dtype=float)).tolist(),
        "mean": mean.tolist(),
        "sd": np.sqrt(weight @ np.array(seconds) - mean**2).tolist(),
        "noise": float(weight @ np.array(noises)),
        "log_evidence": float(log_evidence),
        "best": [k for k in range(size) if inside[best][k]],
        "best_weight": float(weight[best]),
    }


def case(rng, size, rows, correlation, kind, inclusion, families, a0=0.5, b0=0.3):
    common = rng.normal(size=(rows, 1))
    x = math.sqrt(correlation) * common + math.sqrt(1 - correlation) * rng.normal(size=(rows, size))
    x *= 10.0 ** rng.uniform(-1.5, 1.5, size=size)
    beta = np.where(rng.random(size) < 0.4, rng.normal(size=size) / x.std(axis=0), 0.0)
    family = [int(f) for f in rng.integers(0, families, size=size)]
    slab = rng.uniform(0.5, 200.0, size=size) / (x**2).mean(axis=0)
    if kind == "weighted":
        joint = np.arange(rows) >= rows // 3
        w = np.where(joint, 0.25, 9.0)
        covariance = np.diag(1 / w)
        log_constant = 0.5 * np.log(w).sum()
    elif kind == "autoregressive":
        rho, runs = 0.8, [rows // 2, rows // 3, rows - rows // 2 - rows // 3]
        covariance = stationary(rho, runs)
        log_constant = 0.5 * len(runs) * math.log(1 - rho**2)
    else:
        covariance, log_constant = np.eye(rows), 0.0
    y = x @ beta + 0.7 * np.linalg.cholesky(covariance) @ rng.normal(size=rows)
    precision_x = np.linalg.solve(covariance, x)
    return {
        "kind": kind,
        "correlation": correlation,
        "gram": (x.T @ precision_x).ravel().tolist(),
        "xy": (precision_x.T @ y).tolist(),
        "yy": float(y @ np.linalg.solve(covariance, y)),
        "n": rows,
        "log_constant": float(log_constant),
        "slab": slab.tolist(),
        "family": family,
        "inclusion": inclusion,
        "shape": a0,
        "scale": b0,
        "expected": enumerate_models(x, y, covariance, slab, family, inclusion, a0, b0),
    }


def main():
    rng = np.random.default_rng(20260202)
    cases = []
    for correlation in [0.0, 0.5, 0.9, 0.99]:
        for kind in ["iid", "weighted", "autoregressive"]:
            cases.append(case(rng, 6, 40, correlation, kind, {"probability": 0.2}, 1))
            cases.append(case(rng, 7, 40, correlation, kind, {"expected_terms": 2.5}, 3))
        cases.append(case(rng, 10, 60, correlation, "iid", {"expected_terms": 5.0}, 2))
        cases.append(case(rng, 12, 50, correlation, "weighted", {"expected_terms": 5.0}, 4))
    for size in [1, 2, 3, 4]:
        cases.append(case(rng, size, 30, 0.5, "iid", {"probability": 0.5}, 2))
    cases.append(case(rng, 9, 5, 0.5, "iid", {"expected_terms": 3.0}, 2))
    document = {
        "made_by": "multivariate t densities with NumPy and SciPy",
        "version": f"numpy {np.__version__}, scipy {scipy.__version__}",
        "command": "python crates/twincal/tests/reference/infer/make.py",
        "cases": cases,
    }
    (HERE / "enumeration.json").write_text(json.dumps(document) + "\n")


if __name__ == "__main__":
    main()

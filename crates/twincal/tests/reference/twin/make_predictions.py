"""Posterior predictive torque of a small two-joint problem by brute force: every model by dense NumPy algebra, the mixture
over models as a list of scipy.stats.t, its quantiles by bracketed root finding."""

import itertools
import json
import sys

import numpy as np
import scipy
from scipy import optimize, stats

generator = np.random.default_rng(11)
K, N = 5, 30
SHAPE0, SCALE0, SLAB = 0.7, 0.05, 4.0
COLUMNS = [[0, 1, 2, 4], [0, 1, 3]]
NOISE = [
    {"weight": 1.6, "rho": 0.6, "interval_factor": 1.3, "out_of_band": 0.4},
    {"weight": 1.0 / 1.6, "rho": 0.0, "interval_factor": 1.0, "out_of_band": 0.0},
]

# The statistics are those of any weighted regression; here simply of rows in which both joints' columns appear.
design = generator.standard_normal((N, K)) * np.array([1.0, 0.8, 2.0, 0.5, 1.0])
design[:, 1] += 0.9 * design[:, 0]
y = design @ np.array([0.9, 0.0, 0.25, -0.4, 0.0]) + 0.6 * generator.standard_normal(N)
gram, xy, yy = design.T @ design, design.T @ y, y @ y
shape = SHAPE0 + N / 2

models = []
for size in range(K + 1):
    for members in itertools.combinations(range(K), size):
        z = list(members)
        precision = gram[np.ix_(z, z)] + np.eye(size) / SLAB
        covariance = np.linalg.inv(precision) if size else np.zeros((0, 0))
        mean = covariance @ xy[z]
        scale = SCALE0 + 0.5 * (yy - xy[z] @ mean)
        log_weight = -0.5 * size * np.log(SLAB) - 0.5 * np.linalg.slogdet(precision)[1] - shape * np.log(scale) - size * np.log(3.0)
        models.append([z, log_weight, scale, mean, covariance, np.linalg.cholesky(precision) if size else np.zeros((0, 0))])
largest = max(m[1] for m in models)
total = sum(np.exp(m[1] - largest) for m in models)
for m in models:
    m[1] = np.exp(m[1] - largest) / total
models.sort(key=lambda m: -m[1])


def moments(models):
    mean, second = np.zeros(K), np.zeros((K, K))
    for z, weight, scale, mu, covariance, _ in models:
        full, spread = np.zeros(K), np.zeros((K, K))
        full[z], spread[np.ix_(z, z)] = mu, scale / (shape - 1) * covariance
        mean += weight * full
        second += weight * (spread + np.outer(full, full))
    return mean, second - np.outer(mean, mean)


def predict(models, joint, x, signal):
    """Low, high, epistemic sd and PIT at a torque for one row, relative to the nominal torque."""
    noise, columns = NOISE[joint], COLUMNS[joint]
    factor = noise["interval_factor"] ** 2 / (noise["weight"] * (1 - noise["rho"] ** 2))
    extra = noise["out_of_band"] ** 2 if signal == "raw" else 0.0
    full = np.zeros(K)
    full[columns] = x
    parts = []
    for z, weight, scale, mu, covariance, _ in models:
        row = full[z]
        variance = scale / shape * (factor + row @ covariance @ row) + extra
        parts.append((weight, stats.t(2 * shape, loc=row @ mu, scale=np.sqrt(variance))))
    cdf = lambda value: sum(w * part.cdf(value) for w, part in parts)

    def quantile(p):
        ends = [part.ppf(p) for _, part in parts]
        low, high = min(ends) - 1e-9, max(ends) + 1e-9
        return optimize.brentq(lambda value: cdf(value) - p, low, high, xtol=1e-14, rtol=1e-15)

    mean, covariance = moments(models)
    at = 0.4
    return {
        "low": quantile(0.025),
        "high": quantile(0.975),
        "mean": float(full @ mean),
        "epistemic": float(np.sqrt(full @ covariance @ full)),
        "residual": at,
        "pit": float(cdf(at)),
    }


def case(models, rows):
    total = sum(m[1] for m in models)
    models = [[z, w / total, *rest] for z, w, *rest in models]
    mean, covariance = moments(models)
    inclusion = [float(sum(w for z, w, *_ in models if k in z)) for k in range(K)]
    return {
        "posterior": {
            "inclusion": inclusion,
            "inclusion_mcse": [0.0] * K,
            "mean": mean.tolist(),
            "sd": np.sqrt(np.maximum(np.diag(covariance), 0)).tolist(),
            "shape": shape,
            "noise": float(sum(w * s / (shape - 1) for _, w, s, *_ in models)),
            "models": [
                {"members": z, "weight": float(w), "scale": float(s), "mean": mu.tolist(), "factor": root.ravel().tolist()}
                for z, w, s, mu, _, root in models
            ],
            "models_mass": 1.0,
            "log_evidence": None,
            "method": {"method": "exact", "models": 2**K},
        },
        "rows": [
            {"joint": joint, "signal": signal, "x": x, **predict(models, joint, x, signal)}
            for joint, signal, x in rows
        ],
    }


rows = []
for joint in (0, 1):
    for signal in ("filtered", "raw"):
        for size in (0.0, 0.3, 1.0, 3.0, 30.0):
            rows.append((joint, signal, (size * generator.standard_normal(len(COLUMNS[joint]))).tolist()))
result = {
    "made_by": "make_predictions.py",
    "version": f"numpy {np.__version__}, scipy {scipy.__version__}",
    "command": "python make_predictions.py > predictions.json",
    "columns": COLUMNS,
    "noise": [
        {"joint": f"j{j}", "sigma": 1.0, "n": 30.0, "n_eff": 30.0, "autocorrelation_time": 1.0, **noise}
        for j, noise in enumerate(NOISE)
    ],
    "cases": {"all_models": case(models, rows), "one_model": case(models[:1], rows)},
}
json.dump(result, sys.stdout, indent=1)
print()

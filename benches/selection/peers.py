"""The peers: what a user of scikit-learn or PySINDy would call on the same rows. Every one gets columns and torque of size one.

An answer is {beta, low, high, chance}: coefficients (exact zeros where a term is out), 95 % interval and the probability
that the term is in, where the method has one.
"""

import time
import warnings

import numpy as np
from pysindy.optimizers import STLSQ, EnsembleOptimizer
from sklearn.linear_model import ARDRegression, LassoCV

FOLDS = 5
THRESHOLDS = np.geomspace(1e-4, 0.5, 16)  # of a coefficient, columns and torque scaled to root mean square 1
BAGS = 20  # models of the ensemble: PySINDy's default


def scaled(x, y):
    """Columns and torque with root mean square one, and the factors that take coefficients back."""
    scale, size = np.sqrt(np.mean(x**2, axis=0)), np.sqrt(np.mean(y**2))
    scale = np.where(scale > 0, scale, 1.0)
    return x / scale, y / size, size / scale


def ard(x, y):
    """ARDRegression as it comes; intervals from its own covariance."""
    fit = ARDRegression(fit_intercept=False).fit(x, y)
    inside = fit.lambda_ < fit.threshold_lambda
    sd = np.zeros(x.shape[1])
    sd[inside] = np.sqrt(np.diag(fit.sigma_))
    beta = np.where(inside, fit.coef_, 0.0)
    return {"beta": beta, "low": beta - 1.96 * sd, "high": beta + 1.96 * sd}


def lasso(x, y):
    """LassoCV, penalty by five-fold cross-validation over stretches of time."""
    return {"beta": LassoCV(cv=FOLDS, fit_intercept=False, max_iter=20000).fit(x, y).coef_}


def compressed(x, y):
    """Triangular factor and rotated torque: the same sums of squares for least squares and ridge, K rows instead of N."""
    q, r = np.linalg.qr(x)
    return r, q.T @ y


def thresholded(x, y, threshold):
    """Coefficients of STLSQ; zeros where its threshold leaves nothing."""
    try:
        return STLSQ(threshold=threshold).fit(x, y[:, None]).coef_.ravel()
    except ValueError:
        return np.zeros(x.shape[1])


def best_threshold(x, y):
    """Cross-validation over stretches of time; the largest threshold within one standard error of the best."""
    errors = np.empty((FOLDS, len(THRESHOLDS)))
    for fold, out in enumerate(np.array_split(np.arange(len(y)), FOLDS)):
        rest = np.delete(np.arange(len(y)), out)
        r, z = compressed(x[rest], y[rest])
        for k, threshold in enumerate(THRESHOLDS):
            errors[fold, k] = np.mean((y[out] - x[out] @ thresholded(r, z, threshold)) ** 2)
    mean, se = errors.mean(axis=0), errors.std(axis=0, ddof=1) / np.sqrt(FOLDS)
    best = mean.argmin()
    return THRESHOLDS[np.flatnonzero(mean <= mean[best] + se[best]).max()]


def ensemble(x, y, threshold, seed):
    """PySINDy's bagging of STLSQ: median coefficients, share of the models that hold a term, percentiles."""
    np.random.seed(seed)
    fit = EnsembleOptimizer(STLSQ(threshold=threshold), bagging=True, n_models=BAGS).fit(x, y[:, None])
    drawn = np.array([coef.ravel() for coef in fit.coef_list])
    chance = np.mean(drawn != 0, axis=0)
    low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
    beta = np.where(chance >= 0.5, np.median(drawn, axis=0), 0.0)
    return {"beta": beta, "low": low, "high": high, "chance": chance}


def hindsight(x, y, mistakes):
    """STLSQ with the threshold that makes the fewest mistakes, which only somebody who knows the truth can choose."""
    small = compressed(x, y)
    tries = [thresholded(*small, threshold) for threshold in THRESHOLDS]
    return {"beta": min(tries, key=lambda beta: mistakes(beta != 0))}


def answers(x, y, seed, mistakes):
    """(name, answer, seconds of processor time) of every peer on one set of rows; `mistakes` counts those of chosen columns.

    Warnings (no convergence, nothing left) are part of using them.
    """
    x, y, back = scaled(x, y)

    def timed(run, *arguments):
        before = time.process_time()
        out = run(*arguments)
        return out, time.process_time() - before

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        threshold, tuning = timed(best_threshold, x, y)
        found = [
            ("ARDRegression", *timed(ard, x, y), 0.0),
            ("LassoCV", *timed(lasso, x, y), 0.0),
            ("STLSQ", *timed(lambda: {"beta": thresholded(*compressed(x, y), threshold)}), tuning),
            ("STLSQ ensemble", *timed(ensemble, x, y, threshold, seed), tuning),
            ("STLSQ, threshold in hindsight", *timed(hindsight, x, y, mistakes), 0.0),
        ]
    for name, answer, seconds, before in found:
        yield name, {k: v if k == "chance" else v * back for k, v in answer.items()}, seconds + before

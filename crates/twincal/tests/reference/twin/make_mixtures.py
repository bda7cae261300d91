"""Reference values for Student-t distributions and their mixtures, 40 digits (mpmath), cross-checked against SciPy."""

import json
import sys

import mpmath as mp
import numpy as np
import scipy
from scipy import stats

mp.mp.dps = 40


def t_cdf(t, dof):
    """P(T <= t) by the regularised incomplete beta function, from the tail that does not cancel."""
    t, dof = mp.mpf(t), mp.mpf(dof)
    tail = mp.betainc(dof / 2, mp.mpf(1) / 2, 0, dof / (dof + t * t), regularized=True) / 2 if dof < 1e4 else tail_integral(t, dof)
    return tail if t < 0 else 1 - tail


def tail_integral(t, dof):
    """The upper tail by direct integration of the density: mpmath's beta function is slow for a = 5e6."""
    peak = mp.exp(mp.loggamma((dof + 1) / 2) - mp.loggamma(dof / 2)) / mp.sqrt(dof * mp.pi)
    density = lambda x: peak * mp.exp(-(dof + 1) / 2 * mp.log1p(x * x / dof))
    start = abs(t)
    return mp.quad(density, [start + step for step in (0, 0.25, 0.5, 1, 2, 4, 8, 16)])


def cdf_cases():
    cases = []
    for dof in [0.02, 0.7, 1.0, 2.0, 3.5, 10.0, 47.3, 401.0, 4000.02, 1.0e5, 1.0e7]:
        ts = [-30.0, -12.5, -11.99, -6.0, -2.7, -1.0 / 3.0, 0.0, 1e-9, 0.017, 1.0, 1.96, 3.3, 7.77, 11.99, 12.01, 40.0, 1.0e3]
        ts = [t for t in ts if dof < 1e4 or abs(t) < 12]
        values = [float(t_cdf(t, dof)) for t in ts]
        assert np.allclose(values, stats.t.cdf(ts, dof), atol=1e-9), dof
        start = float(stats.t.ppf(0.975, dof))
        if dof < 0.5:
            quantile = mp.findroot(lambda logt: mp.log(1 - t_cdf(mp.exp(logt), dof)) - mp.log(mp.mpf("0.025")), mp.log(start))
            quantile = mp.exp(quantile)
        else:
            quantile = mp.findroot(lambda t: t_cdf(t, dof) - mp.mpf("0.975"), start)
        cases.append({"dof": dof, "t": ts, "cdf": values, "quantile_975": float(quantile)})
    return cases


def mixture_cdf(y, case):
    """Weights in 64 bits sum to one only to rounding: here they are taken as shares."""
    continuous = mp.fsum(
        mp.mpf(w) * t_cdf((mp.mpf(y) - mp.mpf(m)) / mp.mpf(s), case["dof"])
        for w, m, s in zip(case["weights"], case["locations"], case["scales"])
    )
    return continuous / mp.fsum(map(mp.mpf, case["weights"]))


def mixture_quantile(p, case):
    """Bisection of the 40-digit mixture; the spike at zero by cases."""
    p, spike = mp.mpf(p), mp.mpf(case["spike"])
    below = (1 - spike) * mixture_cdf(0, case)
    if spike > 0:
        if p <= below:
            p = p / (1 - spike)
        elif p <= below + spike:
            return 0.0
        else:
            p = (p - spike) / (1 - spike)
    own = [m + s * float(stats.t.ppf(float(p), case["dof"])) for m, s in zip(case["locations"], case["scales"])]
    width = max(case["scales"])
    low, high = mp.mpf(min(own) - 1e-6 * width), mp.mpf(max(own) + 1e-6 * width)
    for _ in range(60):
        middle = (low + high) / 2
        if mixture_cdf(middle, case) < p:
            low = middle
        else:
            high = middle
    return float((low + high) / 2)


def mixtures():
    generator = np.random.default_rng(20)
    cases = []
    for dof, count, spread, unequal, spike in [
        (5.0, 2, 4.0, 1.0, 0.0),
        (12.3, 3, 0.3, 0.2, 0.0),
        (250.0, 6, 0.05, 0.01, 0.0),
        (4001.0, 3, 1.0, 3.0, 0.0),
        (1.0, 2, 10.0, 1.0, 0.0),
        (40.0, 3, 1.0, 0.5, 0.3),
        (40.0, 2, 3.0, 0.5, 0.96),
        (9.0, 4, 0.5, 4.0, 0.03),
    ]:
        weights = generator.dirichlet(np.ones(count))
        case = {
            "dof": dof,
            "spike": spike,
            "weights": weights.tolist(),
            "locations": (1.0 + spread * generator.standard_normal(count)).tolist(),
            "scales": np.exp(unequal * generator.standard_normal(count)).tolist(),
            "probabilities": [1e-6, 0.025, 0.1, 0.5, 0.9, 0.975, 0.9999],
        }
        case["quantiles"] = [mixture_quantile(p, case) for p in case["probabilities"]]
        cases.append(case)
    # A needle beside a wide component: where Halley alone would accept too early.
    case = {"dof": 30.0, "spike": 0.0, "weights": [0.5, 0.5], "locations": [0.0, 0.0], "scales": [1.0, 1e-7], "probabilities": [0.2, 0.3, 0.6, 0.975]}
    case["quantiles"] = [mixture_quantile(p, case) for p in case["probabilities"]]
    cases.append(case)
    return cases


result = {
    "made_by": "make_mixtures.py",
    "version": f"mpmath {mp.__version__}, scipy {scipy.__version__}",
    "command": "python make_mixtures.py > mixtures.json",
    "cdf": cdf_cases(),
    "mixtures": mixtures(),
}
json.dump(result, sys.stdout, indent=1)
print()

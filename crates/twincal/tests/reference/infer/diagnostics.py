"""Writes diagnostics.json: MCMC diagnostics of ArviZ for chains of every awkward kind.

    python crates/twincal/tests/reference/infer/diagnostics.py
"""

import json
import math
import pathlib
import warnings

import numpy as np

warnings.simplefilter("ignore")
import arviz as az  # noqa: E402
from arviz.stats.diagnostics import _rhat_rank  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent


def autoregression(rng, chains, draws, rho):
    noise = rng.normal(size=(chains, draws))
    x = np.zeros((chains, draws))
    x[:, 0] = noise[:, 0] / math.sqrt(1 - rho**2)
    for t in range(1, draws):
        x[:, t] = rho * x[:, t - 1] + noise[:, t]
    return x


def switching(rng, chains, draws, up, down):
    z = np.zeros((chains, draws))
    for c in range(chains):
        state = 0
        for t in range(draws):
            state = 1 - state if rng.random() < (up if state == 0 else down) else state
            z[c, t] = state
    return z


def cases():
    rng = np.random.default_rng(20260101)
    yield "white", rng.normal(size=(4, 120))
    yield "odd_length", rng.normal(size=(3, 101))
    yield "one_chain", rng.normal(size=(1, 90))
    yield "shortest", rng.normal(size=(2, 4))
    yield "short_odd", rng.normal(size=(2, 7))
    yield "slow", autoregression(rng, 4, 200, 0.95)
    yield "antithetic", autoregression(rng, 4, 150, -0.6)
    yield "heavy_tails", rng.standard_cauchy(size=(4, 100))
    yield "shifted_chain", rng.normal(size=(4, 100)) + np.array([[0.0], [0.0], [0.0], [1.5]])
    yield "wide_chain", rng.normal(size=(4, 100)) * np.array([[1.0], [1.0], [1.0], [4.0]])
    yield "binary", switching(rng, 4, 150, 0.3, 0.4)
    yield "binary_rare", switching(rng, 4, 200, 0.01, 0.6)
    yield "binary_sticky", switching(rng, 4, 150, 0.02, 0.02)
    yield "spike_and_slab", switching(rng, 4, 150, 0.3, 0.3) * rng.normal(2.0, 0.3, size=(4, 150))
    yield "constant", np.full((4, 50), 0.25)
    yield "constants_that_differ", np.repeat(np.array([[0.0], [0.0], [1.0]]), 40, axis=1)
    yield "one_constant_chain", np.vstack([np.zeros(60), rng.normal(size=(2, 60))])
    yield "trend", np.linspace(0, 3, 80)[None, :] + rng.normal(size=(2, 80))


def number(x):
    return float(x) if math.isfinite(x) else None


def main():
    out = []
    for name, x in cases():
        x = np.round(x, 6)
        out.append(
            {
                "name": name,
                "chains": x.tolist(),
                "r_hat": number(_rhat_rank(x)),
                "ess_bulk": number(az.ess(x, method="bulk")),
                "ess_tail": number(az.ess(x, method="tail")),
                "ess_mean": number(az.ess(x, method="mean")),
                "mcse_mean": number(az.mcse(x, method="mean")),
            }
        )
    document = {
        "made_by": "ArviZ",
        "version": az.__version__,
        "command": "python crates/twincal/tests/reference/infer/diagnostics.py",
        "cases": out,
    }
    (HERE / "diagnostics.json").write_text(json.dumps(document) + "\n")


if __name__ == "__main__":
    main()

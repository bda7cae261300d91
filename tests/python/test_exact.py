"""`twincal fit` against a brute-force enumeration by another formula (multivariate t), through the command line.

Twelve candidates of the study, all 4096 models; inclusion probabilities, means and ln evidence to 1e-9. Weights, AR(1)
coefficients, effective rows and slab scale are plug-ins of the fit: given those in result.json, the posterior must be
this one.
"""

from itertools import product

import arm
import brute_force
import candidates
import numpy as np
import pytest
import simulate
from conftest import fit
from scipy.stats import multivariate_t

TWELVE = ["qd1^2", "qd1*qd2", "qd2^2", "qd1^2*cos(q2)", "qd1*qd2*cos(q2)", "qd2^2*cos(q2)", "sin(q1)", "cos(q1)",
          "cos(q2)", "sin(q1+q2)", "q1^2", "q2^2"]  # fmt: skip
HEAD = f"""
[library]
terms = {TWELVE}
generic = false
friction = []
offset = false
motor_inertia = false
[signal]
cutoff_hz = 0
[inference]
method = "exact"
""".replace("'", '"')
GIVEN = """
[prior]
slab = { scaled_variance = 1000.0 }
inclusion = { probability = 0.2 }
noise = { shape = 0.001, scale = 0.001 }
"""
A0 = B0 = 0.001
SLAB = 1000.0


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two short noisy logs, friction and all: some candidates stay undecided, which is what makes this a test."""
    study = simulate.simulate(train=2, heldout=0, duration=6.0, rate_hz=25.0, noise_sd=0.6, noise_time=0.05, seed=4)
    paths = simulate.write(study, tmp_path_factory.mktemp("logs"), "csv")
    return study.logs, list(paths.values())


def columns_and_target(logs):
    """Phi (log, row, joint, candidate) and y (log, row, joint)."""
    nominal = arm.mujoco_model(arm.NOMINAL)
    phi = np.stack([np.stack([candidates.column(t, g.q, g.qd, g.qdd) for t in TWELVE], 2) for g in logs])
    y = np.stack([g.tau - arm.inverse_dynamics(nominal, g.q, g.qd, g.qdd) for g in logs])
    return phi, y


def mean_squares(phi, weights):
    """rms(column)^2: mean over all rows of all joints and logs, weighted by w."""
    return np.mean(phi**2 * weights[:, None], axis=(0, 1, 2)) / np.mean(weights)


def compare(result, pips, evidence, means):
    """Our numbers against brute force."""
    terms = {term["name"]: term for term in result["terms"]}
    ours = np.array([terms[name]["pip"] for name in TWELVE])
    assert ((pips > 0.02) & (pips < 0.98)).sum() >= 2, f"all decided, nothing tested: {pips}"
    np.testing.assert_allclose(ours, pips, rtol=0, atol=1e-9)
    np.testing.assert_allclose([terms[name]["mean"] for name in TWELVE], means, rtol=1e-8, atol=1e-9)
    assert result["log_evidence"] == pytest.approx(evidence, abs=1e-8, rel=1e-11)


def test_the_rotated_density_is_the_multivariate_t():
    """brute_force's shortcut (QR basis) against SciPy's dense multivariate t, every one of 2^3 models."""
    rng = np.random.default_rng(8)
    phi, y, slab = rng.standard_normal((40, 3)), rng.standard_normal(40), np.array([0.5, 3.0, 20.0])
    a0, b0 = 1.3, 0.7
    prior = brute_force.independent(0.3)
    masks = [np.array([i & 1, i & 2, i & 4], bool) for i in range(8)]
    logs = [
        prior(z) + multivariate_t(np.zeros(40), b0 / a0 * (np.eye(40) + (phi[:, z] * slab[z]) @ phi[:, z].T), 2 * a0).logpdf(y)
        for z in masks
    ]
    pips, evidence, _ = brute_force.posterior(phi, y, slab, prior, a0, b0)
    assert evidence == pytest.approx(np.logaddexp.reduce(logs), abs=1e-10)
    np.testing.assert_allclose(pips, np.exp(np.array(logs) - evidence) @ np.array(masks), atol=1e-11)


def test_iid_one_variance(logs, tmp_path):
    result = fit(tmp_path, logs[1], HEAD + GIVEN + '[noise]\nmodel = "iid"\nper_joint = false\n')
    phi, y = columns_and_target(logs[0])
    phi, y = phi.reshape(-1, 12), y.ravel()
    slab = SLAB / np.mean(phi**2, axis=0)
    compare(result, *brute_force.posterior(phi, y, slab, brute_force.independent(0.2), A0, B0))


def test_heredity(logs, tmp_path):
    """Models with a child without its parent have no weight, the others share the prior: probabilities and evidence."""
    pairs = {"cos(q1)": "q1^2", "qd1*qd2": "qd1^2", "qd1*qd2*cos(q2)": "qd1*qd2", "qd2^2": "cos(q2)"}
    heredity = "heredity = { " + ", ".join(f'"{child}" = "{parent}"' for child, parent in pairs.items()) + " }\n"
    result = fit(tmp_path, logs[1], HEAD + GIVEN + heredity + '[noise]\nmodel = "iid"\nper_joint = false\n')
    assert result["prior"]["heredity"] == pairs
    phi, y = columns_and_target(logs[0])
    phi, y = phi.reshape(-1, 12), y.ravel()
    slab = SLAB / np.mean(phi**2, axis=0)
    index = [(TWELVE.index(child), TWELVE.index(parent)) for child, parent in pairs.items()]
    urn = brute_force.independent(0.2)
    alive = [np.array(z, bool) for z in product([0, 1], repeat=12) if all(z[p] or not z[c] for c, p in index)]
    assert result["inference"]["models"] == len(alive) < 4096
    share = np.logaddexp.reduce([urn(z) for z in alive])

    def prior(z):
        return urn(z) - share if all(z[p] or not z[c] for c, p in index) else -np.inf

    pips, evidence, means = brute_force.posterior(phi, y, slab, prior, A0, B0)
    free = brute_force.posterior(phi, y, slab, urn, A0, B0)[0]
    assert np.abs(pips - free).max() > 0.01, "heredity changes nothing here"
    compare(result, pips, evidence, means)


def test_iid_given_weights(logs, tmp_path):
    result = fit(tmp_path, logs[1], HEAD + GIVEN + '[noise]\nmodel = "iid"\nper_joint = true\n')
    phi, y = columns_and_target(logs[0])
    weights = np.array([noise["weight"] for noise in result["noise"]])
    assert weights.prod() == pytest.approx(1.0, abs=1e-12) and abs(weights[0] - 1) > 0.01
    rows = y.shape[0] * y.shape[1]
    root = np.sqrt(weights)
    slab = SLAB / mean_squares(phi, weights)
    phi, y = (phi * root[:, None]).reshape(-1, 12), (y * root).ravel()
    jacobian = 0.5 * rows * np.log(weights).sum()
    compare(result, *brute_force.posterior(phi, y, slab, brute_force.independent(0.2), A0, B0, log_jacobian=jacobian))


def test_ar1_given_weights_and_correlations(logs, tmp_path):
    """Rows whitened one by one: sqrt(1 - rho^2) x_1, then x_t - rho x_(t-1), in every log anew."""
    result = fit(tmp_path, logs[1], HEAD + GIVEN + '[noise]\nmodel = "ar1"\nper_joint = true\n')
    phi, y = columns_and_target(logs[0])
    weights = np.array([noise["weight"] for noise in result["noise"]])
    rho = np.array([noise["rho"] for noise in result["noise"]])
    assert (rho > 0.2).all()
    slab = SLAB / mean_squares(phi, weights)
    jacobian = 0.5 * len(logs[0]) * (y.shape[1] * np.log(weights) + np.log1p(-(rho**2))).sum()
    stacked = np.concatenate([phi, y[..., None]], axis=3)
    white = stacked.copy()
    white[:, 0] *= np.sqrt(1 - rho**2)[:, None]
    white[:, 1:] -= rho[:, None] * stacked[:, :-1]
    white = (white * np.sqrt(weights)[:, None]).reshape(-1, 13)
    prior = brute_force.independent(0.2)
    compare(result, *brute_force.posterior(white[:, :12], white[:, 12], slab, prior, A0, B0, log_jacobian=jacobian))


def test_tempered_given_effective_rows(logs, tmp_path):
    """Every joint's rows count n_eff/n each."""
    result = fit(tmp_path, logs[1], HEAD + GIVEN)
    phi, y = columns_and_target(logs[0])
    weights = np.array([noise["weight"] for noise in result["noise"]])
    kept = np.array([noise["n_eff"] for noise in result["noise"]])
    rows = y.shape[0] * y.shape[1]
    assert (kept < rows).all()
    slab = SLAB / mean_squares(phi, weights)
    root = np.sqrt(weights * kept / rows)
    phi, y = (phi * root[:, None]).reshape(-1, 12), (y * root).ravel()
    prior = brute_force.independent(0.2)
    jacobian = 0.5 * (kept * np.log(weights)).sum()
    compare(result, *brute_force.posterior(phi, y, slab, prior, A0, B0, n=kept.sum(), log_jacobian=jacobian))


def test_gibbs_agrees_with_exact(logs, tmp_path):
    """Within max(0.02, 5 sqrt(p(1-p)/ESS)) of exact, the issue's bound; false alarm below 12 * 6e-7."""
    noise = '[noise]\nmodel = "iid"\nper_joint = false\n'
    exact = fit(tmp_path / "exact", logs[1], HEAD + GIVEN + noise)
    gibbs = fit(tmp_path / "gibbs", logs[1], HEAD.replace('"exact"', '"gibbs"') + GIVEN + noise)
    assert gibbs["log_evidence"] is None and gibbs["inference"]["method"] == "gibbs"
    for a, b in zip(exact["terms"], gibbs["terms"]):
        p = a["pip"]
        assert abs(b["pip"] - p) <= max(0.02, 5 * np.sqrt(p * (1 - p) / gibbs["inference"]["ess"]))

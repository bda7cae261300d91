"""SpikeSlabRegressor against brute force, closed forms and scikit-learn."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest

sklearn = pytest.importorskip("sklearn")

from sklearn.linear_model import ARDRegression  # noqa: E402
from sklearn.utils.estimator_checks import parametrize_with_checks  # noqa: E402
import twincal  # noqa: E402
from twincal import SpikeSlabRegressor  # noqa: E402


@parametrize_with_checks([SpikeSlabRegressor(), SpikeSlabRegressor(noise="ar1")])
def test_scikit_learn(estimator, check):
    check(estimator)


def data(rows: int, columns: int, seed: int, rho: float = 0.0):
    random = np.random.default_rng(seed)
    X = random.standard_normal((rows, columns))
    beta = np.zeros(columns)
    beta[:3] = [1.0, -0.7, 0.5]
    noise = random.standard_normal(rows)
    for i in range(1, rows):
        noise[i] = rho * noise[i - 1] + np.sqrt(1 - rho**2) * noise[i]
    return X, X @ beta + noise, beta


def test_brute_force_over_orders():
    X, y, _ = data(60, 5, 1)
    fits = [
        SpikeSlabRegressor(scaled_variance=10.0, probability=0.3).fit(X[:, order], y)
        for order in (np.arange(5), np.array([3, 1, 4, 0, 2]))
    ]
    order = np.array([3, 1, 4, 0, 2])
    assert np.abs(fits[0].coef_[order] - fits[1].coef_).max() < 1e-9
    assert np.abs(fits[0].inclusion_probability_[order] - fits[1].inclusion_probability_).max() < 1e-9


def test_exact_is_the_sum_over_all_models():
    """Every model's marginal likelihood by numpy, with the package's slab and φ ~ InvGamma(a0, b0) nearly flat."""
    X, y, _ = data(80, 4, 2)
    own = SpikeSlabRegressor(scaled_variance=5.0, probability=0.5).fit(X, y)
    Z, t = X - X.mean(axis=0), y - y.mean()
    slab = 5.0 / (Z**2).mean(axis=0)
    n, a0 = len(t), 1e-3
    b0 = 1e-3 * own.sigma_**2
    logs, means = [], []
    for inside in itertools.product([False, True], repeat=4):
        k = np.flatnonzero(inside)
        A = Z[:, k].T @ Z[:, k] + np.diag(1.0 / slab[k])
        r = Z[:, k].T @ t
        mean = np.linalg.solve(A, r)
        left = t @ t - r @ mean
        logs.append(
            -0.5 * np.linalg.slogdet(A)[1]
            - 0.5 * np.log(slab[k]).sum()
            - (a0 + n / 2) * np.log(b0 + left / 2)
        )
        full = np.zeros(4)
        full[k] = mean
        means.append(full)
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    inside = np.array(list(itertools.product([0.0, 1.0], repeat=4)))
    assert np.abs(own.inclusion_probability_ - weights @ inside).max() < 1e-6
    assert np.abs(own.coef_ - weights @ np.array(means)).max() < 1e-6


def test_gibbs_agrees_with_exact():
    X, y, _ = data(60, 8, 3)
    exact = SpikeSlabRegressor(method="exact", random_state=1).fit(X, y)
    gibbs = SpikeSlabRegressor(method="gibbs", draws=20_000, random_state=1).fit(X, y)
    # 80 000 draws: standard errors below 0.005
    assert np.abs(exact.inclusion_probability_ - gibbs.inclusion_probability_).max() < 0.03
    again = SpikeSlabRegressor(method="gibbs", draws=20_000, random_state=1).fit(X, y)
    assert np.array_equal(gibbs.coef_, again.coef_)


def test_groups_are_in_together():
    X, y, _ = data(100, 6, 4)
    own = SpikeSlabRegressor(groups=[5, 5, 5, 2, 2, 9]).fit(X, y)
    pip = own.inclusion_probability_
    assert pip[0] == pip[1] == pip[2] > 0.99 and pip[3] == pip[4]


@pytest.mark.parametrize(("rho", "noise"), [(0.0, "iid"), (0.9, "ar1")])
def test_intervals_cover(rho, noise):
    """40 data sets × 3 coefficients at 95 %: fewer than 104 of 120 covered has a probability of 1e-4."""
    covered = 0
    for seed in range(40):
        X, y, beta = data(200, 8, 100 + seed, rho)
        # columns that are as slow as the noise, where counting rows as independent is wrong
        for i in range(1, len(X)):
            X[i] = rho * X[i - 1] + np.sqrt(1 - rho**2) * X[i]
        y = X @ beta + (y - data(200, 8, 100 + seed, rho)[0] @ beta)
        own = SpikeSlabRegressor(noise=noise).fit(X, y)
        low, high = own.coef_interval_[:3].T
        covered += int(((low <= beta[:3]) & (beta[:3] <= high)).sum())
    assert covered >= 104, covered


def test_predictions_and_pickle():
    X, y, beta = data(400, 6, 5)
    own = SpikeSlabRegressor().fit(X[:300], y[:300])
    mean, std = own.predict(X[300:], return_std=True)
    inside = np.abs(y[300:] - mean) < 1.96 * std
    assert inside.mean() > 0.85 and own.sigma_ == pytest.approx(1.0, abs=0.15)
    again = pickle.loads(pickle.dumps(own))
    assert np.array_equal(again.predict(X), own.predict(X))
    assert own.sample(50).shape == (50, 6)


def test_beside_ard_on_its_own_example():
    """The data of scikit-learn's example of ARDRegression: 10 of 100 columns matter."""
    from sklearn.datasets import make_regression

    X, y, beta = make_regression(
        n_samples=100, n_features=100, n_informative=10, noise=8, coef=True, random_state=42
    )
    y, beta = y / y.std(), beta / y.std()

    def f1(found: np.ndarray) -> float:
        true = beta != 0
        return 2 * (found & true).sum() / (found.sum() + true.sum())

    own = SpikeSlabRegressor(random_state=0, draws=2000).fit(X, y)
    ard = ARDRegression(compute_score=True).fit(X, y)
    ours = f1(own.inclusion_probability_ > 0.5)
    theirs = f1(np.abs(ard.coef_) > 1e-3 * np.abs(ard.coef_).max())
    print(f"F1 {ours:.3f} and ARD {theirs:.3f}")
    assert ours >= theirs


def test_coloured_noise_beside_ard():
    """30 data sets of 12 slow columns under AR(1) noise of ρ = 0.9: F1 and coverage of the three true coefficients."""
    hits = {"ours": [0, 0, 0], "ard": [0, 0, 0]}
    covered = {"ours": 0, "ard": 0}
    for seed in range(30):
        X, y, beta = data(300, 12, 500 + seed, 0.9)
        noise = y - X @ beta
        for i in range(1, len(X)):
            X[i] = 0.9 * X[i - 1] + np.sqrt(0.19) * X[i]
        y, true = X @ beta + noise, beta != 0
        own = SpikeSlabRegressor(noise="ar1").fit(X, y)
        ard = ARDRegression().fit(X, y)
        kept = np.abs(ard.coef_) > 1e-3 * np.abs(ard.coef_).max()
        spread = np.zeros(12)
        spread[ard.lambda_ < ard.threshold_lambda] = np.sqrt(np.diag(ard.sigma_))
        low, high = own.coef_interval_.T
        inside = {
            "ours": (low <= beta) & (beta <= high),
            "ard": np.abs(ard.coef_ - beta) <= 1.96 * spread,
        }
        for name, found in (("ours", own.inclusion_probability_ > 0.5), ("ard", kept)):
            hits[name] = np.add(hits[name], [(found & true).sum(), found.sum(), true.sum()])
            covered[name] += int(inside[name][true].sum())
    f1 = {name: 2 * both / (found + true) for name, (both, found, true) in hits.items()}
    print(f"F1 {f1}, covered of 90: {covered}")
    assert f1["ours"] > f1["ard"]
    # fewer than 76 of 90 at 95 % has a probability of 1e-4
    assert covered["ours"] >= 76 > covered["ard"]


def swing(seed: int, rows: int = 2000):
    """A joint that swings; viscous and Coulomb friction, what no column describes, and white noise."""
    random = np.random.default_rng(seed)
    time = 0.01 * np.arange(rows)
    size, rate, lead = random.uniform(0.3, 0.6, 4), random.uniform(0.5, 4.0, 4), random.uniform(0, 6, 4)
    q = (size * np.sin(np.outer(time, rate) + lead)).sum(axis=1)
    qd = (size * rate * np.cos(np.outer(time, rate) + lead)).sum(axis=1)
    qdd = -(size * rate**2 * np.sin(np.outer(time, rate) + lead)).sum(axis=1)
    direction = np.tanh(qd / 0.02)
    X = np.column_stack([qd, direction, q, np.sin(q), qdd, qd**2 * direction, np.cos(q) * qd**2])
    unknown = 0.3 * np.sin(3.0 * q + random.uniform(0, 6)) * (1.0 + 0.5 * direction)
    return q, qd, X, 1.0 * qd + 0.8 * direction + unknown + 0.2 * random.standard_normal(rows)


def test_decoys_make_what_no_column_describes_count_as_noise():
    """20 motions: columns that are not true and yet in, and coverage of the two that are true."""
    false, covered = {"iid": 0, "decoys": 0}, {"iid": 0, "decoys": 0}
    for seed in range(20):
        q, qd, X, y = swing(seed)
        for noise in false:
            beside = {"decoys": twincal.decoys(q, qd)} if noise == "decoys" else {}
            own = SpikeSlabRegressor(noise=noise).fit(X, y, **beside)
            false[noise] += int((own.inclusion_probability_[2:] > 0.5).sum())
            low, high = own.coef_interval_[:2].T
            truth = np.array([1.0, 0.8])
            covered[noise] += int(((low <= truth) & (truth <= high)).sum())
    print(false, covered)
    assert false["decoys"] < 0.3 * false["iid"]
    assert covered["decoys"] >= 32 > covered["iid"]


def test_noise_of_decoys_asks_for_them_by_name():
    """`check_estimator` calls `fit(X, y)` alone, which this noise cannot do: the docstring says so."""
    X, y, _ = data(50, 3, 6)
    with pytest.raises(ValueError, match=r"give decoys=.*twincal\.decoys\(q, qd\)"):
        SpikeSlabRegressor(noise="decoys").fit(X, y)
    said = " ".join(SpikeSlabRegressor.__doc__.split())
    assert "`fit` then requires `decoys`" in said and "check_estimator" in said


def test_decoys_are_their_definition_and_belong_to_one_noise():
    q, qd, X, y = swing(1, 50)
    phi = twincal.decoys(q, qd)
    alone = [np.ones_like(q)] + [f(k * q) for k in range(1, 9) for f in (np.cos, np.sin)]
    alone = np.column_stack(alone)
    assert np.abs(phi - np.hstack([alone, alone * np.tanh(qd / 0.02)[:, None]])).max() < 1e-12
    for noise, beside in [("decoys", {}), ("iid", {"decoys": phi}), ("decoys", {"decoys": phi[1:]})]:
        with pytest.raises(ValueError, match="decoys"):
            SpikeSlabRegressor(noise=noise).fit(X, y, **beside)
    for wrong in ((q, qd[1:]), (q[:0], qd[:0]), (X, X)):
        with pytest.raises(ValueError):
            twincal.decoys(*wrong)

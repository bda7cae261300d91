"""Spike-and-slab regression as an estimator of scikit-learn."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils import check_array, check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from twincal import _twincal
from twincal._arrays import whole

Floats = npt.NDArray[np.float64]


class _Asked:
    """What the extension is asked for."""

    groups: list[int]
    noise: str
    method: str
    scaled_variance: float | None
    expected_terms: float | None
    probability: float | None
    chains: int
    draws: int
    seed: int
    intercept: bool


class SpikeSlabRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Sparse linear regression: every group of columns is in the model or out of it.

    y = b + X β + ε with β_k = 0 where its group is out, and β_k ~ N(0, v φ / rms_k²) where it is in.
    The posterior sums all models where that can be done (up to 28 uncertain groups), else it is
    sampled by a collapsed Gibbs sampler.

    Parameters
    ----------
    noise : {"iid", "ar1", "tempered", "decoys"}
        Independent rows; first-order autoregression; independent rows that count by the
        autocorrelation time of the residual; the same, or by what is left along the decoys of
        `fit` where that is more, so that what no column describes counts as noise. With "decoys"
        `fit` then requires `decoys`; `check_estimator` of scikit-learn gives none, and fails.
    method : {"auto", "exact", "gibbs"}
        How the posterior is computed.
    groups : array_like of int, shape (n_features,), optional
        Columns with one number are in or out together; without, each is a group of its own.
    scaled_variance : float, optional
        v of the slab; without, learned.
    expected_terms : float, optional
        Expected number of groups that are in; without, min(5, n_features / 2).
    probability : float, optional
        Prior probability of each group, instead of `expected_terms`.
    fit_intercept : bool
        A constant b with a flat prior.
    chains : int
        Chains of the Gibbs sampler, 2 to 1024.
    draws : int
        Draws after warm-up in each chain, 100 to 10⁷.
    random_state : int, RandomState or None
        The same number gives the same result.

    Attributes
    ----------
    coef_ : ndarray, shape (n_features,)
        Posterior mean of β over all models.
    coef_std_ : ndarray, shape (n_features,)
        Posterior standard deviation.
    coef_interval_ : ndarray, shape (n_features, 2)
        Central 95 % interval.
    inclusion_probability_ : ndarray, shape (n_features,)
        Probability that the column is in.
    intercept_ : float
    sigma_ : float
        Standard deviation of one row around the model.
    rows_per_independent_ : float
        Rows that count as one; 1 unless `noise` is "tempered" or "decoys".
    rho_ : float
        First-order autocorrelation of the noise; 0 unless `noise="ar1"`.
    log_evidence_ : float or None
        None where the posterior was sampled.
    """

    def __init__(
        self,
        *,
        noise: str = "iid",
        method: str = "auto",
        groups: npt.ArrayLike | None = None,
        scaled_variance: float | None = None,
        expected_terms: float | None = None,
        probability: float | None = None,
        fit_intercept: bool = True,
        chains: int = 4,
        draws: int = 5000,
        random_state: Any = None,
    ) -> None:
        self.noise = noise
        self.method = method
        self.groups = groups
        self.scaled_variance = scaled_variance
        self.expected_terms = expected_terms
        self.probability = probability
        self.fit_intercept = fit_intercept
        self.chains = chains
        self.draws = draws
        self.random_state = random_state

    def fit(
        self,
        X: npt.ArrayLike,
        y: npt.ArrayLike,
        *,
        runs: npt.ArrayLike | None = None,
        decoys: npt.ArrayLike | None = None,
    ) -> SpikeSlabRegressor:
        """Fits the model.

        Parameters
        ----------
        X : array_like, shape (n_samples, n_features)
        y : array_like, shape (n_samples,)
        runs : array_like, shape (n_samples,), optional
            Rows with another number than the row before begin a new run: noise is not correlated
            across it.
        decoys : array_like, shape (n_samples, n_decoys), optional
            For `noise="decoys"`: functions of what drives y that no column is made of, as
            `twincal.decoys` makes them of a joint's motion.

        Returns
        -------
        SpikeSlabRegressor
            Itself.

        Raises
        ------
        ValueError
            For arrays and parameters that do not fit together.
        twincal.errors.SettingError
            For `chains` or `draws` out of their range.
        twincal.errors.ContentError
            For more draws than the memory holds.
        """
        checked: tuple[Floats, Floats] = validate_data(
            self, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=2
        )
        rows, target = checked
        asked = self._asked(rows.shape[1])
        breaks: list[int] = []
        if runs is not None:
            own = np.asarray(runs)
            if own.shape != target.shape:
                raise ValueError(f"runs has shape {own.shape}; give one number per sample")
            breaks = (1 + np.flatnonzero(own[1:] != own[:-1])).tolist()
        columns = np.ascontiguousarray(rows.T).reshape(-1)
        target = np.ascontiguousarray(target, dtype=np.float64)
        beside = self._decoys(decoys, len(target))
        self.regression_ = _twincal.regress(columns, target, beside, breaks, asked)
        found = self.regression_
        self.coef_ = found.mean
        self.coef_std_ = found.sd
        self.coef_interval_ = found.interval95.reshape(-1, 2)
        self.inclusion_probability_ = found.inclusion
        self.intercept_ = found.intercept
        self.sigma_ = found.sigma
        self.rows_per_independent_ = found.rows_per_independent
        self.rho_ = found.rho
        self.log_evidence_ = found.log_evidence
        return self

    def predict(
        self, X: npt.ArrayLike, return_std: bool = False
    ) -> Floats | tuple[Floats, Floats]:
        """Mean of y for new rows, and on request its standard deviation.

        Parameters
        ----------
        X : array_like, shape (n_samples, n_features)
        return_std : bool
            Return the standard deviation of a new y too: noise, coefficients and constant.

        Returns
        -------
        mean : ndarray, shape (n_samples,)
        std : ndarray, shape (n_samples,)
            Only with `return_std`.
        """
        check_is_fitted(self)
        rows: Floats = validate_data(self, X, dtype=np.float64, reset=False)
        mean, std = self.regression_.predict(np.ascontiguousarray(rows).reshape(-1))
        return (mean, std) if return_std else mean

    def sample(self, n: int = 1000, *, seed: int = 1) -> Floats:
        """Independent draws of β from the posterior.

        Parameters
        ----------
        n : int
            How many.
        seed : int
            The same seed gives the same draws.

        Returns
        -------
        ndarray, shape (n, n_features)
            Units of y per unit of the column; exactly 0 where the column is out.

        Raises
        ------
        ValueError
            For a negative number.
        twincal.errors.ContentError
            For more draws than the memory holds.
        """
        check_is_fitted(self)
        count = whole("n", n)
        drawn = self.regression_.draws(count, whole("seed", seed))
        return drawn.reshape(count, len(self.coef_))

    def _decoys(self, decoys: npt.ArrayLike | None, rows: int) -> Floats:
        """Decoy after decoy; empty unless the noise asks for them."""
        if (decoys is None) != (self.noise != "decoys"):
            raise ValueError(
                'give decoys=… for noise="decoys" and for no other noise; '
                "twincal.decoys(q, qd) makes those of a joint"
            )
        if decoys is None:
            return np.zeros(0)
        own: Floats = check_array(decoys, dtype=np.float64)
        if len(own) != rows:
            raise ValueError(f"decoys has shape {own.shape}; give {rows} rows, as X has")
        return np.ascontiguousarray(own.T).reshape(-1)

    def _asked(self, features: int) -> _Asked:
        asked = _Asked()
        groups = np.arange(features) if self.groups is None else np.asarray(self.groups)
        if groups.shape != (features,):
            raise ValueError(f"groups has shape {groups.shape}; give one number per column")
        asked.groups = np.unique(groups, return_inverse=True)[1].tolist()
        asked.noise, asked.method = self.noise, self.method
        asked.scaled_variance = self.scaled_variance
        asked.expected_terms = self.expected_terms
        asked.probability = self.probability
        asked.chains, asked.draws = whole("chains", self.chains), whole("draws", self.draws)
        asked.seed = int(check_random_state(self.random_state).randint(2**31 - 1))
        asked.intercept = self.fit_intercept
        return asked

    def __getstate__(self) -> dict[str, Any]:
        state: dict[str, Any] = dict(super().__getstate__())
        if "regression_" in state:
            state["regression_"] = state["regression_"].to_json()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        own = dict(state)
        if "regression_" in own:
            own["regression_"] = _twincal.Regression.from_json(own["regression_"])
        super().__setstate__(own)

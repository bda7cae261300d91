"""The posterior over all models by another road than ours: the density of y, a multivariate t, model by model.

Given z, integrating beta and phi out of y | beta, phi ~ N(Phi_z beta, phi W^-1), beta ~ N(0, phi V_z) and
phi ~ InvGamma(a0, b0) leaves

    y ~ t_{2 a0}(0, (b0/a0) S),   S = W^-1 + Phi_z V_z Phi_z^T

Rows come in already weighted (W = 1), the weights' Jacobian as `log_jacobian`. An orthogonal change of basis (QR of all
columns) makes S the identity but for a K x K block and leaves a t density what it is. No normal equations, no Schur
complements, no sweeps: nothing here is shared with the Rust code.
"""

from itertools import product

import numpy as np
from scipy.special import gammaln, logsumexp


def log_t(y2, log_det, n, a0, b0):
    """ln density of an n-variate t with 2 a0 degrees of freedom; y2 = y^T S^-1 y."""
    nu = 2 * a0
    constant = gammaln((nu + n) / 2) - gammaln(nu / 2) - n / 2 * np.log(nu * np.pi) - n / 2 * np.log(b0 / a0)
    return constant - log_det / 2 - (nu + n) / 2 * np.log1p(y2 * (a0 / b0) / nu)


def posterior(phi, y, slab, log_prior, a0, b0, n=None, log_jacobian=0.0):
    """(inclusion probabilities, ln evidence, posterior means) over all 2^K models.

    `slab`: v_k in the columns' own units; `log_prior(z)`: ln p(z) of a boolean mask; `n`: rows that count (tempered
    likelihoods count fewer than there are).
    """
    q, r = np.linalg.qr(phi)
    u = q.T @ y
    rest = y - q @ u
    rest2 = rest @ rest
    n = len(y) if n is None else n
    k = phi.shape[1]
    masks = np.array(list(product([False, True], repeat=k)))
    logs, means = np.empty(len(masks)), np.zeros((len(masks), k))
    for i, z in enumerate(masks):
        rz = r[:, z]
        s = np.eye(k) + (rz * slab[z]) @ rz.T
        solved = np.linalg.solve(s, u)
        logs[i] = log_prior(z) + log_t(u @ solved + rest2, np.linalg.slogdet(s)[1], n, a0, b0)
        means[i, z] = slab[z] * (rz.T @ solved)
    evidence = logsumexp(logs)
    weights = np.exp(logs - evidence)
    return weights @ masks, evidence + log_jacobian, weights @ means


def independent(probability):
    """ln p(z) when every column is in with this probability."""
    return lambda z: z.sum() * np.log(probability) + (~z).sum() * np.log1p(-probability)


def beta_binomial(families, expected):
    """ln p(z), Beta-Binomial(1, K/m0 - 1) in every family, integrated out; `families`: index per column."""
    families = np.asarray(families)
    b = len(families) / expected - 1

    def log_prior(z):
        total = 0.0
        for family in np.unique(families):
            size, count = (families == family).sum(), z[families == family].sum()
            total += gammaln(1 + count) + gammaln(b + size - count) - gammaln(1 + b + size)
            total -= gammaln(1) + gammaln(b) - gammaln(1 + b)
        return total

    return log_prior

"""What people use today for the same question, timed on one core: `cargo bench -p twincal --bench inference` runs this.

- scikit-learn's ARDRegression (one sparse Bayesian point estimate, no probabilities) on 2000 rows of 24 columns and on 20 000 of 32;
- all 2^K models with NumPy, as fast as batched linear algebra makes it, at a smaller K and per model.
"""

import os

for variable in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"]:
    os.environ[variable] = "1"

import time  # noqa: E402
import warnings  # noqa: E402

import numpy as np  # noqa: E402
import sklearn  # noqa: E402
from sklearn.linear_model import ARDRegression  # noqa: E402

warnings.simplefilter("ignore")


def data(size, rows=2000):
    rng = np.random.default_rng(1)
    x = np.sqrt(0.5) * rng.normal(size=(rows, 1)) + np.sqrt(0.5) * rng.normal(size=(rows, size))
    y = x[:, 0] - 0.5 * x[:, 3] + 0.3 * x[:, 5] + 0.2 * x[:, 7] + rng.normal(size=rows)
    return x, y


def least(repeats, run):
    best = float("inf")
    for _ in range(repeats):
        before = time.process_time()
        run()
        best = min(best, time.process_time() - before)
    return best


def enumerate_models(x, y, v=100.0, a0=1e-3, b0=1e-3, p=0.2):
    """PIPs by one batched solve per model size class: members gathered, the rest replaced by the identity."""
    n, size = x.shape
    gram, r, yy = x.T @ x, x.T @ y, y @ y
    logs = np.empty(2**size)
    inside = np.zeros(size)
    step = 2**10
    for start in range(0, 2**size, step):
        sets = (np.arange(start, start + step)[:, None] >> np.arange(size)) & 1
        mask = sets[:, :, None] * sets[:, None, :]
        a = mask * (gram + np.eye(size) / v) + np.eye(size) * (1 - sets)[:, :, None]
        rz = sets * r
        rss = yy - (rz * np.linalg.solve(a, rz[:, :, None])[:, :, 0]).sum(axis=1)
        count = sets.sum(axis=1)
        logs[start : start + step] = (
            count * np.log(p)
            + (size - count) * np.log1p(-p)
            - 0.5 * count * np.log(v)
            - 0.5 * np.linalg.slogdet(a)[1]
            - (a0 + n / 2) * np.log(b0 + rss / 2)
        )
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    for k in range(size):
        inside[k] = weight[(np.arange(2**size) >> k) & 1 == 1].sum()
    return inside


def main():
    x, y = data(24)
    seconds = least(3, lambda: ARDRegression().fit(x, y))
    name = f"scikit-learn {sklearn.__version__} ARDRegression, 24 columns"
    print(f"{name:<44} {seconds:>10.6f} gives no probabilities")
    x, y = data(32, 20_000)
    seconds = least(3, lambda: ARDRegression().fit(x, y))
    print(f"{'the same, 20 000 rows of 32 columns':<44} {seconds:>10.6f}")
    x, y = data(14)
    seconds = least(2, lambda: enumerate_models(x, y))
    each = seconds * 1e9 / 2**14
    print(f"{f'NumPy {np.__version__}, 2^14 models':<44} {seconds:>10.6f} {each:>9.0f} ns/model")
    print(f"{'NumPy, 2^24 models (scaled)':<44} {each * 2**24 * 1e-9:>10.1f}")


if __name__ == "__main__":
    main()

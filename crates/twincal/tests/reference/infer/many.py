"""Writes many.json: 200 random problems, given by their statistics, and their posteriors over all 2^K models in 40 digits.

Up to 12 columns, correlations 0, .5, .9 and .99, up to 4 million rows: what `N/2 ln(b0 + RSS/2)` makes of a rounding error is the
point. The recursion below eliminates the columns one by one (Schur complements, in mpmath), and every leaf is one
model; the formula is that of method section 7, written down independently of the crate.

    python crates/twincal/tests/reference/infer/many.py
"""

import json
import pathlib

import mpmath as mp
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
mp.mp.dps = 40
CASES = 200


def problem(index, rng):
    """Statistics of y = X beta + noise with equicorrelated columns of different units; some columns act, some hardly."""
    size = int(rng.integers(2, 13))
    correlation = [0.0, 0.5, 0.9, 0.99][index % 4]
    rows = int(round(10 ** rng.uniform(1.5, 6.6)))
    few = min(rows, 400)
    x = np.sqrt(correlation) * rng.normal(size=(few, 1)) + np.sqrt(1 - correlation) * rng.normal(size=(few, size))
    x *= 10 ** rng.uniform(-2, 2, size)
    weight = rows / few
    # Effects of up to 8 standard errors: PIPs everywhere between 0 and 1.
    sigma = 10 ** rng.uniform(-1, 1)
    error = sigma / np.sqrt(weight * few * (1 - correlation)) / np.sqrt((x**2).mean(0))
    beta = error * rng.choice([0.0, 1.0, 3.0, 8.0], size) * rng.normal(size=size)
    y = x @ beta + sigma * rng.normal(size=few) * np.sqrt(min(1.0, 400 / rows) + 1e-3)
    short = lambda values: [float(f"{v:.12g}") for v in np.ravel(values)]
    gram = weight * x.T @ x
    gram = np.array(short(gram)).reshape(size, size)
    return {
        "correlation": correlation,
        "n": float(rows),
        "gram": short(gram[np.triu_indices(size)]),
        "xy": short(weight * x.T @ y),
        # Columns explain little: most of y's square is the noise of the rows that are not kept.
        "yy": short([weight * y @ y + rows * sigma**2])[0],
        "slab": short(10 ** rng.uniform(0, 4) / (x**2).mean(0)),
        "family": [int(f) for f in rng.integers(0, 3, size)],
        "inclusion": {"probability": 0.2} if index % 3 else {"expected_terms": size / 3},
        "shape": 0.001,
        "scale": short([0.001 * (y @ y / few + sigma**2)])[0],
    }


def symmetric(triangle, size):
    matrix = np.zeros((size, size))
    matrix[np.triu_indices(size)] = triangle
    return matrix + np.triu(matrix, 1).T


def posterior(case):
    size = len(case["xy"])
    gram = symmetric(case["gram"], size)
    exact = lambda v: mp.mpf(float(v))
    slab = [exact(v) for v in case["slab"]]
    table = [[exact(gram[i][j]) + (1 / slab[i] if i == j else 0) for j in range(size)] + [exact(case["xy"][i])] for i in range(size)]
    table.append([exact(v) for v in case["xy"]] + [exact(case["yy"])])
    a0, b0, n = exact(case["shape"]), exact(case["scale"]), exact(case["n"])
    families = sorted(set(case["family"]))
    if "probability" in case["inclusion"]:
        p = exact(case["inclusion"]["probability"])
        def log_prior(members):
            return len(members) * mp.log(p) + (size - len(members)) * mp.log(1 - p)
    else:
        b = size / exact(case["inclusion"]["expected_terms"]) - 1
        def log_prior(members):
            total = mp.mpf(0)
            for f in families:
                count = case["family"].count(f)
                inside = sum(1 for k in members if case["family"][k] == f)
                total += mp.log(mp.beta(1 + inside, b + count - inside)) - mp.log(mp.beta(1, b))
            return total
    known = {}
    leaves = []

    def walk(k, matrix, members, log_factor):
        """`matrix`: rows and columns k … size of what is left; its corner is the RSS in the end."""
        if k == size:
            key = tuple(sum(1 for m in members if case["family"][m] == f) for f in families)
            if key not in known:
                known[key] = log_prior(members)
            leaves.append((known[key] + log_factor - (a0 + n / 2) * mp.log(b0 + matrix[0][0] / 2), members))
            return
        rest = [row[1:] for row in matrix[1:]]
        walk(k + 1, rest, members, log_factor)
        pivot, row = matrix[0][0], matrix[0]
        left = [[value - matrix[i + 1][0] * row[j + 1] / pivot for j, value in enumerate(line)] for i, line in enumerate(rest)]
        walk(k + 1, left, [*members, k], log_factor - mp.log(slab[k] * pivot) / 2)

    walk(0, table, [], mp.mpf(0))
    constant = a0 * mp.log(b0) - mp.loggamma(a0) + mp.loggamma(a0 + n / 2) - n / 2 * mp.log(2 * mp.pi)
    top = max(log for log, _ in leaves)
    weights = [mp.exp(log - top) for log, _ in leaves]
    total = mp.fsum(weights)
    pip = [mp.fsum(w for w, (_, members) in zip(weights, leaves) if k in members) / total for k in range(size)]
    return {"pip": [float(p) for p in pip], "log_evidence": float(constant + top + mp.log(total))}


def main():
    rng = np.random.default_rng(20261121)
    cases = []
    for index in range(CASES):
        case = problem(index, rng)
        case["expected"] = posterior(case)
        cases.append(case)
    (HERE / "many.json").write_text(json.dumps({"cases": cases}, separators=(",", ":")) + "\n")
    pips = np.concatenate([c["expected"]["pip"] for c in cases])
    print(f"{len(pips)} probabilities, {np.mean((pips > 0.01) & (pips < 0.99)):.2f} of them between 0.01 and 0.99")


if __name__ == "__main__":
    main()

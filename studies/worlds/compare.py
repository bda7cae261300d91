"""What two programs do differently on the same worlds.

    python compare.py a.jsonl b.jsonl [--all]

Worlds and seeds that both have. Printed are paired differences (b less a, with the standard error of their mean over fits) and, fit by
fit, the claims that only one of them makes; with --all for worlds without a difference, too.
"""

import argparse
from math import log

import numpy as np
from fits import read
from table import LARGE, components, coverage, error_ratio, false_claims, lines_of


def claims(line):
    """Established components and sets, with their judgement."""
    own = {f"{row['name']}": row["judged"] for row in line["components"] if row["status"] == "established"}
    return own | {"{" + " | ".join(sorted(one["members"])) + "}": one["judged"] for one in line["sets"]}


def numbers(line):
    """What is compared, per fit; None where a fit does not have it."""
    inside, rows = coverage([line])
    large = [cause["established"] or cause["in_set"] for cause in line["causes"] if cause["standard_errors"] >= LARGE]
    ratio = error_ratio([line])
    sure = [row["judged"] for row in components([line]) if row["pip"] >= 0.95]
    return {
        "established and false": false_claims(line), "… inertial": false_claims(line, True), "PIP ≥ .95": len(sure), "… true": sure.count("true"),
        "effects ≥ 8 se found, of all": sum(large) if large else None, "held-out coverage": inside / rows if rows else None,
        "log error / friction": log(ratio) if ratio > 0 else None, "CPU, s": line["cpu"],
    }  # fmt: skip


def difference_rows(pairs):
    """One row per number and world, and one over all."""
    worlds = list(dict.fromkeys(a["world"] for a, _ in pairs))
    rows = [["", *(f"`{name}`" for name in worlds), "all, b − a"], ["---"] * (len(worlds) + 2)]
    for what in numbers(pairs[0][0]):
        cells = []
        for name in [*worlds, None]:
            some = [(numbers(a)[what], numbers(b)[what]) for a, b in pairs if name in (None, a["world"])]
            some = np.array([pair for pair in some if None not in pair], float)
            if not len(some):
                cells.append("–")
                continue
            gaps = some[:, 1] - some[:, 0]
            spread = f" ± {gaps.std(ddof=1) / len(gaps) ** 0.5:.3f}" if name is None and len(gaps) > 1 else ""
            cells.append(f"{gaps.mean():+.3f}{spread}" if name is None else f"{some[:, 0].mean():.2f} → {some[:, 1].mean():.2f}")
        rows.append([what, *cells])
    return rows


def changes(a, b):
    """Claims that only one of two fits makes."""
    left, right = claims(a), claims(b)
    gone = [f"− {name} ({left[name]})" for name in left if name not in right]
    new = [f"+ {name} ({right[name]})" for name in right if name not in left]
    return gone + new


def shared_pairs(a, b):
    """Pairs of lines of the worlds that both fitted."""
    right = {(line["world"], line["seed"]): line for line in b if "error" not in line}
    return [(line, right[key]) for line in a if "error" not in line and (key := (line["world"], line["seed"])) in right]


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("a")
    arguments.add_argument("b")
    arguments.add_argument("--all", action="store_true")
    given = arguments.parse_args()
    left, right = ({(line["world"], line["seed"]): line for line in read(path)} for path in (given.a, given.b))
    for key in left:
        if key in right and ("error" in left[key]) != ("error" in right[key]):
            print(f"- `{key[0]}` {key[1]}: {'b' if 'error' in right[key] else 'a'} refuses")
    pairs = shared_pairs(left.values(), right.values())
    if not pairs:
        print("no world that both fitted")
        return
    print(f"\n{len(pairs)} worlds that both fitted\n\n" + lines_of(difference_rows(pairs)) + "\n")
    for a, b in pairs:
        told = changes(a, b)
        if told or given.all:
            print(f"- `{a['world']}` {a['seed']} {a['robot']}: {', '.join(told) or 'no difference'}")


if __name__ == "__main__":
    main()

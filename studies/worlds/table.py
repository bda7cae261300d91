"""The table of the study, from JSON lines: one line per fit.

    python table.py fits.jsonl
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from columns import INERTIAL
from scipy.stats import beta

BINS = ((0.5, 0.8), (0.8, 0.95), (0.95, 0.99), (0.99, 1.0000001))
LARGE = 8.0  # standard errors


def bounds99(hits, total):
    """One-sided 99 % bounds of a share (Clopper and Pearson): the lower one and the upper one."""
    if total == 0:
        return 0.0, 1.0
    low = beta.ppf(0.01, hits, total - hits + 1) if hits else 0.0
    high = beta.ppf(0.99, hits + 1, total - hits) if hits < total else 1.0
    return float(low), float(high)


def share(hits, total):
    """`0.93 (14/15, 99 %: > 0.74, < 0.99)`."""
    if total == 0:
        return "–"
    low, high = bounds99(hits, total)
    return f"{hits / total:.2f} ({hits}/{total}; 99 %: > {low:.2f}, < {high:.2f})"


def components(lines):
    """All judged components of some lines."""
    return [row for line in lines for row in line["components"]]


def false_claims(line, inertial=False):
    """Established and false components, and sets without the cause, of one fit."""
    wrong = [row for row in line["components"] if row["status"] == "established" and row["judged"] == "false"]
    sets = [one for one in line["sets"] if one["judged"] == "false"]
    return sum(not inertial or row["family"] in INERTIAL for row in wrong) + sum(not inertial or one["inertial"] for one in sets)


def found(line):
    """True effects of 8 standard errors or more that have a candidate: how many are reported, how many there are."""
    large = [cause for cause in line["causes"] if cause["candidate"] and cause["standard_errors"] >= LARGE]
    return sum(cause["established"] or cause["in_set"] for cause in large), len(large)


def coverage(lines):
    """Rows inside and rows, pooled."""
    rows = [joint for line in lines for joint in line["heldout"]]
    return sum(j["coverage"] * j["rows"] for j in rows), sum(j["rows"] for j in rows)


def error_ratio(lines):
    """Geometric mean over joints of the held-out error over that of friction and motor inertia alone."""
    ratios = [j["rmse"] / j["rmse_friction"] for line in lines for j in line["heldout"] if j["rmse_friction"] and j["rmse"]]
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else float("nan")


def by_world(lines):
    """Lines of each world, in the order in which they come."""
    out = defaultdict(list)
    for line in lines:
        out[line["world"]].append(line)
    return out


def world_rows(worlds):
    """One row per world."""
    head = ["world", "fits", "candidates", "PIP ≥ .95: true, stand-in, false", "true share", "established false per fit", "inertial", "power, 8 se",
            "held-out coverage", "error / friction", "CPU, s"]  # fmt: skip
    rows = [head, ["---"] * len(head)]
    for name, lines in worlds.items():
        sure = [row["judged"] for row in components(lines) if row["pip"] >= 0.95]
        counts = [sure.count(word) for word in ("true", "stand_in", "false")]
        hits, large = (sum(part) for part in zip(*map(found, lines)))
        inside, all_rows = coverage(lines)
        specified = sum(line["well_specified"] for line in lines)
        rows.append([f"`{name}`", str(len(lines)), "all" if specified == len(lines) else "none or some" if specified == 0 else f"all in {specified}",
                     " ".join(map(str, counts)), f"{counts[0] / len(sure):.2f}" if sure else "–",
                     f"{np.mean([false_claims(line) for line in lines]):.2f}", f"{np.mean([false_claims(line, True) for line in lines]):.2f}",
                     f"{hits}/{large}" if large else "–", f"{inside / all_rows:.3f}", f"{error_ratio(lines):.3f}",
                     f"{np.mean([line['cpu'] for line in lines]):.1f}"])  # fmt: skip
    return rows


def reliability_rows(lines):
    """Probabilities said, and the share that is true: worlds whose causes all have candidates, and the others."""
    rows = [["PIP", "candidates: n", "mean PIP", "true", "bound", "others: n", "mean PIP", "true", "true or stand-in"], ["---"] * 9]
    for low, high in BINS:
        cells = [f"{low}–{min(high, 1.0):.4g}"]
        for specified in (True, False):
            some = [row for line in lines if line["well_specified"] == specified for row in line["components"] if low <= row["pip"] < high]
            true, stand = (sum(row["judged"] == word for row in some) for word in ("true", "stand_in"))
            n = len(some)
            cells += [str(n), f"{np.mean([row['pip'] for row in some]):.3f}" if n else "–", f"{true / n:.2f}" if n else "–"]
            cells += [f"< {bounds99(true, n)[1]:.2f}" if n else "–"] if specified else [f"{(true + stand) / n:.2f}" if n else "–"]
        rows.append(cells)
    return rows


def mass_intervals(lines, family):
    """Mass intervals that hold the truth, and how many masses are reported."""
    told = [line["masses"].get(family) for line in lines if line["masses"].get(family)]
    return sum(low <= truth <= high for _, _, truth, low, high, _ in told), len(told)


def right_links(lines):
    """Fits in which payload and heavier link are established (or in a set of three), no other body is, and both mass intervals hold."""
    good = right = 0
    for line in lines:
        bodies = [cause for cause in line["causes"] if cause["family"] in ("payload", "body")]
        link = all(cause["established"] or cause["in_set"] for cause in bodies) and not false_claims(line, True)
        told = [line["masses"].get(cause["family"]) for cause in bodies]
        right += link
        good += link and all(one and one[3] <= one[2] <= one[4] for one in told)
    return right, good, len(lines)


class Limits:
    """Rows of limits: what, reached, asked, and `missed` where the one-sided 99 % bound excludes the limit."""

    def __init__(self, worlds, refused):
        self.worlds, self.refused = worlds, refused
        self.lines = [line for some in worlds.values() for line in some]
        self.rows = []

    def add(self, what, reached, asked, missed):
        """A row."""
        self.rows.append([what, reached, asked, "missed" if missed else ""])

    def probabilities(self):
        """Whether probabilities mean what they say, in worlds whose causes all have candidates by the program's own list."""
        specified = {name: components([line for line in some if line["well_specified"]]) for name, some in self.worlds.items()}
        sure = {name: [row["judged"] == "true" for row in some if row["pip"] >= 0.95] for name, some in specified.items()}
        sure = {name: some for name, some in sure.items() if some}
        if sure:
            hits, total = sum(map(sum, sure.values())), sum(map(len, sure.values()))
            mean = np.mean([np.mean(some) for some in sure.values()])
            what = "PIP ≥ .95 that is true, worlds with candidates (mean of worlds)"
            self.add(what, f"{mean:.2f}; all: {share(hits, total)}", "≥ .90", bounds99(hits, total)[1] < 0.9)
        for low, high in BINS:
            some = [row for rows in specified.values() for row in rows if low <= row["pip"] < high]
            if some:
                hits, said = sum(row["judged"] == "true" for row in some), float(np.mean([row["pip"] for row in some]))
                what = f"PIP {low} to {min(high, 1.0):.4g}, worlds with candidates"
                self.add(what, share(hits, len(some)), f"≥ {said:.3f}, as said", bounds99(hits, len(some))[1] < said)

    def false_effects(self):
        """Established and false effects per fit."""
        false = {name: [false_claims(line) for line in some] for name, some in self.worlds.items()}
        inertial = {name: [false_claims(line, True) for line in some] for name, some in self.worlds.items()}
        mean = lambda counts: np.mean([np.mean(some) for some in counts.values()])
        worst = max(false, key=lambda name: np.mean(false[name]))
        self.add("established and false per fit, mean of worlds", f"{mean(false):.2f}", "≤ .1", exceeds(sum(false.values(), []), 0.1))
        self.add(f"… worst world (`{worst}`)", f"{np.mean(false[worst]):.2f}", "≤ .3", exceeds(false[worst], 0.3))
        self.add("… inertial", f"{mean(inertial):.2f}", "≤ .1", exceeds(sum(inertial.values(), []), 0.1))
        if "null" in self.worlds:
            wrong, fits = sum(false["null"]), len(false["null"])
            self.add("false terms in fits of noise (`null`)", f"{wrong} in {fits}", "≤ 1 in 100", exceeds(false["null"], 0.01))

    def power(self):
        """True effects of 8 standard errors or more that have a candidate."""
        for word, specified, asked in (("well-specified", True, 0.85), ("misspecified", False, 0.65)):
            hits, total = (sum(part) for part in zip((0, 0), *(found(line) for line in self.lines if line["well_specified"] == specified)))
            what = f"true effects ≥ 8 standard errors, established or in a set of ≤ 3: {word}"
            self.add(what, share(hits, total), f"≥ {asked}", total and bounds99(hits, total)[1] < asked)

    def masses(self):
        """Right links and mass intervals."""
        if "ur5_forearm" in self.worlds:
            right, good, total = right_links(self.worlds["ur5_forearm"])
            self.add("UR5, payload and heavier forearm: right links", f"{right} of {total}", "≥ 19 of 20", bounds99(right, total)[1] < 0.95)
            self.add("… and both mass intervals hold", f"{good} of {total}", "≥ 19 of 20", bounds99(good, total)[1] < 0.95)
        if "gain" in self.worlds:
            hits, total = mass_intervals(self.worlds["gain"], "payload")
            reached = f"{share(hits, total)} of {len(self.worlds['gain'])} fits"
            self.add("mass intervals in worlds with gain error", reached, "≥ .90", total and bounds99(hits, total)[1] < 0.9)

    def prediction(self):
        """Coverage of the worst world; its bound takes the spread from fit to fit, since rows of one log are not independent."""
        covered = {name: coverage(some) for name, some in self.worlds.items()}
        covered = {name: inside / rows for name, (inside, rows) in covered.items() if rows}
        worst = min(covered, key=covered.get)
        each = np.array([inside / rows for inside, rows in (coverage([line]) for line in self.worlds[worst]) if rows])
        spread = each.std(ddof=1) / len(each) ** 0.5 if len(each) > 1 else 1.0
        self.add(f"held-out 95 % interval, worst world (`{worst}`)", f"{covered[worst]:.3f}", "≥ .90", covered[worst] + 2.326 * spread < 0.9)

    def table(self):
        """All rows."""
        if self.lines:
            for part in (self.probabilities, self.false_effects, self.power, self.masses, self.prediction):
                part()
        self.add("fits that are refused", str(self.refused), "0", self.refused > 0)
        return [["what (beyond viscous and Coulomb friction)", "reached", "asked", ""], ["---"] * 4, *self.rows]


def exceeds(counts, limit):
    """Whether the mean of counts per fit is above `limit`, one-sided at 99 %, by one of two tests.

    A mean of at most `limit` allows at most this share of fits with any count (Markov's inequality): binomial. And the mean against its
    standard error, the spread taken from the fits (that of a Poisson count at least), since counts of one fit are not independent.
    """
    counts = np.asarray(counts, float)
    some = int((counts > 0).sum())
    spread = max(counts.var(ddof=1) if len(counts) > 1 else counts.mean(), limit)
    return bool(bounds99(some, len(counts))[0] > limit or counts.mean() - limit > 2.326 * (spread / len(counts)) ** 0.5)


def lines_of(rows):
    """Rows as Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" if row[0] != "---" else "|" + "|".join(row) + "|" for row in rows)


def false_names(lines):
    """What is established and false, by family and world."""
    count = defaultdict(int)
    for line in lines:
        for row in line["components"]:
            if row["status"] == "established" and row["judged"] == "false":
                count[(line["world"], row["family"])] += 1
    return ", ".join(f"`{world}` {family} {n}" for (world, family), n in sorted(count.items(), key=lambda item: -item[1])) or "none"


def sound(lines):
    """Lines of fits that ended with a result, world by world, and the others."""
    failed = [line for line in lines if "error" in line]
    return by_world([line for line in lines if "error" not in line]), failed


def limits(lines):
    """Rows of limits."""
    worlds, failed = sound(lines)
    return Limits(worlds, len(failed)).table()


def markdown(lines):
    """All tables."""
    worlds, failed = sound(lines)
    good = [line for some in worlds.values() for line in some]
    parts = [f"{len(lines)} fits, {len(failed)} refused" + "".join(f"; `{line['world']}` {line['seed']}: {line['error'][:120]}" for line in failed) + "."]
    if good:
        parts += [lines_of(world_rows(worlds)), lines_of(reliability_rows(good)), lines_of(limits(lines)), f"Established and false: {false_names(good)}."]
    return "\n\n".join(parts)


def main():
    path = Path(sys.argv[1])
    print(markdown([json.loads(text) for text in path.read_text().splitlines() if text.strip()]))


if __name__ == "__main__":
    main()

"""Tables of the study: what was decided, McNemar's exact test, and promises against outcomes."""

import json
from collections import defaultdict
from math import comb, sqrt

KINDS = ("designed", "random")
WORLDS = 64  # that the program simulates for a promise
BINS = (0.0, 0.5, 0.8, 0.95, 1.0)
SIGNIFICANT = 0.01
DECIDED = (0.05, 0.95)


def read(path):
    """Lines of a file."""
    return [json.loads(line) for line in path.read_text().splitlines() if line.strip()]


def sentence(line):
    """One seed in one line of text."""
    head = f"{line['robot']} {line['pair']} {line['misfit']} {line['seed']} {line['true']}:"
    if not line["kept"]:
        return f"{head} no poor log leaves both open, {line['tries']} tries"
    both = ", ".join(f"{kind} {shown(line[kind]['pips'])} ({line[kind]['sds']:.1f} sd)" for kind in KINDS)
    return f"{head} before {shown(line['before'])}, {both}"


def shown(pips):
    """PIPs as text."""
    return "/".join(f"{pip:.2f}" for pip in pips)


def mcnemar(lines):
    """One-sided exact probability that so many more are decided rightly by design alone, were both motions alike."""
    design = sum(line["designed"]["right"] and not line["random"]["right"] for line in lines)
    other = sum(line["random"]["right"] and not line["designed"]["right"] for line in lines)
    n = design + other
    return sum(comb(n, k) for k in range(design, n + 1)) / 2**n


def outcomes(line, motion="designed"):
    """For each effect of the pair: whether it is true, what was promised, and whether it is decided rightly and wrongly."""
    promises = {promise["effect"]: promise for promise in line["promises"]}
    for effect, pip in zip(line["effects"], line[motion]["pips"], strict=True):
        promise, is_there = promises[effect], effect == line["true"]
        said = True if pip >= DECIDED[1] else False if pip <= DECIDED[0] else None
        yield is_there, promise, {"right": said == is_there, "wrong": said == (not is_there)}


def promised(lines, is_there, side):
    """Pairs of a promised probability and what happened, of the true or the false effect of each run.

    The probability is that of (64 p + 1/2) / 65: 64 of 64 simulated robots are no certainty.
    """
    found = [own for line in lines for own in outcomes(line)]
    return [((WORLDS * promise[side] + 0.5) / (WORLDS + 1), happened[side]) for true, promise, happened in found if true == is_there]


def kept_promise(pairs):
    """Number that happened, number promised, and three binomial standard deviations."""
    return sum(y for _, y in pairs), sum(p for p, _ in pairs), 3.0 * sqrt(sum(p * (1 - p) for p, _ in pairs))


def table(lines):
    """One row per table, and the sum of each kind of world."""
    groups = defaultdict(list)
    for line in lines:
        groups[line["misfit"], line["robot"], line["pair"]].append(line)
        groups[line["misfit"], "all", "all"].append(line)
    yield "| misfit | robot | pair | kept of tried | designed: right, wrong | random: right, wrong | McNemar p |"
    yield "|---|---|---|---|---|---|---|"
    for key, own in sorted(groups.items(), key=lambda one: (one[0][0] != "none", one[0][1] == "all", one[0])):
        kept = [line for line in own if line["kept"]]
        if not kept:
            yield f"| {' | '.join(key)} | 0 of {len(own)} | | | |"
            continue
        shares = [", ".join(f"{100 * sum(line[kind][what] for line in kept) / len(kept):.0f} %" for what in ("right", "wrong")) for kind in KINDS]
        yield f"| {' | '.join(key)} | {len(kept)} of {len(own)} | {' | '.join(shares)} | {mcnemar(kept):.2g} |"


def of_promises(lines):
    """Rows of promises against outcomes."""
    yield "| misfit | effect | side | promised | happened | three sd | held |"
    yield "|---|---|---|---|---|---|---|"
    for misfit in sorted({line["misfit"] for line in lines}, key=lambda one: (one != "none", one)):
        own = [line for line in lines if line["misfit"] == misfit]
        for is_there in (True, False):
            for side in ("right", "wrong"):
                pairs = promised(own, is_there, side)
                happened, wanted, margin = kept_promise(pairs)
                held = "yes" if abs(happened - wanted) <= margin else "no"
                yield f"| {misfit} | {'true' if is_there else 'false'} | {side} | {wanted:.1f} | {happened} of {len(pairs)} | {margin:.1f} | {held} |"


def in_bins(lines):
    """Rows of how often an effect is decided rightly, by what was promised."""
    yield "| promised right | runs | mean promise | happened | three sd |"
    yield "|---|---|---|---|---|"
    pairs = promised(lines, True, "right") + promised(lines, False, "right")
    for low, high in zip(BINS, BINS[1:]):
        inside = [(p, y) for p, y in pairs if low <= p < high]
        if inside:
            happened, wanted, margin = kept_promise(inside)
            n = len(inside)
            yield f"| {low}–{high} | {n} | {wanted / n:.2f} | {happened / n:.2f} | {margin / n:.2f} |"


def report(lines):
    """Prints all tables."""
    print("\n" + "\n".join(table(lines)))
    kept = [line for line in lines if line["kept"]]
    if kept:
        print("\n" + "\n".join(of_promises(kept)))
        print("\n" + "\n".join(in_bins(kept)))

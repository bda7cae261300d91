"""The tables of the study, from JSON lines: one line per fleet.

    python table.py fleets.jsonl

A share passes where it is within two binomial standard deviations of its limit: hits >= n p - 2 sqrt(n p (1 - p)) of a lower limit p.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

RECALL, FALSE_SHARE, ONSET_SHARE, COVERAGE, FALSE_PER_FLEET, POOLING = 0.95, 0.05, 0.80, (0.93, 0.97), 0.1, 0.7


def slack(limit, total):
    """Two binomial standard deviations of a share."""
    return 2.0 * (limit * (1.0 - limit) / total) ** 0.5


def at_least(hits, total, limit):
    """A share and whether it reaches its limit."""
    return share(hits, total), None if total == 0 else hits / total >= limit - slack(limit, total)


def at_most(hits, total, limit):
    """A share and whether it stays below its limit."""
    return share(hits, total), None if total == 0 else hits / total <= limit + slack(limit, total)


def between(hits, total, limits):
    """A share and whether it is between its limits."""
    low, high = limits
    return share(hits, total), None if total == 0 else low - slack(low, total) <= hits / total <= high + slack(high, total)


def share(hits, total):
    """`0.93 (14/15)`."""
    return f"{hits / total:.2f} ({hits}/{total})" if total else "–"


def answer(passed):
    """Yes, no, or that nothing was counted."""
    return {None: "not measured", True: "yes", False: "no"}.get(passed, passed)


def units_of(lines):
    """Units that deviate and units that are named without a deviation."""
    rows = [unit for line in lines for unit in line["robots"]]
    return [unit for unit in rows if unit["deviates"]], [unit for unit in rows if not unit["deviates"]]


def planted_of(lines):
    """Every planted deviation."""
    return [one for line in lines for unit in line["robots"] for one in unit["planted"]]


def marks(rows, name):
    """How many of the rows that have an answer say yes, and how many have one."""
    said = [row[name] for row in rows if row.get(name) is not None]
    return sum(said), len(said)


def limits(lines):
    """Quantity, limit, measured, passed, over fleets of one kind."""
    true, false = units_of(lines)
    named, planted = sum(unit["named"] for unit in true), planted_of(lines)
    late = [abs(one["onset_off"]) <= 1 for one in planted if one["onset_off"] is not None]
    ratios = [line["pooling"]["ratio"] for line in lines if line.get("pooling") and line["pooling"]["ratio"] is not None]
    wrong = sum(len(line["type"]["false"]) for line in lines)
    rows = [("deviating units named", "≥ 0.95", *at_least(named, len(true), RECALL)),
            ("named units without a deviation", "≤ 0.05", *at_most(len(false), named + len(false), FALSE_SHARE)),
            ("onset within one window", "≥ 0.80", *at_least(sum(late), len(late), ONSET_SHARE)),
            ("95 % interval holds the planted size", "0.93 to 0.97", *between(*marks(planted, "covers"), COVERAGE)),
            ("95 % interval holds size and scatter", "–", share(*marks(planted, "covers_total")), "–")]  # fmt: skip
    if not true:
        rows = [("units named per fleet", "≤ 0.1", f"{len(false) / len(lines):.2f} ({len(false)}/{len(lines)})", len(false) <= FALSE_PER_FLEET * len(lines))]
    rows.append(("false effects of the type per fleet", "≤ 0.1", f"{wrong / len(lines):.2f} ({wrong}/{len(lines)})", wrong <= FALSE_PER_FLEET * len(lines)))
    rows.append(("true effects of the type, PIP > 0.99", "all", share(*found_types(lines)), len(set(found_types(lines))) == 1))
    middle = float(np.exp(np.mean(np.log(ratios)))) if ratios else None
    rows.append(("held-out error, pooled / alone", "≤ 0.7", f"{middle:.2f} ({len(ratios)} fleets)" if ratios else "–", middle <= POOLING if ratios else None))
    return rows


def found_types(lines):
    """True effects of the type that are sure, and how many there are."""
    return sum(line["type"]["found"] for line in lines), sum(line["type"]["true"] for line in lines)


def kind_rows(lines):
    """One row per kind of deviation."""
    head = ["deviation", "planted", "unit named", "effect right", "only a stand-in", "with a wrong effect", "onset within one window",
            "interval holds size", "size / scatter sd"]  # fmt: skip
    rows = [head, ["---"] * len(head)]
    pairs = defaultdict(list)
    for line in lines:
        for unit in line["robots"]:
            for one in unit["planted"]:
                pairs[one["kind"]].append((unit, one))
    for kind, found in sorted(pairs.items()):
        stand = sum(not one["found"] and any(effect["judged"] == "stand_in" for effect in unit["effects"]) for unit, one in found)
        wrong = sum(any(effect["judged"] == "wrong" for effect in unit["effects"]) for unit, _ in found)
        late = [abs(one["onset_off"]) <= 1 for _, one in found if one["onset_off"] is not None]
        scatter = np.median([one["scatter_sds"] for _, one in found])
        rows.append([kind, len(found), share(sum(unit["named"] for unit, _ in found), len(found)), share(sum(one["found"] for _, one in found), len(found)),
                     stand, wrong, share(sum(late), len(late)), share(*marks([one for _, one in found], "covers")), f"{scatter:.2g}"])  # fmt: skip
    return rows if pairs else []


def cpu_row(lines):
    """Mean CPU seconds per fleet."""
    parts = {what for line in lines for what in line["cpu"]}
    mean = {what: np.mean([line["cpu"][what] for line in lines if what in line["cpu"]]) for what in ("simulate", "statistics", "fleet") if what in parts}
    return "CPU per fleet: " + ", ".join(f"{what} {seconds:.1f} s" for what, seconds in mean.items())


def table(rows):
    """Markdown of rows, the first of which is the head."""
    return "\n".join("| " + " | ".join(str(cell) for cell in row) + " |" for row in rows)


def markdown(lines):
    """Tables of every kind, robot and size."""
    groups, out = defaultdict(list), []
    for line in lines:
        groups[line["kind"], line["robot"], line["units"], line["windows"], line["sds"], line["of"]].append(line)
    for (kind, robot, units, windows, sds, of), some in groups.items():
        good = [line for line in some if "error" not in line]
        size = "" if kind == "null" else f", {sds:g} sds of {'one window' if of == 'window' else 'window and units'}"
        out.append(f"### {kind}: {len(some)} fleet{'s' * (len(some) != 1)} of {units} {robot}, {windows} windows{size}")
        out += [f"Seed {line['seed']} failed: {line['error'].splitlines()[0]}" for line in some if "error" in line]
        out.append(cpu_row(some))
        if good:
            rows = [["quantity", "limit", "measured", "passed"], ["---"] * 4]
            out.append(table(rows + [[*row[:3], answer(row[3])] for row in limits(good)]))
            out.append(table(kind_rows(good)))
    return "\n\n".join(part for part in out if part)


def main():
    print(markdown([json.loads(text) for text in Path(sys.argv[1]).read_text().splitlines() if text.strip()]))


if __name__ == "__main__":
    main()

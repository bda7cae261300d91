"""Tables and figure of the runs there are: one table per measure, problems in rows, methods in columns."""

import json

import matplotlib
import numpy as np

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402

HINDSIGHT = "STLSQ, threshold in hindsight"
# Name, method, rows; of several those with the higher mean F1 on the problem. Where twincal went on in the wider band (docs/selection.md), "wider"
# are the rows of that band; elsewhere the same as the filtered ones.
METHODS = [
    ("twincal", "twincal", ("filtered",)),
    ("twincal, ar1", "twincal, ar1", ("filtered",)),
    ("paper, filtered rows", "the paper's", ("filtered", "wider")),
    ("paper", "the paper's", ("raw",)),
    ("ARD", "ARDRegression", ("filtered", "wider", "raw")),
    ("LassoCV", "LassoCV", ("filtered", "wider", "raw")),
    ("STLSQ", "STLSQ", ("filtered", "wider", "raw")),
    ("ensemble", "STLSQ ensemble", ("filtered", "wider", "raw")),
    ("STLSQ in hindsight", HINDSIGHT, ("filtered", "wider", "raw")),
]
COLOURS = ("#d1495b", "#edae49", "#7fb3d5", "#30638e", "#00798c", "#6a994e", "#8d6a9f", "#555555", "#bbbbbb")
MEASURES = [
    ("f1", "F1", "{:.3f}"),
    ("false", "False terms per run", "{:.2f}"),
    ("missed", "Missed terms per run", "{:.2f}"),
    ("rmse", "Held-out RMSE of the filtered torque, N·m", "{:.4f}"),
    ("model", "The same against torque without noise, N·m", "{:.4f}"),
    ("coverage", "Coverage of 95 % intervals of the true coefficients", "{:.3f}"),
    ("calibration", "Expected calibration error of the probabilities", "{:.3f}"),
    ("seconds", "Processor time, s", "{:.2f}"),
]


def f1(score):
    """Harmonic mean of precision and recall over all components of a run."""
    return 2 * score["hit"] / (2 * score["hit"] + score["false"] + score["missed"])


def calibration(scores):
    """Expected calibration error, 20 bins: |mean probability - share that is true|, weighted by the bin's count."""
    chance = np.concatenate([s["chance"] for s in scores])
    true = np.concatenate([s["is_true"] for s in scores])
    bins = np.minimum((chance * 20).astype(int), 19)
    return sum(abs((chance[bins == b] - true[bins == b]).sum()) for b in range(20)) / len(chance)


def reliability(all_runs, problems):
    """Prints what probabilities are worth: how many of the candidates with a probability in this range are true.

    Problems whose truth the candidates cannot say are left out: there a candidate may rightly stand in for what is missing.
    """
    whole = [run for name, runs in all_runs.items() for run in runs if problems[name].friction and not problems[name].stribeck]
    kinds = [(label, f"{method}|{kinds[0]}") for label, method, kinds in METHODS]
    kinds = [(label, key) for label, key in kinds if whole and "chance" in whole[0]["scores"].get(key, {})]
    edges = [0, 0.05, 0.2, 0.5, 0.8, 0.95, 1]
    print("### Probabilities said, and the share that is true (number of candidates)")
    print("| said | " + " | ".join(label for label, _ in kinds) + " |\n|---|" + "---|" * len(kinds))
    for low, high in zip(edges, edges[1:]):
        cells = []
        for _, key in kinds:
            chance = np.concatenate([run["scores"][key]["chance"] for run in whole])
            true = np.concatenate([run["scores"][key]["is_true"] for run in whole])
            here = (chance >= low) & ((chance < high) | (high == 1))
            cells.append(f"{chance[here].mean():.3f} → {true[here].mean():.3f} ({here.sum()})" if here.any() else "–")
        print(f"| {low:g} to {high:g} | " + " | ".join(cells) + " |")
    print()


def summary(runs, method, kind):
    """One method on one kind of rows: means over runs, and every run's F1; None where it was not run."""
    scores = [run["scores"].get(f"{method}|{kind}") for run in runs]
    if kind == "wider" and any(scores):
        scores = [own or run["scores"][f"{method}|filtered"] for own, run in zip(scores, runs)]
    scores = [own for own in scores if own]
    if not scores:
        return None
    covered = np.sum([s["covered"] for s in scores if "covered" in s], axis=0)
    return {
        "kind": kind,
        "each": np.array([f1(s) for s in scores]),
        "refused": sum(bool(s.get("refused")) for s in scores),
        "f1": float(np.mean([f1(s) for s in scores])),
        **{key: float(np.mean([s[key] for s in scores])) for key in ("false", "missed", "rmse", "seconds")},
        "model": float(np.mean([s["rmse_clean"] for s in scores])),
        "calibration": calibration(scores) if "chance" in scores[0] else None,
        "coverage": float(covered[0] / covered[1]) if np.ndim(covered) else None,
    }


def better(runs, method, kinds):
    """The kind of rows with the highest F1 (at equal F1 the smallest model error)."""
    known = [s for s in (summary(runs, method, kind) for kind in kinds) if s]
    return max(known, key=lambda s: (round(s["f1"], 4), -s["model"])) if known else None


def tied(best, other):
    """F1 of the same runs differs by no more than two standard errors of the mean difference."""
    gap = best["each"] - other["each"]
    return gap.mean() <= 2 * gap.std(ddof=1) / len(gap) ** 0.5 if len(gap) > 1 else gap[0] <= 0


def cell(key, form, summary, top):
    """A number; bold where it is the best or, for F1, tied with it."""
    if summary is None or summary[key] is None:
        return "–"
    text = form.format(summary[key])
    if key == "f1":
        text = f"**{text}**" if tied(top, summary) else text
        return text + {"raw": " r", "wider": " w"}.get(summary["kind"], "") + (f" ({summary['refused']} refused)" if summary["refused"] else "")
    return text


def read(path):
    """Runs of one problem."""
    return [json.loads(text) for text in path.read_text().splitlines()] if path.exists() else []


def show(problems, folder, figure):
    """Prints one table per measure, what the runs were, and draws the figure."""
    all_runs = {name: runs for name, runs in ((name, read(folder / f"{name}.jsonl")) for name in problems) if runs}
    if not all_runs:
        return
    found = {name: {label: better(runs, method, kinds) for label, method, kinds in METHODS} for name, runs in all_runs.items()}
    labels = [label for label, _, _ in METHODS if any(row[label] for row in found.values())]
    for key, title, form in MEASURES:
        print(f"### {title}\n| problem | " + " | ".join(labels) + " |\n|---|" + "---|" * len(labels))
        for name, row in found.items():
            top = max((s for label, s in row.items() if s and label != METHODS[-1][0]), key=lambda s: s["f1"])
            print(f"| {problems[name].words} | " + " | ".join(cell(key, form, row[label], top) for label in labels) + " |")
        print()
    reliability(all_runs, problems)
    print("### Runs\n| problem | runs | filtered rows | raw rows | columns | cut-off, Hz | condition number |\n|---|---|---|---|---|---|---|")
    for name, runs in all_runs.items():
        (filtered, columns), (raw, _) = (runs[0]["rows"][kind] for kind in ("filtered", "raw"))
        cuts = sorted({f"{run['cutoff_hz']:.3g}" for run in runs}, key=float)
        cut = cuts[0] if len(cuts) == 1 else f"{cuts[0]}–{cuts[-1]}"
        condition = np.median([run["condition"] for run in runs])
        print(f"| {problems[name].words} | {len(runs)} | {filtered} | {raw} | {columns} | {cut} | "
              f"{'singular' if condition > 1e12 else format(condition, '.0f')} |")  # fmt: skip
    draw(found, labels, figure)


def draw(found, labels, path):
    """False and missed terms per run, a mark per method."""
    plt.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": "twincal", "font.size": 9}
    figure, axes = plt.subplots(1, 2, figsize=(8.5, 0.45 * len(found) + 1.4), sharey=True)
    figure.set_facecolor("white")
    for axis, key in zip(axes, ("false", "missed")):
        for at in range(len(found)):
            axis.axhline(at, color="#e4e4e4", lw=9, zorder=0)
        for rank, ((label, _, _), colour) in enumerate(zip(METHODS, COLOURS)):
            if label in labels:
                there = [(at, row[label][key]) for at, row in enumerate(found.values()) if row[label]]
                heights = [at + 0.76 * (rank / (len(METHODS) - 1) - 0.5) for at, _ in there]
                axis.plot([value for _, value in there], heights, "o", ms=3.6, color=colour, label=label, clip_on=False)
        axis.set_xscale("symlog", linthresh=0.1, linscale=0.4)
        axis.set_xlim(0, 13)
        axis.set_xticks([0, 0.1, 1, 10], ["0", "0.1", "1", "10"])
        axis.set_xlabel(f"{key} terms per run")
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_yticks(range(len(found)), list(found))
    axes[0].invert_yaxis()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="upper center", ncols=5, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 1 - 0.5 / figure.get_figheight()))
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)

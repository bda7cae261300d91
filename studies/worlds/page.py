"""Writes docs/worlds.md from the lines of the study.

    python page.py --date 2026-11-27 final.jsonl [--held-back others.jsonl] [--before earlier.jsonl] -o ../../docs/worlds.md
"""

import argparse
from pathlib import Path

from compare import difference_rows, shared_pairs
from fits import read
from table import false_names, limits, lines_of, reliability_rows, sound, world_rows
from worlds import HELD_BACK, KINDS, MIDDLE, PAYLOAD, ROBOTS, Drawer

INTRODUCTION = """# Worlds: which claims are true
Arms are simulated whose every defect is known. Each fit gets two training logs and one held-out log.
Every reported component beyond viscous and Coulomb friction is then true, a stand-in or false.
"""
TRUTH = """## How truth counts
| word | meaning |
|---|---|
| true | the cause acts: same joint or link, same family |
| stand-in | no candidate for the cause; takes 80 % off its torque's mean square |
| false | all else |

- Levels of a body count as that body. The payload and the last link are one body.
- Friction with memory is `hysteresis` or `stribeck` of that joint. The `stribeck` candidate alone does not
  describe it: without `hysteresis` in the library the world counts as one without candidates.
- A set of at most four members counts once. It is true if it holds the cause.
- Stand-ins are judged on a third motion without noise, on the joints on which the component acts.
  Viscous and Coulomb friction are free on both sides of that comparison.
- `established` is `components[].status`. For programs without it: PIP ≥ 0.95 and `selected`.
- A bound is one-sided at 99 %. "missed": the bound excludes the limit.
- The size of an effect in standard errors is that of least squares with the true causes and friction
  (`studies/worlds/oracle.py`): ten columns for a body, rows below 5 Hz, the noise as simulated.
- Error / friction is the held-out error over that of nominal torque, friction and motor inertia,
  geometric mean over joints. Coverage is that of moving rows.
"""
RECORDED = f"""## What is simulated
- Robots: {", ".join(ROBOTS)}; held back: UR10, Z1. Payloads of up to {", ".join(f"{mass:g} kg ({name})" for name, mass in PAYLOAD.items())}.
- Motions: Fourier series, point to point with dwells, pick and place; 12 s at 250 Hz, `warm_up` 30 s.
- The held-out log has another motion of the same kind in half of the worlds, else another kind.
- Encoders have 2^17 to 2^20 counts per turn. Torque noise is 3 to 8 % of Coulomb friction,
  half white, half AR(1) of 10 ms. Every joint has viscous and Coulomb friction.
- A link that may be heavier is one of joints {", ".join(f"{name} {'/'.join(str(j + 1) for j in joints)}" for name, joints in MIDDLE.items())}.
- In half of the `gain` worlds the log says that its torque is a current.
- All worlds marked with a payload in half of them draw it by seed.
"""


def kinds_rows(kinds):
    """What each kind draws, in the words of the method that draws it."""
    words = lambda kind: " ".join((getattr(Drawer, kind).__doc__ or "").split())
    calls = lambda kind: getattr(Drawer, kind).__code__.co_names
    half = lambda kind: "half" if "maybe_payload" in calls(kind) else "some" if kind == "small" else "all" if "payload" in calls(kind) else "–"
    return [["world", "what is drawn", "payload"], ["---"] * 3, *([f"`{kind}`", words(kind), half(kind)] for kind in kinds)]


def section(title, lines, command):
    """Tables of one set of fits."""
    worlds, failed = sound(lines)
    good = [line for some in worlds.values() for line in some]
    return [f"## {title}", f"`{command}`: {len(lines)} fits, {len(failed)} refused.", lines_of(limits(lines)), "### World by world", lines_of(world_rows(worlds)),
            "### Probabilities said", lines_of(reliability_rows(good)), f"Established and false: {false_names(good)}."]  # fmt: skip


def command_of(lines, options=""):
    """The command that gives these lines."""
    seeds = [line["seed"] for line in lines]
    return f"studies/worlds/run --seeds {min(seeds)} {max(seeds)}{options}"


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("lines")
    arguments.add_argument("--held-back")
    arguments.add_argument("--before", help="lines of an earlier version on the same worlds")
    arguments.add_argument("--date", required=True)
    arguments.add_argument("-o", "--output", type=Path, required=True)
    given = arguments.parse_args()
    lines = read(given.lines)
    parts = [INTRODUCTION.rstrip(), *section(f"Results, {given.date}", lines, command_of(lines))]
    if given.held_back:
        others = read(given.held_back)
        parts += section("Worlds of other kinds, which no choice was made on", others, command_of(others, " --held-back"))
    if given.before:
        pairs = shared_pairs(read(given.before), lines)
        said = f"{len(pairs)} worlds, fitted by both."
        parts += ["## Beside the version before, same logs", said, lines_of(difference_rows(pairs))]
    parts += [TRUTH.rstrip(), RECORDED.rstrip(), lines_of(kinds_rows(KINDS + HELD_BACK))]
    given.output.write_text("\n\n".join(parts) + "\n")


if __name__ == "__main__":
    main()

"""Two promises about chance, measured: what pure noise yields, and what becomes of an effect of eight standard errors.

    python benches/selection/chance.py [--fits 100] [--twincal PROGRAM]

50 candidates on the planar arm, 20 s at 100 Hz, every row used, white torque noise of 0.1 N m, defaults otherwise. Standard
errors are those of least squares on all 50 columns. Prints false terms per fit, and the share of planted effects with a
probability above one half.
"""

import argparse
import json
import os
import tempfile
from pathlib import Path

import numpy as np

import planar
import program
import selection

USER = (
    *("sin(2*q1)", "cos(2*q1)", "sin(2*q2)", "cos(2*q2)", "sin(3*q1)", "cos(3*q1)", "sin(3*q2)", "cos(3*q2)"),
    *("sin(q1-q2)", "cos(q1-q2)", "sin(2*q1+q2)", "cos(2*q1+q2)", "sin(q1+2*q2)", "cos(q1+2*q2)"),
    *("q1*q2", "q1^3", "q2^3", "q1^2*q2", "q1*q2^2"),
    *("qd1^2*cos(q1)", "qd1^2*sin(q1)", "qd2^2*cos(q1)", "qd2^2*sin(q1)", "qd1*qd2*cos(q1)", "qd1*qd2*sin(q1)"),
    *("qd1^2*cos(2*q2)", "qd2^2*cos(2*q2)"),
)
RATE, NOISE, SIZE = 100.0, 0.1, 8.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fits", type=int, default=100, help="of each kind")
    default = os.environ.get("TWINCAL", selection.ROOT / "target" / "release" / "twincal")
    parser.add_argument("--twincal", type=Path, default=default)
    options = parser.parse_args()
    columns = list(USER + planar.GENERIC + planar.FRICTION + planar.OFFSETS)
    assert len(columns) == 50
    config = f"[library]\nterms = {json.dumps(USER)}\nmotor_inertia = false\ncoulomb_velocity = {planar.V_S}\n{program.OFF}"
    false, strays, found, least = [], [], [], []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for fit in range(options.fits):
            log = planar.simulate(planar.Settings(train=1, heldout=0, rate_hz=RATE, seed=1 + fit % 10)).logs[0]
            x, tau_nom = planar.design(columns, log.q, log.qd, log.qdd)
            flat = x.reshape(-1, len(columns))
            scale = np.sqrt(np.mean(flat**2, axis=0))
            errors = NOISE * np.sqrt(np.diag(np.linalg.inv((flat / scale).T @ (flat / scale)))) / scale
            rng = np.random.default_rng([fit, 2])
            planted = fit % len(columns)
            for beta in (0.0, SIZE * errors[planted]):
                tau = tau_nom + x[:, :, planted] * beta + NOISE * rng.standard_normal(log.q.shape)
                path = selection.write(folder / "log.parquet", (log.q, log.qd, log.qdd, tau), RATE)
                result, _ = program.fit(options.twincal, planar.ASSETS / "arm.urdf", [path], [], config, folder)
                pip = program.answer(result, columns)["chance"]
                if beta == 0.0:
                    false.append(int((pip >= 0.5).sum()))
                else:
                    strays.append(int((np.delete(pip, planted) >= 0.5).sum()))
                    found.append(bool(pip[planted] >= 0.5))
                    least.append((pip[planted], columns[planted]))
    print(f"pure noise, 50 candidates: {np.mean(false):.3f} false terms per fit ({sum(false)} in {len(false)} fits)")
    print(f"an effect of {SIZE:g} standard errors: found in {100 * np.mean(found):.1f} % of {len(found)} fits, "
          f"{np.mean(strays):.3f} false terms beside it; least probabilities {sorted(least)[:3]}")  # fmt: skip


if __name__ == "__main__":
    main()

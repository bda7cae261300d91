"""Torque images of candidate Lagrangians by SymPy, for crates/twincal/src/term/tests/sympy.rs.

SymPy takes d/dt of dL/dqd itself, with the coordinates as functions of time: it shares no formula with twincal, which
expands the operator by hand. Values have 40 digits before they are rounded to doubles.

    python crates/twincal/tests/reference/term/make.py            writes euler_lagrange.json beside this file
    python crates/twincal/tests/reference/term/make.py --check    fails if the file is not what this script makes
"""

import json
import random
import sys
from pathlib import Path

import sympy as sp

EXPRESSIONS = [
    # the planar arm's own
    "qd1^2",
    "qd1*qd2*cos(q2)",
    "qd1^2*sin(q2)",
    "sin(q1+q2)",
    "q2^2",
    # kinetic terms with several joints
    "qd1*qd3*cos(q2)*sin(2*q3)",
    "qd2^2*cos(q1+q2-q3)^2",
    "(qd1 + qd2*cos(q2))^2*(1 + q3^2)",
    "qd3^2*q1*q2*q3",
    # powers, also negative and real ones
    "(2+sin(q1))^-2*qd1^2",
    "qd1^3*q2",
    "qd1^4/24 - qd2^3*q1^5",
    "(1.5+cos(q2))^0.5*qd2^2",
    "(q1^2+q2^2+1)^(-3/2)",
    # rational functions
    "qd1^2/(1+q2^2)",
    "(q1-q2)/(2+cos(q1))/(3+q3^2)*qd2",
    "1/(1+exp(-3*q1))*qd1*qd2",
    # every function of the grammar
    "tan(q1/4)*qd2^2",
    "exp(-q1^2)*qd1*qd2",
    "log(2+sin(q1*q2))*qd1^2",
    "sqrt(1+qd1^2+q2^2)",
    "sinh(q1/2)*cosh(q2/2)*qd1*qd3",
    "tanh(3*q1)*qd2^2 - tanh(qd1)",
    "atan(q1*q3)*qd2^2",
    "log(qd1^2+1)*cos(q3-pi/3)",
    # not quadratic, not separable
    "sin(qd1*q2)*cos(qd2*q1)",
    "exp(sin(q1+qd2)) - qd3*q1*q2",
    # total time derivatives: image 0
    "qd1*sin(q1)",
    "qd1*q2*cos(q1) + qd2*sin(q1)",
    # zero only by an identity
    "sin(2*q1) - 2*sin(q1)*cos(q1)",
]
JOINTS = 3
STATES = 4


def images(text):
    """D_1 … D_n and phi as SymPy expressions in plain symbols."""
    t = sp.Symbol("t")
    q = [sp.Function(f"q{i + 1}")(t) for i in range(JOINTS)]
    qs = sp.symbols(f"q1:{JOINTS + 1}")
    vs = sp.symbols(f"qd1:{JOINTS + 1}")
    accs = sp.symbols(f"qdd1:{JOINTS + 1}")
    names = {str(s): s for s in (*qs, *vs)}
    phi = sp.sympify(text.replace("^", "**"), locals=names, rational=True)
    to_time = [(v, sp.diff(c, t)) for v, c in zip(vs, q)] + list(zip(qs, q))
    to_plain = (
        [(sp.diff(c, t, 2), a) for c, a in zip(q, accs)]
        + [(sp.diff(c, t), v) for c, v in zip(q, vs)]
        + list(zip(q, qs))
    )
    rows = []
    for i in range(JOINTS):
        momentum = sp.diff(phi, vs[i]).subs(to_time, simultaneous=True)
        force = sp.diff(phi, qs[i])
        rows.append(sp.diff(momentum, t).subs(to_plain[:JOINTS]).subs(to_plain[JOINTS:]) - force)
    return phi, rows, (*qs, *vs, *accs)


def make():
    rng = random.Random(7)
    cases = []
    for text in EXPRESSIONS:
        phi, rows, symbols = images(text)
        states = []
        for _ in range(STATES):
            values = [rng.uniform(-1.5, 1.5) for _ in symbols]
            at = {s: sp.Rational(v) for s, v in zip(symbols, values)}  # the double, exactly

            def number(expression):
                exact = sp.sympify(expression).subs(at)
                return float(exact.evalf(40, chop=True) if exact.free_symbols == set() else sp.nan)

            states.append(
                {
                    "q": values[:JOINTS],
                    "qd": values[JOINTS : 2 * JOINTS],
                    "qdd": values[2 * JOINTS :],
                    "phi": number(phi),
                    "torque": [number(row) for row in rows],
                }
            )
        cases.append({"expression": text, "states": states})
    return {
        "made_by": "SymPy",
        "version": sp.__version__,
        "command": "python crates/twincal/tests/reference/term/make.py",
        "joints": JOINTS,
        "cases": cases,
    }


def main():
    path = Path(__file__).with_name("euler_lagrange.json")
    made = make()
    if "--check" in sys.argv[1:]:
        kept = json.loads(path.read_text())
        made["version"] = kept["version"]
        if kept != made:
            sys.exit(f"{path.name} is not what {Path(__file__).name} makes")
        print(f"{path.name}: {len(made['cases'])} expressions, as made")
    else:
        path.write_text(json.dumps(made, indent=1) + "\n")
        print(f"wrote {path.name}: {len(made['cases'])} expressions")


if __name__ == "__main__":
    main()

"""Candidates in SymPy: a term as twincal writes it, and the Euler-Lagrange operator on it (paper eq. 3), exactly.

    D_i(phi) = sum_j d2phi/dqd_i dqd_j qdd_j + sum_j d2phi/dqd_i dq_j qd_j - dphi/dq_i
"""

from functools import lru_cache

import numpy as np
import sympy

Q = sympy.symbols("q1 q2", real=True)
QD = sympy.symbols("qd1 qd2", real=True)
QDD = sympy.symbols("qdd1 qdd2", real=True)
_NAMES = {str(s): s for s in Q + QD} | {"sin": sympy.sin, "cos": sympy.cos}


def parse(term):
    """SymPy expression of a term in twincal's grammar (`^` is the power)."""
    return sympy.sympify(term.replace("^", "**"), locals=_NAMES)


def euler_lagrange(phi):
    """The two torque expressions D_1(phi), D_2(phi) in q, qd, qdd."""
    rows = []
    for i in range(2):
        momentum = sympy.diff(phi, QD[i])
        row = sum(sympy.diff(momentum, QD[j]) * QDD[j] + sympy.diff(momentum, Q[j]) * QD[j] for j in range(2))
        rows.append(sympy.expand(row - sympy.diff(phi, Q[i])))
    return rows


@lru_cache(maxsize=None)
def _compiled(term, module):
    return sympy.lambdify(Q + QD + QDD, euler_lagrange(parse(term)), module)


def column(term, q, qd, qdd):
    """Torque column of a term for samples in rows, N x 2, N m per unit of its coefficient."""
    rows = _compiled(term, "numpy")(*q.T, *qd.T, *qdd.T)
    return np.stack([np.broadcast_to(row, len(q)) for row in rows], axis=1).astype(float)


def mass_and_bias(terms):
    """Fast scalar form of a sum of terms {term: coefficient}: q, qd -> (H11, H12, H22, c1, c2) with D = H qdd + c."""
    rows = euler_lagrange(sum((b * parse(t) for t, b in terms.items()), sympy.Integer(0)))
    bias = [row.subs(dict.fromkeys(QDD, 0)) for row in rows]
    mass = [sympy.diff(rows[0], QDD[0]), sympy.diff(rows[0], QDD[1]), sympy.diff(rows[1], QDD[1])]
    return sympy.lambdify(Q + QD, mass + bias, "math")


def friction_column(kind, joint, qd, coulomb_velocity):
    """Column of `<joint>.viscous`, `.coulomb` or `.offset`, N x 2: + qd, + tanh(qd / v_s) (sign at v_s = 0), + 1."""
    out = np.zeros_like(qd)
    speed = qd[:, joint]
    if kind == "viscous":
        out[:, joint] = speed
    elif kind == "coulomb":
        out[:, joint] = np.tanh(speed / coulomb_velocity) if coulomb_velocity > 0 else np.sign(speed)
    elif kind == "offset":
        out[:, joint] = 1.0
    else:
        raise ValueError(f"no friction column of kind {kind!r}; use viscous, coulomb or offset")
    return out

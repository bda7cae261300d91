"""How large a deviation of a unit is: standard error of a least squares over one window that knows the mechanisms.

Columns are the deviation itself, viscous and Coulomb friction of every joint, the ten inertial parameters of a body at the flange unless
the deviation is one, and the zeros of the other joints. They are low-passed and weighted as in `studies/worlds/oracle.py`:

    1 / sqrt(sum_j |M u_j|^2 / S_j),   S_j = sigma_j^2 (1 + (1 + rho) / (1 - rho)) / 2,

u the torque of a deviation of size 1 (kg at a known centre, N m of Coulomb friction, rad) and M the projection off all other columns.
Neither the other windows nor the other units are used, so that a program that pools them has a smaller error.
"""

from math import exp

import numpy as np
import pinocchio as pin
from defects import PAYLOAD_RADIUS
from oracle import THIN, body_columns, friction_columns, low_pass

COLLINEAR = 1e-7  # singular values below this share of the largest are no direction


def zero_columns(model, path):
    """Torque per rad of every joint's zero: samples x joints x joints."""
    data = model.createData()
    out = np.empty((*path.q.shape, path.q.shape[1]))
    for k, row in enumerate(zip(path.q, path.qd, path.qdd)):
        pin.computeRNEADerivatives(model, data, *row)
        out[k] = data.dtau_dq
    return out


def columns_of_window(model, path, recorder, sd, centre):
    """Low-passed and weighted columns of one window: {mass, body, friction, zeros}, rows x columns."""
    rho = exp(-1.0 / (recorder.rate * recorder.noise_time))
    scale = 1.0 / (sd * (0.5 * (1.0 + (1.0 + rho) / (1.0 - rho))) ** 0.5)
    rows = lambda part: (low_pass(part, recorder.rate)[::THIN] * (THIN**0.5 * scale[:, None])).reshape(-1, part.shape[2])
    body = rows(body_columns(model, model.nv - 1, path, 1))
    ball = pin.Inertia(1.0, np.array(centre), 0.4 * PAYLOAD_RADIUS**2 * np.eye(3)).toDynamicParameters()
    return {"mass": body @ ball, "body": body, "friction": rows(friction_columns(path.qd)), "zeros": rows(zero_columns(model, path))}


def standard_error(columns, kind, joint):
    """Standard error of a deviation of size 1; infinite where the other columns explain it."""
    friction, zeros, body = columns["friction"], columns["zeros"], columns["body"]
    if kind == "mass":
        own, others = columns["mass"], [friction, zeros]
    elif kind == "drag":
        which = zeros.shape[1] + joint  # viscous friction stands first
        own, others = friction[:, which], [np.delete(friction, which, axis=1), zeros, body]
    else:
        own, others = zeros[:, joint], [friction, np.delete(zeros, joint, axis=1), body]
    others = np.hstack(others)
    others = others / np.maximum(np.linalg.norm(others, axis=0), 1e-12)
    basis, values, _ = np.linalg.svd(others, full_matrices=False)
    basis = basis[:, values > COLLINEAR * values[0]]
    rest = np.linalg.norm(own - basis @ (basis.T @ own))
    return float(1.0 / rest) if rest > COLLINEAR * np.linalg.norm(own) and rest > 1e-12 else float("inf")

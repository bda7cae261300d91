"""How large a true effect is, in standard errors of a least squares that knows which effects are true.

Columns are those of the true causes: all ten inertial parameters of a body (Pinocchio's regressor of the model file), the three components
of gravity, else the cause's own torque; and viscous and Coulomb friction of every joint, v_s known. Columns are low-passed at 5 Hz, as
the rows of a fit are; the noise left there is white with the power of white + AR(1) noise at low frequencies. The size of an effect c is

    sqrt(sum_j |M_c u_cj|^2 / S_j),   S_j = sigma_j^2 (1 + (1 + rho) / (1 - rho)) / 2,

u_c its true torque and M_c the projection off all other columns. For one column that is its coefficient over its standard error.
"""

from math import exp

import numpy as np
import pinocchio as pin
from scipy.signal import butter, sosfiltfilt
from shared import BASE_RATE, COULOMB_VELOCITY

CUTOFF = 5.0  # Hz
THIN = 10  # every tenth of the low-passed samples is kept, and counts tenfold


def low_pass(columns, rate):
    """Zero-phase low-pass along the samples."""
    return sosfiltfilt(butter(4, CUTOFF, fs=rate, output="sos"), columns, axis=0)


def body_columns(model, joint, path, keep):
    """Torque per inertial parameter of one body: samples x joints x 10."""
    data, some = model.createData(), slice(10 * joint, 10 * joint + 10)
    rows = zip(path.q[::keep], path.qd[::keep], path.qdd[::keep])
    return np.array([pin.computeJointTorqueRegressor(model, data, *row)[:, some] for row in rows])


def gravity_columns(model, path, keep):
    """Torque per unit of gravity along x, y, z: samples x joints x 3."""
    columns = []
    for axis in range(3):
        turned = model.copy()
        turned.gravity.linear = np.eye(3)[axis]
        data = turned.createData()
        columns.append([pin.computeGeneralizedGravity(turned, data, q).copy() for q in path.q[::keep]])
    return np.moveaxis(np.array(columns), 0, -1)


def columns_of(world, cause, path, keep, effect):
    """Columns of one cause."""
    model = world.arm.model
    if cause.mechanism in ("payload", "heavier"):
        joint = model.nv - 1 if cause.mechanism == "payload" else world.defects.heavier[0]
        return body_columns(model, joint, path, keep)
    if cause.mechanism == "tilt":
        return gravity_columns(model, path, keep)
    return effect[:, :, None]


def friction_columns(qd):
    """Viscous and Coulomb friction of every joint: samples x joints x 2 joints."""
    n = qd.shape[1]
    out = np.zeros((*qd.shape, 2 * n))
    for j in range(n):
        out[:, j, j], out[:, j, n + j] = qd[:, j], np.tanh(qd[:, j] / COULOMB_VELOCITY)
    return out


def standard_errors(world, paths, effects, sd):
    """Size of every cause in standard errors, from the training motions and the torque that each cause contributes to them."""
    if not world.causes:
        return []
    recorder, keep = world.recorder, BASE_RATE // world.recorder.rate
    rho = exp(-1.0 / (recorder.rate * recorder.noise_time))
    scale = 1.0 / (sd * (0.5 * (1.0 + (1.0 + rho) / (1.0 - rho))) ** 0.5)
    rows = lambda part: low_pass(part, recorder.rate)[::THIN] * (THIN**0.5 * scale[:, None])
    stack = lambda parts: np.concatenate([rows(part) for part in parts]).reshape(-1, parts[0].shape[2])
    sets = [stack([columns_of(world, cause, path, keep, effect[k]) for path, effect in zip(paths, effects)])
            for k, cause in enumerate(world.causes)]  # fmt: skip
    friction = stack([friction_columns(path.qd[::keep]) for path in paths])
    own = stack([np.moveaxis(effect, 0, -1) for effect in effects])
    sizes = []
    for k in range(len(world.causes)):
        others = np.hstack([friction, *(columns for i, columns in enumerate(sets) if i != k)])
        others = others / np.maximum(np.linalg.norm(others, axis=0), 1e-12)
        basis, values, _ = np.linalg.svd(others, full_matrices=False)
        basis = basis[:, values > 1e-7 * values[0]]
        rest = own[:, k] - basis @ (basis.T @ own[:, k])
        sizes.append(float(np.linalg.norm(rest)))
    return sizes

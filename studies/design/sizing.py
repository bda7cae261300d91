"""How large a cause is: so many standard errors of what 20 s of random motion give.

    error = 1 / |M u|,   M = 1 − X (XᵀX)⁻¹ Xᵀ

u is the torque of a cause of size 1 and X holds the columns of the other effect of the pair and of friction, in units of the noise. What is
left of u is the one direction that tells the two causes apart, and the square of size / error is the noncentrality of the test between
them. The effect's own further columns are not in X: the cause has one size, and the price of more columns is the posterior's affair.
Of a potential X has the first harmonic alone: with the second one it equals a spring to a thousandth within ±1.2 rad.

Misfit adds its own error, (Σ over seconds of (uᵀM r)²)^½ / |M u|², with r the torque that no column explains.
"""

import numpy as np
import pinocchio as pin

NOISE = 0.3  # N m, sd of every joint
COULOMB_VELOCITY = 0.01  # rad/s
THIN = 4  # rows of a log per row of the columns
MOTIONS = range(11, 26)  # numbers of the random motions that a size is taken from; none of them is compared
BLOCK = 1.0  # s, within which misfit adds up
COLLINEAR = 1e-7  # singular values below this share of the largest are no direction


def body(model, cause, size):
    """Inertia of a payload, a point at the flange, or of so much more of the link before the last one, kg."""
    if cause == "payload":
        return pin.Inertia(size, np.array([0.0, 0.0, 0.05]), np.zeros((3, 3)))
    own = model.inertias[model.nv - 1]
    return pin.Inertia(size, own.lever, own.inertia * size / own.mass)


def on_joint(shape, joint, *signals):
    """Columns of one joint: samples x joints x signals."""
    out = np.zeros((*shape, len(signals)))
    out[:, joint] = np.stack(signals, axis=1)
    return out


def columns(world, motion):
    """Columns of each effect and of friction, and the torque of a cause of size 1."""
    _, q, qd, qdd = motion
    model = world.with_load(world.model) if world.pair == "gain" else world.model
    data, n, tanh = model.createData(), world.dof, np.tanh(qd / COULOMB_VELOCITY)
    found = {"friction": np.concatenate([on_joint(q.shape, j, qd[:, j], tanh[:, j]) for j in range(n)], axis=2)}
    if world.pair == "spring":
        angle = q[:, 1]
        found["spring"] = on_joint(q.shape, 1, angle, np.ones_like(angle))
        found["potential"] = on_joint(q.shape, 1, np.sin(angle), np.cos(angle))
        units = {"spring": on_joint(q.shape, 1, angle - world.start[1]), "potential": on_joint(q.shape, 1, np.sin(angle))}
        return found, units
    rows = np.array([pin.computeJointTorqueRegressor(model, data, *state) for state in zip(q, qd, qdd, strict=True)])
    units = {cause: rows[:, :, 10 * (joint - 1) : 10 * joint] @ body(world.model, cause, 1.0).toDynamicParameters()[:, None]
             for cause, joint in (("payload", n), ("density", n - 1))}  # fmt: skip
    found |= {"payload": rows[:, :, -10:], "density": units["density"]}
    nominal = rows @ np.concatenate([own.toDynamicParameters() for own in list(model.inertias)[1:]])
    found["gain"] = units["gain"] = nominal[:, :, None]
    return found, units


def error_of(world, motion):
    """Standard error of the size of the cause that a motion gives."""
    missed = world.missed(motion[2])
    motion = [x[::THIN] for x in motion]
    found, units = columns(world, motion)
    flat = lambda part: part.reshape(-1, part.shape[2]) * (THIN**0.5 / NOISE)
    other = next(name for name in world.causes if name != world.cause)
    x, u = np.hstack([flat(found["friction"]), flat(found[other])]), flat(units[world.cause])[:, 0]
    x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-12)
    basis, values, _ = np.linalg.svd(x, full_matrices=False)
    basis = basis[:, values > COLLINEAR * values[0]]
    rest = u - basis @ (basis.T @ u)
    square = float(rest @ rest)
    if missed is None:
        return square**-0.5
    r = flat(missed[::THIN, :, None])[:, 0]
    products = (rest * (r - basis @ (basis.T @ r))).reshape(len(motion[0]), -1).sum(axis=1)
    sums = np.bincount(np.floor(motion[0] / BLOCK).astype(int), products)
    return float((square + sums @ sums) ** 0.5 / square)


def standard_error(world):
    """Median standard error of the size over random motions."""
    return float(np.median([error_of(world, world.random(number)) for number in MOTIONS]))

"""A calibration in the schema of ArviZ."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twincal._arrays import floats, states, whole

if TYPE_CHECKING:
    import xarray

    from twincal._calibration import Calibration


def datatree(
    calibration: Calibration, log: tuple[Any, ...] | None, size: tuple[int, int], seed: int
) -> xarray.DataTree:
    """See `Calibration.to_datatree`."""
    import xarray

    chains, draws = (whole(name, own) for name, own in zip(("chains", "draws"), size, strict=True))
    size = (chains, draws)
    drawn = calibration.draws(chains * draws, seed=seed)
    components, belongs = calibration._calibration.components
    of = np.asarray(belongs, dtype=np.intp)
    included = np.stack(
        [drawn.included[:, of == index].any(axis=1) for index in range(len(components))], axis=1
    )
    coords: dict[str, Any] = {"chain": np.arange(chains), "draw": np.arange(draws)}
    shape = (chains, draws, -1)
    posterior = xarray.Dataset(
        {
            "beta": (("chain", "draw", "term"), drawn.coefficients.reshape(shape)),
            "included": (
                ("chain", "draw", "component"),
                included.reshape(shape).astype(np.float64),
            ),
            "noise": (("chain", "draw"), drawn.noise.reshape(chains, draws)),
        },
        {**coords, "term": drawn.terms, "component": components},
    )
    size_of_model = included.sum(axis=1).reshape(chains, draws)
    groups = {
        "posterior": posterior,
        "sample_stats": xarray.Dataset(
            {"model_size": (("chain", "draw"), size_of_model)}, coords
        ),
        "constant_data": xarray.Dataset(
            {"family": (("component",), calibration._calibration.families)},
            {"component": components, "joint": calibration.joint_names},
        ),
    }
    if log is not None:
        groups.update(_predictive(calibration, log, size, seed))
    return xarray.DataTree.from_dict(groups)


def _predictive(
    calibration: Calibration, log: tuple[Any, ...], size: tuple[int, int], seed: int
) -> dict[str, xarray.Dataset]:
    """Drawn and measured torque of the states of a log."""
    import xarray

    if len(log) != 5:
        raise ValueError(f"log has {len(log)} arrays; give time, q, qd, qdd, tau")
    time, q, qd, qdd, tau = log
    chains, draws = size
    joints = calibration.joint_names
    shape, arrays = states(len(joints), q, qd, qdd)
    stamps, measured = floats("time", time), floats("tau", tau)
    if len(shape) != 2 or measured.shape != shape or stamps.shape != shape[:1]:
        raise ValueError(f"give time of shape (N,) and arrays of shape (N, {len(joints)})")
    torque = calibration._calibration.predictive(arrays, chains * draws, seed)
    coords = {"time": stamps, "joint": joints}
    predicted = xarray.Dataset(
        {"tau": (("chain", "draw", "time", "joint"), torque.reshape(chains, draws, *shape))},
        {"chain": np.arange(chains), "draw": np.arange(draws), **coords},
    )
    observed = xarray.Dataset({"tau": (("time", "joint"), measured)}, coords)
    return {"posterior_predictive": predicted, "observed_data": observed}

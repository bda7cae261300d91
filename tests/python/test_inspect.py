"""What `inspect` says about parameters and logs, against ranks that NumPy finds in Pinocchio's regressor."""

import json
import sys

import numpy as np
import pytest

from conftest import ROOT, twincal

sys.path.insert(0, str(ROOT / "studies" / "industrial_arms"))
pin = pytest.importorskip("pinocchio")
import simulate_arms  # noqa: E402

STILL = 3  # index of the joint that stands still


def regressor(model, q, qd, qdd, joints):
    """Pinocchio's joint-torque regressor, the rows of some joints at all states."""
    data = model.createData()
    point = lambda k: pin.integrate(model, pin.neutral(model), q[k])
    rows = [pin.computeJointTorqueRegressor(model, data, point(k), qd[k], qdd[k])[joints] for k in range(len(q))]
    return np.vstack(rows)


def rank(matrix):
    """Rank of a matrix whose columns are brought to length 1."""
    length = np.linalg.norm(matrix, axis=0)
    singular = np.linalg.svd(matrix[:, length > 1e-9 * length.max()] / length[length > 1e-9 * length.max()], compute_uv=False)
    return int((singular > 1e-7 * singular[0]).sum())


@pytest.mark.parametrize("name", ["ur5", "panda", "xarm7"])
def test_ranks_and_the_joint_to_move(name, tmp_path):
    model = simulate_arms.load(name)
    n = model.nv
    rng = np.random.default_rng(3)
    random = [scale * rng.uniform(-1, 1, (200, n)) for scale in (np.pi, 2.0, 5.0)]
    every = rank(regressor(model, *random, list(range(n))))

    t, q, qd, qdd = simulate_arms.motion(rng, n, 20000)
    config = tmp_path / "twincal.toml"
    names = [model.names[j + 1] for j in range(n)]
    locked = ", ".join(f'"{joint}" = 0.0' for joint in simulate_arms.ROBOTS[name].locked)
    config.write_text(f"[model]\nlocked = {{ {locked} }}\n[signal]\ncutoff_hz = 0\n"
                      '[library]\nfamilies = ["mass_moments", "tensor", "viscous", "coulomb"]\ngeneric = false\n')
    for still in (False, True):
        if still:
            q[:, STILL], qd[:, STILL], qdd[:, STILL] = 0.4, 0.0, 0.0
        columns = {"t": t[::20]}
        for j in range(n):
            columns |= {f"q{j + 1}": q[::20, j], f"qd{j + 1}": qd[::20, j], f"qdd{j + 1}": qdd[::20, j]}
            columns[f"tau{j + 1}"] = rng.normal(size=len(t[::20]))
        simulate_arms.write(tmp_path / "run.csv", columns)
        done = twincal("inspect", simulate_arms.model_file(name), tmp_path / "run.csv", "--config", config, "--json")
        told = json.loads(done.stdout)
        assert told["base_parameters"]["count"] == every
        # viscous and Coulomb friction of every joint are directions of their own
        assert told["directions"][0] == every + 2 * n
        moving = [j for j in range(n) if not (still and j == STILL)]
        # with the filter off every row counts, also those of the joint that stands still
        shown = rank(regressor(model, q[::40], qd[::40], qdd[::40], list(range(n)))) + 2 * len(moving)
        if not still:
            assert told["unseen"] == [] and told["directions"][1] == shown == every + 2 * n
            continue
        # NumPy counts what is not zero, twincal what is a hundredth of ordinary motion
        assert told["directions"][1] <= shown < every + 2 * n
        assert told["unseen"][0]["joint"] == names[STILL]
        assert {f"{names[STILL]}.viscous", f"{names[STILL]}.coulomb"} <= set(told["unseen"][0]["nothing_of"])
        for component in told["components"]:
            if component["family"] in ("viscous", "coulomb"):
                expected = "not_at_all" if component["name"].startswith(names[STILL] + ".") else "fully"
                assert component["seen"] == expected, component

"""A two-link arm with more mass than its model says, simulated by Pinocchio; the program beside the package."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("TWINCAL_PROGRAM", ROOT / "target/release/twincal"))

LINK = """
  <link name="{name}"><inertial><origin xyz="{com} 0 0"/><mass value="{mass}"/>
    <inertia ixx="0.002" iyy="{i}" izz="{i}" ixy="0.0005" ixz="0.001" iyz="0.0003"/></inertial></link>"""


def urdf(mass: float) -> str:
    """An arm of two links whose second one weighs so many kg."""
    return (
        '<robot name="two_link"><link name="base"/>'
        + LINK.format(name="upper", com=0.2, mass=2.0, i=0.03)
        + LINK.format(name="fore", com=0.15, mass=mass, i=0.015)
        + """
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit effort="99" velocity="9" lower="-3" upper="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit effort="99" velocity="9" lower="-3" upper="3"/></joint></robot>"""
    )


def motion(phase: float, rows: int = 4000) -> tuple[np.ndarray, ...]:
    """Time and a sum of sines with its exact derivatives: rad, rad/s, rad/s²."""
    time = 0.005 * np.arange(rows)
    q = np.zeros((rows, 2))
    qd, qdd = q.copy(), q.copy()
    for joint, (base, lead) in enumerate([(1.1, phase), (1.7, 2.0 * phase + 0.4)]):
        for k, size in enumerate([0.5, 0.3, 0.15], start=1):
            w = base * k * (1.0 + 0.07 * k)
            angle = w * time + lead * k
            q[:, joint] += size * np.sin(angle)
            qd[:, joint] += size * w * np.cos(angle)
            qdd[:, joint] -= size * w * w * np.sin(angle)
    return time, q, qd, qdd


def torque(mass: float, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Inverse dynamics by Pinocchio, N·m."""
    import pinocchio

    model = pinocchio.buildModelFromXML(urdf(mass))
    data = model.createData()
    return np.array([pinocchio.rnea(model, data, *state) for state in zip(q, qd, qdd)])


class Arm:
    """Files and arrays of the arm; the real one carries 0.5 kg more and has viscous friction."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.model = folder / "arm.urdf"
        self.model.write_text(urdf(1.0))
        self.runs = {}
        random = np.random.default_rng(5)
        for name, phase in [("run1", 0.3), ("run2", 1.1), ("run3", 2.0)]:
            time, q, qd, qdd = motion(phase)
            tau = torque(1.5, q, qd, qdd) + 0.4 * qd
            tau += 0.02 * random.standard_normal(tau.shape)
            self.runs[name] = (time, q, qd, qdd, tau)
            columns = [time, *q.T, *qd.T, *qdd.T, *tau.T]
            header = "t,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2"
            np.savetxt(
                folder / f"{name}.csv",
                np.column_stack(columns),
                delimiter=",",
                header=header,
                comments="",
                fmt="%.17g",
            )

    def log(self, name: str):
        """A run as a log of arrays."""
        import twincal

        time, q, qd, qdd, tau = self.runs[name]
        return twincal.Log(time, q, tau, qd, qdd, name=name)


def run(*arguments: object, **more) -> subprocess.CompletedProcess:
    """The program."""
    return subprocess.run(
        [str(PROGRAM), *map(str, arguments)], capture_output=True, timeout=300, **more
    )


@pytest.fixture(scope="session")
def arm(tmp_path_factory) -> Arm:
    return Arm(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="session")
def robot(arm):
    import twincal

    return twincal.Robot.from_urdf(arm.model)


SETTINGS = {"families": ["payload", "viscous", "coulomb"], "generic": False}


@pytest.fixture(scope="session")
def result(arm, robot):
    """A fit of two logs, judged by the third."""
    import twincal

    logs = [twincal.Log.read(arm.folder / f"{name}.csv") for name in ("run1", "run2")]
    heldout = twincal.Log.read(arm.folder / "run3.csv")
    return twincal.fit(robot, logs, heldout=heldout, **SETTINGS)


def python(code: str, *arguments: object, **more) -> subprocess.CompletedProcess:
    """A process of Python of its own."""
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
        **more,
    )

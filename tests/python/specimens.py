"""Twins for tests of what people see: each function fits one into a folder and returns its page; `printed.txt` is what `fit` printed, `logs.txt`
the paths of its logs."""

import subprocess

import numpy as np
import pytest
from conftest import ASSETS, ROOT, SHARED, program, twincal

ATTACK = "</script><img src=x onerror=alert(1)>"


def demo(folder):
    done = subprocess.run([program("twincal"), "demo"], cwd=folder, capture_output=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr
    return folder / "twincal-demo" / "report.html"


def fitted(folder, model, logs, *arguments):
    done = twincal("fit", *logs, "--model", model, "-o", folder / "out", *arguments, expect=None)
    (folder / "printed.txt").write_text(done.stdout)
    (folder / "logs.txt").write_text("\n".join(map(str, logs)))
    return folder / "out" / "report.html"


def double_pendulum(folder):
    data = SHARED / "double_pendulum"
    if not data.is_dir():
        pytest.skip("../shared/data/double_pendulum is not there")
    run = [data / f"run{number}.csv" for number in range(8)]
    config = ROOT / "examples" / "double_pendulum" / "twincal.toml"
    return fitted(folder, data / "model_as_published.urdf", run[2:], "--config", config, "--heldout", *run[:2])


def last_third(folder):
    """One log, tested on its own end."""
    return fitted(folder, ASSETS / "arm.urdf", [ASSETS / "train1.parquet"], "--no-config")


def hostile(folder):
    """Joints and a log whose names are markup. A file's name has no slash."""
    name = ATTACK.replace("<", "&lt;").replace(">", "&gt;")
    model = (ASSETS / "arm.urdf").read_text().replace('"shoulder"', f'"{name}"').replace('"elbow"', f'"{name}2"')
    (folder / "arm.urdf").write_text(model)
    log = folder / (ATTACK.replace("/", "") + ".parquet")
    log.write_bytes((ASSETS / "heldout1.parquet").read_bytes())
    return fitted(folder, folder / "arm.urdf", [ASSETS / "train1.parquet"], "--no-config", "--heldout", log)


def many_joints(folder, joints=44):
    """A right model of many joints about vertical axes, each with one link on the base: nothing is found."""
    link = (
        '<link name="l{0}"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
        '<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>'
        '<joint name="axis_{0}_of_the_arm" type="continuous"><parent link="base"/><child link="l{0}"/>'
        '<origin xyz="{0} 0 0"/><axis xyz="0 0 1"/></joint>'
    )
    links = "".join(link.format(joint) for joint in range(joints))
    (folder / "robot.urdf").write_text(f'<robot name="many"><link name="base"/>{links}</robot>')
    (folder / "twincal.toml").write_text('[library]\nfamilies = ["viscous"]\n')
    t, rng = np.arange(0, 20, 0.02), np.random.default_rng(1)
    speed = rng.uniform(1, 3, (joints, 1))
    q, qd, qdd = np.sin(speed * t), speed * np.cos(speed * t), -(speed**2) * np.sin(speed * t)
    torque = (0.05 + 0.1**2) * qdd + rng.normal(0, 0.05, q.shape)
    names = [f"{kind}{joint + 1}" for kind in ("q", "qd", "qdd", "tau") for joint in range(joints)]
    table = np.vstack([t, q, qd, qdd, torque]).T
    np.savetxt(folder / "run.csv", table, "%.6g", ",", header=",".join(["t", *names]), comments="")
    return fitted(folder, folder / "robot.urdf", [folder / "run.csv"], "--config", folder / "twincal.toml")


def real(folder, robot, model="model.urdf", fitted_logs=slice(None)):
    """A robot of `../shared/data`, its logs or some of them, tested on parts of them."""
    data = SHARED / robot
    if not data.is_dir():
        pytest.skip(f"../shared/data/{robot} is not there")
    logs = sorted(path for path in data.iterdir() if path.name.startswith("run"))[fitted_logs]
    return fitted(folder, data / model, logs, "--no-config")


def simple_pendulum(folder):
    return real(folder, "simple_pendulum")


def ur10(folder):
    return real(folder, "ur10")


def staubli_tx40(folder):
    return real(folder, "staubli_tx40")


def kuka_kr300(folder):
    return real(folder, "kuka_kr300")

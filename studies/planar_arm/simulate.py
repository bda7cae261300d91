"""The paper's study: logs of a planar arm from MuJoCo, and the exact coefficient of every candidate.

    python simulate.py                      writes the demo's files anew: logs and truth.json
    python simulate.py --help               noise, friction, rates, encoder-only logs; -o chooses another folder

MuJoCo integrates the real arm under a tracking controller. What the real arm has beyond rigid bodies, a hidden
conservative correction phi and friction f, enters through `qfrc_applied`. D(phi) holds the acceleration, so at every
Runge-Kutta stage the accelerations are solved for first:

    (M + H) qdd = tau - bias - c - f,   D(phi) = H qdd + c,   qfrc_applied = -(H qdd + c + f)

and every recorded (q, qd, qdd, tau) satisfies M qdd + bias + D(phi) + f = tau to rounding.
"""

import argparse
import json
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from math import exp, pi, tanh
from pathlib import Path

import mujoco
import numpy as np

import candidates
from arm import ASSETS, GENERIC, JOINTS, NOMINAL, REAL, Arm, coefficients, mujoco_model

STEP = 1e-3  # integration step of MuJoCo's RK4, s
STIFFNESS = (300.0, 60.0)  # tracking controller, N m/rad
DAMPING = (40.0, 6.0)  # N m s/rad
CENTRE = (-0.4, 0.3)  # middle of the motion, rad
LIMITS = (1.5, 3.5, 15.0)  # of the excitation: rad from the centre, rad/s, rad/s^2


@dataclass(frozen=True)
class Settings:
    """One study. Torques in N m, times in s; two numbers are those of shoulder and elbow."""

    rate_hz: float = 100.0
    duration: float = 20.0
    train: int = 3
    heldout: int = 2
    noise_sd: float = 0.1
    noise_time: float = 0.0  # 0: white; else the time constant of an AR(1) process with sd `noise_sd`
    viscous: tuple[float, float] = (0.4, 0.25)
    coulomb: tuple[float, float] = (0.6, 0.35)
    coulomb_velocity: float = 0.02  # f = F tanh(qd / v_s); 0: F sign(qd)
    encoder_sd: float = 0.0  # > 0: the log holds only q, with white noise of this sd (rad), and the torque
    harmonics: int = 5
    base_hz: float = 0.1
    seed: int = 1
    real: Arm = REAL
    hidden: dict = field(default_factory=lambda: {"cos(q2)": 0.8, "qd2^2*cos(q2)": 0.03})

    @property
    def stride(self):
        """Integration steps per logged sample."""
        stride = round(1.0 / (self.rate_hz * STEP))
        if stride < 1 or abs(stride * STEP * self.rate_hz - 1.0) > 1e-9:
            raise ValueError(f"rate {self.rate_hz} Hz does not divide {1 / STEP:.0f} Hz; use 1000, 500, 250, 200, 125, 100 ...")
        return stride


@dataclass(frozen=True)
class Log:
    """One trajectory; arrays N x 2. `tau = clean + noise` is what is written, and `q_logged` where encoders are noisy."""

    name: str
    role: str
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    clean: np.ndarray
    noise: np.ndarray
    q_logged: np.ndarray
    encoder_only: bool

    @property
    def tau(self):
        """Measured torque."""
        return self.clean + self.noise

    def columns(self):
        """The log as it is written, name to values."""
        motion = (("q", self.q_logged),) if self.encoder_only else (("q", self.q), ("qd", self.qd), ("qdd", self.qdd))
        out = {"t": self.t}
        for name, values in motion + (("tau", self.tau),):
            out |= {f"{name}{j + 1}": values[:, j] for j in range(2)}
        return out


@dataclass(frozen=True)
class Study:
    """What `simulate` returns."""

    settings: Settings
    logs: list[Log]
    truth: dict


def excitation(settings, role, index):
    """Reference motion of one trajectory at every half integration step: lists of q, qd, qdd tuples.

    q_i(t) = centre_i + sum_k (a_k sin(k w t) - b_k cos(k w t)) / (k w), scaled to reach the first of LIMITS it meets.
    """
    rng = np.random.default_rng([settings.seed, 1 if role == "heldout" else 0, index, 0])
    t = np.arange(2 * round(settings.duration / STEP) + 2) * (STEP / 2)
    tables = []
    for joint in range(2):
        a, b = rng.standard_normal((2, settings.harmonics))
        q, qd, qdd = np.zeros((3, len(t)))
        for k in range(settings.harmonics):
            w = 2 * pi * settings.base_hz * (k + 1)
            s, c = np.sin(w * t), np.cos(w * t)
            q += (a[k] * s - b[k] * c) / w
            qd += a[k] * c + b[k] * s
            qdd += w * (b[k] * c - a[k] * s)
        q -= (q.max() + q.min()) / 2
        scale = min(limit / np.abs(x).max() for limit, x in zip(LIMITS, (q, qd, qdd)))
        tables.append(np.stack([CENTRE[joint] + scale * q, scale * qd, scale * qdd], axis=1))
    return np.concatenate(tables, axis=1)


class _Plant:
    """Controller, hidden correction and friction, as MuJoCo's control callback."""

    def __init__(self, settings, reference):
        self.rows = reference.tolist()
        self.nominal = candidates.mass_and_bias(coefficients(NOMINAL))
        self.hidden = candidates.mass_and_bias(settings.hidden)
        self.settings = settings
        self.mass = np.zeros((2, 2))

    def friction(self, joint, speed):
        s = self.settings
        coulomb = tanh(speed / s.coulomb_velocity) if s.coulomb_velocity > 0 else (speed > 0) - (speed < 0)
        return s.viscous[joint] * speed + s.coulomb[joint] * coulomb

    def __call__(self, model, data):
        r1, rd1, rdd1, r2, rd2, rdd2 = self.rows[round(data.time / (STEP / 2))]
        (q1, q2), (w1, w2) = data.qpos.tolist(), data.qvel.tolist()
        n11, n12, n22, nc1, nc2 = self.nominal(r1, r2, rd1, rd2)
        tau1 = n11 * rdd1 + n12 * rdd2 + nc1 + STIFFNESS[0] * (r1 - q1) + DAMPING[0] * (rd1 - w1)
        tau2 = n12 * rdd1 + n22 * rdd2 + nc2 + STIFFNESS[1] * (r2 - q2) + DAMPING[1] * (rd2 - w2)
        h11, h12, h22, c1, c2 = self.hidden(q1, q2, w1, w2)
        c1 += self.friction(0, w1)
        c2 += self.friction(1, w2)
        mujoco.mj_fullM(model, data, self.mass)
        (m11, m12), (_, m22) = self.mass.tolist()
        b1, b2 = data.qfrc_bias.tolist()
        # (M + H) a = tau - bias - c - f
        s11, s12, s22, y1, y2 = m11 + h11, m12 + h12, m22 + h22, tau1 - b1 - c1, tau2 - b2 - c2
        det = s11 * s22 - s12 * s12
        a1, a2 = (s22 * y1 - s12 * y2) / det, (s11 * y2 - s12 * y1) / det
        data.ctrl[:] = tau1, tau2
        data.qfrc_applied[:] = -(h11 * a1 + h12 * a2 + c1), -(h12 * a1 + h22 * a2 + c2)


class _MotionKey:
    """Settings as a cache key: equal when everything they hold is (the hidden terms are a dict)."""

    def __init__(self, settings):
        self.settings, self.text = settings, repr(settings)

    def __hash__(self):
        return hash(self.text)

    def __eq__(self, other):
        return self.text == other.text


@lru_cache(maxsize=64)
def _motion(key, role, index):
    """Integrates one trajectory and records time, motion and actuator torque at the log's rate."""
    settings = key.settings
    model = mujoco_model(settings.real)
    reference = excitation(settings, role, index)
    rows = int(round(settings.duration * settings.rate_hz))
    t, (q, qd, qdd, tau) = np.arange(rows) / settings.rate_hz, np.empty((4, rows, 2))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = reference[0, [0, 3]], reference[0, [1, 4]]
    mujoco.set_mjcb_control(_Plant(settings, reference))
    try:
        for row in range(rows):
            mujoco.mj_forward(model, data)
            q[row], qd[row], qdd[row], tau[row] = data.qpos, data.qvel, data.qacc, data.qfrc_actuator
            mujoco.mj_step(model, data, settings.stride)
    finally:
        mujoco.set_mjcb_control(None)
    return t, q, qd, qdd, tau


def _run(settings, role, index):
    """One log: the motion, which is kept for worlds that differ in noise only, and the noise."""
    silent = replace(settings, noise_sd=0.0, noise_time=0.0, encoder_sd=0.0)
    t, q, qd, qdd, tau = _motion(_MotionKey(silent), role, index)
    rng = np.random.default_rng([settings.seed, 1 if role == "heldout" else 0, index, 1])
    noise = _noise(settings, rng, len(t))
    q_logged = q + settings.encoder_sd * rng.standard_normal(q.shape) if settings.encoder_sd > 0 else q
    return Log(f"{role}{index + 1}", role, t, q, qd, qdd, tau, noise, q_logged, settings.encoder_sd > 0)


def _noise(settings, rng, rows):
    """White or stationary AR(1) torque noise, rows x 2."""
    noise = settings.noise_sd * rng.standard_normal((rows, 2))
    if settings.noise_time > 0:
        rho = exp(-1.0 / (settings.rate_hz * settings.noise_time))
        for row in range(1, rows):
            noise[row] = rho * noise[row - 1] + np.sqrt(1 - rho * rho) * noise[row]
    return noise


def truth(settings):
    """Exact coefficient of every candidate: real minus nominal parameters, plus the hidden correction, plus friction.

    `terms` holds the library without motor inertia. With it, `qd1^2` and `qd2^2` are the same columns as the motor
    inertias up to a factor 2 (D(qd^2) = 2 qdd): `motor_inertia` holds what those coefficients are then.
    """
    real, nominal = coefficients(settings.real), coefficients(NOMINAL)
    terms = {name: real[name] - nominal[name] for name in GENERIC}
    for name, beta in settings.hidden.items():
        terms[name] = terms.get(name, 0.0) + beta
    for kind, values in (("viscous", settings.viscous), ("coulomb", settings.coulomb), ("offset", (0.0, 0.0))):
        terms |= {f"{joint}.{kind}": value for joint, value in zip(JOINTS, values)}
    motor = {f"{joint}.motor_inertia": 2 * terms[f"qd{j + 1}^2"] for j, joint in enumerate(JOINTS)}
    return {"joints": list(JOINTS), "terms": terms, "motor_inertia": motor, "coulomb_velocity": settings.coulomb_velocity}


def simulate(settings=None, **changes):
    """Runs the study; `simulate(noise_time=0.02, rate_hz=1000)` changes the default `Settings`."""
    settings = replace(settings or Settings(), **changes)
    runs = [("train", i) for i in range(settings.train)] + [("heldout", i) for i in range(settings.heldout)]
    logs = [_run(settings, role, index) for role, index in runs]
    return Study(settings, logs, truth(settings))


def write(study, folder, form="parquet"):
    """Writes the logs (`parquet` or `csv`) and truth.json; returns the logs' paths by name."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = {}
    for log in study.logs:
        paths[log.name] = path = folder / f"{log.name}.{form}"
        columns = log.columns()
        if form == "parquet":
            import pyarrow
            import pyarrow.parquet

            pyarrow.parquet.write_table(
                pyarrow.table(columns), path, compression="zstd", compression_level=19, use_dictionary=False,
                column_encoding=dict.fromkeys(columns, "BYTE_STREAM_SPLIT"),
            )
        else:
            np.savetxt(path, np.stack(list(columns.values()), 1), "%.17g", ",", header=",".join(columns), comments="")
    made = {"made_by": "studies/planar_arm/simulate.py", "mujoco": mujoco.__version__, "numpy": np.__version__}
    made["settings"] = asdict(study.settings)
    (folder / "truth.json").write_text(json.dumps(study.truth | made, indent=1) + "\n")
    return paths


def main():
    """Command line: every option is a field of `Settings`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", default=str(ASSETS), help="folder (default: the demo's assets)")
    parser.add_argument("--form", choices=("parquet", "csv"), default="parquet")
    defaults = Settings()
    for name in ("rate_hz", "duration", "train", "heldout", "noise_sd", "noise_time", "viscous", "coulomb",
                 "coulomb_velocity", "encoder_sd", "harmonics", "base_hz", "seed"):  # fmt: skip
        value = getattr(defaults, name)
        pair = {"nargs": 2, "type": float} if isinstance(value, tuple) else {"type": type(value)}
        parser.add_argument("--" + name.replace("_", "-"), default=value, help=f"default {value}", **pair)
    options = vars(parser.parse_args())
    folder, form = options.pop("output"), options.pop("form")
    options |= {name: tuple(options[name]) for name in ("viscous", "coulomb")}
    for name, path in write(simulate(**options), folder, form).items():
        print(f"{name}: {path}")


if __name__ == "__main__":
    main()

"""The problems: what spoils the data, and which candidates the methods are given."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

# Every arm that problems are simulated on: studies/planar_arm (MuJoCo) and the UR5 of studies/industrial_arms (Pinocchio).
PLANAR, UR5 = "planar", "ur5"


@dataclass(frozen=True)
class Problem:
    """One row of the table; torques in N m."""

    name: str
    words: str
    noise_time: float = 0.0  # s; 0: white
    noise_sd: float = 0.1
    sine: tuple = (0.0, 0.0)  # amplitude, Hz
    encoder: float = 0.0  # rad; > 0: only positions and torque are logged
    friction: bool = True  # friction is among the candidates
    stribeck: float = 0.0  # more torque at breakaway, of Coulomb friction
    poor: bool = False  # motion that makes columns alike
    weak: bool = False  # another truth for every seed: effects of 4 to 40 standard errors
    arm: str = PLANAR


_PLANAR = [
    Problem("white", "white torque noise"),
    Problem("ar1_20ms", "AR(1) torque noise, 20 ms", noise_time=0.02),
    Problem("ar1_100ms", "AR(1) torque noise, 100 ms", noise_time=0.1),
    Problem("periodic", "white, and an unknown torque of 0.1 N·m at 2 Hz", sine=(0.1, 2.0)),
    Problem("encoder_1e-5", "only positions logged, noise 1e-5 rad", encoder=1e-5),
    Problem("encoder_1e-4", "only positions logged, noise 1e-4 rad", encoder=1e-4),
    Problem("friction", "friction that no candidate describes", friction=False),
    Problem("stribeck", "Stribeck friction, candidates have none", stribeck=0.3),
    Problem("weak", "white, effects of 4–40 standard errors", weak=True),
    Problem("weak_ar1", "AR(1) 100 ms, effects of 4–40 standard errors", noise_time=0.1, weak=True),
    Problem("correlated", "poor motion: columns correlate", poor=True),
]
_UR5 = [replace(p, name=f"ur5_{p.name}", words=f"UR5: {p.words}", arm=UR5) for p in _PLANAR if not (p.weak or p.stribeck)]
PROBLEMS = {problem.name: problem for problem in _PLANAR + _UR5}  # their order seeds their noise


def noise(rng, shape, rate, problem):
    """Torque noise of one log, samples x joints at `rate` Hz: what no candidate can explain, friction apart."""
    out = problem.noise_sd * rng.standard_normal(shape)
    if problem.noise_time > 0:
        rho = np.exp(-1 / (rate * problem.noise_time))
        out[1:] *= np.sqrt(1 - rho**2)
        out = lfilter([1.0], [1.0, -rho], out, axis=0)
    amplitude, frequency = problem.sine
    phase = rng.uniform(0, 2 * np.pi, shape[1])
    return out + amplitude * np.sin(2 * np.pi * frequency * np.arange(shape[0])[:, None] / rate + phase)

"""Sampled noise through the program: true noise inside its interval, the same effects as with plug-in noise, refusals."""

from conftest import ASSETS, fit, twincal

LOGS = [ASSETS / f"train{number}.parquet" for number in (1, 2, 3)]
# The real arm's friction is F·tanh(q̇/0.02).
LIBRARY = '[library]\ngeneric = true\nfamilies = ["viscous", "coulomb"]\ncoulomb_velocity = 0.02\n[inference]\ndraws = 2000\n'
# studies/planar_arm/README.md: the torque sensor's white noise, N·m.
SENSOR = 0.1


def both(folder, config):
    """result.json with plug-in noise and with sampled noise."""
    plain = fit(folder / "plain", LOGS, config)
    return plain, fit(folder / "sampled", LOGS, config + 'uncertainty = "sampled"\n')


def agree(plain, sampled):
    """Two answers about the same rows: one knows the noise, the other draws it. 3000 rows know it to a few per cent."""
    found = 0
    for a, b in zip(plain["terms"], sampled["terms"], strict=True):
        assert a["name"] == b["name"] and (a["pip"] is None) == (b["pip"] is None)
        if a["pip"] is None:
            continue
        assert abs(a["pip"] - b["pip"]) < 0.05, (a, b)
        if a["pip"] > 0.99:
            found += 1
            assert abs(a["mean"] - b["mean"]) < 0.2 * a["sd"], (a, b)
            assert 0.85 < b["sd"] / a["sd"] < 1.25, (a, b)
            assert 0.85 < (b["interval95"][1] - b["interval95"][0]) / (a["interval95"][1] - a["interval95"][0]) < 1.25
    assert found >= 6


def test_the_true_noise_lies_in_its_interval(tmp_path):
    # Every row as logged. Each interval misses the truth with probability 0.05; four sds of it are allowed: 6e-5.
    plain, sampled = both(tmp_path, f'{LIBRARY}[signal]\ncutoff_hz = 0\n[noise]\nmodel = "iid"\n')
    agree(plain, sampled)
    for joint in sampled["noise"]:
        low, high = joint["sampled"]["sigma95"]
        assert low < joint["sigma"] < high
        middle, sd = 0.5 * (low + high), (high - low) / 3.92
        assert abs(middle - SENSOR) < 4 * sd, joint
        # The sd of an sd from n white rows is σ/√(2n).
        assert abs(sd / (SENSOR / (2 * joint["n"]) ** 0.5) - 1) < 0.15, joint
        assert joint["sampled"]["rho95"] is None
    assert all(joint["sampled"] is None for joint in plain["noise"])


def test_autocorrelation_is_drawn_with_ar1(tmp_path):
    # Every row as logged: behind the filter the plug-in knows of the filter, what is drawn is an autoregression of the rows.
    plain, sampled = both(tmp_path, f'{LIBRARY}[signal]\ncutoff_hz = 0\n[noise]\nmodel = "ar1"\n')
    agree(plain, sampled)
    for a, b in zip(plain["noise"], sampled["noise"], strict=True):
        low, high = b["sampled"]["rho95"]
        assert low < a["rho"] < high and low < b["rho"] < high
        # The sd of ρ from n rows is √((1 − ρ²)/n).
        assert abs((high - low) / 3.92 / ((1 - b["rho"] ** 2) / b["n"]) ** 0.5 - 1) < 0.2, b


def test_a_tempered_likelihood_has_no_variance_to_draw(tmp_path):
    config = tmp_path / "twincal.toml"
    config.write_text('[noise]\nuncertainty = "sampled"\n')
    done = twincal("fit", LOGS[0], "--model", ASSETS / "arm.urdf", "--config", config, "-o", tmp_path / "out", expect=2)
    assert "noise.uncertainty" in done.stderr and "ar1" in done.stderr
    assert not (tmp_path / "out" / "result.json").exists()

"""What all Python tests share: where things are, the study's modules, and the program run as a user runs it."""

import json
import os
import subprocess
import sys
from pathlib import Path

# One thread per worker: matrices here are small, and threads of several workers wait for each other. Before NumPy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
STUDY = ROOT / "studies" / "planar_arm"
ASSETS = ROOT / "crates/twincal-cli/assets"
SHARED = ROOT.parent / "shared" / "data"
sys.path.insert(0, str(STUDY))


def pytest_configure(config):
    config.addinivalue_line("markers", "long: takes half a minute and more; runs in `./check --full`")


def program(name):
    """A built program; `TWINCAL_BIN_DIR` overrides `target/release`."""
    folder = Path(os.environ.get("TWINCAL_BIN_DIR", ROOT / "target" / "release"))
    path = folder / name
    assert path.exists(), f"{path} is not built; run cargo build --release --workspace --bins --examples"
    return str(path)


def twincal(*arguments, expect=0):
    """Runs `twincal` and checks its exit code (`None`, and 0 of a fit: 0 or 3, degraded data or no "yes"); returns the finished process."""
    command = [program("twincal"), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    either = expect is None or (expect == 0 and arguments[0] == "fit")
    assert done.returncode in ((0, 3) if either else (expect,)), f"{' '.join(command)}\nexit {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done


def fit(folder, logs, config, *arguments, model=ASSETS / "arm.urdf", expect=None):
    """`twincal fit` with a twincal.toml of this text; returns result.json."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "twincal.toml").write_text(config)
    out = folder / "out"
    done = twincal("fit", *logs, "--model", model, "--config", folder / "twincal.toml", "-o", out, "--force", *arguments,
                   expect=expect)  # fmt: skip
    result = json.loads((out / "result.json").read_text())
    lost = any(finding["severity"] == "degraded" for finding in result["findings"])
    usable = result["assessment"]["answer"] in ("yes", "yes_within_limits")
    assert done.returncode == (0 if usable and not lost else 3), (result["assessment"]["reason"], done.returncode)
    return result


@pytest.fixture(scope="session")
def carried():
    """The carried truth.json."""
    return json.loads((ASSETS / "truth.json").read_text())


@pytest.fixture(scope="session")
def study():
    """The demo's study, simulated anew."""
    import simulate

    return simulate.simulate()

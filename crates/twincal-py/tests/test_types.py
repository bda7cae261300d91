"""Types: mypy --strict of the package, stubtest of the extension, docstrings of everything public."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import twincal

FOLDER = Path(twincal.__file__).parent


def test_mypy_is_strict(tmp_path):
    pytest.importorskip("mypy")
    config = tmp_path / "mypy.ini"
    config.write_text(
        "[mypy]\nstrict = True\n"
        + "".join(
            f"[mypy-{name}.*]\nignore_missing_imports = True\nfollow_imports = skip\n"
            for name in ("sklearn", "pandas", "polars", "xarray", "matplotlib", "tqdm", "arviz")
            + ("fsspec", "pyarrow", "ray")
        )
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", config, "-p", "twincal"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout


def test_stubs_are_those_of_the_extension(tmp_path):
    pytest.importorskip("mypy")
    allow = tmp_path / "allow"
    allow.write_text("twincal\\._twincal\\.__all__\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "twincal._twincal", "--allowlist", allow]
        + ["--ignore-unused-allowlist", "--ignore-disjoint-bases"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=300,
        env={**os.environ},
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_py_typed_is_there():
    assert (FOLDER / "py.typed").exists()


def test_everything_public_has_a_docstring():
    missing = []
    for name in twincal.__all__:
        own = getattr(twincal, name)
        if not inspect.getdoc(own):
            missing.append(name)
        if inspect.isclass(own):
            for key, member in vars(own).items():
                public = not key.startswith("_") and (callable(member) or isinstance(member, property))
                if public and not inspect.getdoc(getattr(own, key)):
                    missing.append(f"{name}.{key}")
    assert not missing


def functions():
    """Public functions and methods of the package by name, `plot` and `fleet` included."""
    for name in twincal.__all__:
        own = getattr(twincal, name)
        if inspect.ismodule(own):
            for key in own.__all__:
                if inspect.isfunction(getattr(own, key)):
                    yield f"{name}.{key}", getattr(own, key)
        elif inspect.isfunction(own):
            yield name, own
        elif inspect.isclass(own) and not issubclass(own, (tuple, BaseException)):
            for key in vars(own):
                member = getattr(own, key)
                if not key.startswith("_") and inspect.isroutine(member):
                    yield f"{name}.{key}", member


def test_docstrings_have_their_sections():
    """Every parameter by name, and what is returned unless it is None."""
    missing = []
    for name, own in functions():
        text, signature = inspect.getdoc(own) or "", inspect.signature(own)
        named = re.findall(r"^((?:\*{0,2}\w+)(?:, \*{0,2}\w+)*)(?: :|$)", text, flags=re.M)
        known = {key.lstrip("*") for line in named for key in line.split(", ")}
        missing += [f"{name}({key})" for key in signature.parameters if key not in known | {"self"}]
        if signature.return_annotation not in (None, "None") and "Returns\n-------" not in text:
            missing.append(f"{name} -> {signature.return_annotation}")
    assert not missing, missing


def test_classes_that_others_make_refuse_anything_else():
    for own in (twincal.Calibration, twincal.Statistics, twincal.Plan):
        with pytest.raises(TypeError, match="made by"):
            own(3)

"""Scripts find the Python of a version, also where a shim of pyenv that runs nothing stands first on PATH."""

from __future__ import annotations

import os
import subprocess
import sys

from conftest import ROOT

FIND = ROOT / "tests/python/find_python"


def test_behind_a_shim_stands_the_installed_python(tmp_path):
    shims, root = tmp_path / "shims", tmp_path / "pyenv"
    own = root / "versions/3.99.1/bin/python"
    shims.mkdir()
    own.parent.mkdir(parents=True)
    (shims / "python3.99").write_text("#!/bin/sh\nexit 127\n")
    own.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    for file in (shims / "python3.99", own):
        file.chmod(0o755)
    places = {"PATH": f"{shims}:{os.environ['PATH']}", "PYENV_ROOT": str(root)}

    def found(name: str) -> subprocess.CompletedProcess:
        return subprocess.run([FIND, name], env=os.environ | places, capture_output=True, text=True)

    for name in ("python3.99", sys.executable):
        assert os.path.samefile(found(name).stdout.strip(), sys.executable)
    none = found("python3.98")
    assert none.returncode == 1 and not none.stdout

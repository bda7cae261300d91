"""The command of the wheel is the program: the same output, the same exit codes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

import pytest
from conftest import PROGRAM

COMMAND = Path(sysconfig.get_path("scripts")) / "twincal"

CASES = [
    ["--version"],
    ["--help"],
    [],
    ["fitt"],
    ["fit"],
    ["fit", "none.csv", "--model", "arm.urdf", "--no-config"],
    ["fit", "run1.csv", "--no-config"],
    ["schema"],
    ["completions", "bash"],
    ["inspect", "arm.urdf"],
    ["check", "run1.csv", "--twin", "none", "--json"],
    ["diff", "--help"],
]


@pytest.fixture(scope="module")
def both():
    if not COMMAND.exists():
        pytest.skip("the package is not installed from a wheel")
    return PROGRAM, COMMAND


@pytest.mark.parametrize("arguments", CASES, ids=lambda own: " ".join(own) or "nothing")
def test_output_and_exit_code(both, arm, arguments):
    done = [
        subprocess.run([own, *arguments], capture_output=True, cwd=arm.folder, timeout=60)
        for own in both
    ]
    assert done[0].returncode == done[1].returncode
    assert done[0].stdout == done[1].stdout
    assert done[0].stderr == done[1].stderr


def test_ctrl_c_is_130(both, arm):
    codes = []
    for own in both:
        fit = [own, "fit", "run1.csv", "run2.csv", "run3.csv", "--model", "arm.urdf"]
        child = subprocess.Popen(
            [*fit, "--no-config", "-o", f"stopped_{own.parent.name}"],
            cwd=arm.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        child.stderr.readline()
        time.sleep(0.05)
        child.send_signal(signal.SIGINT)
        codes.append(child.wait(timeout=20))
    assert codes == [130, 130]


def test_ctrl_c_while_it_starts_prints_nothing():
    """Until the program takes Ctrl-C over it ends the process, as that of any command."""
    code = """
import os, signal, sys, types
import twincal
twincal._twincal = sys.modules["twincal._twincal"] = types.ModuleType("twincal._twincal")
twincal._twincal.command = lambda _: os.kill(os.getpid(), signal.SIGINT)
from twincal._command import main
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60)
    assert done.returncode == -signal.SIGINT and not done.stderr, done.stderr


def test_the_command_imports_next_to_nothing():
    """Until `main` runs a Ctrl-C ends in a traceback: only `signal` and the package itself are imported."""
    code = "import signal, sys; before = set(sys.modules); import twincal._command; print(*sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["__future__", "twincal", "twincal._command"], done.stderr


def test_a_reader_that_goes_away_is_no_error(both, arm):
    codes = []
    for own in both:
        read, write = os.pipe()
        os.close(read)
        child = subprocess.Popen([own, "schema"], stdout=write, stderr=subprocess.PIPE)
        os.close(write)
        codes.append((child.wait(timeout=20), child.stderr.read()))
    assert codes[0] == codes[1]


def test_the_command_is_python_s(both):
    assert sys.executable and COMMAND.read_bytes()[:2] == b"#!"

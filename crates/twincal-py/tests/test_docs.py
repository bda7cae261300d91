"""Every example of docs/python.md runs, in order, as one program."""

from __future__ import annotations

import os
import re
import shutil

import pytest
from conftest import ROOT

PAGE = ROOT / "docs/python.md"


@pytest.mark.skipif(not PAGE.exists(), reason="the documents are not beside the tests")
def test_page_runs(arm, tmp_path, monkeypatch):
    for module in ("pandas", "sklearn", "matplotlib", "xarray"):
        pytest.importorskip(module)
    import matplotlib

    matplotlib.use("Agg")
    for name in ("arm.urdf", "run1.csv", "run2.csv", "run3.csv"):
        shutil.copy(arm.folder / name, tmp_path)
    for number, robot in enumerate(["one", "two", "three"], start=1):
        (tmp_path / "robots" / robot).mkdir(parents=True)
        shutil.copy(arm.folder / f"run{number}.csv", tmp_path / "robots" / robot / "run.csv")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), flags=re.S)
    assert len(blocks) >= 8
    names: dict[str, object] = {}
    for number, block in enumerate(blocks):
        exec(compile(block, f"docs/python.md block {number + 1}", "exec"), names)
    assert os.path.exists("report.html") and os.path.exists("twin/result.json")
    assert os.path.exists("motion/motion.csv") and os.path.exists("fleet/fleet.json")


@pytest.mark.skipif(not PAGE.exists(), reason="the documents are not beside the tests")
def test_pages_say_what_there_is():
    """`design` plans motions, and the number of notebooks is that of the folder."""
    tools = (ROOT / "docs/which_tool.md").read_text()
    assert "does not plan" not in tools and "`design`" in tools and "FIGAROH" in tools
    notebooks = list((ROOT / "docs/notebooks").glob("*.ipynb"))
    word = {5: "five", 6: "six", 7: "seven", 8: "eight"}[len(notebooks)]
    assert f"[{word} notebooks]" in (ROOT / "README.md").read_text()

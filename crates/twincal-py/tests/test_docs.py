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
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), flags=re.S)
    assert len(blocks) >= 8
    names: dict[str, object] = {}
    for number, block in enumerate(blocks):
        exec(compile(block, f"docs/python.md block {number + 1}", "exec"), names)
    assert os.path.exists("report.html") and os.path.exists("twin/result.json")

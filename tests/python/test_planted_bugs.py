"""Each error that `planted_bugs.py` plants still has its place in the sources: one that has none would never be planted."""

import importlib.util

import pytest
from conftest import ROOT

PATH = ROOT / "crates" / "twincal" / "tests" / "statistics" / "planted_bugs.py"
SPEC = importlib.util.spec_from_file_location("planted_bugs", PATH)
planted = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(planted)


@pytest.mark.parametrize("bug", planted.BUGS, ids=lambda bug: bug[0])
def test_the_place_of_an_error_is_there_once(bug):
    _, file, right, wrong = bug
    text = (planted.SOURCE / file).read_text()
    assert text.count(right) == 1 and right != wrong

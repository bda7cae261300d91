"""CHANGELOG.md: one line per change, at most 120 characters, in the groups of Keep a Changelog."""

from conftest import ROOT

LINES = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
GROUPS = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_lines_are_short_and_none_is_continued():
    wrong = {
        number: line
        for number, line in enumerate(LINES, start=1)
        if len(line) > 120 or (number > 2 and line and not line.startswith(("- ", "#")))
    }
    assert not wrong, wrong


def test_groups_are_those_of_keep_a_changelog():
    groups = [line.removeprefix("### ") for line in LINES if line.startswith("### ")]
    assert groups and set(groups) <= GROUPS, groups
    versions = [line for line in LINES if line.startswith("## ")]
    assert versions[0] == "## [Unreleased]"


def test_no_change_stands_twice():
    changes = [line for line in LINES if line.startswith("- ")]
    assert len(changes) == len(set(changes))

"""Terminal, page, result.json, `check`, `predict`, `diff` and `export` give one answer about one twin, whichever robot it is of."""

import html
import json
import math
import re

import pytest
import specimens
from conftest import ROOT, twincal

USABLE = ("yes", "yes_within_limits")
ROBOTS = [
    "last_third",
    "hostile",
    "many_joints",
    "simple_pendulum",
    "double_pendulum",
    "ur10",
    "staubli_tx40",
    "kuka_kr300",
]


def words(text):
    """In one line, without what a page adds to break it."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", text.replace("\u200b", ""))).split())


@pytest.fixture(params=ROBOTS, scope="module")
def made(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    page = getattr(specimens, request.param)(folder)
    out = page.parent
    return folder, out, page.read_text(), json.loads((out / "result.json").read_text())


def test_page_and_terminal_give_the_answer_of_the_result(made):
    folder, out, page, result = made
    assessment = result["assessment"]
    first = (folder / "printed.txt").read_text().splitlines()[0]
    answer = re.search(r'<section id="answer".*?</section>', page, re.S)
    assert answer and words(first) in words(answer[0]), first
    claims = assessment["claims"]
    assert assessment["reason"] == "passed" or claims[0]["code"] == assessment["reason"]
    # an answer that begins with yes is given of usable twins alone
    assert assessment["answer"] in USABLE or not first.startswith("Yes"), first


def test_commands_on_a_twin_name_a_doubt_that_it_has(made, tmp_path):
    _, out, _, result = made
    doubtful = result["assessment"]["answer"] != "yes"
    for command in (["diff", out, out], ["export", "--twin", out, "--to", "csv", "-o", tmp_path / "effects.csv"]):
        done = twincal(*command, expect=None)
        assert ("can this twin be used?" in words(done.stdout + done.stderr)) == doubtful, command


def test_a_check_of_what_was_fitted_has_the_exit_code_of_its_answer(made):
    folder, out, _, result = made
    logs = (folder / "logs.txt").read_text().splitlines()
    never_tested = result["validation"]["split"] == "not_tested"
    done = twincal("check", *logs, "--twin", out, "--json", expect=2 if never_tested else None)
    if never_tested:
        return
    checked = json.loads(done.stdout)
    lost = any(finding["severity"] == "degraded" for finding in checked["findings"])
    usable = checked["assessment"]["answer"] in USABLE
    expected = 1 if checked["assessment"]["answer"] == "no" else 0 if usable and not lost else 3
    assert done.returncode == expected, checked["assessment"]


def test_codes_page_has_every_number_of_every_claim(made):
    page = (ROOT / "docs" / "codes.md").read_text()
    sections = dict(re.findall(r"^### `(\w+)`\n(.*?)(?=^### |\Z)", page, re.S | re.M))
    _, _, _, result = made
    for claim in result["assessment"]["claims"]:
        listed = re.findall(r"^- Evidence.*", sections[claim["code"]], re.M)
        known = set(re.findall(r"`(\w+)`", " ".join(listed))) | {"count", "chapter", "chapters", "chapters_alike"}
        assert set(claim["evidence"]) <= known, claim


def test_a_message_names_what_it_is_about_but_for_the_logs_of_some_codes(made):
    page = (ROOT / "docs" / "codes.md").read_text()
    without = set(re.findall(r"^### `(\w+)`\n(?:(?!### ).*\n)*?- Subject: the log, which", page, re.M))
    assert "columns" in without
    _, _, _, result = made
    for finding in result["findings"]:
        # of a set the first ones are named
        named = finding["subject"].split(", ")[0] in finding["message"]
        assert not finding["subject"] or named == (finding["code"] not in without), finding


# Numbers that stand behind a message and not in it, or as "> 0.999" or "a segment".
BESIDE = {
    ("short_segments", "segments"),
    ("joint_stands_still", "cutoff"),
    ("joint_stands_still", "rest_velocity"),
    ("standstill", "cutoff"),
    ("standstill", "rest_velocity"),
    ("copied_log", "first_row"),
    ("copied_log", "first_row_of_original"),
    ("alike_in_data", "pip"),
}
FACTORS = (1.0, 100.0, 1e3, 1e6, 1e-3, 180 / math.pi, 1e9)
NUMBER = re.compile(r"[-+−]?[\d.]+(?:e[-+]?\d+)?")


def printed(number, message):
    """Whether a message prints a number, in SI units, percent, thousandths or degrees, to its own digits."""
    for text in NUMBER.findall(message.replace("\u2212", "-").replace("\u202f", "")):
        try:
            said = float(text)
        except ValueError:
            continue
        digits = text.lower().split("e")[0].lstrip("+-")
        exponent = int(text.lower().split("e")[1]) if "e" in text.lower() else 0
        unit = 10.0 ** (exponent - len(digits.partition(".")[2]))
        if any(abs(abs(said) - abs(factor * number)) <= 0.51 * unit for factor in FACTORS):
            return True
    return False


def test_the_numbers_of_a_finding_stand_in_its_message(made):
    """Evidence and message are made apart: a number of one that is not in the other is a wrong one."""
    _, _, _, result = made
    lost = []
    for finding in result["findings"]:
        for name, number in finding.get("evidence", {}).items():
            beside = number is None or (finding["code"], name) in BESIDE
            if not beside and not printed(number, finding["message"]):
                lost.append((finding["code"], name, number, finding["message"]))
    assert not lost, lost

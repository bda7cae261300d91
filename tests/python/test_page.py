"""`report.html` in a headless browser: what the first screen shows, that the plots answer, and that names are text.

Skipped without Chromium (Debian and Ubuntu: `apt-get install chromium`; `TWINCAL_BROWSER` names another one).
"""

import base64
import csv
import re
import time

import browser
import pytest
import specimens
from specimens import ATTACK

pytestmark = pytest.mark.skipif(browser.installed() is None, reason="no browser: install chromium")
DESK, PHONE = (1280, 900), (390, 844)
SPECIMENS = ["demo", "double_pendulum", "last_third", "hostile", "many_joints"]
# Positions on the page and what its reader sees, sections closed.
MEASURE = """(() => {
  const box = id => { const b = document.getElementById(id).getBoundingClientRect(); return [b.top, b.bottom]; };
  return {answer: box("answer"), torque: box("torque"), plot: box("plot-torque"), use: box("use"), useText: document.querySelector("#use > :last-child").getBoundingClientRect().bottom, wide: document.documentElement.scrollWidth,
          words: document.body.innerText.split(/\\s+/).filter(word => word).length, images: document.images.length,
          open: document.querySelectorAll("details[open]").length};
})()"""


@pytest.fixture(scope="module")
def tabs(tmp_path_factory):
    """A browser, and the specimens that were made so far."""
    chromium = browser.Browser(tmp_path_factory.mktemp("profile"))
    yield chromium, {}
    chromium.close()


@pytest.fixture(params=SPECIMENS)
def page(request, tabs, tmp_path_factory):
    chromium, made = tabs
    if request.param not in made:
        made[request.param] = getattr(specimens, request.param)(tmp_path_factory.mktemp(request.param))
    return chromium, made[request.param]


def quiet(chromium):
    """Nothing was refused, reported, asked or fetched."""
    assert chromium.happened("Log.entryAdded") == []
    assert chromium.happened("Runtime.exceptionThrown") == []
    assert chromium.happened("Runtime.consoleAPICalled") == []
    assert chromium.happened("Page.javascriptDialogOpening") == []
    urls = [event["request"]["url"] for event in chromium.happened("Network.requestWillBeSent")]
    assert [url for url in urls if not url.startswith(("file:", "blob:"))] == [] and sum(url.startswith("file:") for url in urls) == 1


def readout(chromium):
    return chromium.value("[...document.querySelectorAll('#plot-torque .u-value')].map(value => value.textContent)")


def shown(chromium):
    return chromium.value("document.getElementById('range').textContent")


def test_first_screen_of_a_desk(page):
    chromium, path = page
    for dark in (False, True):
        chromium.open(path, *DESK, dark=dark)
        seen = chromium.value(MEASURE)
        for part in ("answer", "plot"):
            assert 0 <= seen[part][0] and seen[part][1] <= DESK[1], (part, seen)
        assert seen["use"][0] < DESK[1] / 2 and seen["useText"] <= DESK[1], seen
        assert seen["wide"] <= DESK[0], seen
        assert seen["words"] <= 1500 and seen["open"] == 0 and seen["images"] == 0, seen
        quiet(chromium)


def test_first_screen_of_a_phone(page):
    chromium, path = page
    chromium.open(path, *PHONE)
    seen = chromium.value(MEASURE)
    assert 0 <= seen["answer"][0] and seen["answer"][1] <= PHONE[1], seen
    assert seen["plot"][0] < 1000, seen
    assert seen["wide"] <= PHONE[0], seen
    chromium.value("document.querySelectorAll('details').forEach(section => section.open = true)")
    assert chromium.value(MEASURE)["wide"] <= PHONE[0]
    quiet(chromium)


def test_plots_answer(page):
    """Hover shows values; drag, buttons and keys zoom and pan both plots; the picker changes the joint."""
    chromium, path = page
    chromium.open(path, *DESK)
    left, top, width, height = chromium.value(
        "(() => { const b = document.querySelector('#plot-torque .u-over').getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })()"
    )
    middle = top + height / 2
    before = readout(chromium)
    chromium.mouse("mouseMoved", left + width / 3, middle)
    assert readout(chromium) != before and re.search(r"\d", "".join(readout(chromium)))
    whole = shown(chromium)
    chromium.drag((left + width / 4, middle), (left + width / 2, middle))
    zoomed = shown(chromium)
    assert zoomed != whole
    chromium.value("document.getElementById('plot-residual').focus()")
    chromium.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight")
    moved = shown(chromium)
    assert moved not in (zoomed, whole)
    chromium.value("document.querySelector('[data-do=all]').click()")
    assert shown(chromium) == whole
    first = chromium.value("document.getElementById('error').textContent")
    chromium.value("(() => { const joint = document.getElementById('joint'); joint.selectedIndex = joint.selectedIndex ? 0 : joint.length - 1;"
                   " joint.dispatchEvent(new Event('change')); })()")  # fmt: skip
    assert chromium.value("document.getElementById('error').textContent") != first
    assert chromium.value("document.querySelectorAll('.uplot').length") == 2
    labels = "[...document.querySelectorAll('.plot')].every(plot => plot.getAttribute('aria-label').length > 20)"
    assert chromium.value(labels) and chromium.value("document.getElementById('joint').labels.length") == 1
    quiet(chromium)


def test_torque_as_logged_lies_behind_the_filtered_one(page):
    chromium, path = page
    chromium.open(path, *DESK)
    logged = chromium.value("(d => d.traces[d.first].logged.length)(JSON.parse(document.getElementById('traces').textContent))")
    labels = chromium.value("[...document.querySelectorAll('#plot-torque .u-label')].map(label => label.textContent)")
    assert ("as logged" in labels) == (logged > 0), (logged, labels)
    assert logged > 0 or path.parent.name != "twincal-demo"


def test_csv_is_the_shown_trace(page, tmp_path):
    chromium, path = page
    chromium.open(path, *DESK)
    chromium.call("Browser.setDownloadBehavior", session=False, behavior="allow", downloadPath=str(tmp_path))
    chromium.value("document.getElementById('csv').click()")
    for _ in range(100):
        files = list(tmp_path.glob("*.csv"))
        if files:
            break
        time.sleep(0.1)
    (file,) = files
    assert re.fullmatch(r"[\w-]+\.csv", file.name)
    rows = list(csv.DictReader(file.open()))
    data = "(t => [t.time.length, t.time[5], t.measured[5], t.high[5]])((d => d.traces[d.first])(JSON.parse(document.getElementById('traces').textContent)))"
    assert [len(rows), *(float(rows[5][key]) for key in ("time_s", "measured", "high95"))] == pytest.approx(chromium.value(data))
    quiet(chromium)


def test_without_script_the_figures_stay(page):
    chromium, path = page
    chromium.open(path, *DESK, script=False)
    document = chromium.call("DOM.getDocument", depth=0)["root"]["nodeId"]
    svg = chromium.call("DOM.querySelector", nodeId=document, selector="#torque .still-figure .wide svg")["nodeId"]
    box = chromium.call("DOM.getBoxModel", nodeId=svg)["model"]
    assert box["width"] > 400 and box["height"] > 100
    assert path.stat().st_size < 2_000_000


def test_print_has_eight_pages_at_most(page):
    chromium, path = page
    chromium.open(path, *DESK)
    pdf = base64.b64decode(chromium.call("Page.printToPDF", preferCSSPageSize=True)["data"])
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 8


def test_names_are_text(tabs, tmp_path_factory):
    """The attack stands on the page as its reader wrote it, and makes no element; another script does not run."""
    chromium, made = tabs
    if "hostile" not in made:
        made["hostile"] = specimens.hostile(tmp_path_factory.mktemp("hostile"))
    chromium.open(made["hostile"], *DESK)
    assert chromium.value("document.body.innerText").count(ATTACK) >= 1
    assert chromium.value("document.images.length") == 0 and chromium.value("document.scripts.length") == 2
    quiet(chromium)
    chromium.value("(() => { const s = document.createElement('script'); s.textContent = 'window.ran = 1'; document.body.append(s); })()")
    assert chromium.value("window.ran === undefined")
    refused = [event["entry"]["text"] for event in chromium.happened("Log.entryAdded")]
    assert any("Content Security Policy" in text for text in refused)

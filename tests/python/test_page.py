"""`report.html` in a headless browser: what the first screen shows, that the plots answer, and that names are text.

Skipped without Chromium (Debian and Ubuntu: `apt-get install chromium`; `TWINCAL_BROWSER` names another one).
"""

import base64
import csv
import re
import subprocess
import time

import browser
import numpy as np
import pytest
from conftest import ASSETS, ROOT, SHARED, program, twincal

pytestmark = pytest.mark.skipif(browser.installed() is None, reason="no browser: install chromium")
ATTACK = "</script><img src=x onerror=alert(1)>"
DESK, PHONE = (1280, 900), (390, 844)
SPECIMENS = ["demo", "double_pendulum", "last_third", "hostile", "many_joints"]
# Positions on the page and what its reader sees, sections closed.
MEASURE = """(() => {
  const box = id => { const b = document.getElementById(id).getBoundingClientRect(); return [b.top, b.bottom]; };
  return {answer: box("answer"), torque: box("torque"), plot: box("plot-torque"), use: box("use"), useText: document.querySelector("#use > :last-child").getBoundingClientRect().bottom, wide: document.documentElement.scrollWidth,
          words: document.body.innerText.split(/\\s+/).filter(word => word).length, images: document.images.length,
          open: document.querySelectorAll("details[open]").length};
})()"""


def demo(folder):
    done = subprocess.run([program("twincal"), "demo"], cwd=folder, capture_output=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr
    return folder / "twincal-demo" / "report.html"


def fitted(folder, model, logs, *arguments):
    twincal("fit", *logs, "--model", model, "-o", folder / "out", *arguments, expect=None)
    return folder / "out" / "report.html"


def double_pendulum(folder):
    data = SHARED / "double_pendulum"
    if not data.is_dir():
        pytest.skip("../shared/data/double_pendulum is not there")
    run = [data / f"run{number}.csv" for number in range(8)]
    config = ROOT / "examples" / "double_pendulum" / "twincal.toml"
    return fitted(folder, data / "model_as_published.urdf", run[2:], "--config", config, "--heldout", *run[:2])


def last_third(folder):
    """One log, tested on its own end."""
    return fitted(folder, ASSETS / "arm.urdf", [ASSETS / "train1.parquet"], "--no-config")


def hostile(folder):
    """Joints and a log whose names are markup. A file's name has no slash."""
    name = ATTACK.replace("<", "&lt;").replace(">", "&gt;")
    model = (ASSETS / "arm.urdf").read_text().replace('"shoulder"', f'"{name}"').replace('"elbow"', f'"{name}2"')
    (folder / "arm.urdf").write_text(model)
    log = folder / (ATTACK.replace("/", "") + ".parquet")
    log.write_bytes((ASSETS / "heldout1.parquet").read_bytes())
    return fitted(folder, folder / "arm.urdf", [ASSETS / "train1.parquet"], "--no-config", "--heldout", log)


def many_joints(folder, joints=44):
    """A right model of many joints about vertical axes, each with one link on the base: nothing is found."""
    link = (
        '<link name="l{0}"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
        '<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>'
        '<joint name="axis_{0}_of_the_arm" type="continuous"><parent link="base"/><child link="l{0}"/>'
        '<origin xyz="{0} 0 0"/><axis xyz="0 0 1"/></joint>'
    )
    links = "".join(link.format(joint) for joint in range(joints))
    (folder / "robot.urdf").write_text(f'<robot name="many"><link name="base"/>{links}</robot>')
    (folder / "twincal.toml").write_text('[library]\nfamilies = ["viscous"]\n')
    t, rng = np.arange(0, 20, 0.02), np.random.default_rng(1)
    speed = rng.uniform(1, 3, (joints, 1))
    q, qd, qdd = np.sin(speed * t), speed * np.cos(speed * t), -(speed**2) * np.sin(speed * t)
    torque = (0.05 + 0.1**2) * qdd + rng.normal(0, 0.05, q.shape)
    names = [f"{kind}{joint + 1}" for kind in ("q", "qd", "qdd", "tau") for joint in range(joints)]
    table = np.vstack([t, q, qd, qdd, torque]).T
    np.savetxt(folder / "run.csv", table, "%.6g", ",", header=",".join(["t", *names]), comments="")
    return fitted(folder, folder / "robot.urdf", [folder / "run.csv"], "--config", folder / "twincal.toml")


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
        made[request.param] = globals()[request.param](tmp_path_factory.mktemp(request.param))
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
        made["hostile"] = hostile(tmp_path_factory.mktemp("hostile"))
    chromium.open(made["hostile"], *DESK)
    assert chromium.value("document.body.innerText").count(ATTACK) >= 1
    assert chromium.value("document.images.length") == 0 and chromium.value("document.scripts.length") == 2
    quiet(chromium)
    chromium.value("(() => { const s = document.createElement('script'); s.textContent = 'window.ran = 1'; document.body.append(s); })()")
    assert chromium.value("window.ran === undefined")
    refused = [event["entry"]["text"] for event in chromium.happened("Log.entryAdded")]
    assert any("Content Security Policy" in text for text in refused)

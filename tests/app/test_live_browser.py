"""The page in a real browser: it loads, the numbers move, its orders are obeyed, its files read back.

Needs viser, playwright and a Chromium (on Debian: apt-get install chromium-headless-shell). ARMLOAD_PICTURES=FOLDER
keeps the picture of the page there.
"""

import contextlib
import io
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload.app.page.curves import GROUPS
from armload.app.page.motion_page import MotionPage
from armload.app.page.page import Page
from armload.arms import arm as arm_named
from armload.devices import Replay, Simulator, read_load
from armload.errors import SourceError
from armload.motion import taie2024
from armload.payloads import test_payload
from armload.recording import read_recording
from armload.service import Session

pytestmark = pytest.mark.full

HELD = test_payload().parameters
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-background-networking",
)
PATIENCE = 120_000  # [ms] drawing without a GPU is slow
LARGE, SMALL = (1360, 860), (960, 600)  # [px] of the picture to keep, and where nothing but text is looked at
PHONE, TABLET = (390, 844), (768, 1024)  # [px]


@pytest.fixture(scope="module")
def open_browser():
    """Open the page in a browser of its own, which closes with the `with`: two that draw without a GPU in one process
    have been seen to stop each other."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="driving a browser needs playwright")
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"no browser found: expected one of {', '.join(BROWSERS)}")
    with sync_api.sync_playwright() as playwright:

        @contextlib.contextmanager
        def opened(url, complaints, strangers, size=SMALL):
            with playwright.chromium.launch(executable_path=program, args=list(FLAGS)) as browser:
                tab = browser.new_page(viewport=dict(zip(("width", "height"), size, strict=True)))
                tab.set_default_timeout(PATIENCE)
                tab.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
                tab.on("pageerror", lambda error: complaints.append(str(error)))
                tab.on(
                    "request", lambda r: None if r.url.startswith((url, "data:", "blob:")) else strangers.append(r.url)
                )
                tab.goto(url)
                tab.wait_for_selector("[data-armload=state]")
                yield tab

        yield opened


class Hesitant(Simulator):
    """A simulator that stops before the payload is taken up until it may go on: browsers may be slow."""

    def __init__(self, *arguments, **settings):
        super().__init__(*arguments, **settings)
        self.go_on = threading.Event()

    def __iter__(self):
        for sample in super().__iter__():
            if sample.t > 5.0:
                self.go_on.wait()
            yield sample


@pytest.fixture(scope="module")
def served(panda):
    """The page of a simulated Panda that takes up a payload; what browsers complain of, whom else they ask."""
    pytest.importorskip("viser", reason="the page needs viser")
    simulator = Hesitant(panda, payloads=[(6.0, HELD)], rate=250.0)
    session = Session(simulator, panda)
    page = Page(session, port=0, period=0.3)
    server = threading.Thread(target=page.serve)
    server.start()
    session.start()
    yield session, page, [], []
    simulator.go_on.set()
    page.close()
    server.join()
    session.close()


@pytest.fixture
def tab(request, served, open_browser):
    """The page open in a browser."""
    _, page, complaints, strangers = served
    with open_browser(page.url, complaints, strangers, getattr(request, "param", SMALL)) as tab:
        yield tab


@pytest.fixture
def holding(served, tab):
    """The page open in a browser while the payload is held and known."""
    session, *_ = served
    session.source.go_on.set()
    until(lambda: session.estimate.determined.all())
    return tab


def text(tab, name):
    return tab.locator(f"[data-armload={name}]").inner_text()


def mass(tab):
    """Value and half-width of the mass on the page [kg]; None while it is undetermined."""
    found = re.fullmatch(r"(\S+) ± (\S+) kg", text(tab, "mass"))
    return None if found is None else tuple(map(float, found.groups()))


def until(condition, seconds=90.0):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.2)
    return found


def choose(tab, label, option):
    tab.get_by_label(label, exact=True).or_(tab.locator(f"label:has-text('{label}') ~ * input")).first.click()
    tab.get_by_role("option", name=option, exact=True).click()


def of_orange(tab):
    """How many pixels of the picture's middle have the payload's colour; the picture."""
    from PIL import Image

    tab.evaluate("document.querySelectorAll('.mantine-Notification-root button').forEach(b => b.click())")
    time.sleep(2.0)
    image = Image.open(io.BytesIO(tab.screenshot())).convert("RGB")
    red, green, blue = np.asarray(image)[:, 420:940].reshape(-1, 3).astype(int).T
    return np.count_nonzero((red > 150) & (green > red - 110) & (blue < green - 40)), image


def test_numbers_move_and_approach_the_truth(served, tab):
    session, *_ = served
    first = until(lambda: tab.locator("[data-armload=mass]").count() and mass(tab))
    assert first[0] < 0.2  # nothing is held yet
    assert "nothing is held" in text(tab, "state")
    session.source.go_on.set()
    until(lambda: (now := mass(tab)) is not None and now[0] > 1.0)
    later = until(lambda: (now := mass(tab)) is not None and now[1] < 0.03 and now)
    assert len({first, later}) == 2
    assert later[0] == pytest.approx(HELD.mass, abs=0.05)
    assert "truth: 1.480 kg" in text(tab, "truth")
    assert "grasp" in until(lambda: "grasp" in text(tab, "log") and text(tab, "log"))
    assert "samples" in text(tab, "health")
    assert float(tab.locator("[data-armload=phi0] td").first.inner_text()) == pytest.approx(later[0], abs=0.05)
    assert session.error is None


def test_a_screen_reader_is_told_what_changes_and_of_every_control_what_it_is(holding):
    live = holding.get_by_role("status")
    # a busy machine says before it that it is not of now
    until(lambda: live.inner_text().endswith("a payload is held"))
    for group in GROUPS:
        assert holding.get_by_role("img", name=f"curves of {group.title} over time").count() == 1
    assert holding.get_by_role("img", name="picture of the arm in three dimensions").count() == 1
    nameless = "x => !x.closest('[role=alert]') && !x.innerText.trim() && !x.getAttribute('aria-label')"
    assert holding.locator("button").evaluate_all(f"all => all.filter({nameless}).length") == 0


def test_the_slider_of_a_motion_is_called_by_its_label(panda, open_browser):
    page = MotionPage(taie2024(), panda, port=0)
    server = threading.Thread(target=page.serve)
    server.start()
    try:
        with open_browser(page.url, [], []) as tab:
            until(lambda: tab.get_by_role("slider", name="Time [s]").count() == 1)
            assert tab.get_by_role("textbox", name="Time [s]").count() == 1
    finally:
        page.close()
        server.join()


@pytest.mark.parametrize("tab", [LARGE], indirect=True, ids=["large"])
def test_the_picture_shows_the_arm_and_what_it_holds(holding, tmp_path):
    until(lambda: mass(holding))
    orange, image = of_orange(holding)
    assert orange > 300
    middle = np.asarray(image)[:, 420:940].reshape(-1, 3).astype(int)
    red, green, blue = middle.T
    assert np.count_nonzero((np.ptp(middle, axis=1) < 45) & (middle.max(axis=1) < 170)) > 500  # joints, dark grey
    assert np.count_nonzero((green > red + 60) & (green > blue + 10)) > 50  # the truth's edges, green
    folder = Path(os.environ.get("ARMLOAD_PICTURES") or tmp_path)
    image.save(folder / "live.jpg", quality=80, optimize=True)
    assert (folder / "live.jpg").stat().st_size < 200_000


@pytest.mark.parametrize("tab", [PHONE], indirect=True, ids=["phone"])
def test_a_phone_shows_mass_and_its_curve_without_scrolling(holding):
    until(lambda: mass(holding))
    width, height = PHONE
    for part in ("[data-armload=mass]", ".uplot"):
        place = holding.locator(part).first
        box = until(place.bounding_box)  # None before it is drawn
        assert box["x"] >= 0.0
        assert box["x"] + box["width"] <= width
        assert box["y"] + box["height"] <= height


@pytest.mark.parametrize("tab", [PHONE, TABLET], indirect=True, ids=["phone", "tablet"])
def test_on_a_narrow_screen_nothing_of_the_table_is_cut_off(holding):
    until(lambda: mass(holding))
    width = holding.viewport_size["width"]
    for k in range(10):
        cells = holding.locator(f"[data-armload=phi{k}] td")  # drawn anew ten times a second: all asked at once
        edges = "x => [x.getBoundingClientRect().left, x.getBoundingClientRect().right, x.scrollWidth <= x.clientWidth]"
        found = cells.evaluate_all(f"all => all.map({edges})")
        assert len(found) > 1
        assert all(0.0 <= left <= right <= width and whole for left, right, whole in found)


def test_downloads_read_back(holding, tmp_path):
    tab = holding
    with tab.expect_download() as started:
        tab.get_by_role("button", name="Download").click()
    assert started.value.suggested_filename == "payload-urdf.urdf"
    started.value.save_as(tmp_path / "payload.urdf")
    root = ET.parse(tmp_path / "payload.urdf").getroot()
    assert float(root.find(".//mass").get("value")) == pytest.approx(HELD.mass, abs=0.05)

    choose(tab, "Form", "json")
    with tab.expect_download() as started:
        tab.get_by_role("button", name="Download").click()
    started.value.save_as(tmp_path / "payload.json")
    load = read_load(tmp_path / "payload.json")
    assert load.parameters.mass == pytest.approx(HELD.mass, abs=0.05)
    assert np.allclose(load.parameters.com, HELD.com, atol=0.005)


def test_whoever_comes_later_sees_the_present_state(served, holding, open_browser):
    _, page, complaints, strangers = served
    with open_browser(page.url, complaints, strangers) as late:
        late.wait_for_selector("[data-armload=phi9]")
        assert until(lambda: mass(late))[0] == pytest.approx(until(lambda: mass(holding))[0], abs=0.05)
        assert "grasp" in text(late, "log")


def test_the_method_can_be_switched_and_the_stream_tared(served, holding):
    session, *_ = served
    choose(holding, "Method", "map")
    until(lambda: session.identifier.method == "map")
    until(lambda: "method map" in text(holding, "log"))
    until(lambda: (now := mass(holding)) is not None and abs(now[0] - HELD.mass) < 0.1)
    began = session.estimate.t
    until(lambda: session.estimate.t > began + 5.0)
    holding.get_by_role("button", name="Tare").or_(holding.get_by_text("Tare", exact=True)).first.click()
    until(lambda: session.estimate.relative_to == "tare")
    until(lambda: (now := mass(holding)) is not None and abs(now[0]) < 0.1)


def test_curves_are_drawn_of_a_source_that_knows_no_truth(panda, analytic_log, open_browser):
    pytest.importorskip("viser", reason="the page needs viser")
    session = Session(Replay(analytic_log(panda, HELD, duration=4.0), panda, speed=None), panda, method="map")
    session.run()
    page, complaints, strangers = Page(session, port=0, period=0.3), [], []
    server = threading.Thread(target=page.serve)
    server.start()
    try:
        with open_browser(page.url, complaints, strangers) as tab:
            # where viser keeps its charts for tests
            charts = "Object.values((window.__viserTestpoints || {}).uplots || {}).map(p => p.chart.scales.y)"
            scales = f"{charts}.map(y => [y.min, y.max])"
            seen = until(
                lambda: len(now := tab.evaluate(scales)) == 4 and all(None not in ends for ends in now) and now
            )
            assert np.isfinite(seen).all()
            assert min(low for low, _ in seen) < HELD.mass < max(high for _, high in seen)
    finally:
        page.close()
        server.join()
        session.close()
    assert complaints == []


def test_beyond_this_machine_the_page_opens_with_its_token_and_not_without(panda, analytic_log, open_browser):
    pytest.importorskip("viser", reason="the page needs viser")
    session = Session(Replay(analytic_log(panda, HELD, duration=4.0), panda, speed=None), panda, method="map")
    session.run()
    page, complaints, strangers = Page(session, host="0.0.0.0", port=0, period=0.3), [], []
    server = threading.Thread(target=page.serve)
    server.start()
    try:
        here = re.sub("//[^:/]*:", "//127.0.0.1:", page.url)
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(here.partition("?")[0], timeout=10.0)
        with open_browser(here, complaints, strangers) as tab:
            until(lambda: abs(mass(tab)[0] - HELD.mass) < 0.2 if mass(tab) else None)
            assert "token" not in tab.url
    finally:
        page.close()
        server.join()
        session.close()
    assert complaints == []


@contextlib.contextmanager
def page_of(log, panda, port=0):
    """The page of a log that has ended."""
    session = Session(Replay(log, panda, speed=None), panda, method="map")
    session.run()
    page = Page(session, port=port, period=0.3)
    server = threading.Thread(target=page.serve)
    server.start()
    try:
        yield page
    finally:
        page.close()
        server.join()
        session.close()


def test_a_page_that_hears_nothing_says_that_it_is_old_and_goes_on_by_itself(panda, analytic_log, open_browser):
    pytest.importorskip("viser", reason="the page needs viser")
    logs = [analytic_log(panda, held, duration=4.0) for held in (HELD, None)]
    with contextlib.ExitStack() as stack:
        first = stack.enter_context(contextlib.ExitStack())
        page = first.enter_context(page_of(logs[0], panda))
        tab = stack.enter_context(open_browser(page.url, [], []))
        until(lambda: mass(tab) and mass(tab)[0] > 1.0)
        port, unheard = int(page.url.rpartition(":")[2]), tab.locator("[data-armload=unheard]")
        time.sleep(6.0)
        assert not unheard.is_visible()  # nothing changes, and it is heard all the same
        first.close()
        until(unheard.is_visible, 30.0)
        shade = "e => getComputedStyle(e.closest('[data-beat]')).opacity"
        until(lambda: float(tab.locator("[data-armload=mass]").evaluate(shade)) < 0.5)
        assert "what is shown is old" in unheard.inner_text()
        until(lambda: tab.get_by_role("status").inner_text() == "nothing is heard of armload")
        assert tab.evaluate("document.hasFocus()")  # nobody has to click on a display on a wall
        stack.enter_context(page_of(logs[1], panda, port))
        until(lambda: (now := mass(tab)) is not None and now[0] < 0.5)
        until(lambda: not unheard.is_visible())
        assert float(tab.locator("[data-armload=mass]").evaluate(shade)) == 1.0


def test_a_page_whose_browser_slept_shows_nothing_old_as_new(panda, analytic_log, open_browser):
    pytest.importorskip("viser", reason="the page needs viser")
    with page_of(analytic_log(panda, HELD, duration=4.0), panda) as page, open_browser(page.url, [], []) as tab:
        until(lambda: mass(tab))
        browser = tab.context.new_cdp_session(tab)
        browser.send("Page.setWebLifecycleState", {"state": "frozen"})
        time.sleep(6.0)
        page.session.log.write(0.0, "it happened while the browser slept")
        time.sleep(2.0)
        browser.send("Page.setWebLifecycleState", {"state": "active"})
        until(lambda: "while the browser slept" in text(tab, "log"), 30.0)
        until(lambda: not tab.locator("[data-armload=unheard]").is_visible(), 30.0)


@pytest.mark.parametrize("tab", [TABLET], indirect=True, ids=["tablet"])
def test_on_a_tablet_the_picture_is_as_wide_as_the_screen_and_both_panels_are_below_it(holding):
    until(lambda: mass(holding))
    width, height = TABLET
    edges = """all => all.map(q => [...document.querySelectorAll(q)].map(x => {
        const r = x.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; }))"""
    asked = ["[data-dock-root] > :first-child", "[data-armload=mass]", ".uplot"]

    def laid_out():  # the page is drawn anew ten times a second, and laid out as it fills: all are asked at once
        (picture, *_), *panels = holding.evaluate(edges, asked)
        left, _, right, bottom = picture
        if not all(panels) or (left, right) != (0.0, width) or not 0.3 * height < bottom < height:
            return False
        return all(top >= bottom and 0.0 <= left < right <= width for panel in panels for left, top, right, _ in panel)

    until(laid_out)
    folder = os.environ.get("ARMLOAD_PICTURES")
    if folder:
        holding.screenshot(path=Path(folder) / "tablet.png")


class Unplugged(Replay):
    """A log that ends as a robot does that is lost."""

    def __iter__(self):
        yield from super().__iter__()
        raise SourceError("the robot was unplugged")


@pytest.mark.parametrize("kind", ["log", "log of the wrong sign", "robot that is lost"])
def test_without_a_truth_the_picture_shows_what_is_known_and_nothing_old(
    panda, analytic_log, open_browser, tmp_path, kind
):
    pytest.importorskip("viser", reason="the page needs viser")
    log = analytic_log(panda, HELD, duration=4.0)
    if kind == "log of the wrong sign":
        log = replace(log, tau=-log.tau)
    source = (Unplugged if kind == "robot that is lost" else Replay)(log, panda, speed=None)
    session, complaints, strangers = Session(source, panda, method="map"), [], []
    session.start()
    until(lambda: session.ended)
    page = Page(session, port=0, period=0.3)
    server = threading.Thread(target=page.serve)
    server.start()
    try:
        with open_browser(page.url, complaints, strangers, LARGE) as tab:
            until(lambda: tab.locator("[data-armload=age]").count())
            orange, image = of_orange(tab)
            image.save(Path(os.environ.get("ARMLOAD_PICTURES") or tmp_path) / f"{kind.replace(' ', '_')}.png")
            assert not tab.locator("[data-armload=truth]").count()
            if kind == "log":
                assert orange > 300
                assert mass(tab)[0] == pytest.approx(HELD.mass, abs=0.05)
                assert "P(held)" in text(tab, "probabilities")
            elif kind == "robot that is lost":
                assert orange < 100
                assert text(tab, "mass") == "—"
                assert "the robot was unplugged" in text(tab, "state")
                assert text(tab, "waits") == "waits for the source"  # the reason is said once
            else:
                assert "sign" in text(tab, "misfit")
    finally:
        page.close()
        server.join()
        session.close()
    assert complaints == []


def test_in_a_browser_the_motion_runs_and_stands_still_when_it_is_told_to(panda, open_browser):
    pytest.importorskip("viser", reason="the page needs viser")
    page, complaints, strangers = MotionPage(taie2024(), panda, port=0), [], []
    server = threading.Thread(target=page.serve)
    server.start()
    try:
        with open_browser(page.url, complaints, strangers) as tab:
            assert tab.title() == "armload · taie2024"
            seen = {tab.locator("[data-armload=state]").inner_text()}
            for _ in range(300):
                seen.add(tab.locator("[data-armload=state]").inner_text())
                if len(seen) > 2:
                    break
                tab.wait_for_timeout(100)
            assert len(seen) > 2
            tab.get_by_label("Run").click()
            tab.wait_for_timeout(1000)
            still = tab.locator("[data-armload=state]").inner_text()
            tab.wait_for_timeout(1000)
            assert tab.locator("[data-armload=state]").inner_text() == still
            assert tab.locator("[data-armload=joint7]").count() == 1
    finally:
        page.close()
        server.join(timeout=60)
    assert complaints == []
    assert strangers == []


_CONTRAST = """e => {
  const light = text => text.match(/[\\d.]+/g).slice(0, 3).map(x => x / 255)
    .map(x => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4)
    .reduce((sum, x, k) => sum + x * [0.2126, 0.7152, 0.0722][k], 0);
  const solid = text => !/, 0\\)|transparent/.test(text);
  let on = e;
  while (on.parentElement && !solid(getComputedStyle(on).backgroundColor)) on = on.parentElement;
  const ground = getComputedStyle(on).backgroundColor;
  const both = [light(getComputedStyle(e).color), solid(ground) ? light(ground) : 1].sort();
  return (both[1] + 0.05) / (both[0] + 0.05); }"""  # WCAG 2.2, 1.4.3


def test_a_page_has_the_title_of_its_arm_and_its_buttons_can_be_read(served, tab):
    session, *_ = served
    assert tab.title() == f"armload · {session.source.name}"
    for scheme in ("light", "dark"):
        tab.evaluate("x => document.documentElement.setAttribute('data-mantine-color-scheme', x)", scheme)
        tab.wait_for_timeout(500)  # a colour changes in steps
        for words in ("Start anew", "Tare", "Take up", "Put down", "Download", "Curves"):
            found = tab.get_by_text(words, exact=True).first.evaluate(_CONTRAST)
            assert found >= 4.5, (scheme, words)
    tab.evaluate("document.documentElement.setAttribute('data-mantine-color-scheme', 'light')")


@pytest.mark.usefixtures("tab")
def test_the_browser_had_nothing_to_complain_of_and_asked_nobody_else(served):
    *_, complaints, strangers = served
    assert complaints == []
    assert strangers == []


def test_killing_the_page_loses_nothing_of_the_record(tmp_path):
    pytest.importorskip("viser", reason="the page needs viser")
    record = tmp_path / "record.csv"
    process = subprocess.Popen(
        [sys.executable, "-m", "armload", "live", "--port", "0", "--record", str(record), "--method", "map"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    message = process.stderr.readline()
    url = re.search(r"http://127\.0\.0\.1:\d+", message).group()
    with urllib.request.urlopen(url, timeout=30) as answer:
        assert b"<html" in answer.read(2000).lower()
    until(lambda: record.stat().st_size > 100_000)
    before = record.read_text(encoding="utf-8").count("\n")
    process.send_signal(signal.SIGKILL)
    out, _ = process.communicate(timeout=30)
    assert out == ""
    assert len(read_recording(record, arm_named("panda"))) >= before - 1
    size = record.stat().st_size
    time.sleep(1.5)
    assert record.stat().st_size == size or until(lambda: not _grows(record))  # the reader has ended too


def _grows(path):
    size = path.stat().st_size
    time.sleep(0.5)
    return path.stat().st_size > size

"""The report: complete, self-contained, labelled with units, and safe to write."""

import base64
import re
import shutil
import subprocess
from html.parser import HTMLParser
from io import BytesIO
from xml.etree import ElementTree

import matplotlib as mpl
import matplotlib.colors
import numpy as np
import pytest

from armload.identification import identify
from armload.identification.text import quantities, shown
from armload.inertia import NAMES, InertialParameters
from armload.lab.evaluation import Comparison, EvaluationRun, Table
from armload.lab.report import ReportError, Section, answer_section, default_report, render, write_report
from armload.lab.report import comparison_figures as figures
from armload.lab.report import recording_figures as recordings
from armload.lab.report.style import look, method_styles
from armload.motion import taie2024
from armload.regression import first_order_lag
from armload.simulation import simulate

BODY = InertialParameters.from_com(1.3, (0.03, -0.02, 0.06), np.diag([4e-3, 5e-3, 3e-3]))
METHODS = ("tree ensemble", "network <ensemble>", "rls", "rls-filter", "training mean", "same-prior least squares")
UNIT = re.compile(r"\[(g|g·m|g·m²|s|rad|rad/s|N·m)\]$")


def made_up(runs=4, seed=0, off=1.0):
    """A comparison whose errors shrink with time; the third method is `off` times worse."""
    rng, T = np.random.default_rng(seed), 13
    times = np.linspace(0, 6, T)
    truth = BODY.phi * (1 + 0.2 * rng.normal(size=(runs, 1)))
    scale = np.array([1, 1, off, 1, 1, 1])[:, None, None, None] * np.array([0.02] + [0.002] * 3 + [0.001] * 6)
    shape = (len(METHODS), runs, T, 10)
    phi = truth[:, None] + scale * rng.normal(size=shape) / (1 + times[:, None])
    std = np.broadcast_to(scale / (1 + times[:, None]), shape).copy()
    std[3, :, 0] = np.inf
    return Comparison(
        methods=METHODS,
        baselines=METHODS[-2:],
        averaged=METHODS[:2],
        labels=tuple(f"payload {k}" for k in range(runs)),
        times=times,
        truth=truth,
        phi=phi,
        std=std,
        samples=np.broadcast_to(1 + 500 * np.arange(T), shape[:3]),
        wall=rng.uniform(0.1, 1.0, shape[:2]),
        lengths=np.full(runs, 6001),
        robot="panda",
        frame="panda_link8",
        split="payloads held out",
        seeds=tuple(range(runs)),
        prior="77 training payloads",
    )


class Page(HTMLParser):
    """Text, tag balance, and whatever would be fetched."""

    VOID = frozenset({"meta", "br", "img", "link", "hr"})

    def __init__(self, text):
        super().__init__()
        self.open, self.resources, self.images, self.text = [], [], [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.resources += [v for k, v in attrs.items() if k in ("src", "srcset", "data", "poster", "action")]
        self.resources += [attrs["href"]] if "href" in attrs else []
        assert tag not in ("script", "iframe", "link", "object")
        if tag == "img":
            self.images.append(attrs)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def page(panda):
    comparison = made_up(off=60.0)
    t = np.arange(0, 2, 0.005)
    q = 0.3 * np.sin(t[:, None] + np.arange(7)) + [0, -0.6, 0, -1.8, 0, 1.6, 0.4]
    dq = np.gradient(q, t, axis=0)
    from armload.recording import Recording

    run = EvaluationRun(Recording(t, q, dq, panda.torque(q, dq)), BODY, "payload 0")
    return comparison, render(default_report(comparison, [run], panda, introduction="A <b>test</b>."), "Title & more")


# ---------------------------------------------------------------------------- HTML


def test_page_is_well_formed_and_fetches_nothing(page):
    parsed = Page(page[1])
    assert parsed.open == []
    assert len(parsed.images) == 6
    for resource in parsed.resources:
        assert resource.startswith(("data:image/svg+xml;base64,", "#"))
    assert "@import" not in page[1]
    assert "url(" not in page[1]
    for image in parsed.images:
        svg = base64.b64decode(image["src"].partition("base64,")[2])
        root = ElementTree.fromstring(svg)
        assert root.tag.endswith("svg")
        for element in root.iter():
            for key, value in element.attrib.items():
                assert not key.endswith("href") or value.startswith("#")


def test_page_holds_every_method_and_every_number_of_the_comparison(page):
    comparison, text = page
    shown = Page(text).text
    for name in comparison.methods:
        assert name in shown  # also the one that looks like a tag
    for table in (comparison.summary(), comparison.table(), comparison.estimates(0), comparison.intervals()):
        assert table.note in shown
        for row in table:
            assert all(cell in shown for cell in row)
    assert "A <b>test</b>." in shown
    assert "Title & more" in shown


def test_images_carry_their_caption_as_text(page):
    assert all(len(image["alt"]) > 20 for image in Page(page[1]).images)


def test_rows_are_headed_and_what_scrolls_is_reached_by_keyboard():
    """A screen reader says the head of a row with each cell; whoever has no mouse scrolls what has the focus."""
    page = render(default_report(made_up()))
    body = page.split("<tbody>", 1)[1]
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", body.split("</tbody>")[0])
    assert rows
    assert all(re.match(r'<th scope="row"[^>]*>[^<]+</th><td', row) for row in rows)
    regions = re.findall(r'<div class="wide"([^>]*)>', page)
    assert regions
    assert all(re.search(r'role="region" tabindex="0" aria-label="[^"]+"', region) for region in regions)


def test_the_same_comparison_gives_the_same_bytes():
    first, second = (
        render(
            [Section("S", figures=((figures.error_over_time(made_up()), "a caption"),), tables=(made_up().table(),))]
        )
        for _ in range(2)
    )
    assert first == second


@pytest.mark.full  # some seconds
def test_a_comparison_of_one_run_and_one_time_makes_a_report():
    c = made_up(runs=1)
    short = Comparison(**{
        **{name: getattr(c, name) for name in c.__dataclass_fields__},
        "times": c.times[-1:], "phi": c.phi[:, :, -1:], "std": c.std[:, :, -1:], "samples": c.samples[:, :, -1:],
    })  # fmt: skip
    page = Page(render(default_report(short))).text
    assert "one run: no spread" in page
    assert "One payload says nothing about others" in page


def test_a_method_without_error_and_one_that_diverged_can_be_drawn():
    c = made_up(runs=2)
    phi = c.phi.copy()
    phi[0], phi[2] = c.truth[:, None], 1e6
    perfect = Comparison(**{**{name: getattr(c, name) for name in c.__dataclass_fields__}, "phi": phi})
    assert default_report(perfect)[0].tables[0].rows[0][1] == "0 ± 0"
    for draw in (figures.error_bars, figures.estimates, figures.error_over_time, figures.parameter_over_time):
        draw(perfect).savefig(BytesIO())  # warnings are errors


def test_summary_names_who_does_not_beat_the_baselines():
    c = made_up(off=60.0)
    text = default_report(c)[0].text
    behind = text.partition("No better than the better of the two baselines: ")[2]
    assert "rls (mass, first moment, inertia)" in behind
    best = c.methods[int(np.argmin(c.mae[:4, -1, 0]))]
    assert f"**mass** {best}" in text


def test_text_is_escaped_and_marks_are_understood():
    table = Table("<t>", ("a", "b [g]"), (("<x>", "1"),), "note & more")
    text = render([Section("One & two", "A `1 < 2` and **bold**\n\n<script>alert(1)</script>", (table,))])
    assert "<code>1 &lt; 2</code> and <strong>bold</strong>" in text
    assert "<script" not in text
    assert "&lt;x&gt;" in text
    assert "note &amp; more" in text
    assert text.count("<p>") == 2


def test_report_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "report.html"
    assert write_report(path, [Section("One")]) == path
    before = path.read_text(encoding="utf-8")
    with pytest.raises(AttributeError):
        write_report(path, [Section("Two", figures=((object(), "not a figure"),))])
    assert path.read_text(encoding="utf-8") == before
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
    with pytest.raises(ReportError, match=r"cannot be written to .*missing.*"):
        write_report(tmp_path / "missing" / "report.html", [Section("One")])


# ---------------------------------------------------------------------------- figures


@pytest.mark.parametrize("draw", [figures.error_bars, figures.estimates, figures.error_over_time,
                                  figures.parameter_over_time])  # fmt: skip
def test_every_axis_of_a_comparison_has_its_unit(draw):
    for ax in draw(made_up()).axes:
        assert UNIT.search(ax.get_ylabel())
        ticks = [label.get_text() for label in ax.get_xticklabels()]
        assert UNIT.search(ax.get_xlabel()) or set(ticks) <= set(NAMES)


def test_every_axis_of_a_recording_has_its_unit(panda, analytic_log):
    log = analytic_log(panda, BODY, duration=1.0)
    upper, lower = recordings.motion(log).axes
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("position q [rad]", "velocity dq [rad/s]")
    assert UNIT.search(lower.get_xlabel())
    seen = [ax for ax in recordings.torques(log, panda).axes if ax.get_visible()]
    assert len(seen) == 7
    assert all(UNIT.search(ax.get_ylabel()) for ax in seen[::2])
    assert all(UNIT.search(ax.get_xlabel()) for ax in seen[-2:])


def test_bars_are_as_high_as_the_errors():
    c = made_up()
    upper_left, upper_right, lower = figures.error_bars(c).axes
    heights = [[bar.get_y() + bar.get_height() for bar in box.patches] for ax in (upper_left, upper_right, lower)
               for box in ax.containers if hasattr(box, "patches")]  # fmt: skip
    expected = [1e3 * c.mae[m, -1, part] for part in (slice(0, 1), slice(1, 4), slice(4, 10)) for m in range(6)]
    for drawn, mae in zip(heights, expected, strict=True):
        assert drawn == pytest.approx(mae)


def test_dots_of_a_learned_method_average_to_its_line():
    c = made_up()
    ax = figures.parameter_over_time(c, run=1, parameter=9).axes[0]
    dots = [line for line in ax.lines if line.get_linestyle() == "None"]
    assert len(dots) == 2
    n = np.diff(c.samples[0, 1])
    total = c.phi[0, 1, 0, 9] * c.samples[0, 1, 0] + np.sum(n * dots[0].get_ydata()) / 1e3
    assert total / c.samples[0, 1, -1] == pytest.approx(c.phi[0, 1, -1, 9])


def test_one_method_far_off_does_not_flatten_the_rest():
    c = made_up(off=1e4)
    for draw in (figures.parameter_over_time, figures.estimates):
        for ax in draw(c).axes:
            low, high = ax.get_ylim()
            assert high - low < 1e4
    labels = [t.get_text() for t in figures.parameter_over_time(c).legends[0].get_texts()]
    assert "rls (off scale)" in labels
    assert "rls-filter" in labels


def test_ticks_of_a_logarithmic_axis_are_numbers():
    for draw in (figures.error_bars, figures.error_over_time):
        figure = draw(made_up(off=1e3))
        with look():  # as it is saved
            figure.canvas.draw()
        ticks = [ax.get_yticklabels(which="both") for ax in figure.axes if ax.get_yscale() == "log"]
        assert ticks
        for labels in ticks:
            written = [label.get_text() for label in labels if label.get_text()]
            assert len([float(text) for text in written]) > 1


def test_a_method_keeps_its_colour_in_every_figure_and_baselines_are_grey():
    styles = method_styles(made_up())
    assert list(styles) == list(METHODS)
    colours = [s["color"] for s in styles.values()]
    assert len(set(colours)) == len(METHODS)
    for name in METHODS[-2:]:
        r, g, b = mpl.colors.to_rgb(styles[name]["color"])
        assert r == g == b
    bars = figures.error_bars(made_up()).axes[0].containers
    drawn = [box.patches[0].get_facecolor() for box in bars if hasattr(box, "patches")]
    assert drawn == [mpl.colors.to_rgba(c) for c in colours]


def test_drawing_leaves_no_global_state():
    before = dict(mpl.rcParams)
    figures.error_bars(made_up())
    assert dict(mpl.rcParams) == before
    import matplotlib._pylab_helpers as helpers

    assert helpers.Gcf.get_all_fig_managers() == []


def test_torques_drawn_are_the_lagged_torques(panda, analytic_log):
    """Oracle: inverse dynamics with the exact acceleration, behind the same lag."""
    log = analytic_log(panda, None, duration=2.0)
    t, measured, bare = recordings.lagged_torques(log, panda)
    assert measured == pytest.approx(bare, abs=0.05)  # nothing is held: log.tau is the bare arm's torque
    lagged = first_order_lag(log.t, log.tau, 50.0)
    assert measured == pytest.approx(lagged[np.searchsorted(log.t, log.t[0] + t - 1e-9)])
    loaded = recordings.lagged_torques(analytic_log(panda, BODY, duration=2.0), panda)
    assert loaded[2] == pytest.approx(bare, abs=0.05)
    assert np.abs(loaded[1] - loaded[2]).max() > 3.0


# ---------------------------------------------------------------------------- the answer first, and everything visible


def test_the_answer_comes_first_and_says_what_the_answer_says(panda):
    found = identify(simulate(panda, taie2024(), BODY, rate=200.0), panda)
    section = answer_section(found, BODY)
    (table,) = section.tables
    cells = {row[0]: row for row in table}
    assert cells["mass"][1] == shown(quantities(found)["mass"])[0]
    assert cells["mass"][2] == f"{BODY.mass:+.4f}"
    assert float(cells["centre of mass z"][2]) == pytest.approx(1e3 * BODY.com[2], abs=0.06)
    assert float(cells["inertia about it Iyy"][2]) == pytest.approx(BODY.inertia_com[1, 1], abs=6e-6)
    assert f"**{found.mass:.3f} ± " in section.text
    for note in found.notes:
        assert note[1:] in section.text
    nothing = answer_section(identify(simulate(panda, taie2024(), None, rate=200.0), panda))
    assert [row[0] for row in nothing.tables[0]] == ["mass"]
    assert "nothing seems to be held" in nothing.text


def beyond_the_edge(sections, width, tmp_path):
    """By how many pixels each table is wider than the place it has in a window of some width."""
    browser = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    if browser is None:
        pytest.skip("no Chromium is installed: expected chromium-headless-shell")
    ask = (
        "document.title=innerWidth+' '+"
        "[...document.querySelectorAll('div.wide')].map(d=>d.scrollWidth-d.clientWidth).join(' ')"
    )
    page = render(sections, "wide").replace("</body>", f"<script>{ask}</script></body>")
    (tmp_path / "r.html").write_text(page)
    flags = ["--no-sandbox", "--headless", "--disable-gpu", f"--window-size={width},2000", "--dump-dom"]
    dom = subprocess.run(
        [browser, *flags, f"file://{tmp_path}/r.html"], capture_output=True, text=True, timeout=120
    ).stdout
    seen, *beyond = (float(x) for x in re.search("<title>(.*)</title>", dom)[1].split())
    assert seen == width
    return beyond


@pytest.mark.full
def test_no_table_of_a_report_is_wider_than_a_page_of_1280_pixels(tmp_path):
    beyond = beyond_the_edge(default_report(made_up(runs=24, off=6000.0)), 1280, tmp_path)
    assert len(beyond) >= 8
    assert max(beyond) <= 0


@pytest.mark.full
def test_an_answer_is_read_on_a_phone_without_moving_its_table_aside(panda, tmp_path):
    found = identify(simulate(panda, taie2024(), BODY, rate=200.0), panda)
    widest = ("inertia about it Ixx", "+0.0072 [+0.0000, +0.0180]", "kg·m²", "rests on the prior")
    without = Section("Found", "", (Table("The answer", ("quantity", "value", "unit", ""), (widest,), ""),))
    assert max(beyond_the_edge([without, answer_section(found, BODY)], 390, tmp_path)) <= 0

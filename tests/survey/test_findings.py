"""What rows say of arms, and the page that shows it."""

from __future__ import annotations

import base64
import re
import warnings
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

from armload.app.cli import main
from armload.survey import read_rows, write_rows
from armload.survey.findings import arm_findings, doubtful
from armload.survey.learning import empty_stretches
from armload.survey.report import survey_sections, write_survey_report
from armload.survey.rows import columns
from armload.survey.shift import shifts

DAY = 86400.0


def row(arm, day, **more):
    """An answered row of a sound arm."""
    plain = {name: 0.0 if kind == "number" else 0 if kind == "whole" else "" for name, kind in columns(7).items()}
    plain |= dict.fromkeys(("held", "moves", "changed"), False)
    plain |= {"log": f"{arm}/{day:02d}.csv", "arm": arm, "episode": None, "parts": 1, "date": 1.79e9 + DAY * day}
    plain |= {"status": "answered", "consistent": True, "mass": 1.0, "mass_low": 0.9, "mass_high": 1.1, "misfit": 10.0}
    plain |= {name: None for name in plain if name.startswith("slide_")}  # not asked
    return plain | {"t1": 30.0, "determined": "m | m·rx | m·ry | m·rz | Ixx", "held": True} | more


@pytest.fixture
def rows():
    """Twenty days of four arms: sound but for a log, exchanged on day 12, loose from day 8 on, and put right again."""
    made = []
    for day in range(20):
        made.append(row("sound", day, changed=day == 15, moves=day == 16))
        made.append(row("exchanged", day, changed=day >= 12, misfit_joint=3 if day >= 12 else 1))
        made.append(row("loose", day, moves=day >= 8 and day % 2 == 0))
        made.append(row("mended", day, changed=5 <= day < 10))
    made.append(row("sound", 30) | {"status": "unusable", "reason": "cut off", "held": None, "moves": None})
    return made


def test_an_arm_that_changed_is_told_with_its_day_and_joint_and_sound_ones_are_left_alone(rows):
    found = {f.arm: f for f in arm_findings(rows)}
    assert [arm for arm, f in found.items() if f.retare] == ["exchanged"]
    assert [arm for arm, f in found.items() if f.loose] == ["loose"]
    assert found["exchanged"].since == 1.79e9 + DAY * 12
    assert found["exchanged"].joint == 3
    assert (found["loose"].since - 1.79e9) / DAY == pytest.approx(8, abs=1)
    assert found["sound"].unusable == 1
    assert found["sound"].logs == 21
    assert [bool(f.advice) for f in found.values()] == [f.retare or f.loose for f in found.values()]


def test_a_lasting_shift_of_friction_is_found_with_its_day_and_joint(rows):
    rng = np.random.default_rng(3)
    rows = [one for one in rows if one["arm"] in ("sound", "mended") and one["status"] == "answered"]
    for one in rows:
        day = round((one["date"] - 1.79e9) / DAY)
        one |= {f"{name}_{j}": float(0.05 * rng.normal()) for name in ("offset", "coulomb") for j in range(1, 8)}
        one["coulomb_4"] += 0.4 * (one["arm"] == "mended" and day >= 7)
    found = shifts(rows, 7)
    assert [arm for arm, shift in found.items() if shift.found] == ["mended"]
    assert (found["mended"].joint, found["mended"].what) == (4, "friction")
    assert found["mended"].since == 1.79e9 + DAY * 7
    assert found["mended"].size == pytest.approx(0.4, abs=0.1)
    advised = {f.arm: f for f in arm_findings(rows)}
    assert advised["mended"].retare
    assert not advised["sound"].retare
    assert shifts([one | {"date": None} for one in rows], 7) == {}


def test_logs_in_which_the_arm_stood_or_that_were_broken_off_are_no_shift(rows):
    """Their offsets and friction are near zero, as is expected of an arm of which nothing is seen."""
    rng = np.random.default_rng(4)
    rows = [row("worked", day) for day in range(12)]
    for one in rows:
        one |= {f"{name}_{j}": float(0.01 * rng.normal()) for name in ("offset", "coulomb") for j in range(1, 8)}
        one["coulomb_7"] += 0.3
    stood = [row("worked", day, determined=known) for day, known in ((12, "m | m·rx"), (13, ""), (14, "m | m·rz"))]
    assert not shifts(rows, 7)["worked"].found
    assert shifts([*rows, *stood], 7) == shifts(rows, 7)
    (finding,) = arm_findings([*rows, *stood])
    assert not finding.advice


def test_of_an_arm_that_has_no_tare_nothing_is_said_about_its_tare(rows):
    rows = [row("a", day, misfit=None, coulomb_2=0.4 * (day > 9) + 0.01 * (day % 3)) for day in range(20)]
    (finding,) = arm_findings(rows)
    assert "by the friction of joint 2 most, which shifted by +0.4 N·m: record it empty" in finding.advice
    assert "at its tare" not in finding.advice


def test_the_axes_of_dates_say_the_year_and_the_day(rows):
    sections = survey_sections(rows, arm_findings(rows), 7)
    over_time = sections[1].figures[0][0].axes[0].get_xlabel()
    drift = [figure.get_supxlabel() for figure, _ in sections[2].figures]
    assert {over_time, *drift} == {"date (UTC), 2026-09-21 to 2026-10-10"}
    assert {figure.get_supylabel() for figure, _ in sections[2].figures} == {"torque [N·m]"}
    one = [row("a", 0, date=1.79e9), row("a", 0, date=1.79e9 + 60.0)]
    assert survey_sections(one, arm_findings(one), 7)[1].figures[0][0].axes[0].get_xlabel() == "date (UTC), 2026-09-21"


def test_one_log_of_one_arm_is_no_plural():
    one = [row("a", 0)]
    assert survey_sections(one, arm_findings(one), 7)[0].text.startswith("1 log of 1 arm: 1 payload carried, 0 logs")


def test_nothing_is_said_of_arms_that_could_not_be_asked(rows):
    for one in rows:
        one["misfit"] = None
    assert {f.changed for f in arm_findings(rows)} == {None}
    (few,) = arm_findings([row("new", 1, changed=True), row("new", 2, changed=True)])
    assert few.changed is None
    assert not few.retare


def test_what_asks_for_nothing_has_no_mark_that_it_does():
    rows = [row("once", day, moves=day == 1, changed=day == 1) for day in range(3)]
    findings = arm_findings(rows)
    assert findings[0].advice == ""
    (cells,) = survey_sections(rows, findings, 7)[0].tables[0].rows
    assert "33 %" in cells
    assert not [cell for cell in cells if "!" in cell]


def test_only_stretches_that_are_empty_beyond_doubt_are_learned_from():
    empty = {"held": False, "mass_low": -0.01, "mass_high": 0.01}
    sound = row("a", 3, **empty)
    others = [
        row("a", 1),  # something is held
        row("a", 1, held=False, mass_low=0.002, mass_high=0.01),  # perhaps
        row("a", 1, **empty, t1=10.0),
        row("a", 1, **empty, moves=True),
        row("a", 1, **empty, changed=True),
        row("a", 1, **empty) | {"determined": "Ixx"},
        row("a", 1, **empty) | {"status": "unusable"},
    ]
    earlier = row("a", 2, **empty)
    assert empty_stretches([sound, *others, earlier]) == [earlier, sound]


def test_the_page_says_what_to_do_and_lists_what_is_in_doubt(rows, tmp_path, capsys):
    write_rows(tmp_path / "survey.parquet", rows, 7)
    page = tmp_path / "report.html"
    assert main(["survey", "report", str(tmp_path / "survey.parquet"), "--out", str(page)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in said] == ["exchanged", "loose", "wrote"]
    assert "at joint 3 most" in said[0]
    html = page.read_text(encoding="utf-8")
    assert html.count("data:image/svg+xml") == 4
    assert len(re.findall("<tr>", html)) == 2 + 4 + len(doubtful(rows))
    assert "2026-10-03" in html  # day 12
    assert "cut off" in html


def test_arms_named_in_a_script_that_the_font_lacks_are_drawn_without_a_warning(rows, tmp_path, capsys):
    for one in rows:
        one["arm"] = one["arm"].replace("exchanged", "日本")
    write_rows(tmp_path / "survey.json", rows, 7)
    assert main(["survey", "report", str(tmp_path / "survey.json"), "--out", str(tmp_path / "r.html")]) == 0
    assert "Glyph" not in capsys.readouterr().err
    assert "日本" in (tmp_path / "r.html").read_text(encoding="utf-8")


NAMES = ("$x_$y", "$\\bad$", "_left", "tab\there", "escape\x1b[31m", "two\nlines", "<b>", "*a*")


def test_an_arm_has_its_name_in_every_picture_whatever_that_is(tmp_path):
    rows = [row(name, day) for name in NAMES for day in range(3)]
    write_rows(tmp_path / "survey.parquet", rows, 7)
    write_survey_report(tmp_path / "survey.parquet", tmp_path / "report.html")
    pictures = re.findall("base64,([A-Za-z0-9+/=]+)", (tmp_path / "report.html").read_text(encoding="utf-8"))
    assert len(pictures) == 4
    for picture in pictures:
        ElementTree.fromstring(base64.b64decode(picture))  # a browser draws nothing of what is no XML
    over_time, _ = survey_sections(rows, arm_findings(rows), 7)[1].figures[0]
    (legend,) = over_time.legends
    assert {text.get_text() for text in legend.get_texts()} == set(NAMES)


@pytest.mark.parametrize("suffix", [".csv", ".json", ".parquet"])
def test_a_table_keeps_every_name_whatever_that_is(suffix, tmp_path):
    odd = ("cr\rlf\n.csv", 'comma,"quote".csv', "\r", " space ", "=1+1", "\x1b", "日本")
    rows = [row(name, 0, log=name, notes=name) for name in odd]
    write_rows(tmp_path / f"survey{suffix}", rows, 7)
    assert read_rows(tmp_path / f"survey{suffix}")[0] == rows


def test_a_survey_of_which_no_log_was_answered_has_its_page(tmp_path, capsys):
    nothing = row("a", 0, status="unusable", reason="cut off", held=None, mass=None, t0=None, t1=None, misfit=None)
    for some in ([nothing], [nothing, nothing | {"date": None, "log": "b.csv"}]):
        write_rows(tmp_path / "survey.json", some, 7)
        assert main(["survey", "report", str(tmp_path / "survey.json"), "--out", str(tmp_path / "r.html")]) == 0
        page = (tmp_path / "r.html").read_text(encoding="utf-8")
        assert "Nothing was held in any log." in page
        assert "No log was answered." in page
        assert page.count("cut off") == len(some)
    write_rows(tmp_path / "survey.json", [], 7)
    assert main(["survey", "report", str(tmp_path / "survey.json"), "--out", str(tmp_path / "r.html")]) == 2
    assert "survey.json is no survey that can be read (it has no rows)" in capsys.readouterr().err


def test_a_survey_without_dates_has_its_page_too(rows, tmp_path):
    for one in rows:
        one["date"] = None
    write_rows(tmp_path / "survey.csv", rows, 7)
    assert main(["survey", "report", str(tmp_path / "survey.csv"), "--out", str(tmp_path / "r.html")]) == 0
    assert "do not say when" not in (tmp_path / "r.html").read_text(encoding="utf-8")  # it is in a figure
    assert np.all([f.since is None or isinstance(f.since, str) for f in arm_findings(rows)])


def test_logs_without_dates_are_counted_from_one_and_nothing_has_half_a_log_or_payload(rows):
    few = [one | {"date": None} for one in rows if one["arm"] == "sound"][:3]
    few[0]["mass"] = 2.0
    sections = survey_sections(few, arm_findings(few), 7)
    over_time, histogram = (figure for figure, _ in sections[1].figures)
    (ax,) = over_time.axes
    assert sorted(ax.lines[0].get_xdata()) == [1.0, 2.0, 3.0]
    for axis in (ax.xaxis, histogram.axes[0].yaxis):
        ticks = axis.get_ticklocs()
        assert np.array_equal(ticks, np.round(ticks))
    (single,) = survey_sections(few[:1], arm_findings(few[:1]), 7)[1].figures[0][0].axes
    assert [at for at in single.get_xticks() if np.diff(single.get_xlim())[0] > abs(at - 1.0)] == [1.0]
    assert single.get_xlabel().startswith("payloads of an arm in order")


def test_where_some_logs_have_no_date_all_are_in_order_on_one_axis(rows):
    """Days since 1970 and the number of a log are no common axis: the one lies 57 years from the other."""
    for one in rows:
        one["date"] = None if one["arm"] == "loose" else one["date"]
    payloads, drift = survey_sections(rows, arm_findings(rows), 7)[1:3]
    axes = [ax for figure, _ in (*payloads.figures[:1], *drift.figures) for ax in figure.axes]
    seen = [np.asarray(line.get_xdata()) for ax in axes for line in ax.lines if len(line.get_xdata()) > 2]
    assert len(seen) > 4
    assert all(np.array_equal(x, np.arange(1.0, 21.0)) for x in seen)


@pytest.mark.parametrize("days", [0.004, 0.08, 2.4, 70.0, 800.0])
@pytest.mark.full  # some seconds
def test_dates_of_any_span_are_drawn_without_a_warning_and_apart(rows, days):
    first, *_, last = (one for one in rows if one["arm"] == "sound" and one["status"] == "answered")
    several = [
        one | {"arm": arm, "date": 1.79e9 + DAY * days * share}
        for arm in "abcd"
        for one, share in zip((first, last), (0.0, 1.0), strict=True)
    ]
    sections = survey_sections(several, arm_findings(several), 7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for figure, _ in (*sections[1].figures, *sections[2].figures):
            figure.canvas.draw()
    for figure, _ in sections[2].figures:
        for ax in figure.axes:
            left, right = ax.get_xlim()
            shown = [tick for tick in ax.xaxis.get_major_ticks() if left <= tick.get_loc() <= right]
            boxes = [tick.label1.get_window_extent() for tick in shown]
            assert all(a.x1 < b.x0 for a, b in pairwise(boxes))


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["survey", "."], "needs --out"),
        (["survey", ".", "--out", "s.parquet"], "needs --robot"),
        (["survey", ".", "--robot", "panda", "--out", "s.xlsx"], "unsupported suffix '.xlsx'"),
        (["survey", ".", "--robot", "panda", "--out", "s.csv"], "no log in"),
        (["survey", "x.csv", "--robot", "panda", "--out", "s.csv", "--tare", "no.csv"], "no.csv is not there"),
        (["survey", "x.csv", "--robot", "panda", "--out", "s.csv", "--cluster", "x"], "expected local, or the address"),
        (
            ["survey", "x.csv", "--robot", "panda", "--out", "s.csv", "--profile", "p", "--learn-profiles", "q"],
            "leave --profile out",
        ),
        (["survey", "none"], "needs --out, its table: --out survey.parquet; or: armload survey report TABLE --out"),
        (["survey", "none", "--robot", "panda", "--out", "s.csv"], "none: no such file or folder"),
        (["survey", "report", "--out", "r.html"], "takes one table"),
        (["survey", "report", "s.parquet"], "takes one table and --out: armload survey report survey.parquet --out"),
        (["survey", "report", "none.parquet", "--out", "r.html"], "none.parquet is not there"),
        (
            ["survey", "report", "s.parquet", "--out", "r.html", "--json", "--arm-of", "(.)"],
            "leave out --arm-of, --json",
        ),
        (["survey", "report", "x.csv", "--out", "r.html"], "is no table of a survey, but a log"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(tmp_path, monkeypatch, capsys, argv, said):
    monkeypatch.chdir(tmp_path)
    if "x.csv" in argv:
        (tmp_path / "x.csv").write_text("a,b\n1,2\n")
    assert main(argv) == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert said in out.err.strip().splitlines()[-1]
    assert out.err.count("\n") == 1 or "x.csv" in argv  # of logs that are there it is said how many
    assert not (tmp_path / "s.csv").exists()

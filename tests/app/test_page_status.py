"""Beside the numbers of the page: what it waits for and why, what does not fit, how old answer and tare are."""

import re
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from time import monotonic, sleep

import numpy as np
import pytest

from armload.app.page import tables
from armload.app.page.page import Page
from armload.app.page.status import Watcher, waits_for
from armload.app.page.style import GOOD, SHEET, WAIT, awake
from armload.devices import Replay, Simulator, Source, open_source
from armload.errors import SourceError
from armload.inertia import NAMES
from armload.online import Event
from armload.payloads import test_payload
from armload.service import Session, Unknown
from armload.service.session_log import Entry
from armload.service.tare import Tare
from armload.service.unknown import Why

HELD = test_payload().parameters


class Lost(Source):
    """A robot that is lost after some seconds."""

    def __init__(self, inner, seconds):
        self.inner, self.seconds = inner, seconds
        self.name, self.n, self.rate, self.speed = "robot", inner.n, inner.rate, None

    def __iter__(self):
        for sample in self.inner:
            if sample.t > self.seconds:
                raise SourceError("the robot was unplugged")
            yield sample

    def close(self):
        self.inner.close()


def simulated(panda, **settings):
    return Simulator(panda, payloads=[(0.0, HELD)], speed=None, rate=250.0, **settings)


@pytest.fixture(scope="module")
def seen(panda):
    """A session that has seen a simulated Panda hold the test payload for four seconds, and its last estimate then."""
    session = Session(simulated(panda, duration=4.0), panda, method="map")
    session.run()
    yield session
    session.close()


@pytest.fixture(scope="module")
def lost(panda):
    """The same of a robot that was lost."""
    session = Session(Lost(simulated(panda, duration=4.0), 3.0), panda, method="map")
    session.start()
    end = monotonic() + 60.0
    while not session.ended:
        assert monotonic() < end
        sleep(0.01)
    yield session
    session.close()


def test_before_the_first_sample_the_page_says_that_it_waits_for_it(panda):
    session = Session(simulated(panda, duration=1.0), panda, method="map")
    status = Watcher(session).look()
    assert status.why.reason is Unknown.STARTING
    assert "waits for</b> the first sample" in tables.status(None, status)
    assert status.age is None
    session.close()


def test_an_answer_that_nobody_renews_gets_older_by_the_clock(seen):
    watcher = Watcher(seen)
    first = watcher.look(100.0).age
    assert first == pytest.approx(seen.estimate.age)
    assert watcher.look(103.5).age == pytest.approx(first + 3.5)
    assert "answer 3.5 s old" in tables.status(seen.estimate, watcher.look(103.5 - first))


def test_probabilities_are_told_with_the_answer(seen):
    text = tables.status(seen.estimate, Watcher(seen).look())
    assert seen.estimate.p_held > 0.99
    assert "P(held) &gt;&#8239;0.99" in text
    assert "P(change)" in text


def test_a_log_that_has_ended_is_not_lost_and_waits_for_nothing(seen):
    status = Watcher(seen).look()
    assert status.why.reason is Unknown.SOURCE_ENDED
    assert not status.gone
    assert status.waits is None
    assert "the source has ended" in tables.status(seen.estimate, status)


def test_the_headline_says_of_when_an_answer_is_that_is_not_of_now(seen):
    status = Watcher(seen).look()
    ended = tables.headline(seen.estimate, None, status)
    assert "at the end of the source: a payload is held" in ended
    assert GOOD in ended
    for reason in (Unknown.BEHIND, Unknown.UNUSABLE):
        old = tables.headline(seen.estimate, None, status._replace(why=Why(reason, "why"), age=2.2))
        assert "2.2 s ago: a payload is held" in old
        assert WAIT in old
        assert GOOD not in old
        assert "font-weight:600" not in old  # no large black number of what was
    maybe = replace(seen.estimate, notes=("the payload may be changing",))
    assert WAIT in tables.headline(maybe, None, status._replace(why=None))
    now = tables.headline(seen.estimate, None, status._replace(why=None))
    assert "ago" not in now
    assert GOOD in now
    assert "font-weight:600" in now


def test_what_is_told_of_the_state_has_no_number_that_changes_with_each_picture(seen):
    def told(html):
        return re.search(r'data-armload="state"[^>]* data-spoken="([^"]*)"', html)[1]

    status = Watcher(seen).look()._replace(why=None)
    still = replace(seen.estimate, moving=False)
    assert told(tables.headline(still, None, status)) == "a payload is held"
    for reason, words in (
        (Unknown.SOURCE_ENDED, "at the end of the source: a payload is held"),
        (Unknown.BEHIND, "not of now: a payload is held"),
    ):
        assert told(tables.headline(still, None, status._replace(why=Why(reason, "2.2 s"), age=2.2))) == words
    assert told(tables.gone(status._replace(why=Why(Unknown.SILENT, "no sample for 1.2 s")))) == "no answer: silent"
    assert told(tables.headline(None)) == "waiting for the first sample"


def test_what_is_below_does_not_move_while_the_answer_becomes_known(seen):
    """As many lines of the centre of mass, columns of given width, and no sign of a zero that comes and goes."""
    unknown = replace(seen.estimate, determined=np.zeros(10, dtype=bool))
    for estimate in (seen.estimate, unknown, replace(seen.estimate, held=False)):
        com = tables.headline(estimate).split('data-armload="com"')[1].split('data-armload="truth"')[0]
        assert com.count("centre of mass [mm] from") == 1
        assert "table-layout:fixed" in tables.parameters(estimate)
    tiny = replace(seen.estimate, phi=np.array([-1e-9, 1e-9, -1e-9, *seen.estimate.phi[3:]]))
    table = tables.parameters(tiny)
    assert "-0.0000<" not in table
    assert "+0.0000<" not in table
    assert table.count(">0.0000<") == 2
    assert ">0.000 ± " in tables.headline(tiny)


def test_a_change_of_payload_is_listed_with_its_mass_once_that_is_known():
    log = [Entry(1.0, "", Event("change", 1.0, 0.9, None)), Entry(2.0, "", Event("grasp", 2.0, 1.9, 1.48))]
    text = tables.events(log)
    assert "grasp, +1.48 kg" in text
    assert "change</div>" in text
    assert "grasp, +0.0041 kg" in tables.events([Entry(2.0, "", Event("grasp", 2.0, 1.9, 0.00412, 4))])


def _luminance(colour):
    """Relative luminance of `#rrggbb` (WCAG 2.2)."""
    parts = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize(("scheme", "ground"), [("light", "#ffffff"), ("dark", "#242424")])
def test_grey_and_coloured_words_can_be_read(scheme, ground):
    rules = SHEET.split(f'scheme="{scheme}"] {{')[1].split("}")[0]
    colours = re.findall(r"#[0-9a-f]{6}", rules)
    assert len(colours) == 5
    for colour in colours:
        light, dark = sorted((_luminance(colour), _luminance(ground)), reverse=True)
        assert (light + 0.05) / (dark + 0.05) >= 4.5, colour


def test_the_title_of_a_page_is_text_whatever_an_arm_is_called():
    tags, parser, title = [], HTMLParser(), '"><img src=x onerror="alert(1)">\''
    parser.handle_starttag = lambda tag, attributes: tags.append((tag, dict(attributes)))
    parser.feed(awake(title))
    ((_, found),) = tags
    assert found["data-title"] == title
    assert found["onerror"].endswith("document.title=this.dataset.title")


def test_each_row_of_numbers_is_headed_by_its_parameter(seen):
    """A screen reader says the head of a row with each number in it."""
    heads = re.findall(r'<th scope="row"[^>]*>([^<]*)</th>', tables.parameters(seen.estimate))
    assert heads == list(NAMES)


def test_a_robot_that_is_lost_is_waited_for_and_why_is_said(lost):
    status = Watcher(lost).look()
    assert status.why.reason is Unknown.SOURCE_LOST
    assert status.gone
    assert "the robot was unplugged" in status.waits
    assert "P(held)" not in tables.status(lost.estimate, status)


def test_what_is_not_determined_waits_for_motion_by_name(seen):
    some = replace(seen.estimate, determined=np.arange(10) < 4, moving=False)
    assert waits_for(some, None) == ("motion (the arm is not moving; Ixx, Ixy, Ixz, Iyy, Iyz, Izz undetermined)")
    assert waits_for(replace(some, moving=True), None).startswith("faster and wider motion (Ixx")
    assert waits_for(replace(some, determined=np.ones(10, dtype=bool)), None) is None
    assert waits_for(replace(some, held=False), None) is None  # there is no inertia of nothing


def test_torque_of_the_wrong_sign_does_not_fit_and_is_said_once(panda, analytic_log):
    log = analytic_log(panda, HELD, duration=8.0)
    session = Session(Replay(replace(log, tau=-log.tau), panda, speed=None), panda, method="map")
    session.run()
    status = Watcher(session).look()
    assert session.doubt is not None
    assert status.misfit == session.doubt
    assert "does not fit:" in tables.status(session.estimate, status)
    headline = tables.headline(session.estimate, None, status)
    assert session.doubt[:40] not in headline
    assert "not to be trusted: see below" in headline
    for note in session.estimate.notes:  # each once, below: the headline stays short
        assert escape(note) not in headline
        assert tables.status(session.estimate, status).count(escape(note)) == 1
    assert "nothing is held</div>" not in headline.split('data-armload="state"')[1]
    assert "font-weight:600" not in headline  # no large black number of what cannot be so
    assert "font-weight:600" in tables.headline(session.estimate)
    session.close()


def test_the_age_of_a_tare_is_counted_from_when_it_was_taken_or_recorded(panda, analytic_log, monkeypatch):
    log = replace(analytic_log(panda, duration=4.0), source="empty.csv", epoch=1.7e9)
    session = Session(simulated(panda, duration=8.0), panda, tare=log, method="map")
    watcher = Watcher(session)
    now = monotonic()
    monkeypatch.setattr("time.time", lambda: 1.7e9 + float(log.t[-1]) + 600.0)
    monkeypatch.setattr("time.monotonic", lambda: now)
    assert watcher.look().tare == "empty.csv, recorded 10 min ago"  # what is replayed may be as old
    for tare, words in (
        (Tare(log, age=7200.0, given=now - 1.0), "empty.csv, 2 h old"),  # as somebody said
        (Tare(log, taken=True, given=now - 15.0), "taken 15.0 s ago"),
        (
            Tare(replace(log, epoch=0.0, t=1.7e9 + log.t), given=now),
            "empty.csv, recorded 10 min ago",
        ),  # times since 1970
        (Tare(replace(log, epoch=5e3), given=now), "empty.csv, which does not say when it was recorded"),  # since boot
        (Tare(replace(log, epoch=0.0), given=now), "empty.csv, which does not say when it was recorded"),
    ):
        session.tare = tare
        assert watcher.look().tare == words
        assert tare.age_now == tare.age  # of a replay, which takes no minute, always the same
    session.close()


@pytest.fixture
def page_of():
    """The page of a session, as nobody looks at it."""
    pytest.importorskip("viser", reason="the page needs viser")
    pages = []

    def made(session):
        pages.append(Page(session, port=0))
        pages[-1].show()
        return pages[-1]

    yield made
    for page in pages:
        page.close()


def test_after_a_loss_nothing_old_is_shown_as_if_it_were_so(lost, page_of):
    page = page_of(lost)
    assert lost.estimate.held
    assert lost.estimate.determined[:4].all()
    assert 'data-armload="mass">—<' in page._headline.content
    assert "the robot was unplugged" in page._headline.content
    assert "kg" not in page._headline.content
    assert page._table.content == ""
    assert not page.scene._payload.visible
    assert not page.scene._region.visible


def test_a_payload_is_drawn_only_where_its_centre_of_mass_is_determined(seen, page_of):
    page = page_of(seen)
    assert f"{seen.estimate.phi[0]:.3f} ± " in page._headline.content  # a log that has ended keeps its answer
    assert page.scene._payload.visible
    assert page.scene._region.visible
    some = np.arange(10) != 2
    for estimate in (replace(seen.estimate, determined=some), replace(seen.estimate, held=False)):
        page.scene.show(seen.sample, estimate, None)
        assert not page.scene._payload.visible
        assert not page.scene._region.visible
        assert ">x " not in tables.headline(estimate)
    assert "none: nothing is held" in tables.headline(replace(seen.estimate, held=False))


def test_the_flange_stays_in_the_middle_of_the_picture_or_the_base_where_it_is(seen, page_of):
    scene, poses = page_of(seen).scene, np.linspace(-0.5, 0.5, 3)[:, None] * np.ones(7) + [0, 0, 0, -1.5, 0, 1.5, 0]
    for close, (fixed, moved) in {True: ("flange", "base"), False: ("base", "flange")}.items():
        scene.close, seen_at = close, {"flange": [], "base": []}
        for q in poses:
            scene.show(seen.sample._replace(q=q), seen.estimate, None)
            seen_at["base"].append(np.array(scene._arm._whole.position))
            seen_at["flange"].append(seen_at["base"][-1] + seen.arm.frame_pose(q)[1][0])
        assert np.allclose(seen_at[fixed], seen_at[fixed][0], atol=1e-9)
        assert np.ptp(seen_at[moved], axis=0).max() > 0.1
        assert np.allclose(seen_at["flange"], 0.0, atol=1e-9) == close


def test_what_a_simulated_arm_holds_can_be_changed_by_hand(panda, page_of):
    source = Simulator(panda, speed=None, rate=100.0, duration=6.0, ahead=0.1)
    session = Session(source, panda, method="map")
    page, truths = page_of(session), []
    for estimate in session.estimates():
        if len(truths) == 300:
            page.take_up(1.2, 0.08)
        if len(truths) == 500:
            page.take_up(0.0, 0.0)
        truths.append(session.truth(estimate.t))
    session.close()
    masses = np.array([body.mass for body in truths])
    assert sorted(set(masses.round(9))) == [0.0, 1.2]
    assert masses[[299, 350, -1]].tolist() == [0.0, 1.2, 0.0]
    np.testing.assert_allclose(truths[350].com, (0.0, 0.0, 0.08), atol=1e-12)
    assert abs(session.history.last(10.0)[1][-1][0]) < 0.2


def test_another_process_s_simulator_holds_what_it_is_told_and_the_truth_knows(panda):
    with open_source("sim", panda, detached=True, rate=100.0) as source:
        assert source.simulated
        samples = iter(source)
        next(samples)
        since = source.hold(HELD)
        assert since > 0.0
        assert source.truth(since - 1e-6).mass == 0.0
        np.testing.assert_allclose(source.truth(since + 1e-6).phi, HELD.phi)

"""A source that is lost is opened again; what it says of its age is true."""

import itertools
import os
import re
import signal
import time

import numpy as np
import pytest

from armload.devices import Detached
from armload.errors import SourceError
from armload.online import OnlineIdentifier
from armload.recording import write_recording
from armload.service import ArmSettings, Reconnecting, Session, Unknown
from armload.service.arm_process import ArmProcess
from armload.service.backoff import Backoff
from armload.service.reconnecting import STALLED
from armload.service.transit import Transit
from armload.service.unknown import SILENT, Link, why_unknown


@pytest.fixture
def path(panda, analytic_log, tmp_path):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, duration=4.0))
    return path


@pytest.fixture
def source(panda, path):
    said = []
    source = Reconnecting(lambda: Detached(str(path), panda, loop=True), said=said.append, name="arm", n=7)
    source.said = said
    yield source
    source.close()


def test_a_reader_that_is_killed_and_one_that_stalls_are_replaced(source):
    samples, seen = source.ticking(0.05), []
    reader, hurt = None, 0
    for sample in samples:
        if sample is None:
            continue
        if source.process is not reader:
            reader, count = source.process, 0
            seen.append(reader.pid)
        count += 1
        if count == 20 and hurt < 2:
            os.kill(reader.pid, (signal.SIGKILL, signal.SIGSTOP)[hurt])
            hurt += 1
        if count == 20 and len(seen) == 3:
            break
    assert len(set(seen)) == 3
    assert source.connections == 3
    assert source.state == "streaming"
    lost = [text for text in source.said if "opened again" in text]
    assert "killed by signal 9" in lost[0]
    assert f"nothing for {STALLED:g} s" in lost[1]


@pytest.mark.full  # some seconds
def test_a_source_that_takes_its_time_for_its_first_sample_is_not_opened_again_meanwhile(panda, monkeypatch):
    monkeypatch.setattr("armload.service.reconnecting.STALLED", 0.05)  # a simulator takes a second
    source = Reconnecting(lambda: Detached("sim", panda, rate=100.0), name="sim", n=7)
    try:
        waited = 0
        for sample in source.ticking(0.01):
            if sample is not None:
                break
            waited += source.present is not None
        assert waited > 10
        assert source.connections == 1
    finally:
        source.close()


def test_whoever_was_away_goes_on_with_the_newest_sample(source):
    samples = (sample for sample in source.ticking(0.05) if sample is not None)
    before = next(samples).t
    time.sleep(1.5)
    next(samples)
    assert source.lag() > 1.0
    after = next(samples)
    assert source.lag() < 1.0
    assert after.t - before > 1.0
    assert source.lost > 100


def test_a_source_is_not_silent_while_its_sample_is_answered(source, panda, path, monkeypatch):
    settings = ArmSettings(name="left", source=str(path), robot="panda", method="map")
    process, said = ArmProcess(settings, 0.1), []
    monkeypatch.setattr(process, "_write", said.append)
    process.source = source
    session = Session(source, panda, method="map")
    for estimate in itertools.islice(session.estimates(), 400):
        if estimate.n_samples >= 300 and not said:
            time.sleep(1.0)  # as the first answers of a process take
            session.estimate = estimate.behind(source.lag())
            process._tell(session, time.monotonic())
    assert time.monotonic() - source.link().heard < SILENT
    assert [line["unknown"] for line in said] == ["behind"]
    session.close()


def test_what_cannot_be_opened_is_tried_again_and_ends_when_told(panda, tmp_path, path):
    later = tmp_path / "later.csv"
    source = Reconnecting(lambda: Detached(str(later), panda), name="arm", n=7)
    seen = []
    for sample in source.ticking(0.05):
        if source.state == "lost" and not later.exists():
            assert "later.csv" in source.why
            path.rename(later)
        if sample is not None:
            seen.append(sample)
        if len(seen) == 10:
            source.close()
    assert len(seen) == 10
    assert source.why is None


@pytest.mark.full  # some seconds
def test_a_reason_that_stays_is_said_as_often_as_the_wait_grows_and_then_now_and_then(monkeypatch):
    monkeypatch.setattr("armload.service.reconnecting.Backoff", lambda: Backoff(0.001, 0.004))
    said, trials = [], []

    def opened():
        trials.append(None)
        raise SourceError("none.csv is not there")

    source = Reconnecting(opened, said=said.append, name="arm", n=7)
    for _ in source.ticking(0.001):
        if len(trials) == 10:
            break
    assert len(said) == 3  # 1, 2 and 4 ms
    assert all("none.csv" in text for text in said)
    monkeypatch.setattr("armload.service.backoff.REMINDED", 0.0)
    for _ in source.ticking(0.001):
        if len(trials) == 13:
            break
    source.close()
    assert len(said) >= 5


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (RuntimeError("libfranka:\n  no route to host"), "libfranka: no route to host"),
        (TimeoutError(), "TimeoutError"),
        (SourceError("the reader of arm was killed by signal 9: open the source again"), "killed by signal 9$"),
    ],
)
def test_why_it_cannot_be_opened_is_one_line_that_asks_for_nothing_that_is_done_anyway(error, why):
    def opened():
        raise error

    source = Reconnecting(opened, name="arm", n=7)
    for _ in source.ticking(0.001):
        if source.why is not None:
            source.close()
    assert re.search(why, source.why)
    assert "\n" not in source.why


@pytest.mark.parametrize("step", [-100.0, 100.0])
def test_a_clock_that_is_set_makes_no_sample_old(step):
    transit, wall = Transit(), 0.01 * np.arange(400)
    own = wall + np.where(wall > 2.0, step, 0.0)
    late = [transit.late(t, arrived + 50.0) for t, arrived in zip(own, wall, strict=True)]
    assert max(late) < 1e-9


@pytest.mark.parametrize("step", [-0.1, -0.7, -0.99])
def test_a_clock_that_is_set_back_by_less_than_a_second_makes_one_sample_old(step):
    transit, wall = Transit(), 0.01 * np.arange(400)
    own = wall + np.where(wall > 2.0, step, 0.0)
    late = np.array([transit.late(t, arrived + 50.0) for t, arrived in zip(own, wall, strict=True)])
    assert np.sum(late > 1e-9) == 1


def test_a_sample_that_overtook_others_sets_no_clock():
    transit, t = Transit(), 0.01 * np.arange(400)
    order = np.arange(400)
    order[100], order[101] = 101, 100
    for own in t[order][:200]:
        transit.late(own, own + 50.0)
    assert transit.late(t[200], t[200] + 50.6) == pytest.approx(0.6)


def test_samples_that_waited_on_their_way_are_as_old_as_they_waited():
    transit, t = Transit(), 0.01 * np.arange(400)
    arrived = np.where((t > 1.0) & (t < 1.7), 1.7, t)  # seven tenths come at once
    late = [transit.late(*pair) for pair in zip(t, arrived, strict=True)]
    assert np.allclose(late, arrived - t, atol=1e-9)


@pytest.mark.parametrize("paced", [True, False])
def test_simulated_time_that_runs_slower_than_time_does_makes_no_sample_old(panda, path, paced):
    class Slower(Detached):
        """Each sample comes a tenth of a second later than its clock says."""

        count = 0

        def arrived(self):
            return 1e3 + 0.1 * self.count

    made = []

    def opened():
        made.append(Slower(str(path), panda, loop=True))
        made[0].paced = paced
        return made[0]

    source = Reconnecting(opened, name="arm", n=7)
    try:
        for sample in source.ticking(0.05):
            if sample is not None:
                late = made[0].arrived() - source.arrived()
                made[0].count += 1
            if made and made[0].count == 10:
                break
        assert late == pytest.approx(0.9 if paced else 0.0, abs=0.1)
    finally:
        source.close()


def test_a_clock_set_back_by_100_s_is_no_silence(panda, analytic_log):
    log = analytic_log(panda, duration=4.0, start=200.0)
    identifier = OnlineIdentifier(panda, method="map")
    for k, (t, q, dq, tau) in enumerate(log):
        estimate = identifier.update(t if k < 400 else t - 100.0, q, dq, tau)
    assert estimate.health.clock_jumps == 1
    assert estimate.health.used > 790
    link = Link("streaming", None, 1, 0.0, 10.0)
    assert why_unknown(estimate, link, 10.0) is None
    identifier.close()


def test_the_reasons_are_told_in_their_order(panda, analytic_log):
    identifier = OnlineIdentifier(panda, method="map")
    first = None
    for sample in analytic_log(panda, duration=3.0):
        estimate = identifier.update(*sample)
        first = first or estimate
    identifier.close()
    well = Link("streaming", None, 1, 0.0, 100.0)

    def reason(estimate, link, now=100.0, **more):
        why = why_unknown(estimate, link, now, **more)
        return None if why is None else why.reason

    assert reason(estimate, well) is None
    assert reason(first, well) is Unknown.UNDETERMINED
    assert reason(None, well) is Unknown.STARTING
    assert reason(estimate, well, now=101.0) is Unknown.SILENT
    assert reason(estimate.behind(0.7), well) is Unknown.BEHIND
    assert reason(estimate, well, trouble="bad") is Unknown.UNUSABLE
    assert reason(estimate, well, doubt="sign") is Unknown.IMPLAUSIBLE
    assert reason(estimate, well._replace(state="lost", why="gone"), doubt="sign") is Unknown.SOURCE_LOST
    assert reason(estimate, well._replace(state="ended")) is Unknown.SOURCE_ENDED
    again = well._replace(connections=2, resumed=99.5)
    assert reason(estimate, again) is Unknown.UNCONFIRMED
    assert reason(estimate, again._replace(resumed=98.0)) is None
    assert reason(estimate.behind(0.4), again._replace(resumed=99.7)) is Unknown.UNCONFIRMED
    # a robot that was never reached is lost, not starting; one whose first connection is being made is starting
    assert reason(None, well._replace(state="lost")) is Unknown.SOURCE_LOST
    assert reason(None, well._replace(state="connecting")) is Unknown.STARTING
    assert reason(None, well, compiling="compiles") is Unknown.COMPILING
    # all at once, and then without the first of them
    touched = first.of({**vars(first), "p_contact": 1.0})
    changing = touched.of({**vars(touched), "settling": True})
    bad = {"trouble": "bad", "doubt": "sign", "compiling": "compiles"}
    assert reason(changing.behind(0.7), again._replace(state="lost"), 101.0, **bad) is Unknown.SOURCE_LOST
    assert reason(changing.behind(0.7), again, 101.0, **bad) is Unknown.COMPILING
    del bad["compiling"]
    assert reason(changing.behind(0.7), again, 101.0, **bad) is Unknown.SILENT
    assert reason(changing.behind(0.7), again, **bad) is Unknown.BEHIND
    assert reason(changing, again, **bad) is Unknown.UNUSABLE
    assert reason(changing, again, doubt="sign") is Unknown.IMPLAUSIBLE
    assert reason(changing, again) is Unknown.UNCONFIRMED
    assert reason(changing, well) is Unknown.CHANGING
    assert reason(touched, well) is Unknown.CONTACT


def test_a_session_goes_on_where_it_was_after_its_reader_was_killed(panda, source):
    session = Session(source, panda, method="map")
    killed, lags, used = False, [], 0
    for estimate in session.estimates():
        if estimate.n_samples > 60 and not killed:
            killed, used = True, estimate.health.used
            source.process.kill()
        if killed and source.state == "lost":
            lags.append(estimate.lag)
        if killed and source.connections == 2 and estimate.health.used > used + 20:
            break
    session.close()
    assert estimate.n_samples > used  # nothing was forgotten
    assert len(lags) > 1  # it waits for 0.1 s at least, and says so every 0.1 s
    assert all(late > early for early, late in itertools.pairwise(lags))

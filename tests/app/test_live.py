"""Beside a stream: lines of JSON, curves in bounded memory, the orders of a session, what the page draws and offers."""

import itertools
import json
import math
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import sleep
from urllib.parse import urlsplit

import numpy as np
import pytest
from scipy.spatial import KDTree

from armload.app.cli import main
from armload.app.cli.headless import lines
from armload.app.page import com_region, equivalent_box
from armload.app.page.curves import AXES, GROUPS, HEIGHT, PADDING, data_of, series_of
from armload.app.page.download import ENDINGS, file_of
from armload.app.page.drawing import arm_parts, capsule, drum, edges, frame_poses
from armload.app.page.page import Page, methods_for
from armload.app.page.tables import com_std, events, headline, parameters, stream
from armload.arms import arm as arm_named
from armload.devices import FORMS, Detached, Recorded, Replay, Simulator, Source, open_source, read_load
from armload.errors import ArmloadError, SinkError, SourceError, UsageError
from armload.identification import check_plausible
from armload.inertia import UNITS, InertialParameters
from armload.online import OnlineIdentifier
from armload.online.gate import Health
from armload.payloads import random_payload, solids, test_payload
from armload.recording import Recording, Sample, read_recording, write_recording
from armload.service import History, Session
from armload.service.recent import Recent

HELD = test_payload().parameters
# what was started in the background of a shell is deaf to Ctrl-C, and so are its children
HEARS_CTRL_C = ("env", "--default-signal=INT")


def finite_json(line):
    """The object of a line that holds no NaN and no infinity."""

    def refuse(name):
        raise AssertionError(f"{name} in {line[:200]}")

    return json.loads(line, parse_constant=refuse)


@pytest.fixture(scope="module")
def held(panda):
    """A session that has seen a simulated Panda hold the test payload for six seconds."""
    session = Session(Simulator(panda, payloads=[(0.0, HELD)], speed=None, duration=6.0, rate=500.0), panda)
    session.run()
    yield session
    session.close()


@pytest.fixture
def log(panda, analytic_log, tmp_path):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, HELD, duration=4.0))
    return path


# ---------------------------------------------------------------------- lines of JSON


def test_a_log_becomes_lines_of_finite_numbers_that_approach_the_payload(log, capsys):
    assert main(["live", str(log), "--robot", "panda", "--headless", "--speed", "max", "--every", "0.5"]) == 0
    records = [finite_json(line) for line in capsys.readouterr().out.splitlines()]
    times = [line["t"] for line in records]
    assert np.allclose(np.diff(times[:-1]), 0.5, atol=0.006)
    assert times[-1] == pytest.approx(3.995)  # the last sample always has a line
    assert {line["robot"] for line in records} == {"panda"}
    assert records[-1]["mass"] == pytest.approx(HELD.mass, abs=0.05)
    assert np.allclose(records[-1]["com"], HELD.com, atol=0.005)
    assert all(np.shape(line["phi"]) == (10,) for line in records)
    assert "truth" not in records[-1]  # a log does not know


def test_the_simulator_is_identified_and_its_truth_told(panda):
    simulator = Simulator(panda, payloads=[(0.0, HELD)], speed=None, duration=5.0, rate=500.0)
    session = Session(simulator, panda)
    records = [finite_json(line) for line in lines(session, every=1.0)]
    session.close()
    assert all(line["truth"] == HELD.phi.tolist() for line in records)
    assert records[-1]["mass"] == pytest.approx(HELD.mass, abs=0.03)
    assert records[-1]["held"]
    width = [line["phi_high"][0] - line["phi_low"][0] for line in records]
    assert width[-1] < 0.5 * width[0]


def test_sim_is_what_live_runs_by_itself(capsys):
    assert main(["live", "--headless", "--speed", "max", "--duration", "0.4", "--method", "map"]) == 0
    records = [finite_json(line) for line in capsys.readouterr().out.splitlines()]
    assert records[-1]["t"] == pytest.approx(0.4, abs=0.01)
    assert records[-1]["method"] == "map"


def test_the_page_has_a_row_for_every_field_of_a_line(capsys):
    assert main(["live", "--headless", "--speed", "max", "--duration", "0.1", "--method", "map"]) == 0
    page = (Path(__file__).resolve().parents[2] / "docs" / "live.md").read_text(encoding="utf-8")
    rows = page.split("## Lines of JSON")[1].split("\n## ")[0].splitlines()
    told = {name for row in rows if row.startswith("| `") for name in re.findall(r"`(\w+)`", row.split("|")[1])}
    assert told == set(finite_json(capsys.readouterr().out.splitlines()[-1]))


@pytest.mark.parametrize("method", ["ols", "rls", "map-gp"])
def test_every_line_is_json_whatever_the_method_knows_at_first(panda, log, method):
    session = Session(Replay(log, panda, speed=None), panda, method=method)
    records = [finite_json(line) for line in lines(session, every=0.0, duration=0.3)]
    session.close()
    assert len(records) > 20


def test_a_log_needs_its_robot_named(log, capsys):
    assert main(["live", str(log), "--headless"]) == 2
    assert "--robot" in capsys.readouterr().err


@pytest.fixture
def live():
    """Starts `armload live`, and ends what a failing test has left."""
    started = []

    def start(*arguments):
        process = subprocess.Popen(
            [*HEARS_CTRL_C, sys.executable, "-m", "armload", "live", *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
        for pipe in (process.stdout, process.stderr):
            pipe.close()


@pytest.mark.full  # some seconds
def test_ctrl_c_and_a_reader_that_has_gone_end_it_in_one_line(live):
    process = live("--headless", "--method", "map", "--every", "0.01")
    assert process.stdout is not None
    finite_json(process.stdout.readline())
    process.send_signal(signal.SIGINT)
    _, text = process.communicate(timeout=60)
    assert process.returncode == 130
    assert text.strip() == "armload: interrupted"

    process = live("--headless", "--method", "map", "--every", "0.01")
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(timeout=60) == 141
    assert process.stderr.read() == ""


@pytest.mark.full  # some seconds
def test_kill_9_loses_nothing_of_the_record(live, tmp_path):
    record = tmp_path / "record.csv"
    process = live("--headless", "--method", "map", "--every", "0", "--record", record)
    seen = [finite_json(process.stdout.readline())["t"] for _ in range(300)]
    process.kill()
    rest, _ = process.communicate(timeout=60)
    # the pipe's end may be cut off, and what readline had taken of it beyond its line is not in the rest
    seen += [finite_json(line)["t"] for line in rest.splitlines() if line[:9] == '{"robot":' and line.endswith("}")]
    assert process.returncode == -signal.SIGKILL
    kept = read_recording(record, arm_named("panda"))
    assert set(seen) <= set(kept.t.tolist())


# ---------------------------------------------------------------------- curves


def test_a_history_of_days_has_the_memory_of_a_minute():
    history = History(3)
    bytes_before = history.nbytes
    for k in range(20000):
        history.append(10.0 * k, np.full(3, 10.0 * k))  # more than two days
    assert history.nbytes == bytes_before < 1_000_000
    for seconds in (60.0, 3600.0, 86400.0, np.inf):
        t, rows = history.last(seconds)
        assert 2 <= len(t) <= 301
        assert np.all(np.diff(t) > 0)
        assert t[-1] == 10.0 * 19999
        assert np.array_equal(rows[:, 0], t)  # rows belong to their times
        assert t[0] >= t[-1] - seconds
    assert history.last()[0][0] == 0.0  # the beginning is still there


@pytest.mark.parametrize("seconds", [5.0, 40.0, 300.0])
def test_a_curve_reaches_as_far_back_as_asked(seconds):
    history = History(1)
    for k in range(6000):
        history.append(0.1 * k, [0.0])
    t, _ = history.last(seconds)
    assert t[-1] - t[0] > 0.9 * seconds
    assert history.due(t[-1] + 0.1)
    assert not history.due(t[-1] + 0.05)


def test_a_clock_that_was_set_back_starts_the_curves_anew():
    history = History(1)
    history.append(100.0, [1.0])
    assert history.due(3.0)
    history.append(3.0, [2.0])
    t, rows = history.last()
    assert t.tolist() == [3.0]
    assert rows.tolist() == [[2.0]]


@pytest.mark.parametrize("group", GROUPS, ids=lambda g: g.title)
def test_curves_hold_the_estimates_within_their_intervals(held, group):
    t, rows = held.history.last()
    data = data_of(group, t, rows)
    assert len(data) == len(series_of(group))
    for k, place in enumerate(group.places):
        high, low, truth, value = data[1 + 4 * k : 5 + 4 * k]
        assert np.all(low <= value)
        assert np.all(value <= high)
        assert value[-1] == group.scale * rows[-1, place]
        assert truth[-1] == group.scale * HELD.phi[place]
        half = high[-1] - value[-1]
        assert half == pytest.approx(group.scale * rows[-1, 10 + place])  # the present interval is not cut
    assert np.all(np.isfinite(np.array(data)))


def ticks(low, high, axis):
    """How many ticks uPlot puts on a y axis: at the least of its increments that leaves `space` px (its own: 30)."""
    step = increment(low, high, axis)
    return math.floor(high / step) - math.ceil(low / step) + 1


def increment(low, high, axis):
    """From tick to tick."""
    pixels = HEIGHT - PADDING[0] - PADDING[2] - AXES[0]["size"]
    increments = [m * 10.0**e for e in range(-12, 12) for m in (1.0, 2.0, 2.5, 5.0)]
    return next(i for i in increments if pixels * i / (high - low) >= axis.get("space", 30))


@pytest.mark.parametrize("group", GROUPS, ids=lambda g: g.title)
def test_ticks_differ_in_the_three_decimals_that_uplot_writes(group):
    rows = np.zeros((50, 30))
    rows[:, 10:20] = np.where(np.arange(10) == 0, 2e-3, 2e-6)  # better known than arms can tell
    data = data_of(group, np.arange(50.0), rows)
    assert increment(min(x.min() for x in data[1:]), max(x.max() for x in data[1:]), AXES[1]) >= 0.001
    assert group.unit == {1.0: "kg", 1e3: "10⁻³ " + UNITS[group.places[0]]}[group.scale]


def test_a_source_that_knows_no_truth_is_drawn_like_any_other(panda, log):
    """uPlot takes the least of all numbers of a scale: one that is none would leave the plot empty."""
    session = Session(Replay(log, panda, speed=None), panda, method="map-gp")
    session.run()
    session.close()
    t, rows = session.history.last()
    assert np.isnan(rows[:, 20:]).all()
    for group in GROUPS:
        data = data_of(group, t, rows)
        assert len(data) == len(series_of(group))
        assert np.isfinite(np.array(data)).all()
        low, high = min(x.min() for x in data[1:]), max(x.max() for x in data[1:])
        for k, place in enumerate(group.places):
            assert data[4 + 4 * k][-1] == group.scale * rows[-1, place]
            assert np.array_equal(data[3 + 4 * k], data[4 + 4 * k])  # hidden under the line of the value, drawn later
            assert ["dash" in each for each in series_of(group)[3 + 4 * k : 5 + 4 * k]] == [True, False]
        ends = group.scale * (rows[-1, :10] + np.array([[-1.0], [1.0]]) * rows[-1, 10:20])
        assert low <= ends[0, list(group.places)].min()
        assert high >= ends[1, list(group.places)].max()
        assert high - low < 10.0 * np.ptp(ends[:, list(group.places)])
        pad = 0.1 * (high - low)  # uPlot's own
        assert ticks(low - pad, high + pad, AXES[1]) >= 3


def test_a_truth_that_is_known_late_is_drawn_from_then_on(held):
    t, rows = held.history.last()
    rows = rows.copy()
    rows[: len(t) // 2, 20:] = np.nan
    for group in GROUPS:
        data = np.array(data_of(group, t, rows))
        assert np.isfinite(data).all()
        for k, place in enumerate(group.places):
            assert np.all(data[3 + 4 * k, len(t) // 2 :] == group.scale * HELD.phi[place])


def test_nothing_yet_and_no_interval_yet_can_be_drawn():
    for rows in (
        np.empty((0, 30)),
        np.full((1, 30), np.nan),
        np.column_stack([np.zeros((3, 10)), np.full((3, 20), np.inf)]),
    ):
        data = data_of(GROUPS[1], np.arange(float(len(rows))), rows)
        assert len({len(column) for column in data}) == 1
        assert len(data[0]) >= 2
        assert np.isfinite(np.array(data)).all()


# ---------------------------------------------------------------------- session


class Broken(Source):
    """A robot whose connection breaks after the first samples."""

    name, n, rate = "robot", 7, 1000.0

    def __iter__(self):
        for k in range(5):
            yield Sample(0.001 * k, np.zeros(7), np.zeros(7), np.zeros(7))
        raise SourceError("the connection was lost")

    def close(self):
        pass


def test_a_lost_robot_is_told_in_the_log_and_the_last_estimate_stays(panda):
    session = Session(Broken(), panda, method="map")
    session.start()
    while not session.ended:
        sleep(0.01)
    assert str(session.error) == "the connection was lost"
    assert session.log[-1].text == "the connection was lost"
    assert session.estimate.t == pytest.approx(0.004)
    with pytest.raises(SourceError, match="ended"):
        session.reset()
    session.close()


class Given(Source):
    """Samples as they are."""

    name, n, rate = "robot", 7, 200.0

    def __init__(self, samples):
        self.samples = samples

    def __iter__(self):
        return iter(self.samples)

    def close(self):
        pass


def test_lines_go_on_and_say_why_while_no_sample_can_be_used(panda, analytic_log):
    samples = list(analytic_log(panda, HELD, duration=4.0))
    step = samples[1].t - samples[0].t
    stream = [s if s.t < 2.0 else s._replace(tau=np.full(7, np.nan)) for s in samples]
    warned = []
    session = Session(Given(stream), panda, method="map", warn=warned.append)
    records = [finite_json(line) for line in lines(session, every=0.1)]
    session.close()
    assert np.diff([line["t"] for line in records]).max() < 0.1 + 1.5 * step
    assert records[-1]["t"] == pytest.approx(samples[-1].t)
    assert records[-1]["age"] == pytest.approx(samples[-1].t - 2.0, abs=0.05)
    assert records[-1]["left_out_why"] == {"not finite": records[-1]["left_out"]}
    assert "torque of joint 1 is not a number" in records[-1]["notes"][-1]
    assert len(warned) == 1
    assert [entry.text for entry in session.log if entry.warning] == warned
    assert session.sample.t < 2.0  # what the page draws


class Clock:
    """A machine's monotonic clock that goes on only on command, in place of the module `time`."""

    def __init__(self, monkeypatch):
        self.now = 100.0
        for user in ("pace", "source"):
            monkeypatch.setattr(f"armload.devices.{user}.time", self)

    def monotonic(self):
        return self.now


@pytest.mark.parametrize("speed", [1.0, 4.0, None])
@pytest.mark.parametrize("recorded", [False, True])
def test_an_answer_is_as_old_as_its_samples_have_waited(panda, analytic_log, monkeypatch, tmp_path, speed, recorded):
    log, clock = analytic_log(panda, HELD, duration=2.0), Clock(monkeypatch)
    source = Replay(log, panda, speed=speed)
    source = Recorded(source, tmp_path / "record.csv") if recorded else source
    session = Session(source, panda, method="map")
    estimates = session.estimates()
    assert next(estimates).lag == 0.0
    clock.now += 5.0  # the consumer is held up, and all the rest of the log comes due
    late = 0.0 if speed is None else 5.0 * speed
    for estimate in estimates:
        waited = 0.0 if speed is None else late - (estimate.t - log.t[0])  # the first was due at once
        assert estimate.lag == pytest.approx(waited, abs=1e-9)
        assert -1e-9 <= estimate.age - waited <= 0.0101  # rows are 5 ms apart
    session.close()
    assert ("this machine is too busy" in stream("log", session.estimate)) == (speed is not None)


@pytest.mark.full  # some seconds
def test_lines_tell_what_was_lost_and_how_late_they_are(panda, log, tmp_path):
    """The reader has its own process and does not wait: what it has written to its record was due before."""
    kept = tmp_path / "record.csv"
    with Detached(str(log), panda, record=kept, capacity=100) as source:
        session = Session(source, panda, method="map")
        records = lines(session, every=0.0)
        next(records)  # and at most 99 more are on their way
        while kept.read_bytes().count(b"\n") < 500:
            sleep(0.02)
        newest = read_recording(kept).t[-1]
        held_up = [finite_json(line) for line in records]
        session.close()
    assert held_up[-1]["lost"] >= 300
    for line in held_up[:-1]:  # the last comes when the log has ended
        assert line["lag"] >= newest - line["t"] - 1e-9
        assert line["age"] >= line["lag"]


@pytest.mark.parametrize("time", [np.nan, 3.0], ids=["no time", "one time"])
def test_lines_come_by_the_machines_clock_where_the_streams_stands(panda, analytic_log, time):
    samples = [s._replace(t=time) for s in analytic_log(panda, HELD, duration=1.0)]

    class Slow(Given):
        def __iter__(self):
            for sample in self.samples[:60]:
                sleep(0.005)
                yield sample

    session = Session(Slow(samples), panda, method="map")
    records = [finite_json(line) for line in lines(session, every=0.05)]
    session.close()
    assert len(records) >= 4
    assert "no sample could be used" in records[-1]["notes"][-1]


def test_a_change_has_its_line_at_once_and_lines_go_on_while_it_settles(panda):
    simulator = Simulator(panda, payloads=[(3.0, HELD)], speed=None, duration=4.0, rate=200.0)
    session = Session(simulator, panda, method="map-gp")
    records = [finite_json(line) for line in lines(session, every=0.05)]
    session.close()
    settling = [line for line in records if line["settling"]]
    first = next(line for line in records if line["event"] is not None)
    assert first is settling[0]
    assert first["t"] == first["event"]["t"]
    assert len(settling) >= 4
    assert np.diff([line["t"] for line in records]).max() < 0.06
    assert all(line["p_change"] > 0.5 and line["interval"] == "approximate" for line in settling)
    assert settling[0]["event"]["mass"] is None


NOT_OF_THIS_ARM = {
    "torque negated": (lambda _, s: s._replace(tau=-s.tau), "opposite sign"),
    "no torque": (lambda _, s: s._replace(tau=0.0 * s.tau), "tau is zero"),
    "no gravity": (lambda arm, s: s._replace(tau=s.tau - arm.torque(s.q)), "tau holds only"),
    "no velocity": (lambda _, s: s._replace(dq=0.0 * s.dq), "dq.* is zero although"),
}


@pytest.fixture(scope="module")
def moved(panda):
    with Simulator(panda, payloads=[(0.0, HELD)], speed=None, duration=7.0, rate=200.0) as simulator:
        return list(simulator)


@pytest.mark.parametrize("wrong", [None, *NOT_OF_THIS_ARM])
@pytest.mark.full  # some seconds
def test_samples_that_cannot_be_of_this_arm_are_doubted_as_in_a_log(panda, moved, wrong):
    change, expected = NOT_OF_THIS_ARM.get(wrong, (lambda _, s: s, None))
    warned = []
    session = Session(Given([change(panda, s) for s in moved]), panda, method="map", warn=warned.append)
    session.run()
    session.close()
    if expected is None:
        assert warned == []
        assert session.estimate.notes == ()
        return
    assert len(warned) == 1
    assert re.search(f"not plausible.*{expected}", warned[0])
    assert warned[0].split(": tau")[0] in session.estimate.notes[-1]
    assert not session.estimate.calibrated
    assert warned[0] in events(session.log).replace("&#x27;", "'")


def test_an_interruption_is_no_jump_of_the_joints(panda, moved):
    """A log that is replayed again and again, or an arm that was switched off and moved by hand, is no other arm."""
    lap = moved[-1].t + 0.005
    stream = [s._replace(t=s.t + k * lap) for k in range(3) for s in moved[: len(moved) - 150]]
    warned = []
    session = Session(Given(stream), panda, method="map", warn=warned.append)
    session.run()
    session.close()
    assert warned == []


def test_a_doubt_stays_though_too_little_is_seen_of_the_next_payload_to_say_it_again():
    """Another method forgets what was seen, as a change of payload does; two seconds of this arm then pass as sound."""
    robot, anew = arm_named("ur10e"), [4.25, 8.25]
    with open_source("sim", robot, payloads=[], speed=None, duration=11.0, rate=200.0, seed=4) as simulator:
        stream = [s._replace(tau=-s.tau) for s in simulator]
    for begins in anew:
        two = [s for s in stream if begins <= s.t <= begins + 2.1]
        check_plausible(Recording(*map(np.array, zip(*two, strict=True))), robot)
    session, doubted = Session(Given(stream), robot, method="map"), []
    for estimate in session.estimates():
        if anew and estimate.t >= anew[0]:
            session.use("map")
            anew.pop(0)
        doubted += [any("not plausible" in note for note in estimate.notes)] if estimate.t > 4.0 else []
    session.close()
    assert all(doubted)
    assert not any("plausible now" in entry.text for entry in session.log)


@pytest.mark.full
@pytest.mark.parametrize("method", ["map", "rls"])  # one takes the turns for changes of payload
def test_a_doubt_is_taken_back_by_evidence_and_the_checks_go_on(panda, analytic_log, method):
    """The sign of the torque is turned, set right after 4 s, and turned again after 40 s."""
    log = analytic_log(panda, HELD, duration=65.0, rate=50.0)
    stream = [s._replace(tau=s.tau if 4.0 < s.t < 40.0 else -s.tau) for s in log]
    session = Session(Given(stream), panda, method=method)
    session.run()
    session.close()
    first, back, again = [entry for entry in session.log if "plausible" in entry.text]
    assert "opposite sign" in first.text
    assert first.t < 4.0
    assert "plausible now" in back.text
    assert 2.0 * first.t - 0.3 < back.t < 40.0  # after as much motion as the doubt rested on
    assert "not plausible" in again.text
    assert again.t > 40.0
    assert "not plausible" in session.estimate.notes[-1]
    assert not session.estimate.calibrated


def test_a_lost_source_is_told_in_the_terminal_at_once(monkeypatch, capsys):
    errors = []

    class Seen:
        url = "nowhere"

        def __init__(self, session, *_, **__):
            self.session = session

        def serve(self):
            while not self.session.ended:
                sleep(0.01)
            while "the connection was lost" not in "".join(errors):  # a thread of its own writes it
                sleep(0.01)
                errors.append(capsys.readouterr().err)
            raise KeyboardInterrupt

        def close(self):
            pass

    monkeypatch.setattr("armload.app.page.page.Page", Seen)
    monkeypatch.setattr("armload.devices.open_source", lambda *_, **__: Broken())
    assert main(["live", "fr3://nowhere", "--method", "map"]) == 2
    assert "".join(errors).count("the connection was lost") == 1
    assert capsys.readouterr().err == ""  # once is enough


def test_a_tool_that_is_known_is_part_of_the_arm(capsys, tmp_path):
    settings = ["live", "--headless", "--speed", "max", "--duration", "3", "--method", "map", "--every", "1"]
    assert main([*settings, "--tool", "franka-hand"]) == 0
    last = finite_json(capsys.readouterr().out.splitlines()[-1])
    assert last["relative_to"] == "tool"
    assert last["mass"] == pytest.approx(last["truth"][0], abs=0.05)  # the simulated arm has the tool, too
    assert main([*settings, "--tool", "franka-hand", "--tare", "empty.csv"]) == 2
    assert "--tool and --tare together" in capsys.readouterr().err
    heavy = tmp_path / "heavy.json"
    heavy.write_text(json.dumps({"phi": [730.0, *[0.0] * 3, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0]}))
    assert main([*settings, "--tool", str(heavy)]) == 2
    assert "the tool weighs 730 kg" in capsys.readouterr().err


def test_another_method_goes_on_from_nothing_and_an_unknown_one_changes_nothing(panda, analytic_log):
    session = Session(Replay(analytic_log(panda, HELD, duration=2.0), panda, speed=None), panda, method="map")
    estimates = session.estimates()
    before = list(itertools.islice(estimates, 200))[-1]
    with pytest.raises(ArmloadError, match="sorcery"):
        session.use("sorcery")
    assert next(estimates).method == "map"
    session.use("rls")
    after = next(estimates)
    assert (after.method, session.identifier.method) == ("rls", "rls")
    assert before.n_samples in (199, 200)  # of the rows that count by then
    assert after.n_samples == 1
    assert session.log[-1].text == "method rls"
    session.reset()
    next(estimates)
    assert next(estimates).n_samples == 2
    session.close()


def test_a_tare_is_as_old_as_it_was_said_to_be_until_another_is_taken(panda, analytic_log):
    run, tare = analytic_log(panda, HELD, duration=9.0), analytic_log(panda, None, duration=4.0)
    session = Session(Replay(run, panda, speed=None), panda, tare, "map", tare_age=4 * 86400.0)
    estimates, drifts = session.estimates(), []

    def look(count):
        list(itertools.islice(estimates, count))
        drifts.append(session.identifier.engine.session.drift)

    look(100)
    session.use("map-gp")
    look(700)
    session.take_tare()
    look(10)
    session.close()
    assert drifts == pytest.approx([2.0, 2.0, 0.0], rel=1e-4)  # some seconds later
    assert (session.tare.age, session.tare.taken) == (0.0, True)


def test_an_order_that_follows_another_at_once_does_not_undo_it(panda, analytic_log):
    session = Session(Replay(analytic_log(panda, HELD, duration=12.0), panda, speed=None), panda, method="map")
    estimates = session.estimates()
    for method, orders in (
        ("map-gp", (lambda: session.use("map-gp"), session.take_tare)),
        ("map", (session.take_tare, lambda: session.use("map"))),
    ):
        list(itertools.islice(estimates, 900))
        for order in orders:
            order()
        after = next(estimates)
        assert (after.method, after.relative_to) == (method, "tare")
    session.close()


@pytest.mark.parametrize("command", [["live", "sim", "--headless"], ["serve", "sim", "--robot", "panda"]])
def test_the_age_of_no_tare_is_refused(capsys, command):
    assert main([*command, "--tare-age", "1d"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert "there is no --tare" in err


def test_what_is_held_counts_as_nothing_after_a_tare(panda, analytic_log):
    run = analytic_log(panda, HELD, duration=9.0)
    session = Session(Replay(run, panda, speed=None, payload=HELD), panda, method="map")
    estimates = session.estimates()
    list(itertools.islice(estimates, 100))
    with pytest.raises(ArmloadError, match="a tare needs at least"):
        session.take_tare()
    held = list(itertools.islice(estimates, 900))[-1]
    assert held.phi[0] == pytest.approx(HELD.mass, abs=0.02)
    session.take_tare()
    *_, bare = estimates
    assert bare.relative_to == "tare"
    assert bare.phi[0] == pytest.approx(0.0, abs=0.02)
    assert session.truth(bare.t).mass == pytest.approx(0.0)
    session.close()


@pytest.mark.full  # some seconds
def test_no_tare_is_taken_while_a_payload_is_handed_over(panda, analytic_log):
    empty, loaded = (analytic_log(panda, what, duration=20.0) for what in (None, HELD))
    share = np.clip((empty.t - 8.0) / 8.0, 0.0, 1.0)[:, np.newaxis]
    run = Recording(empty.t, empty.q, empty.dq, empty.tau + share * (loaded.tau - empty.tau))
    session = Session(Replay(run, panda, speed=None), panda)
    refused = set()
    for estimate in session.estimates():
        if 8.0 < estimate.t < 15.9 and (estimate.settling or estimate.p_change > 0.5):
            with pytest.raises(ArmloadError, match="the payload is changing"):
                session.take_tare()
            refused.add(round(estimate.t))
    assert len(refused) > 4  # seconds
    session.close()


def test_recent_samples_are_the_last_ones_in_bounded_memory():
    recent = Recent(2, rows=50)
    assert recent.recording(1.0) is None
    for k in range(500):
        recent.append(Sample(0.01 * k, np.full(2, k), np.full(2, -k), np.full(2, 0.5 * k)))
    kept = recent.recording(0.2)
    assert len(kept) == 20
    assert kept.q[-1].tolist() == [499.0, 499.0]
    assert kept.tau[0].tolist() == [240.0, 240.0]
    assert len(recent.recording(1e9)) == 50
    recent.append(Sample(0.0, np.zeros(2), np.zeros(2), np.zeros(2)))  # the clock was set
    assert recent.recording(1e9) is None


def test_methods_offered_are_those_that_work_here(held, panda):
    names = methods_for(held)
    assert names[0] == "hybrid"
    for name in names:
        OnlineIdentifier(panda, None, name).close()
    assert "difference" not in names  # needs a tare


# ---------------------------------------------------------------------- shapes


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0  # divergence theorem


def test_a_capsule_is_at_its_radius_from_the_segment_and_closed():
    start, end, radius = np.array([0.1, -0.2, 0.3]), np.array([0.4, 0.1, 0.9]), 0.07
    mesh = capsule(start, end, radius, sides=64)
    along = end - start
    share = np.clip((mesh.vertices - start) @ along / (along @ along), 0.0, 1.0)
    assert np.allclose(np.linalg.norm(mesh.vertices - start - share[:, None] * along, axis=1), radius)
    length = np.linalg.norm(along)
    assert volume(mesh) == pytest.approx(np.pi * radius**2 * length + 4 / 3 * np.pi * radius**3, rel=0.01)
    there = [(a, b) for f in mesh.faces for a, b in itertools.pairwise([*f, f[0]])]
    assert len(set(there)) == len(there)  # each edge once in either direction: closed, all faces outwards
    assert {(b, a) for a, b in there} == set(there)


def test_a_drum_has_the_volume_of_a_cylinder():
    mesh = drum((0.1, 0.0, 0.2), (1.0, 1.0, 0.0), 0.05, 0.2, sides=128)
    assert volume(mesh) == pytest.approx(np.pi * 0.05**2 * 0.2, rel=0.002)
    assert np.allclose(mesh.vertices.mean(axis=0), (0.1, 0.0, 0.2))


def test_links_reach_from_joint_to_joint_and_drums_stay_where_their_joint_turns(any_arm):
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, any_arm.n)
    R, p = frame_poses(any_arm, q)
    parts = arm_parts(any_arm)
    assert {part.frame for part in parts if part.kind == "joint"} == set(range(any_arm.n + 1))
    for part in parts:
        corners = p[part.frame] + part.mesh.vertices @ R[part.frame].T
        if part.kind == "link":
            along = p[part.frame + 1] - p[part.frame]
            share = np.clip((corners - p[part.frame]) @ along / (along @ along), 0.0, 1.0)
            away = np.linalg.norm(corners - p[part.frame] - share[:, None] * along, axis=1)
            assert np.allclose(away, away[0])  # a capsule about the line from this joint to the next
        elif part.frame:
            turned = q.copy()
            turned[part.frame - 1] += 2 * np.pi * 5 / 32  # by five of its 32 sides it turns into itself
            R_after, p_after = frame_poses(any_arm, turned)
            after = p_after[part.frame] + part.mesh.vertices @ R_after[part.frame].T
            assert np.allclose(KDTree(corners).query(after)[0], 0.0, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_equivalent_box_has_the_inertial_parameters(seed):
    body = random_payload(seed).parameters
    box = equivalent_box(body)
    assert np.linalg.det(box.axes) == pytest.approx(1.0)
    same = solids.box(box.lengths, mass=body.mass, rotation=box.axes, translation=box.centre)
    assert np.allclose(same.phi, body.phi, atol=1e-12)


def test_numbers_no_body_can_have_are_drawn_flat():
    impossible = InertialParameters.from_com(1.0, (0, 0, 0.1), np.diag([0.001, 0.001, 0.003]))
    lengths = equivalent_box(impossible).lengths
    assert lengths.min() == 0.0
    assert np.all(np.isfinite(lengths))


def test_the_region_of_the_centre_of_mass_holds_it_with_95_percent():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(10, 10)) * 1e-3
    covariance = root @ root.T
    phi = np.array([1.5, 0.02, -0.01, 0.09, 0.01, 0, 0, 0.01, 0, 0.01])
    region = com_region(phi, covariance)
    drawn = rng.multivariate_normal(phi, covariance, size=20000)
    r = drawn[:, 1:4] / drawn[:, :1]
    inside = np.sum(((r - region.centre) @ region.axes / region.lengths) ** 2, axis=1) <= 1.0
    assert inside.mean() == pytest.approx(0.95, abs=0.01)


def test_a_box_has_four_edges_along_each_side():
    ends = edges((0.1, 0.2, 0.3))
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert np.allclose(np.sort(lengths), np.repeat([0.1, 0.2, 0.3], 4))


# ---------------------------------------------------------------------- what the page says and offers


def test_numbers_have_units_and_what_is_not_determined_says_so(held):
    estimate = held.estimate
    text = headline(estimate, HELD)
    assert f"{estimate.phi[0]:.3f} ± " in text
    assert "kg" in text
    assert "mm" in text
    table = parameters(estimate, HELD)
    assert table.count("<tr") == 11
    assert "kg·m²" in table
    assert table.count("unknown") == np.count_nonzero(~estimate.determined)
    at_first = OnlineIdentifier(held.arm).update(0.0, np.zeros(7), np.zeros(7), np.zeros(7))
    assert parameters(at_first).count("unknown") == 10
    assert "kg</div>" not in headline(at_first)
    assert "nothing has happened" in events([])


def test_the_page_names_what_rests_on_the_prior_as_a_line_does(held):
    leaning = np.isin(np.arange(10), [5, 6, 8])
    # what is undetermined is said already
    estimate = replace(held.estimate, determined=np.arange(10) != 8, rests_on_prior=leaning)
    said = parameters(estimate).split('data-armload="prior">')[1].split("</div>")[0]
    assert said == "more on the prior than on the samples: Ixy, Ixz"
    assert "more on the prior" not in parameters(replace(estimate, rests_on_prior=np.zeros(10, dtype=bool)))


def test_a_pause_or_a_clock_that_was_set_is_no_sample_left_out():
    assert str(Health(6097, pauses=1)) == "6097 samples; 1 pause"
    left_out = {"not a number": 3}
    assert str(Health(10, left_out, pauses=2, clock_jumps=1)) == (
        "10 samples, left out: 3 not a number; 2 pauses; 1 clock jump"
    )


def test_the_centre_of_mass_has_the_error_bars_of_its_region(held):
    rng = np.random.default_rng(2)
    drawn = rng.multivariate_normal(held.estimate.phi, held.estimate.covariance, size=20000)
    assert np.allclose(com_std(held.estimate), (drawn[:, 1:4] / drawn[:, :1]).std(axis=0), rtol=0.05)


def test_every_form_can_be_downloaded_under_its_own_name(held, tmp_path):
    assert set(ENDINGS) == {*FORMS, "json"}
    files = [file_of(held.estimate, held.arm, form) for form in ENDINGS]
    assert len({name for name, _ in files}) == len(ENDINGS)
    assert all(text for _, text in files)
    path = tmp_path / "payload.json"
    path.write_text(file_of(held.estimate, held.arm, "json")[1], encoding="utf-8")
    load = read_load(path)
    assert np.allclose(load.parameters.phi, held.estimate.phi)
    assert (load.robot, load.frame) == ("panda", "panda_link8")
    assert list(load.determined) == held.estimate.determined.tolist()


def test_nothing_is_downloaded_before_the_mass_is_known(held):
    at_first = OnlineIdentifier(held.arm).update(0.0, np.zeros(7), np.zeros(7), np.zeros(7))
    for estimate in (None, at_first):
        with pytest.raises(SinkError, match="not determined yet"):
            file_of(estimate, held.arm, "urdf")
    with pytest.raises(SinkError, match="unknown form"):
        file_of(held.estimate, held.arm, "punched-cards")


def test_a_page_without_viser_says_what_to_install(held, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(UsageError, match=r"the page needs viser.*pip install .*viser>="):
        Page(held)


def test_a_page_goes_on_whatever_time_span_a_client_sends(held):
    pytest.importorskip("viser")
    page = Page(held, port=0)
    try:
        page._span.value = "nonsense"
        page.show()
        t, *_ = page._plots[0].data
        assert len(t) == len(held.history.last(30.0)[0])
    finally:
        page.close()


@pytest.mark.parametrize("more", [b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01"])
def test_what_a_stranger_sends_is_no_traceback_of_ours(held, more, caplog):
    pytest.importorskip("viser")
    page = Page(held, port=0)
    try:
        port = urlsplit(page.url).port
        with socket.create_connection(("127.0.0.1", port), timeout=10.0) as stranger:
            stranger.sendall(b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 5\r\n\r\n" + more)
            with suppress(ConnectionError):
                while stranger.recv(4096):
                    pass
        with urllib.request.urlopen(page.url, timeout=10.0) as answer:
            assert answer.status == 200
    finally:
        page.close()
    assert [record for record in caplog.records if record.name.startswith("websockets")] == []


def test_a_page_on_an_interface_that_is_not_there_is_refused(held):
    pytest.importorskip("viser")
    with pytest.raises(UsageError, match="no page can be served"):
        Page(held, host="203.0.113.7")

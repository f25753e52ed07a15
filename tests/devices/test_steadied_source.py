"""A source whose velocities are told by its positions, too: what a coarse robot sends, answered as its log is."""

from __future__ import annotations

import json
import time
from dataclasses import replace

import numpy as np
import pytest

from armload.app.cli import main
from armload.arms import arm
from armload.devices import Replay, Source, Steadied
from armload.errors import SourceError
from armload.inertia import InertialParameters
from armload.lab.episodes.motion_kinds import MotionSource
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.recording import Recording, read_recording, steadied, write_recording
from armload.service.session import Session
from armload.simulation import Sensors, World, simulate

STEP = 2.0 * np.pi / 2.0**17  # [rad]


def coarse(log):
    """The same with positions of 17 bits, and velocities that are their differences to the sample before."""
    q = np.round(log.q / STEP) * STEP
    dq = np.zeros_like(q)
    dq[1:] = np.diff(q, axis=0) / np.diff(log.t)[:, None]
    return replace(log, q=q, dq=dq).select(slice(1, None))


class Silent(Source):
    """Sends what a log has, then nothing for a while, then ends, or is lost."""

    def __init__(self, log: Recording, ticks: int, lost: bool = False) -> None:
        self.name, self.n, self.rate, self._log, self._ticks = "silent", log.n, log.rate, log, ticks
        self._came, self._lost = 0.0, lost

    def __iter__(self):
        return (sample for sample in self.ticking(0.0) if sample is not None)

    def ticking(self, tick):
        for k, sample in enumerate(self._log):
            self._came = 1000.0 + k
            yield sample
        for _ in range(self._ticks):
            time.sleep(tick)
            yield None
        if self._lost:
            raise SourceError("the connection was lost")

    def arrived(self):
        return self._came

    def close(self):
        """Nothing is held."""


@pytest.fixture(scope="module")
def swinging():
    t = np.arange(200) / 100.0
    q = 0.3 * np.sin(3.0 * t)[:, None] * [1.0, 0.5]
    rng = np.random.default_rng(4)
    return Recording(t, q, np.gradient(q, t, axis=0) + 2e-3 * rng.normal(size=q.shape), q)


def test_what_is_held_back_comes_once_nothing_has_come_for_as_long_as_a_gap(swinging):
    ticks = list(Steadied(Silent(swinging, 3)).ticking(0.06))
    assert [sample.t for sample in ticks if sample is not None] == swinging.t.tolist()
    silent = [k for k, sample in enumerate(ticks) if sample is None]
    assert len(swinging) > silent[0] > len(swinging) - 10  # too short a pause to be one
    assert silent[1:] == [len(swinging) + 1, len(swinging) + 2]


def test_what_came_before_a_connection_was_lost_is_handed_on_first(swinging):
    source = iter(Steadied(Silent(swinging, 0, lost=True)))
    assert [next(source).t for _ in range(len(swinging))] == swinging.t.tolist()
    with pytest.raises(SourceError, match="lost"):
        next(source)


def test_a_sample_has_arrived_when_it_came_and_not_when_it_is_handed_on(swinging):
    source = Steadied(Silent(swinging, 0))
    for k, sample in enumerate(source):
        assert sample.t == swinging.t[k]
        assert source.arrived() == 1000.0 + k
        came = source.as_it_came(sample)
        np.testing.assert_array_equal(came.dq, swinging.dq[k])
        assert not np.array_equal(sample.dq, came.dq)


def test_a_replay_in_real_time_is_75_ms_late_and_says_so(swinging):
    source = Steadied(Replay(swinging.between(0.0, 0.6), speed=1.0))
    lags = [source.lag() for _ in source]
    assert np.median(lags[:40]) == pytest.approx(0.08, abs=0.02)
    assert time.monotonic() - source.arrived() < 1.0


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A run of a Gen3 at 100 Hz with most of what it is rated for, and its tare, as such robots log them."""
    robot, folder = arm("gen3"), tmp_path_factory.mktemp("coarse")
    world, places = World.real_like(robot, 900), MotionSource(robot, 0.0)
    motion = random_motion(robot, 60, duration=10.0)
    about = places.draw("long", np.random.default_rng(8), 20.0, "tare", places.centre(motion), 0.3)
    drawn = draw_payload("boxes", 0).parameters.phi
    body = InertialParameters(drawn * (0.8 * robot.rated_payload / drawn[0]))
    how = {"world": world, "sensors": Sensors.of(robot), "rate": 100.0}
    run, tare = simulate(robot, motion, body, seed=0, **how), simulate(robot, about, seed=50, **how)
    for name, log in (("run", run), ("empty", tare)):
        write_recording(folder / f"{name}.csv", coarse(log))
    return folder / "run.csv", folder / "empty.csv", body.mass


@pytest.mark.full  # some seconds
def test_a_stream_of_coarse_velocities_is_told_how_they_can_be_steadied_and_then_not_doubted(logs, capsys):
    run, empty, mass = logs
    last = {}
    for steady in ([], ["--steady"]):
        args = ["live", str(run), "--robot", "gen3", "--tare", str(empty), "--headless", "--speed", "max", *steady]
        assert main(args) == 0
        out, err = capsys.readouterr()
        last[bool(steady)] = json.loads(out.splitlines()[-1])
        assert err.count("steady them") == (0 if steady else 1)
    assert last[False]["event"] is not None
    assert last[False]["interval"] == "approximate"
    assert last[True]["event"] is None
    assert last[True]["interval"] == "calibrated"
    assert last[True]["phi_low"][0] <= mass <= last[True]["phi_high"][0]


@pytest.mark.full  # some seconds
def test_beside_a_profile_nobody_is_told_to_steady_velocities_without_leaving_it_out(logs, tmp_path, capsys):
    """`--steady` beside `--profile` is refused."""
    run, empty, _ = logs
    path = tmp_path / "arm.profile"
    assert main(["profile", str(empty), "--robot", "gen3", "--out", str(path)]) == 0
    capsys.readouterr()
    assert main(["live", str(run), "--robot", "gen3", "--profile", str(path), "--headless", "--speed", "max"]) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if "steady them" in line]
    assert len(told) == 1
    assert "give a tare in place of the profile, and steady them (" in told[0]


def test_velocities_that_are_no_velocities_are_doubted_as_they_came(logs):
    """In degrees per second: told by the positions, too, they look like velocities."""
    robot, (run, _, _) = arm("gen3"), logs
    log = read_recording(run, robot)
    session = Session(Steadied(Replay(replace(log, dq=np.rad2deg(log.dq)), speed=None)), robot, method="map")
    session.run()
    session.close()
    assert session.doubt is not None
    assert "derivative" in session.doubt
    assert session.estimate.interval == "approximate"


def test_a_tare_taken_from_a_steadied_stream_is_steadied_too(logs):
    """The samples are kept as they came; an answer from both kinds would be of two different arms."""
    robot, (_, empty, _) = arm("gen3"), logs
    log = read_recording(empty, robot).between(0.0, 8.0)
    session = Session(Steadied(Replay(log, speed=None)), robot, method="map")
    for k, _ in enumerate(session.estimates()):
        if k == 500:
            session.take_tare()
    session.close()
    assert session.tare is not None
    kept = session.tare.recording
    np.testing.assert_array_equal(kept.dq, log.between(kept.t[0], kept.t[-1] + 1e-9).dq)
    assert session.estimate.relative_to == "tare"
    assert abs(session.estimate.phi[0]) < 0.3


@pytest.mark.parametrize("steady", [False, True])
def test_a_stream_whose_joints_are_counted_anew_after_a_turn_is_not_doubted_and_can_be_tared(steady):
    robot, t, endless = arm("gen3"), np.arange(1600) / 200.0, [0, 2, 4, 6]
    q = 0.5 * np.sin(np.outer(t, np.linspace(0.8, 1.6, 7)))
    q[:, endless] += np.outer(t, [1.0, -1.0, 1.2, -1.2])
    dq = np.gradient(q, t, axis=0)
    log = Recording(t, q, dq, robot.torque(q, dq, np.gradient(dq, t, axis=0)))
    wrapped = q.copy()
    wrapped[:, endless] = np.mod(q[:, endless], 2.0 * np.pi)
    assert np.abs(np.diff(wrapped, axis=0)).max() > 6.0
    source = Replay(replace(log, q=wrapped), speed=None)
    session = Session(Steadied(source) if steady else source, robot, method="map")
    for k, _ in enumerate(session.estimates()):
        if k == 1200:
            session.take_tare()
    session.close()
    assert session.doubt is None
    assert session.tare is not None
    assert np.abs(np.diff(session.tare.recording.q, axis=0)).max() < 0.1


def test_a_profile_and_steadied_velocities_are_refused_together(capsys):
    assert main(["live", "sim", "--headless", "--steady", "--profile", "arm.profile"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "leave one of the two out" in err


def test_a_record_of_a_steadied_stream_has_the_samples_as_they_came(logs, tmp_path, capsys):
    robot, (run, _, _) = arm("gen3"), logs
    options = ["--robot", "gen3", "--method", "map", "--headless", "--speed", "max", "--duration", "1", "--steady"]
    for name in ("record.csv", "record.mcap"):
        assert main(["live", str(run), *options, "--record", str(tmp_path / name)]) == 0
        kept, log = read_recording(tmp_path / name, robot), read_recording(run, robot)
        assert len(kept) > 50
        np.testing.assert_allclose(kept.dq[: len(log)], log.dq[: len(kept)], rtol=0, atol=1e-12)
    assert capsys.readouterr().out
    assert np.abs(steadied(log).dq - log.dq).max() > 1e-3

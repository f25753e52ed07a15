"""A stream teaches a profile the empty arm, and nothing that it may have held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm, identify
from armload.devices import Simulator
from armload.errors import IdentificationError
from armload.motion import random_motion
from armload.online import OnlineIdentifier, learning
from armload.payloads import draw_payload
from armload.posterior import checked_solver, learn_profile
from armload.posterior.scales import AnotherArm
from armload.recording import Recording, marks_of
from armload.simulation import Run, Sensors, World, simulate, simulate_many
from armload.simulation.resolution import COARSE

SECONDS = 24.0


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def world(panda):
    return World.real_like(panda, 31)


@pytest.fixture(scope="module")
def logs(panda, world):
    motions = [random_motion(panda, seed, duration=8.0) for seed in range(4)]
    runs = [Run(motion, None, world, Sensors.panda(panda), k) for k, motion in enumerate(motions)]
    return simulate_many(panda, runs, rate=100.0, duration=8.0, workers=1, resolution=COARSE)


@pytest.fixture(scope="module")
def learned(logs):
    """One of the profile's logs."""
    return logs[1]


@pytest.fixture(scope="module")
def profile(panda, logs):
    return learn_profile(panda, logs)


def streamed(panda, world, profile, held, look=None, seconds=SECONDS):
    """A stream of an arm that repeats one motion, `held` being [(from, payload)]; `look` at it after every sample."""
    source = Simulator(
        panda,
        random_motion(panda, 3, duration=8.0),
        held,
        speed=None,
        duration=seconds,
        seed=5,
        world=world,
        sensors=Sensors.panda(panda),
        rate=100.0,
    )
    stream = OnlineIdentifier(panda, profile=profile)
    for sample in source:
        last = stream.update(*sample)
        if look is not None:
            look(stream)
    learned = stream.learned("today")
    stream.close()
    return last, learned


@pytest.mark.parametrize("which", ["stream", "tare"])
def test_a_stream_of_what_the_profile_is_learned_from_is_doubted_as_a_log_of_it_is(panda, learned, profile, which):
    """What they say counts twice, and the intervals are too narrow."""
    other = simulate(panda, random_motion(panda, 9, duration=4.0), sensors=Sensors.panda(panda), rate=100.0, seed=9)
    log, tare = (learned, None) if which == "stream" else (other, learned)
    stream = OnlineIdentifier(panda, tare, profile=profile)
    for sample in log:
        stream.update(*sample)
    last, doubts = stream.conclude(), stream.doubts
    stream.close()
    of_log = identify(log, panda, tare=tare, profile=profile)
    said = next(note for note in of_log.notes if "learned from these very measurements" in note)
    assert said in last.notes
    assert said in doubts
    assert last.interval == of_log.interval == "approximate"
    sound = OnlineIdentifier(panda, profile=profile)
    for sample in other:
        sound.update(*sample)
    assert said not in sound.conclude().notes
    sound.close()


def test_samples_of_a_stream_have_the_marks_of_a_log_of_them_and_a_bounded_number(monkeypatch):
    rng, seen = np.random.default_rng(4), learning.Seen()
    q, dq, tau = rng.normal(size=(3, 20_000, 7))
    dq[:500] = 0.0
    log = Recording(0.01 * np.arange(len(q)), q, dq, tau)
    for sample in log:
        seen.take(sample)
    assert tuple(seen.marks) == marks_of(log)
    monkeypatch.setattr(learning, "_MOST", 100)
    few = learning.Seen()
    for sample in log:
        few.take(sample)
    assert 25 < len(few.marks) <= 100
    assert set(few.marks) < set(seen.marks)


@pytest.mark.full
def test_a_stream_of_the_empty_arm_is_one_more_session(panda, world, profile):
    last, learned = streamed(panda, world, profile, [(0.0, None)])
    assert not last.held
    assert learned is not None
    assert [session.name for session in learned.sessions[len(profile.sessions) :]] == ["today"]
    assert learned.sessions[-1].duration == pytest.approx(SECONDS, abs=1.0)
    poses = random_motion(panda, 3, duration=8.0).position(np.linspace(1.0, 7.0, 20))
    assert learned.uncertainty(poses).mean() < profile.uncertainty(poses).mean()


@pytest.mark.full  # that a log with a payload is not learned from: tests/app/test_cli_profile.py
def test_nothing_is_learned_from_a_payload(panda, world, profile):
    last, learned = streamed(panda, world, profile, [(0.0, draw_payload("boxes", 1, 0.8))])
    assert last.held
    assert learned is None


@pytest.mark.full  # some seconds
def test_a_light_thing_that_nobody_noticed_does_not_become_the_arm_s(panda, world, profile):
    light = draw_payload("boxes", 2, 0.04)
    _, learned = streamed(panda, world, profile, [(0.0, light)])
    if learned is not None:
        before, after = (p.mounted(panda)[0][0] for p in (profile, learned))
        assert abs(after - before) < 0.25 * light.parameters.mass


@pytest.mark.full  # some seconds
def test_nothing_is_learned_from_another_arm_and_it_is_said_within_a_minute(panda, profile):
    last, learned = streamed(panda, World.real_like(panda, 77), profile, [(0.0, None)], seconds=45.0)
    assert learned is None
    assert not last.calibrated
    assert any("not as its profile says" in note for note in last.notes)


@pytest.mark.full  # some seconds
def test_an_arm_that_was_once_found_to_be_another_stays_one(panda, world, profile, monkeypatch):
    answers = iter([True])  # found once; the evidence falls back afterwards
    monkeypatch.setattr(checked_solver, "FROM", 5.0)
    monkeypatch.setattr(checked_solver, "another_arm", lambda *_: AnotherArm(0.0, -9.0, next(answers, False)))
    said = []
    held = [(0.0, None), (18.0, draw_payload("boxes", 3, 1.5))]  # its new run has not asked yet
    last, learned = streamed(panda, world, profile, held, lambda stream: said.append(stream.arm_changed is not None))
    assert next(answers, None) is None
    assert last.held
    assert said == sorted(said)  # never taken back
    assert said[-1]
    assert learned is None
    assert not last.calibrated
    assert any("not as its profile says" in note for note in last.notes)


@pytest.mark.full  # some seconds
def test_an_arm_that_is_found_to_be_another_amid_changes_is_not_its_profile_s(panda, world, profile, monkeypatch):
    changed = []
    monkeypatch.setattr(checked_solver, "FROM", 2.0)
    monkeypatch.setattr(checked_solver, "another_arm", lambda *_: AnotherArm(0.0, -9.0, bool(changed)))
    held = [(0.0, None), (6.0, draw_payload("boxes", 3, 1.5))]
    last, _ = streamed(
        panda, world, profile, held, lambda stream: changed.extend([1] * (stream.relative_to == "before"))
    )
    assert changed  # what is held was compared with the run before it, not with what the profile held
    assert [note for note in last.notes if note.startswith("the arm is not as its profile says")]


@pytest.mark.parametrize("found", [True, False])
@pytest.mark.full  # some seconds
def test_an_end_says_once_that_the_arm_is_not_its_profile_s(panda, world, profile, monkeypatch, found):
    verdicts = iter([True, found])  # while the stream goes on, and at its end
    monkeypatch.setattr(checked_solver, "FROM", 3.0)
    monkeypatch.setattr(checked_solver, "another_arm", lambda *_: AnotherArm(9.0, 9.0, next(verdicts, found)))
    log = simulate(panda, random_motion(panda, 3, duration=8.0), world=world, rate=100.0).between(0.0, 5.0)
    stream = OnlineIdentifier(panda, profile=profile)
    for sample in log:
        stream.update(*sample)
    end = stream.conclude()
    stream.close()
    said = [note for note in end.notes if note.startswith("the arm is not as")]
    assert len(said) == 1
    assert "not as its profile says" in said[0]
    assert ("do without" in said[0]) == found
    assert end.interval == "approximate"


@pytest.mark.full  # some seconds
def test_what_was_taken_up_on_the_way_is_left_out(panda, world, profile):
    _, learned = streamed(panda, world, profile, [(0.0, None), (21.5, draw_payload("boxes", 3, 1.5))])
    if learned is not None:
        assert learned.sessions[-1].duration < 22.0
        before, after = (p.mounted(panda)[0][0] for p in (profile, learned))
        assert abs(after - before) < 0.03


def test_without_a_profile_nothing_is_learned(panda):
    stream = OnlineIdentifier(replace(panda))
    with pytest.raises(IdentificationError, match="without a profile"):
        stream.learned()
    stream.close()


@pytest.mark.parametrize("tared", [False, True])
@pytest.mark.full  # twenty seconds
def test_a_state_goes_on_exactly_without_having_the_profile_in_it(panda, world, profile, logs, tared, tmp_path):
    """Also as what it teaches the profile, and where it begins anew later."""
    about = (random_motion(panda, 3, duration=8.0), [(4.0, draw_payload("boxes", 5, rated=3.0))])
    sensors = {"world": world, "sensors": Sensors.panda(panda), "rate": 100.0, "speed": None}
    with Simulator(panda, *about, duration=9.0, seed=5, **sensors) as source:
        samples = list(source)
    first = OnlineIdentifier(panda, logs[0] if tared else None, profile=profile)
    streams, sizes = [first], {}
    for k, sample in enumerate(samples):
        answers = [one.update(*sample) for one in streams]
        for answer in answers[1:]:
            assert np.array_equal(answer.phi, answers[0].phi)
            assert np.array_equal(answer.covariance, answers[0].covariance)
        if k in (5, 150, 420, 700):  # the first moments; one run; a hand-over; a run and the one before it
            path = first.save(tmp_path / "state.npz")
            sizes[k] = path.stat().st_size
            streams.append(OnlineIdentifier.restore(path, panda, profile=profile))
    assert first.event is not None
    assert sizes[150] < (1.6 if tared else 1.0) * profile.A.nbytes
    taught = [one.learned("today") for one in streams]
    assert len({None if one is None else one.digest for one in taught}) == 1
    for one in streams:
        one.reset()
    for sample in samples[:100]:
        again = [one.update(*sample) for one in streams]
        assert all(np.array_equal(one.phi, again[0].phi) for one in again)
    for one in streams:
        one.close()

"""Velocities on a stream that positions and velocities tell together: those of the log, 75 ms late, nothing lost."""

from __future__ import annotations

import numpy as np
import pytest

from armload import Recording
from armload.recording import Sample, Steadying, steadied, with_velocities_of_positions
from armload.recording.steadied import AROUND
from armload.recording.steadying import _ROWS

NOISE = 2e-3  # [rad/s]


def swinging(rate, seconds=6.0):
    """Two joints that swing by 0.3 rad twice in a second, and their true velocities."""
    rng, count = np.random.default_rng(3), round(seconds * rate)
    t = (np.arange(count) + 0.2 * rng.uniform(size=count)) / rate
    phase = np.pi * t[:, None] + [0.0, 1.0]
    q = 0.3 * np.sin(phase) + NOISE / 200.0 * rng.normal(size=(count, 2))
    truth = 0.3 * np.pi * np.cos(phase)
    return Recording(t, q, truth + NOISE * rng.normal(size=q.shape), rng.normal(size=q.shape)), truth


def through(samples, n=2):
    """What a stream gives back, each sample with the number of the one that had come last."""
    steadying, out = Steadying(n), []
    for k, sample in enumerate(samples):
        out += [(k, number, s) for s, number in steadying.take(sample, k)]
    return out + [(len(samples), number, s) for s, number in steadying.flush()]


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_a_stream_has_the_velocities_of_its_log(rate):
    log, truth = swinging(rate)
    out = through(list(log))
    assert [number for _, number, _ in out] == list(range(len(log)))
    dq = np.array([s.dq for _, _, s in out])
    whole = steadied(log).dq
    later = log.t > 1.0  # of the first seconds the noise is not known yet
    assert np.sqrt(np.mean((dq - whole)[later] ** 2)) < 0.05 * NOISE
    assert np.sqrt(np.mean((dq - truth) ** 2)) < 1.1 * np.sqrt(np.mean((whole - truth) ** 2))
    assert all(np.array_equal(s.q, log.q[k]) and np.array_equal(s.tau, log.tau[k]) for _, k, s in out)


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_a_stream_without_velocities_has_those_of_the_positions_of_its_log(rate):
    log, truth = swinging(rate, 2.0)
    told = with_velocities_of_positions(log).dq
    steadying = Steadying(2, alone=True)
    samples = [sample._replace(dq=np.full(2, np.nan)) for sample in log]
    out = [s for sample in samples for s, _ in steadying.take(sample)] + [s for s, _ in steadying.flush()]
    np.testing.assert_allclose([s.dq for s in out], told, atol=1e-9)
    assert np.sqrt(np.mean((told - truth) ** 2)) < NOISE


def test_a_sample_waits_until_what_tells_its_velocity_has_come_and_no_longer():
    log, _ = swinging(200.0, 2.0)
    for k, number, sample in through(list(log)):
        if k < len(log):
            assert log.t[k] >= sample.t + AROUND > log.t[k - 1]
        else:
            assert sample.t > log.t[-1] - AROUND
            assert number < k


def test_a_stretch_ends_where_the_clock_jumps_or_pauses_and_the_next_begins_anew():
    """Positions are 3 rad apart: one that was told across would be off by far."""
    t = np.arange(100) / 100.0
    q = 0.4 * t[:, None] * [1.0, -1.0]
    dq = np.tile([0.4, -0.4], (100, 1))
    for start in (t[-1] + 0.3, t[-1] - 5.0):
        samples = [Sample(*x) for x in zip(t, q, dq, dq, strict=True)]
        samples += [Sample(*x) for x in zip(t + start, q + 3.0, dq, dq, strict=True)]
        out = through(samples)
        assert [number for _, number, _ in out] == list(range(200))
        np.testing.assert_allclose([s.dq for _, _, s in out], np.tile(dq, (2, 1)), atol=1e-6)


@pytest.mark.parametrize("bad", [None, "x", [0.0], [np.nan, 0.0], [1.0, 2.0, 3.0]])
def test_what_is_no_sample_is_handed_on_in_its_turn_and_the_others_are_told_as_without_it(bad):
    log, _ = swinging(200.0, 1.0)
    samples, without = list(log), [s for k, s in enumerate(log) if k != 100]
    samples[100] = samples[100]._replace(dq=bad)
    out = through(samples)
    assert [number for _, number, _ in out] == list(range(len(log)))
    assert out[100][2].dq is bad
    told = [s.dq for k, (_, _, s) in enumerate(out) if k != 100]  # one had not waited for the sample after the bad one
    np.testing.assert_allclose(told, [s.dq for _, _, s in through(without)], atol=0.1 * NOISE)


def test_angles_that_are_counted_anew_after_a_turn_are_told_as_if_they_went_on():
    t = np.arange(400) / 200.0
    q = np.outer(t, [2.0, -2.5])
    log = Recording(t, q, [2.0, -2.5] + NOISE * np.random.default_rng(1).normal(size=q.shape), np.zeros_like(q))
    wrapped = Recording(t, np.mod(q + np.pi, 2.0 * np.pi) - np.pi, log.dq, log.tau)
    assert np.abs(np.diff(wrapped.q, axis=0)).max() > 6.0
    out = through(list(wrapped))
    np.testing.assert_allclose([s.dq for _, _, s in out], [s.dq for _, _, s in through(list(log))], atol=1e-9)
    assert all(np.array_equal(s.q, wrapped.q[k]) for _, k, s in out)


def test_samples_that_come_twice_tell_nothing_more():
    log, _ = swinging(200.0, 1.0)
    once, twice = through(list(log)), through([s for s in log for _ in range(2)])
    assert [number for _, number, _ in twice] == list(range(2 * len(log)))
    np.testing.assert_array_equal([s.dq for _, _, s in twice[::2]], [s.dq for _, _, s in once])


def test_a_clock_that_stands_still_holds_nothing_back():
    log, _ = swinging(200.0, 0.5)
    steadying, out = Steadying(2), []
    for k, sample in enumerate([*log, *1000 * [list(log)[-1]]]):
        out += [number for _, number in steadying.take(sample, k)]
        assert len(out) >= k + 1 - (3 if k > len(log) + 3 else 20)
    assert out == list(range(len(out)))


@pytest.mark.parametrize("t", [None, np.nan, "x"])
def test_a_sample_without_a_time_waits_for_nobody(t):
    log, _ = swinging(200.0, 1.0)
    samples = list(log)
    samples[100] = samples[100]._replace(t=t)
    out = through(samples)
    assert [number for _, number, _ in out] == list(range(len(log)))
    assert out[100][0] == 100


@pytest.mark.full  # some seconds
def test_more_samples_than_were_made_room_for_are_kept():
    """At 8 kHz 75 ms are 600 samples to either side."""
    log, truth = swinging(8000.0, 0.25)
    assert _ROWS < 2 * 8000.0 * AROUND
    dq = np.array([s.dq for _, _, s in through(list(log))])
    assert np.sqrt(np.mean((dq - truth) ** 2)) < 0.1 * NOISE


def test_a_position_that_has_no_other_near_tells_no_velocity():
    """As of a bag that is played slowly: it may move, or not, and 0 would be believed."""
    log, _ = swinging(30.0, 0.5)
    steadying = Steadying(2, alone=True)
    for sample in log:
        held, ((told, _),) = steadying.take(sample), steadying.flush()
        assert held == []
        assert np.isnan(told.dq).all()

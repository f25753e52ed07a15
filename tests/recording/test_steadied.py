"""Velocities that positions and velocities tell together: less noise, the same motion."""

from __future__ import annotations

import numpy as np
import pytest

from armload import Recording
from armload.recording import steadied
from armload.recording.recording import BLOCK
from armload.recording.spooled import spooled

NOISE = 2e-3  # [rad/s], as of real arms


def swinging(rate: float, hertz: float = 0.5, noise: float = NOISE, count: int | None = None) -> tuple:
    """Two joints that swing by 0.3 rad, and their true velocities."""
    rng, count = np.random.default_rng(5), count or round(6.0 * rate)
    t = (np.arange(count) + 0.2 * rng.uniform(size=count)) / rate
    phase = 2.0 * np.pi * hertz * t[:, None] + [0.0, 1.0]
    q, dq = 0.3 * np.sin(phase), 0.6 * np.pi * hertz * np.cos(phase)
    q = q + noise / 200.0 * rng.normal(size=q.shape)
    return Recording(t, q, dq + noise * rng.normal(size=q.shape), np.zeros_like(q)), dq


@pytest.mark.parametrize(("rate", "left"), [(100.0, 0.4), (200.0, 0.3), (1000.0, 0.15)])
def test_velocities_told_by_both_channels_have_a_third_of_the_noise_and_all_of_the_motion(rate, left):
    log, truth = swinging(rate)
    assert np.sqrt(np.mean((steadied(log).dq - truth) ** 2)) < left * NOISE


@pytest.mark.parametrize("hertz", [0.3, 1.0, 2.0])
def test_a_motion_of_two_hertz_is_followed_within_one_per_cent(hertz):
    log, truth = swinging(200.0, hertz, noise=0.0)
    assert np.abs(steadied(log).dq - truth).max() < 0.01 * np.abs(truth).max()


def test_nothing_is_told_across_a_gap():
    """Of two stretches that contradict each other, each keeps its own velocity."""
    t = np.r_[np.arange(100), np.arange(112, 212)] / 100.0
    dq = np.repeat([[0.4], [-0.4]], 100, axis=0)
    log = Recording(t, np.r_[0.4 * t[:100], 3.0 - 0.4 * t[100:]][:, None], dq, dq)
    np.testing.assert_allclose(steadied(log).dq, dq, atol=1e-6)


def test_a_joint_that_stands_is_still_at_rest():
    t = np.arange(0.0, 2.0, 0.01)
    still = Recording(t, np.full((200, 2), 0.3), np.zeros((200, 2)), np.zeros((200, 2)))
    assert np.abs(steadied(still).dq).max() < 1e-8


@pytest.mark.parametrize("noise", [1e-3, 1e-12])
def test_samples_that_are_alone_keep_their_velocity(noise):
    """However much surer the positions are."""
    rng = np.random.default_rng(2)
    t = 0.09 * np.arange(20)  # farther apart than what is taken together
    q, dq = 0.3 + noise * rng.normal(size=(20, 2)), 0.1 * rng.normal(size=(20, 2))
    np.testing.assert_allclose(steadied(Recording(t, q, dq, dq)).dq, dq, rtol=1e-6)


def test_a_log_on_disk_has_the_same_velocities():
    log, _ = swinging(1000.0, count=2 * BLOCK + 100)
    disk = spooled([log.select(slice(0, 1000)), log.select(slice(1000, len(log)))], "log")
    found = steadied(disk)
    np.testing.assert_array_equal(np.asarray(found.dq), steadied(log).dq)
    np.testing.assert_array_equal(np.asarray(found.q), log.q)
    np.testing.assert_array_equal(found.select(slice(4000, 4300)).dq[:], steadied(log).dq[4000:4300])

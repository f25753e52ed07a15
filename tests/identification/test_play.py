"""Whether what is held slides between stops, against rigid bodies on either of them (Pinocchio)."""

from __future__ import annotations

import numpy as np
import pytest

from armload import arm
from armload.identification.play import AXES, play_within
from armload.inertia import InertialParameters
from armload.motion import random_motion
from armload.recording import Recording

MASS, SLIDES, CENTRE = 1.5, 0.004, np.array([0.01, -0.02, 0.09])


def log_of(panda, axis, slides, start=0.0):
    """A payload that rests on the stop that lies lower, in an arm that is as its model says, with a little noise."""
    motion = random_motion(panda, 8, duration=12.0)
    t = np.arange(1200) / 100.0
    q, dq, ddq = motion(t)
    R, p = panda.frame_pose(q)
    acceleration = np.gradient(np.gradient(p, t, axis=0), t, axis=0)
    down = np.einsum("nij,ni,j->n", R, panda.gravity - acceleration, axis) > 0.0
    torques = []
    for way in (-1.0, 1.0):
        body = InertialParameters.from_com(MASS, CENTRE + way * slides * axis, 3e-3 * np.eye(3))
        torques.append(panda.with_payload(body).torque(q, dq, ddq))
    tau = np.where(down[:, None], torques[1], torques[0])
    noise = 0.02 * np.random.default_rng(1).normal(size=tau.shape)
    return Recording(t + start, q, dq, tau + noise)


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def tare(panda):
    motion = random_motion(panda, 7, duration=12.0)
    t = np.arange(1200) / 100.0
    q, dq, ddq = motion(t)
    return Recording(t, q, dq, panda.torque(q, dq, ddq) + 0.02 * np.random.default_rng(2).normal(size=q.shape))


@pytest.mark.parametrize("k", [0, 4])
def test_what_slides_gains_twice_its_mass_times_its_play_along_its_axis(panda, tare, k):
    (loose,) = play_within(log_of(panda, AXES[k], SLIDES, 100.0), panda, [(0.0, 12.0)], tare)
    (firm,) = play_within(log_of(panda, AXES[k], 0.0, 100.0), panda, [(0.0, 12.0)], tare)
    gained = loose.moment[k] - firm.moment[k]  # the noise is the same
    assert gained == pytest.approx(2.0 * MASS * SLIDES, rel=0.3)
    assert loose.moment[k] > 3.0 * loose.std[k]
    assert np.all(np.abs(firm.moment[np.isfinite(firm.moment)]) < 4.0 * firm.std[np.isfinite(firm.moment)])


def test_an_axis_that_does_not_turn_over_tells_nothing(panda, tare):
    log = log_of(panda, AXES[0], SLIDES, 100.0)
    few = log.select(slice(0, 90))
    (found,) = play_within(few, panda, [(0.0, 0.9)], tare)
    assert np.isnan(found.moment).all()
    assert np.isnan(found.std).all()

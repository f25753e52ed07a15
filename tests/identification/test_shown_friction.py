"""Whose friction brakes and whose drives, of an arm that is known so well that its friction's shape is, too."""

from dataclasses import replace

import numpy as np
import pytest

from armload.arms import rated_effort
from armload.identification import identify
from armload.motion import random_motion
from armload.posterior import learn_profile
from armload.recording import Recording

_AS_MANY = 200.0  # times the logs that the profile is learned from: months of days


def _log(arm, seed, duration, sense):
    """The empty arm, whose friction is steeper than armload's and falls from a peak at 0.05 rad/s (Stribeck)."""
    t, rng = np.arange(0.0, duration, 0.01), np.random.default_rng(seed)
    q, dq, ddq = random_motion(arm, seed, duration=duration)(t)
    effort = rated_effort(arm)
    friction = 3e-3 * effort * (1.0 + 0.3 * np.exp(-((dq / 0.05) ** 2))) * np.tanh(dq / 0.005)
    noise = 4e-4 * effort * rng.normal(size=q.shape)
    tau = arm.torque(q, dq, ddq) + sense * friction + noise
    return Recording(t, q, dq + 1e-3 * rng.normal(size=q.shape), tau, source=f"log {seed}")


@pytest.mark.parametrize("sense", [1.0, -1.0], ids=["brakes", "drives"])
def test_friction_of_a_shape_that_many_logs_know_drives_no_joint_that_it_brakes(panda, sense):
    known = learn_profile(panda, [_log(panda, seed, 20.0, sense) for seed in range(2)])
    known = replace(known, A=_AS_MANY * known.A, b=_AS_MANY * known.b)
    answer = identify(_log(panda, 9, 6.0, sense), panda, profile=known)
    assert any("friction drives joints" in note for note in answer.notes) == (sense < 0.0)

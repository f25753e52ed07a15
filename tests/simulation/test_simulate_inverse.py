"""Logs by inverse dynamics: they satisfy the same equation as those of the engine, and change what is held at once."""

from __future__ import annotations

import numpy as np
import pytest

from armload.errors import MotionError
from armload.motion import random_motion
from armload.payloads import test_payload as make_payload
from armload.simulation import World, simulate, simulate_inverse


def test_an_arm_that_follows_exactly_has_the_torques_that_mujoco_finds(panda):
    motion, payload = random_motion(panda, 4, duration=3.0), make_payload()
    engine = simulate(panda.with_payload(payload.parameters), motion, rate=100.0)  # its controller knows the payload
    inverse = simulate_inverse(panda, motion, [(0.0, payload)], rate=100.0, tracking=0.0)
    assert np.abs(engine.q - inverse.q).max() < 1e-5
    assert np.abs(engine.tau - inverse.tau).max() < 0.01


def test_velocity_and_acceleration_are_those_of_the_position(panda):
    motion, rate = random_motion(panda, 5, duration=2.0), 2000.0
    log = simulate_inverse(panda, motion, rate=rate, tracking=1e-2)
    assert np.abs(np.gradient(log.q, 1.0 / rate, axis=0) - log.dq)[1:-1].max() < 1e-4
    ddq = np.gradient(log.dq, 1.0 / rate, axis=0)
    assert np.abs(panda.torque(log.q, log.dq, ddq) - log.tau)[1:-1].max() < 0.02
    assert np.std(log.q - motion.position(log.t)) == pytest.approx(1e-2, rel=0.3)


def test_a_payload_is_there_from_its_time_on(panda):
    motion, payload = random_motion(panda, 6, duration=2.0), make_payload()
    empty, held, changed = (
        simulate_inverse(panda, motion, plan, rate=100.0, seed=3, world=World.real_like(panda, 1)).tau
        for plan in ([(0.0, None)], [(0.0, payload)], [(0.0, None), (1.0, payload)])
    )
    assert np.array_equal(changed, np.where(np.arange(200)[:, None] < 100, empty, held))


def test_a_motion_of_another_arm_is_refused(panda):
    from armload.arms import arm

    with pytest.raises(MotionError, match="moves 6 joints"):
        simulate_inverse(panda, random_motion(arm("ur10e"), 1, duration=2.0))

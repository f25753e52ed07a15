"""Sound logs that look wrong: friction that grows with the load, and velocities that are noisy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import identify
from armload.arms import arm
from armload.identification.choice import choose
from armload.identification.notes import ALLOWED, UNCHECKED
from armload.identification.segments import changes_of_payload
from armload.inertia import InertialParameters
from armload.lab.episodes.motion_kinds import MotionSource
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.posterior import HybridIdentifier
from armload.posterior.drift import CHANGED
from armload.simulation import Sensors, World, simulate

STEP = 2.0 * np.pi / 2.0**17  # [rad] of positions of 17 bits


def differenced(log):
    """The same log with coarse positions, and velocities that are their differences."""
    q = np.round(log.q / STEP) * STEP
    dq = np.gradient(q, log.t, axis=0)
    dq[1:] = np.diff(q, axis=0) / np.diff(log.t)[:, None]
    return replace(log, q=q, dq=dq).select(slice(1, None))


def logs_of(robot, k, share, rate, coarse, changed=0.0):
    """A run of 10 s with most of what the arm is rated for, a tare of 20 s, and what is held."""
    rng = np.random.default_rng([k, 8])
    world, places = World.real_like(robot, 900 + k), MotionSource(robot, 0.0)
    world = replace(world, friction=replace(world.friction, load=share * np.exp(0.4 * rng.normal(size=robot.n))))
    before = replace(world, offset=world.offset + changed * rng.normal(size=robot.n))
    motion = random_motion(robot, 60 + k, duration=10.0)
    about = places.draw("long", rng, 20.0, "tare", places.centre(motion), 0.3)
    drawn = draw_payload("boxes", k).parameters.phi
    body = InertialParameters(drawn * (0.8 * robot.rated_payload / drawn[0]))
    how = {"sensors": Sensors.of(robot), "rate": rate}
    run = simulate(robot, motion, body, world=world, seed=k, **how)
    tare = simulate(robot, about, world=before, seed=50 + k, **how)
    return (*(differenced(log) if coarse else log for log in (run, tare)), body.phi)


@pytest.mark.full  # some seconds
@pytest.mark.parametrize(
    ("name", "share", "rate", "coarse"),
    [("panda", 0.02, 200.0, False), ("gen3", 0.01, 100.0, True)],
)
def test_sound_logs_of_rubbing_joints_and_noisy_velocities_are_not_called_changed(name, share, rate, coarse):
    robot, again = arm(name), 0
    for k in range(2):
        run, tare, truth = logs_of(robot, k, share, rate, coarse)
        answer = identify(run, robot, tare=tare)
        again += ALLOWED in answer.notes
        assert answer.phi_low[0] <= truth[0] <= answer.phi_high[0]
        assert answer.interval == "calibrated", answer.notes
        assert len(answer.segments) == 1
    assert again >= 1  # as they were read first, they were doubted


@pytest.mark.full  # some seconds
def test_an_arm_that_changed_since_its_tare_is_not_explained_by_its_rubbing():
    robot = arm("panda")
    run, tare, _ = logs_of(robot, 1, 0.005, 200.0, False, changed=0.5)
    answer = identify(run, robot, tare=tare)
    assert answer.interval == "approximate"
    assert any("not as it was at its tare" in note for note in answer.notes)
    assert ALLOWED not in answer.notes


@pytest.mark.parametrize("k", [2, pytest.param(4, marks=pytest.mark.full)])
@pytest.mark.full  # some seconds
def test_joints_that_rub_more_for_what_was_added_are_no_arm_that_changed_and_hide_none(k):
    """As of a stream, which is not read twice."""
    robot, found = arm("gen3"), {}
    for changed in (0.0, 0.4):
        run, tare, _ = logs_of(robot, k, 0.01, 200.0, False, changed)
        identifier = choose(robot, tare, live=True).identifier
        assert isinstance(identifier, HybridIdentifier)
        identifier.run(run)
        found[changed] = identifier.stream.drift
    assert found[0.0].statistic > CHANGED
    assert not found[0.0].changed
    assert found[0.4].changed


@pytest.mark.full  # some seconds
def test_real_velocities_that_are_differences_of_unsteady_positions_are_not_taken_for_another_arm(real_data):
    """Those of the KUKA jump by a fifth from sample to sample."""
    answer = identify(real_data / "kuka_lwr_100hz.csv", "iiwa14")
    assert ALLOWED in answer.notes
    assert not any("differ from those of iiwa14" in note for note in answer.notes)
    assert answer.interval == "approximate"  # of what no tare stands beside
    assert UNCHECKED in answer.notes


@pytest.mark.full  # some seconds
@pytest.mark.parametrize(("rate", "k"), [(100.0, 0), (50.0, 4)])
def test_vibration_that_a_slow_log_folds_is_no_change_and_hides_none(rate, k):
    """15–120 Hz, seen at 50 or 100 Hz, is white noise of all of its power."""
    robot = arm("panda")
    run, tare, _ = logs_of(robot, k, 0.0, rate, False)
    sound = changes_of_payload(run, robot, tare, kappa=1.0)
    assert not sound.doubted
    half = run.t[0] + 0.5 * run.duration
    light = robot.with_payload(InertialParameters([0.3, 0.0, 0.0, 0.015, *np.zeros(6)]))
    less = np.where(run.t[:, None] < half, light.torque(run.q) - robot.torque(run.q), 0.0)
    found = changes_of_payload(replace(run, tau=run.tau - less), robot, tare, kappa=1.0)
    assert found.times == [pytest.approx(half, abs=0.2)]

"""A log of very many poses: the arm's smooth mismatch is sought among more functions."""

from functools import cache

import numpy as np
import pytest

from armload import identify
from armload.arms import arm
from armload.identification.many_poses import more_features
from armload.lab.episodes.motion_kinds import KINDS, MotionSource
from armload.motion import random_motion, taie2024
from armload.motion.collision import capsule_arm
from armload.motion.point_to_point import PointToPoint
from armload.motion.random_fourier import clear_poses
from armload.recording import Recording
from armload.regression.features import JointFeatures, distinct_poses
from armload.simulation import Sensors, World, simulate

SEED, SECONDS = 70102, 60.0


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


def everywhere(panda, seconds):
    """From clear pose to clear pose in all of the joints' range with stops, each way at most half of the limits."""
    rng, limits = np.random.default_rng([SEED, 3]), panda.limits
    poses = clear_poses(panda, capsule_arm(panda), rng, 0.0, 400, 0.05, 0.01)
    far = np.abs(np.diff(poses, axis=0))
    ways = 2.0 * far / (0.5 * limits.velocity), np.sqrt(6.0 * far / (0.5 * limits.acceleration))
    lasting = np.max(
        [*(way.max(axis=1) for way in ways), np.cbrt(48.0 * far / (0.5 * limits.jerk)).max(axis=1)], axis=0
    )
    ends = 0.2 + np.cumsum(lasting + 0.2)
    count = int(np.searchsorted(ends, seconds)) + 1
    return PointToPoint(poses[: count + 1], (ends - lasting)[:count], ends[:count], 0.5, "everywhere")


def of(panda, motion, seconds):
    t = np.linspace(0.0, seconds, 2000)
    return Recording(t, *motion(t)[:2], np.zeros((len(t), panda.n)))


def test_distinct_poses_are_the_poses_far_from_each_other_however_often_they_are_seen():
    far = 9.0 * np.eye(7)
    assert distinct_poses(far) == pytest.approx(7.0, abs=1e-6)
    assert distinct_poses(np.repeat(far, 5, axis=0)) == pytest.approx(7.0, abs=1e-6)


def test_the_functions_of_the_pose_have_the_kernel_that_poses_are_told_apart_by():
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (60, 7))
    f = JointFeatures(7, 20_000).of_pose(q)
    kernel = f @ f.T / np.mean(np.sum(f**2, axis=1))
    assert len(q) ** 2 / (kernel**2).sum() == pytest.approx(distinct_poses(q), rel=0.02)


def test_only_a_log_of_very_many_poses_is_one(panda):
    source = MotionSource(panda)
    motions = [taie2024(), *(random_motion(panda, seed) for seed in range(3))]
    motions += [source.draw(kind, np.random.default_rng(seed), 60.0) for kind in KINDS for seed in range(3)]
    logs = [of(panda, motion, motion.duration) for motion in motions]
    assert not any(more_features(log, panda) for log in logs)
    assert min(distinct_poses(log.q[::5]) for log in logs) >= 1.0
    assert max(distinct_poses(log.q[::5]) for log in logs) < 6.3
    assert distinct_poses(of(panda, everywhere(panda, SECONDS), SECONDS).q[::5]) > 13.5
    assert more_features(of(panda, everywhere(panda, SECONDS), SECONDS), panda) == JointFeatures(7, 384)


@cache
def logs(other):
    """The tare of an arm, or another's, and a minute of it empty in poses everywhere."""
    panda = arm("panda")
    how = {"sensors": Sensors.panda(panda), "rate": 100.0}
    world = World.real_like(panda, SEED)
    tare_of = World.real_like(panda, SEED + 50) if other else world
    tare = simulate(panda, random_motion(panda, SEED, duration=20.0), world=tare_of, seed=1, **how)
    return tare, simulate(panda, everywhere(panda, SECONDS), world=world, duration=SECONDS, seed=2, **how)


@pytest.mark.full  # half a minute
def test_a_sound_log_of_very_many_poses_is_not_said_to_be_of_another_arm(panda):
    tare, log = logs(other=False)
    answer = identify(log, panda, tare=tare)
    assert answer.interval == "calibrated"
    assert answer.phi_low[0] <= 0.0 <= answer.phi_high[0]
    assert any("so many poses" in note for note in answer.notes)


@pytest.mark.full  # half a minute
def test_another_arm_s_tare_is_noticed_in_a_log_of_very_many_poses_too(panda):
    tare, log = logs(other=True)
    answer = identify(log, panda, tare=tare)
    assert answer.interval == "approximate"
    assert any("not as it was at its tare" in note for note in answer.notes)

"""Gravity is not believed where the torques show another one: a base that leans is found, answered for and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats

from armload import arm
from armload.arms import Arm
from armload.arms.momentum_row import MomentumRow, leaning_row
from armload.identification import identify
from armload.identification.arm_notes import gravity_doubted
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.online import OnlineIdentifier
from armload.posterior import HybridIdentifier
from armload.posterior.scales import Tilt
from armload.regression import Correction

ANGLES = np.radians([3.0, -4.0])  # 5° together


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


def logs_of(robot, actual, population="reference", count=2):
    drawn = draw_episodes(robot, population, count, seed=81, motions=2)
    return list(simulate_episodes([replace(e, arm=actual) for e in drawn]))


@pytest.fixture(scope="module")
def leaning(panda):
    return logs_of(panda, panda.leaning(ANGLES))


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (0.0, 9.81, 0.0), (-3.0, 2.0, -9.0)])
def test_gravity_is_turned_about_two_axes_normal_to_it(gravity):
    robot = arm("panda", gravity=gravity)
    g, axes = np.array(gravity), robot.horizontal
    np.testing.assert_allclose(axes @ g, 0.0, atol=1e-12)
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-12)
    turned = np.array(robot.leaning(ANGLES).gravity)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(g))
    assert np.degrees(np.arccos(turned @ g / (g @ g))) == pytest.approx(5.0)
    np.testing.assert_allclose(turned - g, ANGLES @ np.cross(axes, g), atol=0.05)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_the_tilt_s_columns_are_the_derivative_of_the_arm_s_own_torque(name):
    robot, rng = arm(name, gravity=(1.0, -3.0, -9.0)), np.random.default_rng(0)
    q = rng.uniform(-2.0, 2.0, (5, robot.n))
    step = 1e-5
    by_difference = [
        (robot.leaning(step * a).torque(q) - robot.leaning(-step * a).torque(q)) / (2 * step) for a in np.eye(2)
    ]
    ours = Correction(robot, robot.limits.effort)
    drift = ours.regressor(q, np.zeros_like(q), np.zeros_like(q)).drift[:, :, ours.tilt]
    np.testing.assert_allclose(drift, np.stack(by_difference, axis=2), atol=1e-6)
    turned, links = np.cross(robot.horizontal, robot.gravity), np.ascontiguousarray(robot.link_parameters.ravel())
    for pose, expected in zip(q, drift, strict=True):
        row = leaning_row(*MomentumRow(robot).chain[:4], turned, links, pose)
        np.testing.assert_allclose(row, expected, atol=1e-9)


def test_gravity_is_believed_until_somebody_asks(panda):
    ours = Correction(panda, panda.limits.effort)
    assert not ours.prior_std[ours.tilt].any()
    assert not ours.adaptive[ours.tilt].any()


@pytest.mark.full  # some seconds
def test_a_base_that_leans_is_found_and_answered_for(panda, leaning):
    """The answer is, but for the last of the angle, what the right gravity gives; and it is said what to pass."""
    for log in leaning:
        answer = identify(log.run, panda, tare=log.tare)
        told = identify(log.run, panda.leaning(ANGLES), tare=log.tare)
        assert answer.interval == "approximate"
        assert told.interval == "calibrated"
        assert answer.notes[0].startswith("the base leans by ")
        assert len(answer.segments) == 1  # a base that leans looks like a payload that changes, from pose to pose
        assert not any("the payload" in note for note in answer.notes)
        gravity = [float(x) for x in answer.notes[0].split("--gravity=")[1].split(" ")[0].rstrip(",").split(",")]
        np.testing.assert_allclose(gravity, panda.leaning(ANGLES).gravity, atol=9.81 * np.radians(0.6))
        half = 0.5 * (told.phi_high - told.phi_low)
        assert np.all(np.abs(answer.phi - told.phi)[:4] < 0.5 * half[:4])


@pytest.mark.full  # some seconds
def test_a_base_that_leans_is_found_without_a_tare(panda):
    (log,) = logs_of(panda, panda.leaning(ANGLES), "untared", 1)
    answer = identify(log.run, panda)
    assert answer.notes[0].startswith("the base leans by ")
    told = identify(log.run, panda.leaning(ANGLES))
    assert told.phi_low[0] < answer.mass < told.phi_high[0]


@pytest.mark.full  # some seconds
def test_gravity_as_it_is_is_not_doubted(panda):
    for population in ("reference", "untared"):
        for log in logs_of(panda, panda, population):
            identifier = HybridIdentifier(panda, log.tare)
            identifier.run(log.run)
            tilt = identifier.stream.tilt
            assert not tilt.found
            assert np.degrees(np.linalg.norm(tilt.angles)) < 1.5


def test_a_concluded_stream_says_that_the_base_leans(panda, leaning):
    log = leaning[0]
    online = OnlineIdentifier(panda, log.tare)
    for sample in log.run.between(0.0, 3.0):
        online.update(*sample)
    said = online.conclude()
    online.close()
    assert said.interval == "approximate"
    assert any(note.startswith("the base leans by ") for note in said.notes)


def test_a_stream_says_within_a_second_that_the_base_leans_and_goes_on_saying_it(panda, leaning):
    for log, leans in ((leaning[0], True), (logs_of(panda, panda, count=1)[0], False)):
        online = OnlineIdentifier(panda, log.tare)
        for sample in log.run.between(0.0, 3.0):
            said = online.update(*sample)
            if sample.t >= 1.0:
                assert (said.interval == "approximate") == leans
                assert any(note.startswith("the base leans by ") for note in said.notes) == leans
        online.close()


def test_friction_that_nobody_expects_is_no_base_that_leans():
    """Of gears, on an arm that is not known to measure motor currents, as those of a URDF are not."""
    for name in ("ur3e", "ur5e", "ur10e"):
        robot = arm(name)
        (log,) = logs_of(robot, robot, "untared", 1)
        stream = OnlineIdentifier(replace(robot, motor_torque=False))
        said = {note for sample in log.run.between(0.0, 3.0) for note in stream.update(*sample).notes}
        stream.close()
        assert not any("lean" in note for note in said), name


def test_the_gravity_of_a_base_that_leans_is_worked_out_once_for_each_solution(panda, leaning, monkeypatch):
    asked, turned = [], Arm.leaning
    monkeypatch.setattr(Arm, "leaning", lambda self, angles: asked.append(1) or turned(self, angles))
    stream = OnlineIdentifier(panda, leaning[0].tare)
    for sample in leaning[0].run.between(0.0, 3.0):
        said = stream.update(*sample)
    stream.close()
    assert any(note.startswith("the base leans by ") for note in said.notes)
    assert 0 < len(asked) <= stream.engine.stream.solutions + 1  # and once as restlessness is asked, too


def test_a_lean_in_doubt_is_said_beyond_what_a_level_base_shows_of_an_arm_whose_links_are_known(panda):
    level = float(scipy.stats.chi2(2).ppf(0.95))
    for share, said in ((0.99, False), (1.01, True)):
        tilt = Tilt(np.radians([1.5, 0.0]), share * level, False)
        assert (gravity_doubted(panda, tilt, "link") is not None) == said
        assert gravity_doubted(panda, tilt, "motor") is None  # friction holds a joint as gravity does
        assert (
            gravity_doubted(arm("iiwa14"), tilt, "link") is None
        )  # so do links of which only nominal figures are known
    assert "by about 1.5°" in (gravity_doubted(panda, Tilt(np.radians([1.5, 0.0]), 9.0, False), "link") or "")


@pytest.mark.full  # some seconds
def test_a_base_that_may_lean_is_said_and_no_answer_of_it_is_called_calibrated(panda):
    for log in logs_of(panda, panda.leaning(np.radians([1.2, -1.6])), count=4):  # 2° together
        answer = identify(log.run, panda, tare=log.tare)
        assert answer.interval == "approximate"
        assert any("lean" in note for note in answer.notes)

"""Episodes: what a population promises holds for what is drawn, and their logs are those of the parts they name."""

from dataclasses import replace

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import ArmError, MotionError
from armload.inertia import is_consistent
from armload.lab.episodes import POPULATIONS, Recipe, draw_episodes, simulate_episodes
from armload.lab.episodes.motion_kinds import KINDS, MotionSource
from armload.lab.training.hybrid import FAMILIES as PRIOR_FAMILIES
from armload.motion import FourierMotion, check_motion, rated_load
from armload.motion.blended import BlendedMotion
from armload.motion.point_to_point import PointToPoint
from armload.payloads import random_payload
from armload.regression import FilteredRegression
from armload.simulation import Resolution, Sensors, World, simulate

SHORT = {"duration": 0.5, "tare_duration": 0.5}


def test_a_blend_starts_and_ends_at_rest_and_leaves_the_rest_alone():
    rng = np.random.default_rng(0)
    inner = FourierMotion(np.ones(3), *rng.normal(size=(2, 3, 5)), period=6.0)
    motion = BlendedMotion(inner, 6.5, blend=0.5)
    q, dq, ddq = motion([0.0, 6.5])
    np.testing.assert_allclose(q, inner.derivative(np.array([0.0, 6.5]), 0))
    np.testing.assert_allclose(np.concatenate([dq, ddq]), 0.0, atol=1e-12)
    t = np.linspace(0.5, 5.99, 50)
    np.testing.assert_allclose(motion(t), inner(t), atol=1e-12)


def test_a_blend_s_derivatives_are_those_of_its_positions():
    rng = np.random.default_rng(1)
    motion = BlendedMotion(FourierMotion(np.zeros(2), *rng.normal(size=(2, 2, 4)), period=4.0), 4.5)
    t, h = np.linspace(0.01, 4.49, 400), 1e-5
    for order in range(3):
        slope = (motion.derivative(t + h, order) - motion.derivative(t - h, order)) / (2 * h)
        exact = motion.derivative(t, order + 1)
        np.testing.assert_allclose(slope, exact, rtol=0, atol=1e-5 * np.abs(exact).max())


def test_an_episode_s_logs_are_the_simulations_of_its_parts(panda):
    drawn = [replace(e, **SHORT) for e in draw_episodes(panda, "reference", 2, seed=4)]
    for episode, (run, tare, truth) in zip(
        drawn, simulate_episodes(drawn, rate=100.0, resolution=Resolution()), strict=True
    ):
        single = simulate(
            panda,
            episode.motion,
            episode.payload,
            world=episode.world,
            sensors=episode.sensors,
            rate=100.0,
            duration=0.5,
            seed=episode.seed,
        )
        np.testing.assert_allclose(run.tau, single.tau, atol=1e-9)
        np.testing.assert_array_equal(truth.phi, episode.payload.parameters.phi)
        assert truth.frame == panda.frame
        assert tare is not None
        assert np.abs(tare.q[0] - episode.tare_motion([0.0])[0]).max() < 0.02


@pytest.mark.full  # some seconds
def test_processes_give_what_one_process_gives(panda):
    drawn = [replace(e, **SHORT) for e in draw_episodes(panda, "reference", 10, seed=2, motions=2)]
    one, two = (list(simulate_episodes(drawn, rate=100.0, workers=w)) for w in (1, 2))
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.run.tau, b.run.tau)
        np.testing.assert_array_equal(a.truth.phi, b.truth.phi)


def test_a_longer_draw_begins_with_the_shorter_one(panda):
    few, more = (draw_episodes(panda, "reference", count, seed=3) for count in (2, 3))
    for a, b in zip(few, more, strict=False):
        assert a.world.fingerprint == b.world.fingerprint
        np.testing.assert_array_equal(a.motion([1.0])[0], b.motion([1.0])[0])
        np.testing.assert_array_equal(a.payload.parameters.phi, b.payload.parameters.phi)


def test_an_unknown_population_is_named():
    with pytest.raises(ArmError, match="no population is called 'mars'"):
        draw_episodes(arm("panda"), "mars", 1, 0)


# ---------------------------------------------------------------- motions


def test_point_to_point_derivatives_are_those_of_its_positions_and_it_stops_at_every_pose():
    rng = np.random.default_rng(0)
    starts, ends = np.array([0.2, 1.5, 2.5]), np.array([1.2, 2.5, 4.0])
    motion = PointToPoint(rng.normal(size=(4, 2)), starts, ends, ramp=0.3)
    np.testing.assert_allclose(motion(np.append(0.0, ends))[0], motion.poses, atol=1e-12)
    for order in (1, 2):
        np.testing.assert_allclose(motion.derivative(np.concatenate([starts, ends]), order), 0.0, atol=1e-12)
    t, h = np.linspace(0.013, 3.987, 500), 1e-5
    for order in range(3):
        slope = (motion.derivative(t + h, order) - motion.derivative(t - h, order)) / (2 * h)
        exact = motion.derivative(t, order + 1)
        np.testing.assert_allclose(slope, exact, rtol=0, atol=1e-3 * np.abs(exact).max())


def test_impossible_segments_are_refused():
    poses = np.zeros((3, 2))
    with pytest.raises(MotionError, match="leaves a pose before it is there"):
        PointToPoint(poses, np.array([0.0, 0.5]), np.array([1.0, 2.0]))
    with pytest.raises(MotionError, match="expected \\(S \\+ 1, n\\)"):
        PointToPoint(poses, np.array([0.0]), np.array([1.0]))


@pytest.mark.parametrize("kind", KINDS)
def test_the_arm_may_run_every_kind_of_motion_with_its_rated_payload(some_arm, kind):
    motion = MotionSource(some_arm).draw(kind, np.random.default_rng(3), 6.0)
    assert check_motion(some_arm, motion, rated_load(some_arm)).ok
    moved = np.ptp(motion(np.linspace(0, 6, 200))[0], axis=0) > 0.02
    assert np.any(moved)
    assert np.all(moved) == (kind != "partial")


def test_a_tare_moves_near_the_run_unless_it_is_elsewhere(panda):
    source = MotionSource(panda)
    apart = {
        name: [
            np.abs(source.centre(e.motion) - source.centre(e.tare_motion)).mean()
            for e in draw_episodes(panda, name, 8, seed=1)
        ]
        for name in ("reference", "elsewhere", "same-motion")
    }
    assert 0.1 < np.mean(apart["reference"]) < 0.4 < np.mean(apart["elsewhere"])
    assert np.all(np.array(apart["same-motion"]) == 0)


# ---------------------------------------------------------------- populations


@pytest.mark.parametrize("name", sorted(POPULATIONS))
def test_what_an_episode_carries_is_a_body_the_arm_is_rated_for(panda, name):
    recipe = replace(
        POPULATIONS[name], motions=("point-to-point",), untared=1.0
    )  # found at once; what is held is the same
    for episode in draw_episodes(panda, recipe, 12, seed=7, motions=1):
        carried = [p for p in (episode.payload, episode.tool) if p is not None]
        assert sum(p.parameters.mass for p in carried) <= panda.rated_payload
        assert all(is_consistent(p.parameters.phi) for p in carried if p.parameters.mass > 0)


def test_training_sees_nothing_of_the_odd_payloads():
    assert POPULATIONS["odd"].payloads == ("odd",)
    assert "odd" not in POPULATIONS["broad"].payloads
    assert "odd" not in PRIOR_FAMILIES


def test_broad_holds_every_kind_of_episode(panda):
    drawn = draw_episodes(panda, "broad", 150, seed=0, motions=6)
    assert {e.world.name for e in drawn} == {"real-like", "beyond", "beyond, motor side"}
    assert {e.payload.name.split()[0] for e in drawn} >= {"random", "shapes", "tools", "container", "nothing"}
    assert {e.rate for e in drawn} == {100.0, 200.0, 500.0, 1000.0}
    untared = np.mean([e.tare_motion is None for e in drawn])
    tools = np.mean([e.tool is not None for e in drawn])
    assert 0.2 < untared < 0.4
    assert 0.1 < tools < 0.3
    assert any(e.tare_motion is e.motion for e in drawn)


def test_a_mounted_tool_is_in_both_runs_and_not_in_the_answer(panda):
    drawn = draw_episodes(panda, "tool", 1, seed=5)[0]
    quiet = replace(drawn, world=World.nominal(panda), sensors=Sensors.ideal(), duration=6.0, tare_duration=8.0)
    ((run, tare, truth),) = simulate_episodes([quiet], rate=200.0)
    for log, expected in ((run, drawn.tool.parameters.mass + truth.mass), (tare, drawn.tool.parameters.mass)):
        r, W = FilteredRegression(panda)(log.t, log.q, log.dq, log.tau)
        found = np.linalg.lstsq(W.reshape(-1, 10), r.ravel(), rcond=None)[0]
        assert found[0] == pytest.approx(expected, rel=5e-3)
    np.testing.assert_array_equal(truth.phi, drawn.payload.parameters.phi)
    without_tare = replace(drawn, tare_motion=None)
    np.testing.assert_allclose(without_tare.truth.phi, drawn.payload.parameters.phi + drawn.tool.parameters.phi)


def test_the_reference_world_payload_and_sensors_are_the_ones_results_rest_on(panda):
    for episode in draw_episodes(panda, "reference", 3, seed=9):
        assert episode.world.fingerprint == World.real_like(panda, episode.world.seed).fingerprint
        seed = int(episode.payload.name.split()[1])
        np.testing.assert_array_equal(episode.payload.parameters.phi, random_payload(seed).parameters.phi)
        np.testing.assert_array_equal(episode.sensors.torque_noise, Sensors.panda(panda).torque_noise)


def test_a_recipe_of_nothing_known_is_refused():
    with pytest.raises(ArmError, match="payloads of the recipe are"):
        Recipe(payloads=("cats",))
    with pytest.raises(MotionError, match="no kind of motion"):
        MotionSource(arm("panda")).draw("dance", np.random.default_rng(0), 1.0)

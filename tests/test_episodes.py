"""Episodes: what a population promises holds for what is drawn, and their logs are those of the parts they name."""

from dataclasses import replace

import numpy as np
import pytest

from armload.arms import arm
from armload.episodes import draw_episodes, simulate_episodes
from armload.errors import ArmError
from armload.motion import FourierMotion
from armload.motion.blended import BlendedMotion
from armload.simulate import Resolution, simulate

SHORT = {"duration": 0.5, "tare_duration": 0.5}


def test_a_blend_starts_and_ends_at_rest_and_leaves_the_rest_alone():
    rng = np.random.default_rng(0)
    inner = FourierMotion(np.ones(3), *rng.normal(size=(2, 3, 5)), period=6.0)
    motion = BlendedMotion(inner, 6.5, blend=0.5)
    q, dq, ddq = motion([0.0, 6.5])
    np.testing.assert_allclose(q, inner([0.0, 0.0])[0] * [[1], [0]] + inner.derivative(np.array([6.5]), 0) * [[0], [1]])
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
        alone = simulate(
            panda,
            episode.motion,
            episode.payload,
            world=episode.world,
            sensors=episode.sensors,
            rate=100.0,
            duration=0.5,
            seed=episode.seed,
        )
        np.testing.assert_allclose(run.tau, alone.tau, atol=1e-9)
        np.testing.assert_array_equal(truth.phi, episode.payload.parameters.phi)
        assert truth.frame == panda.frame
        assert tare is not None
        assert np.abs(tare.q[0] - episode.tare_motion([0.0])[0]).max() < 0.02


def test_processes_give_what_one_process_gives(panda):
    drawn = [replace(e, **SHORT) for e in draw_episodes(panda, "reference", 10, seed=2)]
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

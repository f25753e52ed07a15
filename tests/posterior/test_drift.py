"""A tare of another session: offsets and friction that have changed since are unknowns, found, allowed for and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm
from armload.arms import FRICTION_WIDTH
from armload.devices import Simulator
from armload.identification import identify
from armload.inertia import Z95
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.motion import random_motion
from armload.online import OnlineIdentifier
from armload.payloads import draw_payload
from armload.posterior import HybridIdentifier, SmoothPosteriorLeastSquares
from armload.posterior.drift import CHANGED
from armload.posterior.problem import Problem
from armload.regression import solution_prior_std
from armload.simulation import Sensors, World, simulate
from armload.simulation.friction import Friction

OFFSET = np.array([0.3, -0.3, 0.3, -0.3, 0.1, -0.1, 0.1])  # [N·m]


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


def logs_of(panda, changed, population="reference", count=2):
    """Episodes whose tare is of the arm as `changed` makes it."""
    drawn = draw_episodes(panda, population, count, seed=81, motions=3)
    return list(simulate_episodes([replace(e, tare_world=changed(e.world)) for e in drawn]))


@pytest.fixture(scope="module")
def old(panda):
    return logs_of(panda, lambda w: replace(w, offset=w.offset - OFFSET))


@pytest.fixture(scope="module")
def sound(panda):
    return logs_of(panda, lambda w: w)


def test_an_answer_allows_for_offsets_that_changed_since_the_tare_and_says_by_how_much(panda, old):
    error, inside = {True: [], False: []}, {True: [], False: []}
    for log in old:
        for tested in (True, False):
            identifier = HybridIdentifier(panda, log.tare)
            identifier.test_tare = tested
            estimate = identifier.run(log.run)
            error[tested].append(abs(estimate.phi[0] - log.truth.mass))
            inside[tested].append(np.abs(estimate.phi - log.truth.phi) <= Z95 * estimate.std)
            if tested:
                drift = identifier.stream.drift
                assert drift.changed
                assert drift.offset[:4] == pytest.approx(OFFSET[:4], abs=0.2)
    assert np.mean(error[True]) < 0.6 * np.mean(error[False])
    assert np.mean(inside[True]) > 0.8 > np.mean(inside[False])


def test_a_tare_of_another_arm_is_noticed(panda):
    for log in logs_of(panda, lambda w: World.real_like(panda, w.seed + 1)):
        identifier = HybridIdentifier(panda, log.tare)
        identifier.run(log.run)
        assert identifier.stream.drift.changed


@pytest.mark.full  # some seconds
def test_joints_that_rub_more_than_most_are_asked_and_motor_currents_are_not(panda):
    def rubbing(share, offset):
        friction = Friction(share * panda.limits.effort, np.full(panda.n, FRICTION_WIDTH))
        now = replace(episode.world, friction=friction)
        e = replace(episode, world=now, tare_world=replace(now, offset=now.offset - offset))
        return next(iter(simulate_episodes([e])))

    episode = draw_episodes(panda, "reference", 1, seed=81, motions=3)[0]
    found = {}
    for share, offset in ((0.015, OFFSET), (0.015, 0.0 * OFFSET), (0.06, OFFSET)):
        log = rubbing(share, offset)
        identifier = HybridIdentifier(panda, log.tare)
        identifier.run(log.run)
        assert identifier.posterior.torque == "motor"  # as far as the gain's width goes
        found[share, offset.any()] = identifier.stream.drift
    assert found[0.015, True].changed
    assert found[0.015, True].offset[:4] == pytest.approx(OFFSET[:4], abs=0.2)
    assert not found[0.015, False].changed
    assert found[0.06, True] is None


@pytest.mark.full  # some seconds
def test_an_arm_that_has_not_changed_is_answered_as_without_the_question(panda, sound):
    for log in sound:
        asked, silent = HybridIdentifier(panda, log.tare), HybridIdentifier(panda, log.tare)
        silent.test_tare = False
        assert np.array_equal(asked.run(log.run).phi, silent.run(log.run).phi)
        assert not asked.stream.drift.changed
        assert asked.stream.drift.statistic < 0.6 * CHANGED


@pytest.mark.full  # some seconds
def test_a_tare_of_known_age_is_worth_less_and_its_change_is_expected(panda, old, sound):
    for log in (*old, *sound):
        same_day, aged = HybridIdentifier(panda, log.tare), HybridIdentifier(panda, log.tare)
        aged.allow_for(3.0)
        same_day.test_tare = False
        assert aged.run(log.run).std[0] >= 0.99 * same_day.run(log.run).std[0]
        assert not aged.stream.drift.changed


def test_rows_one_by_one_give_the_posterior_of_the_accumulated_rows_with_a_drift(panda, old):
    log = old[0]
    identifier = SmoothPosteriorLeastSquares(panda, log.tare)
    identifier.allow_for(1.0)
    for _, sample in zip(range(400), log.run, strict=False):
        identifier.update(sample)
    stream = identifier.stream
    stream.hold()
    running = stream.information.copy(), stream.vector.copy()
    scales = stream.posterior.scales
    run = stream.accumulated()
    problem = Problem([*stream.tares, run], solution_prior_std(panda), identifier.prior, stream.noise)
    whole = problem.sequential(scales)
    assert running[0] == pytest.approx(whole.information, rel=1e-6, abs=1e-6 * np.abs(whole.information).max())
    assert running[1] == pytest.approx(whole.vector, rel=1e-6, abs=1e-6 * np.abs(whole.vector).max())


def test_the_mass_of_all_that_is_mounted_is_that_of_the_joint_posterior(panda, old):
    """phi_0 + phi of the Gaussian of all unknowns, in which none is eliminated first."""
    log = old[0]
    identifier = SmoothPosteriorLeastSquares(panda, log.tare)
    for _, sample in zip(range(400), log.run, strict=False):
        identifier.update(sample)
    stream = identifier.stream
    stream.hold()
    problem = Problem([*stream.tares, stream.accumulated()], solution_prior_std(panda), identifier.prior, stream.noise)
    whole, phi = problem.posterior(stream.posterior.scales), problem.last
    state = problem.sequential(stream.posterior.scales)
    mass, variance = state.mass_in_all(whole.mean[phi], whole.covariance[phi, phi])
    both = np.zeros(len(whole.mean))
    both[[0, phi.start]] = 1.0
    assert phi.start == 10
    assert mass == pytest.approx(both @ whole.mean, rel=1e-6)
    assert variance == pytest.approx(both @ whole.covariance @ both, rel=1e-4)


@pytest.mark.full  # some seconds
def test_a_stream_that_is_concluded_doubts_an_old_tare_as_a_log_does(panda, old):
    log = old[0]
    identifier = OnlineIdentifier(panda, log.tare)
    for sample in log.run:
        identifier.update(*sample)
    said, whole = identifier.conclude(), identify(log.run, panda, tare=log.tare)
    identifier.close()
    assert not said.calibrated
    assert whole.interval == "approximate"
    assert any("not as it was at its tare" in note for note in said.notes)
    assert said.phi == pytest.approx(whole.phi, rel=1e-6, abs=1e-9)


@pytest.mark.full  # some seconds
def test_a_stream_says_within_seconds_that_its_tare_is_old_and_nothing_of_a_sound_one(panda, sound):
    """Three of four old ones at least say so within six seconds; none of them is believed after five."""

    def old(world):
        friction = replace(world.friction, level=1.3 * world.friction.level)
        return replace(world, offset=world.offset - OFFSET, friction=friction)

    found = []
    for log, changed in (*((log, True) for log in logs_of(panda, old, count=4)), (sound[0], False)):
        online = OnlineIdentifier(panda, log.tare)
        said = [online.update(*sample) for sample in log.run]
        online.close()
        notes = {x for each in said for x in each.notes if x.startswith("the arm is not as it was at its tare")}
        assert all("the intervals do not allow for it" in note for note in notes)
        assert any(each.calibrated for each in said if each.t - log.run.t[0] >= 5.0) != changed
        found.append(bool(notes))
    assert sum(found[:-1]) >= 3
    assert not found[-1]


@pytest.mark.full  # some seconds
def test_what_was_found_of_the_arm_holds_for_the_next_payload(panda):
    now = World.real_like(panda, 8)
    then = replace(now, offset=now.offset + OFFSET, friction=replace(now.friction, level=1.3 * now.friction.level))
    about = {"sensors": Sensors.panda(panda), "rate": 200.0}
    tare = simulate(panda, random_motion(panda, 3), world=then, duration=20.0, **about)
    held = [(0.0, draw_payload("boxes", 1, 1.2)), (6.0, draw_payload("boxes", 2, 0.5))]
    source = Simulator(panda, random_motion(panda, 4), held, speed=None, duration=11.0, world=now, **about)
    stream, found = OnlineIdentifier(panda, tare), False
    for sample in source:
        said = stream.update(*sample)
        found = found or stream.arm_changed is not None
        assert stream.arm_changed is not None or not found
        assert not (found and said.calibrated)
    stream.close()
    assert said.event is not None
    assert found

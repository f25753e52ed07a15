"""Something off since the tare and something else on: the difference of two bodies is asked for, answered and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm
from armload.identification import identify
from armload.identification.reporting import doubt_of
from armload.inertia import Z95, InertialParameters
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.payloads import draw_payload, franka_hand
from armload.posterior import TRAITS, Evidence, HybridIdentifier, MixturePosterior, MixturePrior, shipped_model
from armload.posterior.hybrid import answer, holding_both
from armload.simulation import simulate


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def exchanged(panda):
    """(run, tare, truth): the hand was on at the tare, a payload is in the run; and the same on a bare arm."""
    drawn = draw_episodes(panda, "reference", 3, seed=300, motions=3)
    hand = franka_hand()
    tares = [logs.tare for logs in simulate_episodes([replace(e, tool=hand) for e in drawn])]
    runs = list(simulate_episodes(drawn))
    return [(a.run, tare, a.truth.phi - hand.parameters.phi) for a, tare in zip(runs, tares, strict=True)], runs


def test_the_difference_of_two_payloads_has_no_mean_and_twice_the_covariance(panda):
    prior = shipped_model(panda).prior.only("boxes", "shapes")
    both = prior.differences
    second = np.einsum("k,kij->ij", prior.weights, prior.covariances + prior.means[:, :, None] * prior.means[:, None])
    covariance = second - np.outer(prior.mean, prior.mean)
    np.testing.assert_allclose(both.mean / prior.std, 0.0, atol=1e-12)
    np.testing.assert_allclose(both.std, np.sqrt(2.0 * np.diag(covariance)))
    assert MixturePrior(np.ones(1), np.zeros((1, 10)), np.eye(10)[None], ("nothing",)).differences is None


def test_two_hypotheses_are_weighed_by_bayes_rule():
    """Oracle: draws of both, in the shares of their probabilities."""
    rng = np.random.default_rng(0)
    mean, root = np.linspace(0.0, 1.0, 10), np.diag(np.linspace(0.5, 1.0, 10))
    first = MixturePosterior(np.zeros(10), np.eye(10), np.ones(1), -3.0, 0.0)
    other = MixturePosterior(mean, root @ root, np.ones(1), -2.0, 0.0)
    found, share = first.or_else(other, odds=0.5)
    assert share == pytest.approx(0.5 * np.e / (1.0 + 0.5 * np.e))
    N = 200_000
    draws = np.where(rng.random((N, 1)) < share, mean + rng.normal(size=(N, 10)) @ root, rng.normal(size=(N, 10)))
    np.testing.assert_allclose(found.mean, draws.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(found.covariance, np.cov(draws.T), atol=0.02)


def test_intervals_that_hold_two_answers_hold_each_and_are_no_wider_than_that():
    rng = np.random.default_rng(1)
    root, other = rng.normal(size=(10, 10)), np.diag(rng.uniform(0.01, 30.0, 10))
    own, aside = root @ root.T, 2.0 * rng.normal(size=10)
    both = holding_both(own, aside, other)
    half, first, second = (Z95 * np.sqrt(np.diag(x)) for x in (both, own, other))
    np.testing.assert_allclose(half, np.maximum(first, np.abs(aside) + second))
    np.testing.assert_allclose(both / np.outer(half, half), own / np.outer(first, first))


@pytest.mark.parametrize(("kind", "off", "held"), [(1, True, True), (1, False, False), (0, True, False)])
def test_intervals_hold_an_exchange_that_fits_the_log_better_than_a_body(panda, kind, off, held):
    """Evidence of a box less a tool, beside a tare and without one, and of a box alone."""
    model = shipped_model(panda)
    payloads, std = model.prior_for(panda), np.array([5e-3] + [1e-3] * 3 + [2e-3] * 6)
    truth = draw_payload("boxes", 3, 3.0).parameters.phi - off * draw_payload("tools", 9, 1.0).parameters.phi
    information = np.diag(std**-2.0)
    evidence = Evidence(information, information @ truth, 0.0, np.zeros(len(TRAITS)), 6.0, kind)
    found = answer(evidence, model.calibration, payloads, False)
    other = payloads.differences.posterior(information, information @ truth)
    body = payloads.posterior(information, information @ truth)
    assert (0.0 < other.log_evidence - body.log_evidence < np.log(10.0)) == off
    std = np.sqrt(np.diag(model.calibration.widened(other, evidence, payloads)))
    low, high = (other.mean + s * Z95 * std for s in (-1, 1))
    half = Z95 * np.sqrt(np.diag(found.covariance))
    inside = (found.phi - half <= low + 1e-12) & (high <= found.phi + half + 1e-12)
    assert inside.all() == held


@pytest.mark.full  # some seconds
def test_what_was_exchanged_since_the_tare_is_covered_or_said(panda, exchanged):
    logs, _ = exchanged
    fine = []
    for run, tare, truth in logs:
        answer = identify(run, panda, tare=tare)
        inside = (answer.phi_low <= truth) & (truth <= answer.phi_high)
        fine.append(inside | (answer.interval == "approximate"))
    assert np.mean(fine) > 0.85


@pytest.mark.full
def test_a_difference_that_is_surely_no_body_is_answered_as_it_is_and_said(panda, exchanged):
    """A kilogram far off the flange for a hand of 0.7 kg: 0.3 kg whose centre lies 0.4 m away."""
    logs, runs = exchanged
    episode = draw_episodes(panda, "reference", 1, seed=300, motions=1)[0]
    payload = InertialParameters.from_com(1.0, (0.12, 0.0, 0.04), np.diag([2e-3, 2e-3, 2e-3]))
    how = {"world": episode.world, "sensors": episode.sensors, "rate": 200.0, "duration": 6.0}
    run = simulate(panda, episode.motion, payload, seed=1, **how)
    answer = identify(run, panda, tare=logs[0][1])
    truth = payload.phi - franka_hand().parameters.phi
    assert answer.interval == "approximate"
    assert any("something else put on" in note for note in answer.notes)
    assert not answer.consistent
    inside = (answer.phi_low <= truth) & (truth <= answer.phi_high)
    assert inside[:4].all()
    alone = identify(run, panda, tare=runs[0].tare)
    assert alone.interval == "calibrated"


@pytest.mark.full  # some seconds
def test_a_payload_on_a_bare_arm_is_not_called_an_exchange(panda, exchanged):
    for log in exchanged[1]:
        identifier = HybridIdentifier(panda, log.tare)
        identifier.run(log.run)
        assert not identifier.exchanged


@pytest.mark.parametrize(("since", "other"), [("tare", "profile"), ("profile", "since the tare")])
def test_an_exchange_is_said_to_be_since_what_was_given(since, other):
    said = doubt_of(True, True, None, 0.0, relative_to=since)
    assert f"taken off since the {since}" in said
    assert other not in said

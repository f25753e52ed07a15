"""The shipped excitation: within the Panda's limits, worth its name, and what its script makes."""

import json
from importlib import resources

import numpy as np
import pytest

from armload.arms import payload_regressor
from armload.motion import FourierMotion, check_motion, rated_load, taie2024
from armload.motion import design as d


def test_it_has_the_papers_form_and_says_that_it_is_ours():
    motion = taie2024()
    assert (motion.n, motion.harmonics, motion.period, motion.name) == (7, 8, 6.0, "taie2024")
    assert "Our own re-design" in motion.note
    assert str(d.SEED) in motion.note
    assert str(d.STEPS) in motion.note


def test_it_starts_and_ends_at_rest_to_the_last_printed_digit():
    text = resources.files("armload.motion").joinpath("motions/taie2024.json").read_text(encoding="utf-8")
    content = json.loads(text)
    k = np.arange(1, 9)
    for key, weight in (("sine", k), ("cosine", k**2)):
        steps = np.round(np.array(content[key]) * 1e5)
        np.testing.assert_allclose(steps / 1e5, content[key], rtol=0, atol=1e-12)  # printed in steps of 10 µrad
        np.testing.assert_array_equal(steps @ weight, 0.0)  # exact, in integers


def test_it_keeps_the_designs_margins_with_the_rated_payload(panda):
    check = check_motion(panda, taie2024(), rated_load(panda), rate=1000, collision_rate=500)
    assert rated_load(panda).mass == 3.0
    assert check.problems == []
    assert check.margin["position"].min() >= d.KEEP_OFF - 0.005
    for quantity in ("velocity", "acceleration", "jerk", "torque"):
        assert check.used(quantity).max() <= 0.9, quantity
    assert check.floor_clearance >= d.FLOOR - 0.005
    assert check.self_clearance >= d.SELF - 0.005


def test_it_moves_every_joint_and_never_the_payload_faster_than_planned(panda):
    t = np.linspace(0, 6, 2001)
    q, dq, _ = taie2024()(t)
    assert np.all(np.ptp(q, axis=0) > 0.5)
    p = panda.frame_pose(q)[1]
    speed = np.linalg.norm(np.diff(p, axis=0), axis=1) / np.diff(t)  # by finite differences, not the Jacobian
    assert 0.5 < speed.max() < d.TOOL_SPEED * 1.02
    assert np.abs(dq).max() > 1.0


def test_it_determines_all_ten_parameters_far_better_than_chance(panda):
    rng, k = np.random.default_rng(0), np.arange(1, 9)
    test, best = d.allowed(panda), taie2024()
    for _ in range(5):
        drawn = FourierMotion(d.READY, rng.normal(size=(7, 8)) / k**2, rng.normal(size=(7, 8)) / k**2, 6.0).smooth()
        while not test(drawn):
            drawn = drawn.scaled(0.8)
        assert d.information(panda, best) > d.information(panda, drawn) + 5
        assert d.condition(panda, best) < d.condition(panda, drawn)
    assert d.condition(panda, best) < 30


def test_the_criterion_is_the_log_determinant_of_scaled_least_squares(panda):
    t = np.arange(60) * 0.1
    q, dq, ddq = taie2024()(t)
    Y = payload_regressor(panda.frame_motion(q), dq, ddq)
    A = sum(y.T @ np.diag(1 / np.array(d.SIGMA) ** 2) @ y for y in Y) / 60
    # det(S·A·S) = det(S)²·det(A): log det S = (3·1 + 6·2)·log L
    expected = np.linalg.slogdet(A)[1] + 2 * 15 * np.log(0.1)
    assert d.information(panda, taie2024()) == pytest.approx(expected, abs=1e-6)


def test_the_search_is_deterministic_improves_and_stays_within_its_margins(panda):
    start, short, again = d.design(panda, 7, steps=0), d.design(panda, 7, steps=60), d.design(panda, 7, steps=60)
    np.testing.assert_array_equal(short.sine, again.sine)
    np.testing.assert_array_equal(short.cosine, again.cosine)
    np.testing.assert_array_equal(short.offset, again.offset)
    assert d.information(panda, short) > d.information(panda, start) + 0.5
    assert d.allowed(panda)(short)
    assert d.allowed(panda)(taie2024())


def test_tidying_moves_nothing_by_more_than_its_rounding():
    rng = np.random.default_rng(3)
    motion = FourierMotion(rng.normal(size=7), rng.normal(size=(7, 8)), rng.normal(size=(7, 8)), 6.0).smooth()
    tidy = d.tidy(motion)
    assert np.abs(tidy.sine[:, 1:] - motion.sine[:, 1:]).max() <= 0.5e-5 + 1e-12
    assert np.abs(tidy.cosine[:, 0] - motion.cosine[:, 0]).max() <= 0.5e-5 * 204  # sum of k² for k = 1 to 8
    k = np.arange(1, 9)
    np.testing.assert_array_equal(np.round(tidy.sine * 1e5) @ k, 0.0)
    np.testing.assert_array_equal(np.round(tidy.cosine * 1e5) @ k**2, 0.0)

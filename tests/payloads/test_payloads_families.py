"""Random payloads by family: bodies that can exist, of the mass asked for, and the same ones for the same seed."""

import numpy as np
import pytest

from armload.errors import PayloadError
from armload.inertia import is_consistent
from armload.payloads import FAMILIES, container, container_loadings, draw_payload, random_payload
from armload.payloads.odd import ODD
from armload.payloads.shapes import SHAPES, TOOLS

SEEDS = range(60)


@pytest.mark.parametrize("rated", [0.5, 3.0, 12.5])
@pytest.mark.parametrize("family", FAMILIES)
def test_every_payload_can_exist_and_is_within_what_the_arm_may_carry(family, rated):
    for seed in SEEDS:
        payload = draw_payload(family, seed, rated)
        assert 0.0 <= payload.parameters.mass < rated
        assert (payload.parameters.mass > 0) == (family != "nothing")
        assert is_consistent(payload.parameters.phi) or family == "nothing"


@pytest.mark.parametrize("shape", {**SHAPES, **TOOLS, **ODD}.values(), ids=lambda shape: shape.__name__)
def test_a_shape_has_the_mass_asked_for_and_its_density_does_not_depend_on_the_scale(shape):
    for seed in range(10):
        small, large = (shape(np.random.default_rng(seed), m, s) for m, s in ((0.8, 1.0), (0.8 * 8, 2.0)))
        assert small.mass == pytest.approx(0.8)
        np.testing.assert_allclose(np.linalg.eigvalsh(small.inertia_com) > 0, True)
        if shape.__name__ != "gripper" and shape.__name__ != "gripped":  # its fingers are as thick for any arm
            np.testing.assert_allclose(large.com, 2.0 * small.com, atol=1e-12)
            np.testing.assert_allclose(large.inertia_com, 32.0 * small.inertia_com, rtol=1e-9, atol=1e-12)


def test_boxes_of_a_larger_arm_are_the_same_boxes_grown():
    small, large = draw_payload("boxes", 4), draw_payload("boxes", 4, rated=24.0)
    np.testing.assert_array_equal(small.parameters.phi, random_payload(4).parameters.phi)
    scale = 8.0 * np.array([1, 2, 2, 2, 4, 4, 4, 4, 4, 4])  # of mass; a length more; two lengths more
    np.testing.assert_allclose(large.parameters.phi, scale * small.parameters.phi, rtol=1e-9)
    np.testing.assert_allclose(sum(b.parameters.phi for b in large.boxes), large.parameters.phi, rtol=1e-9, atol=1e-12)


def test_a_filling_is_the_empty_container_and_weights_by_the_paper_s_rules():
    empty, known = container().parameters.phi, np.array([p.parameters.phi for p in container_loadings()])
    new = 0
    for seed in SEEDS:
        phi = draw_payload("container", seed).parameters.phi
        weights = phi - empty
        assert 0.0 <= weights[0] <= 5 * 0.2746 + 1e-9
        if weights[0] > 1e-9:
            assert is_consistent(weights)
            r = weights[1:4] / weights[0]
            assert np.hypot(*r[:2]) <= 0.0755
            assert 0.019 <= r[2] <= 0.081
        new += np.abs(known - phi).max(axis=1).min() > 1e-9
    assert new > 30


def test_odd_payloads_lie_outside_every_other_family():
    def aside_and_moment(family):
        phi = np.array([draw_payload(family, seed).parameters.phi for seed in range(150)])
        moment = np.hypot(phi[:, 1], phi[:, 2])
        return moment / phi[:, 0], moment, phi[:, 0]

    aside, moment, mass = aside_and_moment("odd")
    assert 0.45 <= mass.min() < 0.6
    assert 2.8 < mass.max() <= 3.0
    for family in sorted(set(FAMILIES) - {"odd", "nothing"}):
        other_aside, other_moment, _ = aside_and_moment(family)
        assert np.mean(other_aside > aside.min()) < 0.02  # their centres of mass hardly meet
        assert np.mean(moment > np.quantile(other_moment, 0.99)) > 0.5


def test_a_ring_turns_about_its_axis_like_two_radii():
    rng = np.random.default_rng(4)
    body = ODD["ring"](rng, 2.0, 1.0)
    largest = np.linalg.eigvalsh(body.inertia_com)[-1]  # about its axis: m·(R² + r²)/2
    outer, thick = np.random.default_rng(4).uniform((0.12, 0.01), (0.25, 0.03))
    assert largest == pytest.approx(2.0 * (outer**2 + (outer - thick) ** 2) / 2, rel=1e-9)


def test_the_same_seed_gives_the_same_payload_and_families_differ():
    drawn = [draw_payload(family, 3).parameters.phi for family in FAMILIES]
    again = [draw_payload(family, 3).parameters.phi for family in FAMILIES]
    np.testing.assert_array_equal(drawn, again)
    assert len({phi.tobytes() for phi in drawn}) == len(FAMILIES)


def test_mistakes_are_named():
    with pytest.raises(PayloadError, match="no family of payloads is called 'cats': expected one of boxes"):
        draw_payload("cats", 0)
    with pytest.raises(PayloadError, match="rated payload is 0 kg"):
        draw_payload("boxes", 0, rated=0)
    with pytest.raises(PayloadError, match="seed is -1"):
        draw_payload("nothing", -1)

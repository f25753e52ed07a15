"""Something light: a prior that expects an empty hand must not make an interval sure of one."""

from __future__ import annotations

import numpy as np
import pytest

from armload import arm
from armload.inertia import Z95
from armload.inertia.cholesky import inverse
from armload.payloads import draw_payload
from armload.posterior import Evidence, shipped_model
from armload.posterior.evidence import TRAITS
from armload.posterior.hybrid import answer, holding


@pytest.fixture(scope="module")
def model():
    return shipped_model(arm("panda"))


def evidence_of(truth, std, rng):
    """What a log says of a payload (10,) whose ten parameters it tells to within std (10,)."""
    Λ = np.diag(std**-2.0)
    return Evidence(Λ, Λ @ (truth + std * rng.normal(size=10)), 0.005, np.zeros(len(TRAITS)), 6.0, 0)


STD = np.array([0.03] + [3e-3] * 3 + [5e-3] * 6)


def test_the_mass_if_there_is_something_is_that_of_the_prior_without_light_families(model):
    some = model.prior.only(*[x for x in dict.fromkeys(model.prior.families) if x not in ("nothing", "light")])
    rng = np.random.default_rng(1)
    for mass in (0.0, 0.05, 0.3, 2.0):
        truth = draw_payload("boxes", 1, mass).parameters.phi if mass else np.zeros(10)
        log = evidence_of(truth, STD, rng)
        found, known = (prior.posterior(log.information, log.vector) for prior in (model.prior, some))
        assert found.mass_if_any == pytest.approx(known.mean[0], rel=1e-6, abs=1e-9)


def test_the_interval_of_a_light_mass_holds_with_and_without_the_empty_hand(model):
    """Oracle: payloads of 30 to 150 g and logs with errors of a known size."""
    inside, narrow, rng = [], [], np.random.default_rng(2)
    for k in range(150):
        truth = draw_payload("boxes", k, float(rng.uniform(0.03, 0.15))).parameters.phi
        log = evidence_of(truth, STD, rng)
        phi, covariance = answer(log, model.calibration, model.prior, False)[:2]
        found = model.prior.posterior(log.information, log.vector)
        before = model.calibration.widened(found, log, model.prior)
        inside.append(abs(phi[0] - truth[0]) <= Z95 * np.sqrt(covariance[0, 0]))
        narrow.append(abs(found.mean[0] - truth[0]) <= Z95 * np.sqrt(before[0, 0]))
    assert np.mean(inside) > 0.95 > np.mean(narrow) + 0.02


def test_a_wider_interval_leaves_the_others_and_every_correlation():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(10, 10))
    C = root @ root.T
    wide = holding(C, 0, -0.7)
    assert Z95 * np.sqrt(wide[0, 0]) == pytest.approx(Z95 * np.sqrt(C[0, 0]) + 0.7)
    assert np.array_equal(wide[1:, 1:], C[1:, 1:])
    correlation = [A / np.sqrt(np.outer(np.diag(A), np.diag(A))) for A in (C, wide)]
    assert correlation[1] == pytest.approx(correlation[0])
    assert np.isfinite(inverse(wide)).all()

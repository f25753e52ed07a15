"""Wide, thin bodies carried at their centre, and light ones: what the prior knows, and how wide intervals are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm
from armload.inertia import Z95, InertialParameters
from armload.lab.training.added_families import LIGHT, WIDE
from armload.payloads import draw_payload, solids
from armload.posterior import Evidence, HybridModel, shipped_model
from armload.posterior.evidence import TRAITS
from armload.posterior.model_file import SHIPPED

DIAGONAL = [4, 7, 9]  # of the inertia within phi


@pytest.fixture(scope="module")
def model():
    """Of which evidence is taken as it is: what these tests draw claims no more than is true."""
    shipped = shipped_model(arm("panda"))
    return replace(shipped, calibration=replace(shipped.calibration, bag=None, level=1.0, left_open=0.0))


def a_log(truth, std, rng):
    """What a log says of phi (10,) that it tells to within std (10,)."""
    Λ = np.diag(std**-2.0)
    return Evidence(Λ, Λ @ (truth + std * rng.normal(size=10)), 0.005, np.zeros(len(TRAITS)), 6.0, 1)


def tray(mass, a, b, z):
    """phi of a lamina a × b across z, at z: m/12·(b², a², a² + b²) about its centre, and Steiner's m·z²."""
    xx, yy, zz = mass / 12.0 * b**2 + mass * z**2, mass / 12.0 * a**2 + mass * z**2, mass / 12.0 * (a**2 + b**2)
    return np.array([mass, 0.0, 0.0, mass * z, xx, 0.0, 0.0, yy, 0.0, zz])


def without_wide(prior):
    """The same prior without that family."""
    return prior.only(*[x for x in dict.fromkeys(prior.families) if x != "wide"])


def test_the_inertia_of_a_thin_tray_lies_inside_where_the_log_leaves_room(model):
    """Oracle: closed form. The log tells the mass well and an inertia to within 1 g·m², of 1 to 30."""
    std, rng = np.array([0.02] + [2e-3] * 3 + [1e-3] * 6), np.random.default_rng(11)
    inside, error = {}, {}
    logs = []
    for _ in range(200):
        a = rng.uniform(0.2, 0.4)
        truth = tray(rng.uniform(0.4, 2.0), a, rng.uniform(0.5, 1.0) * a, rng.uniform(0.01, 0.06))
        logs.append((a_log(truth, std, rng), truth))
    for name, prior in (("with", model.prior), ("without", without_wide(model.prior))):
        found = [model.calibration.answer(log, prior) for log, _ in logs]
        off = np.array([np.abs(f.mean - truth) for f, (_, truth) in zip(found, logs, strict=True)])[:, DIAGONAL]
        half = Z95 * np.sqrt([np.diag(f.covariance)[DIAGONAL] for f in found])
        inside[name], error[name] = np.mean(off <= half), np.mean(off)
    assert inside["with"] > 0.88 > inside["without"] + 0.03
    assert error["with"] < 0.8 * error["without"]


def test_wide_bodies_are_laminas_across_the_axis():
    """The perpendicular axis theorem: of a thin body I_zz = I_xx + I_yy about its centre, but for its thickness."""
    for seed in range(60):
        body = draw_payload("wide", seed).parameters
        (xx, yy, zz), m = np.diag(body.inertia_com), body.mass
        thick = np.sqrt(6.0 * (xx + yy - zz) / m)  # both of them have m·thick²/12 of it
        assert 0.002 - 1e-9 <= thick <= 0.02 + 1e-9
        assert np.hypot(*body.com[:2]) < 0.08
        assert 0.0 <= body.com[2] <= 0.12


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_prior_expects_wide_and_light_bodies_as_often_as_stated(name):
    prior = shipped_model(arm(name)).prior
    wide = sum(w for w, family in zip(prior.weights, prior.families, strict=True) if family == "wide")
    first = prior.families.index("anything") + 1  # what was added stands behind
    assert wide == pytest.approx(WIDE)
    assert prior.weights[first:].sum() - wide == pytest.approx((1.0 - WIDE) * LIGHT)
    assert set(prior.families[first:]) == {"wide", "light"}


def test_the_inertia_of_light_ones_narrows_as_that_of_bodies_of_one_density(model):
    """Oracle: two boxes of one density, I/m of the smaller over that of the larger."""
    m0 = model.calibration.light
    big = solids.box((0.06, 0.05, 0.04), mass=m0)
    half_as_heavy = solids.box(np.array((0.06, 0.05, 0.04)) * 0.5 ** (1 / 3), mass=0.5 * m0)
    ratio = (half_as_heavy.phi[4] / half_as_heavy.mass) / (big.phi[4] / big.mass)
    found = model.prior.posterior(np.eye(10), np.zeros(10))
    surely = found._replace(covariance=np.diag(np.full(10, 1e-20)))  # of a mass that is known
    narrows = [model.calibration.narrowing(surely._replace(mean=b.phi), model.prior) for b in (big, half_as_heavy)]
    assert narrows == pytest.approx([1.0, ratio], rel=1e-6)
    doubtful = np.diag([m0**2] + [1e-20] * 9)
    assert model.calibration.narrowing(surely._replace(mean=0.1 * big.phi, covariance=doubtful), model.prior) == 1.0


def test_the_inertia_of_a_light_one_far_out_narrows_no_more_than_its_mass_times_its_lever_squared(model):
    """Oracle: of bodies of one density the square of the lever goes with m^(2/3)."""
    m0, usual = model.calibration.light, model.prior.lever_square
    heavy = np.sqrt(model.prior.mean[0] ** 2 + model.prior.std[0] ** 2)
    found = model.prior.posterior(np.eye(10), np.zeros(10))._replace(covariance=np.diag(np.full(10, 1e-20)))

    def left(mass, lever):
        point = InertialParameters.from_com(mass, (0.0, 0.0, lever), np.zeros((3, 3)))
        return model.calibration.narrowing(found._replace(mean=point.phi), model.prior)

    lever = np.sqrt(0.5 * usual) * (m0 / heavy) ** (1 / 3)  # of a body of m_0, as `FAR_OUT` has it
    assert left(0.3 * m0, 0.2 * lever) == pytest.approx(0.3 ** (2 / 3))
    assert left(0.3 * m0, 0.8 * lever) == pytest.approx(0.8**2)
    assert left(0.3 * m0, 1.1 * lever) == 1.0


def test_only_the_inertia_of_light_ones_narrows_and_only_if_a_model_says_so(model, tmp_path):
    rng = np.random.default_rng(5)
    log = a_log(tray(0.1, 0.1, 0.1, 0.02), np.array([0.01] + [1e-3] * 3 + [1e-3] * 6), rng)
    plain = replace(model, calibration=replace(model.calibration, light=0.0))
    narrow, wide = (x.calibration.answer(log, x.prior).covariance for x in (model, plain))
    assert np.allclose(narrow[:4, :4], wide[:4, :4])
    assert np.all(np.diag(narrow)[4:] < 0.9 * np.diag(wide)[4:])
    for one in (model, plain):
        assert HybridModel.load(one.save(tmp_path / "one.safetensors")).calibration.light == one.calibration.light

"""The hybrid: closed forms of its prior, coverage of its error bars on data of known law, its file, its answers."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors import safe_open
from scipy.stats import multivariate_normal

import armload
from armload.arms import ARMS, arm
from armload.errors import ModelError
from armload.identification import identify
from armload.inertia import Z95, InertialParameters, is_consistent
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.lab.training import Records, cross_validated, measure_episodes, shards
from armload.lab.training.calibrating import TREES, fit_calibration, overrating
from armload.motion import random_motion
from armload.payloads import draw_payload, random_payloads
from armload.posterior import (
    TRAITS,
    Calibration,
    Evidence,
    HybridIdentifier,
    HybridModel,
    MixturePrior,
    PosteriorLeastSquares,
    Training,
    shipped_model,
)
from armload.posterior import SmoothPosteriorLeastSquares as Smooth
from armload.regression import JointFeatures
from armload.simulation import Sensors, World, simulate

SHIPPED = sorted((Path(armload.__file__).parent / "posterior" / "models").glob("*.safetensors"))
UNIT = np.array([0.5] + [0.05] * 3 + [5e-3] * 6)
BODY = InertialParameters.from_com(1.2, (0.02, -0.03, 0.07), np.diag([4e-3, 3e-3, 2e-3]))


def spread(rng, scale=1.0):
    root = rng.normal(size=(10, 10)) / 4 + np.eye(10)
    return scale * (root @ root.T) * np.outer(UNIT, UNIT)


@pytest.fixture(scope="module")
def mixture():
    rng = np.random.default_rng(1)
    means = rng.normal(size=(3, 10)) * UNIT
    return MixturePrior(np.array([0.5, 0.3, 0.2]), means, np.array([spread(rng) for _ in range(3)]), ("a", "b", "b"))


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


# ---------------------------------------------------------------------------- the prior


def test_one_component_gives_the_gaussian_posterior():
    rng = np.random.default_rng(2)
    C, mean, Λ = spread(rng), rng.normal(size=10) * UNIT, np.linalg.inv(spread(rng))
    prior = MixturePrior(np.ones(1), mean[None], C[None], ("x",))
    h = Λ @ (rng.normal(size=10) * UNIT)
    P = np.linalg.inv(Λ + np.linalg.inv(C))
    found = prior.posterior(Λ, h)
    assert found.mean / UNIT == pytest.approx(P @ (h + np.linalg.solve(C, mean)) / UNIT, abs=1e-9)
    assert found.covariance / np.outer(UNIT, UNIT) == pytest.approx(P / np.outer(UNIT, UNIT), abs=1e-9)


def test_the_posterior_is_that_of_importance_sampling(mixture):
    rng = np.random.default_rng(3)
    R = spread(rng, 0.3)
    truth = mixture.means[1]
    found = replace(mixture, beta=1.0).posterior(np.linalg.inv(R), np.linalg.solve(R, truth))
    counts = rng.multinomial(400_000, mixture.weights)
    draws = np.concatenate(
        [
            rng.multivariate_normal(m, C, size=n)
            for m, C, n in zip(mixture.means, mixture.covariances, counts, strict=True)
        ]
    )
    w = multivariate_normal(truth, R).pdf(draws)
    mean = w @ draws / w.sum()
    std = np.sqrt(w @ (draws - mean) ** 2 / w.sum())
    assert found.mean / UNIT == pytest.approx(mean / UNIT, abs=0.03)
    assert np.sqrt(np.diag(found.covariance)) / std == pytest.approx(np.ones(10), abs=0.04)


@pytest.mark.parametrize("beta", [1.0, 0.5])
def test_how_well_a_component_fits_counts_as_often_as_beta_says(mixture, beta):
    """Oracle: each component's density of a measurement of phi."""
    R = spread(np.random.default_rng(3), 0.3)
    seen = 0.5 * (mixture.means[1] + mixture.means[2])
    evidence = np.linalg.inv(R), np.linalg.solve(R, seen)
    found = replace(mixture, beta=beta).posterior(*evidence)
    fits = [multivariate_normal(m, C + R).logpdf(seen) for m, C in zip(mixture.means, mixture.covariances, strict=True)]
    weights = mixture.weights * np.exp(beta * (np.array(fits) - max(fits)))
    assert found.weights == pytest.approx(weights / weights.sum(), rel=1e-6)
    assert found.log_evidence == pytest.approx(mixture.posterior(*evidence).log_evidence)  # not of beta


def test_without_evidence_the_posterior_is_the_prior(mixture):
    found = mixture.posterior(np.zeros((10, 10)), np.zeros(10))
    assert found.mean == pytest.approx(mixture.mean)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(mixture.std)
    assert found.weights == pytest.approx(mixture.weights)


def test_moving_the_prior_and_the_evidence_moves_the_posterior(mixture):
    rng = np.random.default_rng(4)
    T = np.diag(1.0 / UNIT) @ (np.eye(10) + 0.2 * rng.normal(size=(10, 10))) @ np.diag(UNIT)
    Λ, inverse = np.linalg.inv(spread(rng)), np.linalg.inv(T)
    h = Λ @ mixture.means[0]
    here, there = mixture.posterior(Λ, h), mixture.moved(T).posterior(inverse.T @ Λ @ inverse, inverse.T @ h)
    assert there.mean == pytest.approx(T @ here.mean)
    assert there.covariance == pytest.approx(T @ here.covariance @ T.T)


def test_who_knows_the_family_keeps_its_components(mixture):
    known = mixture.only("b")
    assert known.weights == pytest.approx([0.6, 0.4])
    assert known.mean == pytest.approx(0.6 * mixture.means[1] + 0.4 * mixture.means[2])
    with pytest.raises(ModelError, match="no family is called c: expected some of a, b"):
        mixture.only("c")


def test_fitting_finds_the_moments_of_the_draws():
    rng = np.random.default_rng(5)
    draws = {"x": rng.multivariate_normal(2 * UNIT, spread(rng), size=4000), "none": np.zeros((5, 10))}
    prior = MixturePrior.fit(draws, {"x": 1.0, "none": 0.0})
    assert prior.mean == pytest.approx(draws["x"].mean(axis=0), rel=0.02)
    assert prior.std == pytest.approx(draws["x"].std(axis=0), rel=0.05)


def test_a_covariance_that_is_none_is_refused():
    with pytest.raises(ModelError, match="not positive definite"):
        MixturePrior(np.ones(1), np.zeros((1, 10)), -np.eye(10)[None], ("x",))


def test_evidence_of_another_size_is_refused():
    prior = MixturePrior(np.ones(1), np.zeros((1, 10)), np.eye(10)[None], ("x",))
    for size, length in ((3, 10), (10, 300)):
        with pytest.raises(ModelError, match="10 numbers each"):
            prior.posterior(np.eye(size), np.zeros(length))


@pytest.mark.parametrize(("family", "heaviest"), [("boxes", 2.8), ("shapes", 2.9), ("container", 2.2)])
def test_error_bars_hold_for_heavy_bodies_as_for_light_ones(panda, family, heaviest):
    """Fair evidence of 15 g, 3 g·m, 4 g·m²: what the prior makes of it holds in each third of the family's weights."""
    rng, prior = np.random.default_rng(8), shipped_model(panda).prior
    std = np.repeat([0.015, 3e-3, 4e-3], [1, 3, 6])
    inside = [[], [], []]
    for seed in range(400):
        phi = draw_payload(family, 100_000 + seed).parameters.phi
        found = prior.posterior(np.diag(std**-2.0), (phi + std * rng.normal(size=10)) / std**2)
        inside[min(int(3.0 * phi[0] / heaviest), 2)].append(
            np.abs(found.mean - phi) <= 1.96 * np.sqrt(np.diag(found.covariance))
        )
    for third in inside:
        if len(third) > 50:
            assert np.mean(np.array(third)[:, 4:]) > 0.89  # before half of the draws were as heavy as they come: 0.84


@pytest.mark.parametrize("mass", [0.01, 0.04, 0.15])
def test_what_is_light_is_not_taken_for_nothing(panda, mass):
    body = draw_payload("boxes", 3, mass).parameters.phi
    std = np.array([mass / 6.0] + [1e-3] * 9)  # a log that tells three standard deviations of mass
    found = shipped_model(panda).prior.posterior(np.diag(std**-2.0), body / std**2)
    assert abs(found.mean[0] - body[0]) < 2.0 * np.sqrt(found.covariance[0, 0])


# ---------------------------------------------------------------------------- the physics


def test_pose_features_have_the_kernel_of_a_gaussian_process():
    features, rng = JointFeatures(n=3, pose=20_000, velocity=0), np.random.default_rng(8)
    q = rng.uniform(-1.0, 1.0, size=(6, 3))
    squared = ((q[:, None] - q) ** 2).sum(axis=2)
    kernel = np.mean([np.exp(-squared / (2.0 * scale**2)) for scale in (0.7, 0.9, 1.1, 1.3, 1.5)], axis=0)
    assert features.of_pose(q) @ features.of_pose(q).T == pytest.approx(kernel, abs=0.03)


def test_velocity_features_span_friction_of_any_shape():
    dq = np.linspace(-1.5, 1.5, 601)
    g = JointFeatures(n=1, pose=0).of_velocity(dq[:, None])[:, 0]
    for shape in (np.tanh(dq / 0.06), np.sign(dq) * (0.6 + 0.4 * np.exp(-((dq / 0.1) ** 2))) * (np.abs(dq) > 0.05), dq):
        left = shape - g @ np.linalg.lstsq(g, shape)[0]
        assert np.sqrt(np.mean(left**2)) < 0.15 * np.sqrt(np.mean(shape**2))


def test_a_smooth_torque_that_no_rigid_body_explains_is_not_taken_for_payload(panda, analytic_log):
    def smooth(q, _):
        return 0.25 * np.stack([np.sin(1.3 * q[:, (j + 1) % 7] + q[:, j] + j) for j in range(7)], axis=1)

    run = analytic_log(panda, BODY, extra=smooth)
    tare = analytic_log(panda, duration=20.0, phase=1.0, extra=smooth)
    rigid, both = (method(panda, tare).run(run).phi - BODY.phi for method in (PosteriorLeastSquares, Smooth))
    assert np.linalg.norm(both / UNIT) < 0.5 * np.linalg.norm(rigid / UNIT)


# ---------------------------------------------------------------------------- the error bars


@pytest.fixture(scope="module")
def synthetic(mixture):
    """Records of known law: truths from the prior, evidence that claims to be 1 to 25 times as good as it is."""
    rng = np.random.default_rng(6)
    rows = []
    for episode in range(700):
        k = rng.choice(3, p=mixture.weights)
        truth = rng.multivariate_normal(mixture.means[k], mixture.covariances[k])
        trait = rng.uniform(0.0, 1.4)  # log10 of the overrating, which the learner may read
        for t in (0.1, 1.0):
            R = spread(rng, 0.05 / t)
            seen = rng.multivariate_normal(truth, R * 10.0**trait)
            traits = np.zeros(len(TRAITS))
            traits[0], traits[1] = np.log10(t), trait
            Λ = np.linalg.inv(R)
            rows.append((Λ, Λ @ seen, 0.0, traits, t, episode % 2, truth, episode, "synthetic"))
    columns = [np.array([row[k] for row in rows]) for k in range(9)]
    return Records(*columns, np.zeros((len(rows), 0, 10, 10)))


def half_widths(calibration, records, prior):
    answers = [calibration.answer(records.evidence(k), prior) for k in range(len(records))]
    half = 1.959963984540054 * np.sqrt([np.diag(a.covariance) for a in answers])
    return half, np.abs([a.mean for a in answers] - records.truth)


@pytest.mark.parametrize("learners", [TREES, ()])
def test_intervals_hold_on_episodes_that_were_not_trained_on(synthetic, mixture, learners):
    train, test = synthetic.select(synthetic.episode < 500), synthetic.select(synthetic.episode >= 500)
    half, error = half_widths(fit_calibration(train, mixture, learners=learners), test, mixture)
    assert np.mean(error <= half) == pytest.approx(0.95, abs=0.025)


def test_the_torques_gain_widens_an_interval_by_its_own_share(synthetic, mixture):
    evidence = replace(synthetic.evidence(3), gain_std=0.02)
    calibration = Calibration(None, 1.0, np.array([0.1]), np.full((3, 1, 10), 3.0), left_open=0.0)
    found = mixture.posterior(evidence.information, evidence.vector)
    half = Z95 * np.sqrt(np.diag(calibration.answer(evidence, mixture).covariance))
    np.testing.assert_allclose(half**2, (3.0**2) * np.diag(found.covariance) + (Z95 * 0.02 * found.mean) ** 2)


def test_intervals_hold_and_are_no_wider_than_they_must_where_only_the_gain_is_wrong(synthetic, mixture):
    rng = np.random.default_rng(3)
    gain = 1.0 + rng.uniform(-0.03, 0.03, size=len(synthetic))[:, None]
    sharp = 1e-4 * mixture.std
    rows = replace(
        synthetic,
        information=np.tile(np.diag(sharp**-2.0), (len(synthetic), 1, 1)),
        vector=gain * synthetic.truth / sharp**2,
        gain_std=np.full(len(synthetic), 0.02),
    )
    train, test = rows.select(rows.episode < 500), rows.select(rows.episode >= 500)
    half, error = half_widths(fit_calibration(train, mixture, learners=()), test, mixture)
    assert np.mean(error <= half) > 0.93
    assert np.mean(half[:, 0]) < 0.05 * np.mean(np.abs(test.truth[:, 0]))


def test_learning_how_far_evidence_is_overrated_makes_answers_and_intervals_better(synthetic, mixture):
    train, test = synthetic.select(synthetic.episode < 500), synthetic.select(synthetic.episode >= 500)
    (with_bag, error), (without, plain) = (
        half_widths(fit_calibration(train, mixture, learners=learners), test, mixture) for learners in (TREES, ())
    )
    assert np.mean(error / UNIT) < 0.99 * np.mean(plain / UNIT)
    assert np.mean(with_bag / UNIT) < 0.99 * np.mean(without / UNIT)


def test_evidence_that_claims_too_much_is_found_to_do_so_by_its_own_factor(synthetic, mixture):
    claimed = 10.0 ** synthetic.traits[:, 1]
    assert np.nanmean(overrating(synthetic, mixture)[0] / claimed) == pytest.approx(1.0, abs=0.05)


def test_a_factor_that_is_left_open_is_weighed_by_how_well_it_goes_with_the_payloads():
    """Oracle: the density of what the log says, N(mu, C + f·R), under a prior of one component; powers as stated."""
    rng = np.random.default_rng(21)
    C, R = spread(rng, 1.0), spread(rng, 0.5)
    prior = MixturePrior(np.ones(1), BODY.phi[None], C[None], ("boxes",))
    Λ = np.linalg.inv(R)
    calibration = Calibration(None, 1.0, np.array([1.0]), np.ones((3, 1, 10)), left_open=0.4)
    for size in (0.1, 1.0, 4.0):
        seen = rng.multivariate_normal(BODY.phi, C + size * R)
        evidence = Evidence(Λ, Λ @ seen, 0.0, np.zeros(len(TRAITS)), 1.0, 1)
        f = 10.0 ** (0.4 * np.sqrt(3.0) * np.array([-1.0, 0.0, 1.0]))
        p = np.array([1.0, 4.0, 1.0]) * [multivariate_normal(BODY.phi, C + x * R).pdf(seen) ** 0.5 for x in f]
        each = [BODY.phi + C @ np.linalg.solve(C + x * R, seen - BODY.phi) for x in f]
        expected = p @ each / p.sum()
        assert calibration.posterior(evidence, prior).mean / UNIT == pytest.approx(expected / UNIT, abs=1e-6)


def test_errors_larger_or_smaller_than_claimed_make_worse_answers_if_the_factor_is_thought_to_be_known(mixture):
    rng, error = np.random.default_rng(22), {0.0: [], 0.4: []}
    for _ in range(300):
        k = rng.choice(3, p=mixture.weights)
        truth, R = rng.multivariate_normal(mixture.means[k], mixture.covariances[k]), spread(rng, 0.5)
        seen, Λ = rng.multivariate_normal(truth, R * 10.0 ** (0.8 * rng.normal())), np.linalg.inv(R)
        evidence = Evidence(Λ, Λ @ seen, 0.0, np.zeros(len(TRAITS)), 1.0, 1)
        for left_open, errors in error.items():
            calibration = Calibration(None, 1.0, np.array([1.0]), np.ones((3, 1, 10)), left_open=left_open)
            errors.append(np.mean(np.abs(calibration.posterior(evidence, mixture).mean - truth) / UNIT))
    assert np.mean(error[0.4]) < 0.93 * np.mean(error[0.0])


def test_evidence_about_one_direction_is_trusted_as_much_as_evidence_about_all(synthetic, mixture):
    rng, rows = np.random.default_rng(7), synthetic.select(synthetic.t == 0.1)
    rows.traits[:, 1] = np.arange(len(rows)) % 2  # every other row tells of the mass alone, all as well as they claim
    for k, truth in enumerate(rows.truth):
        std = 0.02 * mixture.std * np.where(np.arange(10) < 1 + 9 * rows.traits[k, 1], 1.0, 1e6)
        rows.information[k] = np.diag(std**-2.0)
        rows.vector[k] = rng.normal(truth, std) / std**2
    calibration = fit_calibration(rows, mixture)
    one, all_ten = (calibration.kappa(rows.traits[k]) for k in (0, 1))
    assert one == pytest.approx(all_ten, rel=0.4)  # the mean logarithm of a single square is less by a factor of 3.2


def test_kappa_follows_the_trait_that_carries_it(synthetic, mixture):
    calibration = fit_calibration(synthetic, mixture)
    traits = np.zeros((2, len(TRAITS)))
    traits[:, 1] = 0.2, 1.2
    low, high = map(calibration.kappa, traits)
    assert high / low == pytest.approx(10.0, rel=0.35)


def test_widths_belong_to_the_times_asked_for_however_samples_are_jittered(synthetic, mixture):
    rng = np.random.default_rng(7)
    jittered = replace(synthetic, t=synthetic.t * rng.uniform(0.9, 1.0, len(synthetic)))
    calibration = fit_calibration(jittered, mixture, learners=())
    assert calibration.times == pytest.approx([0.095, 0.95], rel=0.01)
    assert calibration.widths == pytest.approx(fit_calibration(synthetic, mixture, learners=()).widths)


def test_cross_validation_covers_every_episode(synthetic, mixture):
    checked = cross_validated(synthetic, mixture)
    assert checked.episodes == 700
    assert checked.pooled == pytest.approx(0.95, abs=0.02)


# ---------------------------------------------------------------------------- the file


def test_a_model_answers_the_same_after_it_was_saved(synthetic, mixture, panda, tmp_path):
    calibration = fit_calibration(synthetic, mixture)
    model = HybridModel(mixture, calibration, panda.name, panda.fingerprint, str(panda.frame), panda.n, {"note": 1})
    path = model.save(tmp_path / "model.safetensors")
    back = HybridModel.load(path)
    for k in (0, 7, 20):
        evidence = synthetic.evidence(k)
        assert np.array_equal(
            back.calibration.answer(evidence, back.prior).mean, calibration.answer(evidence, mixture).mean
        )
    assert back.provenance == {"note": 1}
    assert back.training is None
    assert not back.calibrated  # nobody has checked it
    assert HybridModel.wrote(path)


@pytest.mark.parametrize(
    ("pooled", "episodes", "calibrated"),
    [(0.95, 1000, True), (0.931, 1000, True), (0.95, 999, False), (0.929, 1000, False), (0.971, 1000, False)],
)
def test_intervals_are_calibrated_by_what_the_model_says_of_its_training(tmp_path, pooled, episodes, calibrated):
    checked = Training("broad", episodes, 4, pooled)
    model = replace(HybridModel.load(SHIPPED[0]), training=checked, provenance={})
    back = HybridModel.load(model.save(tmp_path / "model.safetensors"))
    assert back.training == checked
    assert model.calibrated == back.calibrated == calibrated


def test_a_model_of_an_earlier_format_is_refused_in_a_sentence(tmp_path):
    from safetensors.numpy import load_file, save_file

    with safe_open(SHIPPED[0], framework="np") as file:
        header = json.loads(file.metadata()["armload-hybrid"])
    path = tmp_path / "model.safetensors"
    save_file(load_file(SHIPPED[0]), path, {"armload-hybrid": json.dumps({**header, "format": 2})})
    with pytest.raises(ModelError, match=r"model\.safetensors belongs to another version of armload: train") as said:
        HybridModel.load(path)
    assert str(said.value).startswith(str(path))  # and not what is said of a damaged file about it


def test_a_file_that_is_no_hybrid_is_refused_in_a_sentence(tmp_path):
    from safetensors.numpy import save_file

    save_file({"x": np.zeros(3)}, tmp_path / "other.safetensors")
    (tmp_path / "text.safetensors").write_text("hello")
    for name in ("other", "text", "missing"):
        assert not HybridModel.wrote(tmp_path / f"{name}.safetensors")
        with pytest.raises(ModelError, match=name):
            HybridModel.load(tmp_path / f"{name}.safetensors")


@pytest.mark.parametrize("broken", ["nan", "negative", "of one kind", "no provenance", "no share"])
def test_a_hybrid_with_numbers_that_cannot_be_is_refused_in_a_sentence(tmp_path, broken):
    model = HybridModel.load(SHIPPED[0])
    widths = model.calibration.widths.copy()
    if broken == "nan":
        widths[0, 0, 0] = np.nan
    elif broken == "negative":
        widths[1, 2, 3] *= -1.0
    elif broken == "of one kind":
        widths = widths[:1]
    calibration = replace(model.calibration, widths=widths)
    provenance: Any = None if broken == "no provenance" else model.provenance
    assert model.training is not None
    share: Any = "most" if broken == "no share" else model.training.pooled_coverage
    training = replace(model.training, pooled_coverage=share)
    model = replace(model, calibration=calibration, provenance=provenance, training=training)
    path = model.save(tmp_path / "model.safetensors")
    with pytest.raises(ModelError, match=r"model\.safetensors holds a hybrid model armload cannot use"):
        HybridModel.load(path)


def test_records_read_back_as_they_were_written(synthetic, tmp_path):
    back = Records.load(synthetic.save(tmp_path / "records.npz"))
    assert np.array_equal(back.information, synthetic.information)
    assert np.array_equal(back.group, synthetic.group)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.5, 0.999])
def test_records_cut_short_are_named_with_what_to_do(synthetic, tmp_path, share):
    whole = synthetic.save(tmp_path / "records.npz").read_bytes()
    (tmp_path / "bad.npz").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(ModelError, match=r"bad\.npz holds no records of episodes .*: delete it and make it again"):
        Records.load(tmp_path / "bad.npz")
    (tmp_path / "bad.npz").write_text("no")
    with pytest.raises(ModelError, match="holds no records"):
        Records.load(tmp_path / "bad.npz")


def test_records_that_stay_in_their_files_train_the_same_model_bit_for_bit(synthetic, mixture, tmp_path, monkeypatch):
    whole, paths, firsts = synthetic.select(synthetic.episode < 150), [], (0, 60, 120)
    for first in firsts:
        part = whole.select((whole.episode >= first) & (whole.episode < first + 60))
        paths.append(replace(part, episode=part.episode - first).save(tmp_path / f"{first}.npz"))
    stored, read, loaded = shards.stored_records(paths, firsts), shards._chunk, []
    monkeypatch.setattr(shards, "_chunk", lambda path: loaded.append(path) or read(path))
    assert np.array_equal(np.asarray(stored.select(stored.episode == 61).vector), whole.vector[122:124])
    assert set(loaded) == {str(paths[1])}  # the others were not read for it
    monkeypatch.undo()
    a, b = (fit_calibration(records, mixture, learners=(), seed=3) for records in (whole, stored))
    assert np.array_equal(a.widths, b.widths)
    assert np.array_equal(a.times, b.times)
    for k in (0, 130, 299):
        ours, theirs = (c.answer(r.evidence(k), mixture) for c, r in ((a, whole), (b, stored)))
        assert np.array_equal(ours.mean, theirs.mean)
        assert np.array_equal(ours.covariance, theirs.covariance)
    assert shards._chunk.cache_info().currsize <= 2
    paths[0].unlink()
    shards._chunk.cache_clear()
    with pytest.raises(ModelError, match="holds no records"):
        stored.evidence(0)


# ---------------------------------------------------------------------------- on logs


@pytest.fixture(scope="module")
def logs(panda):
    """The reference population: two arms, payloads, motions and tares."""
    return list(simulate_episodes(draw_episodes(panda, "reference", 2, seed=77, motions=3)))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_model_is_small_and_calibrated_and_belongs_to_its_arm(path):
    own, model = arm(path.stem), HybridModel.load(path)
    assert path == HybridModel.shipped(own)
    assert path.stat().st_size < 5e6
    assert model.calibrated
    assert model.prior_for(own).mean[0] > 0.0
    for other in (other for other in ARMS if other != own.name):
        with pytest.raises(ModelError, match=f"trained for {own.name}: {other} "):
            model.prior_for(arm(other))


@pytest.fixture(scope="module")
def estimates(panda, logs):
    """What the hybrid says of them."""
    return [HybridIdentifier(panda, log.tare).run(log.run) for log in logs]


def test_errors_on_real_like_arms_stay_near_their_error_bars(logs, estimates):
    inside = []
    for log, estimate in zip(logs, estimates, strict=True):
        inside.append(np.abs(estimate.phi - log.truth.phi) < 1.96 * estimate.std)
        assert abs(estimate.phi[0] - log.truth.mass) < 0.05
        assert is_consistent(estimate.phi)
    assert np.mean(inside) > 0.8  # of 20, 95 % of them expected; an arm's errors come together


def test_another_payload_frame_describes_the_same_body(panda, logs, estimates):
    wrist = arm("panda", "panda_link7")  # turns with the flange, 0.107 m before it
    here, there = estimates[0], HybridIdentifier(wrist, logs[0].tare).run(logs[0].run)
    moved = wrist.in_frame(InertialParameters(here.phi, panda.frame))
    assert there.phi == pytest.approx(moved.phi, abs=2e-4)  # the weak priors of either frame differ


@pytest.mark.full  # some seconds
def test_what_was_taken_off_since_the_tare_is_negative(panda):
    body, motion = random_payloads(1, seed=3)[0], random_motion(panda, 5)
    other = random_motion(panda, 6, duration=12.0, around=motion([0.0])[0][0])
    world, sensors = World.real_like(panda, 4), Sensors.panda(panda)
    loaded = simulate(panda, other, body, world=world, sensors=sensors, rate=200.0, seed=1)
    empty = simulate(panda, motion, None, world=world, sensors=sensors, rate=200.0, seed=2)
    found = identify(empty, panda, tare=loaded)
    assert found.mass == pytest.approx(-body.parameters.mass, abs=0.1)
    assert not found.consistent
    assert not found.held


def test_a_tare_along_the_same_motion_is_recognised_and_better(panda):
    episodes = draw_episodes(panda, "same-motion", 2, seed=4, motions=2)
    records = measure_episodes(episodes, times=(6.0,))
    assert sorted(records.kind.tolist()) == [0, 0, 2, 2]
    without, error = (
        np.abs([np.linalg.solve(records.information[k], records.vector[k]) - records.truth[k] for k in rows])
        for rows in (np.flatnonzero(records.kind == kind) for kind in (0, 2))
    )
    assert np.max(error, axis=0)[0] < 0.01
    assert np.max(error, axis=0)[1:4].max() < 2e-3
    for part in (slice(0, 1), slice(1, 4), slice(4, 10)):
        assert error[:, part].mean() < 0.5 * without[:, part].mean()


def test_identify_takes_the_hybrid_by_itself_and_says_its_intervals_are_calibrated(panda, logs):
    found = identify(logs[1].run, panda, tare=logs[1].tare)
    assert (found.method, found.interval) == ("hybrid", "calibrated")
    assert found.held
    assert found.consistent
    turned = replace(panda, gravity=(0.0, 0.0, -9.81))
    assert identify(logs[1].run, turned, tare=logs[1].tare).phi == pytest.approx(found.phi)


def test_no_log_is_trusted_less_than_the_logs_that_were_seen():
    """Traits unlike all logs that a bag was trained on, as a profile's are: a UR3e's leaves say 1 in 200 and less then.

    60 is the least trust that 40 new episodes of any shipped arm got.
    """
    calibration = shipped_model(arm("ur3e")).calibration
    assert calibration.bag is not None
    unlike = np.random.default_rng(0).normal(scale=3.0, size=(500, 18))
    assert max(calibration.level * 10.0 ** float(calibration.bag.row(x).mean()) for x in unlike) > 200.0
    assert max(calibration.kappa(x) for x in unlike) <= 60.0

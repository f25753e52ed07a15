"""Evaluation: errors known beforehand come out as stated, baselines are always there, priors do what priors do."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload.arms import rated_effort
from armload.errors import IdentificationError, InertiaError
from armload.estimators import Estimate, Identifier, RecursiveLeastSquares
from armload.inertia import NAMES, InertialParameters
from armload.lab.evaluation import (
    Comparison,
    EvaluationRun,
    PriorLeastSquares,
    TrainingMean,
    catalogued,
    compare,
    coverage,
    half_width,
    mean_absolute_error,
    settling_time,
    spread,
)
from armload.payloads import franka_hand
from armload.posterior.solve import solve
from armload.recording import Recording
from armload.regression import Correction, GaussianPrior
from armload.regression.information import RegressionData
from armload.regression.noise import RIGID

CAMERA = InertialParameters.from_com(1.3, (0.03, -0.02, 0.06), np.diag([4e-3, 5e-3, 3e-3]))
TOOL = InertialParameters.from_com(0.7, (-0.01, 0.01, 0.03), np.diag([1e-3, 2e-3, 1.5e-3]))
FAMILY = [
    InertialParameters.from_com(m, (x, -x, 0.08), m * np.diag([2e-3, 3e-3, 2.5e-3]))
    for m in (0.8, 1.2, 1.6, 2.0)
    for x in (-0.02, 0.0, 0.01)
]


class Says(Identifier):
    """Answers `answer(t)` with a fixed standard deviation."""

    name = "says"

    def __init__(self, arm, answer, std=0.1):
        self.arm, self.answer, self.std = arm, answer, std
        self.reset()

    def reset(self):
        self._start, self._count = None, 0

    def _take(self, t, *_):
        self._start = t[0] if self._start is None else self._start
        self._count += len(t)

    def _estimate(self, t):
        phi = np.asarray(self.answer(t - self._start))
        return Estimate(t, phi, np.diag(np.full(10, self.std**2)), self._count, str(self.arm.frame))


def still(arm, duration=2.0, rate=50.0, start=0.0, source="still"):
    t = start + np.arange(round(duration * rate) + 1) / rate
    zeros = np.zeros((len(t), arm.n))
    return Recording(t, zeros, zeros, zeros, source=source)


def runs_of(arm, payloads, **kwargs):
    return [EvaluationRun(still(arm, **kwargs), p, f"run {k}", seed=k) for k, p in enumerate(payloads)]


# ---------------------------------------------------------------------------- metrics


@given(st.integers(1, 9), st.floats(0.05, 0.99), st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_coverage_of_gaussian_draws_is_the_level(runs, level, seed):
    std = 10.0 ** np.arange(-runs, 0)
    draws = std * np.random.default_rng(seed).normal(size=(20_000, runs))
    share = coverage(draws, std, np.zeros(runs), level)
    assert np.abs(share - level).max() < 5 * np.sqrt(level * (1 - level) / 20_000)


def test_half_widths_are_the_normal_quantiles():
    assert half_width(2.0, 0.6826894921370859) == pytest.approx(2.0, rel=1e-12)
    assert half_width(1.0) == pytest.approx(1.959963984540054)
    with pytest.raises(IdentificationError, match="between 0 and 1"):
        half_width(1.0, 95)


def test_spread_is_of_the_absolute_error_and_zero_for_one_run():
    phi = np.array([[1.0], [-3.0], [5.0]])
    assert mean_absolute_error(phi, 0.0)[0] == 3.0
    assert spread(phi, 0.0)[0] == pytest.approx(2.0)
    assert spread(phi[:1], 0.0)[0] == 0.0


def test_settling_is_the_last_entry_into_the_band():
    times = np.arange(6.0)
    assert settling_time(times, [0.0, 1.0, 5.0, 1.0, 1.1, 1.0], 0.2) == 3.0
    assert settling_time(times, np.ones(6), 0.0) == 0.0
    assert settling_time(times, [np.inf, np.nan, 1.0, 1.0, 1.0, 1.0], 0.2) == 2.0


# ---------------------------------------------------------------------------- compare


def test_a_method_with_a_known_error_gets_exactly_that_error(panda):
    offset = np.linspace(-0.3, 0.6, 10)
    runs = [EvaluationRun(still(panda, start=k * 7.0), p, f"run {k}", seed=k) for k, p in enumerate([CAMERA, TOOL])]
    truths = [CAMERA.phi, TOOL.phi]
    methods = {f"off {k}": Says(panda, lambda t, p=p: p + offset * (1 + t)) for k, p in enumerate(truths)}
    c = compare(methods, runs, times=np.linspace(0.0, 2.0, 5), training=FAMILY, split="by payload")
    for k, (mine, other) in enumerate([truths, truths[::-1]]):
        for i, t in enumerate(c.times):
            wrong = offset * (1 + t)
            errors = np.stack([np.abs(wrong), np.abs(wrong + mine - other)])
            assert c.mae[k, i] == pytest.approx(errors.mean(axis=0), abs=1e-12)
            assert c.spread[k, i] == pytest.approx(errors.std(axis=0, ddof=1), abs=1e-12)
    assert c.samples[0, 0].tolist() == [1, 26, 51, 76, 101]
    assert c.seeds == (0, 1)


def test_every_method_gets_the_same_samples(panda):
    class Hears(Says):
        def reset(self):
            self.heard = []
            super().reset()

        def _take(self, t, *rest):
            self.heard += t.tolist()
            super()._take(t, *rest)

    methods = {name: Hears(panda, lambda _: CAMERA.phi) for name in "ab"}
    log = still(panda)
    compare(methods, [EvaluationRun(log, CAMERA)])
    assert methods["a"].heard == methods["b"].heard == log.t.tolist()


def test_the_nearest_estimate_counts_on_an_uneven_clock(panda):
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.choice([0.8e-3, 1e-3, 1.6e-3, 9e-3], size=1500, p=[0.3, 0.5, 0.18, 0.02]))
    zeros = np.zeros((len(t), panda.n))
    clock = Says(panda, lambda now: np.full(10, now))
    times = np.array([0.05, 0.5, 1.0, 1.5])
    c = compare({"clock": clock}, [EvaluationRun(Recording(t, zeros, zeros, zeros), CAMERA)], times)
    assert c.phi[0, 0, :, 0] == pytest.approx(times, abs=0.03)


def test_both_baselines_are_always_among_the_rows(panda):
    runs = runs_of(panda, [CAMERA])
    trained = compare({"says": Says(panda, lambda _: CAMERA.phi)}, runs, times=[1.0], training=FAMILY)
    assert trained.methods == ("says", TrainingMean.name, PriorLeastSquares.name)
    assert trained.baselines == trained.methods[1:]
    assert trained.phi[1, 0, 0] == pytest.approx(np.mean([p.phi for p in FAMILY], axis=0))
    assert "12 training payloads" in trained.conditions
    untrained = compare({"says": Says(panda, lambda _: CAMERA.phi)}, runs, times=[1.0])
    assert untrained.phi[1, 0, 0] == pytest.approx(np.zeros(10))
    assert "no training payloads" in untrained.conditions


def test_baselines_of_the_caller_are_not_doubled(panda):
    mine = TrainingMean(panda, CAMERA.phi, np.eye(10))
    c = compare({"mine": mine, "says": Says(panda, lambda _: TOOL.phi)}, runs_of(panda, [TOOL]), times=[1.0])
    assert c.methods == ("says", "mine", PriorLeastSquares.name)
    assert c.mae[1, 0] == pytest.approx(np.abs(CAMERA.phi - TOOL.phi))


def test_a_tare_reaches_factories_and_is_subtracted_for_identifiers(panda):
    loaded, empty = still(panda, start=10.0, source="loaded"), still(panda, source="empty")
    phantom = np.full(10, 0.5)
    asked = []

    def factory(tare):
        asked.append(tare)
        return Says(panda, lambda _: TOOL.phi)

    class Haunted(Says):
        def _take(self, t, *rest):
            super()._take(t, *rest)
            self.answer = lambda _: phantom + (CAMERA.phi if self._start == loaded.t[0] else 0.0)

    c = compare(
        {"plain": Haunted(panda, None, std=0.3), "knows": factory},
        [EvaluationRun(loaded, CAMERA, tare=empty)],
        times=[1.0],
        training=FAMILY,
    )
    assert c.phi[0, 0, 0] == pytest.approx(CAMERA.phi)
    assert c.std[0, 0, 0] == pytest.approx(np.full(10, 0.3 * np.sqrt(2)))
    assert all(tare is empty for tare in asked)
    assert c.phi[1, 0, 0] == pytest.approx(TOOL.phi)
    assert c.phi[2, 0, 0] == pytest.approx(np.mean([p.phi for p in FAMILY], axis=0))  # the mean needs no tare


def test_senseless_comparisons_are_refused_in_a_sentence(panda):
    says = {"says": Says(panda, lambda _: CAMERA.phi)}
    run = EvaluationRun(still(panda), CAMERA)
    with pytest.raises(IdentificationError, match="nothing to compare"):
        compare({}, [run])
    with pytest.raises(IdentificationError, match="nothing to compare"):
        compare(says, [])
    with pytest.raises(IdentificationError, match="seconds from 0 to 2"):
        compare(says, [run], times=[1.0, 2.5])
    with pytest.raises(IdentificationError, match="panda_link0"):
        compare(says, [EvaluationRun(still(panda), InertialParameters(CAMERA.phi, "panda_link0"))])
    with pytest.raises(IdentificationError, match="baseline"):
        compare({TrainingMean.name: says["says"]}, [run])


@pytest.mark.parametrize("method", [RecursiveLeastSquares, "rls", lambda _: None, 3])
def test_what_is_no_method_is_refused_by_its_name_and_with_what_one_is(panda, method):
    with pytest.raises(IdentificationError, match=r"'mine'.*expected an Identifier, such as .*lambda tare: "):
        compare({"mine": method}, [EvaluationRun(still(panda), CAMERA)])


def test_methods_without_names_unknown_names_and_whole_payloads_are_refused_in_a_sentence(panda):
    says = Says(panda, lambda _: CAMERA.phi)
    with pytest.raises(IdentificationError, match="expected them by name"):
        compare(says, [EvaluationRun(still(panda), CAMERA)])
    with pytest.raises(InertiaError, match="expected InertialParameters; of a Payload give"):
        compare({"says": says}, [EvaluationRun(still(panda), franka_hand())])
    with pytest.raises(IdentificationError, match="unknown method 'nope, with tare': expected one of hybrid, map-gp"):
        catalogued(panda, "rls", "nope, with tare")


# ---------------------------------------------------------------------------- tables and JSON


@pytest.fixture(scope="module")
def comparison(panda):
    rng = np.random.default_rng(5)
    runs = runs_of(panda, FAMILY[:3])
    methods = {
        "good": Says(panda, lambda t: FAMILY[1].phi * (1 + 0.1 * np.exp(-3 * t)), std=0.01),
        "vague": Says(panda, lambda _: rng.normal(size=10), std=np.inf),
    }
    return compare(methods, runs, times=np.linspace(0, 2, 9), training=FAMILY, split="payloads 70/15/15")


def test_every_table_states_split_seeds_spread_and_baselines(comparison):
    c = comparison
    for table in (c.summary(), c.table(), c.estimates(), c.over_time(), c.intervals()):
        assert "payloads 70/15/15" in table.note
        assert "seeds 0, 1, 2" in table.note
        assert "standard deviation over the runs" in table.note
        assert [table.rows[k][0] for k in table.baselines] == [TrainingMean.name, PriorLeastSquares.name]
        assert table.note in str(table)
        assert all(cell in str(table) for row in table for cell in row)


def test_table_cells_are_the_errors_in_grams(comparison):
    first = comparison.table().rows[0]
    assert first[0] == "good"
    for cell, mean, deviation in zip(first[1:], comparison.mae[0, -1], comparison.spread[0, -1], strict=True):
        value, spread_shown = cell.split(" ± ")
        last_digit = 10.0 ** -len(value.partition(".")[2])
        assert float(value) == pytest.approx(1e3 * mean, rel=0.005, abs=1e-3)
        assert float(spread_shown) == pytest.approx(1e3 * deviation, abs=0.5001 * last_digit)


def test_infinite_intervals_hold_everything_and_say_so(comparison):
    assert (comparison.coverage()[1] == 1.0).all()
    assert comparison.intervals().rows[1][1] == "100% (±∞)"


def test_json_holds_the_whole_comparison(comparison):
    data = json.loads(json.dumps(comparison.to_dict(), allow_nan=False))
    again = Comparison.from_dict(data)
    assert str(again.table()) == str(comparison.table())
    assert str(again.intervals()) == str(comparison.intervals())
    assert data["final"]["good"]["mae"] == pytest.approx(comparison.mae[0, -1])
    assert data["parameters"] == list(NAMES)
    del data["truth"]
    with pytest.raises(IdentificationError, match="truth missing"):
        Comparison.from_dict(data)


# ---------------------------------------------------------------------------- priors


def test_prior_of_a_family_has_its_moments_and_is_never_singular():
    prior = GaussianPrior.of(FAMILY)
    phi = np.array([p.phi for p in FAMILY])
    assert prior.mean == pytest.approx(phi.mean(axis=0))
    assert prior.std == pytest.approx(phi.std(axis=0, ddof=1), rel=0.05, abs=1e-3)
    assert prior.root @ prior.root.T == pytest.approx(prior.covariance, abs=1e-14)
    assert np.linalg.matrix_rank(np.cov(phi.T)) < 10  # the family varies in few directions only
    with pytest.raises(IdentificationError, match="singular"):
        GaussianPrior(np.zeros(10), np.cov(phi.T))
    with pytest.raises(IdentificationError, match="not symmetric"):  # half of one, say: only a half would be read
        GaussianPrior(np.zeros(10), np.triu(np.full((10, 10), 0.1)) + np.eye(10))
    with pytest.raises(IdentificationError, match="at least 2"):
        GaussianPrior.of(FAMILY[:1])


def test_a_payload_prior_enters_as_bayes_rule_says(panda, analytic_log):
    """Oracle: (A + P₀⁻¹)·z = b + P₀⁻¹·z₀ solved densely, with the first iteration's weights."""
    log = analytic_log(panda, CAMERA, duration=1.0)
    correction = Correction(panda, rated_effort(panda))
    data = RegressionData(correction, 20.0)
    data.add(log.t, log.q, log.dq, log.tau)
    prior = GaussianPrior.of(FAMILY)
    size = 10 + correction.size
    residual = (RIGID.residual * correction.effort) ** 2 * data.blocks.block
    A, b = np.einsum("jab,j->ab", data.A, 1 / residual), np.einsum("ja,j->a", data.b, 1 / residual)
    P0, z0 = np.zeros((size, size)), np.zeros(size)
    stated = np.maximum(correction.prior_std, 1e-9)  # gravity is believed
    P0[:10, :10], P0[10:, 10:], z0[:10] = prior.covariance, np.diag(stated**2), prior.mean
    scale = np.sqrt(np.diag(P0))  # units differ by orders of magnitude
    information = np.linalg.inv(P0 / np.outer(scale, scale))
    z = scale * np.linalg.solve(A * np.outer(scale, scale) + information, scale * b + information @ (z0 / scale))
    found = solve([data], np.ones(10), prior, iterations=1)
    assert found.phi == pytest.approx(z[:10], abs=1e-7)
    assert np.abs(z[:10] - prior.mean).max() > 1e-3  # the data say something


def test_same_prior_least_squares_starts_at_the_mean_and_ends_at_the_truth(panda, analytic_log):
    prior = GaussianPrior.of(FAMILY)
    truth = FAMILY[1]
    trace = PriorLeastSquares(panda, prior.mean, prior.covariance).trace(analytic_log(panda, truth, duration=3.0), 100)
    before, after = np.abs(trace[0].phi - prior.mean), np.abs(trace[-1].phi - truth.phi)
    assert (before < 0.5 * prior.std).all()
    assert after[0] < 0.01
    assert (after < 0.2 * prior.std + 1e-3).all()
    assert (trace[-1].std <= prior.std * (1 + 1e-9) + 0.005 * truth.mass).all()


def test_a_prior_is_the_bayesian_product_of_two(panda, analytic_log):
    """Posterior information = prior information + data information: the same data under two priors differ by theirs."""
    log = analytic_log(panda, CAMERA, duration=1.0)
    prior = GaussianPrior.of(FAMILY)
    tight = GaussianPrior(prior.mean, 1e-6 * prior.covariance)
    stuck = PriorLeastSquares(panda, tight.mean, tight.covariance).run(log)
    assert stuck.phi == pytest.approx(prior.mean, abs=0.02 * np.abs(CAMERA.phi - prior.mean).max())
    free = PriorLeastSquares(panda, prior.mean, 1e6 * prior.covariance).run(log)
    assert np.abs(free.phi - CAMERA.phi).max() < np.abs(stuck.phi - CAMERA.phi).max()

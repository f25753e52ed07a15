"""Least squares: the recursion, the observer, the MAP posterior, and error bars for correlated residuals."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from armload.arms import arm, payload_regressor
from armload.errors import IdentificationError
from armload.estimators import FilteredRecursiveLeastSquares, RecursiveLeastSquares, Tared
from armload.inertia import InertialParameters
from armload.posterior import PosteriorLeastSquares
from armload.recording import Recording
from armload.regression import BlockMeans

CAMERA = InertialParameters.from_com(1.3, (0.03, -0.02, 0.06), np.diag([4e-3, 5e-3, 3e-3]))
TOOL = InertialParameters.from_com(0.7, (-0.01, 0.01, 0.03), np.diag([1e-3, 2e-3, 1.5e-3]))
METHODS = [RecursiveLeastSquares, FilteredRecursiveLeastSquares, PosteriorLeastSquares]


def ar1(rng, count, channels, correlation, std):
    """A first-order autoregressive signal; its long-run variance per sample is std²·(1 + a)/(1 − a)."""
    e = np.zeros((count, channels))
    drive = rng.normal(0, std * np.sqrt(1 - correlation**2), (count, channels))
    for k in range(1, count):
        e[k] = correlation * e[k - 1] + drive[k]
    return e


# ---------------------------------------------------------------------------- autocorrelation


def test_batch_means_find_the_long_run_variance_of_an_autoregressive_signal():
    a, std, rate = 0.98, 0.3, 100.0
    signal = ar1(np.random.default_rng(0), 100_000, 1, a, std)
    blocks = BlockMeans(1, block=8.0)
    for value in signal:
        blocks.add(1 / rate, value)
    closed_form = std**2 * (1 + a) / (1 - a) / rate
    assert blocks.long_run_variance()[0] == pytest.approx(closed_form, rel=0.2)
    assert blocks.long_run_variance()[0] > 20 * std**2 / rate  # what independence would claim


def test_joining_blocks_keeps_total_time_and_mean_and_memory():
    blocks, values = BlockMeans(2, block=0.1), np.random.default_rng(1).normal(size=(9000, 2))
    size = len(pickle.dumps(blocks))
    for value in values:
        blocks.add(0.01, value)
    means, times, _ = blocks.means()
    assert blocks.block > 0.1
    assert blocks.duration == pytest.approx(90.0)
    assert np.average(means, axis=0, weights=times) == pytest.approx(values.mean(axis=0), abs=2e-3)
    assert len(pickle.dumps(blocks)) <= size + 64


# ---------------------------------------------------------------------------- every method


@pytest.mark.parametrize("method", METHODS)
def test_streaming_sample_by_sample_equals_the_whole_recording(method, panda, analytic_log):
    log = analytic_log(panda, CAMERA, duration=1.5)
    identifier = method(panda)
    for sample in log:
        streamed = identifier.update(sample)
    whole = method(panda).run(log)
    assert streamed.n_samples == whole.n_samples == len(log)
    # torque scale and refresh instants differ at most by rounding and by the age of the last solution
    assert streamed.phi == pytest.approx(whole.phi, abs=2e-3 if method is PosteriorLeastSquares else 1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_reset_forgets_everything(method, panda, analytic_log):
    log, other = analytic_log(panda, CAMERA, duration=1.0), analytic_log(panda, TOOL, duration=1.0, phase=1.0)
    identifier = method(panda)
    first = identifier.run(log)
    identifier.run(other)
    again = identifier.run(log)
    assert np.array_equal(first.phi, again.phi)
    assert np.array_equal(first.covariance, again.covariance)


@pytest.mark.parametrize("method", METHODS)
def test_memory_does_not_grow_with_the_stream(method, panda, analytic_log):
    log = analytic_log(panda, CAMERA, duration=20.0, rate=50.0)
    identifier, sizes = method(panda), []
    for k, sample in enumerate(log):
        identifier.update(sample)
        if k in (400, 999):
            if hasattr(identifier, "close"):
                identifier.close()  # threads are not its memory
            sizes.append(len(pickle.dumps({n: v for n, v in vars(identifier).items() if n != "arm"})))
    assert sizes[1] <= sizes[0] + 256


@pytest.mark.parametrize("method", METHODS)
def test_a_recording_of_another_arm_is_refused(method, panda):
    log = Recording(np.arange(5) * 0.01, np.zeros((5, 6)), np.zeros((5, 6)), np.zeros((5, 6)))
    with pytest.raises(IdentificationError, match="6 joints"):
        method(panda).run(log)


@pytest.mark.parametrize("method", METHODS)
def test_exact_data_give_the_payload_back(method, any_arm, analytic_log):
    log = analytic_log(any_arm, CAMERA, rate=1000.0)
    phi = method(any_arm).run(log).phi
    scale = np.array([1.0] + [0.1] * 3 + [0.01] * 6)  # kg, 0.1 kg·m, 0.01 kg·m²
    # the benchmark's lag of q and dq is not exact (F[Y(q)] ≠ Y(F[q])); the backward difference lags half a sample,
    # which tells on the heavy UR10e
    tolerance = {"rls": 0.25, "rls-filter": 0.4, "map": 0.05}[method.name]
    assert np.abs((phi - CAMERA.phi) / scale).max() < tolerance
    # map keeps a little of the payload for the links, whose prior is wide for nominal figures
    assert phi[0] == pytest.approx(CAMERA.mass, rel={"rls": 1e-3, "rls-filter": 0.02, "map": 3e-3}[method.name])


# ---------------------------------------------------------------------------- the recursion


def test_recursive_least_squares_equals_the_batch_solution_with_the_same_prior(panda, analytic_log):
    rng = np.random.default_rng(3)
    log = analytic_log(panda, CAMERA, duration=2.0, extra=lambda q, _: rng.normal(0, 0.2, q.shape))
    ddq = np.diff(log.dq, axis=0) / np.diff(log.t)[:, None]
    y = log.tau[1:] - panda.torque(log.q[1:], log.dq[1:], ddq)
    Y = payload_regressor(panda.frame_motion(log.q[1:]), log.dq[1:], ddq).reshape(-1, 10)
    prior = np.diag(np.array([10.0] + [1.0] * 3 + [0.3] * 6) ** -2.0)
    batch = np.linalg.solve(Y.T @ Y + prior, Y.T @ y.ravel())
    assert RecursiveLeastSquares(panda).run(log).phi == pytest.approx(batch, abs=1e-8)


def test_forgetting_follows_a_payload_that_changes(panda, analytic_log):
    before, after = analytic_log(panda, CAMERA, duration=3.0), analytic_log(panda, TOOL, duration=3.0, start=3.0)
    both = Recording(*(np.concatenate([getattr(before, x), getattr(after, x)]) for x in ("t", "q", "dq", "tau")))
    remembers = RecursiveLeastSquares(panda).run(both).phi[0]
    forgets = RecursiveLeastSquares(panda, forgetting=0.98).run(both).phi[0]
    assert abs(forgets - TOOL.mass) < 0.01 < abs(remembers - TOOL.mass)


def test_a_higher_observer_gain_shrinks_the_error_of_lagging_the_signals(panda, analytic_log):
    log = analytic_log(panda, CAMERA, rate=1000.0)
    errors = [
        np.abs(FilteredRecursiveLeastSquares(panda, gain=gain).run(log).phi - CAMERA.phi)[4:].max() for gain in (10, 50)
    ]
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("method", [RecursiveLeastSquares, FilteredRecursiveLeastSquares])
def test_virtual_calibration_removes_what_an_unloaded_run_shows(method, panda, analytic_log):
    heavier = panda.link_parameters
    heavier[5:] *= 1.05  # the real arm: links 6 and 7 are 5 % heavier than the model
    real = panda.with_links(heavier)
    unloaded, loaded = analytic_log(real, phase=0.7), analytic_log(real, CAMERA)
    plain = method(panda).run(loaded).phi[0] - CAMERA.mass
    tared = Tared(method(panda), unloaded)
    assert tared.before.phi[0] > 0.03
    assert abs(tared.run(loaded).phi[0] - CAMERA.mass) < 0.3 * abs(plain)


# ---------------------------------------------------------------------------- MAP


def test_a_tare_with_a_tool_on_another_motion_leaves_what_was_added(panda, analytic_log):
    links = panda.link_parameters
    links[3:] *= 1.03
    real = panda.with_links(links)

    def friction(_, dq):
        return 0.3 * np.tanh(dq / 0.06) + 0.1

    tare = analytic_log(real, TOOL, phase=1.3, duration=12.0, extra=friction)
    loaded = analytic_log(real, TOOL + CAMERA, extra=friction)
    estimate = PosteriorLeastSquares(panda, tare).run(loaded)
    error = np.abs(estimate.phi - CAMERA.phi)
    assert error[0] < 0.01
    assert error[1:4].max() < 2e-3
    without = PosteriorLeastSquares(panda).run(loaded)
    assert without.phi[0] > CAMERA.mass + 0.5 * TOOL.mass  # the tool counts as payload then


def test_intervals_of_map_cover_the_truth_under_correlated_noise_where_naive_ones_do_not(panda, analytic_log):
    covered, naive, episodes = 0, 0, 24
    for seed in range(episodes):
        rng = np.random.default_rng(seed)
        noise = ar1(rng, 1200, 7, 0.99, 0.15)
        log = analytic_log(panda, CAMERA, extra=lambda *_, noise=noise: noise, phase=seed)
        estimate = PosteriorLeastSquares(panda).run(log)
        inside = np.abs(estimate.phi - CAMERA.phi) < 1.96 * estimate.std
        covered += inside.sum()
        ddq = np.gradient(log.dq, log.t, axis=0)
        Y = payload_regressor(panda.frame_motion(log.q), log.dq, ddq).reshape(-1, 10)
        y = (log.tau - panda.torque(log.q, log.dq, ddq)).ravel()
        fit, (rss,), *_ = np.linalg.lstsq(Y, y, rcond=None)
        sigma = np.sqrt(np.diag(np.linalg.inv(Y.T @ Y)) * rss / (len(y) - 10))
        naive += np.sum(np.abs(fit - CAMERA.phi) < 1.96 * sigma)
    assert covered / (10 * episodes) > 0.93
    assert naive / (10 * episodes) < 0.6


def test_a_gap_in_the_log_does_not_bend_the_estimate(panda, analytic_log):
    log = analytic_log(panda, CAMERA)
    gappy = log.select((log.t < 2.0) | (log.t > 2.6))
    whole, cut = PosteriorLeastSquares(panda).run(log), PosteriorLeastSquares(panda).run(gappy)
    assert cut.phi == pytest.approx(whole.phi, abs=2e-3)


def test_motor_side_friction_is_recognised_and_widens_the_interval(panda, analytic_log):
    scale = panda.limits.effort

    def motor_friction(_, dq):
        return 0.05 * scale * np.tanh(dq / 0.06)

    link, motor = PosteriorLeastSquares(panda), PosteriorLeastSquares(panda)
    narrow = link.run(analytic_log(panda, CAMERA))
    wide = motor.run(analytic_log(panda, CAMERA, extra=motor_friction))
    assert (link.posterior.torque, motor.posterior.torque) == ("link", "motor")
    assert wide.std[0] > narrow.std[0]
    assert wide.phi[0] == pytest.approx(CAMERA.mass, abs=0.05)


def test_where_torque_is_known_to_be_the_motors_a_log_at_rest_says_less(analytic_log):
    ur = arm("ur10e")
    link = replace(ur, motor_torque=False)
    log = analytic_log(ur, CAMERA, rate=100.0)
    still = replace(log, q=np.tile(log.q[:1], (len(log), 1)), dq=0.0 * log.dq, tau=np.tile(log.tau[:1], (len(log), 1)))
    known, unknown = PosteriorLeastSquares(ur), PosteriorLeastSquares(link)
    assert known.run(still).std[0] > 2.0 * unknown.run(still).std[0]
    assert (known.posterior.torque, unknown.posterior.torque) == ("motor", "link")


def test_rows_are_bounded_at_high_rates_so_that_a_minute_at_1_khz_is_light(panda, analytic_log):
    log = analytic_log(panda, CAMERA, duration=3.0, rate=1000.0)
    coarse = log.select(slice(None, None, 5))
    fine, thin = PosteriorLeastSquares(panda).run(log), PosteriorLeastSquares(panda).run(coarse)
    assert fine.phi == pytest.approx(thin.phi, abs=1e-3)
    assert fine.n_samples == 5 * thin.n_samples


def test_clock_is_only_the_log_s(panda, analytic_log):
    early, late = analytic_log(panda, CAMERA, duration=1.0), analytic_log(panda, CAMERA, duration=1.0)
    moved = Recording(late.t + 1.7e9, late.q, late.dq, late.tau)  # a ROS time stamp
    assert PosteriorLeastSquares(panda).run(moved).phi == pytest.approx(
        PosteriorLeastSquares(panda).run(early).phi, abs=1e-6
    )

"""Estimators beside plain least squares: consistent, torque difference, joint with the arm, extended Kalman filter."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import least_squares, minimize

from armload.arms import Arm, ForwardDynamics
from armload.errors import IdentificationError, InertiaError
from armload.estimators import (
    ConsistentLeastSquares,
    DifferenceLeastSquares,
    ExtendedKalmanFilter,
    JointLeastSquares,
    LogCholeskyLeastSquares,
    Tared,
    WeightedLeastSquares,
)
from armload.estimators.constrained import _CHART_MEAN, _CHART_STD, entropic_pull, fit_chart
from armload.inertia import (
    InertialParameters,
    from_log_cholesky,
    is_consistent,
    log_cholesky,
    log_cholesky_curvature,
    log_cholesky_jacobian,
    nearest_consistent,
    pseudo_inertia,
)
from armload.recording import Recording, same_motion
from armload.regression.mismatch import FRICTION_WIDTH

CAMERA = InertialParameters.from_com(1.3, (0.03, -0.02, 0.06), np.diag([4e-3, 5e-3, 3e-3]))
TOOL = InertialParameters.from_com(0.7, (-0.01, 0.01, 0.03), np.diag([1e-3, 2e-3, 1.5e-3]))
UNITS = np.array([1.0] + [0.1] * 3 + [0.01] * 6)  # kg, 0.1 kg·m, 0.01 kg·m²


def noisy(log: Recording, seed: int, tau: float) -> Recording:
    e = np.random.default_rng(seed).normal(0, tau, log.tau.shape)
    return Recording(log.t, log.q, log.dq, log.tau + e)


def joined(*logs: Recording, pause: float) -> Recording:
    """Logs one after another, each starting `pause` after the end of the one before."""
    t, start = [], 0.0
    for log in logs:
        t.append(log.t - log.t[0] + start)
        start = t[-1][-1] + pause
    columns = (np.concatenate([getattr(log, name) for log in logs]) for name in ("q", "dq", "tau"))
    return Recording(np.concatenate(t), *columns)


def unmodelled(q, dq):
    """A torque no rigid body makes: friction, offset, and something smooth in the configuration."""
    return 0.3 * np.tanh(dq / FRICTION_WIDTH) + 0.2 + 0.4 * np.sin(1.3 * q + np.arange(q.shape[1]))


# ---------------------------------------------------------------------------- physically consistent least squares


def test_the_chart_s_derivatives_are_its_differences():
    theta = log_cholesky(CAMERA.phi) + 0.1 * np.random.default_rng(0).normal(size=10)
    h = 1e-6
    differences = [(from_log_cholesky(theta + h * e) - from_log_cholesky(theta - h * e)) / (2 * h) for e in np.eye(10)]
    assert log_cholesky_jacobian(theta) == pytest.approx(np.array(differences).T, rel=1e-6, abs=1e-9)
    weights = np.random.default_rng(1).normal(size=10) / UNITS
    change = [log_cholesky_jacobian(theta + h * e) - log_cholesky_jacobian(theta - h * e) for e in np.eye(10)]
    second = np.array([weights @ x for x in change]) / (2 * h)
    assert log_cholesky_curvature(theta, weights) == pytest.approx(second, abs=1e-7 * np.abs(second).max())


def off_the_cone(seed):
    """Ten numbers that are no body, with an information matrix that knows them unevenly."""
    rng = np.random.default_rng(seed)
    phi = CAMERA.phi + UNITS * rng.normal(0, [0.1] + [0.3] * 3 + [0.8] * 6)
    root = rng.normal(size=(10, 10)) / UNITS
    return phi, 3.0 * root.T @ root


def test_the_chart_s_fit_is_the_one_of_a_general_solver():
    for seed in range(3):
        phi, information = off_the_cone(seed)
        root = np.linalg.cholesky(information).T

        def residual(theta, phi=phi, root=root):
            return np.concatenate([root @ (from_log_cholesky(theta) - phi), (theta - _CHART_MEAN) / _CHART_STD])

        start = log_cholesky(nearest_consistent(phi, information, 1e-3))
        oracle = least_squares(residual, start, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=50_000)
        assert from_log_cholesky(fit_chart(phi, information)) / UNITS == pytest.approx(
            from_log_cholesky(oracle.x) / UNITS, abs=1e-4
        )


def test_the_entropic_pull_is_the_minimum_a_general_solver_finds_in_the_chart():
    reference, pull = TOOL.phi, 3.0
    inverse = np.linalg.inv(pseudo_inertia(reference))
    for seed in range(3):
        phi, information = off_the_cone(seed)

        def cost(theta, phi=phi, information=information):
            x = from_log_cholesky(theta)
            J = pseudo_inertia(x)
            divergence = np.trace(inverse @ J) - np.linalg.slogdet(inverse @ J)[1] - 4
            return (x - phi) @ information @ (x - phi) + pull * divergence

        found = entropic_pull(phi, information, reference, pull)
        oracle = minimize(cost, log_cholesky(reference), method="BFGS", options={"gtol": 1e-7, "maxiter": 2000})
        assert is_consistent(found)
        assert cost(log_cholesky(found)) <= oracle.fun + 1e-6 * abs(oracle.fun)
        assert found / UNITS == pytest.approx(from_log_cholesky(oracle.x) / UNITS, abs=2e-3)


def test_a_strong_pull_ends_at_the_reference_and_a_weak_one_at_the_nearest_body():
    phi, information = off_the_cone(1)
    assert not is_consistent(phi)
    strong = entropic_pull(phi, information, TOOL.phi, 1e9)
    weak = entropic_pull(phi, information, TOOL.phi, 1e-6)
    assert strong / UNITS == pytest.approx(TOOL.phi / UNITS, abs=1e-4)
    assert weak / UNITS == pytest.approx(nearest_consistent(phi, information, 1e-9) / UNITS, abs=1e-2)


@pytest.mark.parametrize("kind", [ConsistentLeastSquares, LogCholeskyLeastSquares])
def test_consistent_methods_equal_weighted_least_squares_well_inside_the_cone(kind, panda, analytic_log):
    log = noisy(analytic_log(panda, CAMERA, duration=4.0), 0, 0.05)
    found, free = kind(panda).run(log), WeightedLeastSquares(panda).run(log)
    assert is_consistent(free.phi)
    assert np.abs(found.phi - free.phi).max() < 1e-3
    assert np.all(np.abs(found.phi - free.phi) < 0.5 * free.std)
    assert found.std == pytest.approx(free.std, rel=0.2)


def test_consistent_methods_give_bodies_all_along_a_log_and_better_inertia(panda, analytic_log):
    point = InertialParameters.from_com(0.4, (0.02, 0.0, 0.05), 1e-5 * np.eye(3))
    errors: dict[type, list] = {WeightedLeastSquares: [], ConsistentLeastSquares: [], LogCholeskyLeastSquares: []}
    for seed in range(3):
        log = noisy(analytic_log(panda, point, duration=2.0, rate=100.0), seed, 1.0)
        for kind, found in errors.items():
            trace = kind(panda).trace(log, every=20)
            found.append(np.abs(trace[-1].phi - point.phi)[4:].mean())
            if kind is not WeightedLeastSquares:
                assert all(is_consistent(estimate.phi) for estimate in trace)
            else:
                assert not is_consistent(trace[-1].phi)
    free = np.mean(errors.pop(WeightedLeastSquares))
    assert all(np.mean(found) < 0.7 * free for found in errors.values())


@pytest.mark.parametrize("kind", [ConsistentLeastSquares, LogCholeskyLeastSquares])
def test_a_tare_is_taken_off_before_the_answer_is_made_a_body(kind, panda, analytic_log):
    tare, run = (analytic_log(panda, load, rate=100.0) for load in (TOOL, TOOL + CAMERA))
    found = kind(panda, tare).run(run)
    assert found.phi / UNITS == pytest.approx(CAMERA.phi / UNITS, abs=0.02)
    difference = Tared(WeightedLeastSquares(panda), tare).run(run)
    assert is_consistent(kind(panda, run).run(tare).phi)  # less than nothing was added: still a body
    assert found.phi / UNITS == pytest.approx(difference.phi / UNITS, abs=0.02)


def test_a_reference_that_is_no_body_and_a_pull_of_nothing_are_refused(panda):
    with pytest.raises(InertiaError, match="not strictly physically consistent"):
        ConsistentLeastSquares(panda, reference=InertialParameters(np.r_[1.0, np.zeros(9)]))
    with pytest.raises(IdentificationError, match="pull"):
        ConsistentLeastSquares(panda, reference=CAMERA, pull=0.0)


# ---------------------------------------------------------------------------- the same motion


def at_rate(log: Recording, rate: float) -> Recording:
    t = np.arange(log.t[0], log.t[-1], 1.0 / rate)
    columns = (np.stack([np.interp(t, log.t, c) for c in x.T], axis=1) for x in (log.q, log.dq, log.tau))
    return Recording(t, *columns)


@pytest.fixture(scope="module")
def long_log():
    """20 s of a motion that never returns, at 500 Hz; its torques do not matter."""
    t = np.arange(0, 20, 2e-3)
    w = np.array([0.7, 1.1, 1.9])
    q, dq = np.sin(t[:, None] * w + [0, 1, 2]), w * np.cos(t[:, None] * w + [0, 1, 2])
    return Recording(t, q, dq, q)


def test_a_shift_of_seconds_is_found_to_a_tenth_of_a_millisecond(long_log):
    run = long_log.between(7.3, 13.3)
    run = Recording(run.t - 100.0, run.q, run.dq, run.tau)
    found = same_motion(run, long_log)
    assert found is not None
    assert [piece.shift for piece in found.pieces] == pytest.approx([100.0], abs=1e-4)
    assert found.coverage > 0.99
    assert found.deviation < 1e-3


def test_rates_lost_samples_and_small_differences_between_the_runs_do_not_matter(long_log):
    rng = np.random.default_rng(0)
    run = at_rate(long_log.between(3.0, 9.0), 87.0)
    run = run.select(rng.random(len(run)) > 0.2)
    run = Recording(run.t, run.q + 0.004 * np.sin(run.t)[:, None] + 1e-4 * rng.normal(size=run.q.shape), run.dq, run.q)
    tare = at_rate(long_log, 200.0)
    found = same_motion(run, tare.select(rng.random(len(tare)) > 0.1))
    assert found is not None
    assert found.pieces[0].shift == pytest.approx(0.0, abs=5e-3)
    assert found.coverage > 0.95
    assert 1e-3 < found.deviation < 0.02


def test_a_run_longer_than_the_tare_is_found_as_far_as_the_tare_goes(long_log):
    found = same_motion(long_log.between(2.0, 12.0), long_log.between(4.0, 10.0))
    assert found is not None
    assert found.pieces[0].start < 4.5
    assert found.pieces[-1].stop == pytest.approx(10.0, abs=0.05)
    assert 0.5 < found.coverage < 0.7
    times = found.tare_times([3.0, 7.0, 11.0])
    assert np.isnan(times[[0, 2]]).all()
    assert times[1] == pytest.approx(7.0, abs=1e-4)


def test_a_periodic_run_finds_each_of_its_periods_in_a_tare_of_one():
    t = np.arange(0, 24, 0.01)
    angle = 2 * np.pi / 6 * t[:, None] * np.array([1.0, 2.0, 3.0])
    q, dq = np.sin(angle), 2 * np.pi / 6 * np.array([1.0, 2.0, 3.0]) * np.cos(angle)
    whole = Recording(t, q, dq, q)
    found = same_motion(whole, whole.between(0.0, 6.0))
    assert found is not None
    assert found.coverage > 0.9
    assert found.pieces[-1].stop > 23.5
    for piece in found.pieces:
        assert piece.shift % 6.0 == pytest.approx(0.0, abs=1e-3) or piece.shift % 6.0 == pytest.approx(6.0, abs=1e-3)


def test_a_pause_that_only_one_of_them_makes_is_bridged(long_log):
    first, second = long_log.between(0.0, 5.0), long_log.between(5.0, 10.0)
    waiting = Recording(np.arange(0, 3, 2e-3), *(np.tile(x[-1], (1500, 1)) for x in (first.q, 0 * first.q, first.q)))
    found = same_motion(joined(first, waiting, second, pause=2e-3), long_log)
    assert found is not None
    shifts = [piece.shift for piece in found.pieces]
    assert shifts[0] == pytest.approx(0.0, abs=1e-3)
    assert shifts[-1] == pytest.approx(-3.0, abs=5e-3)
    assert found.coverage > 0.9


def test_another_motion_standing_still_and_another_arm_are_not_the_same_motion(long_log):
    mirrored = Recording(long_log.t, -long_log.q, -long_log.dq, long_log.tau)
    backwards = Recording(long_log.t, long_log.q[::-1], -long_log.dq[::-1], long_log.tau)
    faster = Recording(long_log.t / 1.3, long_log.q, 1.3 * long_log.dq, long_log.tau)
    still = Recording(long_log.t, 0 * long_log.q, 0 * long_log.q, long_log.tau)
    fewer = Recording(long_log.t, long_log.q[:, :2], long_log.dq[:, :2], long_log.tau[:, :2])
    for other in (mirrored, backwards, faster, still, fewer):
        assert same_motion(long_log, other) is None
        assert same_motion(other, long_log) is None
    assert same_motion(still, still) is None


# ---------------------------------------------------------------------------- torque difference


def test_the_difference_removes_what_no_model_holds(panda, analytic_log):
    run = analytic_log(panda, CAMERA, extra=unmodelled)
    tare = analytic_log(panda, extra=unmodelled, rate=333.0, duration=9.0, start=-2.0)
    tare = Recording(tare.t + 50.0, tare.q, tare.dq, tare.tau)
    found = DifferenceLeastSquares(panda, tare).run(run)
    plain = Tared(WeightedLeastSquares(panda), tare).run(run)
    assert found.phi / UNITS == pytest.approx(CAMERA.phi / UNITS, abs=2e-3)
    assert np.abs(plain.phi - CAMERA.phi)[0] > 5 * np.abs(found.phi - CAMERA.phi)[0]


def test_the_nominal_arm_makes_up_for_motions_that_differ_a_little(panda, analytic_log):
    run, tare = analytic_log(panda, CAMERA), analytic_log(panda, phase=0.02)
    found = DifferenceLeastSquares(panda, tare).run(run)
    assert found.phi / UNITS == pytest.approx(CAMERA.phi / UNITS, abs=2e-3)


def test_the_difference_is_what_was_added_since_the_tare(panda, analytic_log):
    tare, run = (analytic_log(panda, load, extra=unmodelled) for load in (TOOL, TOOL + CAMERA))
    found = DifferenceLeastSquares(panda, tare).run(run)
    assert found.phi / UNITS == pytest.approx(CAMERA.phi / UNITS, abs=2e-3)
    assert DifferenceLeastSquares(panda, run).run(tare).phi[0] == pytest.approx(-CAMERA.mass, abs=2e-3)


def test_a_gap_and_a_tare_with_a_gap_cost_their_rows_only(panda, analytic_log):
    run, tare = analytic_log(panda, CAMERA, extra=unmodelled), analytic_log(panda, extra=unmodelled)
    run = run.select((run.t < 2.0) | (run.t > 2.6))
    tare = tare.select((tare.t < 4.0) | (tare.t > 4.3))
    found = DifferenceLeastSquares(panda, tare).run(run)
    assert found.phi / UNITS == pytest.approx(CAMERA.phi / UNITS, abs=2e-3)


def test_a_tare_of_another_motion_is_refused_in_one_sentence_and_a_stream_learns_nothing(panda, analytic_log):
    run, other = analytic_log(panda, CAMERA, rate=100.0), analytic_log(panda, rate=100.0, phase=2.0)
    difference = DifferenceLeastSquares(panda, other)
    with pytest.raises(IdentificationError, match="does not show the motion") as caught:
        difference.run(run)
    assert "expected at least 50%" in str(caught.value)
    assert str(caught.value).count(". ") == 0
    difference.reset()
    for sample in run:
        estimate = difference.update(sample)
    assert estimate.phi == pytest.approx(np.zeros(10))
    assert np.all(estimate.std > UNITS)


def test_two_copies_of_one_log_say_no_more_than_the_torque_is_known(panda, analytic_log):
    log = analytic_log(panda, CAMERA, extra=unmodelled)
    found = DifferenceLeastSquares(panda, log).run(log)
    assert found.phi == pytest.approx(np.zeros(10), abs=1e-12)
    # a thousand rows of 1e-3 N·m each, with lever arms of a metre at most and 9.81 m/s², tell no mass below 3e-6 kg
    assert found.std[0] > 1e-3 / np.sqrt(1e3) / 9.81


def test_the_intervals_of_the_difference_cover_the_truth_under_correlated_noise(panda, analytic_log):
    clean, tare = analytic_log(panda, CAMERA, rate=100.0, duration=10.0), analytic_log(panda, rate=100.0, duration=10.0)
    inside = []
    for seed in range(10):
        rng, e = np.random.default_rng(seed), np.zeros((len(clean), 7))
        for k in range(1, len(clean)):
            e[k] = 0.95 * e[k - 1] + rng.normal(0, 0.02, 7)
        found = DifferenceLeastSquares(panda, tare).run(Recording(clean.t, clean.q, clean.dq, clean.tau + e))
        inside.append(np.abs(found.phi - CAMERA.phi) < 1.96 * found.std)
    assert np.mean(inside) > 0.85


# ---------------------------------------------------------------------------- joint identification


def torque_regressor(arm: Arm, q, dq, ddq):
    """What a joint torque can be, from Pinocchio's regressor and the friction model: (N·n, 10·n + 4·n)."""
    model = pin.buildModelFromXML(arm.urdf)
    data = model.createData()
    rows = []
    for k in range(len(q)):
        links = pin.computeJointTorqueRegressor(model, data, q[k], dq[k], ddq[k])
        own = [np.eye(arm.n), np.diag(np.tanh(dq[k] / FRICTION_WIDTH)), np.diag(dq[k]), np.diag(ddq[k])]
        rows.append(np.concatenate([links, *own], axis=1))
    return np.concatenate(rows)


def test_the_base_parameters_are_as_many_as_another_engine_s_regressor_has_rank(any_arm, analytic_log):
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.uniform(-2, 2, (3, 100, any_arm.n))
    rank = np.linalg.matrix_rank(torque_regressor(any_arm, q, dq, ddq), tol=1e-8)
    losses = any_arm.n if any_arm.motor_torque else 0  # of the gears, which that regressor knows nothing of
    assert JointLeastSquares(any_arm, analytic_log(any_arm, duration=0.5, rate=50.0)).base_size == rank + losses


def test_joint_identification_finds_the_payload_on_an_arm_whose_links_are_all_wrong(panda, analytic_log):
    rng = np.random.default_rng(0)
    other = panda.with_links(panda.link_parameters * rng.uniform(0.8, 1.2, (7, 1)))
    friction = lambda _, dq: 0.5 * np.tanh(dq / FRICTION_WIDTH) + 0.3 * dq + 0.4  # noqa: E731
    # where friction meets a velocity near zero it is not known; the motions here cross it, so it is not exact
    tare = analytic_log(other, TOOL, duration=20.0, phase=1.0, extra=friction)
    run = analytic_log(other, TOOL + CAMERA, extra=friction)
    found = JointLeastSquares(panda, tare).run(run)
    plain = Tared(WeightedLeastSquares(panda), tare).run(run)
    assert found.phi / UNITS == pytest.approx(CAMERA.phi / UNITS, abs=0.02)
    assert np.all(np.abs(found.phi - CAMERA.phi) < 0.1 * np.abs(plain.phi - CAMERA.phi).max())


def test_what_the_motions_do_not_excite_is_unknown_to_joint_identification(panda, analytic_log):
    t = np.arange(0, 4, 0.01)
    still = np.tile([0.2, -0.6, 0.3, -1.8, 0.2, 1.6, 0.4], (len(t), 1))
    run = Recording(t, still, 0 * still, panda.with_payload(CAMERA).torque(still))
    found = JointLeastSquares(panda, analytic_log(panda, rate=50.0)).run(run)
    assert np.all(found.std[4:] > 0.5)  # a posture says nothing of inertia
    assert np.all(np.isfinite(found.phi))
    moved = JointLeastSquares(panda, analytic_log(panda, rate=50.0)).run(analytic_log(panda, CAMERA, rate=50.0))
    assert np.all(moved.std[4:] < 0.1)


# ---------------------------------------------------------------------------- forward dynamics, extended Kalman filter


def test_forward_dynamics_with_a_payload_inverts_newton_euler(any_arm):
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-1, 1, (3, any_arm.n))
    tau = any_arm.with_payload(CAMERA).torque(q, dq, ddq)
    assert ForwardDynamics(any_arm)(q, dq, tau, CAMERA.phi) == pytest.approx(ddq, abs=1e-8)


def test_the_derivatives_of_forward_dynamics_are_its_differences(any_arm):
    rng = np.random.default_rng(1)
    q, dq, tau = rng.uniform(-1, 1, (3, any_arm.n))
    dynamics, phi = ForwardDynamics(any_arm), CAMERA.phi
    found = dynamics.derivatives(q, dq, tau, phi)
    assert found.ddq == pytest.approx(dynamics(q, dq, tau, phi))

    def differences(of, x, h):
        return np.array([(of(x + h * e) - of(x - h * e)) / (2 * h) for e in np.eye(len(x))]).T

    numeric = {
        "by_q": differences(lambda x: dynamics(x, dq, tau, phi), q, 1e-6),
        "by_dq": differences(lambda x: dynamics(q, x, tau, phi), dq, 1e-6),
        "by_tau": differences(lambda x: dynamics(q, dq, x, phi), tau, 1e-4),
        "by_phi": differences(lambda x: dynamics(q, dq, tau, x), phi, 1e-7),
    }
    for name, matrix in numeric.items():
        assert getattr(found, name) == pytest.approx(matrix, abs=1e-5 * np.abs(matrix).max()), name


def test_the_filter_finds_the_payload_of_an_exact_log_and_its_covariance_stays_a_covariance(panda, analytic_log):
    log = analytic_log(panda, CAMERA, duration=3.0)
    trace = ExtendedKalmanFilter(panda).trace(log, every=60)
    assert trace[-1].phi / UNITS == pytest.approx(CAMERA.phi / UNITS, abs=0.03)
    for estimate in trace:
        C = estimate.covariance / np.outer(estimate.std, estimate.std)
        assert np.array_equal(estimate.covariance, estimate.covariance.T)
        assert np.linalg.eigvalsh(C)[0] > 0
    assert np.all(trace[-1].std < trace[1].std)


def test_the_filter_tells_friction_from_payload(panda, analytic_log):
    friction = lambda _, dq: 0.4 * np.tanh(dq / FRICTION_WIDTH) + 0.2  # noqa: E731
    found = ExtendedKalmanFilter(panda).run(analytic_log(panda, CAMERA, duration=3.0, extra=friction))
    assert np.all(np.abs(found.phi - CAMERA.phi) < 3 * found.std)
    assert found.phi[:4] / UNITS[:4] == pytest.approx(CAMERA.phi[:4] / UNITS[:4], abs=0.15)


@pytest.mark.full
def test_the_filter_s_error_is_as_large_as_its_covariance_says(panda, analytic_log):
    """Normalised squared error of ten parameters: chi-square, 10 on average, under the noise the filter assumes."""
    clean, density, squares = analytic_log(panda, CAMERA, duration=2.0), 0.05, []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        e = density * np.sqrt(200.0) * rng.normal(size=clean.tau.shape)  # white, of this density at 200 Hz
        log = Recording(clean.t, clean.q, clean.dq + 2e-3 * rng.normal(size=e.shape), clean.tau + e)
        found = ExtendedKalmanFilter(panda, torque_density=density).run(log)
        away = found.phi - CAMERA.phi
        squares.append(away @ np.linalg.solve(found.covariance, away))
    assert 4.0 < np.mean(squares) < 20.0


def test_the_filter_begins_the_joints_anew_after_a_gap(panda, analytic_log):
    log = analytic_log(panda, CAMERA, duration=3.0)
    log = log.select((log.t < 1.0) | (log.t > 2.0))
    assert ExtendedKalmanFilter(panda).run(log).phi[0] == pytest.approx(CAMERA.mass, abs=0.02)


def test_noise_that_is_not_positive_is_refused(panda):
    with pytest.raises(IdentificationError, match="positive"):
        ExtendedKalmanFilter(panda, velocity_noise=0.0)

"""The rivals of the study: least squares on a derivative or behind an observer, against independent implementations."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload.estimators import FilteredRecursiveLeastSquares, RecursiveLeastSquares
from armload.inertia import InertialParameters
from armload.lab.evaluation import EvaluationRun
from armload.lab.study import FULL, QUICK, Basis
from armload.lab.study.readings import reading_specs
from armload.lab.study.rivals import (
    FORGETTING,
    GRID,
    Rival,
    acceleration,
    answers,
    equations,
    recursive,
    rivals,
    tune,
)
from armload.recording import Recording

LOAD = InertialParameters.from_com(1.3, (0.03, -0.02, 0.06), np.diag([4e-3, 5e-3, 3e-3]))
# Pinocchio orders the moments of inertia Ixx Ixy Iyy Ixz Iyz Izz
OURS = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]


@pytest.fixture
def log(analytic_log, panda):
    """A noisy log that starts at rest for as long as the lags need."""
    made = analytic_log(panda, LOAD, duration=2.5, rate=500.0)
    rng = np.random.default_rng(4)
    return replace(
        made,
        dq=made.dq + 2e-3 * rng.normal(size=made.dq.shape),
        tau=made.tau + 0.05 * rng.normal(size=made.tau.shape),
    )


# ------------------------------------------------------------------ [7], from its formulas


def kurdas(arm, log, gain, start):
    """phi (10,) by reference [7] written anew: momentum observer, matched filter, least squares, all from Pinocchio.

    Observer (De Luca et al.): r = K·(p(t) − p(0) − ∫(tau + Cᵀ·dq − g + r) ds), the external torque behind a lag; a load
    adds the torque −r. Filter: x' = K·(u − x) for q and dq, its derivative for the acceleration. Rows from `start` [s].
    """
    model = pin.buildModelFromXML(arm.urdf)
    model.gravity.linear = np.array(arm.gravity)
    data, frame = model.createData(), model.getFrameId(arm.frame)
    p, u = [], []
    for q, dq, tau in zip(log.q, log.dq, log.tau, strict=True):
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        C = pin.computeCoriolisMatrix(model, data, q, dq)
        g = pin.computeGeneralizedGravity(model, data, q)
        p.append(M @ dq)
        u.append(tau + C.T @ dq - g)
    p, u, t = np.array(p), np.array(u), log.t
    r, integral = np.zeros_like(p), np.zeros(arm.n)
    q_lag, dq_lag = log.q.copy(), log.dq.copy()
    r[0] = -u[0]  # at rest the load is all that u feels
    integral = p[0] - r[0] / gain
    for k in range(1, len(t)):
        h = t[k] - t[k - 1]
        # trapezoids, solved for the new r
        known = integral + 0.5 * h * (u[k - 1] + u[k] + r[k - 1])
        r[k] = gain * (p[k] - known) / (1 + 0.5 * h * gain)
        integral = known + 0.5 * h * r[k]
        for lagged, signal in ((q_lag, log.q), (dq_lag, log.dq)):
            half = 0.5 * h * gain
            lagged[k] = ((1 - half) * lagged[k - 1] + half * (signal[k - 1] + signal[k])) / (1 + half)
    ddq_lag = gain * (log.dq - dq_lag)
    A, b = np.diag(np.array([10.0] + [1.0] * 3 + [0.3] * 6) ** -2), np.zeros(10)
    for k in np.flatnonzero(t >= start):
        pin.rnea(model, data, q_lag[k], dq_lag[k], ddq_lag[k])
        wrench = pin.frameBodyRegressor(model, data, frame)[:, OURS]
        pin.computeJointJacobians(model, data, q_lag[k])
        pin.updateFramePlacements(model, data)
        Y = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL).T @ wrench
        A += Y.T @ Y
        b += Y.T @ -r[k]
    return np.linalg.solve(A, b)


@pytest.mark.parametrize("gain", [20.0, 100.0])
def test_filtered_rls_is_reference_7_written_anew(panda, log, gain):
    ours = FilteredRecursiveLeastSquares(panda, gain=gain).run(log).phi
    theirs = kurdas(panda, log, gain, log.t[0] + 5.0 / gain)
    assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-8)


# ------------------------------------------------------------------ the recursion in closed form


@pytest.mark.parametrize("forgetting", FORGETTING)
def test_the_closed_form_is_where_the_recursion_arrives(panda, log, forgetting):
    y, Y = equations(panda, log, "difference", 0.0)
    every = 100
    found = recursive(y, Y, forgetting, every)
    identifier = RecursiveLeastSquares(panda, forgetting)
    stops = [*range(every + 1, len(log), every), len(log)]
    expected = [e.phi for e in identifier.at(log, log.t[np.array(stops) - 1] - log.t[0])]
    assert found == pytest.approx(np.array(expected), rel=1e-6, abs=1e-8)


def test_the_filtered_rows_are_those_of_the_estimator_from_rest(panda, analytic_log):
    log = analytic_log(panda, LOAD, duration=1.0, rate=500.0)
    rest = Recording(np.arange(50) / 500.0, *(np.tile(x[0], (50, 1)) for x in (log.q, 0 * log.dq, log.tau)))
    still = replace(rest, tau=panda.with_payload(LOAD).torque(rest.q, rest.dq, 0 * rest.dq))
    y, Y = equations(panda, still, "filter", 20.0)
    expected = FilteredRecursiveLeastSquares(panda, gain=20.0).run(still).phi
    assert recursive(y, Y, 1.0, len(y))[-1] == pytest.approx(expected, rel=1e-6, abs=1e-9)


# ------------------------------------------------------------------ derivatives


def moving(dq, t):
    return Recording(t, np.zeros_like(dq), dq, np.zeros_like(dq))


def test_savitzky_and_golay_differentiate_a_cubic_exactly():
    t = np.arange(400) / 500.0
    dq = np.tile((1.0 + t - 2.0 * t**2 + 0.5 * t**3)[:, None], 7)
    ddq = acceleration(moving(dq, t), "savgol", 0.05)
    assert ddq == pytest.approx(np.tile((1.0 - 4.0 * t + 1.5 * t**2)[:, None], 7), abs=1e-6)


@pytest.mark.parametrize(("derivative", "setting"), [("savgol", 0.05), ("butterworth", 10.0)])
def test_a_smooth_derivative_passes_the_motion_and_not_the_noise(derivative, setting):
    t = np.arange(3000) / 500.0
    rng, dq = np.random.default_rng(1), np.tile(np.sin(2 * np.pi * t)[:, None], 7)
    noisy = moving(dq + 2e-3 * rng.normal(size=dq.shape), t)
    truth = 2 * np.pi * np.cos(2 * np.pi * t)[:, None]
    inside = slice(300, -300)
    smooth = acceleration(noisy, derivative, setting)[inside] - truth[inside]
    rough = acceleration(noisy, "difference", 0.0)[inside] - truth[inside]
    assert np.sqrt(np.mean(rough**2)) == pytest.approx(np.sqrt(2) * 2e-3 * 500.0, rel=0.05)
    assert np.sqrt(np.mean(smooth**2)) < 0.1 * np.sqrt(np.mean(rough**2))


def test_lost_samples_and_jitter_do_not_bend_a_smooth_derivative():
    rng = np.random.default_rng(2)
    t = np.sort(rng.choice(np.arange(3000), 2760, replace=False)) / 500.0
    dq = np.tile(np.sin(2 * np.pi * t)[:, None], 7)
    ddq = acceleration(moving(dq, t), "savgol", 0.03)
    assert ddq[300:-300] == pytest.approx(np.tile(2 * np.pi * np.cos(2 * np.pi * t)[:, None], 7)[300:-300], abs=0.05)


# ------------------------------------------------------------------ tuning


def test_tuning_takes_what_errs_least_on_the_runs_it_sees(tmp_path, log):
    basis, rival = Basis(tmp_path, QUICK), Rival(500, "panda", "savgol", tuned=True)
    runs = [EvaluationRun(log, LOAD)]

    def loss(setting, forgetting):
        error = np.abs(answers(basis, rival, runs[0], setting, [forgetting])[0] - LOAD.phi)
        return np.log(np.maximum(error, 1e-9)).mean()

    chosen = tune(basis, rival, runs)
    losses = {(s, f): loss(s, f) for s in GRID["savgol"] for f in FORGETTING}
    assert losses[chosen] == pytest.approx(min(losses.values()))


def test_calibration_takes_away_what_the_empty_arm_says(tmp_path, panda, analytic_log):
    offset = lambda q, dq: np.full_like(q, 0.3)  # noqa: E731, ARG005
    loaded, empty = (analytic_log(panda, load, duration=2.0, extra=offset) for load in (LOAD, None))
    run, rival = EvaluationRun(loaded, LOAD, tare=empty), Rival(200, "none", "savgol")
    basis = Basis(tmp_path, QUICK)
    plain, calibrated = (
        np.abs(answers(basis, replace(rival, calibrated=c), run, 0.05, [1.0])[0] - LOAD.phi) for c in (False, True)
    )
    assert calibrated.max() < 0.02 * plain.max()


# ------------------------------------------------------------------ the plan


def test_every_combination_is_measured_once_and_the_readings_hold_the_paper_s_settings():
    found = rivals(FULL)
    assert len({r.name for r in found}) == len(found) == 2 * 2 * 4 * 2 * 2
    specs = reading_specs(FULL)
    assert len({s.name for s in specs}) == len(specs)
    usual = {(s.kind, s.stages, s.split) for s in specs if s.scale == "raw" and s.max_epochs == 1000}
    assert usual == {(k, n, p) for k in ("tree", "network") for n in (1, 2) for p in ("row", "payload")}

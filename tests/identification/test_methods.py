"""The catalogue: its rows, its page and its command; and the linear estimators against independent answers."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from armload.app.cli import main
from armload.arms import payload_regressor
from armload.errors import IdentificationError
from armload.estimators import (
    CommandedLeastSquares,
    MomentumLeastSquares,
    OrdinaryLeastSquares,
    PolynomialLeastSquares,
    RecursiveLeastSquares,
    RecursiveTotalLeastSquares,
    Tared,
    WeightedLeastSquares,
)
from armload.identification import DEFAULT, LEFT_OUT, METHODS, Method, identify
from armload.inertia import InertialParameters
from armload.motion import random_motion, taie2024
from armload.online import OnlineIdentifier
from armload.recording import Recording, write_recording
from armload.regression import FilteredRegression
from armload.simulation import simulate

PAGE = Path(__file__).resolve().parents[2] / "docs" / "methods.md"
BODY = InertialParameters.from_com(1.3, (0.03, -0.02, 0.06), np.diag([4e-3, 5e-3, 3e-3]))


def noisy(log: Recording, seed: int, dq: ArrayLike = 0.0, tau: ArrayLike = 0.0) -> Recording:
    """The log with white noise on its velocity and torque, of one standard deviation or one for each joint (n,)."""
    rng = np.random.default_rng(seed)
    return Recording(
        log.t,
        log.q,
        log.dq + np.asarray(dq) * rng.normal(size=log.q.shape),
        log.tau + np.asarray(tau) * rng.normal(size=log.q.shape),
    )


# ---------------------------------------------------------------------- the catalogue


def test_the_default_is_in_the_catalogue_and_stands_first():
    assert next(iter(METHODS)) == DEFAULT
    assert not METHODS[DEFAULT].needs


def test_every_row_says_what_when_and_from_where():
    for name, method in METHODS.items():
        assert method.name == name
        assert min(len(method.title), len(method.when)) > 10
        assert any(ch.isdigit() for ch in method.source), f"{name}: a source has a year"
        assert "|" not in method.title + method.when + method.source  # they stand in a Markdown table
    assert len({method.when for method in METHODS.values()}) == len(METHODS)


def test_a_row_with_an_unknown_use_of_the_tare_is_refused():
    with pytest.raises(IdentificationError, match="sometimes"):
        Method("x", "x", "x", "x", tare="sometimes", prior=False, build=lambda *_: OrdinaryLeastSquares(_[0]))


def test_what_is_left_out_has_a_reason_and_is_not_in_the_catalogue():
    assert len(LEFT_OUT) >= 5
    assert all(len(why) > 15 and not why.endswith(".") for why in LEFT_OUT.values())
    assert not set(LEFT_OUT) & set(METHODS)


def test_every_approach_of_the_paper_s_related_work_is_built_or_left_out_with_a_reason():
    built = {
        3: "joint",
        7: "rls-filter",
        11: "ols",
        12: "ols",
        13: "rtls",
        16: "rls",
        17: "difference",
        18: "difference",
    }
    built |= {22: "tree", 23: "mixed", 24: "network"}  # ensembles of one kind, of several, in place of single models
    left_out = {int(number) for what in LEFT_OUT for number in re.findall(r"\[(\d+)\]", what)}
    assert set(built.values()) <= set(METHODS)
    assert left_out | set(built) == {3, *range(7, 25)}  # what Section II of the paper refers to
    assert not left_out & set(built)


def test_a_method_is_called_what_the_catalogue_calls_it(panda, analytic_log):
    tare = analytic_log(panda, duration=0.5, rate=50.0)
    for name, method in METHODS.items():
        if method.needs in ("", "tare"):
            assert method.make(panda, tare if method.needs == "tare" else None).name == name


def test_a_tare_is_used_as_the_row_says(panda, analytic_log):
    tare = analytic_log(panda, duration=0.5, rate=50.0)
    for name, method in METHODS.items():
        if method.tare == "virtual calibration" and not method.needs:
            made = method.make(panda, tare)  # a body is made of the difference, so that some subtract by themselves
            assert isinstance(made, Tared) or made.before.n_samples, name
        if method.tare == "none":
            with pytest.raises(IdentificationError, match="cannot use a tare"):
                method.make(panda, tare)


def test_a_method_says_what_it_cannot_work_without(panda):
    words = {"tare": "needs a tare", "training": "trained model", "motion": "needs the motion"}
    needy = [method for method in METHODS.values() if method.needs]
    assert {"training", "motion"} <= {method.needs for method in needy}
    for method in needy:
        with pytest.raises(IdentificationError, match=words[method.needs]) as caught:
            method.make(panda)
        assert method.name in str(caught.value)


def test_the_command_refuses_a_method_that_lacks_something_in_one_sentence(tmp_path, capsys, panda, analytic_log):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, BODY, duration=1.0, rate=50.0))
    for name in (method.name for method in METHODS.values() if method.needs):
        assert main(["identify", str(path), "--robot", "panda", "--method", name]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.count("\n") == 1
        assert name in said.err


def test_identify_takes_the_catalogue_s_names_and_answers_with_them(panda, analytic_log):
    log = analytic_log(panda, BODY, duration=3.0, rate=50.0)
    answer = identify(log, panda, method="wls")
    assert answer.method == "wls"
    assert answer.phi == pytest.approx(WeightedLeastSquares(panda).run(log).phi.tolist(), abs=1e-4)
    tared = identify(log, panda, method="wls", tare=analytic_log(panda, rate=50.0))
    assert tared.relative_to == "tare"
    assert tared.mass == pytest.approx(BODY.mass, rel=0.01)


def test_an_identifier_of_ones_own_is_no_name_and_is_told_how_it_answers(panda, analytic_log):
    own, log = WeightedLeastSquares(panda), analytic_log(panda, BODY, duration=1.0, rate=50.0)
    for refuse in (lambda: identify(log, panda, method=own), lambda: OnlineIdentifier(panda, method=own)):
        with pytest.raises(IdentificationError, match=r"an identifier of your own answers by its run\(recording\)"):
            refuse()


def test_the_page_is_the_catalogue(capsys):
    assert main(["methods", "--markdown"]) == 0
    assert PAGE.read_text(encoding="utf-8") == capsys.readouterr().out, (
        "run: armload methods --markdown > docs/methods.md"
    )


def test_the_command_lists_every_method_and_what_is_left_out(capsys):
    assert main(["methods"]) == 0
    shown = capsys.readouterr().out
    assert main(["methods", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in listed["methods"]] == list(METHODS)
    assert listed["default"] == DEFAULT
    assert {row["what"] for row in listed["left_out"]} == set(LEFT_OUT)
    for text in (*METHODS, *(what.split(" [")[0] for what in LEFT_OUT)):
        assert text in shown


# ---------------------------------------------------------------------- ols, wls


def test_ols_is_the_batch_solution_of_the_filtered_rows(panda, analytic_log):
    log = noisy(analytic_log(panda, BODY, duration=3.0), 0, tau=0.2)
    r, W = FilteredRegression(panda)(log.t, log.q, log.dq, log.tau)
    batch = np.linalg.lstsq(W.reshape(-1, 10), r.ravel(), rcond=None)[0]
    assert OrdinaryLeastSquares(panda).run(log).phi == pytest.approx(batch, abs=2e-4)


def test_wls_is_the_batch_solution_with_each_joint_divided_by_its_residual(panda, analytic_log):
    log = noisy(analytic_log(panda, BODY, duration=3.0), 0, tau=np.array([2.0, 2.0, 1.0, 1.0, 0.05, 0.05, 0.05]))
    r, W = FilteredRegression(panda)(log.t, log.q, log.dq, log.tau)
    s = np.ones(7)
    for _ in range(3):
        rows, y = (W / s[:, None]).reshape(-1, 10), (r / s).ravel()
        batch = np.linalg.lstsq(rows, y, rcond=None)[0]
        s = np.sqrt(np.mean((r - W @ batch) ** 2, axis=0))
    assert WeightedLeastSquares(panda).run(log).phi == pytest.approx(batch, abs=1e-5)


def test_weights_help_where_joints_differ(panda, analytic_log):
    spread = np.array([2.0, 2.0, 1.0, 1.0, 0.05, 0.05, 0.05])
    logs = [noisy(analytic_log(panda, BODY, duration=3.0, rate=100.0), seed, tau=spread) for seed in range(6)]
    plain, weighted = (
        np.mean([np.abs(kind(panda).run(log).phi - BODY.phi) for log in logs], axis=0)
        for kind in (OrdinaryLeastSquares, WeightedLeastSquares)
    )
    assert weighted[0] < 0.7 * plain[0]
    assert np.all(weighted[1:4] < 0.3 * plain[1:4])


def test_intervals_of_least_squares_cover_the_truth_under_correlated_noise(panda, analytic_log):
    inside, naive = [], []
    clean = analytic_log(panda, BODY, rate=100.0, duration=10.0)
    for seed in range(12):
        rng, e = np.random.default_rng(seed), np.zeros((len(clean), 7))
        for k in range(1, len(clean)):
            e[k] = 0.97 * e[k - 1] + rng.normal(0, 0.05, 7)
        log = Recording(clean.t, clean.q, clean.dq, clean.tau + e)
        estimate = OrdinaryLeastSquares(panda).run(log)
        error = np.abs(estimate.phi - BODY.phi)
        inside.append(error < 1.96 * estimate.std)
        r, W = FilteredRegression(panda)(log.t, log.q, log.dq, log.tau)
        W = W.reshape(-1, 10)
        sigma = np.std(r.ravel() - W @ estimate.phi) * np.sqrt(np.diag(np.linalg.inv(W.T @ W)))
        naive.append(error < 1.96 * sigma)
    assert np.mean(inside) > 0.88
    assert np.mean(naive) < 0.7


# ---------------------------------------------------------------------- momentum


def test_a_window_s_row_is_the_mean_load_torque(panda):
    """Against Newton–Euler with the exact acceleration: rnea(arm + payload) − rnea(arm), averaged over the window."""
    t = np.arange(0.0, 0.5, 5e-4)
    q, dq, ddq = taie2024()(1.0 + t)
    tau = panda.with_payload(BODY).torque(q, dq, ddq)
    load = tau - panda.torque(q, dq, ddq)
    times, y, Y = MomentumLeastSquares(panda, window=0.2)._rows(t, q, dq, tau)
    assert times == pytest.approx([0.2, 0.4])
    mean = np.trapezoid(load[:401], t[:401], axis=0) / t[400]
    assert y[0] == pytest.approx(mean, abs=1e-5)
    assert Y[0] @ BODY.phi == pytest.approx(mean, abs=1e-5)


def test_a_window_must_last(panda):
    with pytest.raises(ValueError, match="positive"):
        MomentumLeastSquares(panda, window=0.0)
    with pytest.raises(ValueError, match="positive"):
        PolynomialLeastSquares(panda, half=-1.0)


# ---------------------------------------------------------------------- rtls


def test_total_least_squares_has_no_bias_where_noisy_velocity_gives_least_squares_one(panda, analytic_log):
    clean = analytic_log(panda, BODY, duration=4.0, rate=400.0)
    logs = [noisy(clean, seed, dq=4e-3, tau=0.05) for seed in range(6)]
    least, total = (
        np.mean([kind(panda).run(log).phi[0] for log in logs]) / BODY.mass - 1.0
        for kind in (RecursiveLeastSquares, RecursiveTotalLeastSquares)
    )
    assert least < -0.1  # errors in the regressor pull towards zero
    assert abs(total) < 0.02


def test_total_least_squares_minimises_the_residual_in_units_of_its_expected_error(panda, analytic_log):
    """vᵀ·A·v / vᵀ·B·v of [Y y] and of the errors drawn at random is stationary at the estimate."""
    log = noisy(analytic_log(panda, BODY, duration=4.0, rate=200.0), 1, dq=2e-3, tau=0.3)
    phi = RecursiveTotalLeastSquares(panda).run(log).phi
    h, (q, dq, tau) = np.diff(log.t)[:, None], (0.5 * (x[1:] + x[:-1]) for x in (log.q, log.dq, log.tau))

    def rows(ddq):
        y = tau - panda.torque(q, dq, ddq)
        return np.concatenate([payload_regressor(panda.frame_motion(q), dq, ddq), y[..., None]], axis=2)

    ddq = np.diff(log.dq, axis=0) / h
    z, rng = rows(ddq), np.random.default_rng(2)
    drawn = [rows(ddq + np.sqrt(2.0) * 2e-3 / h * rng.normal(size=q.shape)) - z for _ in range(5)]
    least = np.linalg.lstsq(z[..., :10].reshape(-1, 10), z[..., 10].ravel(), rcond=None)[0]
    w = 1.0 / np.mean((z @ np.append(least, -1.0)) ** 2, axis=0)
    A = np.einsum("j,kja,kjb->ab", w, z, z)
    B = np.mean([np.einsum("j,kja,kjb->ab", w, d, d) for d in drawn], axis=0)
    B[10, 10] += len(q) * np.sum(w) * 0.5 * 0.3**2  # torque noise, averaged over two samples

    def quotient(x):
        v = np.append(x, -1.0)
        return v @ A @ v / (v @ B @ v)

    scale = np.array([0.05] + [0.01] * 3 + [0.01] * 6)
    for k in range(10):
        step = scale * np.eye(10)[k]
        up, here, down = (quotient(phi + f * step) for f in (1.0, 0.0, -1.0))
        lowest = 0.5 * (down - up) / (up - 2.0 * here + down)  # of the parabola, in steps
        assert up + down > 2.0 * here
        assert abs(lowest) < 0.5


def test_without_noise_total_and_ordinary_least_squares_agree(panda, analytic_log):
    log = analytic_log(panda, BODY, duration=3.0, rate=500.0)
    total, plain = RecursiveTotalLeastSquares(panda).run(log).phi, OrdinaryLeastSquares(panda).run(log).phi
    assert total == pytest.approx(plain, abs=2e-4)


# ---------------------------------------------------------------------- polynomial, commanded


def test_the_local_polynomial_gives_the_motion_s_own_regressor_at_uneven_times(panda):
    t = np.cumsum(np.random.default_rng(0).uniform(0.001, 0.009, 600))
    q, dq, ddq = taie2024()(t)
    tau = panda.with_payload(BODY).torque(q, dq, ddq)
    unread = np.full_like(dq, 9.0)  # the measured velocity does not enter
    times, y, Y = PolynomialLeastSquares(panda)._rows(t, q, unread, tau)
    rows = np.searchsorted(t, times)
    assert len(times) > 200
    exact = payload_regressor(panda.frame_motion(q[rows]), dq[rows], ddq[rows])
    assert np.abs(Y - exact).max() < 0.01 * np.abs(exact).max()
    assert np.abs(y - exact @ BODY.phi).max() < 0.1


def test_the_command_s_acceleration_is_free_of_the_velocity_s_noise(panda):
    clean = simulate(panda, taie2024(), BODY, rate=200.0)
    log = noisy(clean, 0, dq=5e-3)
    commanded, plain = CommandedLeastSquares(panda, taie2024()), RecursiveLeastSquares(panda)
    assert commanded.run(log).phi[0] == pytest.approx(BODY.mass, rel=0.01)
    assert plain.run(log).phi[0] < 0.95 * BODY.mass


def test_a_log_that_starts_within_the_motion_is_told_when(panda):
    log = simulate(panda, taie2024(), BODY, rate=100.0).between(1.0, 5.0)
    assert CommandedLeastSquares(panda, taie2024(), start=0.0).run(log).phi[0] == pytest.approx(BODY.mass, rel=0.01)
    with pytest.raises(IdentificationError, match="does not follow"):
        CommandedLeastSquares(panda, taie2024()).run(log)


def test_another_motion_and_another_arm_s_are_refused(panda, any_arm):
    log = simulate(panda, random_motion(panda, 3, duration=3.0), BODY, rate=50.0)
    with pytest.raises(IdentificationError, match="does not follow the motion 'taie2024'"):
        CommandedLeastSquares(panda, taie2024()).run(log)
    if any_arm.n != 7:
        with pytest.raises(IdentificationError, match="7 joints"):
            CommandedLeastSquares(any_arm, taie2024())


# ---------------------------------------------------------------------- any arm


@pytest.mark.parametrize(
    "kind",
    [
        OrdinaryLeastSquares,
        WeightedLeastSquares,
        MomentumLeastSquares,
        PolynomialLeastSquares,
        RecursiveTotalLeastSquares,
    ],
)
def test_exact_data_of_any_arm_give_the_payload_back(kind, any_arm, analytic_log):
    phi = kind(any_arm).run(analytic_log(any_arm, BODY, rate=500.0, duration=4.0)).phi
    scale = np.array([1.0] + [0.1] * 3 + [0.01] * 6)  # kg, 0.1 kg·m, 0.01 kg·m²
    assert np.abs((phi - BODY.phi) / scale).max() < 0.06
    assert phi[0] == pytest.approx(BODY.mass, rel=1e-3)

"""A hand-over that goes on in the run after it: how far the run is behind, against rows of a known payload."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from armload.online.lasting import Lasting
from armload.online.modes import Modes
from armload.online.tracking import Tracker

BEFORE = np.full(10, 1.0)
PACE = np.array([0.1, 0.01, 0.0, 0.005, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # per second


def rows(rng, moved, seconds, size=0.5, step=0.02):
    """Rows e ~ N(w·phi(t), v) of an arm of three joints: their times, w, e and v, and phi (10,) at the end."""
    for t in np.arange(0.0, seconds, step):
        w, v = rng.normal(size=(3, 10)), size * rng.uniform(0.5, 1.5, 3)
        e = w @ (moved(t) * PACE) + np.sqrt(v) * rng.normal(size=3)
        yield t, w, e, v


def told(all_rows, lasted=5.0, stayed=0.2, pace=PACE):
    """What `Lasting` makes of rows, as a run's stream shows them."""
    lasting = Lasting()
    for t, w, e, v in all_rows:
        seen = np.column_stack([w, e, v])
        stream = SimpleNamespace(
            row=SimpleNamespace(t=t, h=0.02),
            state=SimpleNamespace(seen=seen),
            noise=SimpleNamespace(overrated=1.0),
        )
        lasting.take(stream, 1.0)  # type: ignore[arg-type]
    lasting.begin(pace * lasted, lasted, stayed, BEFORE)
    return lasting


def by_all_rows(all_rows, ends, prior):
    """The mixture over ends of the Gaussian of (phi, a), from all rows at once: phi at the last row; a = 0 alone."""
    t = np.repeat([r[0] for r in all_rows], 3)
    W, e, v = (np.concatenate([r[k] for r in all_rows]) for k in (1, 2, 3))
    found, log = [], []
    for end in [*ends, None]:
        s = np.zeros_like(t) if end is None else np.minimum(t, end)
        X = np.column_stack([W, (W @ PACE) * s])
        P0 = np.eye(11)
        S = X @ P0 @ X.T + np.diag(v)
        K = P0 @ X.T @ np.linalg.inv(S)
        to_now = np.column_stack([np.eye(10), s[-1] * PACE])
        found.append((to_now @ K @ e, to_now @ (P0 - K @ X @ P0) @ to_now.T))
        log.append(multivariate_normal(np.zeros(len(e)), S).logpdf(e))  # type: ignore[arg-type]
    p = prior * np.exp(np.array(log) - max(log))
    p /= p.sum()
    mean = sum(x * m for x, (m, _) in zip(p, found, strict=True))
    cov = sum(x * (P + np.outer(m - mean, m - mean)) for x, (m, P) in zip(p, found, strict=True))
    return mean, cov, found[-1]


def test_how_far_the_run_is_behind_is_what_all_rows_at_once_say():
    ends, end = 0.1 * 2.0 ** (np.arange(19) / 3.0), 0.6
    some = list(rows(np.random.default_rng(1), lambda t: min(t, end), 0.8))
    lasting = told(some)
    past = np.concatenate([[0.0], ends[:-1]])
    goes_on = 0.5 * 5.0 / (5.2 + past)
    prior = np.array([*(goes_on[:-1] - goes_on[1:]), goes_on[-1], 1.0 - goes_on[0]])
    mean, covariance, (alone, own) = by_all_rows(some, ends, prior)
    ahead, spread = lasting.ahead
    assert alone + ahead == pytest.approx(mean, abs=1e-6)
    tracker = Tracker()
    tracker.lasting = lasting
    assert tracker.of_now((alone, own))[0] == pytest.approx(mean, abs=1e-6)
    # the mixture of what is given each end: its spread about the mean is the run's, and what is between the ends
    assert np.diag(own + spread) == pytest.approx(np.diag(covariance), rel=1e-4)


def test_a_run_that_a_hand_over_goes_on_in_has_the_truth_in_its_interval():
    rng = np.random.default_rng(3)
    inside, alone = [], []
    for _ in range(40):
        end = rng.uniform(0.3, 2.0)
        some = list(rows(rng, lambda t, end=end: min(t, end), end + 0.5, 0.05))
        lasting = told(some)
        W, e, v = (np.concatenate([r[k] for r in some]) for k in (1, 2, 3))
        P = np.linalg.inv(W.T @ (W / v[:, None]) + np.eye(10))
        phi, truth = P @ W.T @ (e / v), end * PACE[0]
        inside.append(abs(phi[0] + lasting.ahead[0][0] - truth) < 1.96 * np.sqrt(P[0, 0] + lasting.ahead[1][0, 0]))
        alone.append(abs(phi[0] - truth) < 1.96 * np.sqrt(P[0, 0]))
    assert np.mean(inside) >= 0.85  # of 40; 94 % of many
    assert np.mean(alone) < 0.5


def test_after_a_step_the_run_is_soon_alone():
    some = list(rows(np.random.default_rng(5), lambda _: 0.0, 1.0, 0.01))
    lasting = told(some, lasted=0.1, pace=50.0 * PACE)  # half a kilo
    P = np.linalg.inv(sum(w.T @ (w / v[:, None]) for _, w, _, v in some) + np.eye(10))
    assert lasting.over(P[0, 0])
    assert lasting.goes_on < 0.05


def test_an_interval_holds_both_payloads_while_either_is_likelier_than_one_in_twenty():
    covariance, other = 1e-4 * np.eye(10), np.r_[0.3, np.zeros(9)]
    spread = 4e-4 * np.eye(10)
    for p in np.linspace(0.06, 0.94, 12):
        modes = SimpleNamespace(taken_off=0.0, handing=p, other=0.0, shift=lambda going_on: (other, spread))  # noqa: ARG005
        tracker = Tracker()
        for t in np.arange(0.0, 5.0, 0.1):
            phi, found = tracker.track(modes, t, (np.zeros(10), covariance))  # type: ignore[arg-type]
        half = 1.96 * np.sqrt(found[0, 0])
        assert phi[0] - half < 0.0
        assert phi[0] + half > 0.3


@pytest.mark.parametrize(("went_on", "shift", "rest"), [(0.95, 0.2, True), (0.95, -0.3, False), (0.5, 0.2, False)])
def test_what_goes_the_other_way_is_no_rest_of_a_hand_over(went_on, shift, rest):
    tracker = Tracker()
    tracker.lasting = SimpleNamespace(went_on=went_on, pace=np.full(10, 0.05))  # type: ignore[assignment]
    assert tracker.rest(np.r_[shift, np.zeros(9)]) is rest


def test_modes_give_the_level_that_a_new_run_begins_with():
    """25 Hz: noise twice as large as the scales say is found from the rows, and widens what a run says by √2."""
    modes, rng = Modes(1.5, np.ones(7)), np.random.default_rng(0)
    for _ in range(1000):
        seen = np.column_stack([np.zeros((7, 10)), np.sqrt(2.0) * rng.normal(size=7), np.ones(7)])
        modes.take(0.04, seen, np.zeros((7, 10)), np.zeros((7, 6)), np.ones(7), np.zeros(10), np.zeros((10, 10)), True)
    assert modes.level == pytest.approx(2.0, rel=0.25)


@pytest.mark.parametrize(("variance", "least", "most"), [(1.0, 1.0, 1.4), (3.0, 2.4, 3.4)])
def test_how_loud_a_stream_is_shows_within_a_second(variance, least, most):
    """Noise as expected, which would hide an early change if it were held to be louder, and noise that is louder."""
    found = []
    for seed in range(12):
        modes, rng = Modes(1.5, np.ones(7)), np.random.default_rng(seed)
        for _ in range(200):
            seen = np.column_stack([np.zeros((7, 10)), np.sqrt(variance) * rng.normal(size=7), np.ones(7)])
            rest = np.zeros((7, 10)), np.zeros((7, 6)), np.ones(7), np.zeros(10), np.zeros((10, 10))
            modes.take(0.005, seen, *rest, True)
        found.append(modes.level)
    assert least <= np.mean(found) <= most

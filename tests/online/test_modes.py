"""What the last rows of a stream are: probabilities against what Bayes' rule says of simpler hypotheses."""

import numpy as np

from armload.online.modes import Modes

H = 0.005  # [s] of a row


def rows_of_a_standing_arm(shift, seconds, rng):
    """X (7, 10) of an arm that stands, and d (7,) of its rows: noise of one, and `shift` (10,) of phi."""
    X = np.zeros((7, 10))
    X[1:6, 0] = [4.0, 0.5, 3.0, 0.0, 0.6]  # gravity: the mass, and two of the three moments
    X[1:6, 1:4] = rng.normal(size=(5, 2)) @ rng.normal(size=(2, 3)) * 4.0
    for _ in range(round(seconds / H)):
        yield X, X @ shift + rng.normal(size=7)


def test_what_is_steadily_another_payload_s_torque_is_not_thought_to_have_gone_again():
    """A hand-over ends in what was held before only if what was handed over may be nothing: odds of e^1000 are against.

    Else the steady arm, fed from the hand-over with every row, would keep seven times as much.
    """
    modes, rng = Modes(1.5, np.full(7, 50.0)), np.random.default_rng(3)
    shift = 0.6 * np.r_[1.0, 0.0, 0.0, 0.05, np.zeros(6)]  # up to 2.4 times the noise of one row
    scale, nothing, odds, kept = np.ones(7), (np.zeros(10), np.zeros((10, 10))), 0.0, []
    for k, (X, d) in enumerate(rows_of_a_standing_arm(shift, 4.0, rng)):
        modes.take(H, np.column_stack([np.zeros((7, 10)), d, np.ones(7)]), X, scale, *nothing, False)
        odds += float(X @ shift @ d - 0.5 * (X @ shift) @ (X @ shift))  # ln p(rows | shift) / p(rows | nothing)
        if k * H > 1.5:
            kept.append(modes.steady)
    assert odds > 1000.0
    assert np.mean(kept) < 3e-6


def test_what_was_handed_over_and_taken_back_is_steady_again():
    modes, rng = Modes(1.5, np.full(7, 50.0)), np.random.default_rng(4)
    shift, scale, nothing = 0.2 * np.r_[1.0, np.zeros(9)], np.ones(7), (np.zeros(10), np.zeros((10, 10)))
    most = 0.0
    for k, (X, d) in enumerate(rows_of_a_standing_arm(np.zeros(10), 6.0, rng)):
        held = np.clip(min(k * H - 1.0, 2.0 - k * H), 0.0, 0.5) / 0.5  # up and down within a second
        seen = np.column_stack([np.zeros((7, 10)), d + held * (X @ shift), np.ones(7)])
        modes.take(H, seen, X, scale, *nothing, False)
        most = max(most, modes.handing + modes.other)
    assert most > 0.9
    assert modes.steady > 0.9


def test_what_a_pose_is_wrong_by_is_no_change_and_hides_none():
    """The rows of a standstill share one error, three times their noise. A change is sure when its odds are e^60."""
    modes, rng = Modes(1.5, np.full(7, 50.0)), np.random.default_rng(5)
    shift, scale, nothing = 0.2 * np.r_[1.0, np.zeros(9)], np.ones(7), (np.zeros(10), np.zeros((10, 10)))
    wrong, odds, before, sure_at = 3.0 * rng.normal(size=7), 0.0, [], None
    for k, (X, d) in enumerate(rows_of_a_standing_arm(np.zeros(10), 3.0, rng)):
        changed = k * H >= 2.0
        if changed:
            odds += float(X @ shift @ d + 0.5 * (X @ shift) @ (X @ shift))  # ln p(rows | shift) / p(rows | nothing)
        seen = np.column_stack([np.zeros((7, 10)), d + wrong + changed * (X @ shift), np.ones(7)])
        modes.take(H, seen, X, scale, *nothing, False, np.full(7, 9.0))
        if changed and sure_at is None and modes.handing + modes.other > 0.999:
            sure_at = odds
        elif not changed:
            before.append(modes.handing + modes.other)
    assert max(before) < 0.05
    assert sure_at is not None
    assert sure_at < 60.0

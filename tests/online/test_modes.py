"""What the last rows of a stream are: probabilities against what Bayes' rule says of simpler hypotheses."""

import numpy as np

from armload import arm
from armload.arms import payload_regressor
from armload.online import modes as modes_module
from armload.online.modes import Modes

H = 0.005  # [s] of a row
NO_HAND = np.zeros((7, 6))  # Jᵀ of a frame that no force moves


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
        modes.take(H, np.column_stack([np.zeros((7, 10)), d, np.ones(7)]), X, NO_HAND, scale, *nothing, False)
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
        modes.take(H, seen, X, NO_HAND, scale, *nothing, False)
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
        modes.take(H, seen, X, NO_HAND, scale, *nothing, False, np.full(7, 9.0))
        if changed and sure_at is None and modes.handing + modes.other > 0.999:
            sure_at = odds
        elif not changed:
            before.append(modes.handing + modes.other)
    assert max(before) < 0.05
    assert sure_at is not None
    assert sure_at < 60.0


def pulled_slowly(panda, rng):
    """Most that a change is likely (its last 50 ms), and a contact, while a Panda is pulled by up to 20 N for 2 s."""
    modes, noise = Modes(1.5, np.full(7, 50.0)), np.array([0.6, 0.6, 0.6, 0.6, 0.08, 0.08, 0.08])
    force, nothing = np.array([-13.0, -10.0, -13.0]), (np.zeros(10), np.zeros((10, 10)))
    changed, touched = [], []
    for k in range(800):
        t = k * H
        q = np.array([0.1, -0.4, 0.2, -1.9, 0.3, 1.6, 0.5]) + 0.3 * np.sin(t + np.arange(7))
        motion, R = panda.frame_motion(q), panda.frame_pose(q)[0][0]
        X = payload_regressor(motion, np.zeros((1, 7)), np.zeros((1, 7)))[0]
        J = motion.jacobian[0]
        wrench = np.ascontiguousarray(np.vstack([R @ J[3:], R @ J[:3]]).T)
        size = 0.5 - 0.5 * np.cos(np.pi * np.clip(min(t - 1.0, 3.0 - t) / 0.7, 0.0, 1.0))
        d = size * (wrench[:, :3] @ force) / noise + rng.normal(size=7)
        seen = np.column_stack([np.zeros((7, 10)), d, np.ones(7)])
        modes.take(H, seen, X, wrench, 1.0 / noise, *nothing, False)
        changed.append(modes.handing + modes.other)
        touched.append(modes.contact)
    return np.min([changed[k : k + 10] for k in range(790)], axis=1).max(), max(touched)


def test_a_hand_that_pulls_slowly_at_the_flange_is_no_change(monkeypatch):
    """Weight and a centre of mass to one side explain the beginning of such a pull as well as any torque on any joint.

    With hands that pull nowhere some of these pulls are surely changes.
    """
    panda, rng = arm("panda"), np.random.default_rng(6)
    most, touched = np.array([pulled_slowly(panda, rng) for _ in range(4)]).T
    assert most.max() < 0.999
    assert touched.min() > 0.99
    monkeypatch.setattr(modes_module, "HAND_RARE", 1e30)
    rng = np.random.default_rng(6)
    assert max(pulled_slowly(panda, rng)[0] for _ in range(4)) > 0.999

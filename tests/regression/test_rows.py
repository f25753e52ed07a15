"""The one kernel of rows, against the same equation on arrays from Pinocchio and a lag of its own."""

import numpy as np
import pytest

from armload.arms import arm, full_arm_regressor, momentum_regressor, rated_effort
from armload.errors import IdentificationError
from armload.regression import Correction, JointFeatures
from armload.regression.lag import Lag, first_order_lag
from armload.regression.rows import SPACING, FilteredRegression, Rows

GAIN = 20.0


def samples(n, seed=0, count=400):
    """A smooth motion at uneven times, with torque of no arm in particular."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.5e-3, 3e-3, count))
    phase, speed = rng.uniform(0, 6, n), rng.uniform(1, 4, n)
    angle = t[:, None] * speed + phase
    return t, 0.4 * np.sin(angle), 0.4 * speed * np.cos(angle), rng.normal(size=(count, n))


def lagged(t, momentum, drift):
    """λ·Y_p + F[D − λ·Y_p] with the lag from −λ·Y_p(0)."""
    return GAIN * momentum + first_order_lag(t, drift - GAIN * momentum, GAIN, -GAIN * momentum[0])


def by_arrays(robot, t, q, dq, tau, correction, features):
    """r (M, n) and X (M, n, size) at the row times, each part from arrays of samples."""
    rows, last = [], -np.inf
    for k, now in enumerate(t):
        if now - last >= SPACING:
            rows.append(k)
            last = now
    torque = first_order_lag(t, tau, GAIN)[rows]
    t, q, dq = t[rows], q[rows], dq[rows]
    p, drift = robot.momentum(q, dq)
    r = torque - lagged(t, p, drift)
    payload, own = momentum_regressor(robot.frame_motion(q), dq), correction.regressor(q, dq, torque)
    parts = [lagged(t, *payload), lagged(t, *own)]
    pose = first_order_lag(t, features.of_pose(q), GAIN)
    parts += [np.broadcast_to(pose[:, None], (len(t), robot.n, features.pose))]
    parts += [first_order_lag(t, features.of_velocity(dq), GAIN)]
    return r, np.concatenate(parts, axis=2)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_a_row_is_what_arrays_of_samples_give(name):
    robot = arm(name, gravity=(1.0, -3.0, -9.0))
    correction, features = Correction(robot, rated_effort(robot)), JointFeatures(robot.n, 16, 4)
    log = samples(robot.n)
    rows = FilteredRegression(robot, GAIN, correction, features, 200.0).rows(*log)
    r, X = by_arrays(robot, *log, correction, features)
    np.testing.assert_allclose(rows.r, r, rtol=0, atol=1e-10)
    np.testing.assert_allclose(rows.X, X, rtol=0, atol=1e-10)
    assert rows.h.sum() == pytest.approx(rows.t[-1] - rows.t[0])


def test_the_mismatchs_columns_are_those_of_the_whole_arm():
    """The last columns of Z are the links'; offsets, friction and rotors come before them."""
    robot = arm("panda")
    correction = Correction(robot, rated_effort(robot))
    t, q, dq, tau = samples(7)
    X = FilteredRegression(robot, GAIN, correction).rows(t, q, dq, tau).X
    np.testing.assert_allclose(X[:, :, -70:], lagged(t, *full_arm_regressor(robot, q, dq)), rtol=0, atol=1e-10)
    eye = np.broadcast_to(np.eye(7), (len(t), 7, 7))
    np.testing.assert_allclose(X[:, :, 10:17], first_order_lag(t, eye, GAIN), rtol=0, atol=1e-12)  # offsets
    np.testing.assert_allclose(
        X[:, :, 24:31], first_order_lag(t, dq[:, :, None] * np.eye(7), GAIN), rtol=0, atol=1e-12
    )  # viscous friction


@pytest.mark.parametrize("cuts", [[1], [7, 8, 150], [399]])
def test_one_sample_or_many_make_the_same_rows(cuts):
    robot = arm("panda")
    parts = (GAIN, Correction(robot, rated_effort(robot)), JointFeatures(7, 8, 4), 200.0)
    log = samples(7)
    whole, single = FilteredRegression(robot, *parts).rows(*log), FilteredRegression(robot, *parts)
    one_by_one = Rows.of([row for sample in zip(*log, strict=True) if (row := single.row(*sample)) is not None])
    pieces = FilteredRegression(robot, *parts)
    cut = [pieces.rows(*piece) for piece in zip(*(np.split(x, cuts) for x in log), strict=True)]
    for k, column in enumerate(whole):
        np.testing.assert_array_equal(one_by_one[k], column)
        np.testing.assert_array_equal(np.concatenate([part[k] for part in cut]), column)


def test_after_a_gap_rows_begin_anew_and_stand_for_nothing_of_it():
    robot = arm("panda")
    t, q, dq, tau = samples(7)
    late = t.copy()
    late[200:] += 5.0
    rows = FilteredRegression(robot, GAIN, rate=200.0).rows(late, q, dq, tau)
    after = FilteredRegression(robot, GAIN, rate=200.0).rows(late[200:], q[200:], dq[200:], tau[200:])
    first = int(np.searchsorted(rows.t, late[200]))
    np.testing.assert_allclose(rows.r[first:], after.r, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rows.X[first:], after.X, rtol=0, atol=1e-12)
    assert rows.h.sum() < t[-1] - t[0]


def test_a_pose_of_a_standing_arm_counts_no_longer_than_it_settles():
    robot = arm("panda")
    t = np.arange(400) * 5e-3
    still = np.zeros((400, 7))
    rows = FilteredRegression(robot, GAIN, rate=200.0, settling=0.25).rows(t, still, still, still)
    assert rows.h.sum() == pytest.approx(0.25, abs=5e-3)
    paused = t + 3.0 * (t > 0.1)
    rows = FilteredRegression(robot, GAIN, rate=200.0, settling=0.25).rows(paused, still, still, still)
    assert rows.h.sum() == pytest.approx(0.25, abs=6e-3)  # what nobody saw counts for nothing
    moving = np.linspace(0.0, 1.0, 400)[:, None] * np.ones(7)
    rows = FilteredRegression(robot, GAIN, rate=200.0, settling=0.25).rows(t, moving, still, still)
    assert rows.h.sum() == pytest.approx(t[-1])


@pytest.mark.parametrize("wrong", range(3))
@pytest.mark.parametrize("joints", [6, 8])
def test_samples_of_another_arm_are_refused_and_leave_no_trace(joints, wrong):
    t, *good = samples(7, count=40)
    bad = [x if k != wrong else np.zeros((40, joints)) for k, x in enumerate(good)]
    regression, expected = FilteredRegression(arm("panda"), GAIN), FilteredRegression(arm("panda"), GAIN).rows(t, *good)
    with pytest.raises(IdentificationError, match="a number for each joint of panda"):
        regression.rows(t, *bad)
    with pytest.raises(IdentificationError, match="a number for each joint of panda"):
        regression.row(t[0], *(x[0] for x in bad))
    with pytest.raises(IdentificationError, match="a number for each joint of panda"):
        regression.rows(t[1:], *good)
    np.testing.assert_array_equal(regression.rows(t, *good).X, expected.X)


@pytest.mark.parametrize("gain", [-1.0, 0.0, np.nan, np.inf, "20", None])
def test_a_lag_that_is_none_is_refused(gain):
    for made in (Lag, lambda value: FilteredRegression(arm("panda"), value)):
        with pytest.raises(IdentificationError, match="expected the lag's"):
            made(gain)

"""The lags of the filtered regression in machine code: one sample of torque, one row of everything else.

What the rows are is said in `rows.py`, which owns the states of the lags that are handed over here and changed in
place:

    clock       (4,) [s] times of the last sample and row; how long the pose of rest was seen; what the last row is for
    joints      (5, n) lagged torque and last torque; state and last input of the bare arm's lag; the pose of rest
    regressor   (2, n, 10 + p) states of the lags of W and Z, their last inputs
    pose, velocity lags: the same of the features
"""

from __future__ import annotations

import numpy as np

from armload.arms import FRICTION_WIDTH
from armload.arms.momentum_row import leaning_row, momentum_rows
from armload.recording import GAP
from armload.regression.features import features_of_sample
from armload.regression.mismatch import TILTS
from armload.runtime.kernels import kernel

# what `lag_torque` returns of a sample at which the lags start; 1: of another that completes a row, 0: of others
FRESH = 2
# [rad] an arm that stays so near shows one value of its stiction: more of it tells nothing new. Above what encoders and
# a controller at rest show (test_a_pose_of_a_standing_arm_counts_no_longer_than_it_settles)
STILL = 1e-3


@kernel
def lag_torque(t, tau, settings, clock, joints):  # pragma: no cover - compiled
    """Take one sample's torque (n,) into its lag; whether a row is due, and in clock[3] what it stands for [s]."""
    gain, apart = settings[0], settings[1]
    fresh = t - clock[0] > GAP
    x = gain * (t - clock[0])
    for j in range(tau.shape[0]):
        if fresh:
            joints[0, j] = 0.0
        else:
            joints[0, j] += x / (2.0 + x) * (tau[j] + joints[1, j] - 2.0 * joints[0, j])
        joints[1, j] = tau[j]
    clock[0] = t
    if not fresh and t - clock[1] < apart:
        return 0
    clock[3] = 0.0 if fresh else t - clock[1]
    clock[1] = t
    return FRESH if fresh else 1


@kernel
def lag_torques(t, tau, settings, clock, joints):  # pragma: no cover - compiled
    """The same of N samples: index, step, whether the lags start, and lagged torque of those that complete a row."""
    N, count = len(t), 0
    index, steps, fresh, torque = np.empty(N, np.int64), np.empty(N), np.empty(N, np.bool_), np.empty(tau.shape)
    for k in range(N):
        done = lag_torque(t[k], tau[k], settings, clock, joints)
        if done:
            index[count], steps[count], fresh[count] = k, clock[3], done == FRESH
            for j in range(tau.shape[1]):
                torque[count, j] = joints[0, j]
            count += 1
    return index[:count], steps[:count], fresh[:count], torque[:count]


@kernel
def make_rows(
    q, dq, torque, steps, fresh, settings, rotations, translations, axes, turning, gravity,
    turned, links, waves, velocity_waves, clock, joints, regressor, pose_lag, velocity_lag,
):  # fmt: skip  # pragma: no cover - compiled
    """M rows from the samples that complete them: h, X, r and weights."""
    (count, n), size = q.shape, regressor.shape[2] + pose_lag.shape[1] + velocity_lag.shape[2]
    h, X, r, weights = np.empty(count), np.empty((count, n, size)), np.empty((count, n)), np.empty((count, n))
    arm, lags = (rotations, translations, axes, turning, gravity), (regressor, pose_lag, velocity_lag)
    for m in range(count):
        about = (arm, turned, links, waves, velocity_waves, clock, joints, lags)
        h[m] = _made(q[m], dq[m], torque[m], steps[m], fresh[m], settings, about, X[m], r[m], weights[m])
    return h, X, r, weights


@kernel
def make_row(
    q, dq, fresh, settings, rotations, translations, axes, turning, gravity,
    turned, links, waves, velocity_waves, clock, joints, regressor, pose_lag, velocity_lag,
):  # fmt: skip  # pragma: no cover - compiled
    """The same of the sample that `lag_torque` took last."""
    n, size = q.shape[0], regressor.shape[2] + pose_lag.shape[1] + velocity_lag.shape[2]
    X, r, weights = np.empty((n, size)), np.empty(n), np.empty(n)
    arm, lags = (rotations, translations, axes, turning, gravity), (regressor, pose_lag, velocity_lag)
    about = (arm, turned, links, waves, velocity_waves, clock, joints, lags)
    return _made(q, dq, joints[0], clock[3], fresh, settings, about, X, r, weights), X, r, weights


@kernel
def _made(q, dq, torque, step, fresh, settings, about, X, r, weights):  # pragma: no cover - compiled
    """One row into X, r and weights; returns what it stands for [s]."""
    arm, turned, links, waves, velocity_waves, clock, joints, lags = about
    rotations, translations, axes, turning, gravity = arm
    regressor, pose_lag, velocity_lag = lags
    gain, settling, n = settings[0], settings[2], len(q)
    momentum, drift = momentum_rows(rotations, translations, axes, turning, gravity, q, dq)
    pose, velocity = features_of_sample(q, dq, waves, velocity_waves)
    leaning = leaning_row(rotations, translations, axes, turning, turned, links, q)
    inputs = (momentum, drift, leaning, links, dq, torque, pose, velocity, settings[3 + n :])
    _lagged(inputs, gain, step, fresh, joints, regressor, pose_lag, velocity_lag, X, r)
    for j in range(n):
        weights[j] = 1.0 / (1.0 + settings[3 + j] * (1.0 - np.tanh(abs(dq[j]) / FRICTION_WIDTH) ** 2))
    moved = not np.isfinite(clock[2])
    for j in range(n):
        moved |= abs(q[j] - joints[4, j]) > STILL
    clock[2] += step  # not what passed while nothing was seen
    if moved:
        clock[2] = 0.0
        for j in range(n):
            joints[4, j] = q[j]
    return 0.0 if clock[2] > settling else step


@kernel
def _lagged(inputs, gain, h, fresh, joints, regressor, pose_lag, velocity_lag, X, r):  # pragma: no cover - compiled
    """One row from what goes into its lags, h seconds after the last; `fresh`: the lags start here."""
    momentum, drift, leaning, links, dq, torque, pose, velocity, least_friction = inputs
    n, few, many, wide = dq.shape[0], velocity.shape[1], pose.shape[0], regressor.shape[2]
    own = wide - 10 - TILTS - links.shape[0]  # unknowns of the joints, where there are any
    S, U, P, UP, V, UV = regressor[0], regressor[1], pose_lag[0], pose_lag[1], velocity_lag[0], velocity_lag[1]
    B, UB = joints[2], joints[3]
    x = gain * h
    keep, mix = (2.0 - x) / (2.0 + x), x / (2.0 + x)
    for k in range(many):
        if fresh:
            P[k], UP[k] = 0.0, pose[k]
        P[k] = keep * P[k] + mix * (pose[k] + UP[k])
        UP[k] = pose[k]
    for j in range(n):
        p = bare = 0.0
        for k in range(links.shape[0]):
            p += momentum[j, 10 + k] * links[k]
            bare += drift[j, 10 + k] * links[k]
        u = bare - gain * p
        if fresh:
            B[j], UB[j] = -gain * p, u
        B[j] = keep * B[j] + mix * (u + UB[j])
        UB[j] = u
        r[j] = torque[j] - gain * p - B[j]
        for k in range(wide):
            i = k - 10
            if k < 10:
                Y, D = momentum[j, k], drift[j, k]
            elif i < own:  # offset, Coulomb and viscous friction, rotor, load: `Correction.regressor`
                Y = D = 0.0
                if i % n == j:
                    if i < n:
                        D = 1.0
                    elif i < 2 * n:
                        D = np.tanh(dq[j] / FRICTION_WIDTH)
                    elif i < 3 * n:
                        D = dq[j]
                    elif i < 4 * n:
                        Y = dq[j]
                    else:
                        D = np.tanh(dq[j] / FRICTION_WIDTH)
                        D *= abs(torque[j] - least_friction[j] * D)
            elif i < own + TILTS:
                Y, D = 0.0, leaning[j, i - own]
            else:
                i += 10 - own - TILTS
                Y, D = momentum[j, i], drift[j, i]
            u = D - gain * Y
            if fresh:
                S[j, k], U[j, k] = -gain * Y, u
            S[j, k] = keep * S[j, k] + mix * (u + U[j, k])
            U[j, k] = u
            X[j, k] = gain * Y + S[j, k]
        for k in range(many):
            X[j, wide + k] = P[k]
        for k in range(few):
            if fresh:
                V[j, k], UV[j, k] = 0.0, velocity[j, k]
            V[j, k] = keep * V[j, k] + mix * (velocity[j, k] + UV[j, k])
            UV[j, k] = velocity[j, k]
            X[j, wide + many + k] = V[j, k]

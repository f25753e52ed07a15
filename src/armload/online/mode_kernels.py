"""The hypotheses of `modes.py` in machine code: equations there.

A row is one call: what Python pays for each array that it hands over is as much as a hundred products.
"""

from __future__ import annotations

import math

import numpy as np

from armload.runtime.kernels import kernel

# How kinds follow one another, in units of how often they begin and end (`thresholds.py`). They are compiled in, and
# docs/constants.md does not vary them; set with the thresholds, on seeds of `benchmarks/events.py` below 10 000.

# [mean times between changes] in which the steady arm makes way: for what is handed over, another payload, a contact
WAYS = 3.0
# by how much likelier a hand-over begins where something has just changed: one that seemed to be over goes on
GOES_ON = 10.0
# share of hand-overs' ends at which nothing is there any more, if the rows say so
FOR_NOTHING = 0.2
# share of contacts' ends that leave another payload: a hand that puts something in
LEAVES_ONE = 0.1
# [mean times between drifts] that a drift lasts
DRIFT_LASTS = 0.1
# probability of another payload with which its moment is not begun anew, and the most that a new one begins with
KEPT, AT_FIRST = 0.01, 0.1


@kernel
def take_row(
    h, seen, X, wrench, scale, mean, covariance, taken, error, loud, level, listening, rest,
    root, effort, pushes, hands, others, rates, p, b, f, x, P, A, c, since
):  # fmt: skip  # pragma: no cover - compiled
    """Take a row; returns the probabilities of each kind, and for how long the likeliest other body has been there [s].

    Args:
        h … taken: as of `Modes.take`. loud: (2, n) of the present block, Σ N and Σ B. level: how large the noise is,
            the block's length so far [s], and how many blocks it is the mean of. listening: what decides about it.
            rest: (2, n) mean and variance of the error of what is foreseen of an arm that stands [N·m]; the variance
            is negative before its first row.
        root: (10, 10) mass·R. effort: (n,). pushes: sizes and times of drifts and contacts. hands: (2, K, 6) deviations
            and times of a hand's force and moment. others: sizes and times of bodies. rates: how often each kind begins
            or ends, and how. p … c: probabilities, states; of a hand f (K, 7, 6) mean and covariance. since: moments,
            evidence, ages.
    """
    shared = 1.0 if taken else 1.0 + 2.0 * listening[0] / h
    U, d, v = _innovation(seen, X, scale, root, mean, covariance, shared, level[0], error, rest)
    if taken:
        _listen(h, scale, d, v, p[0], loud, level, listening)
    _weigh(h, U, d, v, wrench, scale, effort, pushes, hands, others, rates, p, b, f, x, P, A, c, since)
    if error[0] > 0.0 and p[0] + p[1] > listening[5]:
        for j in range(len(d)):
            rest[0, j] += rest[1, j] * scale[j] * d[j] / v[j]
            rest[1, j] *= level[0] / v[j]
    handing_from = 1 + pushes.shape[1] + hands.shape[1]
    other_from = handing_from + others.shape[1]
    contact = handing = other = 0.0
    best = other_from
    for k in range(2, handing_from):
        contact += p[k]
    for k in range(handing_from, other_from):
        handing += p[k]
    for k in range(other_from, len(p)):
        other += p[k]
        if p[k] > p[best]:
            best = k
    return p[0] + p[1], p[1], contact, handing, other, since[2, best - other_from]


@kernel
def _listen(h, scale, d, v, steady, loud, level, listening):  # pragma: no cover - compiled
    """Follow how large the noise is, in units of what it is held to be: the mean over the joints of (Σ B)²/Σ N."""
    n = len(d)
    for j in range(n):
        loud[0, j] += scale[j] * scale[j] / v[j]
        loud[1, j] += scale[j] * d[j] / v[j]
    level[1] += h
    block, share, outlier, lowest = listening[1], listening[2], listening[3], listening[4]
    if level[1] < block:
        return
    total = 0.0
    for j in range(n):
        total += loud[1, j] * loud[1, j] / max(loud[0, j], 1e-12)
        loud[0, j] = loud[1, j] = 0.0
    level[1] = 0.0
    if steady > 0.5:
        level[2] += 1.0
        share = max(share, 1.0 / level[2])  # the mean of all, until it forgets the first
        level[0] += share * (min(level[0] * (total / n), outlier * level[0]) - level[0])
        level[0] = max(level[0], lowest)


@kernel
def _innovation(seen, X, scale, root, mean, covariance, shared, level, error, rest):  # pragma: no cover - compiled
    """What one row would see of a body (n, 10), its innovations (n,), their variance (n,); all in units of its noise.

    shared: by how much more than the noise the run's own uncertainty counts, unless the arm stands.
    """
    n = seen.shape[0]
    U, d, v = np.zeros((n, 10)), np.empty(n), np.empty(n)
    for j in range(n):
        d[j], v[j] = seen[j, 10], seen[j, 11]
        for i in range(10):
            d[j] -= seen[j, i] * mean[i]
            for k in range(10):
                v[j] += seen[j, i] * covariance[i, k] * seen[j, k]
            for k in range(i, 10):
                U[j, i] += scale[j] * X[j, k] * root[k, i]
        own = level * max(v[j] - 1.0, 0.0)
        if error[j] > 0.0:
            if rest[1, j] < 0.0:
                rest[0, j], rest[1, j] = 0.0, own / scale[j] ** 2 + error[j]
            d[j] -= scale[j] * rest[0, j]
            v[j] = level + scale[j] ** 2 * rest[1, j]
        else:
            v[j] = level + shared * own
    return U, d, v


@kernel
def _weigh(
    h, U, d, v, wrench, scale, effort, pushes, hands, others, rates, p, b, f, x, P, A, c, since
):  # fmt: skip  # pragma: no cover - compiled
    """One row: what may have begun and ended (p), how likely each hypothesis is beside steady, and its state."""
    sizes, times, bodies, slow = pushes[0], pushes[1], others[0], others[1]
    starts, found, age = since[0], since[1], since[2]
    rare, drift_rare, lasts, handed = rates[0], rates[1], rates[2], rates[3]
    n, hand_from, handing_from = len(d), 1 + len(sizes), 1 + len(sizes) + hands.shape[1]
    other_from = handing_from + len(bodies)
    touches, pulls = h / rates[6] / (len(sizes) - 1), h / rates[5] / hands.shape[1]
    gains, y, gone = np.zeros(len(p)), np.empty(10), np.empty(len(bodies))
    for k in range(len(bodies)):
        keep, far = math.exp(-h / slow[k]), 0.0
        for i in range(10):
            x[k, i] *= keep
            for m in range(10):
                P[k, i, m] *= keep * keep
            P[k, i, i] += (1.0 - keep * keep) * bodies[k] ** 2
        for j in range(n):
            e, s = d[j], v[j]
            for i in range(10):
                e -= U[j, i] * x[k, i]
                y[i] = 0.0
            for m in range(10):  # P is symmetric to the last digit: along its rows several are computed at once
                for i in range(10):
                    y[i] += P[k, m, i] * U[j, m]
            for i in range(10):
                s += U[j, i] * y[i]
            far = max(far, (d[j] - e) ** 2 / max(s - v[j], 1e-12))
            gains[handing_from + k] += 0.5 * (d[j] * d[j] / v[j] - e * e / s - math.log(s / v[j]))
            for i in range(10):
                x[k, i] += y[i] * e / s
                for m in range(10):
                    P[k, i, m] -= y[i] * y[m] / s
        gone[k] = max(math.exp(-0.5 * far), rates[4])
    contact, handing, other = p[2:handing_from].sum(), p[handing_from:other_from].sum(), p[other_from:].sum()
    steady, begins, over, done = p[0] + p[1], h / rare, min(h / lasts, 0.5), min(h / handed, 0.5)
    drifts, back = p[0] * h / drift_rare, p[1] * h / (DRIFT_LASTS * drift_rare)
    nothing = 0.0  # of what was handed over, as likely as its torque on the joint that tells most can be none
    for k in range(len(bodies)):
        nothing += gone[k] * p[handing_from + k]
    p[0] += back - drifts - WAYS * begins * p[0] + over * contact + FOR_NOTHING * done * nothing
    p[1] += drifts - back - WAYS * begins * p[1]
    for k in range(2, handing_from):
        starts_now = touches if k < hand_from else pulls
        p[k] += starts_now * (steady + other) - over * p[k]
    for k in range(handing_from, other_from):
        ends = FOR_NOTHING * done * gone[k - handing_from]
        p[k] += begins * (steady + contact + GOES_ON * other) / len(bodies) - ends * p[k]
    best = other_from + p[other_from:].argmax()
    for k in range(len(starts)):
        p[other_from + k] *= 1.0 - (1.0 + GOES_ON) * begins
        age[k] += h
        if age[k] >= starts[k] and (other_from + k != best or p[best] < KEPT):  # begin it anew
            p[0] += p[other_from + k]
            p[other_from + k] = age[k] * (steady / rare + LEAVES_ONE * contact / lasts + handing / handed) / len(starts)
            p[other_from + k] = min(p[other_from + k], AT_FIRST)
            age[k], found[k] = 0.0, 0.0
            for i in range(10):
                c[k, i] = 0.0
                for m in range(10):
                    A[k, i, m] = 0.0
    for k in range(len(sizes)):
        keep = math.exp(-h / times[k])
        for j in range(n):
            size = sizes[k] * effort[j]
            b[0, k, j] *= keep
            b[1, k, j] = keep * keep * b[1, k, j] + (1.0 - keep * keep) * size * size
            g = scale[j] * b[1, k, j]
            e, s = d[j] - scale[j] * b[0, k, j], scale[j] * g + v[j]
            gains[1 + k] += 0.5 * (d[j] * d[j] / v[j] - e * e / s - math.log(s / v[j]))
            b[0, k, j] += g * e / s
            b[1, k, j] *= v[j] / s
    for k in range(hands.shape[1]):
        gains[hand_from + k] = _pulled(h, d, v, wrench, scale, hands[0, k], hands[1, k], f[k, 0], f[k, 1:])
    for k in range(len(starts)):
        for j in range(n):
            for i in range(10):
                z = U[j, i] / v[j]
                c[k, i] += z * d[j]
                for m in range(i + 1):
                    A[k, i, m] += z * U[j, m]
    _evidence(A, c, bodies, gains[other_from:], found)
    p *= np.exp(gains - gains.max())
    p += 1e-30
    p /= p.sum()


@kernel
def _pulled(h, d, v, wrench, scale, size, time, f, P):  # pragma: no cover - compiled
    """Log likelihood of a row, over steady's, if a hand pulls with f (6,), an Ornstein–Uhlenbeck process, P (6, 6)."""
    gain, y = 0.0, np.empty(6)
    for i in range(6):
        keep = math.exp(-h / time[i])
        f[i] *= keep
        for m in range(6):
            P[i, m] *= keep
            P[m, i] *= keep
        P[i, i] += (1.0 - keep * keep) * size[i] * size[i]
    for j in range(len(d)):
        e, s = d[j], v[j]
        for i in range(6):
            e -= scale[j] * wrench[j, i] * f[i]
            y[i] = 0.0
        for m in range(6):
            for i in range(6):
                y[i] += scale[j] * P[m, i] * wrench[j, m]
        for i in range(6):
            s += scale[j] * wrench[j, i] * y[i]
        gain += 0.5 * (d[j] * d[j] / v[j] - e * e / s - math.log(s / v[j]))
        for i in range(6):
            f[i] += y[i] * e / s
            for m in range(6):
                P[i, m] -= y[i] * y[m] / s
    return gain


@kernel
def _evidence(A, c, sizes, gains, found):  # pragma: no cover - compiled
    """What the last row adds to the log evidence of a body since each moment: L·Lᵀ = 1 + s²·A, L·y = s·c.

    All moments and sizes lie beside each other, and each innermost loop runs over them: several are computed at once.
    """
    K, S = len(c), len(sizes)
    many = K * S
    L, y, log = np.empty((10, 10, many)), np.empty((10, many)), np.empty(many)
    for q in range(many):
        log[q] = -math.log(S)
    for i in range(10):
        at = y[i]
        for k in range(K):
            for b in range(S):
                at[k * S + b] = sizes[b] * c[k, i]
        for j in range(i + 1):
            out, one = L[i, j], 1.0 if i == j else 0.0
            for k in range(K):
                for b in range(S):
                    out[k * S + b] = sizes[b] * sizes[b] * A[k, i, j] + one
            for m in range(j):
                left, right = L[i, m], L[j, m]
                for q in range(many):
                    out[q] -= left[q] * right[q]
            if i == j:
                for q in range(many):
                    out[q] = math.sqrt(out[q])
            else:
                root = L[j, j]
                for q in range(many):
                    out[q] /= root[q]
        for m in range(i):
            left, other = L[i, m], y[m]
            for q in range(many):
                at[q] -= left[q] * other[q]
        root = L[i, i]
        for q in range(many):
            at[q] /= root[q]
            log[q] += 0.5 * at[q] * at[q] - math.log(root[q])
    for k in range(K):
        total = -np.inf
        for b in range(S):
            total = np.logaddexp(total, log[k * S + b])
        gains[k], found[k] = total - found[k], total

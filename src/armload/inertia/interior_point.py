"""The one solver for the nearest body: a primal-dual interior-point method, compiled, with a bound on what is left.

    min ½·|F·(x − target)|²   subject to J(x) ⪰ 0,      Z = J*(FᵀF·(x − target)) ⪰ 0,  Z·J = 0 at the optimum

x holds the ten parameters in units that make J's entries comparable and the target's largest entry 1. Both J and Z
start inside their cones, on the central path of the metric q·1. A scaling G (Nesterov and Todd's) makes both the same
diagonal matrix, G⁻¹·J·G⁻ᵀ = Gᵀ·Z·G = Λ; in its coordinates, dJ = G·X·Gᵀ, a Newton step is the least-squares problem

    min |F·(x − target) + B·X|² + |X − C|²,    B·X = F·dx,

which a QR factorisation solves at the root of the condition number of the normal equations: metrics of condition 1e12
keep their digits. Predictor and corrector (Mehrotra) share it. tr(Z·J) is the gap, and with ρ = FᵀF·(x − target) − Z,
which a full step removes, the cost exceeds the optimum by at most

    tr(Z·J) + ½·ρᵀ·(FᵀF)⁻¹·ρ,

because the cost is strongly convex in its own metric: the method stops on that bound.

Sources: Todd, Toh & Tütüncü, SIAM J. Optim. 8, 1998; Vandenberghe, The CVXOPT linear and quadratic cone program
solvers, 2010 (updating the scaling); Boyd & Vandenberghe, Convex Optimization, 2004, ch. 11.
"""

from __future__ import annotations

import numpy as np

from armload.inertia.cholesky import factor
from armload.inertia.cone import congruent, dual, of_dual, pack, primal, pseudo, unpack
from armload.inertia.orthogonal import eigen, least_squares, reflect, singular
from armload.runtime.kernels import kernel

_BORDER, _LEAST = 0.1, 1e-3  # a step leaves 0.1 of the way to the border, times what the predictor left, at least 1e-3
_STALLED = 9  # steps without halving the bound; a badly scaled metric has five in a row
_ROUNDING = 1e-15  # of x


@kernel
def nearest(target, F, order, tolerance, absolute, limit, x):  # pragma: no cover - compiled
    """Fill in x (10,); a bound on its cost above the optimum's, in units of what was asked for, and the steps taken.

    What is asked for is tolerance·cost + absolute + the change of the cost by rounding of x. target (10,), outside the
    cone, its largest entry ±1; F (10, 10) regular, F[:, order] upper triangular. It stops where the bound is at most 1,
    or no longer shrinks, or after `limit` steps.
    """
    n = 10
    G, inverse, gaps = np.empty((4, 4)), np.empty((4, 4)), np.empty(4)
    A, C, K, T = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4))
    dJ, dZ, L_J, L_Z = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4))
    stack, diagonal = np.empty((2 * n, n)), np.empty(n)
    b, step, away, pull, change = np.empty(2 * n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    off = _start(target, F, order, G, inverse, gaps, A, T, away, change)
    left, least, stalled, bound, taken = 1.0, np.inf, 0, np.inf, 0
    for i in range(n):
        x[i] = target[i] + away[i]
    while True:
        cost = 0.0
        for i in range(n):
            total = 0.0
            for k in range(n):
                total += F[i, k] * away[k]
            pull[i] = total
            cost += 0.5 * total * total
        steepest = 0.0
        for i in range(n):
            total = 0.0
            for k in range(n):
                total += F[k, i] * pull[k]
            steepest += abs(total)
        gap = gaps[0] ** 2 + gaps[1] ** 2 + gaps[2] ** 2 + gaps[3] ** 2
        excess = gap + left * left * off
        now = excess / (tolerance * cost + absolute + _ROUNDING * steepest)
        if not np.isfinite(now):
            break
        if now < bound:
            bound = now
            for i in range(n):
                x[i] = target[i] + away[i]
        stalled = stalled + 1 if excess > 0.5 * least else 0
        least = min(least, excess)
        if now <= 1.0 or stalled > _STALLED or taken >= limit:
            break
        taken += 1

        for k in range(n):
            dual(F[k], A)
            congruent(G, A, T, C)
            pack(C, stack[k])
            for j in range(n):
                stack[n + k, j] = 1.0 if j == k else 0.0
        reflect(stack, diagonal)
        for i in range(n):
            b[i], b[n + i] = -pull[i], 0.0
        least_squares(stack, diagonal, b, step)
        unpack(step, dJ)
        for i in range(4):
            for j in range(4):
                dZ[i, j] = -dJ[i, j]
            dZ[i, i] -= gaps[i]
        reached = min(1.0, _longest(gaps, dJ, A), _longest(gaps, dZ, A))
        predicted = 0.0  # tr(Z·J) there: dZ follows dJ, so that it need not vanish even after a whole step
        for i in range(4):
            for j in range(4):
                dJ_ij, dZ_ij = reached * dJ[i, j], reached * dZ[i, j]
                predicted += (dJ_ij + gaps[i]) * (dZ_ij + gaps[i]) if i == j else dJ_ij * dZ_ij
        centring = max(min(1.0, max(0.0, predicted / gap)), 1.0 - reached) ** 3

        for i in range(4):
            for j in range(i, 4):
                total = 0.0
                for k in range(4):
                    total += dJ[i, k] * dZ[k, j] + dZ[i, k] * dJ[k, j]
                total *= -0.5
                if i == j:
                    total += centring * 0.25 * gap - gaps[i] ** 2
                C[i, j] = C[j, i] = 2.0 * total / (gaps[i] + gaps[j])
        for i in range(4):
            for j in range(4):
                A[i, j] = C[i, j]
            A[i, i] += gaps[i]
        for i in range(n):
            b[i] = -pull[i]
        pack(A, b[n:])
        least_squares(stack, diagonal, b, step)
        unpack(step, dJ)
        for i in range(4):
            for j in range(4):
                dZ[i, j] = C[i, j] - dJ[i, j]
        length = min(_longest(gaps, dJ, A), _longest(gaps, dZ, A))
        length = min(1.0, length * (1.0 - _BORDER * max(1.0 - reached, _LEAST)))
        while length > 1e-9:
            for i in range(4):
                for j in range(4):
                    A[i, j], C[i, j] = length * dJ[i, j], length * dZ[i, j]
                A[i, i] += gaps[i]
                C[i, i] += gaps[i]
            if factor(A, L_J, 0.0) and factor(C, L_Z, 0.0):
                break
            length *= 0.8
        else:
            break
        left *= 1.0 - length
        for i in range(4):  # G·dJ·Gᵀ
            for j in range(4):
                T[i, j] = G[j, i]
        congruent(T, dJ, A, C)
        primal(C, change)
        for i in range(n):
            away[i] += length * change[i]
        _rescale(G, inverse, gaps, L_J, L_Z, A, K, T)
    return bound, taken


@kernel
def _start(target, F, order, G, inverse, gaps, A, T, away, change):  # pragma: no cover - compiled
    """Fill in the scaling and x − target where J·Z = q·v²·1, v as far as J(target) is outside; ½·ρᵀ·(FᵀF)⁻¹·ρ there."""
    n = 10
    excess, Z = np.empty(4), np.empty(n)
    q, off = 0.0, 0.0
    for i in range(n):
        for j in range(n):
            q += F[i, j] ** 2 / n
    pseudo(target, A)
    eigen(A, T, True)
    v = max(-min(A[0, 0], A[1, 1], A[2, 2], A[3, 3]), _ROUNDING)
    for i in range(4):
        root = np.sqrt(A[i, i] ** 2 + 4.0 * v * v)
        inside = 0.5 * (A[i, i] + root) if A[i, i] > 0.0 else 2.0 * v * v / (root - A[i, i])
        outside = v * v / inside  # inside − outside is the eigenvalue
        gaps[i] = np.sqrt(q) * v
        size = np.sqrt(np.sqrt(inside / outside / q))
        for k in range(4):
            G[k, i], inverse[i, k] = T[k, i] * size, T[k, i] / size
        excess[i] = outside
    for i in range(4):
        for j in range(4):
            total = 0.0
            for k in range(4):
                total += T[i, k] * excess[k] * T[j, k]
            A[i, j] = total
    primal(A, away)
    of_dual(A, change)
    for i in range(n):  # F⁻ᵀ·Z, row by row
        at, pull = order[i], 0.0
        total = q * change[at]
        for k in range(i):
            total -= F[k, at] * Z[k]
        Z[i] = total / F[i, at]
        for k in range(n):
            pull += F[i, k] * away[k]
        off += 0.5 * (pull - Z[i]) ** 2
    return off


@kernel
def _rescale(G, inverse, gaps, L_J, L_Z, A, K, T):  # pragma: no cover - compiled
    """G, its inverse and Λ after a step to L_J·L_Jᵀ and L_Z·L_Zᵀ in the old scaling: L_Zᵀ·L_J = U·Λ·Vᵀ."""
    for i in range(4):
        for j in range(4):
            product, scaled, back = 0.0, 0.0, 0.0
            for k in range(j, 4):
                scaled += G[i, k] * L_J[k, j]
                if k >= i:
                    product += L_Z[k, i] * L_J[k, j]
            for k in range(i, 4):
                back += L_Z[k, i] * inverse[k, j]
            A[i, j], K[i, j], T[i, j] = product, scaled, back
    singular(A, K)  # U·Λ and G·L_J·V
    for i in range(4):
        square = 0.0
        for k in range(4):
            square += A[k, i] * A[k, i]
        gaps[i] = np.sqrt(square)
        root = np.sqrt(gaps[i])
        for j in range(4):
            G[j, i] = K[j, i] / root
            total = 0.0
            for k in range(4):
                total += A[k, i] * T[k, j]
            inverse[i, j] = total / (gaps[i] * root)


@kernel
def _longest(gaps, D, A):  # pragma: no cover - compiled
    """How far Λ can go along D within the cone."""
    for i in range(4):
        for j in range(4):
            A[i, j] = D[i, j] / np.sqrt(gaps[i] * gaps[j])
    eigen(A, A, False)
    smallest = min(A[0, 0], A[1, 1], A[2, 2], A[3, 3])
    return -1.0 / smallest if smallest < 0.0 else np.inf

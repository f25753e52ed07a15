"""The posterior of a Gaussian mixture in machine code (`payload_prior.py`): equations there.

Several components are computed at once: they lie beside each other, each innermost loop runs over them, and the order
of sums is left to the compiler.
"""

from __future__ import annotations

import numpy as np

from armload.runtime.kernels import kernel


@kernel(fastmath={"contract", "reassoc", "nsz"})
def _components(precisions, pulls, constants, information, vectors):  # pragma: no cover - compiled
    """P_k (10, 10, K), its lower triangle, m_k (V, 10, K) and ln w_k' (V, K)."""
    V, d, K = len(vectors), len(pulls), len(constants)
    L, y, root = np.empty((d, d, K)), np.empty((d, K)), np.empty(K)
    for k in range(K):
        root[k] = 1.0
    P, means, log = np.empty((d, d, K)), np.empty((V, d, K)), np.empty((V, K))
    for j in range(d):  # L·Lᵀ = Λ + C_k⁻¹, the diagonal inverted: a product is sooner had than a quotient
        for i in range(j, d):
            out, one, known = L[i, j], precisions[i, j], 0.5 * (information[i, j] + information[j, i])
            for k in range(K):
                out[k] = one[k] + known
            for m in range(j):
                one, other = L[i, m], L[j, m]
                for k in range(K):
                    out[k] -= one[k] * other[k]
            if i > j:
                one = L[j, j]
                for k in range(K):
                    out[k] *= one[k]
            else:
                for k in range(K):
                    pivot = np.sqrt(max(out[k], 1e-12))
                    root[k] *= pivot
                    out[k] = 1.0 / pivot
    for i in range(d):  # L⁻¹ in its place
        for j in range(i):
            total, last, out = y[0], L[i, i], L[i, j]
            for k in range(K):
                total[k] = 0.0
            for m in range(j, i):
                one, other = L[i, m], L[m, j]
                for k in range(K):
                    total[k] -= one[k] * other[k]
            for k in range(K):
                out[k] = total[k] * last[k]
    for i in range(d):
        for j in range(i + 1):
            out = P[i, j]
            for k in range(K):
                out[k] = 0.0
            for m in range(i, d):
                one, other = L[m, i], L[m, j]
                for k in range(K):
                    out[k] += one[k] * other[k]
    for v in range(V):
        weight = log[v]
        for k in range(K):
            weight[k] = constants[k] - np.log(root[k])
            for i in range(d):
                means[v, i, k] = 0.0
        for i in range(d):
            total = y[i]
            for k in range(K):
                total[k] = 0.0
            for j in range(i + 1):
                one, pull, known = L[i, j], pulls[j], vectors[v, j]
                for k in range(K):
                    total[k] += one[k] * (pull[k] + known)
            for k in range(K):
                weight[k] += 0.5 * total[k] * total[k]
            for j in range(i + 1):
                out, one = means[v, j], L[i, j]
                for k in range(K):
                    out[k] += one[k] * total[k]
    return P, means, log


@kernel(fastmath={"contract", "reassoc", "nsz"})
def mixture_posteriors(
    precisions, pulls, constants, before, scale, some, rate, information, vectors
):  # pragma: no cover - compiled
    """Means (V, 10), covariances (V, 10, 10), weights (V, K), ln p(evidence) + const (V,), the mass of `some` (V,)."""
    (V, d), K = vectors.shape, len(constants)
    Λ, h = np.empty((d, d)), np.empty((V, d))
    for i in range(d):
        for j in range(d):
            Λ[i, j] = scale[i] * information[i, j] * scale[j]
        for v in range(V):
            h[v, i] = scale[i] * vectors[v, i]
    P, m, weights = _components(precisions, pulls, constants, Λ, h)
    mean, covariance, totals, masses = np.empty((V, d)), np.empty((V, d, d)), np.empty(V), np.empty(V)
    for v in range(V):
        w, largest, total = weights[v], weights[v, 0], 0.0
        for k in range(K):
            largest = max(largest, w[k])
        for k in range(K):
            total += np.exp(w[k] - largest)
        totals[v] = largest + np.log(total)
        largest, total = -np.inf, 0.0
        for k in range(K):  # how well a component fits tells less than it seems to
            w[k] = before[k] + rate * (w[k] - before[k])
            largest = max(largest, w[k])
        for k in range(K):
            w[k] = np.exp(w[k] - largest)
            total += w[k]
        for k in range(K):
            w[k] /= total
        share, total = 1e-300, 0.0
        for k in range(K):
            if some[k]:
                share += w[k]
                total += w[k] * m[v, 0, k]
        masses[v] = scale[0] * total / share
        for i in range(d):
            away, total = m[v, i], 0.0
            for k in range(K):
                total += w[k] * away[k]
            for k in range(K):
                away[k] -= total
            mean[v, i] = total * scale[i]
        for i in range(d):
            for j in range(i + 1):
                one, other, own, total = m[v, i], m[v, j], P[i, j], 0.0
                for k in range(K):
                    total += w[k] * (own[k] + one[k] * other[k])
                covariance[v, i, j] = covariance[v, j, i] = total * scale[i] * scale[j]
    return mean, covariance, weights, totals, masses

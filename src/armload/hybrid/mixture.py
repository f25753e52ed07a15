"""What is known about payloads before the first sample, learned: a mixture of Gaussians over the ten parameters.

    p(phi) = sum_k w_k·N(phi; mu_k, C_k)

A family of real bodies is no Gaussian: inertia follows mass and size, a container has its own loadings, and often there
is nothing at all. With Gaussian evidence (Λ, h = Λ·phi_ML) the posterior is again a mixture, in closed form:

    P_k = (Λ + C_k⁻¹)⁻¹,   m_k = P_k·(h + C_k⁻¹·mu_k),
    w_k' ∝ w_k·√(|P_k|/|C_k|)·exp(½·m_kᵀ·P_k⁻¹·m_k − ½·mu_kᵀ·C_k⁻¹·mu_k)

Source: Bishop 2006, ch. 2.3 and 9.2; fitted by scikit-learn's `GaussianMixture`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from armload.errors import ModelError

_COMPONENTS = 12  # per family
_FLOOR = np.array([2e-3] + [2e-4] * 3 + [2e-5] * 6)  # [kg, kg·m, kg·m²] no component is narrower than this


class MixturePosterior(NamedTuple):
    """phi given evidence: mean (10,), covariance (10, 10), the components' weights (K,), and ln p(evidence) + const."""

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    weights: NDArray[np.float64]
    log_evidence: float


@dataclass(frozen=True, eq=False)
class MixturePrior:
    """A mixture of Gaussians over phi.

    Args:
        weights: (K,), summing to 1. means: (K, 10). covariances: (K, 10, 10), positive definite.
        families: (K,) name of the family each component belongs to.

    Raises:
        ModelError: shapes that do not match, weights that are none, or a covariance that is not positive definite.
    """

    weights: NDArray[np.float64]
    means: NDArray[np.float64]
    covariances: NDArray[np.float64]
    families: tuple[str, ...]

    def __post_init__(self) -> None:
        K = len(self.weights)
        if self.means.shape != (K, 10) or self.covariances.shape != (K, 10, 10) or len(self.families) != K or K == 0:
            raise ModelError(f"a mixture of {K} components has means of shape {self.means.shape}: expected ({K}, 10)")
        if not (np.all(self.weights >= 0) and abs(self.weights.sum() - 1.0) < 1e-6):
            raise ModelError("the weights of a mixture are not 0 or more with the sum 1")
        try:
            np.linalg.cholesky(self._scaled)
        except np.linalg.LinAlgError:
            raise ModelError("a covariance of a mixture is not positive definite") from None

    @classmethod
    def fit(cls, samples: Mapping[str, ArrayLike], shares: Mapping[str, float], seed: int = 0) -> MixturePrior:
        """Fit each family's components to draws of it (S, 10); `shares` are the families' weights.

        A family whose draws are all the same becomes one narrow component.
        """
        from sklearn.mixture import GaussianMixture

        weights, means, covariances, names = [], [], [], []
        for family, drawn in samples.items():
            phi = np.asarray(drawn, dtype=float)
            unit = phi.std(axis=0) + _FLOOR
            count = _COMPONENTS if np.any(phi.std(axis=0) > _FLOOR) else 1
            found: Any = GaussianMixture(count, reg_covar=1e-5, random_state=seed, max_iter=200).fit(phi / unit)
            weights += list(shares[family] * found.weights_)
            means += list(found.means_ * unit)
            covariances += [c * np.outer(unit, unit) + np.diag(_FLOOR**2) for c in found.covariances_]
            names += [family] * count
        w = np.array(weights)
        return cls(w / w.sum(), np.array(means), np.array(covariances), tuple(names))

    def only(self, *families: str) -> MixturePrior:
        """The prior of somebody who knows which family the payload is of.

        Raises:
            ModelError: a family the mixture does not have.
        """
        stray = set(families) - set(self.families)
        if stray or not families:
            known = ", ".join(sorted(set(self.families)))
            raise ModelError(f"no family is called {', '.join(sorted(stray)) or 'that'}: expected some of {known}")
        keep = np.array([name in families for name in self.families])
        w = self.weights[keep]
        names = tuple(name for name in self.families if name in families)
        return MixturePrior(w / w.sum(), self.means[keep], self.covariances[keep], names)

    def moved(self, T: NDArray[np.float64]) -> MixturePrior:
        """The same prior over T·phi, T (10, 10) regular: about another frame, say."""
        return MixturePrior(self.weights, self.means @ T.T, T @ self.covariances @ T.T, self.families)

    def joined(self, other: MixturePrior, share: float) -> MixturePrior:
        """A mixture of this one and, with the given share, another."""
        return MixturePrior(
            np.concatenate([(1.0 - share) * self.weights, share * other.weights]),
            np.concatenate([self.means, other.means]),
            np.concatenate([self.covariances, other.covariances]),
            self.families + other.families,
        )

    @cached_property
    def mean(self) -> NDArray[np.float64]:
        """Mean of phi (10,)."""
        return self.weights @ self.means

    @cached_property
    def std(self) -> NDArray[np.float64]:
        """Standard deviation of each parameter (10,)."""
        second = np.einsum("kii->ki", self.covariances) + self.means**2
        return np.sqrt(self.weights @ second - self.mean**2)

    @cached_property
    def _scale(self) -> NDArray[np.float64]:
        return np.sqrt(np.abs(np.einsum("kii->ki", self.covariances))).max(
            axis=0
        )  # units differ by orders of magnitude

    @cached_property
    def _scaled(self) -> NDArray[np.float64]:
        return self.covariances / np.outer(self._scale, self._scale)

    @cached_property
    def _precisions(self) -> NDArray[np.float64]:
        return np.asarray(np.linalg.inv(self._scaled), dtype=float)

    @cached_property
    def _pulls(self) -> NDArray[np.float64]:
        return np.einsum("kij,kj->ki", self._precisions, self.means / self._scale)

    @cached_property
    def _constants(self) -> NDArray[np.float64]:
        quadratic = np.einsum("ki,ki->k", self._pulls, self.means / self._scale)
        return np.log(np.maximum(self.weights, 1e-300)) - 0.5 * quadratic - 0.5 * np.linalg.slogdet(self._scaled)[1]

    def posterior(self, information: NDArray, vector: NDArray) -> MixturePosterior:
        """phi given Λ (10, 10) and h (10,), moments matched."""
        return self.posteriors(information, vector[None])[0]

    def posteriors(self, information: NDArray, vectors: NDArray) -> list[MixturePosterior]:
        """phi given Λ (10, 10) and each of several h (V, 10): one factorisation serves them all."""
        s = self._scale
        unit = np.outer(s, s)
        means, covariances, weights, totals = _posteriors(
            self._precisions, self._pulls, self._constants, information * unit, vectors * s
        )
        return [
            MixturePosterior(m * s, c * unit, w, float(total))
            for m, c, w, total in zip(means, covariances, weights, totals, strict=True)
        ]


@njit(cache=True, nogil=True)
def _posteriors(precisions, pulls, constants, information, vectors):  # pragma: no cover - compiled
    K, V, d = len(precisions), len(vectors), 10
    means, covariances = np.zeros((V, K, d)), np.empty((K, d, d))
    log = np.empty((V, K))
    L, inverse = np.empty((d, d)), np.empty((d, d))
    for k in range(K):
        half = 0.0  # ½·ln|precision|
        for j in range(d):
            for i in range(j, d):
                total = 0.5 * (precisions[k, i, j] + precisions[k, j, i] + information[i, j] + information[j, i])
                for m in range(j):
                    total -= L[i, m] * L[j, m]
                if i == j:
                    inverse[j, j] = 1.0 / np.sqrt(max(total, 1e-12))  # a product is sooner had than a quotient
                    half -= np.log(inverse[j, j])
                else:
                    L[i, j] = total * inverse[j, j]
        for j in range(d):  # inverse of L, by columns
            for i in range(j + 1, d):
                total = 0.0
                for m in range(j, i):
                    total -= L[i, m] * inverse[m, j]
                inverse[i, j] = total * inverse[i, i]
        for i in range(d):
            for j in range(i + 1):
                total = 0.0
                for m in range(i, d):
                    total += inverse[m, i] * inverse[m, j]
                covariances[k, i, j] = covariances[k, j, i] = total
        for v in range(V):
            quadratic = 0.0
            for i in range(d):
                total = 0.0
                for j in range(d):
                    total += covariances[k, i, j] * (pulls[k, j] + vectors[v, j])
                means[v, k, i] = total
                quadratic += total * (pulls[k, i] + vectors[v, i])
            log[v, k] = constants[k] + 0.5 * quadratic - half
    mean, covariance, totals = np.zeros((V, d)), np.zeros((V, d, d)), np.empty(V)
    weights = np.empty((V, K))
    for v in range(V):
        largest = log[v].max()
        weights[v] = np.exp(log[v] - largest)
        total = weights[v].sum()
        totals[v] = largest + np.log(total)
        weights[v] /= total
        for k in range(K):
            w = weights[v, k]
            for i in range(d):
                mean[v, i] += w * means[v, k, i]
        for k in range(K):
            w = weights[v, k]
            if w < 1e-12:
                continue
            for i in range(d):
                away = means[v, k, i] - mean[v, i]
                for j in range(i + 1):
                    covariance[v, i, j] += w * (covariances[k, i, j] + away * (means[v, k, j] - mean[v, j]))
        for i in range(d):
            for j in range(i):
                covariance[v, j, i] = covariance[v, i, j]
    return mean, covariance, weights, totals

"""What is known about payloads before the first sample, learned: a mixture of Gaussians over the ten parameters.

    p(phi) = sum_k w_k·N(phi; mu_k, C_k)

A family of real bodies is no Gaussian: inertia follows mass and size, a container has its own loadings, and often there
is nothing at all. With Gaussian evidence (Λ, h = Λ·phi_ML) the posterior is again a mixture, in closed form:

    P_k = (Λ + C_k⁻¹)⁻¹,   m_k = P_k·(h + C_k⁻¹·mu_k),
    w_k' ∝ w_k·l_k^beta,   l_k = √(|P_k|/|C_k|)·exp(½·m_kᵀ·P_k⁻¹·m_k − ½·mu_kᵀ·C_k⁻¹·mu_k)

beta = 1 is Bayes' rule. A component is a rough description of a family, not where its bodies come from, so that how
well it fits tells less of the others than l_k says: the weights are those of a coarsened posterior, beta < 1.

Sources: Bishop 2006, ch. 2.3 and 9.2; fitted by scikit-learn's `GaussianMixture`. Miller & Dunson, JASA 2019 (robust
Bayesian inference via coarsening).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import ModelError
from armload.posterior.mixture_kernels import mixture_posteriors

_COMPONENTS = 12  # per family: a container's loadings, a box's sizes and places; trained models hold them
# families that a difference is made of: less nothing, or a screw, a payload is what it was
_BODIES = ("boxes", "shapes", "tools", "container")
NOTHING = "nothing"
_LITTLE = (NOTHING, "light")  # families of an empty hand, or nearly
# beta: the smaller, the more of the inertias lie inside, at no larger an error; the smallest in steps of 0.1 with which
# half-widths are about three times the error on sound logs, no more (`benchmarks/coarsening.py`)
COARSENED = 0.7
_FLOOR = np.array([2e-3] + [2e-4] * 3 + [2e-5] * 6)  # [kg, kg·m, kg·m²] no component is narrower than this


class MixturePosterior(NamedTuple):
    """phi given evidence: mean (10,), covariance (10, 10), the components' weights (K,), and ln p(evidence) + const.

    mass_if_any: mean of the mass [kg], if there is something that is not light.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    weights: NDArray[np.float64]
    log_evidence: float
    mass_if_any: float

    def or_else(self, other: MixturePosterior, odds: float) -> tuple[MixturePosterior, float]:
        """This one, or another of the same evidence under another prior, moments matched; and the other's probability.

        odds: of the other prior over this one, before the evidence.
        """
        ahead = np.log(odds) + other.log_evidence - self.log_evidence
        share = float(1.0 / (1.0 + np.exp(-np.clip(ahead, -500.0, 500.0))))
        away = other.mean - self.mean
        covariance = (1.0 - share) * self.covariance + share * other.covariance
        covariance = covariance + share * (1.0 - share) * np.outer(away, away)
        log = float(np.logaddexp(self.log_evidence, np.log(odds) + other.log_evidence) - np.log1p(odds))
        mass = self.mass_if_any + share * (other.mass_if_any - self.mass_if_any)
        return MixturePosterior(self.mean + share * away, covariance, self.weights, log, mass), share

    def among(self, each: list[MixturePosterior], p: NDArray[np.float64]) -> MixturePosterior:
        """One of these with probabilities p (V,), moments matched; its log evidence is this one's."""
        means = np.array([x.mean for x in each])
        mean = p @ means
        away = means - mean
        covariance = np.einsum("v,vij->ij", p, [x.covariance for x in each]) + (away.T * p) @ away
        mass = float(p @ [x.mass_if_any for x in each])
        return self._replace(mean=mean, covariance=covariance, mass_if_any=mass)


@dataclass(frozen=True, eq=False)
class MixturePrior:
    """A mixture of Gaussians over phi.

    Args:
        weights: (K,), summing to 1. means: (K, 10). covariances: (K, 10, 10), positive definite.
        families: (K,) name of the family each component belongs to.
        beta: how much of how well a component fits counts in the weights; 1 is Bayes' rule.

    Raises:
        ModelError: shapes that do not match, weights that are none, or a covariance that is not positive definite.
    """

    weights: NDArray[np.float64]
    means: NDArray[np.float64]
    covariances: NDArray[np.float64]
    families: tuple[str, ...]
    beta: float = COARSENED

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
        return MixturePrior(w / w.sum(), self.means[keep], self.covariances[keep], names, self.beta)

    def split(self, *families: str) -> tuple[MixturePrior, MixturePrior]:
        """The prior of these families or nothing, and that of all others.

        Raises:
            ModelError: a family the mixture does not have, or all that it has.
        """
        said = self.only(*families, NOTHING)
        others = set(self.families) - set(said.families)
        if not others:
            raise ModelError("all families are named: expected some, or none where the payload may be of any")
        return said, self.only(*sorted(others))

    def moved(self, T: NDArray[np.float64]) -> MixturePrior:
        """The same prior over T·phi, T (10, 10) regular: about another frame, say."""
        return replace(self, means=self.means @ T.T, covariances=T @ self.covariances @ T.T)

    def joined(self, other: MixturePrior, share: float) -> MixturePrior:
        """A mixture of this one and, with the given share, another."""
        return MixturePrior(
            np.concatenate([(1.0 - share) * self.weights, share * other.weights]),
            np.concatenate([self.means, other.means]),
            np.concatenate([self.covariances, other.covariances]),
            self.families + other.families,
            self.beta,
        )

    @cached_property
    def differences(self) -> MixturePrior | None:
        """Of one payload less another: every pair of components that are something; None: there are none."""
        some = [k for k, family in enumerate(self.families) if family in _BODIES]
        if not some:
            return None
        w, means, covariances = self.weights[some], self.means[some], self.covariances[some]
        pairs = len(some) ** 2
        return MixturePrior(
            np.outer(w, w).ravel() / w.sum() ** 2,
            (means[:, None] - means).reshape(pairs, 10),
            (covariances[:, None] + covariances).reshape(pairs, 10, 10),
            ("difference",) * pairs,
            self.beta,
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
    def lever_square(self) -> float:
        """E|m·r|² over E m² [m²]: the mean square lever of the centre of mass, by the square of the mass."""
        squares = (self.mean**2 + self.std**2)[:4]
        return float(squares[1:].sum() / squares[0])

    @cached_property
    def _something(self) -> NDArray[np.bool_]:
        """Which components (K,) are of something that is not light; all, where all are."""
        some = ~np.isin(self.families, _LITTLE)
        return some if some.any() else ~some

    @cached_property
    def _scale(self) -> NDArray[np.float64]:
        return np.sqrt(np.abs(np.einsum("kii->ki", self.covariances))).max(
            axis=0
        )  # units differ by orders of magnitude

    @cached_property
    def _scaled(self) -> NDArray[np.float64]:
        return self.covariances / np.outer(self._scale, self._scale)

    @cached_property
    def _tables(self) -> tuple[NDArray[np.float64], ...]:
        """Of the components, in units of `_scale` and beside each other: precisions (10, 10, K), pulls C_k⁻¹·mu_k
        (10, K), what else is in ln w_k·l_k (K,), and ln w_k (K,).
        """
        precisions, means = np.asarray(np.linalg.inv(self._scaled), dtype=float), self.means / self._scale
        pulls = np.einsum("kij,kj->ki", precisions, means)
        before = np.log(np.maximum(self.weights, 1e-300))
        constants = before - 0.5 * np.einsum("ki,ki->k", pulls, means)
        constants -= 0.5 * np.linalg.slogdet(self._scaled)[1]
        symmetric = 0.5 * (precisions + np.swapaxes(precisions, 1, 2))
        return np.ascontiguousarray(np.moveaxis(symmetric, 0, 2)), np.ascontiguousarray(pulls.T), constants, before

    def posterior(self, information: NDArray, vector: NDArray) -> MixturePosterior:
        """phi given Λ (10, 10) and h (10,), moments matched."""
        return self.posteriors(information, vector[None])[0]

    def posteriors(self, information: NDArray, vectors: NDArray) -> list[MixturePosterior]:
        """phi given Λ (10, 10) and each of several h (V, 10): one factorisation serves them all.

        Raises:
            ModelError: arrays of other shapes.
        """
        if information.shape != (10, 10) or vectors.shape[1:] != (10,):  # compiled code reads as many numbers
            raise ModelError(
                f"the information has shape {information.shape} and its vectors {vectors.shape}: expected (10, 10) and "
                "10 numbers each"
            )
        tables = (*self._tables, self._scale, self._something, self.beta)
        found = mixture_posteriors(*tables, information, vectors)
        return [MixturePosterior(m, P, w, float(total), float(x)) for m, P, w, total, x in zip(*found, strict=True)]

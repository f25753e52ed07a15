"""The nearest body: what ten numbers that no body has are replaced by.

    min (x − phi)ᵀ·Λ·(x − phi)   subject to J(x) ⪰ margin      (lengths in units of 0.1 m)

One compiled solver (`interior_point.py`) serves estimates, which ask for all digits, and live streams, which ask for
less and wait for less. Where Λ knows nothing of a direction, the nearest within it is asked for, too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import InertiaError
from armload.inertia.cholesky import factor, root
from armload.inertia.cone import pseudo
from armload.inertia.consistency import LENGTH, is_consistent
from armload.inertia.interior_point import nearest
from armload.inertia.orthogonal import eigen
from armload.inertia.parameters import InertialParameters, numbers
from armload.runtime.kernels import kernel

_SCALE = np.array([1.0] + [1 / LENGTH] * 3 + [1 / LENGTH**2] * 6)
_BALL = np.array([1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 2.0])  # phi·_SCALE of the body whose J is the identity

_ANSWER = 1e-5  # [kg] smallest eigenvalue of an answer's J, lengths in units of 0.1 m
_CONSISTENT = 1e-9  # [kg] tolerance of `is_consistent`
_FLOOR = 1e-13  # of the information, relative: a condition of 1e12 is information, a thousand roundings are not
_INDEFINITE = 1e-8  # relative, of what no information of that rank leaves
_STEPS = 60  # about 15 are taken, 40 where the information is singular
_CLOSE = 1e-12  # relative to the squared distance
_ENOUGH = 1e4  # times what is asked for, where rounding ends the search before
_NEAR = 5e-4  # of half the squared distance, in standard deviations


def nearest_body(phi: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """An answer (10,): phi where a body can have it, else the nearest that one can, in the metric of phi's covariance.

    It stays far enough inside to survive being printed.
    """
    if is_consistent(phi):
        return phi.copy()
    return nearest_consistent(phi, np.linalg.inv(covariance), margin=_ANSWER)


def distance_to_body(phi: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Standard deviations between an estimate phi (10,) and the nearest body, in the metric of phi's covariance.

    Bodies are a convex cone: where the truth is one and phi ~ N(truth, covariance), the square is at most that of the
    distance to the truth, a chi-square of ten degrees of freedom.
    """
    away = nearest_body(phi, covariance) - phi
    return float(np.sqrt(away @ np.linalg.solve(covariance, away))) if away.any() else 0.0


def nearest_consistent(phi: ArrayLike, information: ArrayLike | None = None, margin: float = 1e-6) -> NDArray:
    """The physically consistent parameters nearest to phi: argmin (x − phi)ᵀ·Λ·(x − phi) subject to J(x) ⪰ margin.

    The LMI of Sousa & Cortesão, IJRR 2014, with Wensing's J, solved to 1e-12 of the squared distance or to rounding.

    Args:
        phi: the ten numbers to project.
        information: Λ (10, 10), symmetric positive semidefinite, usually the inverse covariance of phi. Default: units
            of kg, 0.1 kg·m and 0.01 kg·m². What is below 1e-13 of the largest counts as rounding.
        margin: smallest eigenvalue of J allowed, lengths in units of 0.1 m [kg].

    Raises:
        InertiaError: phi is not ten finite numbers, the information is not what is expected, or no answer was found.
    """
    phi = InertialParameters(numbers(phi, "phi", 10)).phi  # ten finite numbers, or a sentence
    weight = (
        np.diag(_SCALE**2)
        if information is None
        else np.ascontiguousarray(numbers(information, "the information", 10, 10))
    )
    if weight.shape != (10, 10) or not np.all(np.isfinite(weight)):
        raise InertiaError(
            f"the information of phi has shape {weight.shape} or is not finite: expected a finite matrix (10, 10), "
            "usually the inverse covariance"
        )
    x, bound, left = _project(phi, weight, margin, 0.99 * margin, _CLOSE, 0.0)
    if left > _INDEFINITE:
        raise InertiaError(
            "the information of phi has a negative eigenvalue: expected a symmetric positive semidefinite matrix, "
            "usually the inverse covariance"
        )
    if not bound <= _ENOUGH:
        raise InertiaError(
            f"no consistent parameters found near {phi.tolist()}: the search ended {_CLOSE * bound:.1g} of the squared "
            "distance from the optimum; check the units of the parameters and of their information"
        )
    return x


def near_consistent(phi: ArrayLike, precision: ArrayLike) -> NDArray[np.float64]:
    """phi (10,) if it is a body, else one whose squared distance is at most 1e-3 above that of `nearest_body`.

    The metric is that of `precision` (10, 10). A live stream can afford it at every answer.

    Raises:
        InertiaError: numbers that are not finite, or as for `nearest_consistent`.
    """
    phi = np.ascontiguousarray(numbers(phi, "phi", 10))
    P = np.ascontiguousarray(numbers(precision, "the information", 10, 10))
    if phi.ndim > 1 or P.ndim > 2:
        return nearest_consistent(phi, P)  # which says so
    x, bound, left = _project(phi, P, _ANSWER, -_CONSISTENT * max(1.0, phi[0]), _CLOSE, _NEAR)
    return x if bound <= 1.0 and left <= _INDEFINITE else nearest_consistent(phi, P, _ANSWER)


@kernel
def _project(phi, information, margin, inside, tolerance, absolute):  # pragma: no cover - compiled
    """x (10,); the bound that `nearest` gives, 0 for phi itself where J(phi) ⪰ inside; what `root` left over."""
    n = 10
    x, target, J, L = np.empty(n), np.empty(n), np.empty((4, 4)), np.empty((4, 4))
    total = 0.0
    for i in range(n):
        x[i] = phi[i]
        total += phi[i]
        for j in range(n):
            total += information[i, j]
    if not np.isfinite(total):
        return x, np.inf, 0.0
    for i in range(n):
        target[i] = phi[i] * _SCALE[i] - inside * _BALL[i]
    pseudo(target, J)
    if factor(J, L, 0.0) and (inside > 0.0 or phi[0] > 0.0):
        return x, 0.0, 0.0
    size = 0.0
    for i in range(n):
        target[i] += (inside - margin) * _BALL[i]
        size = max(size, abs(target[i]))
    F, order = np.empty((n, n)), np.empty(n, np.int64)
    scaled = np.empty((n, n))
    for i in range(n):
        target[i] /= size
        for j in range(n):
            scaled[i, j] = information[i, j] / (_SCALE[i] * _SCALE[j]) * size * size
    left = root(scaled, F, order, _FLOOR)
    bound, _ = nearest(target, F, order, tolerance, absolute, _STEPS, x)
    for i in range(n):
        x[i] = size * x[i] + margin * _BALL[i]
    pseudo(x, J)
    eigen(J, L, False)
    missing = max(0.0, margin - min(J[0, 0], J[1, 1], J[2, 2], J[3, 3]))  # rounding: a small ball makes up for it
    for i in range(n):
        x[i] = (x[i] + missing * _BALL[i]) / _SCALE[i]
    return x, bound, left

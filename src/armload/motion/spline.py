"""A motion of B-splines: from rest at a pose, about it, and back to rest at the same pose.

    q(t) = q_0 + Σ_k c_k·B_k(t),   k = 1 … K,   0 ≤ t ≤ T

B_k are the inner functions of the clamped quintic B-spline basis on K + 1 even intervals: the first three and the last
three functions, which alone have a value, a slope or a curvature at the ends, are left out. So q = q_0 and
dq = ddq = 0 at both ends, exactly, and q is four times continuously differentiable between them.

Source: de Boor, A Practical Guide to Splines, 1978.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.motion.motion import Motion
from armload.runtime.real_numbers import own_reals

DEGREE = 5
_ENDS = 3  # functions left out at each end: value, slope and curvature


@dataclass(frozen=True, eq=False)
class SplineMotion(Motion):
    """Quintic B-splines about a pose, at rest there at both ends.

    >>> motion = SplineMotion(np.array([0.5]), np.array([[0.0, 0.3, 0.0]]), 2.0)
    >>> [round(float(motion([t])[0][0, 0]), 3) for t in (0.0, 1.0, 2.0)]
    [0.5, 0.633, 0.5]

    Args:
        start: q_0 (n,) [rad].
        control: c (n, K) [rad].
        lasting: T [s].
        name: what the motion is called in logs and exports.
        note: where it comes from, in a sentence.

    Raises:
        MotionError: shapes that do not fit, a number that is not finite, a time that is not positive.
    """

    start: NDArray[np.float64]
    control: NDArray[np.float64]
    lasting: float
    name: str = "spline"
    note: str = ""

    def __post_init__(self) -> None:
        for name, dims in (("start", 1), ("control", 2)):
            value = own_reals(getattr(self, name), f"{name} of the motion {self.name!r}", MotionError)
            if value.ndim != dims or value.size == 0 or not np.all(np.isfinite(value)):
                expected = "(n,)" if dims == 1 else "(n, K)"
                raise MotionError(
                    f"{name} of the motion {self.name!r} has shape {value.shape}: expected {expected}, finite, in rad"
                )
            object.__setattr__(self, name, value)
        if len(self.control) != len(self.start):
            raise MotionError(
                f"the motion {self.name!r} has control points of {len(self.control)} joints and a start of "
                f"{len(self.start)}: expected the same"
            )
        if not (np.isfinite(self.lasting) and self.lasting > 0):
            raise MotionError(f"the motion {self.name!r} lasts {self.lasting} s: expected a positive time")
        object.__setattr__(self, "lasting", float(self.lasting))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.start)

    @property
    def duration(self) -> float:
        """T [s]."""
        return self.lasting

    def derivative(self, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """The derivative of q of any order ≥ 0 at times t (N,) within 0 … T; (N, n)."""
        out = spline_basis(self.control.shape[1], self.lasting, t, order) @ self.control.T
        return out + self.start if order == 0 else out


def spline_basis(count: int, lasting: float, t: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """The derivative of B_1 … B_K of the given order at times t (N,); (N, K).

    The basis of degree 5 − order by the recursion of Cox and de Boor, and B′ = p·(B_i/Δ_i − B_(i+1)/Δ_(i+1)), by which
    a derivative has the differences of the control points over the knots' distances for control points.
    """
    inner = np.zeros((count + 2 * _ENDS, count))  # control points of each function
    inner[_ENDS:-_ENDS] = np.eye(count)
    breaks = np.linspace(0.0, lasting, count + 2 * _ENDS - DEGREE + 1)
    knots = np.concatenate([np.zeros(DEGREE), breaks, np.full(DEGREE, lasting)])
    degree = DEGREE
    for _ in range(min(order, DEGREE + 1)):
        if degree == 0:
            return np.zeros((len(t), count))
        wide = knots[degree + 1 : -1] - knots[1 : -degree - 1]
        inner = degree * np.diff(inner, axis=0) / wide[:, None]
        knots, degree = knots[1:-1], degree - 1
    return _basis(knots, degree, np.asarray(t, dtype=float)) @ inner


def _basis(knots: NDArray[np.float64], degree: int, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """All functions of a clamped basis at times t (N,)."""
    last = len(knots) - degree - 2
    within = np.clip(np.searchsorted(knots, t, side="right") - 1, degree, last)
    out = np.zeros((len(t), len(knots) - 1))
    out[np.arange(len(t)), within] = 1.0
    for d in range(1, degree + 1):
        wide = knots[d:] - knots[:-d]  # 0 where knots are repeated, and there the function is 0
        up = np.divide(t[:, None] - knots[:-d], wide, out=np.zeros((len(t), len(wide))), where=wide > 0)
        out = up[:, :-1] * out[:, :-1] + (1.0 - up[:, 1:]) * out[:, 1:]
    return out

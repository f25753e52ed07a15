"""What the last moments of a stream are: steady, a contact, a payload being handed over, or another payload.

Given all rows before, a row says e ~ N(w·phi, v) (`SequentialPosterior.seen`). With phi ~ N(m, P) from the stream its
innovation is d = e − w·m, of variance v + wᵀ·P·w; the noise is taken to be as large as it has lately been. With
R·Rᵀ = E[phi·phiᵀ] of a body (`body_root`) the hypotheses are

    steady          d = noise
    drifting        d_j = b_j + noise,     b_j an Ornstein–Uhlenbeck process, small and slow: the arm itself
    contact         the same, large and quick: anything that touches the arm, any torque on any joint, varying;
                    or d = Jᵀ·f + noise, f (6,) an Ornstein–Uhlenbeck process: a hand that pulls at the payload frame
    handing over    d = W·R·x + noise,     x (10,) an Ornstein–Uhlenbeck process: a body that varies
    another         d = W·R·x + noise,     x ~ N(0, s²·1) since one of several moments: a body that stays

of several sizes and times each, A = Σ Rᵀ·Wᵀ·W·R/v and c = Σ Rᵀ·Wᵀ·d/v of another body since its moment. Likelihoods,
how one follows another and what an arm that stands foresees wrongly: docs/theory.md, "A live stream". Rows that are
withheld from a run share the errors of its predictions, and count for less.

Sources: interacting multiple models, Blom & Bar-Shalom, IEEE T-AC 1988; change points, Adams & MacKay 2007.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.online.mode_kernels import take_row
from armload.online.thresholds import (
    CONTACT_LASTS,
    CONTACT_TIME,
    DRIFT_RARE,
    DRIFT_SIZE,
    DRIFT_TIME,
    EARLY_RARE,
    HAND_LEVER,
    HAND_RARE,
    HAND_SIZES,
    HAND_TIME,
    HANDED_OVER,
    HANDING_TIMES,
    LETS_GO,
    LEVEL,
    LEVEL_BEGINS,
    LEVEL_BLOCK,
    LEVEL_OUTLIER,
    LEVEL_SHARE,
    LIKELY,
    LOWEST_LEVEL,
    PUSH_SIZES,
    RARE,
    SAME_ERROR,
    STARTS,
)
from armload.regression.prior import BODY_SIZES, body_root

_CONTACT = 2  # where each kind begins among the probabilities; 0: steady, 1: drifting
_HANDING, _BODIES = _CONTACT + len(PUSH_SIZES) + len(HAND_SIZES), len(BODY_SIZES)
_OTHER = _HANDING + _BODIES


class Modes:
    """The probabilities of what the last rows are.

    Args:
        mass: of a payload as the arm usually holds [kg]. effort: torque scale of each joint (n,) [N·m]. larger:
            times that what it holds is larger than what the built-in arms do (`payload_size`).

    Attributes:
        steady: probability that the arm holds what it held, and nothing else pulls at it; drifting or not.
        drift: that the arm itself changes, slowly. contact: that something touches it. handing: that the payload is
            changing. other: that it has changed, and stays. stays: for how long the likeliest other payload has been
            there [s]. taken_off: of `contact`, that part of what was on the arm from the start is off instead.
    """

    def __init__(self, mass: float, effort: NDArray[np.float64], larger: float = 1.0) -> None:
        n, bodies, starts = len(effort), _BODIES, len(STARTS)
        self.root, self.effort = mass * body_root(larger), effort
        # what is handed to compiled code comes in few arrays: each costs as much as a hundred products
        self._pushes = np.array([[DRIFT_SIZE, *PUSH_SIZES], [DRIFT_TIME, *(CONTACT_TIME for _ in PUSH_SIZES)]])
        force = 9.81 * mass * HAND_SIZES  # (K,) [N]
        size = np.column_stack([*(3 * [force]), *(3 * [HAND_LEVER * force])])  # (K, 6) force, then moment
        self._hands = np.array([size, np.full_like(size, HAND_TIME)])
        self._others = np.array([BODY_SIZES, HANDING_TIMES])
        self._rates = np.array([RARE, DRIFT_RARE, CONTACT_LASTS, HANDED_OVER, LETS_GO, HAND_RARE, RARE])
        self._weights = np.zeros(_OTHER + starts)
        self._b = np.zeros((2, len(self._pushes[0]), n))  # mean and variance of each joint's torque
        self._f = np.zeros((len(HAND_SIZES), 7, 6))  # mean and covariance of each hand's force and moment
        self._x, self._P = np.zeros((bodies, 10)), np.zeros((bodies, 10, 10))
        self._A, self._c = np.zeros((starts, 10, 10)), np.zeros((starts, 10))  # of A the lower triangle
        self._since = np.array([STARTS, np.zeros(starts), np.zeros(starts)])  # [s], log evidence found, age [s]
        self._loud, self._level = np.zeros((2, n)), np.array([LEVEL, 0.0, LEVEL_BEGINS])
        self._about_level = np.array([SAME_ERROR, LEVEL_BLOCK, LEVEL_SHARE, LEVEL_OUTLIER, LOWEST_LEVEL, LIKELY])
        self._rest = np.zeros((2, n))  # mean and variance of what is foreseen wrongly at rest [N·m]
        self.reset()

    def reset(self) -> None:
        """All is steady; how large the noise has been is not forgotten."""
        self._weights[:] = 0.0
        self._weights[0] = 1.0
        self.foresee_anew()
        for state in (self._b, self._f, self._x, self._P, self._A, self._c, self._since[1:]):
            state[:] = 0.0
        self.steady, self.drift, self.contact, self.handing, self.other, self.stays = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        self.taken_off = 0.0

    def foresee_anew(self) -> None:
        """The arm has moved, or is foreseen from another state: what that is wrong by at rest is not known."""
        self._rest[1] = -1.0

    def expect(self, early: bool) -> None:
        """Whether the stream has just begun, when changes are more frequent."""
        self._rates[0] = EARLY_RARE if early else RARE

    def no_payload(self, perhaps_taken_off: bool) -> None:
        """What would be held since the last row is no payload: it is something that touches the arm.

        perhaps_taken_off: or something was taken off that was on the arm from the start. What presses it upwards
        steadily looks the same, so that neither is likelier.
        """
        self.taken_off = 0.5 * (self.handing + self.other) if perhaps_taken_off else 0.0
        self.contact += self.handing + self.other
        self.handing = self.other = self.stays = 0.0

    @property
    def level(self) -> float:
        """How large the noise has lately been, in units of what it is expected to be."""
        return float(self._level[0])

    def take(
        self,
        h: float,
        seen: NDArray[np.float64],
        X: NDArray[np.float64],
        wrench: NDArray[np.float64],
        scale: NDArray[np.float64],
        mean: NDArray[np.float64],
        covariance: NDArray[np.float64],
        taken: bool,
        error: NDArray[np.float64] | None = None,
    ) -> None:
        """Take a row.

        Args:
            h: what the row stands for [s]. seen: (n, 12) as in `SequentialPosterior`. X: (n, ≥ 10) the row's regressor,
                payload first. wrench: (n, 6) Jᵀ of the payload frame (`wrench_row`). scale: (n,) what the row was
                multiplied by. mean, covariance: of phi before the row.
            taken: whether the run took it, too. error: of an arm that stands, the variance (n,) of what all rows there
                are wrong by, beside what the run does not know [N²·m²].
        """
        self.steady, self.drift, self.contact, self.handing, self.other, self.stays = take_row(
            h, seen, X, wrench, scale, mean, covariance, taken, np.zeros(len(scale)) if error is None else error,
            self._loud, self._level, self._about_level, self._rest,
            self.root, self.effort, self._pushes, self._hands, self._others, self._rates,
            self._weights, self._b, self._f, self._x, self._P, self._A, self._c, self._since,
        )  # fmt: skip
        self.taken_off = 0.0

    def shift(self, going_on: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """By how much phi (10,) has changed if it has, and its covariance, by the likeliest such hypothesis.

        A body's size is not known: it may be any, as likely as it explains the rows.
        going_on: of those alone by which it may still be changing.
        """
        k = int(self._weights[_HANDING : _OTHER if going_on else None].argmax())
        if k < _BODIES:
            p, x, P = self._weights[_HANDING:_OTHER], self._x, self._P
        else:
            k -= _BODIES
            A, c = self._A[k] + np.tril(self._A[k], -1).T, self._c[k]
            P = np.linalg.inv(A + np.eye(10) / BODY_SIZES[:, None, None] ** 2)
            x = P @ c
            likely = x @ c + np.linalg.slogdet(P)[1] - 20.0 * np.log(BODY_SIZES)
            p = np.exp(0.5 * (likely - likely.max()))
        p = p / max(float(p.sum()), 1e-300)
        mean = p @ x
        spread = np.tensordot(p, P + x[:, :, None] * x[:, None, :], 1) - np.outer(mean, mean)
        return self.root @ mean, self.root @ spread @ self.root.T

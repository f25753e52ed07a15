"""How much of an arm's own torque is in a log: the test for a wrong arm, unit, sign or torque channel.

Averaged over a window from t₁ to t₂, the joint torque of the bare arm is (p(t₂) − p(t₁))/(t₂ − t₁) + mean(g − Cᵀ·q̇),
with p the momentum; the payload's is the same with its momentum regressor. So no acceleration is needed. With friction
and an offset of each joint,

    tau = s·tau_arm + W·phi + offset + level·tanh(q̇/0.06) + noise

is linear in (s, phi, offset, level). All but s get a prior wide enough for any sound robot: a payload of three times
the rated mass, motor-side friction, a model error of a few per cent of the rated torque, a tenth of it for a joint at
rest, which friction holds in any way below stiction. If even then s is surely not
about 1, or the noise far larger than a model error, the torque is not that of this arm.

What tau is, the torque, the motors' currents or the torque without gravity, is a question between three models with
s = 1, of each of which tau becomes the torque: c·tau, tau + g. With K the covariance of all that is unknown and y what
the arm's own torque leaves,

    ln p(tau) = −½·yᵀ·K⁻¹·y + Σ ν·ln c + what they have in common

with ν ≤ 1 what is noise alone in a row, and not made up by the unknowns, whose priors are wider than anything believed.
A payload that changes at a cut is two payloads, phi before and phi after, in the place of one: K grows, and

    ln p(tau | cut) = −½·yᵀ·K⁻¹·y − ½·ln|K|

is averaged over the cuts, none of which is likelier than another.

Torque of the motors' side holds viscous friction and the inertia of the rotors, too. On a motion to and fro, whose
acceleration is opposite to its position, they look like gravity that is missing: what is called so has to be so with
both among the unknowns (`gears`). The first question is asked without them, as they would hide another arm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import FRICTION_WIDTH, Arm, momentum_regressor, rated_effort, rated_mass
from armload.identification.thresholds import (
    FRICTION,
    HEAVIEST,
    MODEL_ERROR,
    OFFSET,
    SCALE_HIGH,
    SCALE_LOW,
    SCALE_SURE,
    STICTION,
)
from armload.recording import Recording
from armload.recording.windows import Windows, integrals, windows
from armload.regression.prior import payload_size, within_reach

MOST_WINDOWS = 120  # spread over the log: one factor needs no more, whatever the log's length
# as many as a log of six seconds has: for where many accounts of a log are compared, as all pairs of joints exchanged
FEW_WINDOWS = 24
_ALIKE = 4  # neighbouring windows that err alike, and count for one
# [rated torques per rad/s, per rad/s²] standard deviation of viscous friction and of the rotors' inertia, as motor
# currents show them: a UR10e's joints have 0.04 to 0.06, and 0.008 to 0.024 where both are fitted beside gravity
_VISCOUS, _ROTOR = 0.05, 0.02
_POINTS = 9  # model evaluations per window of 0.25 s: the trapezoidal rule errs by 0.3 % at 1 Hz
_WEIGHT = np.r_[0.5, np.ones(_POINTS - 2), 0.5] / (_POINTS - 1)  # of each in its mean


class TorqueScale(NamedTuple):
    """How much of the arm's own torque there is.

    scale: s; std: its standard deviation; misfit: rms of what s = 1 leaves, in units of a plausible model error.
    evidence: ln p(tau) of s = 1, to be compared with that of the same log as something else. best: of the likeliest s.
    """

    scale: float
    std: float
    misfit: float
    evidence: float
    best: float

    @property
    def is_wrong(self) -> bool:
        """Whether s is surely beyond what a sound log of the arm shows."""
        return self.scale + SCALE_SURE * self.std < SCALE_LOW or self.scale - SCALE_SURE * self.std > SCALE_HIGH

    @property
    def is_determined(self) -> bool:
        """Whether s is known better than that the arm's own torque may be in it or not: it moves, against gravity."""
        return self.std < 1.0

    @property
    def is_negative(self) -> bool:
        """Whether s is surely below 0."""
        return self.scale + SCALE_SURE * self.std < 0

    def contradicts(self, wrong: TorqueScale) -> bool:
        """Whether s is that of a sound log, and surely another than a wrong one that was seen before."""
        return SCALE_LOW <= self.scale <= SCALE_HIGH and abs(self.scale - wrong.scale) > SCALE_SURE * float(
            np.hypot(self.std, wrong.std)
        )


def torque_scale(
    recording: Recording,
    arm: Arm,
    constants: NDArray[np.float64] | None = None,
    most: int = MOST_WINDOWS,
    lacks: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
    gears: bool = False,
) -> TorqueScale | None:
    """Fit the model above to a log; None if the log is too short to say anything.

    constants: (n,) [N·m/A] if tau is current. most: windows, spread over the log. lacks: what was taken out of tau, at
    positions (M, n), (M, n) [N·m]. gears: whether viscous friction and the rotors' inertia may be in tau, too.
    """
    system = _System.of(recording, arm, most, lacks, gears, constants)
    return None if system is None else _Marginal.of(system).fit(system.y, constants)


def torque_scales(
    recording: Recording, arm: Arm, orders: Iterable[list[int]], most: int = MOST_WINDOWS
) -> list[TorqueScale | None]:
    """`torque_scale` of a log with the columns of tau in each of some orders; what is not of tau is computed once."""
    system = _System.of(recording, arm, most)
    if system is None:
        return [None for _ in orders]
    marginal, tau = _Marginal.of(system), system.tau
    return [marginal.fit(tau[:, order].ravel() / system.noise) for order in orders]


def log_odds_of_change(recording: Recording, arm: Arm) -> float:
    """ln p(tau) with a payload that changes once, at any window of the log, over that with one payload; s = 1."""
    system = _System.of(recording, arm)
    if system is None or system.windows < 2:
        return 0.0
    whole = _log_evidence(system.A, system.y - system.b)
    window = np.repeat(np.arange(system.windows), arm.n)[:, None]
    payload, arms_own = system.A[:, :10], system.A[:, 10:]
    odds = [
        _log_evidence(np.hstack([payload * (window < cut), payload * (window >= cut), arms_own]), system.y - system.b)
        for cut in range(1, system.windows)
    ]
    return float(np.logaddexp.reduce(odds) - np.log(len(odds)) - whole) / _ALIKE


def _log_evidence(A: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """ln p(y) of y ~ N(0, K = 1 + A·Aᵀ), but for what does not depend on A."""
    inner = np.eye(A.shape[1]) + A.T @ A
    projected = A.T @ y
    return 0.5 * float(projected @ np.linalg.solve(inner, projected)) - 0.5 * float(np.linalg.slogdet(inner)[1])


class _System(NamedTuple):
    """y = s·b + A·x + noise, x and noise ~ N(0, 1), of all rows, n a window.

    A: (W·n, p), the payload's ten columns first. b, noise: (W·n,), noise in N·m. tau: (W, n) [N·m].
    """

    windows: int
    A: NDArray[np.float64]
    b: NDArray[np.float64]
    tau: NDArray[np.float64]
    noise: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        recording: Recording,
        arm: Arm,
        most: int = MOST_WINDOWS,
        lacks: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
        gears: bool = False,
        constants: NDArray[np.float64] | None = None,
    ) -> _System | None:
        """The model above of a log; None: it is too short to say anything. Arguments as of `torque_scale`."""
        parts = _some(windows(recording), most)
        if len(parts.first) < 2:
            return None
        own, payload, tau, friction, moving = _averages(recording, arm, parts)
        tau = tau if constants is None else tau * constants
        if lacks is not None:
            tau = tau + _mean(recording, parts, lacks)
        W, n = own.shape
        rated = rated_effort(arm)
        offset = np.broadcast_to(np.eye(n), (W, n, n))
        level = friction[:, :, None] * np.eye(n)
        mass = HEAVIEST * rated_mass(arm)
        columns, prior = (
            [payload, offset, level],
            [within_reach(mass, payload_size(arm)), OFFSET * rated, FRICTION * rated],
        )
        if gears:
            columns += [x[:, :, None] * np.eye(n) for x in _changes(recording, parts)]
            prior += [_VISCOUS * rated, _ROTOR * rated]
        A, prior = np.concatenate(columns, axis=2), np.concatenate(prior)  # (W, n, 10 + 2n or 4n), standard deviations
        # a joint at rest is held by any friction below stiction: tanh knows nothing of it
        noise = (rated * np.hypot(MODEL_ERROR, STICTION * (1.0 - np.minimum(moving, 1.0)))).ravel()
        return cls(W, A.reshape(W * n, -1) * prior / noise[:, None], own.ravel() / noise, tau, noise)

    @property
    def y(self) -> NDArray[np.float64]:
        """(W·n,)."""
        return self.tau.ravel() / self.noise


class _Marginal(NamedTuple):
    """y = s·b + noise with everything but s marginalised, K = 1 + A·Aᵀ.

    inner: (1 + Aᵀ·A)⁻¹, (p, p). Kb: K⁻¹b. information: bᵀK⁻¹b.
    """

    system: _System
    inner: NDArray[np.float64]
    Kb: NDArray[np.float64]
    information: float

    @classmethod
    def of(cls, system: _System) -> _Marginal:
        A, b = system.A, system.b
        inner = np.asarray(np.linalg.inv(np.eye(A.shape[1]) + A.T @ A), float)
        Kb = b - A @ (inner @ (A.T @ b))
        return cls(system, inner, Kb, float(b @ Kb))

    def fit(self, y: NDArray[np.float64], constants: NDArray[np.float64] | None = None) -> TorqueScale | None:
        """s = bᵀK⁻¹y / bᵀK⁻¹b, and what s = 1 leaves; None where b tells nothing. constants: as of `torque_scale`."""
        (A, b), inner, information = (self.system.A, self.system.b), self.inner, self.information
        if information <= 0:
            return None
        scale = float(y @ self.Kb) / information
        left = y - b
        rest = left - A @ (inner @ (A.T @ left))  # what s = 1 leaves
        misfit = float(np.sqrt(np.mean(rest**2)))
        std = np.sqrt(_ALIKE) * max(1.0, misfit) / np.sqrt(information)
        evidence = -0.5 * float(left @ rest)
        if constants is not None:  # of what the unknowns make up, which may be anything, nothing is believed
            noise_alone = 1.0 - np.einsum("ij,jk,ik->i", A, inner, A)
            evidence += float(noise_alone.reshape(-1, len(constants)).sum(axis=0) @ np.log(constants))
        best = evidence + 0.5 * (scale - 1.0) ** 2 * information
        return TorqueScale(scale, std, misfit, evidence / _ALIKE, best / _ALIKE)


def _averages(recording: Recording, arm: Arm, parts: Windows) -> tuple[NDArray, ...]:
    """Window means: bare arm's torque (W, n), payload regressor (W, n, 10), tau, tanh(dq/width) and its size (W, n)."""
    q, dq = recording.q, recording.dq
    T = (recording.t[parts.last] - recording.t[parts.first])[:, None]
    rows = _points(parts)
    shape = rows.shape
    p, drift = (x.reshape(*shape, -1) for x in arm.momentum(q[rows.ravel()], dq[rows.ravel()]))
    Y = momentum_regressor(arm.frame_motion(q[rows.ravel()]), dq[rows.ravel()])
    Yp, Yd = (x.reshape(*shape, arm.n, 10) for x in Y)
    own = (p[:, -1] - p[:, 0]) / T + np.einsum("wpi,p->wi", drift, _WEIGHT)
    payload = (Yp[:, -1] - Yp[:, 0]) / T[:, :, None] + np.einsum("wpij,p->wij", Yd, _WEIGHT)
    tau = integrals(recording, lambda rows: recording.tau[rows], parts) / T
    friction = integrals(recording, lambda rows: np.tanh(dq[rows] / FRICTION_WIDTH), parts) / T
    moving = integrals(recording, lambda rows: np.abs(np.tanh(dq[rows] / FRICTION_WIDTH)), parts) / T
    return own, payload, tau, friction, moving


def _changes(recording: Recording, parts: Windows) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Window means of velocity [rad/s] and acceleration [rad/s²], each (W, n)."""
    T = (recording.t[parts.last] - recording.t[parts.first])[:, None]
    dq, ddq = ((x[parts.last] - x[parts.first]) / T for x in (recording.q, recording.dq))
    return dq, ddq


def _points(parts: Windows) -> NDArray[np.intp]:
    """The rows (W, P) of each window that the model is evaluated at."""
    return np.linspace(parts.first, parts.last, _POINTS, axis=1).round().astype(np.intp)


def _mean(
    recording: Recording, parts: Windows, torque: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Window means (W, n) of a torque that positions (M, n) tell [N·m]."""
    rows = _points(parts)
    return np.einsum("wpi,p->wi", torque(recording.q[rows.ravel()]).reshape(*rows.shape, -1), _WEIGHT)


def _some(parts: Windows, most: int) -> Windows:
    """At most so many, spread over the log."""
    if len(parts.first) <= most:
        return parts
    chosen = np.linspace(0, len(parts.first) - 1, most).round().astype(int)
    return Windows(parts.first[chosen], parts.last[chosen])

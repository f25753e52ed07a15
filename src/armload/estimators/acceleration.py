"""Least squares with an acceleration that is not differenced from sample to sample.

    tau − tau_bare(q, dq, ddq) = Y(q, dq, ddq)·phi

`CommandedLeastSquares` takes ddq from the commanded motion: free of noise, and right where the controller tracks well.
A log does not hold the command. `PolynomialLeastSquares` then takes q, dq and ddq from a polynomial fitted to the
measured positions around each sample. Against the true command it misses what lies above a few hertz and costs a delay
of half a window, but it follows where the arm really went. A finite Fourier series of the whole log (Swevers et al.,
IEEE TRA 1997) would be smoother still, but it needs the motion's period and a whole number of them: a stream has none.

Sources: Atkeson, An & Hollerbach, IJRR 1986; Savitzky & Golay, Analytical Chemistry 1964 (the local polynomial).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, payload_regressor
from armload.errors import IdentificationError
from armload.estimators.normal import NormalLeastSquares
from armload.motion import Motion
from armload.recording import Recording
from armload.regression.rows import SPACING

_DEGREE = 4
_NEIGHBOURS = 4  # samples on either side that a polynomial needs at least
_TRACKS = 0.05  # [rad] rms distance from the commanded motion beyond which it is another motion


class PolynomialLeastSquares(NormalLeastSquares):
    """OLS, or WLS, with q, dq, ddq and tau from polynomials of degree 4 around each sample (at most 200 a second).

    tau passes through the same polynomial, so that both sides of the equation are smoothed alike. Nothing is said of
    the first and last half window.

    >>> from armload.arms import arm
    >>> PolynomialLeastSquares(arm("panda")).name
    'polynomial'

    Args:
        arm: the bare arm.
        half: half the window [s]; it holds at least 4 samples either side.
        weighted: as in `NormalLeastSquares`.

    Raises:
        IdentificationError: a window that is not positive.
    """

    name = "polynomial"

    def __init__(self, arm: Arm, half: float = 0.08, weighted: bool = False) -> None:
        if not half > 0:
            raise IdentificationError(f"half the window is {half} s: expected a positive number of seconds")
        self.half = half
        super().__init__(arm, weighted)

    def _restart(self) -> None:
        self._t, self._signal = np.zeros(0), np.zeros((0, 2 * self.arm.n))  # the samples still needed: t, [q tau]
        self._next = _NEIGHBOURS  # index into them of the next sample to decide on
        self._begin, self._fitted_at = np.inf, -np.inf

    def _rows(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        self._begin = min(self._begin, t[0])
        t = self._t = np.concatenate([self._t, t])
        self._signal = np.concatenate([self._signal, np.concatenate([q, tau], axis=1)])
        index = np.arange(len(t))
        first = np.minimum(np.searchsorted(t, t - self.half), index - _NEIGHBOURS)
        stop = np.maximum(np.searchsorted(t, t + self.half, side="right"), index + _NEIGHBOURS + 1)
        times, fits, k = [], [], self._next
        while k + _NEIGHBOURS < len(t) and t[-1] >= t[k] + self.half:
            if t[k] - self.half >= self._begin and t[k] - self._fitted_at >= SPACING:
                window = slice(first[k], stop[k])
                fits.append(_derivatives((t[window] - t[k]) / self.half, self._signal[window]))
                times.append(t[k])
                self._fitted_at = t[k]
            k += 1
        keep = max(first[k], 0) if k < len(t) else 0
        self._t, self._signal, self._next = t[keep:], self._signal[keep:], k - keep
        if not fits:
            return np.zeros(0), np.zeros((0, self.arm.n)), np.zeros((0, self.arm.n, 10))
        (q, tau), (dq, _), (ddq, _) = (np.split(x, 2, axis=1) for x in np.moveaxis(np.array(fits), 1, 0))
        dq, ddq = dq / self.half, ddq / self.half**2
        return np.array(times), *_newton_euler(self.arm, q, dq, ddq, tau)


class CommandedLeastSquares(NormalLeastSquares):
    """OLS, or WLS, with the commanded motion's exact acceleration and the measured q, dq and tau.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> CommandedLeastSquares(arm("panda"), taie2024()).name
    'commanded'

    Args:
        arm: the bare arm.
        motion: the commanded one.
        start: time of the log at which the motion started [s]; None: at the first sample.
        weighted: as in `NormalLeastSquares`.

    Raises:
        IdentificationError: the motion moves another number of joints, or (`trace`, `run`) the recording is of another.
    """

    name = "commanded"

    def __init__(self, arm: Arm, motion: Motion, start: float | None = None, weighted: bool = False) -> None:
        if motion.n != arm.n:
            raise IdentificationError(
                f"the motion {motion.name!r} moves {motion.n} joints: {arm.name} has {arm.n}; name the motion it ran"
            )
        self.motion, self.start = motion, start
        super().__init__(arm, weighted)

    def reset(self) -> None:
        """Forget everything; the next sample is the first."""
        self._zero = self.start
        super().reset()

    def _restart(self) -> None:
        pass

    def _rows(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        if self._zero is None:
            self._zero = float(t[0])
        ddq = self.motion(t - self._zero)[2]
        return t, *_newton_euler(self.arm, q, dq, ddq, tau)

    def _check(self, recording: Recording) -> None:
        super()._check(recording)
        start = recording.t[0] if self.start is None else self.start
        away = np.sqrt(np.mean((recording.q - self.motion(recording.t - start)[0]) ** 2))
        if away > _TRACKS:
            raise IdentificationError(
                f"{recording.source} does not follow the motion {self.motion.name!r} (rms distance {away:.3g} rad): "
                "name the motion that was commanded, and when it started"
            )


def _newton_euler(
    arm: Arm, q: NDArray, dq: NDArray, ddq: NDArray, tau: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return tau - arm.torque(q, dq, ddq), payload_regressor(arm.frame_motion(q), dq, ddq)


def _derivatives(x: NDArray, signal: NDArray) -> NDArray[np.float64]:
    """Value, first and second derivative (3, K) at x = 0 of the polynomials fitted to signal (W, K) at x (W,)."""
    powers = np.vander(x, _DEGREE + 1, increasing=True)
    return np.linalg.lstsq(powers, signal, rcond=None)[0][:3] * np.array([[1.0], [1.0], [2.0]])

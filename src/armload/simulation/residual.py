"""Residual torque outside the rigid-body model: a smooth, repeatable function of the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

_LENGTH_SCALE = (0.7, 1.5)  # [rad]
_WAVES = 48
_HARMONICS = np.array([1, 2, 3, 4, 6, 8])  # of a joint's turn, that bearings and transmissions show


@dataclass(frozen=True, eq=False)
class SmoothTorque:
    """A smooth random function of the pose, f_i(q) = sum_k a_ik·cos(w_k·q) + b_ik·sin(w_k·q) [N·m].

    Random Fourier features of a Gaussian process with a squared-exponential kernel (Rahimi & Recht, NIPS 2007); the
    waves are shared by the joints, the amplitudes are each joint's own. Over all poses, joint i has the rms it was
    drawn with.

    waves: w (K, n) [1/rad]; cosine, sine: a, b (K, n) [N·m].
    """

    waves: NDArray[np.float64]
    cosine: NDArray[np.float64]
    sine: NDArray[np.float64]

    @classmethod
    def drawn(cls, rms: ArrayLike, rng: np.random.Generator) -> SmoothTorque:
        """Draw one with the given rms (n,) [N·m] and length scales between 0.7 and 1.5 rad."""
        rms = np.asarray(rms, dtype=float)
        waves = rng.normal(size=(_WAVES, len(rms))) / rng.uniform(*_LENGTH_SCALE, size=(_WAVES, 1))
        return cls._of_rms(waves, rms, rng)

    @classmethod
    def of_length(cls, rms: ArrayLike, length: tuple[float, float], rng: np.random.Generator) -> SmoothTorque:
        """Draw one with the given rms (n,) [N·m] and length scales uniform in their logarithm [rad]."""
        rms = np.asarray(rms, dtype=float)
        scale = np.exp(rng.uniform(*np.log(length), size=(_WAVES, 1)))
        waves = rng.normal(size=(_WAVES, len(rms))) / scale
        return cls._of_rms(waves, rms, rng)

    @classmethod
    def ripple(cls, rms: ArrayLike, rng: np.random.Generator) -> SmoothTorque:
        """Harmonics of each joint's own angle, as transmissions and bearings make them, with the given rms (n,)."""
        rms = np.asarray(rms, dtype=float)
        own = np.tile(np.eye(len(rms)), (len(_HARMONICS), 1))
        return cls._of_rms(np.repeat(_HARMONICS, len(rms))[:, None] * own, rms, rng, own)

    @classmethod
    def _of_rms(
        cls, waves: NDArray, rms: NDArray, rng: np.random.Generator, share: NDArray | float = 1.0
    ) -> SmoothTorque:
        a, b = rng.normal(size=(2, *waves.shape)) * share
        scale = rms / np.sqrt(0.5 * (a**2 + b**2).sum(axis=0))
        return cls(waves, a * scale, b * scale)

    def __add__(self, other: SmoothTorque) -> SmoothTorque:
        return SmoothTorque(
            np.concatenate([self.waves, other.waves]),
            np.concatenate([self.cosine, other.cosine]),
            np.concatenate([self.sine, other.sine]),
        )

    def __call__(self, q: ArrayLike) -> NDArray[np.float64]:
        """f (N, n) at poses q (N, n)."""
        angle = np.atleast_2d(q) @ self.waves.T
        return np.cos(angle) @ self.cosine + np.sin(angle) @ self.sine

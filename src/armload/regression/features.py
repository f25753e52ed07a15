"""The nonparametric part of an arm's mismatch: smooth functions of the pose and of the velocity, one pair per joint.

    residual_j(q, dq) = sum_r w_jr·f_r(q) + sum_r v_jr·g_r(dq_j),      w ~ N(0, σ_w²), v ~ N(0, σ_v²)

f are random Fourier features cos(ω·q), sin(ω·q) of a Gaussian process whose squared-exponential kernel has length
scales of 0.7–1.5 rad; g are the same over u = asinh(dq/0.03), which stretches the low speeds, so that friction of any
shape is among the functions. What the rigid-body unknowns cannot say about an arm is of this kind: slow, repeatable
and a function of the configuration (measured on two Pandas: 0.2–0.6 % of the effort limit after links, offsets and
friction are fitted).

Source: Rahimi & Recht, NIPS 2007.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.runtime.kernels import kernel

# [rad] of the pose, mixed, as an arm's own is not known. Stated priors
# (test_pose_features_have_the_kernel_of_a_gaussian_process)
_LENGTH_SCALES = (0.7, 0.9, 1.1, 1.3, 1.5)
_SLOW = 0.03  # [rad/s] where the stretched velocity turns from linear to logarithmic: half of the friction's width
# length scale over the stretched velocity: friction bends once within a factor of e in speed
# (test_velocity_features_span_friction_of_any_shape)
_VELOCITY_SCALE = 1.0
_SEED = 2024  # of the waves, which a trained model's widths were calibrated with: never another


@dataclass(frozen=True)
class JointFeatures:
    """Random Fourier features of an arm's pose, the same for all joints, and of each joint's velocity.

    >>> features = JointFeatures(n=7, pose=64, velocity=8)
    >>> features.of_pose(np.zeros((5, 7))).shape, features.of_velocity(np.zeros((5, 7))).shape
    ((5, 64), (5, 7, 8))

    Args:
        n: joints.
        pose, velocity: how many features (even numbers); 0: none.
    """

    n: int
    pose: int = 128
    velocity: int = 12

    @property
    def size(self) -> int:
        """Features R of one joint."""
        return self.pose + self.velocity

    @cached_property
    def waves(self) -> NDArray[np.float64]:
        """ω (pose/2, n) [1/rad]."""
        count = self.pose // 2
        scale = np.array(_LENGTH_SCALES)[np.arange(count) % len(_LENGTH_SCALES)]
        return np.random.default_rng([_SEED, self.n]).normal(size=(count, self.n)) / scale[:, None]

    @cached_property
    def velocity_waves(self) -> NDArray[np.float64]:
        """Waves (velocity/2,) over the stretched velocity."""
        # quantiles of the half-normal, so that few waves already span the functions evenly
        count = self.velocity // 2
        shares = (np.arange(count) + 0.5) / max(count, 1)
        return np.array([NormalDist().inv_cdf((1.0 + share) / 2.0) for share in shares]) / _VELOCITY_SCALE

    def first(self, fewer: JointFeatures) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Which of these are the features (R',) with fewer waves of the pose, and the factor (R',) that makes them so.

        The waves of fewer features are the first of more.
        """
        half, few = self.pose // 2, fewer.pose // 2
        pose = np.concatenate([np.arange(few), half + np.arange(few)])
        velocity = self.pose + np.arange(self.velocity)
        scale = np.concatenate([np.full(2 * few, np.sqrt(half / max(few, 1))), np.ones(self.velocity)])
        return np.concatenate([pose, velocity]), scale

    def of_pose(self, q: ArrayLike) -> NDArray[np.float64]:
        """f (N, pose) at poses (N, n), the same for all joints; the mean square of a weighted sum is the weights'."""
        angle = np.atleast_2d(q) @ self.waves.T
        return np.concatenate([np.cos(angle), np.sin(angle)], axis=1) / np.sqrt(max(self.pose // 2, 1))

    def of_velocity(self, dq: ArrayLike) -> NDArray[np.float64]:
        """g (N, n, velocity) at velocities (N, n); the mean square of a weighted sum is the weights'."""
        angle = self.stretched(dq)[0][:, :, None] * self.velocity_waves
        return np.concatenate([np.cos(angle), np.sin(angle)], axis=2) / np.sqrt(max(self.velocity // 2, 1))

    def stretched(self, dq: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """u = asinh(dq/0.03) at velocities (N, n), and du/d(dq) [s/rad]."""
        ratio = np.atleast_2d(dq) / _SLOW
        return np.arcsinh(ratio), 1.0 / (_SLOW * np.sqrt(1.0 + ratio**2))


@kernel
def features_of_sample(q, dq, waves, velocity_waves):  # pragma: no cover - compiled
    half, few, n = waves.shape[0], velocity_waves.shape[0], q.shape[0]
    pose, velocity = np.empty(2 * half), np.empty((n, 2 * few))
    for i in range(half):
        angle = 0.0
        for k in range(n):
            angle += waves[i, k] * q[k]
        pose[i], pose[half + i] = np.cos(angle) / np.sqrt(half), np.sin(angle) / np.sqrt(half)
    for j in range(n):
        stretched = np.arcsinh(dq[j] / _SLOW)
        for i in range(few):
            angle = stretched * velocity_waves[i]
            velocity[j, i] = np.cos(angle) / np.sqrt(few)
            velocity[j, few + i] = np.sin(angle) / np.sqrt(few)
    return pose, velocity


def distinct_poses(q: NDArray[np.float64]) -> float:
    """How many poses of N (N, n) [rad, m] an arm's smooth mismatch tells apart: N²/Σ_ij k(q_i, q_j)².

    k is the kernel of the functions of the pose, (tr K)²/tr K² of its matrix the number of values that are as good as
    independent: 1 at rest, N where all are far apart. Source: Rasmussen & Williams 2006, section 2.6 (degrees of
    freedom of a linear smoother are of the same kind).

    >>> round(distinct_poses(np.zeros((5, 7))), 3), round(distinct_poses(9.0 * np.eye(7)), 3)
    (1.0, 7.0)
    """
    apart = ((q[:, None] - q[None]) ** 2).sum(axis=-1)
    kernel = np.mean([np.exp(-0.5 * apart / scale**2) for scale in _LENGTH_SCALES], axis=0)
    return len(q) ** 2 / float((kernel**2).sum())

"""What the page draws: an arm without meshes, and bodies that weigh and turn as the numbers say.

Pure functions of numbers; nothing here knows how a picture is made.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.inertia import InertialParameters, phi_to_com

if TYPE_CHECKING:
    from trimesh import Trimesh

    from armload.online import OnlineEstimate

CHI2_95 = 7.814727903251179  # 95 % quantile of chi² with three degrees of freedom
_THICK, _THIN = 0.042, 0.026  # radius of the first and the last link, in units of the length of all links
_SHORT = 1e-3  # [m] a link shorter than this shows its joint only


class Part(NamedTuple):
    """One solid of the arm, fixed to a frame: 0 is the base, k the joint frame of link k."""

    frame: int
    kind: str  # "link" or "joint"
    mesh: Trimesh


class Box(NamedTuple):
    """Axes (3, 3) as columns, centre (3,) and lengths (3,) along the axes [m], in the payload frame."""

    axes: NDArray[np.float64]
    centre: NDArray[np.float64]
    lengths: NDArray[np.float64]


def capsule(start: ArrayLike, end: ArrayLike, radius: float, sides: int = 24) -> Trimesh:
    """All points at `radius` [m] from the segment between two points (3,): a rounded link."""
    from trimesh import creation, geometry

    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(np.linalg.norm(end - start))
    mesh = creation.capsule(height=length, radius=radius, count=[sides, sides])
    place = np.array(geometry.align_vectors([0.0, 0.0, 1.0], (end - start) / length))
    place[:3, 3] = 0.5 * (start + end)
    return mesh.apply_transform(place)


def drum(centre: ArrayLike, axis: ArrayLike, radius: float, length: float, sides: int = 32) -> Trimesh:
    """A cylinder about a centre (3,) [m], along an axis (3,): a joint; its rims stay sharp where light is smoothed."""
    from trimesh import creation

    centre, half = np.asarray(centre, dtype=float), 0.5 * length * np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return creation.cylinder(radius=radius, segment=[centre - half, centre + half], sections=sides).smooth_shaded


def ellipsoid(semi_axes: ArrayLike) -> Trimesh:
    """An ellipsoid about the origin with these semi-axes (3,) [m] along x, y and z; always of the same faces."""
    return _ball().copy().apply_scale(np.asarray(semi_axes, dtype=float))


@cache
def _ball() -> Trimesh:
    from trimesh import creation

    return creation.icosphere(subdivisions=3)


def arm_parts(arm: Arm) -> list[Part]:
    """A capsule from each joint to the next, a drum about each joint's axis; as thick as the arm is long.

    Lengths and axes are the arm's own, the thickness is made up.
    """
    q = np.zeros(arm.n)
    R, p = frame_poses(arm, q)
    steps = np.array([R[k].T @ (p[k + 1] - p[k]) for k in range(arm.n + 1)])  # to the next frame, in this frame's axes
    reach = float(np.linalg.norm(steps, axis=1).sum())
    radii = reach * np.linspace(_THICK, _THIN, arm.n + 1)
    rows = [slice(3, 6) if slides else slice(0, 3) for slides in arm.limits.slides]  # which part of a twist it moves by
    axes = [motion.jacobian[0, rows[k], k] for k, motion in enumerate(arm.link_motions(q[None]))]
    parts = [Part(0, "joint", drum((0.0, 0.0, 0.2 * radii[0]), (0.0, 0.0, 1.0), 1.6 * radii[0], 0.4 * radii[0]))]
    for k, step in enumerate(steps):
        if k:
            radius = 1.12 * radii[k - 1]
            parts.append(Part(k, "joint", drum(np.zeros(3), axes[k - 1], radius, 2.3 * radius)))
        if np.linalg.norm(step) > _SHORT:
            parts.append(Part(k, "link", capsule(np.zeros(3), step, float(radii[k]))))
    return parts


def frame_poses(arm: Arm, q: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotations (n + 2, 3, 3) and positions (n + 2, 3) [m] in the base: base, joints, payload frame."""
    R, p = arm.link_poses(q)
    R_end, p_end = arm.frame_pose(q)
    return np.concatenate([[np.eye(3)], R[0], R_end]), np.concatenate([np.zeros((1, 3)), p[0], p_end])


def equivalent_box(parameters: InertialParameters) -> Box:
    """The homogeneous box with these parameters; its lengths are the sides, √12 times the spread of mass.

    The second moments S = ½·tr(I)·1 − I about the centre of mass are m times the squared spread (3,); what is below
    zero, as no body's is, counts as zero.

    >>> from armload.payloads import solids
    >>> box = equivalent_box(solids.box((0.1, 0.2, 0.3), mass=2.0, translation=(0, 0, 0.15)))
    >>> box.lengths.round(6).tolist(), box.centre.tolist()
    ([0.1, 0.2, 0.3], [0.0, 0.0, 0.15])

    Raises:
        InertiaError: the mass is zero.
    """
    mass, com, inertia = phi_to_com(parameters.phi)
    squared, axes = np.linalg.eigh((0.5 * np.trace(inertia) * np.eye(3) - inertia) / mass)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Box(axes, com, np.sqrt(12.0 * np.maximum(squared, 0.0)))


def com_region(phi: NDArray[np.float64], covariance: NDArray[np.float64]) -> Box:
    """The ellipsoid that holds the centre of mass with 95 %; its lengths are the semi-axes.

    To first order r = h/m has the covariance G·C·Gᵀ, G = [−r, 1]/m, of C for (m, h).

    Args:
        phi: (10,), its mass not zero. covariance: (10, 10), finite.
    """
    r = phi[1:4] / phi[0]
    G = np.column_stack([-r, np.eye(3)]) / phi[0]
    spread, axes = np.linalg.eigh(G @ covariance[:4, :4] @ G.T)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Box(axes, r, np.sqrt(CHI2_95 * np.maximum(spread, 0.0)))


def has_com(estimate: OnlineEstimate) -> bool:
    """Whether something is held whose mass and centre of mass the samples determine."""
    return bool(
        estimate.held
        and estimate.phi[0] > 0.0
        and estimate.determined[:4].all()
        and np.isfinite(estimate.covariance[:4, :4]).all()
    )


def edges(lengths: ArrayLike) -> NDArray[np.float64]:
    """The twelve edges (12, 2, 3) of a box about the origin with these sides (3,) [m]."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1]
    return (corners * np.asarray(lengths, dtype=float))[np.array(pairs)]

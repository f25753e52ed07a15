"""The ten inertial parameters of a rigid body and their algebra.

    phi = [m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]      [kg, kg·m, kg·m²]

r is the centre of mass (CoM) and I the inertia, both about the **origin** and in the axes of one frame. This is the
order of Taie et al., RA-L 2024, Section III-A; it is the order used everywhere in armload.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import InertiaError
from armload.runtime.real_numbers import reals

# Names of the ten parameters, in the order of Taie et al. 2024.
NAMES = ("m", "m·rx", "m·ry", "m·rz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
# Units of the ten parameters, in the order of `NAMES`.
UNITS = ("kg", "kg·m", "kg·m", "kg·m", "kg·m²", "kg·m²", "kg·m²", "kg·m²", "kg·m²", "kg·m²")

_ROWS = np.array([0, 0, 0, 1, 1, 2])
_COLUMNS = np.array([0, 1, 2, 1, 2, 2])
_SIX = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # where each entry of the matrix is among the six


def numbers(values: ArrayLike, name: str, *shape: int) -> NDArray[np.float64]:
    """The values (..., *shape) as floats; `name` is what a sentence calls them.

    Raises:
        InertiaError: they are no numbers, or their last axes have another shape.
    """
    expected = f"expected {'×'.join(map(str, shape))} numbers"
    try:
        out = reals(values)
    except ValueError as error:
        raise InertiaError(f"{name} is not numeric: {expected}, found {error}") from None
    if out.shape[-len(shape) :] != shape:
        raise InertiaError(f"{name} has shape {out.shape}: {expected}")
    return out


def skew(v: ArrayLike) -> NDArray[np.float64]:
    """Matrix of the cross product, [v]× w = v × w; v has shape (..., 3), the result (..., 3, 3)."""
    v = numbers(v, "v", 3)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def vech(inertia: ArrayLike) -> NDArray[np.float64]:
    """The six numbers (xx, xy, xz, yy, yz, zz) of symmetric matrices (..., 3, 3)."""
    return numbers(inertia, "inertia", 3, 3)[..., _ROWS, _COLUMNS]


def inertia_matrix(six: ArrayLike) -> NDArray[np.float64]:
    """The symmetric matrices (..., 3, 3) of six numbers (..., 6) in the order xx, xy, xz, yy, yz, zz."""
    return numbers(six, "the inertia", 6)[..., _SIX]


def com_to_phi(mass: float, com: ArrayLike, inertia_com: ArrayLike) -> NDArray[np.float64]:
    """phi of a body given about its centre of mass: I = I_com + m·(|r|²·1 − r·rᵀ) (parallel-axis theorem).

    Args:
        mass: m [kg].
        com: r, shape (3,) [m].
        inertia_com: inertia about the CoM in the frame's axes, shape (3, 3) [kg·m²].

    Raises:
        InertiaError: a number is none, is not finite, or there are more or fewer; the inertia is not symmetric.
    """
    r, inertia = _vector3(com, "com"), _symmetric(inertia_com, "inertia_com")
    try:
        m = float(mass)
    except (TypeError, ValueError, OverflowError):
        m = np.nan
    if not np.isfinite(m):
        raise InertiaError(f"mass is {mass!r}: expected a finite number of kilograms")
    about_origin = inertia + m * (r @ r * np.eye(3) - np.outer(r, r))
    return np.concatenate([[m], m * r, vech(about_origin)])


def phi_to_com(phi: ArrayLike) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """(mass, com, inertia_com) of phi: the inverse of `com_to_phi`.

    Raises:
        InertiaError: the mass is zero, so that no centre of mass exists.
    """
    phi = _phi(phi)
    m = float(phi[0])
    if m == 0.0:
        raise InertiaError("mass is 0: a massless body has no centre of mass; use phi itself")
    r = phi[1:4] / m
    return m, r, inertia_matrix(phi[4:]) - m * (r @ r * np.eye(3) - np.outer(r, r))


def frame_change_matrix(rotation: ArrayLike, translation: ArrayLike) -> NDArray[np.float64]:
    """Linear map T (10, 10) with phi_a = T·phi_b, where frame b sits in frame a at (rotation, translation).

    A point x_b has coordinates x_a = R·x_b + p in frame a. First moments: m·r_a = R·m·r_b + m·p; second moments
    S = ∫ x·xᵀ dm (inertia I = tr(S)·1 − S): S_a = R·S_b·Rᵀ + (R·m·r_b)·pᵀ + p·(R·m·r_b)ᵀ + m·p·pᵀ.
    """
    R, p = numbers(rotation, "rotation", 3, 3), _vector3(translation, "translation")
    if R.shape != (3, 3) or not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0:
        raise InertiaError("rotation is not a proper 3×3 rotation matrix: expected R·Rᵀ = 1 and det R = +1")
    T = np.empty((10, 10))
    for k, e in enumerate(np.eye(10)):
        m, h, inertia = e[0], R @ e[1:4], inertia_matrix(e[4:])
        S = R @ (0.5 * np.trace(inertia) * np.eye(3) - inertia) @ R.T
        S = S + np.outer(h, p) + np.outer(p, h) + m * np.outer(p, p)
        T[:, k] = np.concatenate([[m], h + m * p, vech(np.trace(S) * np.eye(3) - S)])
    return T


@dataclass(frozen=True, eq=False)
class InertialParameters:
    """What a body weighs, where its centre of mass is and how it resists turning: phi, about one frame's origin.

    >>> hand = InertialParameters.from_com(0.73, (-0.01, 0.0, 0.03), np.diag([1e-3, 2.5e-3, 1.7e-3]))
    >>> round(hand.mass, 3), [round(float(x), 3) for x in hand.com]
    (0.73, [-0.01, 0.0, 0.03])
    >>> round(float((hand + hand).mass), 3)
    1.46

    Args:
        phi: the ten numbers, in the order of `NAMES`, about the origin and in the axes of `frame`.
        frame: the frame's name; parameters of two differently named frames cannot be added. None: not named.
    """

    phi: NDArray[np.float64]
    frame: str | None = None

    def __post_init__(self) -> None:
        phi = _phi(self.phi).copy()
        phi.setflags(write=False)
        object.__setattr__(self, "phi", phi)

    @classmethod
    def from_com(
        cls, mass: float, com: ArrayLike, inertia_com: ArrayLike, frame: str | None = None
    ) -> InertialParameters:
        """From mass [kg], CoM (3,) [m] and inertia about the CoM (3, 3) [kg·m²], in the frame's axes."""
        return cls(com_to_phi(mass, com, inertia_com), frame)

    @classmethod
    def zero(cls, frame: str | None = None) -> InertialParameters:
        """Nothing at all."""
        return cls(np.zeros(10), frame)

    @property
    def mass(self) -> float:
        """m [kg]."""
        return float(self.phi[0])

    @property
    def first_moment(self) -> NDArray[np.float64]:
        """m·r (3,) [kg·m]."""
        return self.phi[1:4]

    @property
    def inertia(self) -> NDArray[np.float64]:
        """Inertia (3, 3) about the frame's origin [kg·m²]."""
        return inertia_matrix(self.phi[4:])

    @property
    def com(self) -> NDArray[np.float64]:
        """Centre of mass r (3,) [m]; raises `InertiaError` for a mass of zero."""
        return phi_to_com(self.phi)[1]

    @property
    def inertia_com(self) -> NDArray[np.float64]:
        """Inertia (3, 3) about the CoM, in the frame's axes [kg·m²]; raises `InertiaError` for a mass of zero."""
        return phi_to_com(self.phi)[2]

    def moved(self, rotation: ArrayLike, translation: ArrayLike, frame: str | None = None) -> InertialParameters:
        """The same body seen from frame a, given the placement of the present frame b in a.

        Args:
            rotation: R_ab (3, 3), the axes of b in a.
            translation: p_ab (3,), the origin of b in a [m].
            frame: the name of a.
        """
        return InertialParameters(frame_change_matrix(rotation, translation) @ self.phi, frame)

    def __add__(self, other: InertialParameters) -> InertialParameters:
        if not isinstance(other, InertialParameters):
            return NotImplemented
        return InertialParameters(self.phi + other.phi, self._common_frame(other))

    def __sub__(self, other: InertialParameters) -> InertialParameters:
        if not isinstance(other, InertialParameters):
            return NotImplemented
        return InertialParameters(self.phi - other.phi, self._common_frame(other))

    def __neg__(self) -> InertialParameters:
        return InertialParameters(-self.phi, self.frame)

    def _common_frame(self, other: InertialParameters) -> str | None:
        if self.frame is not None and other.frame is not None and self.frame != other.frame:
            raise InertiaError(
                f"parameters about frame {self.frame!r} and about frame {other.frame!r} cannot be combined: "
                "move one of them first with .moved(rotation, translation)"
            )
        return self.frame or other.frame

    def __str__(self) -> str:
        where = f" about {self.frame}" if self.frame else ""
        rows = [f"{n:>5} = {v:+.6f} {u}" for n, v, u in zip(NAMES, self.phi, UNITS, strict=True)]
        return f"inertial parameters{where}:\n" + "\n".join(rows)


def parameters_only(given: InertialParameters) -> InertialParameters:
    """What was given, if it is what is meant.

    Raises:
        InertiaError: it is something else, such as a whole payload.
    """
    if not isinstance(given, InertialParameters):
        kind = type(given).__name__
        raise InertiaError(f"a {kind} was given: expected InertialParameters; of a Payload give its .parameters")
    return given


def _phi(values: ArrayLike | Sequence[float]) -> NDArray[np.float64]:
    try:
        phi = reals(values)
    except ValueError as error:
        raise InertiaError(f"phi is not numeric: expected 10 numbers, found {error}") from None
    if phi.shape != (10,):
        raise InertiaError(f"phi has shape {phi.shape}: expected 10 numbers ({', '.join(NAMES)})")
    if not np.all(np.isfinite(phi)):
        bad = NAMES[int(np.flatnonzero(~np.isfinite(phi))[0])]
        raise InertiaError(f"phi holds a number that is not finite at {bad}: expected 10 finite numbers")
    return phi


def _vector3(values: ArrayLike, name: str) -> NDArray[np.float64]:
    try:
        v = reals(values)
    except ValueError:
        v = np.full(3, np.nan)
    if v.shape != (3,) or not np.all(np.isfinite(v)):
        raise InertiaError(f"{name} is {values!r}: expected 3 finite numbers")
    return v


def _symmetric(values: ArrayLike, name: str) -> NDArray[np.float64]:
    matrix = numbers(values, name, 3, 3)
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        raise InertiaError(f"{name} has shape {matrix.shape}: expected a finite symmetric 3×3 matrix")
    if not np.allclose(matrix, matrix.T, rtol=1e-6, atol=1e-9):
        raise InertiaError(f"{name} is not symmetric: expected Ixy = Iyx, Ixz = Izx, Iyz = Izy")
    return 0.5 * (matrix + matrix.T)

"""Worlds: how the simulated arm differs from the model that identification uses.

The measured joint torque of a world is

    tau_J = rigid body(links) + friction(dq) + residual(q) + offset

Friction and residual are torques inside the joint: they disturb the arm's motion and show in the sensor. The offset is
the sensor's own.

The figures for the Panda are measured ones: two robots, published model, below 10 Hz. After links, offsets and friction
have been fitted, (.20 .29 .19 .20 .08 .05 .05) N·m rms remain, smooth in q and repeatable: a torque outside the
rigid-body span. The link figures (2 % of mass, 2 mm, 5 % of inertia) are our choice. Other arms scale with rated
torque.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.errors import ArmError
from armload.inertia import com_to_phi, nearest_consistent, phi_to_com
from armload.simulate.ratings import rated_effort

# one standard deviation of a link's mass [1], centre of mass [m] and inertia [1]
_LINK_MASS, _LINK_COM, _LINK_INERTIA = 0.02, 0.002, 0.05
_PANDA_OFFSET = (0.2, 0.3, 0.12, 0.25, 0.05, 0.08, 0.02)  # [N·m], 1 sigma
_PANDA_FRICTION = (0.25, 0.25, 0.2, 0.35, 0.35, 0.2, 0.26)  # [N·m]
_PANDA_RESIDUAL = (0.20, 0.28, 0.19, 0.20, 0.08, 0.05, 0.045)  # [N·m], rms
_OTHER_OFFSET, _OTHER_FRICTION, _OTHER_RESIDUAL = 0.003, 0.01, 0.0035  # of the rated torque
_FRICTION_WIDTH = 0.06  # [rad/s]
_FRICTION_SPREAD = 0.3
_LENGTH_SCALE = (0.7, 1.5)  # [rad]
_WAVES = 48


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
        a, b = rng.normal(size=(2, _WAVES, len(rms)))
        scale = rms / np.sqrt(0.5 * (a**2 + b**2).sum(axis=0))
        return cls(waves, a * scale, b * scale)

    def __call__(self, q: ArrayLike) -> NDArray[np.float64]:
        """f (N, n) at poses q (N, n)."""
        angle = np.atleast_2d(q) @ self.waves.T
        return np.cos(angle) @ self.cosine + np.sin(angle) @ self.sine


@dataclass(frozen=True, eq=False)
class World:
    """One arm as it really is.

    >>> from armload.arms import arm
    >>> World.real_like(arm("panda"), seed=3)
    World(name='real-like', seed=3)

    Args:
        name: "nominal", "real-like", or your own.
        seed: what it was drawn with.
        links: inertial parameters (n, 10) of the moving links about their joint frames, without what is attached.
        offset: torque sensor offset (n,) [N·m].
        friction_level, friction_width: friction = level·tanh(dq/width), (n,) [N·m] and [rad/s].
        residual: joint torque as a function of the pose; None: none.
    """

    name: str
    seed: int | None
    links: NDArray[np.float64] = field(repr=False)
    offset: NDArray[np.float64] = field(repr=False)
    friction_level: NDArray[np.float64] = field(repr=False)
    friction_width: NDArray[np.float64] = field(repr=False)
    residual: SmoothTorque | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        n = len(self.links)
        for name, shape in (("links", (n, 10)), ("offset", (n,)), ("friction_level", (n,)), ("friction_width", (n,))):
            value = np.array(getattr(self, name), dtype=float)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise ArmError(
                    f"{name} of the world {self.name!r} has shape {value.shape}: expected {shape}, all finite"
                )
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @classmethod
    def nominal(cls, arm: Arm) -> World:
        """The arm exactly as its model says: no friction, no offset, nothing unmodelled."""
        zero = np.zeros(arm.n)
        return cls("nominal", None, _bare_links(arm), zero, zero, np.ones(arm.n))

    @classmethod
    def real_like(cls, arm: Arm, seed: int) -> World:
        """An arm that differs from its model about as much as real ones were measured to."""
        rng = np.random.default_rng([seed, 1])
        if arm.name == "panda" and arm.n == 7:
            offset, friction, residual = (np.array(x) for x in (_PANDA_OFFSET, _PANDA_FRICTION, _PANDA_RESIDUAL))
        else:
            offset, friction, residual = (
                rated_effort(arm) * x for x in (_OTHER_OFFSET, _OTHER_FRICTION, _OTHER_RESIDUAL)
            )
        return cls(
            "real-like",
            seed,
            np.array([_perturbed(phi, rng) for phi in _bare_links(arm)]),
            offset * rng.normal(size=arm.n),
            friction * np.clip(1.0 + _FRICTION_SPREAD * rng.normal(size=arm.n), 0.1, None),
            np.full(arm.n, _FRICTION_WIDTH),
            SmoothTorque.drawn(residual, rng),
        )

    def arm(self, nominal: Arm) -> Arm:
        """The arm with this world's links, and what is attached to the nominal one.

        Raises:
            ArmError: the world was made for an arm with another number of joints.
        """
        if len(self.links) != nominal.n:
            raise ArmError(f"the world {self.name!r} has {len(self.links)} links: {nominal.name} has {nominal.n}")
        return nominal.with_links(self.links)

    @property
    def disturbed(self) -> bool:
        """Whether anything but rigid-body torque acts in the joints."""
        return self.residual is not None or bool(np.any(self.friction_level))

    def friction(self, dq: ArrayLike) -> NDArray[np.float64]:
        """level·tanh(dq/width) for velocities (N, n) [N·m]."""
        return self.friction_level * np.tanh(np.asarray(dq, dtype=float) / self.friction_width)

    def disturbance(self, q: ArrayLike, dq: ArrayLike) -> NDArray[np.float64]:
        """Friction and residual (N, n), what the joints must supply beyond rigid-body torque [N·m]."""
        friction = self.friction(dq)
        return friction if self.residual is None else friction + self.residual(q)

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all its numbers."""
        digest = hashlib.sha256()
        arrays = [self.links, self.offset, self.friction_level, self.friction_width]
        if self.residual is not None:
            arrays += [self.residual.waves, self.residual.cosine, self.residual.sine]
        for array in arrays:
            digest.update(np.round(array, 12).tobytes())
        return digest.hexdigest()


def _bare_links(arm: Arm) -> NDArray[np.float64]:
    return (arm if arm.attached is None else replace(arm, attached=None)).link_parameters


def _perturbed(phi: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A link somewhat off its model, still a body that can exist."""
    mass, com, inertia = phi_to_com(phi)
    root = np.sqrt(np.abs(np.diag(inertia)))
    noise = rng.normal(size=(3, 3))
    inertia = inertia + _LINK_INERTIA * np.outer(root, root) * (np.triu(noise) + np.triu(noise, 1).T)
    changed = com_to_phi(mass * (1 + _LINK_MASS * rng.normal()), com + _LINK_COM * rng.normal(size=3), inertia)
    return nearest_consistent(changed)

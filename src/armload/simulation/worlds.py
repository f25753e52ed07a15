"""Worlds: how the simulated arm differs from the model that identification uses.

The measured joint torque of a world is

    tau_J = gain·[rigid body(links) + rotor inertia·ddq + friction(dq, tau) + residual(q)] + offset + drift(t)

Friction and residual are torques inside the joint: they disturb the arm's motion and show in the sensor. Rotor inertia
is there only where the torque is measured on the motor's side of the gear; so is stiction, what a joint at rest holds
that its motor need not (`Stiction`), on arms that are known to measure there. Gain, offset and drift are the
sensor's own.

How large each part is and how it is drawn says `armload.simulation.model_error`. Worlds beyond the measured ones
(`World.beyond`) are to make a learner and its error bars ready for an arm that was never measured.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.errors import ArmError
from armload.runtime.real_numbers import own_reals
from armload.simulation.friction import Friction
from armload.simulation.model_error import (
    GAIN,
    LENGTHS,
    MOTOR_GAIN,
    any_friction,
    on_motor,
    perturbed,
    plain_friction,
    sizes,
)
from armload.simulation.residual import SmoothTorque
from armload.simulation.stiction import Stiction

_WARMING = (60.0, 1200.0)  # [s]
_HEAVIER = (1.0, 3.0)  # each mismatch over its reference, beyond the measured ones


@dataclass(frozen=True, eq=False)
class Drift:
    """A sensor's offset that follows a warming joint: size·(1 − exp(−t/time)), t since the first log began.

    size: (n,) [N·m]; time: [s].
    """

    size: NDArray[np.float64]
    time: float

    def __call__(self, t: ArrayLike) -> NDArray[np.float64]:
        """Drift (N, n) [N·m] at times t (N,) [s]."""
        return -np.multiply.outer(np.expm1(-np.asarray(t, dtype=float) / self.time), self.size)


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
        friction: joint torque as a function of velocity and transmitted torque.
        residual: joint torque as a function of the pose; None: none.
        gain: scale (n,) of the torque sensor; None: 1.
        drift: what the torque sensor's offset gains with time; None: nothing.
        rotor_inertia: (n,) seen through the gear [kg·m²]; None: the torque is measured behind the gear.
        stiction: (n,) the most that friction holds at rest [N·m], where that shows in the torque; None: it does not.
    """

    name: str
    seed: int | None
    links: NDArray[np.float64] = field(repr=False)
    offset: NDArray[np.float64] = field(repr=False)
    friction: Friction = field(repr=False)
    residual: SmoothTorque | None = field(default=None, repr=False)
    gain: NDArray[np.float64] | None = field(default=None, repr=False)
    drift: Drift | None = field(default=None, repr=False)
    rotor_inertia: NDArray[np.float64] | None = field(default=None, repr=False)
    stiction: NDArray[np.float64] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        n = len(self.links)
        for name, shape in (
            ("links", (n, 10)),
            ("offset", (n,)),
            ("gain", (n,)),
            ("rotor_inertia", (n,)),
            ("stiction", (n,)),
        ):
            if getattr(self, name) is None:
                continue
            value = own_reals(getattr(self, name), f"{name} of the world {self.name!r}", ArmError)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise ArmError(
                    f"{name} of the world {self.name!r} has shape {value.shape}: expected {shape}, all finite"
                )
            object.__setattr__(self, name, value)
        if len(self.friction.level) != n:
            raise ArmError(f"the friction of the world {self.name!r} is of {len(self.friction.level)} joints, not {n}")

    @classmethod
    def nominal(cls, arm: Arm) -> World:
        """The arm exactly as its model says: no friction, no offset, nothing unmodelled."""
        return cls("nominal", None, _bare_links(arm), np.zeros(arm.n), Friction.none(arm.n))

    @classmethod
    def real_like(cls, arm: Arm, seed: int) -> World:
        """An arm that differs from its model about as much as real ones were measured to.

        Where torque is known to be the motor's, friction, gain and rotor inertia are as in `beyond` on that side: it
        is viscous, gears lose 2–12 % of what they transmit, and stiction shows at rest.
        """
        rng = np.random.default_rng([seed, 1])
        offset, friction, residual = sizes(arm)
        links = _perturbed_links(arm, rng, np.full(3, arm.link_spread))
        offset = offset * rng.normal(size=arm.n)
        level, rotor = on_motor(arm, rng) if arm.motor_torque else (friction, None)
        friction = any_friction(level, rng, True) if arm.motor_torque else plain_friction(level, rng)
        return cls(
            "real-like",
            seed,
            links,
            offset,
            friction,
            SmoothTorque.drawn(residual, rng),
            1.0 + rng.uniform(-MOTOR_GAIN, MOTOR_GAIN, size=arm.n) if arm.motor_torque else None,
            rotor_inertia=rotor,
            stiction=friction.level if arm.motor_torque else None,
        )

    @classmethod
    def beyond(cls, arm: Arm, seed: int, motor_side: bool | None = None) -> World:
        """An arm unlike the measured ones: heavier mismatch, other friction, another residual, a gain error, drift.

        Each size is 1 to 3 times that of `real_like`, uniform in its logarithm. Friction may have another width, a
        Stribeck peak, two levels, a viscous part and one that grows with the torque; the residual has length scales of
        0.3–3 rad and may ripple with each joint's own angle. With torque measured on the motor's side, friction is
        5–15 % of the rated torque, the gain is off by up to 3 % and the rotors' inertia shows.

        Args:
            motor_side: where torque is measured; None: drawn, on the motor's side in a third of the worlds, and in all
                of them where that is known of the arm.
        """
        rng = np.random.default_rng([seed, 2])
        usual, level, residual = sizes(arm)
        heavier = np.exp(rng.uniform(*np.log(_HEAVIER), size=6))
        if motor_side is None:
            motor_side = arm.motor_torque or rng.random() < 1 / 3
        rotor = None
        if motor_side:
            level, rotor = on_motor(arm, rng)
        else:
            level = heavier[4] * level
        rippled = rng.random() < 0.5
        share = rng.uniform(0.2, 0.7) if rippled else 0.0
        smooth = SmoothTorque.of_length(np.sqrt(1 - share**2) * heavier[5] * residual, LENGTHS, rng)
        worst = MOTOR_GAIN if motor_side else GAIN
        warming = float(np.exp(rng.uniform(*np.log(_WARMING))))
        links = _perturbed_links(arm, rng, arm.link_spread * heavier[:3])
        offset = heavier[3] * usual * rng.normal(size=arm.n)
        friction = any_friction(level, rng, arm.motor_torque)
        return cls(
            "beyond, motor side" if motor_side else "beyond",
            seed,
            links,
            offset,
            friction,
            smooth + SmoothTorque.ripple(share * heavier[5] * residual, rng) if rippled else smooth,
            1.0 + rng.uniform(-worst, worst, size=arm.n),
            Drift(0.5 * usual * rng.normal(size=arm.n), warming) if rng.random() < 0.5 else None,
            rotor,
            friction.level if arm.motor_torque and motor_side else None,
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
        return self.residual is not None or not self.friction.zero

    def disturbance(self, q: ArrayLike, dq: ArrayLike, torque: ArrayLike | None = None) -> NDArray[np.float64]:
        """Friction and residual (N, n), what the joints must supply beyond rigid-body torque (N, n) [N·m]."""
        friction = self.friction(dq, torque)
        return friction if self.residual is None else friction + self.residual(q)

    def measured(self, torque: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
        """What the torque sensor shows of joint torques (N, n) at times t (N,) since the first log began [s]."""
        seen = torque if self.gain is None else self.gain * torque
        seen = seen + self.offset
        return seen if self.drift is None else seen + self.drift(t)

    def sticking(self, seed: int) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
        """What stiction adds to a log's torque (N, n) at its velocities (N, n), piece by piece; see `Stiction`."""
        if self.stiction is None:
            return np.zeros_like
        shown = self.stiction if self.gain is None else self.gain * self.stiction
        return Stiction(shown, self.friction.width, seed)

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all its numbers."""
        digest = hashlib.sha256()
        arrays = [self.links, self.offset, *self.friction.numbers]
        if self.residual is not None:
            arrays += [self.residual.waves, self.residual.cosine, self.residual.sine]
        for name, value in (
            ("gain", self.gain),
            ("rotor inertia", self.rotor_inertia),
            ("drift", self.drift),
            ("stiction", self.stiction),
        ):
            if value is not None:
                digest.update(name.encode())
                arrays += [np.append(value.size, value.time)] if isinstance(value, Drift) else [value]
        for array in arrays:
            digest.update(np.round(array, 12).tobytes())
        return digest.hexdigest()


def _bare_links(arm: Arm) -> NDArray[np.float64]:
    return (arm if arm.attached is None else replace(arm, attached=None)).link_parameters


def _perturbed_links(arm: Arm, rng: np.random.Generator, spread: NDArray[np.float64]) -> NDArray[np.float64]:
    links = _bare_links(arm)
    light = [joint for joint, phi in zip(arm.joint_names, links, strict=True) if phi[0] <= 0.0]
    if light:
        raise ArmError(
            f"the description of {arm.name} gives no mass to what {', '.join(light)} move{'s' * (len(light) == 1)}: "
            "expected a mass at every joint of an arm that is simulated; complete the description"
        )
    return np.array([perturbed(phi, rng, spread) for phi in links])

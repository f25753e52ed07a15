"""How far a simulated arm is off its model, part by part: the figures, and draws of links and friction.

An arm's sheet may hold measured figures (the Panda's: two robots, published model, below 10 Hz). What remains there
after links, offsets and friction have been fitted is smooth in q and repeatable: a torque outside the rigid-body span.
The link figures (2 % of mass, 2 mm, 5 % of inertia, times `Arm.link_spread`: a model identified on a robot is better
than a maker's drawing) are our choice. Arms without scale with rated torque. What is beyond the measured ones is our
choice altogether.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import FRICTION_WIDTH, LINK_SPREAD, Arm, facts_of, rated_effort
from armload.inertia import com_to_phi, nearest_consistent, phi_to_com
from armload.simulation.friction import Friction

_LINK_MOST = 10.0  # a spread of links beyond this many of `LINK_SPREAD` would leave no arm
_LIGHTEST_LINK = 0.2  # of the model's mass
_OFFSET, _FRICTION, _RESIDUAL = 0.003, 0.01, 0.0035  # of the rated torque, of an arm that was never measured
_FRICTION_SPREAD = 0.3

# beyond the measured ones
_WIDTHS = (0.02, 0.2)  # [rad/s]
LENGTHS = (0.3, 3.0)  # [rad] of the residual
_STRIBECK, _VISCOUS, _LOAD = 0.6, 0.5, 0.015  # at most: of the level, of the level per rad/s, of the torque
GAIN, MOTOR_GAIN = 0.01, 0.03  # torque scale, at most
_MOTOR_FRICTION = (0.05, 0.15)  # of the rated torque
# of the torque, from and to, that the gears of an arm lose whose motor currents are measured: 0.04 to 0.07 of a UR10e's
# joints 2 to 6, 0.03 to 0.05 of a UR10's joints 2 to 4 (`benchmarks/real_residuals.py`)
_MOTOR_LOAD = (0.02, 0.12)
# of the friction's level per rad/s, from and to, of the same arms: 1.1 of a UR10e, 0.9 of a UR10, whose levels are half
# as high as those drawn here (`benchmarks/real_residuals.py`)
_MOTOR_VISCOUS = (0.2, 1.2)
_ROTOR = (0.002, 0.02)  # [s²] rotor inertia over rated torque


def sizes(arm: Arm) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Offset, friction and residual (n,) of an arm like the measured ones [N·m]."""
    rated, facts = rated_effort(arm), facts_of(arm)

    def size(measured: tuple[float, ...] | None, share: float) -> NDArray[np.float64]:
        return rated * share if measured is None else np.array(measured)

    if facts is None:
        return rated * _OFFSET, rated * _FRICTION, rated * _RESIDUAL
    return size(facts.offset, _OFFSET), size(facts.friction, _FRICTION), size(facts.residual, _RESIDUAL)


def on_motor(arm: Arm, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Friction level (n,) [N·m] and rotor inertia (n,) [kg·m²] where torque is measured on the motor's side."""
    rated = rated_effort(arm)
    level = rated * np.exp(rng.uniform(*np.log(_MOTOR_FRICTION), size=arm.n))
    return level, rated * np.exp(rng.uniform(*np.log(_ROTOR), size=arm.n))


def _spread(level: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    return level * np.clip(1.0 + _FRICTION_SPREAD * rng.normal(size=len(level)), 0.1, None)


def plain_friction(level: NDArray[np.float64], rng: np.random.Generator) -> Friction:
    """tanh friction of the measured width, its level scattered about the given one."""
    return Friction(_spread(level, rng), np.full(len(level), FRICTION_WIDTH))


def any_friction(level: NDArray[np.float64], rng: np.random.Generator, motor: bool) -> Friction:
    """Friction of any width, with each other shape in half of the worlds.

    motor: of an arm that is known to measure motor current; its friction is viscous, and its gears lose a share of the
        torque, in every world.
    """
    n = len(level)
    level = _spread(level, rng)
    width = np.exp(rng.uniform(*np.log(_WIDTHS), size=n))
    has = rng.random(4) < 0.5
    viscous, load = (_MOTOR_VISCOUS, _MOTOR_LOAD) if motor else ((0.0, _VISCOUS), (0.0, _LOAD))
    return Friction(
        level,
        width,
        has[0] * np.clip(0.2 * rng.normal(size=n), -0.5, 0.5),
        has[1] * level * rng.uniform(0.0, _STRIBECK, size=n),
        width + rng.uniform(0.03, 0.2, size=n),
        (motor or has[2]) * level * rng.uniform(*viscous, size=n),
        (motor or has[3]) * rng.uniform(*load, size=n),
    )


def perturbed(phi: NDArray[np.float64], rng: np.random.Generator, spread: NDArray[np.float64]) -> NDArray[np.float64]:
    """A link somewhat off its model, still a body that can exist; spread: of mass, centre and inertia."""
    mass, com, inertia = phi_to_com(phi)
    off_mass, off_com, off_inertia = np.minimum(spread, _LINK_MOST) * LINK_SPREAD
    root = np.sqrt(np.abs(np.diag(inertia)))
    noise = rng.normal(size=(3, 3))
    inertia = inertia + off_inertia * np.outer(root, root) * (np.triu(noise) + np.triu(noise, 1).T)
    off = mass * max(1 + off_mass * rng.normal(), _LIGHTEST_LINK)
    changed = com_to_phi(off, com + off_com * rng.normal(size=3), inertia)
    return nearest_consistent(changed)

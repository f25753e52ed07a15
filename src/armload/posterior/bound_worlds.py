"""The scales of simulated arms: what the bound needs to be one for them, and not for arms as an estimator expects them.

An estimator expects more noise than a simulated sensor has, because real ones have quirks; its errors on simulated arms
then lie below the bound of the model it expects. Whoever wants efficiency on a table of simulated arms takes these.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armload.arms import FRICTION_WIDTH, Arm, rated_effort
from armload.errors import IdentificationError
from armload.posterior.scales import Scales
from armload.regression import Correction, JointFeatures
from armload.regression.mismatch import TILTS
from armload.simulation import Sensors, World

_SPEEDS = np.concatenate([-np.geomspace(1.5, 0.01, 60), np.geomspace(0.01, 1.5, 60)])  # [rad/s]
_NUMERICAL = 1e-4  # [N·m] of white noise at least: sensors without any still compute


def scales_of(
    arm: Arm, worlds: Sequence[World], sensors: Sensors, rate: float, features: JointFeatures | None = None
) -> Scales:
    """The variances of a population of simulated arms, for `bound(…, scales=…)`, with a tare or without.

    Offsets and links are taken about the nominal arm. Friction is taken about its mean over the worlds, as if that were
    known: the bound may only be too low. Of the sensors only white torque noise and quantisation count; the rest
    (vibration above the lag's band, skew, jitter, noise of the velocity) can only make errors larger.

    Args:
        arm: nominal.
        worlds: drawn from the population, some dozens.
        sensors, rate: what sees them, how often [Hz].
        features: of the smooth part, the same as for `bound`; with few, a drawn residual is known better than it can
            be: 512 of the pose come close (128: a fifth too low).

    Raises:
        IdentificationError: fewer than two worlds, or of another arm.
    """
    if len(worlds) < 2 or any(len(world.links) != arm.n for world in worlds):
        raise IdentificationError(
            f"{len(worlds)} worlds, of {sorted({len(w.links) for w in worlds})} joints: expected two or more of "
            f"{arm.name}, which has {arm.n}"
        )
    features = features or JointFeatures(arm.n)
    friction = np.array([_friction(world) for world in worlds])  # (worlds, 3, n)
    nominal, loses = World.nominal(arm).links, Correction(arm, rated_effort(arm)).loss_std > 0.0
    square = [
        np.mean([world.offset**2 for world in worlds], axis=0),
        *friction[:, :2].var(axis=0),
        np.mean([np.zeros(arm.n) if w.rotor_inertia is None else w.rotor_inertia**2 for w in worlds], axis=0),
        *([np.var(np.array([world.friction.load for world in worlds]), axis=0)] if loses else []),
        np.zeros(TILTS),
        np.mean([(world.links - nominal) ** 2 for world in worlds], axis=0).ravel(),
    ]
    eta = np.concatenate(square)  # in the order of `Correction`
    pose = np.mean([_mean_square(world) for world in worlds], axis=0)
    shape = friction[:, 2].mean(axis=0)
    own = np.concatenate([np.tile(pose[:, None], features.pose), np.tile(shape[:, None], features.velocity)], axis=1)
    return Scales(np.tile(_white(sensors, arm.n) / rate, (2, 1)), eta, own, np.zeros(20))


def _friction(world: World) -> NDArray[np.float64]:
    """Coulomb and viscous friction of the correction's kind, and the mean square of what they leave (3, n)."""
    X = np.stack([np.tanh(_SPEEDS / FRICTION_WIDTH), _SPEEDS], axis=1)
    torque = world.friction(np.tile(_SPEEDS[:, None], len(world.offset)), None)
    fit, *_ = np.linalg.lstsq(X, torque, rcond=None)
    return np.vstack([fit, np.mean((torque - X @ fit) ** 2, axis=0)]).astype(np.float64)


def _mean_square(world: World) -> NDArray[np.float64]:
    """Of the residual over all poses (n,) [N²·m²]."""
    if world.residual is None:
        return np.zeros(len(world.offset))
    return 0.5 * (world.residual.cosine**2 + world.residual.sine**2).sum(axis=0)


def _white(sensors: Sensors, n: int) -> NDArray[np.float64]:
    """Variance of the torque's white noise and rounding (n,) [N²·m²]."""
    noise = np.zeros(n) if sensors.torque_noise is None else np.asarray(sensors.torque_noise)
    quantum = np.zeros(n) if sensors.torque_quantum is None else np.asarray(sensors.torque_quantum)
    return np.broadcast_to(noise**2 + quantum**2 / 12.0 + _NUMERICAL**2, n)

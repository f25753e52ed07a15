"""Checks before a load is written to a robot: with a wrong one the arm sinks, rises or throws what it holds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from armload.arms import ARMS, Arm, prefixed_frame
from armload.devices.load import Load
from armload.errors import SinkError
from armload.identification import Identification
from armload.inertia import NAMES, InertialParameters

STANDSTILL = 0.01  # [rad/s] a joint that is faster moves
_STILL = 0.1  # [s] for which an arm must have stood: one that turns round is slow for an instant, too
_LOOK = 0.01  # [s] between two looks meanwhile


def is_moving(dq: ArrayLike) -> bool:
    """Whether any joint is faster than 0.01 rad/s; velocities that are not known count as moving.

    Args:
        dq: measured joint velocities (n,) [rad/s].
    """
    speeds = np.abs(np.asarray(dq, dtype=float))
    return not (speeds.size and np.all(speeds <= STANDSTILL))


def stands_still(velocity: Callable[[], ArrayLike]) -> bool:
    """Whether no joint moves for a tenth of a second, which is waited for.

    Args:
        velocity: measures the joint velocities (n,) [rad/s].
    """
    until = time.monotonic() + _STILL
    while not is_moving(velocity()):
        if time.monotonic() >= until:
            return True
        time.sleep(_LOOK)
    return False


def flange_of(arm: Arm) -> str:
    """The frame a built-in arm's controller calls the flange.

    Raises:
        SinkError: the arm is not a built-in one.
    """
    flange = None if arm.known_as is None else prefixed_frame(arm, ARMS[arm.known_as].flange)
    if flange is None:
        raise SinkError(f"the flange of {arm.name} is not known: name its frame with flange=…")
    return flange


def check_writable(
    result: Load | Identification,
    arm: Arm,
    *,
    moving: bool,
    end_effector: float = 0.0,
    write: bool = False,
    flange: str | None = None,
    allow_undetermined_inertia: bool = False,
    allow_nothing: bool = False,
) -> InertialParameters:
    """The parameters to write, about the flange, if they may be written at all.

    Args:
        result: what was identified.
        arm: the arm it is written to; its rated payload is the limit.
        moving: whether the robot moves at this moment, from `is_moving`.
        end_effector: mass the controller counts on the flange beside the load [kg]; 0: the load is all it knows of.
        write: must be True: writing is asked for, never a side effect.
        flange: the frame the controller counts from; default: the built-in arm's.
        allow_undetermined_inertia: write the reported inertia though the log did not determine all of it.
        allow_nothing: write a load of zero, which says that nothing is held.

    Raises:
        SinkError: writing was not asked for, the robot moves, the load is another arm's, it is no body, its mass or
            first moments (or inertia) are undetermined, it contains what the controller counts already or lacks what
            nobody counts, or it is heavier than the arm is rated for.
    """
    load = Load.of(result)
    if write is not True:
        raise SinkError("writing to the robot was not asked for: pass write=True if it is meant")
    if moving:
        raise SinkError(f"the robot moves: a load is written at standstill only, all joints below {STANDSTILL} rad/s")
    if load.robot is not None and load.robot != arm.name:
        raise SinkError(f"the load was identified on {load.robot!r}: it is not written to {arm.name!r}")
    known = load.determined
    if not all(known[:4]):
        names = ", ".join(n for n, k in zip(NAMES[:4], known[:4], strict=True) if not k)
        raise SinkError(f"{names} of the load is undetermined: identify on a motion that determines it, then write")
    if not all(known[4:]) and not allow_undetermined_inertia:
        raise SinkError(
            f"{', '.join(load.undetermined)} of the load is undetermined: identify on a faster motion of the wrist, or "
            "pass allow_undetermined_inertia=True to write what was known beforehand"
        )
    mass = load.parameters.mass
    nothing = allow_nothing and not load.parameters.phi.any()
    if mass <= 0 and not nothing:
        raise SinkError(f"the load has a mass of {mass:.4g} kg: expected a mass above 0")
    consistent = load.consistent and (not isinstance(result, Identification) or result.consistent)
    if not consistent and not nothing:
        raise SinkError("the load is inconsistent: no body can have these parameters; identify again before writing it")
    _check_counted_once(load, end_effector)
    if arm.rated_payload is None:
        raise SinkError(f"what {arm.name} is rated for is not known: give it as Arm(…, rated_payload=…) in kilograms")
    if mass + end_effector > arm.rated_payload:
        also, together = (f" and the end effector {end_effector:.3f} kg", " together") if end_effector else ("", "")
        raise SinkError(
            f"the load weighs {mass:.3f} kg{also}: {arm.name} is rated for {arm.rated_payload:g} kg{together}"
        )
    flange = flange or flange_of(arm)
    return replace(arm, frame=flange, attached=None).in_frame(load.parameters)


_SINCE = {"tare": "the tare", "profile": "the profile", "before": "its last change"}


def _check_counted_once(load: Load, end_effector: float) -> None:
    """Refuse a load that contains what the controller counts already, or lacks what it does not count."""
    if not (np.isfinite(end_effector) and end_effector >= 0):
        raise SinkError(f"the robot counts an end effector of {end_effector} kg: expected a mass, 0 for none")
    if end_effector > 0 and load.relative_to == "arm":
        raise SinkError(
            f"the robot counts an end effector of {end_effector:.3g} kg already, and the load, relative to the bare "
            "arm, contains it: take it off (Load.of(result) - hand), or identify with it as the tool"
        )
    if end_effector == 0 and load.relative_to == "tool":
        raise SinkError(
            "the load is relative to a tool, and the robot counts nothing on the flange but the load: add the tool "
            "(Load.of(result) + tool)"
        )
    if end_effector == 0 and load.relative_to in ("tare", "profile", "before"):
        raise SinkError(
            f"the load is what was added since {_SINCE[load.relative_to]}, and "
            "the robot counts nothing on the flange but the load: add what was mounted then (Load.of(result) + "
            "gripper; InertialParameters.zero() if nothing was)"
        )

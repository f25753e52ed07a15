"""What is said of the arm itself and of its base: another model, another arm, one that leans, a sign that is turned."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armload.arms import Arm
from armload.arms.units import unit_of
from armload.identification.thresholds import NOMINAL
from armload.inertia import Z95
from armload.posterior.scales import AnotherArm, Drift, Tilt
from armload.posterior.tilt import MAY_LEAN


def another_model(name: str, links: float) -> str:
    """That the links seem to be those of another model."""
    return (
        f"the links differ from those of {name} more than an arm's do from its description (T = {links:.0f}): was the "
        "log made by this arm? If so, record a tare"
    )


def held_against(profile: bool, tare: bool) -> str:
    """What an arm is held against, as `arm_changed` asks for it, where there is a profile, and a tare, or not."""
    if not profile:
        return "tare"
    return "both" if tare else "profile"


def arm_changed(arm: Arm, drift: Drift | None, another: AnotherArm | None, what: str = "tare") -> str | None:
    """That the arm is not as it was at its tare, or as its profile says, how it differs, and what to do; None: it is.

    Args:
        drift, another: what the two tests of it found; None: they were not made.
        what: "profile", "both" (a profile, which log and tare, of one session, are held against) or "tare".
    """
    as_it_is = "learn a profile of this arm" if what == "profile" else "record a tare of this arm as it is now"
    then = "the arm is not as its profile says" if what == "profile" else "the arm is not as it was at its tare"
    if what == "both":
        then = "in this log and at its tare the arm is not as its profile says"
        as_it_is = "leave the profile out, or learn one of this arm as it is now"
    if another is not None and another.found:
        rest = "do without" if another.left_out else "still rest on"
        is_another = "it is another one, or was repaired" if another.sure else "it may be another one, or was repaired"
        return (
            f"{then}: {is_another}, as its links, gears or torque sensors differ; the intervals "
            f"{rest} what was known of it; {as_it_is}"
        )
    if drift is None or not drift.changed:
        return None
    j, allow = drift.joint, "allow for it, but not for another arm's links" if drift.allowed else "do not allow for it"
    unit = unit_of("torque", arm.limits.slides[j])
    offset, friction = (
        f"{x:+.2g} {unit}" if abs(x) >= 5e-4 else "nothing" for x in (drift.offset[j], drift.coulomb[j])
    )
    if what != "both":  # a profile is of many days: what has changed within one is measured sooner
        as_it_is = "record a tare of this arm as it is now, with the same base and tool"
    return (
        f"{then}: at joint {j + 1} the torque's offset differs by {offset}, the friction by "
        f"{friction}; the intervals {allow}; {as_it_is}"
    )


def gravity_turned(given: ArrayLike, found: ArrayLike, answered: bool) -> str:
    """That the base leans, by how much, and what to say of it.

    Args:
        given, found: gravity (3,) [m/s²]. answered: whether the answer is of the one that was found.
    """
    given, found = np.asarray(given), np.asarray(found)
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(given, found)), given @ found))
    option = ",".join(f"{x:.2f}" for x in found)
    return (
        f"the base leans by {angle:.1f}° against the gravity that was given: "
        + ("this is the answer for" if answered else "answer anew with")
        + f" --gravity={option}, as the torques show it; level the base, or give its gravity"
        + ("; joints in another order look so, too" if angle > 10.0 else "")
    )


def gravity_doubted(arm: Arm, tilt: Tilt | None, torque: str) -> str | None:
    """That the base may lean, which the log does not tell for sure; None: there is no reason to think so.

    Args:
        tilt: what the test of gravity found; None: it was not made. torque: "link" or "motor", the side it seems to be
            measured on. Errors of nominal links, and friction of gears, look like a base that leans a little.
    """
    link_sensors = torque == "link" and arm.link_spread < NOMINAL
    if tilt is None or tilt.found or not link_sensors or tilt.statistic <= MAY_LEAN:
        return None
    angle = np.degrees(np.linalg.norm(tilt.angles))
    return (
        f"the base may lean, by about {angle:.1f}° against the gravity that was given, which the answer believes: "
        "check that it is level, give its gravity (--gravity), or record a tare of more poses"
    )


def leaning(arm: Arm, tilt: Tilt | None, torque: str) -> str | None:
    """That the base leans, or may; None: there is no reason to think so. Args: as of `gravity_doubted`."""
    if tilt is not None and tilt.found:
        return gravity_turned(arm.gravity, arm.leaning(tilt.angles).gravity, False)
    return gravity_doubted(arm, tilt, torque)


def carries_more(arm: Arm) -> list[str]:
    """That joints of the arm carry others than its own, as a torso does: what these move looks like a fault of its own.

    Joints behind the last one, such as fingers, are not meant.
    """
    others = [(name, carriers) for name, carriers in arm.held if 0 < carriers < arm.n]
    if not others:
        return []
    which = others[0][0] if len(others) == 1 else f"{others[0][0]} … {others[-1][0]}"
    bearing = arm.joint_names[: max(carriers for _, carriers in others)]
    return [
        f"{', '.join(bearing)} also bear{'s' * (len(bearing) == 1)} what {which} move{'s' * (len(others) == 1)}, which "
        "counts as standing at zero: hold it still, in the log and as in its tare, before you believe what is doubted"
    ]


def driven_by_friction(joints: tuple[int, ...]) -> str:
    """That friction drives joints, from 1, where it must brake them: a sign is turned."""
    several = len(joints) > 1
    which = ", ".join(str(j) for j in joints)
    return (
        f"friction drives joint{'s' if several else ''} {which} where it must brake {'them' if several else 'it'}: the "
        f"sign of {'their' if several else 'its'} torque is turned, or that of position and velocity; turn it back in "
        "the log and in its tare"
    )


def scaled_torques(arm: str, scale: float, std: float) -> str:
    """That a log's torques are another multiple of what the arm's own links need."""
    return (
        f"the torques are {scale:.2f} ± {Z95 * std:.2f} times what the links of {arm} need, and what is held seems too "
        "heavy or too light by as much: check that tau is in N·m, in the tare, too, and that this arm made the log"
    )

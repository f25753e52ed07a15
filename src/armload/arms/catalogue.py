"""The arms armload knows by name, and any other from a URDF file.

| name  | what                                            | payload frame | source of the figures                     |
|-------|-------------------------------------------------|---------------|-------------------------------------------|
| panda | Franka Emika Panda (FER), bare to the flange    | `panda_link8` | Franka's documentation; Gaz et al. 2019   |
| fr3   | Franka Research 3, first version (not v2), bare | `fr3_link8`   | libfranka's test URDF; franka_description |
| ur5e  | Universal Robots UR5e, bare to the tool flange  | `tool0`       | Universal Robots' published figures       |
| ur10e | Universal Robots UR10e, bare to the tool flange | `tool0`       | Universal Robots' published figures       |

Each description says more in its head. A Panda with its hand is `arm("panda").with_payload(franka_hand())`.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from armload.arms.kinship import kinship, namesake
from armload.arms.model import STANDARD_GRAVITY, Arm
from armload.errors import ArmError
from armload.inertia import is_consistent

_LIGHTEST = 1e-3  # [kg] of a tool; what is less is another link

ARMS: dict[str, dict[str, Any]] = {
    "panda": {
        "frame": "panda_link8",
        "rated_payload": 3.0,  # [kg]
        "link_spread": 1.0,  # identified on the robot, not the maker's drawing
        # Franka Control Interface documentation, "Limits for Panda"
        "acceleration": (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),  # [rad/s²]
        "jerk": (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),  # [rad/s³]
    },
    "fr3": {
        "frame": "fr3_link8",
        "rated_payload": 3.0,  # [kg]
        "link_spread": 3.0,  # the maker's own model for control, not checked against a robot here
        # libfranka, rate_limiting.h for the FR3
        "acceleration": (10.0,) * 7,  # [rad/s²]
        "jerk": (5000.0,) * 7,  # [rad/s³]
    },
    # no torque sensors in the joints: motor currents times a constant
    "ur5e": {"frame": "tool0", "rated_payload": 5.0, "motor_torque": True},
    "ur10e": {"frame": "tool0", "rated_payload": 12.5, "motor_torque": True},
}


def arm(robot: str | Path, frame: str | None = None, gravity: tuple[float, float, float] = STANDARD_GRAVITY) -> Arm:
    """An arm by name, or from a URDF file.

    >>> arm("ur10e").joint_names[2]
    'elbow_joint'

    Args:
        robot: a name in `ARMS`, or the path of a URDF file. A file with the links of an arm in `ARMS` is that arm:
            what is known of it and no URDF says (rated payload, where torque is measured) holds, and a tool in the file
            is attached to it.
        frame: link whose frame the payload is about. Default: the catalogue's; for a URDF its last link.
        gravity: gravity in the axes of the base [m/s²].

    Raises:
        ArmError: neither a known name nor a readable URDF file, or an unknown frame.
    """
    name = str(robot)
    if name in ARMS:
        facts = dict(ARMS[name])
        if frame is not None:
            facts["frame"] = frame
        text = resources.files("armload.arms").joinpath(f"descriptions/{name}.urdf").read_text(encoding="utf-8")
        return Arm(name, text, gravity=gravity, known_as=name, **facts)
    path = Path(robot)
    if not path.is_file():
        raise ArmError(
            f"unknown robot {name!r}: expected one of {', '.join(ARMS)}, or the path of a URDF file that exists"
        )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ArmError(f"robot description {name} cannot be read as text: {error}") from None
    found = _as_known(Arm(path.stem, text, frame, gravity))
    if path.stem in ARMS and found.known_as != path.stem:
        return replace(found, name=path.name)  # called like an arm of the catalogue, and not that arm
    return found


def _as_known(found: Arm) -> Arm:
    """The arm with the catalogue's facts, if it is one of the catalogue's; a tool in its file is then attached."""
    for name, facts in ARMS.items():
        flange = namesake(found, str(facts["frame"]))
        known = None if flange is None else arm(name)
        if known is None or known.n != found.n:
            continue
        named, bare, what = found, replace(found, frame=flange), kinship(known)
        if kinship(bare) != what:
            links = np.array([*bare.link_parameters[:-1], known.link_parameters[-1]])
            named = found.parted(links)
            tool = named.attached
            if tool is None or tool.mass < _LIGHTEST or not is_consistent(tool.phi):
                continue
            if kinship(bare.with_links(links)) != what:
                continue
        return replace(named, known_as=name, **{fact: x for fact, x in facts.items() if fact != "frame"})
    return found

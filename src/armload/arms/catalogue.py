"""The arms armload knows by name, and any other from a URDF file.

Each has a sheet of facts and a description (`facts.py`), bare to its flange. A Panda with its hand is
`arm("panda").with_payload(franka_hand())`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from armload.arms.facts import ARMS, description_of
from armload.arms.matching import link_fingerprint, prefixed_frame
from armload.arms.model import STANDARD_GRAVITY, Arm
from armload.errors import ArmError
from armload.inertia import is_consistent

_LIGHTEST = 1e-3  # [kg] of a tool; what is less is another link


def arm(robot: str | Path, frame: str | None = None, gravity: tuple[float, float, float] = STANDARD_GRAVITY) -> Arm:
    """An arm by name, or from a URDF file.

    >>> arm("ur10e").joint_names[2]
    'elbow_joint'

    Args:
        robot: a name in `ARMS`, or the path of a URDF file. A file with the links of an arm in `ARMS` is that arm:
            what is known of it and no URDF says (rated payload, where torque is measured) holds, and a tool in the file
            is attached to it.
        frame: link whose frame the payload is about. Default: the arm's flange; for a URDF its last link.
        gravity: gravity in the axes of the base [m/s²].

    Raises:
        ArmError: neither a known name nor a readable URDF file, or an unknown frame.
    """
    name = str(robot)
    if name in ARMS:
        facts = ARMS[name]
        return Arm(name, description_of(name), facts.flange if frame is None else frame, gravity, **facts.of_arm)
    path = Path(robot)
    if not path.is_file():
        if path.is_dir():
            raise ArmError(f"robot description {name} is a folder: expected the path of a URDF file")
        if path.suffix or len(path.parts) > 1:
            raise ArmError(f"robot description {name} is not there: expected the path of a URDF file that exists")
        plain = "".join(letter for letter in name.lower() if letter.isalnum())
        raise ArmError(
            f"unknown robot {name!r}: expected one of {', '.join(ARMS)}, or the path of a URDF file that exists, with "
            "masses and inertias of its links, as its maker or its ROS package gives it"
            + (f"; did you mean {plain!r}?" if plain in ARMS else "")
        )
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ArmError(f"robot description {name} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ArmError(f"robot description {name} cannot be read as text: {error}") from None
    try:
        found = _as_known(Arm(path.stem, text, frame, gravity))
    except ArmError as error:
        raise ArmError(f"{name}: {error}") from None
    if path.stem in ARMS and found.known_as != path.stem:
        return replace(found, name=path.name)  # called like an arm of the catalogue, and not that arm
    return found


def _as_known(found: Arm) -> Arm:
    """The arm with its sheet's facts, if it is one of `ARMS`; a tool in its file is then attached."""
    for name, facts in ARMS.items():
        flange = prefixed_frame(found, facts.flange)
        if flange is None or facts.joints != found.n:
            continue
        known = arm(name)
        named, bare, wanted = found, replace(found, frame=flange), link_fingerprint(known)
        if link_fingerprint(bare) != wanted:
            links = np.array([*bare.link_parameters[:-1], known.link_parameters[-1]])
            named = found.parted(links)
            tool = named.attached
            if tool is None or tool.mass < _LIGHTEST or not is_consistent(tool.phi):
                continue
            if link_fingerprint(bare.with_links(links)) != wanted:
                continue
        return replace(named, **facts.of_arm)
    return found

"""About which frame `armload export` writes: a controller counts from its flange, whatever is mounted behind that."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.devices import Load
    from armload.errors import SinkError


def frame_for(load: Load, to: str, arm: Arm | None) -> str | None:
    """The frame that a form wants where none is asked for: a controller's flange; None: as it is.

    Raises:
        SinkError: the arm's description has no flange that can be told by its name.
    """
    from armload.devices import CONTROLLERS

    if arm is None:
        return None
    if to not in CONTROLLERS:
        return arm.frame if load.frame is None else None
    if load.frame is not None and load.frame not in arm.frames and _is_flange(load.frame):
        return None  # a flange that the arm knows by another name
    flange = _flange(arm, to, load.frame)
    if flange is None:
        raise no_flange(load, arm)
    return flange


def _flange(arm: Arm, to: str, beside: str | None) -> str | None:
    """What an arm calls the flange that a form is about: its maker's, else another's, which a note then says."""
    from armload.arms import ARMS, flange_named
    from armload.devices import FORMS as FORMS_OF

    own = {facts.flange: facts for facts in ARMS.values() if facts.controller == FORMS_OF[to].maker}
    others = {facts.flange: facts for facts in ARMS.values()}
    found = (flange_named(arm, each.values(), beside) for each in (own, others))
    return next((flange for flange in found if flange is not None), None)


def on_flange(frame: str, to: str, arm: Arm | None) -> bool:
    """Whether a frame is the flange of a controller's arm, or called as one where the arm does not tell."""
    flange = None if arm is None or frame not in arm.frames else _flange(arm, to, frame)
    return _is_flange(frame) if flange is None else frame == flange


def no_flange(load: Load, arm: Arm | None) -> SinkError:
    """Why nothing is written of a load whose place on the controller's flange is not known, and what to name."""
    from armload.arms import ARMS
    from armload.errors import SinkError

    flanges = ", ".join(sorted({facts.flange for facts in ARMS.values()}))
    about = "names no frame" if load.frame is None else f"is about {load.frame!r}"
    if arm is None:
        return SinkError(
            f"the payload {about} and a controller counts from its flange ({flanges}): "
            "name the arm and its flange with --robot FILE.urdf --frame FLANGE"
        )
    return SinkError(
        f"the payload {about}, a controller counts from its flange ({flanges}), and {arm.name} does not have one link "
        f"that is called so: name its flange with --frame, one of {', '.join(arm.frames)}"
    )


def _is_flange(frame: str) -> bool:
    """Whether a frame is called as a built-in arm's flange, with whatever prefix."""
    from armload.arms import ARMS

    return frame.endswith(tuple(facts.flange_ending for facts in ARMS.values()))

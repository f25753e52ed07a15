"""Every form a load can be written in, by name: what `armload export --to` takes."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from armload.devices.files.form import mjcf_text, sdf_text, urdf_text
from armload.devices.franka.form import desk_text, set_load_text
from armload.devices.kinova.form import tool_configuration_text
from armload.devices.kuka.form import sunrise_text
from armload.devices.load import Load
from armload.devices.ros2.form import inertia_stamped_text
from armload.devices.ur.form import set_payload_text, set_target_payload_text
from armload.devices.xarm.form import set_tcp_load_text
from armload.errors import SinkError
from armload.runtime.atomic import replacing

_NO_TEXT = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # XML 1.0, 2.2


class Form(NamedTuple):
    """One form a load can be written in.

    what: it is, in a few words. text: of a load in it, given the load and the name of its link. inertia: whether it
    holds one. maker: of the controller that reads it, as the sheets of arms name it (`ArmFacts.controller`), which
    counts from its flange; None: a description, about any frame. counts_all: what that controller calls the number,
    where that is everything on the flange, whatever was mounted when.
    """

    what: str
    text: Callable[[Load, str], str]
    inertia: bool = True
    maker: str | None = None
    counts_all: str | None = None

    def held_of(self, load: Load) -> Load:
        """What the form holds of a load: nothing is said of what it does not."""
        return load if self.inertia else load.without_inertia()


# What `export_load` can write, by name.
FORMS = {
    "franka": Form(
        "Python for libfranka's setLoad, on top of Desk's end effector", lambda a, _: set_load_text(a), maker="franka"
    ),
    "franka-desk": Form("end effector for Franka's Desk (JSON)", lambda a, _: desk_text(a), maker="franka"),
    "ur": Form(
        "URScript set_target_payload, everything on the flange",
        lambda a, _: set_target_payload_text(a),
        maker="ur",
        counts_all="a UR's payload",
    ),
    "ur-payload": Form(
        "URScript set_payload (before 5.10), no inertia",
        lambda a, _: set_payload_text(a),
        inertia=False,
        maker="ur",
        counts_all="a UR's payload",
    ),
    "kuka": Form("Java and object template for KUKA Sunrise", lambda a, _: sunrise_text(a), maker="kuka"),
    "kinova": Form(
        "Python for Kinova's Kortex, no inertia",
        lambda a, _: tool_configuration_text(a),
        inertia=False,
        maker="kinova",
        counts_all="Kinova's tool",
    ),
    "xarm": Form(
        "Python for UFACTORY's set_tcp_load, no inertia",
        lambda a, _: set_tcp_load_text(a),
        inertia=False,
        maker="xarm",
        counts_all="an xArm's load",
    ),
    "urdf": Form("URDF: a link and a fixed joint to the frame", urdf_text),
    "mjcf": Form("MuJoCo: a body", mjcf_text),
    "sdf": Form("SDF: a model with one link", sdf_text),
    "ros2": Form("ROS 2 geometry_msgs/msg/InertiaStamped (YAML)", lambda a, _: inertia_stamped_text(a)),
}
# Those that a controller reads: about its flange.
CONTROLLERS = tuple(name for name, form in FORMS.items() if form.maker is not None)


def export_load(load: Load, to: str, path: str | Path | None = None, name: str = "payload") -> str:
    """The text of a load in a controller's or simulator's own form.

    >>> from armload.payloads import franka_hand
    >>> print(export_load(Load(franka_hand().parameters), "ur-payload"), end="")
    # payload about panda_link8
    set_payload(0.73, [-0.00707106781187, 0.00707106781187, 0.03])

    Args:
        load: about the frame the form wants (the flange, for a controller); a body that can exist.
        to: one of `FORMS`.
        path: a file to write it to, complete or not at all; None: only return it.
        name: name of the link, body or model in a description.

    Raises:
        SinkError: an unknown form, a load that no body can have, a name or frame with a character that no XML holds,
            or a file that cannot be written.
    """
    if to not in FORMS:
        raise SinkError(f"unknown form {to!r}: expected one of {', '.join(FORMS)}")
    for what, called in (("name", name), ("frame", load.frame)):
        if called is not None and _NO_TEXT.search(called):
            raise SinkError(
                f"the {what} is {called!r}, with a character that no XML holds: expected letters and digits"
            )
    if not load.consistent:
        raise SinkError(
            "no body can have these parameters: take the nearest one, load.as_body(), or identify on a faster motion"
        )
    text = FORMS[to].text(FORMS[to].held_of(load), name)
    if path is not None:
        try:
            with replacing(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
        except OSError as error:
            raise SinkError(f"{path} cannot be written: {error.strerror or error}") from None
    return text

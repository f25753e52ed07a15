"""What the page offers to save: the newest estimate as a file of any form `armload.devices` knows."""

from __future__ import annotations

import json

from armload.app.cli.headless import line_of
from armload.arms import ARMS, Arm
from armload.devices import CONTROLLERS, Load, export_load, flange_of
from armload.errors import SinkError
from armload.online import OnlineEstimate

ENDINGS = {
    "franka": ".py",
    "franka-desk": ".json",
    "ur": ".script",
    "ur-payload": ".script",
    "kuka": ".java",
    "kinova": ".py",
    "xarm": ".py",
    "urdf": ".urdf",
    "mjcf": ".xml",
    "sdf": ".sdf",
    "ros2": ".yaml",
    "json": ".json",
}


def file_of(estimate: OnlineEstimate | None, arm: Arm, form: str) -> tuple[str, str]:
    """The name and the text of a file with the newest estimate.

    Args:
        estimate: None before the first sample.
        arm: whose payload it is.
        form: one of `FORMS`, or "json": what `armload export` reads.

    Raises:
        SinkError: an unknown form, nothing to write yet, or a mass that is not above zero.
    """
    if form not in ENDINGS:
        raise SinkError(f"unknown form {form!r}: expected one of {', '.join(ENDINGS)}")
    if estimate is None or not estimate.determined[0]:
        raise SinkError("the mass is not determined yet: wait until the arm has moved with its payload")
    name = f"payload-{form}{ENDINGS[form]}" if form != "json" else "payload.json"
    if form == "json":
        return name, json.dumps(line_of(estimate, arm.name)) + "\n"
    load = Load.of(estimate, arm)
    if form in CONTROLLERS and arm.name in ARMS:
        load = load.about(flange_of(arm), arm)
    return name, export_load(load.as_body(), form)

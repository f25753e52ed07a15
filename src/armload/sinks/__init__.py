"""The identified payload in a controller's or a simulator's own form, and guarded writing to a robot.

`franka_robot.set_load` and `ur_robot.set_load` write; everything else makes text.
"""

from armload.sinks.forms import CONTROLLERS, FORMS, Form, export_load
from armload.sinks.franka import FrankaLoad, franka_load
from armload.sinks.guard import check_writable, flange_of, is_moving
from armload.sinks.load import Load, about, read_load
from armload.sinks.ur import URPayload, ur_payload

__all__ = [
    "CONTROLLERS",
    "FORMS",
    "Form",
    "FrankaLoad",
    "Load",
    "URPayload",
    "about",
    "check_writable",
    "export_load",
    "flange_of",
    "franka_load",
    "is_moving",
    "read_load",
    "ur_payload",
]

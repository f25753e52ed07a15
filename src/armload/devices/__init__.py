"""Robots, simulators and files: reading their samples, writing a payload to them, one folder for each make."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.devices.counted import Controller, Counted
    from armload.devices.detached import Detached
    from armload.devices.files.source import Replay
    from armload.devices.forms import CONTROLLERS, FORMS, Form, export_load
    from armload.devices.franka.form import FrankaLoad, franka_load
    from armload.devices.franka.source import FrankaSource
    from armload.devices.guard import check_writable, flange_of, is_moving
    from armload.devices.load import Load, about
    from armload.devices.load_file import read_load
    from armload.devices.mover import Mover, StreamedMover, samples_of_movement
    from armload.devices.opening import open_source
    from armload.devices.opening_controllers import controller_of, has_controller
    from armload.devices.opening_movers import open_mover
    from armload.devices.reader import Reader
    from armload.devices.recorder import Recorded, Recorder
    from armload.devices.ring import Ring, RingReader
    from armload.devices.ros2.connection import Ros2Connection
    from armload.devices.ros2.source import Ros2Source
    from armload.devices.simulator.mover import SimulatedMover
    from armload.devices.simulator.source import Simulator
    from armload.devices.source import Source
    from armload.devices.steadied import Steadied
    from armload.devices.supervision import Supervision, Thresholds
    from armload.devices.ur.form import URPayload, ur_payload
    from armload.devices.ur.source import URSource

__all__ = [
    "CONTROLLERS",
    "FORMS",
    "Controller",
    "Counted",
    "Detached",
    "Form",
    "FrankaLoad",
    "FrankaSource",
    "Load",
    "Mover",
    "Reader",
    "Recorded",
    "Recorder",
    "Replay",
    "Ring",
    "RingReader",
    "Ros2Connection",
    "Ros2Source",
    "SimulatedMover",
    "Simulator",
    "Source",
    "Steadied",
    "StreamedMover",
    "Supervision",
    "Thresholds",
    "URPayload",
    "URSource",
    "about",
    "check_writable",
    "controller_of",
    "export_load",
    "flange_of",
    "franka_load",
    "has_controller",
    "is_moving",
    "open_mover",
    "open_source",
    "read_load",
    "samples_of_movement",
    "ur_payload",
]

__getattr__, __dir__ = on_first_use(__name__)

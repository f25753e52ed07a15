"""A record as MCAP: joint states, and what was said of the payload beside them, as messages of ROS 2.

| topic | type | what |
|---|---|---|
| `/joint_states` | sensor_msgs/JointState | every sample: q, dq, tau |
| `/payload` | geometry_msgs/InertiaStamped | the body that is held, once it is known, as `armload ros2` publishes it |
| `/payload/parameters` | std_msgs/Float64MultiArray | phi and the ends of its 95 % intervals, (3, 10), row by row |
| `/diagnostics` | diagnostic_msgs/DiagnosticArray | method, what is determined, age, notes, counts |
| `/rosout` | rcl_interfaces/Log | changes of payload and warnings |

All are logged at the time of the sample they belong to: seconds of the stream's clock since the first sample, added to
the time of day at which that one came.
"""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.devices.ros2.announcement import announced
from armload.devices.ros2.messages import message_of
from armload.inertia import NAMES
from armload.online import OnlineEstimate
from armload.recording.mcap_file import McapFile

JOINT_STATES, PAYLOAD, PARAMETERS = "/joint_states", "/payload", "/payload/parameters"
DIAGNOSTICS, LOG = "/diagnostics", "/rosout"
TOPICS = {
    JOINT_STATES: "sensor_msgs/msg/JointState",
    PAYLOAD: "geometry_msgs/msg/InertiaStamped",
    PARAMETERS: "std_msgs/msg/Float64MultiArray",
    DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
    LOG: "rcl_interfaces/msg/Log",
}
_INFO, _WARN = 20, 30  # levels of rcl_interfaces/Log
_SHOWN = ("method", "relative_to", "interval", "held", "p_held", "p_change", "p_contact", "p_drift", "n_samples")
_SHOWN = (*_SHOWN, "since", "age", "lag", "moving", "settling", "left_out", "pauses", "clock_jumps")


class McapPart:
    """One file of a record; see `Recorder`.

    Args:
        path: to write. arm: whose joints and payload it is. epoch: of the source (`Source.epoch`); None: samples are of
            now.

    Raises:
        RecordingError: it cannot be written.
    """

    def __init__(self, path: Path, arm: Arm, epoch: float | None = None) -> None:
        self._file = McapFile(path, TOPICS)
        self._arm, self._names = arm, list(arm.joint_names)
        self._first: float | None = None
        self._of_log = epoch
        self._epoch = self._now = 0  # [ns]
        self._said: list[tuple[str, bool]] = []  # of a log, before its first sample told the time

    def append(self, row: list[float]) -> None:
        """A sample: t, q, dq, tau."""
        if self._first is None:
            self._first = row[0]
            self._epoch = time.time_ns() if self._of_log is None else round(1e9 * (self._of_log + row[0]))
        self._now, n = self._stamp(row[0]), len(self._names)
        q, dq, tau = np.array(row[1:]).reshape(3, n)
        header = _header(self._now)
        message = SimpleNamespace(header=header, name=self._names, position=q, velocity=dq, effort=tau)
        self._file.write(JOINT_STATES, self._now, message)
        self._say_all()

    def keep(self, estimate: OnlineEstimate) -> None:
        """What is said of the payload after the newest sample."""
        body = announced(estimate, self._arm)
        if body is not None:
            rests_on = self._stamp(estimate.t - (estimate.age - estimate.lag))
            self._file.write(PAYLOAD, self._now, message_of(body, rests_on, _inertia))
        rows = np.array([estimate.phi, estimate.low, estimate.high])
        shape = [("phi, low, high", rows.shape[0], rows.size), (" ".join(NAMES), rows.shape[1], rows.shape[1])]
        dim = [SimpleNamespace(label=label, size=size, stride=stride) for label, size, stride in shape]
        layout = SimpleNamespace(dim=dim, data_offset=0)
        self._file.write(PARAMETERS, self._now, SimpleNamespace(layout=layout, data=rows.ravel()))
        answer = estimate.to_dict()
        values = {name: answer[name] for name in _SHOWN}
        values["determined"] = " ".join(name for name, known in zip(NAMES, answer["determined"], strict=True) if known)
        status = SimpleNamespace(
            level=int(bool(estimate.notes)),
            name="armload: payload",
            message="; ".join(estimate.notes),
            hardware_id="",
            values=[SimpleNamespace(key=key, value=str(value)) for key, value in values.items()],
        )
        self._file.write(DIAGNOSTICS, self._now, SimpleNamespace(header=_header(self._now), status=[status]))

    def say(self, text: str, warning: bool = False) -> None:
        """Something that happened."""
        if self._first is None and self._of_log is not None:
            self._said.append((text, warning))
            return
        if self._first is None:
            self._now = time.time_ns()
        log = SimpleNamespace(stamp=_time(self._now), level=_WARN if warning else _INFO, name="armload", msg=text)
        self._file.write(LOG, self._now, SimpleNamespace(**vars(log), file="", function="", line=0))

    def close(self) -> None:
        """Write what was said without a sample, and the index."""
        self._of_log = None
        self._say_all()
        self._file.close()

    def _say_all(self) -> None:
        said, self._said = self._said, []
        for text, warning in said:
            self.say(text, warning)

    def _stamp(self, t: float) -> int:
        assert self._first is not None
        return max(self._epoch + round(1e9 * (t - self._first)), 0)


def _time(stamp: int) -> SimpleNamespace:
    sec, nanosec = divmod(stamp, 1_000_000_000)
    return SimpleNamespace(sec=sec, nanosec=nanosec)


def _header(stamp: int) -> SimpleNamespace:
    return SimpleNamespace(stamp=_time(stamp), frame_id="")


def _inertia() -> Any:
    """An empty geometry_msgs/InertiaStamped."""
    entries = dict.fromkeys(("m", "ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 0.0)
    inertia = SimpleNamespace(**entries, com=SimpleNamespace(x=0.0, y=0.0, z=0.0))
    return SimpleNamespace(header=_header(0), inertia=inertia)

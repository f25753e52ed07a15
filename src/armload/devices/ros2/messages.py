"""The payload as a geometry_msgs/InertiaStamped, and back.

`com` is in the axes of `header.frame_id` and from its origin. The inertia is about the **centre of mass**, in the same
axes: what URDF does, and what the message's definition says since ros2/common_interfaces #313 (2026); before, it left
the point open. Off-diagonal entries are those of the matrix, as everywhere in armload.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from armload.inertia import InertialParameters, inertia_matrix, phi_to_com, vech

_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def message_of(body: InertialParameters, stamp: int, kind: Callable[[], Any]) -> Any:
    """A message with a body's mass, centre of mass and inertia about it; a massless body gives zeros.

    Args:
        body: about the origin of the frame it names.
        stamp: time of the last sample it rests on, since 1970 [ns].
        kind: makes an empty message: geometry_msgs.msg.InertiaStamped.
    """
    message = kind()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
    message.header.frame_id = body.frame or ""
    if body.mass == 0.0:
        return message
    mass, com, inertia = phi_to_com(body.phi)
    message.inertia.m = float(mass)
    message.inertia.com.x, message.inertia.com.y, message.inertia.com.z = com.tolist()
    for name, value in zip(_ENTRIES, vech(inertia).tolist(), strict=True):
        setattr(message.inertia, name, value)
    return message


def parameters_of(message: Any) -> InertialParameters:
    """The inertial parameters in a geometry_msgs/InertiaStamped, about the origin of its frame."""
    inertia, com = message.inertia, message.inertia.com
    matrix = inertia_matrix(np.array([getattr(inertia, name) for name in _ENTRIES]))
    return InertialParameters.from_com(inertia.m, (com.x, com.y, com.z), matrix, frame=message.header.frame_id or None)

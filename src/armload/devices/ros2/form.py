"""The load as a ROS 2 message: `geometry_msgs/msg/InertiaStamped` in YAML, inertia about the centre of mass.

ros2 topic pub --once /payload geometry_msgs/msg/InertiaStamped "$(cat payload.yaml)"
"""

from __future__ import annotations

import json

import numpy as np

from armload.devices.load import Load, numbers_of
from armload.errors import SinkError


def inertia_stamped_text(load: Load) -> str:
    """The message as YAML; its stamp is zero, its `frame_id` the load's frame.

    Raises:
        SinkError: the load does not name its frame.
    """
    if load.frame is None:
        raise SinkError("the payload does not name its frame: the message's frame_id needs it; give --frame")
    # without exponents: to ROS's reader, of YAML 1.1, 5e-05 is text
    numbers = [np.format_float_positional(x, trim="0") for x in numbers_of(load.parameters, "urdf")]
    inertia = "".join(
        f"  {key}: {value}\n"
        for key, value in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), numbers[4:], strict=True)
    )
    x, y, z = numbers[1:4]
    return (
        "".join(f"# {line}\n" for line in load.description())
        + f"header:\n  stamp: {{sec: 0, nanosec: 0}}\n  frame_id: {json.dumps(load.frame)}\n"
        + f"inertia:\n  m: {numbers[0]}\n  com: {{x: {x}, y: {y}, z: {z}}}\n{inertia}"
    )

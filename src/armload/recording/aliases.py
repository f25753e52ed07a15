"""How tools name the columns of a log: data, read by `mapping.py`.

A column's name is cut into words (`state.tau_J[0]` → state, tau, j and the index 0), and the words without those of
`NEUTRAL` say what it holds. Whatever is not listed here is no reading of a joint's position, velocity or torque, and
is left out. Sources, in the order of the tables:

- libfranka, `src/log.cpp`: `time` (2017: `duration`) in whole milliseconds, then state.q[0] …, state.tau_J[0] …
- franka_ros, `FrankaState.msg`: q, dq, tau_J, tau_J_d, tau_ext_hat_filtered; `tau_J` is the link-side sensor.
- ROS, `sensor_msgs/JointState`: name, position, velocity, effort; the order of the joints is the publisher's own.
- rostopic echo -p: `%time` and `field.header.stamp` in nanoseconds, then `field.name0` …, `field.position0` …
- PlotJuggler, `publisher_csv.cpp`: `__time` in seconds, then topic/joint/position in alphabetical order.
- Universal Robots' RTDE client (`csv_writer.py`, separated by spaces) and ur_rtde (`startFileRecording`): actual_q_0 …,
  `timestamp` in seconds since the controller was started, actual_current in amperes.
- LeRobot data sets: `observation.state`, `timestamp` in seconds, `episode_index`. ALOHA: `observations/qpos`.
- panda-py, `Panda::getLog`: q, dq, tau_J, tau_ext_hat_filtered, and time in milliseconds, a list of one.
- Kinova's Kortex, `BaseCyclic.Feedback`: actuators[0].position, .velocity, .torque; degrees.
- Simulink: `tout` beside what a model logs; signals.values of a structure with time.
- NIST's robot measurements: ROBOT_ACTUAL_JOINT_POSITIONS (J1) …
- pyfri (lbr-stack), `collect_data`: mp1 …, mt1 … are measured, ip1 … interpolated, et1 … external; no velocities.
- polymetis (DROID), `franka_torque_control_client.cpp`: motor_torques_measured is libfranka's tau_J.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

QUANTITIES = ("q", "dq", "tau")
CALLED = {"t": "time", "q": "position", "dq": "velocity", "tau": "torque"}

# what is left of a name without index, joint and neutral words: the quantity it holds
WORDS = {
    **dict.fromkeys(("q", "qpos", "jpos", "pos", "position", "positions", "angle", "angles", "theta"), "q"),
    **dict.fromkeys(
        ("dq", "qd", "qdot", "q_dot", "qvel", "jvel", "vel", "velocity", "velocities", "speed", "speeds", "omega"), "dq"
    ),
    **dict.fromkeys(("tau", "torque", "torques", "trq", "eff", "effort", "efforts"), "tau"),
}
CURRENTS = frozenset({"current", "currents", "motor_current", "motor_currents"})
MEASURED = frozenset(("measured", "meas", "actual", "act"))
NEUTRAL = frozenset(
    (
        *("j", "jnt", "joint", "joints", "axis", "actuator", "actuators", "arm", "robot", "franka"),
        *("controller", "broadcaster", "field", "msg", "header", "observation", "observations", "obs"),
        *("state", "states", *MEASURED),
    )
)
# words of what a controller wants or its model expects; of what is left after the arm's own torque is taken out
DESIRED = frozenset(
    (
        *("d", "des", "desired", "target", "goal", "setpoint", "ref", "reference", "planned", "nominal"),
        *("cmd", "command", "commands", "commanded", "computed", "expected", "model", "ff", "feedforward"),
    )
)
EXTERNAL = frozenset(("ext", "external", "residual", "disturbance"))
# whole names that the words alone would misread
WHOLE = {
    "observation_state": ("q", "measured"),
    "motor_torques_measured": ("tau", "measured"),
    "observation_robot_state_motor_torques_measured": ("tau", "measured"),
    "mp": ("q", "measured"),
    "mt": ("tau", "measured"),
    "target_moment": ("tau", "desired"),  # what the controller's model expects for the payload that is set
    "actual_current_as_torque": ("tau", "external"),  # gravity is taken out already: see devices/ur/source.py
}

# moment and current that a controller wants of each joint: torque per ampere follows from them (`torque_constants.py`)
WANTED = ("target_moment", "target_current")
MOMENTS = frozenset(("moment", "moments"))  # what RTDE calls the torque that is wanted

TIMES = frozenset(
    ("t", "time", "timestamp", "timestamps", "stamp", "header_stamp", "time_stamp", "elapsed", "elapsed_time", "tout")
)
# seconds and nanoseconds in columns of their own: the fields of a stamp in ROS 1 and ROS 2, and what a message's is in
PARTS = {"sec": ("nanosec", "nsec"), "secs": ("nsecs", "nanosecs"), "seconds": ("nanoseconds",)}
CLOCKS = TIMES | {"header"}
NAMES = frozenset({"name", "names"})
EPISODE = "episode_index"

TIME_UNITS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "usec", "micros", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanos", "nanosec", "nanosecs", "nanosecond", "nanoseconds"), 1e-9),
}
AMPERE = "a"
UNITS = {
    "t": TIME_UNITS,
    "q": {**dict.fromkeys(("rad", "radian", "radians"), 1.0), **dict.fromkeys(("deg", "°", "degrees"), pi / 180.0)},
    "dq": {
        **dict.fromkeys(("rad/s", "rad", "rads", "rad s", "radians/s"), 1.0),
        **dict.fromkeys(("deg/s", "°/s", "deg", "deg s", "degrees/s"), pi / 180.0),
    },
    "tau": {**dict.fromkeys(("nm", "n·m", "n*m", "n m", "n.m"), 1.0), AMPERE: 1.0},
}


_STAMPS = ("field.header.stamp", "%time")
_POLYMETIS = "observation_robot_state_motor_torques_measured"


class Form(NamedTuple):
    """What is known of a log by the tool that wrote it.

    marks: names without index that must all be there. times: the columns of time, in the order of preference.
    unit: of the time. clocks: pattern of other columns of time that it writes. torque: the measured torque among
        several, as this tool names it.
    """

    tool: str
    marks: tuple[str, ...]
    times: tuple[str, ...]
    unit: str
    clocks: str = "(?!)"
    torque: str | None = None


FORMS = (
    Form("libfranka", ("state_q", "state_dq", "state_tau_j", "success_rate"), ("time",), "ms", torque="state_tau_j"),
    Form("libfranka", ("q", "dq", "tau_j", "success_rate", "sent_commands"), ("duration",), "ms", torque="tau_j"),
    Form("panda-py", ("q", "dq", "tau_j", "control_command_success_rate"), ("time",), "ms", torque="tau_j"),
    Form("rostopic echo -p", ("field_q", "field_tau_j"), _STAMPS, "ns", r"field\..*", "field_tau_j"),
    Form("rostopic echo -p", ("field_position",), _STAMPS, "ns", r"field\..*"),
    Form("PlotJuggler", ("__time",), ("__time",), "s", r"/.*/header/stamp(/\w+)?"),
    Form("RTDE", ("actual_q", "actual_qd"), ("timestamp",), "s"),
    Form("LeRobot", ("observation_state", "episode_index"), ("timestamp",), "s"),
    Form("pyfri", ("mp", "ip", "mt", "et"), ("time",), "s", "record_time_nsec|tsec|tnsec"),
    Form("polymetis", (_POLYMETIS,), (), "s", torque=_POLYMETIS),
)

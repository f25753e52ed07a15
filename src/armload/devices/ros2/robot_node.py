"""The simulated robot as a ROS 2 node: joint states out, joint trajectories in.

What Gazebo and ROS do in the paper (Taie et al., RA-L 2024, Section IV). The physics is `devices.Simulator`: computed a
moment ahead, published in real time. A trajectory begins at the end of what is computed already, and replaces the one
before it, as ROS 2's joint trajectory controller has it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.devices.ros2.connection import Ros2Connection
from armload.devices.ros2.trajectory import TrajectoryMotion, read_trajectory
from armload.devices.simulator.commanded import CommandedMotion
from armload.devices.simulator.source import Simulator
from armload.errors import ArmloadError
from armload.inertia import InertialParameters
from armload.motion import EndlessMotion, Motion
from armload.recording import Sample
from armload.simulation import Sensors, World

_AHEAD = 0.04  # [s] computed at once
_LOOK = 0.1  # [s] at most between two looks at whether somebody interrupts


class RobotNode:
    """Publishes sensor_msgs/JointState and obeys trajectory_msgs/JointTrajectory.

    A trajectory that the arm cannot run is refused; `say` is called with the reason.

    Args:
        arm: as the controller knows it, which does not know the payload.
        connection: the node.
        first: what the robot does until a trajectory comes: a motion to repeat, or a pose (n,) to stand at [rad].
        payload: about the arm's payload frame; None: no payload.
        world: the arm as it really is; None: nominal.
        sensors: None: ideal.
        rate: joint states per second [Hz].
        seed: of the sensors' noise.
        states, commands: the topics.
        say: called with a sentence on what happens.

    Raises:
        SourceError: a topic's name is not one.
        MotionError: the motion cannot be repeated, or is of another arm.
    """

    def __init__(
        self,
        arm: Arm,
        connection: Ros2Connection,
        first: Motion | NDArray[np.float64],
        payload: InertialParameters | None = None,
        *,
        world: World | None = None,
        sensors: Sensors | None = None,
        rate: float = 200.0,
        seed: int = 0,
        states: str = "/joint_states",
        commands: str = "/joint_trajectory_controller/joint_trajectory",
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._arm, self._connection, self._say = arm, connection, say
        motion = first
        if not isinstance(motion, Motion):
            motion = TrajectoryMotion([0.0, 1.0], np.array([first, first]), name="standing")
        self._commanded = CommandedMotion(EndlessMotion(motion))
        self._simulator = Simulator(
            arm, motion, [(0.0, payload)], world=world, sensors=sensors, rate=rate, speed=None, seed=seed, ahead=_AHEAD
        )
        self._simulator.motion = self._commanded
        self._stopped, self._began = False, 0
        self._publish = connection.publisher(connection.JointState, states)
        connection.subscribe(connection.JointTrajectory, commands, self._take)

    def run(self) -> None:
        """Publish and obey until `stop` or an interruption."""
        start = None
        for sample in self._simulator:
            if start is None:  # by now what the simulation needs is loaded
                start = self._began = self._connection.now()
            stamp = start + round(sample.t * 1e9)
            self._wait_until(stamp)
            if self._stopped:
                break
            self._publish(self._message(sample, stamp))

    def hold(self, payload: InertialParameters | None) -> None:
        """Another payload from now on; None: nothing is held."""
        self._simulator.hold(payload)

    def stop(self) -> None:
        """Let `run` end; from any thread."""
        self._stopped = True

    def _wait_until(self, stamp: int) -> None:
        """Handle incoming messages until a sample is due, at least once."""
        while True:
            ahead = 1e-9 * (stamp - self._connection.now())
            self._connection.spin(min(_LOOK, max(0.0, ahead)))
            if self._stopped or self._connection.now() >= stamp:
                return

    def _take(self, message: Any, _: int) -> None:
        """A trajectory has come."""
        try:
            now = self._began + round(1e9 * self._commanded.asked)
            motion = read_trajectory(message, self._arm, self._commanded.state, now)
        except ArmloadError as error:
            self._say(f"a trajectory was refused: {error}")
            return
        self._commanded.order(motion)
        self._say(f"a trajectory of {motion.duration:.2f} s was accepted")

    def _message(self, sample: Sample, stamp: int) -> Any:
        message = self._connection.JointState()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        message.name = list(self._arm.joint_names)
        message.position, message.velocity, message.effort = (x.tolist() for x in (sample.q, sample.dq, sample.tau))
        return message

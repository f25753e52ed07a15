"""The lifecycle node: joint states in; the payload with its error bars, its state and its events out.

    ros2 run armload_ros payload_identifier --ros-args -p robot:=panda -r joint_states:=/franka/joint_states

configure reads the parameters and makes the identifier, activate listens, deactivate stops listening and keeps what is
known, cleanup forgets it. Names below `~` are private to the node, so several arms are several nodes or namespaces.
Time is the node's clock: with use_sim_time that of /clock.
"""

from __future__ import annotations

import sys
import threading
import time
from typing import Any

import numpy as np
import rclpy
from armload_msgs.srv import SetMass, SetTool
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from armload.arms import Arm
from armload.devices.ros2 import announced
from armload.devices.ros2.joint_states import JointStates, velocities_of_positions
from armload.errors import ArmloadError
from armload.identification import check_usable, plausible_known, plausible_tool
from armload.online import OnlineEstimate
from armload.posterior import Known
from armload.recording import GAP, Sample, Steadying
from armload.service.tare import Tare

from .applying import Applying, applying_of
from .diagnostics import status_of, values_of
from .measuring import Measuring
from .messages import payload_message, tool_of
from .outputs import Outputs
from .parameters import DEFAULTS, Parameters, as_declared
from .stream import Stream
from .taring import Taring

_KEPT = 1000  # messages that wait while an answer is computed: one second at 1 kHz
_DONE, _FAILED = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class PayloadIdentifier(LifecycleNode):
    """Subscribes to `joint_states`; see docs/ros2.md for its topics, services, its action and parameters."""

    def __init__(self, **how: Any) -> None:
        super().__init__("payload_identifier", **how)
        for name, value in DEFAULTS.items():  # of any type, so that a wrong one is a sentence of configure
            self.declare_parameter(name, value, ParameterDescriptor(dynamic_typing=True))
        self.parameters = Parameters(DEFAULTS.__getitem__)
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)  # runs on while simulated time stands
        self.beside = ReentrantCallbackGroup()  # of what waits for the rest of the node
        self._stream: Stream | None = None
        self._telling: Steadying | None = None  # velocities, where the joint states have none
        self._applying: Applying | None = None
        self._measuring = Measuring(self)  # for good: whoever waits for a goal hears how it ended, also after cleanup
        self._outputs: Outputs | None = None
        self._offered: list[Any] = []
        self._subscription: Any = None
        self._taring: Taring | None = None
        self._heard, self._last = 0.0, -np.inf
        self._said, self._trouble = "", ""

    @property
    def active(self) -> bool:
        """Whether it listens."""
        return self._subscription is not None

    # ------------------------------------------------------------------ lifecycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Read the parameters; a parameter that is wrong leaves the node unconfigured, and the log says which."""
        try:
            self._begin()
        except (ArmloadError, OSError) as error:
            self.get_logger().error(str(error))
            self._forget()
            return _FAILED
        self._outputs = Outputs(self)
        self._offered = [
            self.create_service(Trigger, "~/reset", self._reset),
            self.create_service(Trigger, "~/tare", self._tare),
            self.create_service(SetTool, "~/set_tool", self._set_tool),
            self.create_service(SetMass, "~/set_mass", self._set_mass),
            self.create_service(Trigger, "~/apply", self._apply, callback_group=self.beside),
        ]
        self._each_second = self.create_timer(1.0, self._diagnose, clock=self.steady)
        return _DONE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen."""
        how = QoSProfile(depth=_KEPT, reliability=ReliabilityPolicy.BEST_EFFORT)  # hears reliable publishers, too
        self._heard = time.monotonic()
        self._subscription = self.create_subscription(JointState, "joint_states", self._take, how)
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen no more; what is known stays."""
        self._silent()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Forget everything."""
        self._silent()
        if self._outputs is not None:
            self.destroy_timer(self._each_second)
            self._outputs.close()
        for service in self._offered:
            self.destroy_service(service)
        self._outputs, self._offered = None, []
        self._forget()
        return _DONE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As cleanup."""
        return self.on_cleanup(state)

    def _silent(self) -> None:
        if self._subscription is not None:
            self.destroy_subscription(self._subscription)
        self._subscription, self._taring = None, None
        self._drop_held_back()
        self._measuring.end("the node is not active any more")

    def _forget(self) -> None:
        for one in (self._applying, self._stream):
            if one is not None:
                one.close()
        self._applying, self._stream = None, None

    def _begin(self) -> None:
        """The arm and the identifier that the parameters ask for, and who is told."""
        read = as_declared({name: self.get_parameter(name).value for name in DEFAULTS})
        self.parameters = given = Parameters(read.__getitem__)  # what is set later counts from the next configure on
        bare = given.bare_arm()
        self._bare, robot = bare, given.with_tool(bare)
        self._states = JointStates(robot, "joint_states", given.effort(robot), needs_velocities=False)
        self._telling = None
        log = given.tare(robot)
        age, aged = given.tare_age(log)
        for note in aged:
            self.get_logger().warning(note)
        self._identify(robot, None if log is None else Tare(log, age), given.known(robot))
        if given.value("apply"):
            self._applying = applying_of(self, given, bare)

    def _identify(self, robot: Arm, tare: Tare | None, known: Known | None = None) -> None:
        """A new stream in the place of the present one, which stays if it cannot be made."""
        given = self.parameters
        method = given.value("method") or None
        stream = Stream(robot, tare, method, given.profile(), known, given.value("steady"))
        if self._stream is not None:
            self._stream.close()
        self._stream, self._last = stream, -np.inf

    # ------------------------------------------------------------------ messages

    def _take(self, message: JointState, info: Any) -> None:  # rclpy looks at the number of arguments
        assert self._stream is not None
        try:
            sample = self._states.sample(message, self.get_clock().now().nanoseconds)
        except ArmloadError as error:
            self._trouble = str(error)
            return
        if sample is None:
            return
        self._heard, self._trouble = time.monotonic(), ""
        received = int(info["received_timestamp"])  # by the middleware, 0 where it does not tell
        # and since then it waited behind others
        arrived = self._heard - (max(0, time.time_ns() - received) / 1e9 if received else 0.0)
        if self._states.has_velocities:
            self._take_sample(sample, arrived)
            return
        if self._telling is None:
            self._telling = Steadying(len(sample.q), alone=True)
            self.get_logger().warning(velocities_of_positions("joint_states"))
        for told, since in self._telling.take(sample, arrived):
            self._take_sample(told, since)

    def _take_sample(self, sample: Sample, arrived: float) -> None:
        """A sample with velocities; arrived: when it had [s, monotonic]."""
        assert self._stream is not None
        if self._taring is not None:
            if self._taring.take(sample) >= self.parameters.value("tare_duration"):
                self._end_tare()
            return
        estimate = self._stream.update(sample, arrived)
        if estimate is None:
            return
        if (advice := self._stream.advice()) is not None:
            self.get_logger().warning(advice)
        if abs(sample.t - self._last) >= 0.999 / self.parameters.value("rate"):  # a clock set back counts as later
            self._last = sample.t
            self._publish(self._stream, estimate)

    def _publish(self, stream: Stream, estimate: OnlineEstimate) -> None:
        known = stream.why_unknown() is None
        body = announced(estimate, stream.arm) if known else None
        said = payload_message(estimate, stream.arm.name, self._states, body)
        self._measuring.take(said)
        if self._applying is not None and stream.sample is not None:
            self._applying.offer(estimate, stream.sample, known, stream.doubts)
        if self._outputs is not None:
            self._outputs.say(said, body, self.parameters.value("com_frame"))

    def _diagnose(self) -> None:
        stream = self._stream
        if self._outputs is None or stream is None:
            return
        if time.monotonic() - self._heard > GAP:
            for told, arrived in () if self._telling is None else self._telling.flush():
                self._take_sample(told, arrived)
            stream.flush()
        why = None if stream.estimate is None else stream.why_unknown()
        status = status_of(self._in_the_way(), stream.estimate, why)
        tared = "yes" if stream.tare is not None else "no"
        status.values = values_of(stream.estimate, robot=self._bare.name, tare=tared, last_service=self._said)
        self._outputs.diagnose(status, self._bare.name)

    def _in_the_way(self) -> tuple[bytes, str] | None:
        silent, clock = time.monotonic() - self._heard, self.get_clock()
        if not self.active:
            return DiagnosticStatus.STALE, "not active"
        if clock.ros_time_is_active and clock.now().nanoseconds == 0:
            return DiagnosticStatus.ERROR, "use_sim_time is set, and nothing comes on /clock"
        if self._trouble or silent > self.parameters.value("timeout"):
            return DiagnosticStatus.ERROR, self._trouble or f"no joint states for {silent:.0f} s"
        if self._taring is not None:
            return DiagnosticStatus.WARN, "taring: keep the payload off and let the arm move"
        return None

    # ------------------------------------------------------------------ services

    def reset_stream(self) -> None:
        """Forget the samples, not the tare."""
        assert self._stream is not None
        self._stream.reset()
        self._last, self._taring = -np.inf, None
        self._drop_held_back()
        self._measuring.forget()

    def _drop_held_back(self) -> None:
        """Forget the samples whose velocities are not told yet: what comes next is of another time."""
        if self._telling is not None:
            self._telling = Steadying(self._bare.n, alone=True)

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:  # noqa: ARG002
        given_up = "" if self._taring is None else ", and the one that was being taken is given up"
        self.reset_stream()
        return self._told(response, True, f"the stream is forgotten; the tare, if there is one, is not{given_up}")

    def _tare(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:  # noqa: ARG002
        if not self.active:
            return self._told(response, False, "the node is not active: activate it first")
        self._taring = Taring(self._bare)
        return self._told(response, True, f"listening for {self.parameters.value('tare_duration'):g} s")

    def _end_tare(self) -> None:
        assert self._taring is not None
        assert self._stream is not None
        taring, self._taring = self._taring, None
        try:
            log = taring.recording(self._bare.joint_names)
            check_usable(log, self._stream.arm)
            self._identify(self._stream.arm, Tare(log, taken=True), self._stream.known)
        except ArmloadError as error:
            self._said = f"no tare: {error}"
            self.get_logger().error(self._said)
            return
        self._said = f"tared with {log.duration:.1f} s"
        self.get_logger().info(self._said)

    def _set_tool(self, request: SetTool.Request, response: SetTool.Response) -> SetTool.Response:
        try:
            robot, text = self._bare, "no tool"
            if request.tool.inertia.m != 0.0:
                tool = plausible_tool(self._bare.in_frame(tool_of(request.tool)), self._bare)
                robot, text = self._bare.with_payload(tool), f"a tool of {tool.mass:.3f} kg"
            self._identify(robot, None, None if self._stream is None else self._stream.known)
        except ArmloadError as error:
            return self._told(response, False, str(error))
        self._taring = None  # of the tool before
        return self._told(response, True, f"{text}; the stream begins anew, without a tare")

    def _set_mass(self, request: SetMass.Request, response: SetMass.Response) -> SetMass.Response:
        assert self._stream is not None
        forgotten = request.mass == 0.0 and request.std == 0.0
        try:
            mass, old = None if forgotten else (request.mass, request.std), self._stream.known or Known()
            known = Known.of(mass, old.com, if_held=True, body=old.body, families=old.families)
            self._identify(self._stream.arm, self._stream.tare, plausible_known(known, self._bare))
        except ArmloadError as error:
            return self._told(response, False, str(error))
        text = "no mass is known" if forgotten else f"the mass is {request.mass:.3f} ± {request.std:.3f} kg"
        return self._told(response, True, f"{text}; the stream begins anew")

    async def _apply(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:  # noqa: ARG002
        applying = self._applying
        if applying is None:
            text = "nobody is told: set the parameter apply to franka_ros2, ur_robot_driver or moveit, and configure"
            return self._told(response, False, text)
        done = Future(executor=self.executor)

        def tell() -> None:  # the executor goes on meanwhile: the arm's state and the service's answers come through it
            done.set_result(applying.tell())
            if self.executor is not None:
                self.executor.wake()

        threading.Thread(target=tell, name="apply", daemon=True).start()
        return self._told(response, *await done)

    def _told(self, response: Any, success: bool, text: str) -> Any:
        self._said = text
        self.get_logger().info(text)
        response.success, response.message = success, text
        return response


def main(args: list[str] | None = None) -> None:
    """Run until it is shut down."""
    rclpy.init(args=args)
    node = PayloadIdentifier()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RuntimeError:  # of rclpy: a message was on its way out as the signal came
        if rclpy.ok():
            raise
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main(sys.argv)

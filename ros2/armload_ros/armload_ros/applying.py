"""What is identified, told to whom the parameter `apply` names: on request, or by itself with `apply_auto`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from armload.arms import Arm
from armload.devices.ros2 import announced
from armload.errors import ArmloadError, UsageError
from armload.inertia import InertialParameters
from armload.online import OnlineEstimate
from armload.recording import Sample
from armload.service.feedback import FRESH, Feedback

from .controllers import KINDS, PlanningScene, ServiceController
from .parameters import Parameters

MOVEIT = "moveit"


class _Answer(NamedTuple):
    estimate: OnlineEstimate
    known: bool
    at: float


class Applying:
    """Tells a controller in steps while the arm stands (`armload.service.feedback`), or MoveIt at once.

    Args:
        node: a node that spins in another thread than `tell` is called from.
        to: franka_ros2, ur_robot_driver or moveit. arm: the bare arm, used by nobody else.
        auto: whether it is told by itself. note: called with sentences for the log.
        mounted, counted, end_effector: see `Feedback`, `ServiceController`. touch_links: that may touch it, for MoveIt.

    Raises:
        ArmloadError: nobody of this name, its messages are not installed, or the arm's flange is not known.
    """

    def __init__(
        self,
        node: Any,
        to: str,
        arm: Arm,
        *,
        auto: bool,
        mounted: InertialParameters | None,
        counted: InertialParameters | None,
        end_effector: float,
        touch_links: list[str],
        note: Callable[[str], None],
    ) -> None:
        if to not in (*KINDS, MOVEIT):
            raise UsageError(f"apply is {to!r}: expected one of {', '.join((*KINDS, MOVEIT))}")
        if auto and to == MOVEIT:
            raise UsageError("apply_auto is for a robot's controller: MoveIt is told on request")
        self._arm, self._auto, self._telling = arm, auto, threading.Lock()
        self._newest: _Answer | None = None
        self._scene: PlanningScene | None = None
        self._feedback: Feedback | None = None
        self._sample: Sample | None = None
        if to == MOVEIT:
            self._scene = PlanningScene(node, touch_links)
            return
        controller = ServiceController(node, to, arm, self._velocity, end_effector, counted)
        self._feedback = Feedback(arm, controller, mounted, note)
        if auto:
            self._feedback.start()

    def offer(self, estimate: OnlineEstimate, sample: Sample, known: bool, doubts: tuple[str, ...] = ()) -> None:
        """The newest answer, its sample, whether it can be used, and what speaks against it."""
        self._newest, self._sample = _Answer(estimate, known, time.monotonic()), sample
        if self._feedback is not None:
            self._feedback.offer(estimate, sample.q, known, doubts)

    def tell(self) -> tuple[bool, str]:
        """Tell it now; whether it was, and what to say."""
        if self._auto:
            return False, "apply_auto is set: it is told by itself"
        if not self._telling.acquire(blocking=False):
            return False, "it is being told already"
        try:
            return self._tell_scene() if self._feedback is None else self._tell_controller(self._feedback)
        except ArmloadError as error:
            return False, str(error)
        finally:
            self._telling.release()

    def close(self) -> None:
        """No more calls."""
        for one in (self._feedback, self._scene):
            if one is not None:
                one.close()

    def _tell_controller(self, feedback: Feedback) -> tuple[bool, str]:
        waits = feedback.finish()
        return (True, f"the controller counts {feedback.mass:.3f} kg") if waits is None else (False, waits)

    def _tell_scene(self) -> tuple[bool, str]:
        assert self._scene is not None
        answer, body = self._newest, None
        if answer is not None and answer.known and time.monotonic() - answer.at <= FRESH:
            body = announced(answer.estimate, self._arm)
        if body is None:
            return False, "the answer is unknown"
        self._scene.put(body)
        return True, f"{body.mass:.3f} kg attached to {body.frame}" if body.mass else "nothing is attached"

    def _velocity(self) -> Any:
        return [] if self._sample is None else self._sample.dq


def applying_of(node: Any, given: Parameters, bare: Arm) -> Applying:
    """As the parameters say."""
    return Applying(
        node,
        given.value("apply"),
        given.bare_arm(),  # of its own: a model computes in a memory that two threads must not share
        auto=given.value("apply_auto"),
        mounted=given.mounted(bare),
        counted=given.counted(bare),
        end_effector=given.value("end_effector"),
        touch_links=[name for name in given.value("touch_links") if name],
        note=node.get_logger().info,
    )

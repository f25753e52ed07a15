"""The action `~/measure`: it ends when the payload is known as well as asked, or when its time is over.

Nothing is moved: whoever asks moves the arm meanwhile, with MoveIt or a controller of ros2_control.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from armload_msgs.action import Measure
from armload_msgs.msg import Payload
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future

_REACHED = "known as well as asked"
_PATIENCE = 60.0  # [s] where no timeout is asked for
_GROUPS = (("mass", slice(0, 1)), ("moment", slice(1, 4)), ("inertia", slice(4, 10)))


def left(goal: Any, payload: Payload) -> list[float]:
    """The largest half-width of each group over what is asked of it (3,); 0 where nothing is asked."""
    half = 0.5 * (np.array(payload.high) - np.array(payload.low))
    half[~np.array(payload.determined)] = np.inf
    ratios = []
    for name, group in _GROUPS:
        asked = getattr(goal, name)
        ratios.append(float(half[group].max() / asked) if asked > 0.0 else 0.0)
    return ratios


class Measuring:
    """Serves the action on a node.

    Args:
        node: of the action, with `reset_stream()` and `active`.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._goals: list[tuple[Any, Future, float]] = []  # the goal, its end, when its time is over
        self._timer = node.create_timer(0.1, self._look, clock=node.steady)
        self._server = ActionServer(
            node, Measure, "~/measure", self._run, goal_callback=self._asked, cancel_callback=self._cancelled
        )
        self._newest = Payload()

    def take(self, payload: Payload) -> None:
        """The newest answer."""
        self._newest = payload
        for handle, future, _ in self._goals:
            ratios = left(handle.request, payload)
            handle.publish_feedback(Measure.Feedback(payload=payload, left=ratios))
            if payload.known and not payload.settling and max(ratios) <= 1.0 and not future.done():
                future.set_result(_REACHED)

    def forget(self) -> None:
        """The stream begins anew: what was known is of before."""
        self._newest = Payload()

    def end(self, why: str) -> None:
        """No goal goes on: the node is not active any more."""
        for _, future, _ in self._goals:
            if not future.done():
                future.set_result(why)

    def _asked(self, goal: Any) -> GoalResponse:
        asked = np.array([goal.mass, goal.moment, goal.inertia, goal.timeout])
        possible = self._node.active and np.isfinite(asked).all() and (asked >= 0.0).all() and asked[:3].any()
        return GoalResponse.ACCEPT if possible else GoalResponse.REJECT

    def _cancelled(self, handle: Any) -> CancelResponse:  # noqa: ARG002
        return CancelResponse.ACCEPT

    async def _run(self, handle: Any) -> Measure.Result:
        goal, future = handle.request, Future(executor=self._node.executor)
        if goal.forget:
            self._node.reset_stream()
        self._goals.append(asked := (handle, future, time.monotonic() + (goal.timeout or _PATIENCE)))
        text = await future
        self._goals.remove(asked)
        reached = text == _REACHED
        if reached:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return Measure.Result(success=reached, message=text, payload=self._newest)

    def _look(self) -> None:
        for handle, future, until in self._goals:
            if future.done():
                continue
            if handle.is_cancel_requested:
                future.set_result("cancelled")
            elif time.monotonic() > until:
                future.set_result("the time is over")

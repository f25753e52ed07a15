"""Who can be told what is held: the drivers of Franka and Universal Robots, and MoveIt, each by its own service.

`apply` is        it calls                                   of type
franka_ros2       service_server/set_load                    franka_msgs/SetLoad
ur_robot_driver   io_and_status_controller/set_payload       ur_msgs/SetPayload
moveit            apply_planning_scene                       moveit_msgs/ApplyPlanningScene

The names are relative, so that a namespace and remapping work. The message packages are imported when one is asked for.
Sources: the packages' interface definitions on docs.ros.org (franka_msgs 1.0.0, ur_msgs of Humble and Jazzy).
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

from armload.arms import Arm
from armload.devices import Counted, Load, check_writable, is_moving
from armload.devices.franka.form import franka_load
from armload.devices.guard import flange_of
from armload.devices.ur.form import ur_payload
from armload.errors import SentError, SinkError
from armload.inertia import InertialParameters
from armload.service.feedback import PAUSE

from .messages import radius

_PATIENCE = 5.0  # [s] for a service to be there, and again for its answer
OBJECT = "armload_payload"  # what it is called in the planning scene

Fill = Callable[[Any, InertialParameters], None]


class ServiceController:
    """A controller behind a service that takes a load and does not tell it: what was told last is what it counts.

    Args:
        node: its client calls, in the group `node.beside`, while another thread spins it. kind: see `KINDS`.
        arm: the bare one, of this thread.
        velocity: gives the newest dq. end_effector: mass that the controller counts beside the load [kg].
        counted: what it counts before it is told anything.
    """

    def __init__(
        self,
        node: Any,
        kind: str,
        arm: Arm,
        velocity: Callable[[], Any],
        end_effector: float,
        counted: InertialParameters | None,
    ) -> None:
        package, name, service, self._fill = KINDS[kind]
        self._type = _imported(package, "srv", name)
        self._service, self._arm, self._velocity, self._end_effector = service, arm, velocity, end_effector
        flange = flange_of(arm)
        self._told = InertialParameters.zero(flange)
        if counted is not None:
            self._told = replace(arm, frame=flange, attached=None).in_frame(counted)
        self._node, self._client = node, node.create_client(self._type, service, callback_group=node.beside)

    def counted(self) -> Counted:
        """What it was told last."""
        return Counted(self._velocity(), self._end_effector, self._told)

    def put(self, load: Load) -> None:
        """Guarded like every writer (`check_writable`).

        Raises:
            SinkError: the load must not be written, the service is not there, or it refused.
        """
        body = check_writable(
            load,
            self._arm,
            moving=is_moving(self._velocity()),
            end_effector=self._end_effector,
            write=True,
            allow_undetermined_inertia=True,
            allow_nothing=True,
        )
        request = self._type.Request()
        self._fill(request, body)
        _call(self._client, self._service, request)
        self._told = body

    def done(self) -> None:
        """Nothing to let go of."""

    def close(self) -> None:
        """No more calls."""
        self._node.destroy_client(self._client)


class PlanningScene:
    """MoveIt's planning scene: the payload as an object attached to the link that carries it.

    Its shape is a ball of the mass as water at the centre of mass: nobody knows the payload's own.
    """

    def __init__(self, node: Any, touch_links: list[str]) -> None:
        self._type = _imported("moveit_msgs", "srv", "ApplyPlanningScene")
        self._attached = _imported("moveit_msgs", "msg", "AttachedCollisionObject")
        self._solid, self._pose = (
            _imported("shape_msgs", "msg", "SolidPrimitive"),
            _imported("geometry_msgs", "msg", "Pose"),
        )
        self._service = "apply_planning_scene"
        self._node, self._touch = node, touch_links
        self._client = node.create_client(self._type, self._service, callback_group=node.beside)

    def put(self, body: InertialParameters) -> None:
        """Attach it in place of what was attached under its name; a mass of 0 takes that off.

        Raises:
            SinkError: MoveIt is not there, or refused.
        """
        attached = self._attached(link_name=body.frame or "", weight=body.mass, touch_links=self._touch)
        thing = attached.object
        thing.header.frame_id, thing.id = body.frame or "", OBJECT
        thing.operation = thing.ADD if body.mass > 0.0 else thing.REMOVE
        if body.mass > 0.0:
            pose = self._pose()
            pose.position.x, pose.position.y, pose.position.z = body.com.tolist()
            pose.orientation.w = 1.0
            thing.primitives = [self._solid(type=self._solid.SPHERE, dimensions=[radius(body.mass)])]
            thing.primitive_poses = [pose]
        request = self._type.Request()
        request.scene.is_diff = request.scene.robot_state.is_diff = True
        request.scene.robot_state.attached_collision_objects = [attached]
        _call(self._client, self._service, request)

    def close(self) -> None:
        """No more calls."""
        self._node.destroy_client(self._client)


def franka_request(request: Any, body: InertialParameters) -> None:
    """franka_msgs/SetLoad: about the flange, inertia about the centre of mass, column by column."""
    request.mass, request.center_of_mass, request.load_inertia = franka_load(body)


def ur_request(request: Any, body: InertialParameters) -> None:
    """ur_msgs/SetPayload: of older drivers mass and centre of gravity, of newer ones inertia and a transition, too."""
    mass, (x, y, z), inertia = ur_payload(body)
    request.mass = mass
    request.center_of_gravity.x, request.center_of_gravity.y, request.center_of_gravity.z = x, y, z
    if hasattr(request, "ixx"):
        for name, value in zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), inertia, strict=True):
            setattr(request, name, value)
    if hasattr(request, "transition_time"):
        request.transition_time.nanosec = round(PAUSE * 1e9)


KINDS: dict[str, tuple[str, str, str, Fill]] = {
    "franka_ros2": ("franka_msgs", "SetLoad", "service_server/set_load", franka_request),
    "ur_robot_driver": ("ur_msgs", "SetPayload", "io_and_status_controller/set_payload", ur_request),
}


def _imported(package: str, where: str, name: str) -> Any:
    try:
        return getattr(import_module(f"{package}.{where}"), name)
    except ImportError as error:
        raise SinkError(f"{package} is not installed: its {name} is what is called") from error


def _call(client: Any, service: str, request: Any) -> None:
    """Call from a thread that does not spin, and wait for the answer."""
    if not client.wait_for_service(_PATIENCE):
        raise SinkError(f"nobody offers the service {service}: see that the driver runs, in this node's namespace")
    answered = threading.Event()
    future = client.call_async(request)
    future.add_done_callback(lambda _: answered.set())
    if not answered.wait(_PATIENCE):
        client.remove_pending_request(future)
        raise SentError(
            f"the service {service} does not answer within {_PATIENCE:g} s, and may have taken the load: see that the "
            "driver runs, and apply it again"
        )
    response = future.result()
    if not response.success:
        why = getattr(response, "error", "")
        raise SinkError(f"the service {service} refused the load: " + (why or "see the driver's log"))

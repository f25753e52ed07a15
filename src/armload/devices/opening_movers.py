"""Arms that can be moved, by name."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from armload.arms import Arm
from armload.devices.mover import Mover
from armload.devices.opening import SCHEMES, address_of, written
from armload.devices.remote_mover import DetachedMover, RemoteMover
from armload.devices.ros2.mover import CONTROLLER, Ros2Mover
from armload.devices.simulator.mover import SimulatedMover
from armload.errors import SourceError
from armload.simulation import Sensors, World


def open_mover(
    spec: str,
    arm: Arm,
    *,
    at: ArrayLike | None = None,
    payload: Any | None = None,
    mounted: Any | None = None,
    world: World | None = None,
    speed: float | None = 1.0,
    rate: float = 1000.0,
    seed: int = 0,
) -> Mover:
    """Open a robot or the simulator to move it; opening moves nothing.

    | spec | what |
    |---|---|
    | `sim` | the simulator |
    | `ur://ADDRESS`, `ur://ADDRESS?torque_constants=12,12,10,11,11,11` | a UR arm |
    | `fr3://ADDRESS`, `panda://ADDRESS` | a Franka robot |
    | `ros2:///joint_states?controller=/NAME` | a ROS 2 controller (default `/joint_trajectory_controller`) |

    Args:
        spec: see the table.
        arm: which it is.
        at, payload, mounted, world, speed, rate, seed: of the simulator, with its arm's sensors (`SimulatedMover`).

    Raises:
        SourceError: no such arm, it cannot be reached, or its client is not installed.
    """
    if spec == "sim":
        if at is None:
            raise SourceError("the simulator stands nowhere: give at=…, a pose")
        sensors = Sensors.of(arm)
        return SimulatedMover(
            arm, at, payload, mounted, world=world, sensors=sensors, rate=rate, speed=speed, seed=seed
        )
    scheme = spec.partition("://")[0].lower()
    if scheme not in SCHEMES:
        raise SourceError(f"{spec} cannot be moved: expected sim, {', '.join(map(written, SCHEMES))}")
    if scheme == "ros2":
        address = address_of(spec)
        return Ros2Mover(address.host, arm, address.controller or CONTROLLER, address.effort(arm))
    return DetachedMover(spec, arm)


def moved_here(spec: str, arm: Arm) -> RemoteMover:
    """A robot's mover in this process, as the reader's process has it."""
    address = address_of(spec)
    if address.scheme == "ur":
        from armload.devices.ur.mover import URMover

        return RemoteMover(URMover(address.host, arm, address.torque_constants))
    from armload.devices.franka.mover import FrankaMover

    return RemoteMover(FrankaMover(address.host, arm, address.scheme))

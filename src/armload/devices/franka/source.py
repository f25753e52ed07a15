"""Franka robots through libfranka: FR3 (`pylibfranka`, the maker's) and Panda (`panda-python`, with libfranka 0.9).

Both clients have the same names, and both hold the interpreter while they wait for a state: read them in a process of
their own (`Detached`, which `open_source` does). `RealtimeConfig.kIgnore` needs no real-time kernel: nothing is
controlled here. The torque is `tau_J`, the sensors behind the gears: rigid body and friction, gravity included,
whatever load is set in the controller. The time is the robot's own, in milliseconds since it was switched on: gaps
are lost packets.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from armload.arms import Arm
from armload.devices.source import Source
from armload.errors import SourceError, SourceSetupError, one_line
from armload.recording import Sample
from armload.runtime.extras import install


class _System(NamedTuple):
    called: str
    module: str
    package: str
    other: str


SYSTEMS = {
    "fr3": _System("FR3", "pylibfranka", "pylibfranka", "a Panda is panda://ADDRESS"),
    "panda": _System("Panda", "panda_py.libfranka", "panda-python", "an FR3 is fr3://ADDRESS"),
}


class FrankaStatus(NamedTuple):
    """State of the robot: velocity (n,) [rad/s], masses set for the end effector and the load [kg].

    com_load, inertia_load: of the load, in the flange frame (3,) [m], about itself (9,) column by column [kg·m²].
    """

    dq: list[float]
    m_ee: float
    m_load: float
    com_load: list[float]
    inertia_load: list[float]


class FrankaSource(Source):
    """A Franka robot at 1 kHz; the robot takes one connection at a time.

    An address that does not answer holds up the client for a minute or longer: `Detached` waits less.

    Args:
        address: host name or IP address of the robot.
        arm: an arm of 7 joints.
        system: "fr3" or "panda".
        realtime: leave this thread the real-time priority that the FR3's client gives it where it may. Only commands
            need it: a busy thread that it starts would inherit it, and let nothing else run.

    Attributes:
        robot: the maker's client.

    Raises:
        SourceError: the client is not installed, or the robot cannot be reached.
    """

    rate = 1000.0

    def __init__(self, address: str, arm: Arm, system: str = "fr3", *, realtime: bool = False) -> None:
        facts = SYSTEMS[system]
        if arm.n != 7:
            raise SourceSetupError(
                f"{arm.name} has {arm.n} joints: {facts.called} robots have 7; name the arm that is there"
            )
        self.name, self.n = f"{system}://{address}", arm.n
        self._closed = False
        self._arrived: float | None = None
        client = load_client(system)
        try:
            with contextlib.nullcontext() if realtime else _priority_kept():
                self.robot: Any = client.Robot(address, client.RealtimeConfig.kIgnore)
        except Exception as error:  # the maker's errors have no common base in Python
            raise SourceError(unreachable(address, one_line(error), system)) from None

    def __iter__(self) -> Iterator[Sample]:
        while not self._closed:
            state = self.state()
            self._arrived = time.monotonic()  # the client drops all but the newest state
            yield Sample(state.time.to_sec(), np.array(state.q), np.array(state.dq), np.array(state.tau_J))

    def close(self) -> None:
        """Let go of the robot."""
        self._closed = True
        self.robot = None

    def arrived(self) -> float | None:
        """When the client had the state handed on last."""
        return self._arrived

    def read_once(self) -> FrankaStatus:
        """The robot's present velocity and what it counts with."""
        state = self.state()
        dq, com, inertia = ([float(x) for x in np.ravel(y)] for y in (state.dq, state.F_x_Cload, state.I_load))
        return FrankaStatus(dq, float(state.m_ee), float(state.m_load), com, inertia)

    def set_load(self, mass: float, com: ArrayLike, inertia: ArrayLike) -> None:
        """Tell the robot what it holds, over this connection; only at rest. `armload.devices` asks before it writes.

        Args:
            mass: [kg].
            com: centre of mass (3,) in the flange frame [m].
            inertia: about the centre of mass in the flange's axes, 9 numbers column by column [kg·m²].

        Raises:
            SourceError: the robot refused it.
        """
        try:
            self._robot().set_load(float(mass), np.ravel(com).tolist(), np.ravel(inertia).tolist())
        except Exception as error:
            raise SourceError(f"{self.name} refused the load: {one_line(error)}") from None

    def _robot(self) -> Any:
        robot = self.robot  # may be let go by another thread
        if robot is None:
            raise SourceError(f"{self.name} is closed: open it again")
        return robot

    def state(self) -> Any:
        """The newest state, in the client's own form."""
        robot = self._robot()
        try:
            return robot.read_once()
        except Exception as error:
            raise SourceError(
                f"{self.name} was lost ({one_line(error)}): see that the robot is switched on, its cable is in, and "
                "FCI is activated in Desk"
            ) from None


@contextlib.contextmanager
def _priority_kept() -> Iterator[None]:
    """Let this thread be scheduled afterwards as it was before."""
    if not hasattr(os, "sched_getscheduler"):
        yield
        return
    before, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        if os.sched_getscheduler(0) != before:
            os.sched_setscheduler(0, before, parameters)


def load_client(system: str) -> Any:
    """The maker's client for "fr3" or "panda".

    Raises:
        SourceSetupError: it is not installed.
    """
    facts = SYSTEMS[system]
    try:
        return importlib.import_module(facts.module)
    except ImportError as error:
        raise SourceSetupError(
            f"{facts.called} robots are read through {facts.package}, which cannot be imported ({error}): "
            f"{install(facts.module)}"
        ) from None


def unreachable(address: str, why: str, system: str) -> str:
    """What to say of a robot that cannot be connected to."""
    facts = SYSTEMS[system]
    return (
        f"the {facts.called} at {address} cannot be reached ({why}): check its address, that its joints are unlocked "
        f"and FCI is activated in Desk, and that no other client is connected; {facts.other}"
    )

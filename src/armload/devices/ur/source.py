"""Universal Robots arms through `ur-rtde`: joint positions, velocities and motor currents, 500 times a second.

A UR has no torque sensors in its joints. What there is, and what is made of it:

- `actual_current` [A] is measured. Times a constant per joint (motor constant times gear ratio [N·m/A]) it is the
  torque on the motor's side of the gear, with the gear's friction in it: what this source gives. Expect percent, not
  grams, and always take a tare. The constants differ between models and are not published by the maker.
- `target_moment` is what the controller's model expects for the payload that is set: it does not measure the real one.
- `actual_current_as_torque` (PolyScope 5.23 and later) has gravity taken out already, by the maintainers of the ROS 2
  driver's account (pull request 1551 of Universal_Robots_ROS2_Driver), with the payload that is set; ur-rtde 1.6 does
  not read it. That driver publishes it as effort unless `use_currents_as_efforts` is set.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from armload.arms import ARMS, Arm
from armload.devices.source import Source
from armload.errors import SourceError, SourceSetupError, one_line
from armload.recording import Sample
from armload.runtime.extras import install

_FIELDS = ["timestamp", "actual_q", "actual_qd", "actual_current"]
_LOOK = 2e-4  # [s] between two looks for the next sample
_SILENCE = 1.0  # [s] after which the arm counts as lost
_SEE = "see that the robot is switched on, its cable is in, and RTDE is enabled in its security settings"


class URSource(Source):
    """A UR arm of the e-series.

    An address that does not answer holds up the client for minutes: `Detached` waits less.

    Args:
        address: host name or IP address of the robot.
        arm: an arm of 6 joints.
        torque_constants: joint torque per motor current (6,) [N·m/A]; None: those known for this arm.
        fields: what else `client` is to receive.

    Attributes:
        client: the maker's.

    Raises:
        SourceError: ur-rtde is not installed, the constants are not known, or the robot cannot be reached.
    """

    def __init__(
        self, address: str, arm: Arm, torque_constants: Sequence[float] | None = None, fields: Sequence[str] = ()
    ) -> None:
        self.name, self.n = f"ur://{address}", arm.n
        if arm.n != 6:
            raise SourceSetupError(f"{arm.name} has {arm.n} joints: a UR arm has 6; name the arm that is there")
        if torque_constants is None:
            facts = ARMS.get(arm.known_as or arm.name)
            torque_constants = None if facts is None else facts.torque_constants
        if torque_constants is None:
            raise SourceSetupError(
                f"{arm.name} measures motor currents, and no torque constants are known for it: give six numbers in "
                "N·m/A (torque_constants), from a scale test with a known load"
            )
        self._constants = np.array(torque_constants, dtype=float)
        if self._constants.shape != (6,) or not np.all(np.isfinite(self._constants)):
            raise SourceSetupError(
                f"torque constants are {list(torque_constants)}: expected six finite numbers in N·m/A"
            )
        self._arrived: float | None = None
        self._stop = threading.Event()
        client = load_client()
        try:
            self.client = client(address, -1.0, [*_FIELDS, *fields])  # −1: the fastest the controller has
        except Exception as error:
            raise SourceError(unreachable(address, one_line(error))) from None
        self.rate = 500.0

    def __iter__(self) -> Iterator[Sample]:
        client, last, heard = self.client, None, time.monotonic()
        looked = heard
        while not self._stop.is_set():
            t, before, looked = client.getTimestamp(), looked, time.monotonic()
            if t == last:
                if looked - before > _SILENCE:  # nobody looked: this process did not run, and neither did the client
                    heard = looked
                silent = looked - heard
                if not client.isConnected():
                    raise SourceError(f"{self.name} was lost: it closed the connection; {_SEE}")
                if silent > _SILENCE:
                    raise SourceError(f"{self.name} was lost: no sample for {silent:.1f} s; {_SEE}")
                self._stop.wait(_LOOK)
                continue
            heard = looked
            q, dq, current = client.getActualQ(), client.getActualQd(), client.getActualCurrent()
            if client.getTimestamp() != t:
                continue  # the next packet came in between: the values may be of either
            last, self._arrived = t, heard
            yield Sample(float(t), np.array(q), np.array(dq), self._constants * current)

    def arrived(self) -> float | None:
        """When the client had the values handed on last."""
        return self._arrived

    def close(self) -> None:
        """Let go of the robot."""
        if not self._stop.is_set():
            self._stop.set()
            self.client.disconnect()


def load_client() -> Any:
    """The receiving side of ur-rtde.

    Raises:
        SourceSetupError: it is not installed.
    """
    try:
        from rtde_receive import RTDEReceiveInterface  # type: ignore[import-not-found]
    except ImportError as error:
        raise SourceSetupError(
            f"a UR arm is read through ur-rtde, which cannot be imported ({error}): {install('rtde_receive')}"
        ) from None
    return RTDEReceiveInterface


def load_control() -> Any:
    """The commanding side of ur-rtde.

    Raises:
        SourceSetupError: it is not installed.
    """
    try:
        from rtde_control import RTDEControlInterface  # type: ignore[import-not-found]
    except ImportError as error:
        raise SourceSetupError(
            f"a UR arm is moved through ur-rtde, which cannot be imported ({error}): {install('rtde_control')}"
        ) from None
    return RTDEControlInterface


def unreachable(address: str, why: str) -> str:
    """What to say of a robot that cannot be connected to."""
    return (
        f"the UR arm at {address} cannot be reached ({why}): check its address, that it is switched on, and that RTDE "
        "is enabled in its security settings"
    )

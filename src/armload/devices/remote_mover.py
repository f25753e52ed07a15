"""A mover in a process of its own: what goes to and fro between the two.

The process that streams commands to the arm must not wait for one that identifies, prints or compiles; and the arm must
come to rest when that one ends, however it does. So the mover runs in the reader's process (`devices.reader_process`),
gets each movement as a whole, watches it (`Supervision`) and stops it there. `DetachedMover` is how it looks from
outside.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.devices.detached import Detached, Refused
from armload.devices.load import Load
from armload.devices.mover import Mover, check_start
from armload.devices.source import Source
from armload.devices.supervision import Thresholds
from armload.errors import SafetyError, SentError, SinkError, SourceError
from armload.inertia import InertialParameters
from armload.motion import Motion, PathMotion
from armload.recording import Sample

_TABLE = 250.0  # [Hz] of the points that a movement is handed over with: quintics between them are off by 1e-9 rad
_COLUMNS = ("times", "positions", "velocities", "accelerations")


class RemoteMover(Source):
    """A mover inside the process: its orders as JSON has them.

    Args:
        mover: closed with this one.

    Attributes:
        ended: how many movements have ended. over: set when no sample will follow.
    """

    def __init__(self, mover: Mover) -> None:
        self.mover, self.name, self.n, self.rate = mover, mover.name, mover.n, mover.rate
        self.ended, self._begun, self._stopped = 0, 0, False
        self.over = threading.Event()

    def __iter__(self) -> Iterator[Sample]:
        try:
            for sample in self.mover:
                self.ended = self._begun - self.mover.moving
                yield sample
        finally:
            self.over.set()

    def begin(self, motion: dict[str, Any], thresholds: dict[str, Any]) -> int:
        """`Mover.follow`; the movement's number."""
        self.mover.follow(PathMotion(**motion), Thresholds(**thresholds))
        self._begun += 1
        return self._begun

    def stop(self, why: str) -> None:
        """`Mover.stop`."""
        self.mover.stop(why)

    def whereabouts(self) -> dict[str, Any]:
        """Where the arm is commanded to be, why it stopped, what to look at, what hinders it, if it takes loads."""
        mover = self.mover
        said = {"why": mover.why, "see": mover.see, "hindrance": mover.hindrance(), "writes": mover.writes}
        return said | {"commanded": mover.commanded().tolist()}

    def put(self, load: dict[str, Any], allow_undetermined_inertia: bool) -> Any:
        """`Mover.write`."""
        parameters = InertialParameters(np.array(load.pop("phi")), load.pop("frame"))
        std = load.pop("std")
        found = Load(parameters, std=None if std is None else np.array(std), **load)
        return self.mover.write(found, allow_undetermined_inertia=allow_undetermined_inertia)

    def comes_to_rest(self) -> bool:
        """Stop, told once; whether the arm still moves."""
        if not self._stopped:
            self._stopped = True
            self.mover.stop("whoever moved the arm has ended")
        return self.mover.moving

    def arrived(self) -> float | None:
        """The mover's."""
        return self.mover.arrived()

    def close(self) -> None:
        """Close the mover."""
        self.mover.close()


class DetachedMover(Detached, Mover):
    """Any mover of `open_mover`, in another process.

    Args:
        spec, arm, capacity, options: see `Detached`; no record is written there.

    Raises:
        SourceError: the arm cannot be reached; the message is the process's.
    """

    _moves = True

    def __init__(self, spec: str, arm: Arm, *, capacity: int = 8192, **options: Any) -> None:
        self.arm = arm
        self._begun = self._ended = 0
        self._stopping = False  # once is enough: each order is answered through a pipe
        super().__init__(spec, arm, capacity=capacity, **options)
        self.writes = True  # those that are read in a process of their own have a controller that does

    @property
    def moving(self) -> bool:
        """Whether a movement is under way, as of the last sample."""
        return self._ended < self._begun

    @property
    def why(self) -> str | None:  # type: ignore[override]
        """Why the last movement was stopped before its end."""
        return self._call("whereabouts")["why"]

    @property
    def see(self) -> str:  # type: ignore[override]
        """What to look at where the arm does not follow."""
        return self._call("whereabouts")["see"]

    def hindrance(self) -> str | None:
        """Why the arm would not follow a movement now."""
        return self._call("whereabouts")["hindrance"]

    def commanded(self) -> NDArray[np.float64]:
        """Where the controller holds the arm, q (n,) [rad]."""
        return np.array(self._call("whereabouts")["commanded"])

    def follow(self, motion: Motion, thresholds: Thresholds | None = None) -> None:
        """Begin a movement."""
        check_start(self, motion)
        table = PathMotion.of(motion, _TABLE)
        numbers = {key: np.asarray(getattr(table, key)).tolist() for key in _COLUMNS}
        try:
            self._begun = self._call("begin", numbers | {"name": motion.name}, asdict(thresholds or Thresholds()))
        except SourceError as error:
            raise SafetyError(str(error)) from None
        self._stopping = False

    def stop(self, why: str) -> None:
        """Let the arm come to rest."""
        if self.moving and not self._stopping:
            self._stopping = True
            self._calls += 1
            self._spawned.send({"call": "stop", "number": self._calls, "arguments": [why]}, self.name)

    def write(self, load: Load, *, allow_undetermined_inertia: bool = False) -> Any:
        """Tell the controller the load, guarded, and return what was sent."""
        content = {
            "phi": load.parameters.phi.tolist(),
            "frame": load.parameters.frame,
            "determined": load.determined,
            "robot": load.robot,
            "relative_to": load.relative_to,
            "std": None if load.std is None else load.std.tolist(),
        }
        if self.process.poll() is not None:
            raise SinkError(f"{self.name} was lost before: see that the robot is on and connected")
        try:
            return self._call("put", content, allow_undetermined_inertia)
        except Refused as error:
            raise (SentError if error.sent else SinkError)(str(error)) from None
        except SourceError as error:  # nobody can say how far it came
            raise SentError(
                f"whether the payload was written is not known ({error}): see on the robot's pendant or in Desk which "
                "one it counts"
            ) from None

    def _note(self, beside: NDArray[np.float64]) -> None:
        super()._note(beside)
        self._ended = int(beside[1])

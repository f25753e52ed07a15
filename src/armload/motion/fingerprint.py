"""The fingerprint of a motion: enough of q(t) to tell whether a log shows this motion or another."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import MotionError
from armload.motion.motion import Motion
from armload.recording import Recording

_RATE = 50.0  # [Hz] of the table
_SHORTEST = 0.05  # [s] a shorter log says nothing about its motion
_LONGEST = 1.10  # a log may last this much of the motion: waiting a moment at the end is the same motion


@dataclass(frozen=True, eq=False)
class MotionFingerprint:
    """q(t) of a motion in a table of 50 Hz and its SHA-256, as a learned model keeps it to refuse other motions.

    >>> from armload.motion import taie2024
    >>> mark = MotionFingerprint.of(taie2024())
    >>> mark.q.shape, mark == MotionFingerprint.from_dict(mark.to_dict())
    ((301, 7), True)

    Args:
        name: the motion's name.
        duration: [s].
        q: (N, n) joint positions [rad] at N evenly spaced times from 0 to `duration`.

    Raises:
        MotionError: the table is too short, not two-dimensional or not finite, or the duration is not positive.
    """

    name: str
    duration: float
    q: NDArray[np.float64] = field(repr=False)

    def __post_init__(self) -> None:
        q = np.round(np.array(self.q, dtype=float), 6) + 0.0  # a µrad is far below any robot's; −0 becomes 0
        if q.ndim != 2 or len(q) < 2 or not np.all(np.isfinite(q)):
            raise MotionError(
                f"fingerprint of {self.name!r} has a table of shape {q.shape}: expected (N ≥ 2, n), finite"
            )
        if not (np.isfinite(self.duration) and self.duration > 0):
            raise MotionError(
                f"fingerprint of {self.name!r} has duration {self.duration}: expected a positive time in s"
            )
        q.setflags(write=False)
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "duration", float(self.duration))

    @classmethod
    def of(cls, motion: Motion) -> MotionFingerprint:
        """The fingerprint of a motion."""
        t = motion.instants(_RATE)
        return cls(motion.name, motion.duration, motion(t)[0])

    @property
    def sha256(self) -> str:
        """SHA-256 of the duration and the table, in µs and µrad as 64-bit integers; the name does not enter."""
        digest = hashlib.sha256(np.array([round(self.duration * 1e6), *self.q.shape], dtype="<i8").tobytes())
        digest.update(np.round(self.q * 1e6).astype("<i8").tobytes())
        return digest.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MotionFingerprint) and self.sha256 == other.sha256

    def __hash__(self) -> int:
        return hash(self.sha256)

    def distance(self, recording: Recording) -> float:
        """Root mean square deviation of the log's joints from the motion [rad], over the time both last.

        The log's time is counted from its first sample. Infinite if it has another number of joints.
        """
        t = recording.t - recording.t[0]
        if recording.q.shape[1] != self.q.shape[1]:
            return float("inf")
        inside = t <= self.duration
        times = np.linspace(0.0, self.duration, len(self.q))
        expected = np.stack([np.interp(t[inside], times, column) for column in self.q.T], axis=1)
        return float(np.sqrt(np.mean((recording.q[inside] - expected) ** 2)))

    def matches(self, recording: Recording, tolerance: float = 0.1) -> bool:
        """Whether the log shows this motion from its start: `distance` within `tolerance` [rad], and no longer than it.

        A log of less than 50 ms, or more than 10 % longer than the motion, never matches.
        """
        lasts = float(recording.t[-1] - recording.t[0])
        return _SHORTEST <= lasts <= _LONGEST * self.duration and self.distance(recording) <= tolerance

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and strings for JSON, the SHA-256 with them."""
        return {"name": self.name, "duration": self.duration, "sha256": self.sha256, "q": self.q.tolist()}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> MotionFingerprint:
        """The fingerprint `to_dict` wrote.

        Raises:
            MotionError: a key is missing, or the table does not give the SHA-256 written with it.
        """
        try:
            mark = cls(str(content["name"]), float(content["duration"]), content["q"])
            expected = str(content["sha256"])
        except MotionError:
            raise
        except KeyError as error:
            raise MotionError(f"the motion fingerprint is incomplete: the key {error} is missing") from None
        except (TypeError, ValueError):
            raise MotionError("the motion fingerprint is damaged: expected a duration and n numbers per row") from None
        if mark.sha256 != expected:
            raise MotionError(
                f"the motion fingerprint of {mark.name!r} is damaged: its table does not match its SHA-256"
            )
        return mark

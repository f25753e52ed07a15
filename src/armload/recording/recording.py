"""One `Recording`: time, joint position, velocity and torque of one arm, SI units, one row per sample."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import RecordingError, one_line
from armload.runtime.real_numbers import reals

if TYPE_CHECKING:
    from armload.arms import Arm

# What a torque column can mean; "measured" is the contract: rigid body + friction, gravity included.
CHANNELS = ("measured", "desired", "external")
# [s] since 1970 from which a log's clock is taken for the time of day, and not for the time since something began:
# September 2001; and up to which: a time after the year 9999, which `datetime` cannot say, is of a clock that is wrong
_CLOCK, _LAST = 1e9, 253_402_300_800.0
GAP = 0.1  # [s] a longer pause between samples ends whatever has a memory of those before it
_MANY = 1 << 18  # samples whose steps say the rate of a longer log: known to 0.3 % of their spread
BLOCK = 4096  # samples that are worked on at a time: bounds the memory of what is made of them
JITTERED = 0.9  # of a rate's sample time, after which the next sample of that rate is due: clocks jitter


def is_time_of_day(seconds: float) -> bool:
    """Whether a clock that shows so much [s since 1970] shows the time of day, not the time since something began."""
    return _CLOCK < seconds < _LAST


class Sample(NamedTuple):
    """One instant of a robot: what every stream identifier takes."""

    t: float  # [s]
    q: NDArray[np.float64]  # (n,) [rad]
    dq: NDArray[np.float64]  # (n,) [rad/s]
    tau: NDArray[np.float64]  # (n,) [N·m]


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Joint position, velocity and torque over time.

    >>> log = Recording(np.arange(3) * 0.1, np.zeros((3, 2)), np.zeros((3, 2)), np.ones((3, 2)))
    >>> len(log), log.n, round(log.duration, 3), round(log.rate, 3)
    (3, 2, 0.2, 10.0)

    Args:
        t: time (N,) [s], strictly increasing, not necessarily even.
        q, dq, tau: (N, n) [rad, rad/s, N·m].
        channel: what tau is; "measured" (rigid body + friction, gravity included), "desired" or "external".
        joint_names: names of the columns, where the source has them; None: they are only counted, in whatever order.
        source: where it comes from (a path), for messages and provenance.
        notes: what a reader did to the log that its user should know (rows dropped, say), one sentence each.
        epoch: time since 1970 at t = 0 [s], finite, where the source has stamps that t is counted from; else 0.
        gravity_of: the arm, with what its controller was set to carry, whose gravity was put back into tau
            (`with_gravity`); None: tau is as the source has it.

    Raises:
        RecordingError: no numbers, wrong shapes, a number that is not finite, times out of order; the message names row
            and column (rows counted from 0, as in the arrays).
    """

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    dq: NDArray[np.float64]
    tau: NDArray[np.float64]
    channel: str = "measured"
    joint_names: tuple[str, ...] | None = None
    source: str = "recording"
    notes: tuple[str, ...] = ()
    epoch: float = 0.0
    gravity_of: Arm | None = None

    def __post_init__(self) -> None:
        for name in ("t", "q", "dq", "tau"):
            value = _numbers(getattr(self, name), f"{self.source}: {name}")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        try:
            epoch = float(self.epoch)
        except (TypeError, ValueError, OverflowError):
            epoch = np.nan
        if not np.isfinite(epoch) or isinstance(self.notes, str):
            raise RecordingError(
                f"{self.source}: the epoch is {self.epoch!r} and the notes are {self.notes!r}: expected finite seconds "
                "since 1970, and a tuple of sentences"
            )
        object.__setattr__(self, "notes", tuple(self.notes))
        if self.channel not in CHANNELS:
            raise RecordingError(f"unknown torque channel {self.channel!r}: expected one of {', '.join(CHANNELS)}")
        if self.t.ndim != 1 or self.q.ndim != 2:
            raise RecordingError(f"{self.source}: t must be (N,) and q (N, n), found {self.t.shape} and {self.q.shape}")
        for name in ("q", "dq", "tau"):
            value = getattr(self, name)
            if value.shape != (len(self.t), self.q.shape[1]):
                raise RecordingError(
                    f"{self.source}: {name} has shape {value.shape}, expected {(len(self.t), self.q.shape[1])}"
                )
        if self.n == 0:
            raise RecordingError(f"{self.source}: q has shape {self.q.shape}: expected at least one joint")
        if self.joint_names is not None:
            if isinstance(self.joint_names, str) or np.ndim(self.joint_names) != 1 or len(self.joint_names) != self.n:
                raise RecordingError(
                    f"{self.source}: the joint names are {self.joint_names!r}: expected one for each of {self.n} joints"
                )
            object.__setattr__(self, "joint_names", tuple(self.joint_names))
        if len(self.t) < 2:
            raise RecordingError(f"{self.source} holds {len(self.t)} sample(s): expected at least 2")
        for name in ("t", "q", "dq", "tau"):
            bad = np.argwhere(~np.isfinite(getattr(self, name)))
            if len(bad):
                row, column = bad[0][0], name + (str(bad[0][1] + 1) if name != "t" else "")
                raise RecordingError(f"{self.source}: {column} at row {row} is not a finite number")
        late = np.flatnonzero(self.t[1:] <= self.t[:-1])
        if len(late):
            k = int(late[0])
            back = self.t[k + 1] < self.t[k]
            do = "sort it, or cut it where its clock was set" if back else "drop repeated rows, or keep more digits"
            raise RecordingError(
                f"{self.source}: time goes from {self.t[k]:.6f} s to {self.t[k + 1]:.6f} s at row {k + 1}: expected "
                f"strictly increasing times; {do}"
            )

    def __repr__(self) -> str:
        return (
            f"<Recording: {self.source}, {self.n} joints, {len(self)} samples, {self.duration:.2f} s, "
            f"{self.rate:.4g} Hz, {self.channel} torque>"
        )

    def _repr_html_(self) -> str:
        """A small table for notebooks: range of each joint's position, velocity and torque."""
        names = self.joint_names or [str(j + 1) for j in range(self.n)]
        heads = ("joint", "q [rad]", "dq [rad/s]", "tau [N·m]")
        rows = ["".join(f"<th>{head}</th>" for head in heads)]
        for j, name in enumerate(names):
            spans = (f"{x[:, j].min():.3g} … {x[:, j].max():.3g}" for x in (self.q, self.dq, self.tau))
            rows.append("".join(f"<td>{escape(str(cell))}</td>" for cell in (name, *spans)))
        caption = escape(repr(self).strip("<>"))
        return f"<table><caption>{caption}</caption>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[Sample]:
        """The samples, one by one, as a live robot would give them."""
        return (Sample(float(t), *row) for t, *row in zip(self.t, self.q, self.dq, self.tau, strict=True))

    @property
    def date(self) -> float | None:
        """Time of day of the first sample [s since 1970]; None: the clock counts from something else, or is wrong."""
        began = self.epoch + float(self.t[0])
        return began if is_time_of_day(began) else None

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.q.shape[1]

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def rate(self) -> float:
        """Median sample rate [Hz]; of a log of more than `_MANY` samples that of so many, spread over it."""
        if len(self) <= _MANY:
            return float(1.0 / np.median(np.diff(self.t), overwrite_input=True))
        rows = np.linspace(0, len(self) - 2, _MANY).astype(int)
        return float(1.0 / np.median(self.t[rows + 1] - self.t[rows], overwrite_input=True))

    def between(self, start: float, stop: float) -> Recording:
        """The samples with start ≤ t < stop [s], on the recording's own clock."""
        return self.select(slice(*np.searchsorted(self.t, [start, stop]).tolist()))

    def with_velocities(self, parts: Iterable[NDArray[np.float64]]) -> Recording:
        """The same with other velocities dq (N, n), given in parts that follow each other."""
        return replace(self, dq=np.concatenate(list(parts)))

    def select(self, rows: NDArray | slice) -> Recording:
        """The samples at the given rows (index array, mask or slice).

        Raises:
            RecordingError: rows that it does not have, fewer than two, or not in the order of time.
        """
        try:
            return replace(self, t=self.t[rows], q=self.q[rows], dq=self.dq[rows], tau=self.tau[rows])
        except IndexError as error:
            raise RecordingError(
                f"{self.source}: no such rows ({one_line(error)}): expected indices, a mask or a slice of its "
                f"{len(self)} samples"
            ) from None


def _numbers(values: ArrayLike, what: str) -> NDArray[np.float64]:
    """A copy of the values as floats: the caller's stays writable.

    Raises:
        RecordingError: they are no numbers.
    """
    try:
        return np.array(reals(values), order="C")
    except ValueError as error:
        raise RecordingError(
            f"{what} is {error}: expected real numbers, as many in each row and none masked; of dates the seconds "
            "since the first, (dates - dates[0]) / np.timedelta64(1, 's')"
        ) from None

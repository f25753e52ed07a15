"""From any table with a header to a Recording: what CSV, Parquet, NPZ, HDF5 and MATLAB have in common."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import EpisodesError, NoEpisodesError, RecordingError
from armload.recording.aliases import EPISODE, QUANTITIES, TIME_UNITS
from armload.recording.choice import DATE, TimeColumns
from armload.recording.column_spec import ColumnSpec
from armload.recording.columns import checked_recording
from armload.recording.currents import of_currents
from armload.recording.mapping import ColumnMap, map_columns
from armload.recording.recording import GAP, Recording
from armload.recording.rows_as_chunks import Chunks
from armload.recording.steadied import with_velocities_of_positions
from armload.recording.torque_constants import controller_constants


class Table(Protocol):
    """A file of rows and named columns."""

    names: Sequence[str]

    @property
    def dates(self) -> Sequence[int]:
        """Places of the columns that hold dates."""
        ...

    @property
    def notes(self) -> Sequence[str]:
        """What its reader did to it, complete once the numbers are read."""
        ...

    def numbers(self, places: Sequence[int]) -> NDArray[np.float64]:
        """The columns at these places (N, k); dates as nanoseconds since 1970."""
        ...

    def whole_numbers(self, place: int) -> NDArray[np.int64] | None:
        """A column of whole numbers (N,), exactly, or of dates [ns since 1970]; None: they are not whole."""
        ...

    def text(self, place: int) -> str | None:
        """The one text that a column holds in all rows; None: numbers, or several texts."""
        ...

    def row_name(self, row: int) -> str:
        """What to call a row in a message."""
        ...


class NotInPieces(RecordingError):
    """A table that must be read whole: to name what is wrong with it, or because one row depends on all."""


def read_table(table: Table, where: str, arm: Arm | None, spec: ColumnSpec, channel: str = "measured") -> Recording:
    """The log in a table.

    Args:
        table: the open file.
        where, arm, spec: as in `map_columns`.
        channel: what its torque is.

    Raises:
        RecordingError: the columns are not clear, or a row is not valid.
    """
    columns: ColumnMap = map_columns(table.names, where, arm, spec, table.text, table.dates)
    reading = _Reading(columns, where, spec)
    motion, rows = reading.values(table)
    notes = columns.notes
    if columns.wanted is not None:
        n = len(columns.wanted[0])
        moment, current = (table.numbers(at)[rows] for at in columns.wanted)
        constants = controller_constants(moment, current, motion[:, 1 + n : 1 + 2 * n], where)
        motion[:, 1 + 2 * n :] *= constants
        notes = (
            *notes,
            of_currents(where, constants.tolist(), " (the controller's own target_moment over target_current)"),
        )
    recording = checked_recording(
        motion,
        where,
        lambda k: table.row_name(int(rows[k])),
        labels=reading.labels(table),
        channel=channel,
        joint_names=columns.joints,
        notes=(*table.notes, *notes),
        epoch=reading.epoch,
    )
    return recording if columns.places["dq"] else with_velocities_of_positions(recording)


def table_chunks(
    pieces: Iterable[Table], where: str, arm: Arm | None, spec: ColumnSpec, channel: str = "measured"
) -> Iterator[Recording]:
    """The log in a table that comes in pieces, each with its own rows and the same columns.

    Raises:
        NotInPieces: the log must be read whole. RecordingError: it would be refused then, too.
    """
    columns: ColumnMap | None = None
    reading: _Reading | None = None
    chunks: Chunks | None = None
    names, dates, notes = [], [], []
    for table in pieces:
        if columns is None or reading is None or chunks is None:
            columns = map_columns(table.names, where, arm, spec, _refuse_text, table.dates)
            if columns.wanted is not None:
                raise NotInPieces(f"{where}: torque per ampere is found from all rows")
            if not columns.places["dq"]:
                raise NotInPieces(f"{where}: velocities are told by the positions before and after")
            reading = _Reading(columns, where, spec, in_pieces=True)
            chunks = Chunks(where, channel, reading.labels(table))
            names, dates = list(table.names), list(table.dates)
        if list(table.names) != names or list(table.dates) != dates:
            raise NotInPieces(f"{where}: the columns change")
        motion, rows = reading.values(table)
        notes += table.notes
        name = table.row_name
        if len(motion):
            of_rows = lambda k, rows=rows, name=name: name(int(rows[k]))  # noqa: E731
            yield from chunks.take(motion, of_rows, columns.joints, reading.epoch)
    if columns is None or chunks is None:
        raise NotInPieces(f"{where} has no rows")
    yield chunks.last((*notes, *columns.notes))


def _refuse_text(_: int) -> str | None:
    raise NotInPieces("a column of names is the same in all rows, or is not")


class _Reading:
    """Rows of a table as t [s], q, dq, tau, one piece of it after the other."""

    def __init__(self, columns: ColumnMap, where: str, spec: ColumnSpec, in_pieces: bool = False) -> None:
        self._columns, self._where, self._spec, self._in_pieces = columns, where, spec, in_pieces
        self._places = [place for key in QUANTITIES for place in columns.places[key]]
        self._scales = np.array([scale for key in QUANTITIES for scale in columns.scales[key]])
        self._count = 0  # rows that were kept so far
        self._origin: int | None = None  # the first stamp, where times are counted from it
        self.epoch = 0.0

    def labels(self, table: Table) -> list[str]:
        """How to call the columns in a message."""
        time = self._columns.time
        names = [table.names[place] for place in self._places]
        n = len(self._columns.places["q"])
        if not self._columns.places["dq"]:
            names[n:n] = [f"dq{j}" for j in range(1, n + 1)]
        return ["t" if time is None else table.names[time.place], *names]

    def values(self, table: Table) -> tuple[NDArray, NDArray[np.intp]]:
        """The rows (N, 1 + 3n) of the episode asked for, and their places in the table."""
        columns, time, where, spec = self._columns, self._columns.time, self._where, self._spec
        extra = [] if time is None else [time.place]
        raw = table.numbers([*extra, *self._places, *([] if columns.episode is None else [columns.episode])])
        if columns.episode is not None:
            if self._in_pieces and len(np.unique(raw[:, -1])) > 1:
                raise NotInPieces(f"{where} holds several episodes")
            keep = _episode(raw[:, -1], spec, where)
        elif spec.episode is None:
            keep = np.ones(len(raw), dtype=bool)
        else:
            raise NoEpisodesError(f"{where} has no column {EPISODE!r}, and so no episodes: leave --episode out")
        rows = np.flatnonzero(keep)
        if time is None:
            assert spec.rate is not None
            t = np.maximum(self._count + np.cumsum(keep) - 1, 0) / spec.rate
        else:
            t = self._seconds(table, time, raw[:, 0])
        self._count += len(rows)
        motion = raw[:, len(extra) : len(extra) + len(self._places)] * self._scales
        if not columns.places["dq"]:
            q, tau = np.split(motion, 2, axis=1)
            motion = np.hstack([q, np.zeros_like(q), tau])
        return np.column_stack([t, motion])[rows], rows

    def _seconds(self, table: Table, time: TimeColumns, raw: NDArray[np.float64]) -> NDArray:
        if self._in_pieces and time.other is not None:
            raise NotInPieces(f"{self._where}: whether it is stamped shows in all rows together")
        t, stamps, scale = _seconds(table, time, raw, self._where)
        if stamps is None:
            return t
        if self._origin is None and len(stamps):
            self._origin = int(stamps[0])
            self.epoch = float(stamps[0] * scale)
        return (stamps - (self._origin or 0)) * scale


def _seconds(
    table: Table, time: TimeColumns, raw: NDArray[np.float64], where: str
) -> tuple[NDArray, NDArray[np.int64] | None, float]:
    """The times (N,) [s]; or stamps (N,) and their unit [s], from which times are counted.

    Stamps in nanoseconds are subtracted as whole numbers first: since 1970 a double resolves 0.2 µs. They begin at 0.
    """
    name = table.names[time.place]
    if time.nanoseconds is not None:
        seconds, nanoseconds = table.whole_numbers(time.place), table.whole_numbers(time.nanoseconds)
        if seconds is None or nanoseconds is None:
            raise RecordingError(f"{where}: columns {name!r} and {table.names[time.nanoseconds]!r} hold broken numbers")
        if len(nanoseconds) and (most := int(nanoseconds.max())) >= 1_000_000_000:
            raise RecordingError(
                f"{where}: column {table.names[time.nanoseconds]!r} holds {most}: expected fewer than 1e9 nanoseconds, "
                f"beside the whole seconds of column {name!r}; name the one that holds the time with --columns t=…"
            )
        return raw, seconds * 1_000_000_000 + nanoseconds, 1e-9
    if time.unit is None:
        with np.errstate(invalid="ignore"):  # numbers that are not finite are refused later, by their row
            step = float(np.median(np.diff(raw))) if len(raw) > 1 else 0.0
        if step > GAP:
            raise RecordingError(
                f"{where}: times in column {name!r} are {step:g} apart, too far for seconds: expected the unit; say it "
                "with --columns t_unit=ms (or us, ns, s)"
            )
        return raw, None, 1.0
    scale = 1e-9 if time.unit == DATE else TIME_UNITS[time.unit.strip().lower()]
    if scale == 1.0:
        return raw, None, 1.0
    whole = table.whole_numbers(time.place)
    if whole is None:
        if time.unit == DATE:
            raise RecordingError(f"{where}: column {name!r} holds dates in some rows only: expected one in every row")
        if time.tool is not None:
            raise RecordingError(
                f"{where}: {time.tool} writes whole {time.unit} in column {name!r}, here they are broken: expected the "
                "unit; say it with --columns t_unit=s (or ms, us, ns)"
            )
        return raw * scale, None, 1.0
    if time.other is not None and len(whole) > 1 and (whole == whole[0]).all():
        other = table.whole_numbers(time.other)  # messages that were not stamped: the time of logging, as in bags
        whole = whole if other is None else other
    return raw, whole, scale


def _episode(episodes: NDArray[np.float64], spec: ColumnSpec, where: str) -> NDArray[np.bool_]:
    """Which rows (N,) are of the one episode asked for."""
    there = np.unique(episodes)
    shown = ", ".join(f"{episode:g}" for episode in there[:8]) + (", …" if len(there) > 8 else "")
    if spec.episode is None and len(there) > 1:
        message = f"{where} holds {len(there)} episodes ({shown}): expected one; name it with --episode K"
        raise EpisodesError(message, tuple(int(episode) for episode in there if np.isfinite(episode)))
    if spec.episode is not None and spec.episode not in there:
        raise RecordingError(f"{where} has no episode {spec.episode}: expected one of {shown}")
    return np.ones(len(episodes), dtype=bool) if spec.episode is None else episodes == spec.episode

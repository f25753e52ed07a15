"""From any table with a header to a Recording: what CSV, Parquet, NPZ and HDF5 have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import EpisodesError, RecordingError
from armload.recording.aliases import EPISODE, QUANTITIES, TIME_UNITS
from armload.recording.choice import DATE, TimeColumns
from armload.recording.column_spec import ColumnSpec
from armload.recording.columns import checked_recording
from armload.recording.mapping import ColumnMap, map_columns, of_currents
from armload.recording.recording import GAP, Recording
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
    places = [place for key in QUANTITIES for place in columns.places[key]]
    time = columns.time
    extra = [] if time is None else [time.place]
    values = table.numbers([*extra, *places, *([] if columns.episode is None else [columns.episode])])
    if columns.episode is not None:
        keep = _episode(values[:, -1], spec, where)
    elif spec.episode is None:
        keep = np.ones(len(values), dtype=bool)
    else:
        raise RecordingError(f"{where} has no column {EPISODE!r}: expected none of --episode; leave it out")
    names = [table.names[place] for place in places]
    scales = np.array([scale for key in QUANTITIES for scale in columns.scales[key]])
    motion = values[:, len(extra) : len(extra) + len(places)] * scales
    notes = columns.notes
    if columns.wanted is not None:
        n = len(columns.wanted[0])
        moment, current = (table.numbers(at)[keep] for at in columns.wanted)
        constants = controller_constants(moment, current, motion[keep, n : 2 * n], where)
        motion[:, 2 * n :] *= constants
        notes = (
            *notes,
            of_currents(where, constants.tolist(), " (the controller's own target_moment over target_current)"),
        )
    if time is None:
        assert spec.rate is not None
        (t, epoch), label = (np.maximum(np.cumsum(keep) - 1, 0) / spec.rate, 0.0), "t"
    else:
        (t, epoch), label = _seconds(table, time, values[:, 0], where), table.names[time.place]
    rows = np.flatnonzero(keep)
    return checked_recording(
        np.column_stack([t, motion])[rows],
        where,
        lambda k: table.row_name(int(rows[k])),
        labels=[label, *names],
        channel=channel,
        joint_names=columns.joints,
        notes=(*table.notes, *notes),
        epoch=epoch,
    )


def _seconds(table: Table, time: TimeColumns, raw: NDArray[np.float64], where: str) -> tuple[NDArray, float]:
    """The times (N,) [s], and what they are counted from [s since the clock's own beginning].

    Stamps in nanoseconds are subtracted as whole numbers first: since 1970 a double resolves 0.2 µs. They begin at 0.
    """
    name = table.names[time.place]
    if time.nanoseconds is not None:
        seconds, nanoseconds = table.whole_numbers(time.place), table.whole_numbers(time.nanoseconds)
        if seconds is None or nanoseconds is None:
            raise RecordingError(f"{where}: columns {name!r} and {table.names[time.nanoseconds]!r} hold broken numbers")
        return _counted(seconds * 1_000_000_000 + nanoseconds, 1e-9)
    if time.unit is None:
        with np.errstate(invalid="ignore"):  # numbers that are not finite are refused later, by their row
            step = float(np.median(np.diff(raw))) if len(raw) > 1 else 0.0
        if step > GAP:
            raise RecordingError(
                f"{where}: times in column {name!r} are {step:g} apart, too far for seconds: expected the unit; say it "
                "with --columns t_unit=ms (or us, ns, s)"
            )
        return raw, 0.0
    scale = 1e-9 if time.unit == DATE else TIME_UNITS[time.unit.strip().lower()]
    if scale == 1.0:
        return raw, 0.0
    whole = table.whole_numbers(time.place)
    if whole is None:
        if time.unit == DATE:
            raise RecordingError(f"{where}: column {name!r} holds dates in some rows only: expected one in every row")
        if time.tool is not None:
            raise RecordingError(
                f"{where}: {time.tool} writes whole {time.unit} in column {name!r}, here they are broken: expected the "
                "unit; say it with --columns t_unit=s (or ms, us, ns)"
            )
        return raw * scale, 0.0
    if time.other is not None and len(whole) > 1 and (whole == whole[0]).all():
        other = table.whole_numbers(time.other)  # messages that were not stamped: the time of logging, as in bags
        whole = whole if other is None else other
    return _counted(whole, scale)


def _counted(whole: NDArray[np.int64], scale: float) -> tuple[NDArray, float]:
    """Times (N,) [s] from the first of some stamps, and that stamp [s]."""
    return (whole - whole[:1]) * scale, float(whole[0] * scale) if len(whole) else 0.0


def _episode(episodes: NDArray[np.float64], spec: ColumnSpec, where: str) -> NDArray[np.bool_]:
    """Which rows (N,) are of the one episode asked for."""
    there = np.unique(episodes)
    shown = ", ".join(f"{episode:g}" for episode in there[:8]) + (", …" if len(there) > 8 else "")
    if spec.episode is None and len(there) > 1:
        said = f"{where} holds {len(there)} episodes ({shown}): expected one; name it with --episode K"
        raise EpisodesError(said, tuple(int(episode) for episode in there if np.isfinite(episode)))
    if spec.episode is not None and spec.episode not in there:
        raise RecordingError(f"{where} has no episode {spec.episode}: expected one of {shown}")
    return np.ones(len(episodes), dtype=bool) if spec.episode is None else episodes == spec.episode

"""Logs as Parquet: one column of numbers per column of the log, or lists of numbers as in LeRobot's data sets.

A file written here holds channel and joint names in its metadata. pyarrow is imported by those who have Parquet files.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import RecordingError, one_line
from armload.recording.array_table import WIDEST, ArrayTable, Column
from armload.recording.column_spec import ColumnSpec
from armload.recording.columns import column_names
from armload.recording.recording import CHANNELS, Recording
from armload.recording.table import read_table, table_chunks
from armload.runtime.extras import install

_METADATA = b"armload.recording"
_BUFFER = 1 << 20  # bytes of a column that are read at a time


def read_parquet(
    path: Path,
    where: str,
    arm: Arm | None = None,
    spec: ColumnSpec | None = None,
    elements: Mapping[str, Sequence[str]] | None = None,
) -> Recording:
    """Read a Parquet log; see `read_recording` for what it raises.

    elements: names of the elements of columns that hold lists, where there are any.
    """
    pa, parquet = pyarrow_for(where)
    try:
        with parquet.ParquetFile(path, page_checksum_verification=True) as file:
            columns = {}
            for entry in file.schema_arrow:
                read = partial(_column, file, entry.name, where)
                if _is_list(pa, entry.type):
                    lists = read()
                    if lists.shape[1] <= WIDEST:
                        called = (elements or {}).get(entry.name, ())
                        called = called if len(called) == lists.shape[1] else None
                        columns[entry.name] = Column(lists.shape[1], lambda lists=lists: lists, elements=called)
                else:
                    columns[entry.name] = Column(None, read, pa.types.is_timestamp(entry.type))
            channel, joints = _about((file.schema_arrow.metadata or {}).get(_METADATA))
            log = read_table(ArrayTable(columns, where), where, arm, spec or ColumnSpec(), channel=channel)
    except RecordingError:
        raise
    except Exception as error:  # a damaged file can fail anywhere in the decoder
        cut = "magic bytes" in str(error)  # those at its end
        reason = "it is damaged or was cut off; copy it again, or write it anew" if cut else one_line(error)[:160]
        raise RecordingError(f"{where} is not a Parquet file that can be read: {reason}") from None
    return log if joints is None or len(joints) != log.n else replace(log, joint_names=joints)


def parquet_chunks(path: Path, where: str, arm: Arm | None, spec: ColumnSpec, size: int) -> Iterator[Recording]:
    """A Parquet log, `size` rows at a time; see `table_chunks` for what it raises."""
    pa, parquet = pyarrow_for(where)
    how: Any = {"page_checksum_verification": True, "pre_buffer": False, "buffer_size": _BUFFER}
    with parquet.ParquetFile(path, **how) as file:
        names = [entry.name for entry in file.schema_arrow if not _is_text(pa, entry.type)]
        channel, joints = _about((file.schema_arrow.metadata or {}).get(_METADATA))

        def pieces() -> Iterator[ArrayTable]:
            first = 0
            for batch in file.iter_batches(size, columns=names, use_threads=False):
                yield ArrayTable(_columns_of(pa, pa.Table.from_batches([batch]), where), where, first)
                first += batch.num_rows

        for log in table_chunks(pieces(), where, arm, spec, channel):
            yield log if joints is None or len(joints) != log.n else replace(log, joint_names=joints)


def _columns_of(pa: Any, table: Any, where: str) -> dict[str, Column]:
    columns = {}
    for entry in table.schema:
        read = partial(_values, table.column(entry.name), entry.name, where)
        if not _is_list(pa, entry.type):
            columns[entry.name] = Column(None, read, pa.types.is_timestamp(entry.type))
        elif (lists := read()).shape[1] <= WIDEST:
            columns[entry.name] = Column(lists.shape[1], lambda lists=lists: lists)
    return columns


def _is_text(pa: Any, kind: Any) -> bool:
    return not (
        pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_timestamp(kind)
    ) and not _is_list(pa, kind)


def pyarrow_for(where: str | Path) -> tuple[Any, Any]:
    """pyarrow and its Parquet module.

    Raises:
        RecordingError: it is not installed.
    """
    try:
        import pyarrow
        import pyarrow.compute
        from pyarrow import parquet
    except ImportError:
        raise RecordingError(
            f"{where}: Parquet is read and written through pyarrow, which is missing: {install('pyarrow')}"
        ) from None
    return pyarrow, parquet


def _is_list(pa: Any, kind: Any) -> bool:
    lists = pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind)
    return lists and (pa.types.is_floating(kind.value_type) or pa.types.is_integer(kind.value_type))


def _column(file: Any, name: str, where: str) -> NDArray:
    """One column: numbers or dates (N,), or lists of numbers (N, width).

    Raises:
        RecordingError: text, a cell that is empty, or lists of different lengths.
    """
    return _values(file.read([name], use_threads=False).column(name), name, where)


def _values(column: Any, name: str, where: str) -> NDArray:
    """The same of a column that was read."""
    pa, _ = pyarrow_for(where)
    if column.null_count:
        row = int(np.flatnonzero(np.asarray(column.is_null()))[0])
        raise RecordingError(f"{where}, row {row}: {name} is empty: expected a number")
    if _is_list(pa, column.type):
        lengths = set(pa.compute.list_value_length(column).unique().to_pylist()) or {0}
        values = column.combine_chunks().flatten()
        if len(lengths) > 1 or values.null_count:
            raise RecordingError(f"{where}: column {name} holds lists of {sorted(lengths)[:4]} numbers, or with gaps")
        return values.to_numpy(zero_copy_only=False).reshape(len(column), lengths.pop())
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    known = pa.types.is_floating(column.type) or pa.types.is_integer(column.type) or pa.types.is_timestamp(column.type)
    if not known:
        raise RecordingError(f"{where}: column {name} holds {column.type}: expected numbers")
    return column.to_numpy()


def write_parquet(path: Path, recording: Recording) -> None:
    """Write a Parquet log with a checksum on every page."""
    pa, parquet = pyarrow_for(path)
    matrix = np.hstack([recording.t[:, None], recording.q, recording.dq, recording.tau])
    about = {"channel": recording.channel, "joint_names": recording.joint_names}
    schema = pa.schema(
        [(name, pa.float64()) for name in column_names(recording.n)], metadata={_METADATA: json.dumps(about).encode()}
    )
    table = pa.Table.from_arrays([pa.array(column) for column in matrix.T], schema=schema)
    parquet.write_table(table, path, compression="zstd", write_page_checksum=True)


def _about(raw: bytes | None) -> tuple[str, tuple[str, ...] | None]:
    """Channel and joint names from the metadata, where they are there and make sense."""
    try:
        about = json.loads(raw or b"{}")
        channel, joints = about.get("channel"), about.get("joint_names")
    except (ValueError, AttributeError):
        return "measured", None
    named = isinstance(joints, list) and all(isinstance(name, str) for name in joints)
    return channel if channel in CHANNELS else "measured", tuple(joints) if named else None

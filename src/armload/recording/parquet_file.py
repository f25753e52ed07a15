"""Logs as Parquet, one column of doubles per column of the log; channel and joint names in the file's metadata."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from armload.arms import Arm
from armload.errors import RecordingError, one_line
from armload.recording.columns import checked_recording, column_names, joint_count
from armload.recording.recording import CHANNELS, Recording

_METADATA = b"armload.recording"


def read_parquet(path: Path, where: str, arm: Arm | None = None) -> Recording:
    """Read a Parquet log; see `read_recording` for what it raises."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(path, page_checksum_verification=True) as file:
            names = file.schema_arrow.names
            n = joint_count(names, where, arm)
            table = file.read(column_names(n), use_threads=False)
            about = (file.schema_arrow.metadata or {}).get(_METADATA)
        columns = []
        for name in column_names(n):
            column = table.column(name)
            if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
                raise RecordingError(f"{where}: column {name} holds {column.type}: expected numbers")
            if column.null_count:
                row = int(np.flatnonzero(np.asarray(column.is_null()))[0])
                raise RecordingError(f"{where}, row {row}: {name} is empty: expected a number")
            columns.append(np.asarray(column.to_numpy(), dtype=float))
        matrix = np.column_stack(columns)
    except RecordingError:
        raise
    except Exception as error:  # a damaged file can fail anywhere in the decoder
        raise RecordingError(f"{where} is not a Parquet file that can be read: {one_line(error)[:160]}") from None
    channel, joints = _about(about, n)
    joints = joints or (arm.joint_names if arm is not None else None)
    return checked_recording(matrix, where, lambda k: f"row {k}", channel=channel, joint_names=joints)


def write_parquet(path: Path, recording: Recording) -> None:
    """Write a Parquet log with a checksum on every page."""
    import pyarrow as pa
    from pyarrow import parquet

    matrix = np.hstack([recording.t[:, None], recording.q, recording.dq, recording.tau])
    about = {"channel": recording.channel, "joint_names": recording.joint_names}
    schema = pa.schema(
        [(name, pa.float64()) for name in column_names(recording.n)], metadata={_METADATA: json.dumps(about).encode()}
    )
    table = pa.Table.from_arrays([pa.array(column) for column in matrix.T], schema=schema)
    parquet.write_table(table, path, compression="zstd", write_page_checksum=True)


def _about(raw: bytes | None, n: int) -> tuple[str, tuple[str, ...] | None]:
    """Channel and joint names from the metadata, where they are there and make sense."""
    try:
        about = json.loads(raw or b"{}")
        channel, joints = about.get("channel"), about.get("joint_names")
    except (ValueError, AttributeError):
        return "measured", None
    named = isinstance(joints, list) and len(joints) == n and all(isinstance(name, str) for name in joints)
    return channel if channel in CHANNELS else "measured", tuple(joints) if named else None

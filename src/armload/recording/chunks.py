"""A log of any kind and length in bounded memory: its chunks one after the other, or a recording that lies on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from armload.arms import Arm
from armload.errors import RecordingError
from armload.recording.column_spec import ColumnSpec
from armload.recording.csv_file import csv_chunks
from armload.recording.files import TABLES, has_topics, log_in, read_as_told
from armload.recording.hdf5_file import hdf5_chunks
from armload.recording.npz_file import npz_chunks
from armload.recording.of_arm import OfArm
from armload.recording.parquet_file import parquet_chunks
from armload.recording.recording import BLOCK, Recording
from armload.recording.ros_bag import bag_chunks
from armload.recording.spooled import spooled

# [bytes] of a file from which a log is long: below, reading it whole takes a few times as much memory, and no disk
LONG = 8e6
_TEXT = 200  # bytes of a line: of text, as many bytes are read at a time as make about so many rows
_TABLES: dict[str, Callable[..., Iterator[Recording]]] = {
    ".parquet": parquet_chunks,
    ".npz": npz_chunks,
    **dict.fromkeys((".hdf5", ".h5"), hdf5_chunks),
    **dict.fromkeys(TABLES, csv_chunks),
}


def recording_chunks(
    path: str | Path,
    arm: Arm | None = None,
    *,
    topic: str | None = None,
    columns: ColumnSpec | Mapping[str, Any] | str | Path | None = None,
    size: int = BLOCK,
) -> Iterator[Recording]:
    """A log as `read_recording` reads it, in parts of about `size` samples, the next one read when it is asked for.

    A bag comes message by message, Parquet by batches of its row groups, HDF5 and NPZ by slices, text by lines. A table
    with a flaw, or one that must be read whole to be understood (several episodes, currents of unknown constants, names
    of joints in its rows), comes as one chunk, or raises what `read_recording` says of it. The notes are on the last.

    Args:
        path, arm, topic, columns: as of `read_recording`. size: samples of a chunk, at least 2.

    Raises:
        RecordingError: as `read_recording`, but of a bag only once its flaw is reached.
    """
    spec = ColumnSpec.of(columns)
    with log_in(path) as file:
        yield from map(OfArm(arm, spec, str(path)).of, _parts(file, str(path), arm, topic, spec, size))


def _parts(
    path: Path, where: str, arm: Arm | None, topic: str | None, spec: ColumnSpec, size: int
) -> Iterator[Recording]:
    read = _TABLES.get(path.suffix.lower())
    if path.exists() and has_topics(path) and spec == spec.of_values:
        yield from bag_chunks(path, where, arm, topic, size, spec)
        return
    if read is None or topic is not None or not path.is_file():
        yield read_as_told(path, where, arm, topic, spec)
        return
    many = size * (_TEXT if read is csv_chunks else 1)
    begun = False
    try:
        for chunk in read(path, where, arm, spec, many):
            begun = True
            yield chunk
    except Exception as error:  # a decoder may fail in any way; read whole, the log says in which
        if begun:
            raise _Begun from error
        yield read_as_told(path, where, arm, None, spec)


class _Begun(RecordingError):
    """A table that turned out to have a flaw after its first chunks."""


def read_long(
    path: str | Path,
    arm: Arm | None = None,
    *,
    topic: str | None = None,
    columns: ColumnSpec | Mapping[str, Any] | str | Path | None = None,
    long: float = LONG,
    size: int = BLOCK,
) -> Recording:
    """The same recording as `read_recording`; the samples of a file of `long` bytes and more stay on disk.

    They lie in the system's folder for temporary files (TMPDIR), 24 bytes for each joint and sample, as long as the
    recording is used.

    Args:
        path, arm, topic, columns: as of `read_recording`. size: as of `recording_chunks`.

    Raises:
        RecordingError: as `read_recording`. OSError: there is no room for the samples.
    """
    spec, where = ColumnSpec.of(columns), str(path)
    of_arm = OfArm(arm, spec, where)
    with log_in(path) as log:
        files = [log] if log.is_file() else list(log.iterdir()) if log.is_dir() and has_topics(log) else []
        if sum(file.stat().st_size for file in files) < long:
            return of_arm.of(read_as_told(log, where, arm, topic, spec))
        chunks = map(of_arm.of, _parts(log, where, arm, topic, spec, size))
        try:
            first = next(chunks)
            second = next(chunks, None)
            return first if second is None else spooled(chain([first, second], chunks), where)
        except _Begun:
            return OfArm(arm, spec, where).of(read_as_told(log, where, arm, None, spec))

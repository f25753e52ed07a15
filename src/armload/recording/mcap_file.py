"""MCAP: a file of ROS 2 messages that grows by whole chunks, and what is left of one that was cut off.

Messages are in CDR, their definitions in the file, as `ros2 bag record --storage mcap` writes them: ROS 2, Foxglove and
rosbags open it. A chunk is handed to the operating system as it is finished, so that a process killed at any moment
loses the chunk at hand. What it leaves has no index at its end, which most readers want first: `mended` makes a copy
that has one.

Source: the format's specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from armload.errors import RecordingError
from armload.recording.growing_file import GrowingFile
from armload.runtime.extras import install

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = 9  # bytes before a record's content: what it is, and its length
# a chunk ends with the message that takes it beyond either: what a kill can lose, and what a viewer reads at a time
CHUNK_BYTES, CHUNK_SECONDS = 1 << 18, 1.0


class McapFile:
    """A file of ROS 2 messages that does not exist yet.

    Args:
        path: to write. topics: name and type of each, such as {"/joint_states": "sensor_msgs/msg/JointState"}.

    Raises:
        RecordingError: the file exists or cannot be written, or mcap or rosbags is not installed.
    """

    def __init__(self, path: Path, topics: Mapping[str, str]) -> None:
        try:
            from mcap.writer import Writer
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise RecordingError(
                f"{path}: MCAP is written through mcap and rosbags, of which one is missing: {install('mcap')}"
            ) from None
        self._types = dict(topics)
        store = get_typestore(Stores.ROS2_HUMBLE)
        self._encode = store.serialize_cdr
        self._file = _Whole(path)
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES)  # type: ignore[arg-type]  # it writes, tells, flushes
        try:
            self._writer.start(profile="ros2", library="armload")
        except BaseException:
            self._file.discard()  # whoever tries again would leave one empty file after the other
            raise
        self._channels = {}
        for topic, kind in self._types.items():
            text = store.generate_msgdef(kind, ros_version=2)[0].encode()
            schema = self._writer.register_schema(kind, "ros2msg", text)
            self._channels[topic] = self._writer.register_channel(topic, "cdr", schema)
        self._flushed = time.monotonic()

    def write(self, topic: str, stamp: int, message: Any) -> None:
        """Add a message, an object with the fields of its topic's type.

        Args:
            stamp: when it was logged, since 1970 [ns].

        Raises:
            RecordingError: the disk is full or gone; the chunks before can be read.
        """
        data = bytes(self._encode(message, self._types[topic]))
        self._writer.add_message(self._channels[topic], stamp, data, stamp)
        if time.monotonic() - self._flushed >= CHUNK_SECONDS:
            self._writer.flush()
            self._flushed = time.monotonic()

    def close(self) -> None:
        """Write the last chunk and the index; nothing happens the second time, nor where writing has failed."""
        if self._file.open:
            try:
                self._writer.finish()
            finally:
                self._file.close()


class _Whole(GrowingFile):
    """The same as the writer of MCAP asks for it; where writing fails it is closed."""

    def write(self, data: bytes) -> int:
        try:
            self.append(data)
        except RecordingError:
            self.close()
            raise
        return len(data)

    def tell(self) -> int:
        return self.size

    def flush(self) -> None:
        """Nothing is held back."""


def is_cut_off(path: Path) -> bool:
    """Whether a file begins as MCAP and does not end so."""
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return False
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - len(_MAGIC), 0))
        return file.read() != _MAGIC


def mended(path: Path, folder: Path) -> tuple[Path, int] | None:
    """A copy of a file that was cut off, with all its whole chunks and an index, and how many messages that are.

    Memory holds a chunk at a time. None: nothing whole is left.

    Raises:
        ModuleNotFoundError: mcap is not installed. McapError: what is left is damaged, too.
    """
    from mcap.exceptions import EndOfFile
    from mcap.records import Channel, Header, Message, Schema
    from mcap.stream_reader import StreamReader
    from mcap.writer import Writer

    copy, messages = folder / "mended.mcap", 0
    schemas, channels = {0: 0}, {}  # a schema 0 is none
    with path.open("rb") as file, copy.open("wb") as out:
        end, writer = _last_whole(file), Writer(out)
        file.seek(0)
        try:
            for record in StreamReader(_Upto(file, end), validate_crcs=True).records:  # type: ignore[arg-type]
                if isinstance(record, Header):
                    writer.start(record.profile, record.library)
                elif isinstance(record, Schema) and record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, Channel) and record.id not in channels:
                    channels[record.id] = writer.register_channel(
                        record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                    )
                elif isinstance(record, Message):
                    messages += 1
                    writer.add_message(
                        channels[record.channel_id], record.log_time, record.data, record.publish_time, record.sequence
                    )
        except EndOfFile:
            pass
        if messages == 0:
            return None
        writer.finish()
    return copy, messages


def _last_whole(file: Any) -> int:
    """Where the last whole record ends [bytes]; a chunk is one."""
    size, end = file.seek(0, os.SEEK_END), len(_MAGIC)
    while end + _HEAD <= size:
        file.seek(end + 1)
        after = end + _HEAD + int.from_bytes(file.read(_HEAD - 1), "little")
        if after > size:
            break
        end = after
    return end


class _Upto:
    """A file that ends where its last whole record does."""

    def __init__(self, file: Any, end: int) -> None:
        self._file, self._end = file, end

    def read(self, size: int) -> bytes:
        return self._file.read(min(size, self._end - self._file.tell()))

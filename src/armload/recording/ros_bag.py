"""Logs inside ROS bags: the sensor_msgs/JointState messages of one topic (ROS 1 .bag, ROS 2 .db3, .mcap or folder).

The joints of a JointState are known by **name**, that of the description or another on the arm's sheet: their order
is the publisher's own (UR's driver may list the elbow first, grippers publish finger joints on the same topic). Time
is the message's header stamp, counted from the first; where all stamps are equal, as with publishers that do not set
them, it is the time of logging.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, names_among
from armload.errors import RecordingError, one_line
from armload.recording.bag_parts import PART_SUFFIXES, in_order
from armload.recording.column_spec import ColumnSpec
from armload.recording.currents import in_si
from armload.recording.mcap_file import is_cut_off, mended
from armload.recording.recording import Recording
from armload.recording.rows_as_chunks import Chunks
from armload.recording.steadied import with_velocities_of_positions
from armload.runtime.extras import missing

JOINT_STATE = "sensor_msgs/msg/JointState"
BAG_SUFFIXES = (".bag", *PART_SUFFIXES)
IN_SI = ColumnSpec()


class _Message(NamedTuple):
    log_time: int  # [ns]
    stamp: int  # [ns]
    names: tuple[str, ...]
    values: tuple[NDArray[np.float64], ...]  # position, velocity, effort


def read_bag(
    path: Path, where: str, arm: Arm | None = None, topic: str | None = None, spec: ColumnSpec = IN_SI
) -> Recording:
    """Read the JointState messages of a bag; see `read_recording` for what it raises."""
    return next(bag_chunks(path, where, arm, topic, spec=spec))


def bag_chunks(
    path: Path,
    where: str,
    arm: Arm | None = None,
    topic: str | None = None,
    size: int | None = None,
    spec: ColumnSpec = IN_SI,
) -> Iterator[Recording]:
    """The JointState messages of a bag, `size` at a time (None: all at once), read as they are asked for.

    `spec` says the units of their values, where they are not SI.

    Raises:
        RecordingError: as `read_recording`.
    """
    try:
        with ExitStack() as stack:
            notes: list[str] = []
            bag = _Bag([stack.enter_context(reader) for reader in _readers(path, where, stack, notes)], notes)
            yield from _recordings(bag, _choose(bag, where, arm, topic), where, arm, size, spec)
    except RecordingError:
        raise
    except ModuleNotFoundError as error:
        raise RecordingError(f"{where}: ROS bags are read through rosbags: {missing(error) or error}") from None
    except Exception as error:  # a damaged bag can fail anywhere between the index, the chunks and the messages
        raise RecordingError(
            f"{where} is not a bag that can be read (damaged or cut off?): {one_line(error)[:160]}"
        ) from None


class _Bag:
    """The JointState topics of a bag, whichever ROS wrote it."""

    def __init__(self, readers: list[Any], notes: list[str]) -> None:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.typesys import Stores, get_typestore

        self._readers, self.notes = readers, notes
        connections = [connection for reader in readers for connection in reader.connections]
        self.types = {connection.topic: connection.msgtype for connection in connections}
        self.topics = sorted({c.topic for c in connections if c.msgtype == JOINT_STATE})
        # The message is read as the ROS release defines it, not as the file says: JointState never changed
        if any(isinstance(reader, Reader1) for reader in readers):
            self._decode = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1
        else:
            self._decode = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr

    def messages(self, topic: str) -> Iterator[_Message]:
        """The messages of one topic in the order of logging."""
        for reader in self._readers:
            mine = [c for c in reader.connections if c.topic == topic and c.msgtype == JOINT_STATE]
            if not mine:
                continue
            for _, log_time, raw in reader.messages(mine):
                m: Any = self._decode(raw, JOINT_STATE)
                stamp = m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec
                yield _Message(log_time, stamp, tuple(m.name), (m.position, m.velocity, m.effort))


def _readers(path: Path, where: str, stack: ExitStack, notes: list[str]) -> list[Any]:
    from rosbags.rosbag2 import Reader as Reader2

    if path.suffix.lower() == ".bag" and path.is_file():
        from armload.recording.ros1_index import CompactReader

        return [CompactReader(path)]
    parts = [path] if path.is_file() else in_order(p for p in path.iterdir() if p.suffix.lower() in PART_SUFFIXES)
    for part in parts:
        if part.suffix.lower() == ".db3":
            _check_length(part)
    if (path / "metadata.yaml").is_file():
        return [Reader2(_plain_name(path, stack))]
    if not parts:
        raise RecordingError(
            f"{where} is a folder without metadata.yaml, .db3, .mcap or meta/info.json: expected a log file, or the "
            "folder of a ROS 2 bag or of a LeRobot data set"
        )
    return [Reader2(_plain_name(_whole(part, stack, notes), stack)) for part in parts]


def _whole(part: Path, stack: ExitStack, notes: list[str]) -> Path:
    """A file as it is or, of an MCAP whose writer was killed, a copy of all that is whole in it."""
    if part.suffix.lower() != ".mcap" or not is_cut_off(part):
        return part
    copy = mended(part, Path(stack.enter_context(tempfile.TemporaryDirectory())))
    if copy is None:
        return part
    notes.append(f"{part} is cut off: it was read up to the end of its last whole chunk, {copy[1]} messages")
    return copy[0]


def _check_length(path: Path) -> None:
    """Refuse a SQLite file shorter than its header says: SQLite itself would read it up to the first missing page."""
    with path.open("rb") as file:
        head = file.read(100)
    page = int.from_bytes(head[16:18], "big")
    pages = int.from_bytes(head[28:32], "big") if head[24:28] == head[92:96] else 0  # else an old writer left it unset
    expected = (65536 if page == 1 else page) * pages
    if path.stat().st_size < expected:
        raise RecordingError(
            f"{path} is not a bag that can be read: it has {path.stat().st_size} bytes of the {expected} its header "
            "names; copy it again"
        )


def _plain_name(path: Path, stack: ExitStack) -> Path:
    """The path, or a link to it where its suffix is in capitals or SQLite would take part of its name for a query."""
    if path.suffix == path.suffix.lower() and not any(sign in str(path) for sign in "?#%"):
        return path
    link = Path(stack.enter_context(tempfile.TemporaryDirectory())) / f"bag{path.suffix.lower()}"
    link.symlink_to(path.absolute(), target_is_directory=path.is_dir())
    return link


def _choose(bag: _Bag, where: str, arm: Arm | None, topic: str | None) -> str:
    """The topic to read: the one named, or the only one that has the arm's joints."""
    if not bag.topics:
        others = ", ".join(f"{name} ({kind})" for name, kind in sorted(bag.types.items())[:6]) or "nothing"
        raise RecordingError(f"{where} has no topic of type sensor_msgs/JointState: it has {others}")
    if topic is not None:
        if topic not in bag.topics:
            raise RecordingError(f"{where} has no JointState topic {topic!r}: expected one of {', '.join(bag.topics)}")
        return topic
    if len(bag.topics) == 1:
        return bag.topics[0]
    if arm is None:
        candidates = bag.topics
    else:
        candidates = [name for name in bag.topics if any(names_among(arm, m.names) for m in bag.messages(name))]
        if not candidates:
            found = sorted({joint for name in bag.topics for m in bag.messages(name) for joint in m.names})
            _refuse_joints(where, f"topics {', '.join(bag.topics)}", arm, found)
    if len(candidates) > 1:
        raise RecordingError(
            f"{where} has {len(candidates)} JointState topics to choose from: {', '.join(candidates)}; "
            "name one (--topic)"
        )
    return candidates[0]


def _recordings(
    bag: _Bag, topic: str, where: str, arm: Arm | None, size: int | None, spec: ColumnSpec
) -> Iterator[Recording]:
    wanted = None if arm is None else arm.joint_names
    called: tuple[str, ...] | None = None  # what the log calls the arm's joints
    columns: dict[tuple[str, ...], list[int] | None] = {}  # by names in a message: places of the arm's joints
    messages: list[tuple[int, int, int, NDArray[np.float64]]] = []  # number, stamp, time of logging, values
    scale, said = None, ()  # what values are multiplied with, and why
    moving: bool | None = None  # whether the messages have velocities
    channel = "desired" if "desired" in topic.rsplit("/", 1)[-1] else "measured"
    tables = _Tables(where, topic)
    chunks = Chunks(where, channel)
    for number, message in enumerate(bag.messages(topic), start=1):
        if wanted is None:
            wanted = message.names
        if scale is None:
            scale, said = in_si(spec, arm, len(wanted), f"{where}, {topic}")
        if message.names not in columns:
            if called is None:
                called = wanted if arm is None else names_among(arm, message.names)
            complete = called is not None and set(called) <= set(message.names)
            columns[message.names] = [message.names.index(name) for name in called or ()] if complete else None
        order = columns[message.names]
        if order is None:
            continue  # another device on the same topic, such as a gripper
        if moving is None:
            moving = len(message.values[1]) > 0 and not spec.without_velocities
            size = size if moving else None  # what comes after a sample tells of its velocity, too
        values = scale * np.concatenate(_values(message, order, moving, f"{where}, {topic} message {number}"))
        messages.append((number, message.stamp, message.log_time, values))
        if len(messages) == size:
            yield from chunks.take(*tables.of(messages), joint_names=wanted, epoch=tables.epoch)
            messages = []
    if not messages and not tables.begun:
        if not columns or wanted is None:
            raise RecordingError(f"{where}: topic {topic} has no messages: expected at least 2")
        if arm is not None:
            _refuse_joints(where, f"topic {topic}", arm, sorted({name for names in columns for name in names}))
    if messages:
        yield from chunks.take(*tables.of(messages), joint_names=wanted, epoch=tables.epoch)
    last = chunks.last((*bag.notes, *tables.notes, *said))
    yield last if moving else with_velocities_of_positions(last)


class _Tables:
    """Messages as rows (N, 1 + 3n), timed by their stamps, or by the times of logging where all stamps are equal."""

    def __init__(self, where: str, topic: str) -> None:
        self._where, self._topic = where, topic
        self._stamp: int | None = None  # the first; all messages have it where they are not stamped
        self._stamped, self._origin = True, 0
        self.notes: tuple[str, ...] = ()

    @property
    def begun(self) -> bool:
        """Whether there was a message."""
        return self._stamp is not None

    @property
    def epoch(self) -> float:
        """What times are counted from [s]."""
        return self._origin * 1e-9

    def of(self, messages: list[tuple[int, int, int, NDArray]]) -> tuple[NDArray, Callable[[int], str]]:
        """The rows, and how to call them; whether messages are stamped is judged by the first that are given."""
        numbers, stamps, log_times, values = zip(*messages, strict=True)
        if self._stamp is None:
            self._stamp, self._stamped = stamps[0], len(set(stamps)) > 1 or len(stamps) == 1
            self._origin = stamps[0] if self._stamped else log_times[0]
            if not self._stamped:
                note = f"{self._where}: the messages of {self._topic} are not stamped: took the times of logging"
                self.notes = (note,)
        elif not self._stamped and set(stamps) != {self._stamp}:
            raise RecordingError(
                f"{self._where}: only some messages of {self._topic} are stamped: expected all or none; record it anew"
            )
        times = np.array(stamps if self._stamped else log_times, dtype=np.int64) - self._origin
        t = times * 1e-9  # exact to the ns, unlike since 1970
        return np.column_stack([t, np.array(values)]).astype(float), lambda k: f"{self._topic} message {numbers[k]}"


def _values(message: _Message, order: list[int], moving: bool, place: str) -> list[NDArray[np.float64]]:
    """Position, velocity and effort of the wanted joints; velocities of 0 where the topic has none."""
    out = []
    for what, values in zip(("position", "velocity", "effort"), message.values, strict=True):
        if what == "velocity" and not moving:
            out.append(np.zeros(len(order)))
            continue
        if len(values) != len(message.names):
            found = f"no {what}" if len(values) == 0 else f"{len(values)} values of {what}"
            also = " (joint torque); record a topic that carries the torque" if what == "effort" else ""
            raise RecordingError(f"{place} has {found} for {len(message.names)} joints: expected one per joint{also}")
        out.append(np.asarray(values, dtype=float)[order])
    return out


def _refuse_joints(where: str, topics: str, arm: Arm, found: list[str]) -> None:
    missing = [name for name in arm.joint_names if name not in found]
    if not missing:
        raise RecordingError(f"{where}: no single message of {topics} has all joints of {arm.name}")
    raise RecordingError(
        f"{where}: {arm.name}'s joint{'s' if len(missing) > 1 else ''} {', '.join(missing)} "
        f"{'are' if len(missing) > 1 else 'is'} not on {topics}: found {', '.join(found[:20]) or 'no joints'}; "
        "name the robot that made the bag"
    )

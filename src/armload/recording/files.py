"""Reading and writing recordings by the suffix of their file."""

from __future__ import annotations

from pathlib import Path

from armload.arms import Arm
from armload.atomic import replacing
from armload.errors import RecordingError
from armload.recording.csv_file import read_csv, write_csv
from armload.recording.npz_file import read_npz, write_npz
from armload.recording.parquet_file import read_parquet, write_parquet
from armload.recording.recording import Recording
from armload.recording.ros_bag import BAG_SUFFIXES, read_bag

_READERS = {".csv": read_csv, ".parquet": read_parquet, ".npz": read_npz}
_WRITERS = {".csv": write_csv, ".parquet": write_parquet, ".npz": write_npz}
_SIGNATURES = {
    b"PAR1": (".parquet",),
    b"PK\x03\x04": (".npz",),
    b"SQLite format 3\x00": (".db3",),
    b"\x89MCAP0\r\n": (".mcap",),
    b"#ROSBAG V": (".bag",),
}


def read_recording(path: str | Path, arm: Arm | None = None, *, topic: str | None = None) -> Recording:
    """Read the log of an arm: CSV, Parquet, NPZ, ROS 1 bag, ROS 2 bag (folder, .db3 or .mcap).

    Args:
        path: the file, or the folder of a ROS 2 bag; SI units, columns t, q1..qn, dq1..dqn, tau1..taun or JointState.
        arm: the arm that made the log, if known: the number of joints is checked, and joints in a bag are taken by
            their names in the arm's order.
        topic: the JointState topic of a bag, where several have the arm's joints.

    Raises:
        RecordingError: the file cannot be read, or a line of it is not valid; one sentence that names the place
            (for CSV the line of the file, the header being line 1).
    """
    path, where = Path(path), str(path)
    try:
        if not path.exists():
            raise RecordingError(f"{where} does not exist: expected the path of a log (CSV, Parquet, NPZ or ROS bag)")
        if path.is_dir():
            return read_bag(path, where, arm, topic)
        if not path.is_file():
            raise RecordingError(f"{where} is not a regular file: expected a log (CSV, Parquet, NPZ or ROS bag)")
        suffix = path.suffix.lower()
        if suffix not in (*_READERS, *BAG_SUFFIXES):
            raise RecordingError(
                f"{where}: unsupported suffix {path.suffix!r}: expected {', '.join((*_READERS, *BAG_SUFFIXES))}"
                f"{_looks_like(path, suffix)}"
            )
        if path.stat().st_size == 0:
            raise RecordingError(f"{where} is empty: expected a log of at least 2 samples")
        if topic is not None and suffix in _READERS:
            raise RecordingError(f"{where}: a topic ({topic!r}) was named, but only ROS bags have topics; leave it out")
        if hint := _looks_like(path, suffix):
            raise RecordingError(f"{where} is not a {suffix} file{hint}")
        return read_bag(path, where, arm, topic) if suffix in BAG_SUFFIXES else _READERS[suffix](path, where, arm)
    except OSError as error:
        raise RecordingError(f"{where} cannot be read: {error.strerror or error}") from None


def has_topics(path: str | Path) -> bool:
    """Whether a file is a ROS bag, by its name."""
    path = Path(path)
    return path.is_dir() or path.suffix.lower() in BAG_SUFFIXES


def write_recording(path: str | Path, recording: Recording) -> None:
    """Write a recording as CSV, Parquet or NPZ, by suffix; the file appears whole or not at all.

    Every number is kept exactly. Parquet and NPZ also keep the torque channel and the joint names; CSV has no room for
    them, so that only recordings of measured torque can be written as CSV.

    Raises:
        RecordingError: unknown suffix, a channel that CSV cannot hold, or a folder that cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _WRITERS:
        raise RecordingError(f"{path}: unsupported suffix {path.suffix!r}: expected {', '.join(_WRITERS)}")
    if suffix == ".csv" and recording.channel != "measured":
        raise RecordingError(
            f"{path}: CSV cannot say that tau is the {recording.channel} torque: write .parquet or .npz instead"
        )
    try:
        with replacing(path) as temporary:
            _WRITERS[suffix](temporary, recording)
    except OSError as error:
        raise RecordingError(f"{path} cannot be written: {error.strerror or error}") from None


def _looks_like(path: Path, suffix: str) -> str:
    """A hint, if the file starts like one of another suffix."""
    with path.open("rb") as file:
        head = file.read(16)
    for signature, suffixes in _SIGNATURES.items():
        if head.startswith(signature) and suffix not in suffixes:
            return f": it starts like a {suffixes[0]} file; rename it"
    return ""

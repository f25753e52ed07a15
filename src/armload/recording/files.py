"""Reading and writing recordings by the suffix of their file."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from armload.arms import Arm
from armload.errors import RecordingError
from armload.recording.column_spec import ColumnSpec
from armload.recording.csv_file import read_csv, write_csv
from armload.recording.hdf5_file import read_hdf5
from armload.recording.lerobot import is_data_set, read_data_set
from armload.recording.mat_file import read_mat
from armload.recording.npz_file import read_npy, read_npz, write_npz
from armload.recording.of_arm import OfArm
from armload.recording.packed import UNPACKED, form_of, unpacked
from armload.recording.parquet_file import read_parquet, write_parquet
from armload.recording.recording import Recording
from armload.recording.ros_bag import BAG_SUFFIXES, read_bag
from armload.runtime.atomic import replacing

NAMED_SUFFIXES = (".dat", ".log", ".asc", ".npy")  # read where it is named; in a folder it is mostly something else
TABLES = (".csv", ".tsv", ".txt", ".dat", ".log", ".asc")
_READERS = {
    **dict.fromkeys(TABLES, read_csv),
    ".parquet": read_parquet,
    ".npz": read_npz,
    ".npy": read_npy,
    **dict.fromkeys((".hdf5", ".h5"), read_hdf5),
    ".mat": read_mat,
}
FORMS = (*_READERS, *BAG_SUFFIXES)
LOG_SUFFIXES = tuple(suffix for suffix in FORMS if suffix not in NAMED_SUFFIXES)
PACKED_SUFFIXES = (*UNPACKED, ".zst")
_FORMS = "CSV, Parquet, NPZ, HDF5, MATLAB, ROS bag or LeRobot folder"
_WRITERS = {".csv": write_csv, ".parquet": write_parquet, ".npz": write_npz}
_PACKED = {  # how a file begins that a program has packed
    b"\x1f\x8b": ("gzip", ".gz"),
    b"BZh91AY&SY": ("bzip2", ".bz2"),
    b"\xfd7zXZ\x00": ("xz", ".xz"),
    b"\x28\xb5\x2f\xfd": ("Zstandard", ".zst"),
}
_HEAD = 2048  # bytes by which a file is known; HDF5 may leave up to so many to others before it begins
_ZIP = b"PK\x03\x04"
_OCTAVE = b"# Created by Octave"
_SIGNATURES = {
    b"PAR1": (".parquet",),
    b"MATLAB ": (".mat",),
    _ZIP: (".npz",),
    b"\x93NUMPY": (".npy",),
    b"\x89HDF\r\n\x1a\n": (".hdf5", ".h5"),
    b"SQLite format 3\x00": (".db3",),
    b"\x89MCAP0\r\n": (".mcap",),
    b"#ROSBAG V": (".bag",),
}


def read_recording(
    path: str | Path,
    arm: Arm | None = None,
    *,
    topic: str | None = None,
    columns: ColumnSpec | Mapping[str, Any] | str | Path | None = None,
    rate: float | None = None,
    episode: int | None = None,
) -> Recording:
    """Read the log of an arm: a table (CSV, Parquet, NPZ, HDF5, MATLAB), a ROS bag, an episode of a LeRobot data set.

    Args:
        path: the file, packed or not (run.csv.gz, run.zip), or the folder of a ROS 2 bag or of a LeRobot data set.
            Columns of a table are known by the names that tools give them (docs/recordings.md); SI units, unless
            header, tool or `columns` say otherwise.
        arm: the arm that made the log, if known: the number of joints is checked, and joints that have names are taken
            by them, in the arm's order.
        topic: the JointState topic of a bag, where several have the arm's joints.
        columns: names and units of a table's columns (`ColumnSpec.of`), where its header leaves them open; of a bag,
            units alone.
        rate: samples per second [Hz] of a table without times.
        episode: which one of a table that holds several.

    Raises:
        RecordingError: the file cannot be read, its columns are not clear, or a line of it is not valid; one sentence
            that names the place (for CSV the line of the file, the first being 1).
    """
    if isinstance(arm, str):
        raise RecordingError(f"the arm of {path} is given as {arm!r}: expected an Arm, such as armload.arm({arm!r})")
    spec = ColumnSpec.of(columns).over(rate=rate, episode=episode)
    with log_in(path) as file:
        return OfArm(arm, spec, str(path)).of(read_as_told(file, str(path), arm, topic, spec))


def log_in(path: str | Path) -> AbstractContextManager[Path]:
    """The file or folder of a log; of a packed one what is in it, for as long as it is read (`unpacked`)."""
    return unpacked(Path(path), FORMS)


def read_as_told(path: Path, where: str, arm: Arm | None, topic: str | None, spec: ColumnSpec) -> Recording:
    """What an unpacked file says; what else the log says of the arm is another matter (`OfArm`)."""
    try:
        if not path.exists():
            raise RecordingError(f"{where} does not exist: expected the path of a log ({_FORMS})")
        if not path.is_file() and not path.is_dir():
            raise RecordingError(f"{where} is not a regular file: expected a log ({_FORMS})")
        suffix = path.suffix.lower()
        if has_topics(path):
            if spec != spec.of_values:
                raise RecordingError(
                    f"{where}: columns, a rate or an episode were named, but a ROS bag has its joints by name; leave "
                    "them out (but q_unit, dq_unit, tau_unit, torque_constants, compensated and dq=none may be said)"
                )
            if path.is_dir():
                return read_bag(path, where, arm, topic, spec)
        elif path.is_dir():
            if topic is not None:
                raise RecordingError(_without_topics(where, topic))
            return read_data_set(path, where, arm, spec)
        elif suffix not in _READERS:
            raise RecordingError(
                f"{where}: unsupported suffix {path.suffix!r}: expected {', '.join(LOG_SUFFIXES)}"
                f"{'; unpack it first' if suffix in PACKED_SUFFIXES else _looks_like(path, suffix)}"
            )
        if path.stat().st_size == 0:
            raise RecordingError(f"{where} is empty: expected a log of at least 2 samples")
        if topic is not None and suffix in _READERS:
            raise RecordingError(_without_topics(where, topic))
        if hint := _looks_like(path, suffix):
            raise RecordingError(f"{where} is not a {suffix} file{hint}")
        return read_bag(path, where, arm, topic, spec) if has_topics(path) else _READERS[suffix](path, where, arm, spec)
    except OSError as error:
        raise RecordingError(f"{where} cannot be read: {error.strerror or error}") from None


def is_log(path: str | Path) -> bool:
    """Whether a file's name is that of a log, packed or not."""
    path = Path(path)
    return (path.with_suffix("") if path.suffix.lower() in PACKED_SUFFIXES else path).suffix.lower() in LOG_SUFFIXES


def has_topics(path: str | Path) -> bool:
    """Whether a file or folder is a ROS bag, by its name."""
    path = Path(path)
    return not is_data_set(path) if path.is_dir() else form_of(path, FORMS) in BAG_SUFFIXES


def _without_topics(where: str, topic: str) -> str:
    return f"{where}: a topic ({topic!r}) was named, but only ROS bags have topics; leave it out"


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
    """A hint, if the file starts like one of another suffix, or was packed."""
    with path.open("rb") as file:
        head = file.read(_HEAD)
    for signature, (packer, packed) in _PACKED.items():
        if head.startswith(signature):
            say = f"let its name end in {suffix}{packed}" if packed in UNPACKED else "unpack it first"
            return f": it is packed with {packer}; {say}"
    if head.startswith(_ZIP) and (inside := _in_zip(path)):
        return inside
    for signature, suffixes in _SIGNATURES.items():
        if head.startswith(signature):
            return "" if suffix in suffixes else f": it starts like a {suffixes[0]} file; rename it"
    if head.startswith(_OCTAVE):
        return ": it is Octave's own text; save it with -v7"
    if suffix not in TABLES and _is_text(head) and not any(signature in head for signature in _SIGNATURES):
        return ": it is text; if it is a table, its name should end in .csv"
    return ""


def _in_zip(path: Path) -> str:
    """A hint, if an archive is none of NumPy's; a damaged one is left to who reads it."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return ""
    if any(name.startswith("xl/") for name in names):
        return ": it is a spreadsheet; save it as CSV"
    return "" if any(name.endswith(".npy") for name in names) else ": it is packed with zip; let its name end in .zip"


def _is_text(head: bytes) -> bool:
    text = head.decode("utf-8", errors="ignore")
    return len(text.encode()) > len(head) - 4 and all(x.isprintable() or x in "\r\n\t\ufeff" for x in text)

"""Logs as NumPy archives with the arrays t (N,), q, dq, tau (N, n); never with pickled objects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.errors import RecordingError, one_line
from armload.recording.columns import QUANTITIES, check_joint_count, checked_recording
from armload.recording.recording import CHANNELS, Recording

_ARRAYS = ("t", *QUANTITIES)
_LABELS = ("channel", "joint_names")


def read_npz(path: Path, where: str, arm: Arm | None = None) -> Recording:
    """Read an NPZ log; see `read_recording` for what it raises."""
    try:
        # opened here, because numpy leaves a file open that it cannot read
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise RecordingError(f"{where} holds one bare array: expected an archive with t, q, dq and tau")
            _check_names(archive.files, where)
            arrays = {name: archive[name] for name in archive.files}
    except RecordingError:
        raise
    except Exception as error:  # a damaged archive can fail anywhere between zip, zlib and the array header
        raise RecordingError(f"{where} is not a NumPy archive that can be read: {one_line(error)[:160]}") from None

    for name in _ARRAYS:
        if arrays[name].dtype.kind not in "iuf":
            raise RecordingError(f"{where}: array {name} holds {arrays[name].dtype}: expected real numbers")
    t, q = arrays["t"], arrays["q"]
    if t.ndim != 1 or q.ndim != 2 or 0 in q.shape[1:]:
        raise RecordingError(f"{where}: t has shape {t.shape} and q {q.shape}: expected (N,) and (N, n)")
    n = q.shape[1]
    for name in QUANTITIES:
        if arrays[name].shape != (len(t), n):
            turned = "; transpose it" if arrays[name].shape[::-1] == (len(t), n) else ""
            raise RecordingError(
                f"{where}: {name} has shape {arrays[name].shape}: expected {(len(t), n)}, one row per time{turned}"
            )
    if arm is not None:
        check_joint_count(n, where, arm)

    matrix = np.hstack([t[:, None], *(arrays[name] for name in QUANTITIES)]).astype(float)
    channel = str(arrays.get("channel", "measured"))
    if channel not in CHANNELS:
        raise RecordingError(f"{where}: channel is {channel[:24]!r}: expected one of {', '.join(CHANNELS)}")
    joints = tuple(str(name) for name in np.ravel(arrays["joint_names"])) if "joint_names" in arrays else None
    if joints is None or len(joints) != n:
        joints = None if arm is None else arm.joint_names
    return checked_recording(matrix, where, lambda k: f"row {k}", channel=channel, joint_names=joints)


def write_npz(path: Path, recording: Recording) -> None:
    """Write an NPZ log; channel and joint names go along as arrays of text."""
    arrays: dict[str, Any] = {name: getattr(recording, name) for name in _ARRAYS}
    arrays["channel"] = np.array(recording.channel)
    if recording.joint_names is not None:
        arrays["joint_names"] = np.array(recording.joint_names)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _check_names(names: list[str], where: str) -> None:
    missing = [name for name in _ARRAYS if name not in names]
    unexpected = [name for name in names if name not in (*_ARRAYS, *_LABELS)]
    if missing or unexpected:
        faults = [f"lacks {', '.join(missing)}"] if missing else []
        faults += [f"has the unexpected {', '.join(name[:24] for name in unexpected[:4])}"] if unexpected else []
        raise RecordingError(f"{where} {' and '.join(faults)}: expected the arrays t, q, dq and tau")

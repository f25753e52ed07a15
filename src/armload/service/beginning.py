"""What is checked before a service begins: whatever can never be ends it at once, and not each process in turn."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from armload.arms import arm
from armload.errors import ArmloadError, UsageError
from armload.runtime.extras import require
from armload.service.settings import NO_FILES, READ, ArmSettings, ServiceSettings


def checked(settings: ServiceSettings) -> None:
    """Make once what each process will make, so that what cannot be is said at once.

    Raises:
        ArmloadError: an arm, a frame, a rating or a kind of source that there is not, a folder that cannot be
            written into, or a package that a record needs.
    """
    from armload.devices.opening import check_spec  # with what reads robots, of which the supervisor needs nothing

    for each in settings.arms:
        try:
            gravity = {} if each.gravity is None else {"gravity": each.gravity}
            arm(each.robot, each.frame, **gravity)
            check_spec(each.source)
        except ArmloadError as error:
            raise type(error)(f"{each.name}: {error}") from None
        _check_files(each)
        if each.save is not None:
            _check_folder(f"{each.name}: its state cannot be kept in", Path(each.save), made=True)
        if each.record is not None:
            _check_folder(f"{each.name}: its record cannot be kept in", Path(each.record).parent, made=False)
            if each.record.lower().endswith(".mcap"):
                _check_mcap(each.name)


def _check_files(arm: ArmSettings) -> None:
    """See that there is what an arm's process will read: it would say so only once it has begun."""
    for key in ("source", *READ):
        named = getattr(arm, key)
        if named is None or named in NO_FILES or (key == "source" and not arm.replays):
            continue
        if not Path(named).exists():
            what = "a log" if key == "source" else "a file"
            raise UsageError(f"{arm.name}: {key}: {named} does not exist: expected the path of {what}")


def _check_mcap(name: str) -> None:
    try:
        require("mcap", "rosbags")
    except ModuleNotFoundError as error:
        raise UsageError(f"{name}: record: {error}") from None


def _check_folder(what: str, folder: Path, made: bool) -> None:
    """See that files can be written into a folder, which is made if it is to be."""
    try:
        if made:
            folder.mkdir(parents=True, exist_ok=True)
        if not folder.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except FileExistsError:
        raise UsageError(f"{what} {folder}: it is no folder; name one") from None
    except OSError as error:
        raise UsageError(f"{what} {folder}: {error.strerror}; name a folder that can be written into") from None

"""The logs that the options of a command name, and what they say of their columns."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from armload.app.cli.arguments import AS_NAMED, COLUMN_OPTIONS
from armload.app.cli.idle import given, refuse_idle
from armload.app.cli.named import names_motion, payload_of
from armload.errors import NoEpisodesError, RecordingError, UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.recording import ColumnSpec, Recording


def columns_of(options: argparse.Namespace, of_tare: bool = False) -> ColumnSpec:
    """What `--columns` and its companions say of the log, or of the tare: the same unless `--tare-columns` differs."""
    from armload.recording import ColumnSpec

    if of_tare and (given := getattr(options, "tare_columns", None)) is not None:
        spec = ColumnSpec() if given == AS_NAMED else ColumnSpec.of(given)
    else:
        companions = {"tau": "effort_key", "rate": "log_rate", "episode": "episode"}
        more = {key: getattr(options, name, None) for key, name in companions.items()}
        spec = ColumnSpec.of(options.columns).over(**more)
    episode = getattr(options, "tare_episode", None) if of_tare else None
    return spec if episode is None else replace(spec, episode=episode)


def columns_for(options: argparse.Namespace, log: str | None, tare: str | None, of_tare: bool) -> ColumnSpec | None:
    """What `--columns` says of a log, or of its tare: nothing of a bag where the other is a table, which it is of.

    Raises:
        UsageError: it says units, which a bag has, too, and not of which of the two.
    """
    from armload.recording import ColumnSpec, has_topics

    path, other = (tare, log) if of_tare else (log, tare)
    own = getattr(options, "tare_columns", None) or (of_tare and getattr(options, "tare_episode", None) is not None)
    if not own and path is not None and other is not None and has_topics(path) and not has_topics(other):
        spec = columns_of(options)
        if spec.of_values != ColumnSpec():
            raise UsageError(
                "--columns says units, and of log and tare one is a bag, the other a table: say those of the tare with "
                f"--tare-columns ({AS_NAMED}, if its own header says all)"
            )
        return None
    return columns_of(options, of_tare)


def read_logs(
    options: argparse.Namespace,
    arm: Arm,
    log: str | None,
    tare: str | None = None,
    topics: tuple[str | None, str | None] | None = None,
) -> tuple[Recording | None, Recording | None]:
    """A log and its tare, by their paths; None stays None.

    Topics are for bags, columns for tables. Where there is none of the kind, reading says that they were named in vain.

    Args:
        options: of the command.
        arm: whose logs they are.
        log, tare: paths.
        topics: of each (default: `--topic`).
    """
    from armload.recording import has_topics

    of_tare = [getattr(options, name, None) for name in ("tare_columns", "tare_episode")]
    if of_tare != [None, None] and options.tare is None:
        raise UsageError("--tare-columns and --tare-episode are for a tare, but there is no --tare")
    bags = [path is not None and has_topics(path) for path in (log, tare)]
    read: list[Recording | None] = [None, None]
    for k, path in enumerate((log, tare)):
        if path is None:
            continue
        own = k == 1 and of_tare != [None, None]
        columns = columns_for(options, log, tare, of_tare=k == 1)
        topic = (topics or (getattr(options, "topic", None),) * 2)[k]
        topic = topic if bags[k] or not any(bags) else None
        try:
            read[k] = _read(path, arm, topic, columns, of_the_other=k == 1 and not own)
        except RecordingError as error:
            if k == 1 and not own and columns is not None and _reads(path, arm):
                raise RecordingError(
                    f"{error}; if the tare's own header says all, add --tare-columns {AS_NAMED}"
                ) from None
            raise
    return read[0], read[1]


def _read(path: str, arm: Arm, topic: str | None, columns: ColumnSpec | None, of_the_other: bool) -> Recording:
    """A log; one without episodes is read whole if the episode that is named is `of_the_other`."""
    from armload.recording import read_recording

    try:
        return read_recording(path, arm, topic=topic, columns=columns)
    except NoEpisodesError:
        if columns is None or not of_the_other:
            raise
        return read_recording(path, arm, topic=topic, columns=replace(columns, episode=None))


def _reads(path: str, arm: Arm) -> bool:
    """Whether a log can be read by what its header says alone."""
    from armload.recording import read_recording

    try:
        read_recording(path, arm)
    except RecordingError:
        return False
    return True


def with_gravity_put_back(
    log: Recording, tare: Recording | None, arm: Arm, payload: str
) -> tuple[Recording, Recording | None]:
    """Logs with the gravity that their controller took out of the torque: the arm's, and a payload's or `nothing`'s."""
    from armload.payloads import NOTHING
    from armload.recording import with_gravity

    held = None if payload == NOTHING else payload_of(payload, arm)  # once: it may be a pipe
    return with_gravity(log, arm, held), None if tare is None else with_gravity(tare, arm, held)


def check_columns(options: argparse.Namespace, *names: str | None) -> None:
    """Refuse what `--columns` and its companions say where none of the runs that are named is a log.

    Raises:
        UsageError: all of them are motions.
    """
    if all(name is None or names_motion(name) for name in names):
        refuse_idle(given(options, *COLUMN_OPTIONS), "of a log, and none is named")

"""Recordings: what a robot's joints did, the files they come in, and whether their data are valid."""

from armload.recording.alignment import Alignment, same_motion
from armload.recording.bag_parts import is_part_of_bag
from armload.recording.chunks import read_long, recording_chunks
from armload.recording.column_spec import ColumnSpec
from armload.recording.compensated import arm_as_set, with_gravity
from armload.recording.copies import check_own_measurements, digest_of, mark_of, marks_of, shared_samples
from armload.recording.files import (
    LOG_SUFFIXES,
    NAMED_SUFFIXES,
    PACKED_SUFFIXES,
    has_topics,
    is_log,
    log_in,
    read_recording,
    write_recording,
)
from armload.recording.lerobot import data_set_columns, data_set_episodes, digests_of_episodes, is_data_set
from armload.recording.recording import BLOCK, CHANNELS, GAP, JITTERED, Recording, Sample
from armload.recording.spooled import blocks, largest, parts_of, span
from armload.recording.steadied import steadied, with_velocities_of_positions
from armload.recording.steadying import Steadying
from armload.recording.turns import TURN, Turns, endless

__all__ = [
    "BLOCK",
    "CHANNELS",
    "GAP",
    "JITTERED",
    "LOG_SUFFIXES",
    "NAMED_SUFFIXES",
    "PACKED_SUFFIXES",
    "TURN",
    "Alignment",
    "ColumnSpec",
    "Recording",
    "Sample",
    "Steadying",
    "Turns",
    "arm_as_set",
    "blocks",
    "check_own_measurements",
    "data_set_columns",
    "data_set_episodes",
    "digest_of",
    "digests_of_episodes",
    "endless",
    "has_topics",
    "is_data_set",
    "is_log",
    "is_part_of_bag",
    "largest",
    "log_in",
    "mark_of",
    "marks_of",
    "parts_of",
    "read_long",
    "read_recording",
    "recording_chunks",
    "same_motion",
    "shared_samples",
    "span",
    "steadied",
    "with_gravity",
    "with_velocities_of_positions",
    "write_recording",
]

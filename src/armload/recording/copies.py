"""Whether two logs hold the same measurements: a copy, a cut, or two cuts of one log that overlap."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armload.errors import RecordingError
from armload.recording.recording import Recording, Sample
from armload.recording.spooled import blocks

# samples of a moving arm of which one is remembered: nine of three seconds at 200 Hz, 31 of 20 s at 100 Hz
# (test_a_part_of_an_old_log_is_not_learned_again)
ONE_IN = 64
# what a copy in fewer digits, other units or another type of number keeps: [rad, m, N·m, N] that a number is off by, at
# most, and the share of the samples that still say so. Copies with three decimals, five digits or as float32 keep 70 %
# and more, other logs of a real UR10e (the same motion, too), Panda and KUKA none of 5 000 to 10 000
# (test_a_log_in_fewer_digits_is_not_its_own_tare)
RESOLVED = 1e-3
COPIED = 0.1
# [rad/s] from which an arm surely moves: a real UR10e shows up to 0.0003 where it stands
MOVING = 0.05


def check_own_measurements(log: Recording, tare: Recording) -> None:
    """Refuse a tare that shares measured samples with the log: against itself a log weighs nothing, whatever it holds.

    Raises:
        RecordingError: they share samples.
    """
    if (count := shared_samples(log, tare) or copied_samples(log, tare)) > 0:
        raise RecordingError(
            f"the tare {tare.source} and the log {log.source} share {count} measured samples: expected an earlier log "
            "of its own, without what is to be identified; record one, or leave the tare out"
        )


def digest_of(log: Recording) -> str:
    """The first twelve digits of the SHA-256 of what was measured: the same of a copy, whatever its name and form."""
    digest = hashlib.sha256()
    for part in blocks(len(log)):
        for measured in (log.q[part], log.dq[part], log.tau[part]):
            digest.update(np.ascontiguousarray(measured + 0.0).tobytes())
    return digest.hexdigest()[:12]


def marks_of(log: Recording) -> tuple[str, ...]:
    """Hashes of one in `ONE_IN` of the samples at which the arm moves: which ones, the samples themselves decide.

    So a log and a part of it, or two that overlap, have marks in common, and logs of other measurements have none.
    Source: sampling by hash, Broder, Proc. Compression and Complexity of Sequences, 1997.
    """
    return tuple(mark for measured in _moving(log) if (mark := _mark(measured)) is not None)


def mark_of(sample: Sample) -> str | None:
    """The hash of one sample of a stream, as `marks_of` a log of it has it; None: it is none of those that are kept."""
    if not np.any(sample.dq):
        return None
    return _mark((np.concatenate([sample.q, sample.dq, sample.tau]) + 0.0).tobytes())


def shared_samples(log: Recording, other: Recording) -> int:
    """How many samples of one log are in the other, too: equal in every measured number, bit for bit.

    Of an arm that moves, position, velocity and torque of all joints never repeat, so that any such sample counts,
    whatever its time. One that stands may well measure the same twice: there the samples count only if their times are
    equal, too, and no time that both logs have shows anything else.
    """
    if log.n != other.n:
        return 0
    measured = set(_moving(other))
    if moving := sum(key in measured for key in _moving(log)):
        return moving
    here = np.minimum(np.searchsorted(log.t, other.t), len(log) - 1)
    there = np.flatnonzero(log.t[here] == other.t)
    here = here[there]
    return len(here) if _keys(log, here) == _keys(other, there) else 0


def copied_samples(log: Recording, other: Recording) -> int:
    """How many samples of one log are in the other in other digits: as text with some decimals, or as float32.

    Of a moving arm, positions and torques of all joints, each to `RESOLVED`. 0 where fewer than `COPIED` of the shorter
    log's are: those may be alike by chance.
    """
    if log.n != other.n:
        return 0
    ours, theirs = _rounded(log), _rounded(other)
    count = int(np.isin(ours, theirs).sum())
    return count if count > COPIED * min(len(ours), len(theirs)) else 0


def _rounded(log: Recording) -> NDArray[np.uint64]:
    """Hashes of the samples at which the arm surely moves, without their times and velocities, to `RESOLVED`.

    Σ_i a_i·round(x_i/1e-3) modulo 2⁶⁴ with odd a_i at random (Dietzfelbinger, STACS 1996).
    """
    odd = np.random.default_rng(0).integers(2**63, size=2 * log.n, dtype=np.uint64) * np.uint64(2) + np.uint64(1)
    found = [np.empty(0, np.uint64)]
    for part in blocks(len(log)):
        moving = np.max(np.abs(log.dq[part]), axis=1, initial=0.0) > MOVING
        measured = np.concatenate([log.q[part][moving], log.tau[part][moving]], axis=1)
        found.append(np.rint(measured / RESOLVED).astype(np.int64).view(np.uint64) @ odd)
    return np.concatenate(found)


def _mark(measured: bytes) -> str | None:
    value = int.from_bytes(hashlib.blake2b(measured, digest_size=7).digest())
    return f"{value // ONE_IN:012x}" if value % ONE_IN == 0 else None


def _moving(log: Recording) -> Iterator[bytes]:
    """The samples at which the arm moves."""
    for part in blocks(len(log)):
        yield from _keys(log, part.start + np.flatnonzero(np.any(log.dq[part], axis=1)))


def _keys(log: Recording, rows: NDArray) -> list[bytes]:
    """The samples at the given rows, without their times; −0.0 is 0.0."""
    return [row.tobytes() for row in np.concatenate([log.q[rows], log.dq[rows], log.tau[rows]], axis=1) + 0.0]

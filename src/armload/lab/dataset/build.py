"""Building a data set: simulate every run, keep what is finished, and put the table together at the end.

While it is being built the folder holds `provenance.json` (without a hash) and `parts/`, one file per batch of runs.
Each file appears whole or not at all, so that a build may be stopped at any moment and started again. At the end come
`table.parquet` and the hash in `provenance.json`, and the parts go. Two builds of the same data set in one folder take
each other's parts; whoever is first finishes it for both.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armload.arms import Arm
from armload.ensembles.progress import Progress, Report, reporter
from armload.errors import DatasetError
from armload.lab.dataset.parquet_table import IDENTITIES, Dataset, content_hash, open_dataset, read_table, table_columns
from armload.lab.dataset.provenance import (
    PROVENANCE_FILE,
    SAMPLERS,
    TABLE_FILE,
    differences,
    provenance_of,
    read_provenance,
    write_provenance,
)
from armload.lab.engine import engine
from armload.motion import Motion
from armload.payloads import Payload
from armload.recording import Recording
from armload.runtime.atomic import replacing
from armload.simulation import Run, Sensors, World, simulate_inverse, simulate_many

if TYPE_CHECKING:
    import pyarrow as pa

ROWS_PER_RUN = 3244  # the paper's 249 788 rows are 77 payloads × 3244
_BATCH = 16  # runs per part: what an interruption can lose
_PARTS = "parts"
_REQUEST = b"armload.dataset"


def build_dataset(
    path: str | Path,
    arm: Arm,
    motions: Sequence[Motion],
    payloads: Sequence[Payload],
    *,
    worlds: Sequence[World] | None = None,
    sensors: Sensors | None = None,
    rows_per_run: int = ROWS_PER_RUN,
    seed: int = 0,
    progress: bool | Report = True,
    cluster: str | None = None,
    sampler: str = SAMPLERS[0],
) -> Dataset:
    """Simulate every payload on every motion in every world and write one table with the paper's columns.

    The rows of a run are evenly spaced over its motion, at rate = rows_per_run/T: 3244 rows in 6 s are the paper's
    540.67 Hz. They lie at t = k/rate; the last instant, t = T, is the first one of the next period and is left out.

    Args:
        path: the folder of the data set; it must not exist, be empty, or hold the same data set, finished or not.
        arm: the nominal arm.
        motions, payloads, worlds: all combinations are run; worlds None: the nominal one.
        sensors: None: ideal. Rows stay evenly spaced and complete: jitter and lost samples are switched off.
        rows_per_run: samples kept of each run.
        seed: of the sensors' noise, which differs from run to run.
        progress: show a bar on stderr; or a function called with a `Progress` after every part.
        cluster: where the runs are simulated, as of `armload.lab.engine.engine`; its workers see the folder.
        sampler: mujoco, an arm under its controller (`simulate`); or inverse, a hundred times faster: an arm that
            follows its motion but for a drawn tracking error (`simulate_inverse`).

    Raises:
        DatasetError: the folder holds something else or a data set made otherwise, nothing to run was given, or there
            is no such sampler.
    """
    folder = Path(path)
    worlds = [World.nominal(arm)] if worlds is None else list(worlds)
    sensors = None if sensors is None else sensors.evenly()
    _check(arm, motions, payloads, worlds, rows_per_run)
    if sampler not in SAMPLERS:
        raise DatasetError(f"there is no sampler {sampler!r}: expected {' or '.join(SAMPLERS)}")
    provenance = provenance_of(arm, motions, payloads, worlds, sensors, rows_per_run, seed, sampler)
    try:
        if _claim(folder, provenance):
            _remove_parts(folder)  # of a build that was stopped between the hash and this
            return open_dataset(folder)
        runs = _runs(motions, payloads, worlds, sensors, seed)
        batches = [
            range(first, min(first + _BATCH, first - first % len(payloads) + len(payloads)))
            for start in range(0, len(runs), len(payloads))
            for first in range(start, start + len(payloads), _BATCH)
        ]  # no batch mixes motions, whose rates may differ
        _build_parts(folder, provenance, arm, runs, batches, progress, cluster)
        _finish(folder, provenance, batches)
    except OSError as error:
        if _finished(folder, provenance):  # by another build, which took the parts away
            _remove_parts(folder)
            return open_dataset(folder)
        raise DatasetError(
            f"{folder} cannot be written ({error.strerror or error}): free some space or choose another folder, then "
            "build again; it goes on where it was"
        ) from None
    return open_dataset(folder)


def _check(
    arm: Arm, motions: Sequence[Motion], payloads: Sequence[Payload], worlds: Sequence[World], rows_per_run: int
) -> None:
    for name, given in (("motions", motions), ("payloads", payloads), ("worlds", worlds)):
        if not given:
            raise DatasetError(f"a data set of no {name} was asked for: expected at least one")
    if rows_per_run < 2:
        raise DatasetError(f"rows_per_run is {rows_per_run}: expected at least 2")
    for motion in motions:
        if motion.n != arm.n:
            raise DatasetError(f"the motion {motion.name!r} has {motion.n} joints: {arm.name} has {arm.n}")
    for payload in payloads:
        if payload.parameters.frame not in (None, arm.frame):
            raise DatasetError(
                f"the payload {payload.name!r} is about the frame {payload.parameters.frame!r}: expected the arm's "
                f"payload frame {arm.frame!r}; move it there"
            )


def _claim(folder: Path, provenance: dict[str, Any]) -> bool:
    """Make the folder this data set's own; True if it holds it already, finished."""
    if folder.exists() and not folder.is_dir():
        raise DatasetError(f"{folder} is a file: expected a new or empty folder for the data set")
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / PROVENANCE_FILE).exists():
        strangers = sorted(entry.name for entry in folder.iterdir() if not entry.name.startswith("."))
        if strangers:
            raise DatasetError(f"{folder} holds other things ({', '.join(strangers[:3])}): expected an empty folder")
        write_provenance(folder, provenance)
        return False
    found = read_provenance(folder)
    if other := differences(provenance, found):
        raise DatasetError(
            f"{folder} holds a data set made with other {', '.join(other)}: expected the same; choose another "
            "folder, or delete this one"
        )
    return bool(found["sha256"])


def _runs(
    motions: Sequence[Motion], payloads: Sequence[Payload], worlds: Sequence[World], sensors: Sensors | None, seed: int
) -> list[tuple[Run, Payload, int, int, int]]:
    """Every run with its payload and the indices of payload, motion and world; payloads vary fastest."""
    out = []
    for w, world in enumerate(worlds):
        for m, motion in enumerate(motions):
            for p, payload in enumerate(payloads):
                noise = int(np.random.SeedSequence([seed, len(out)]).generate_state(1)[0])
                out.append((Run(motion, payload.parameters, world, sensors, noise), payload, p, m, w))
    return out


def _build_parts(
    folder: Path,
    provenance: dict[str, Any],
    arm: Arm,
    runs: list[tuple[Run, Payload, int, int, int]],
    batches: list[range],
    progress: bool | Report,
    cluster: str | None,
) -> None:
    def missing() -> Iterator[tuple[range, list[tuple[Run, Payload, int, int, int]]]]:
        for batch in batches:
            if not _is_whole(_part(folder, batch), provenance, batch):
                yield batch, [runs[k] for k in batch]

    (folder / _PARTS).mkdir(exist_ok=True)
    with reporter(progress) as report:
        done = len(runs) - sum(len(batch) for batch, _ in missing())
        report(Progress(f"simulating {arm.name}", done, len(runs)))
        with engine(1 if cluster is None else os.cpu_count() or 1, cluster) as on:
            for (batch, _), written in on.each(partial(_write_part, folder, provenance, arm), missing):
                if written is None:
                    raise DatasetError(
                        f"the process that simulated runs {batch.start} to {batch.stop - 1} was killed each time: "
                        "expected it to end; build again on workers with more memory"
                    )
                done += len(batch)
                report(Progress(f"simulating {arm.name}", done, len(runs)))


def _write_part(
    folder: Path,
    provenance: dict[str, Any],
    arm: Arm,
    item: tuple[range, list[tuple[Run, Payload, int, int, int]]],
) -> bool:
    """Simulate a batch of runs and write its part."""
    from pyarrow import parquet

    batch, runs = item
    rate = provenance["rows_per_run"] / runs[0][0].motion.duration
    logs = _sampled(arm, [run for run, *_ in runs], rate, provenance.get("sampler", SAMPLERS[0]))
    table = _table(arm, provenance, [(k, log, *one[1:]) for k, log, one in zip(batch, logs, runs, strict=True)])
    with replacing(_part(folder, batch)) as temporary:
        parquet.write_table(table, temporary, compression="zstd", write_page_checksum=True)
    return True


def _sampled(arm: Arm, runs: list[Run], rate: float, sampler: str) -> list[Recording]:
    if sampler == SAMPLERS[0]:
        return simulate_many(arm, runs, rate=rate)
    return [
        simulate_inverse(
            arm, run.motion, [(0.0, run.payload)], world=run.world, sensors=run.sensors, rate=rate, seed=run.seed
        )
        for run in runs
    ]


def _table(arm: Arm, provenance: dict[str, Any], logs: list[tuple[int, Recording, Payload, int, int, int]]) -> pa.Table:
    """The rows of some runs, with the hash of what they were made from in the metadata."""
    import pyarrow as pa

    rows = provenance["rows_per_run"]
    values, identity = [], []
    for run, log, payload, p, m, w in logs:
        if len(log) != rows:
            raise DatasetError(f"run {run} has {len(log)} samples: expected {rows}; the simulation lost some")
        phi = np.broadcast_to(payload.parameters.phi, (rows, 10))
        values.append(np.hstack([log.t[:, None], phi, log.q, log.dq, log.tau]))
        identity.append(np.broadcast_to([run, p, m, w], (rows, 4)))
    names = [*table_columns(arm.n), *IDENTITIES]
    arrays = [pa.array(column) for column in np.vstack(values).T]
    arrays += [pa.array(column.astype(np.int32)) for column in np.vstack(identity).T]
    return pa.Table.from_arrays(arrays, names=names).replace_schema_metadata({_REQUEST: content_hash(provenance, [])})


def _is_whole(part: Path, provenance: dict[str, Any], batch: range) -> bool:
    """Whether this batch is done: its file can be read and was made from the same provenance."""
    import pyarrow as pa

    try:
        table = read_table(part)
    except (OSError, pa.ArrowException):
        return False
    made_from = (table.schema.metadata or {}).get(_REQUEST, b"").decode(errors="replace")
    return made_from == content_hash(provenance, []) and len(table) == len(batch) * provenance["rows_per_run"]


def _finish(folder: Path, provenance: dict[str, Any], batches: list[range]) -> None:
    """Parts → table, then the hash, then away with the parts: stopped in between, nothing is lost."""
    from pyarrow import parquet

    parts = [_part(folder, batch) for batch in batches]
    schema = parquet.read_schema(parts[0]).remove_metadata()
    with (
        replacing(folder / TABLE_FILE) as temporary,
        parquet.ParquetWriter(temporary, schema, compression="zstd", write_page_checksum=True) as writer,
    ):

        def written() -> Iterator[pa.Table]:
            for part in parts:
                table = read_table(part).replace_schema_metadata(None)
                writer.write_table(table)
                yield table

        sha256 = content_hash(provenance, written())
    write_provenance(folder, {**provenance, "sha256": sha256})
    _remove_parts(folder)


def _finished(folder: Path, provenance: dict[str, Any]) -> bool:
    """Whether the folder holds this data set, with its hash."""
    try:
        found = read_provenance(folder)
    except DatasetError:
        return False
    return bool(found["sha256"]) and not differences(provenance, found)


def _remove_parts(folder: Path) -> None:
    """Away with the parts of a finished data set; another build may be doing so, too."""
    shutil.rmtree(folder / _PARTS, ignore_errors=True)


def _part(folder: Path, batch: range) -> Path:
    return folder / _PARTS / f"runs-{batch[0]:06d}-{batch[-1]:06d}.parquet"

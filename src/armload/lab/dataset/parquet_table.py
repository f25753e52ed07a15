"""The table of a data set: the paper's columns, one row per sample, and its check against the recorded hash.

For an arm with 7 joints the first 32 columns are those of Taie et al., RA-L 2024, Section IV: time, ten inertial
parameters, seven positions, velocities and torques. Four integer columns say which run, payload, motion and world.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import DatasetError, one_line
from armload.inertia import InertialParameters
from armload.lab.dataset.provenance import RESTORE, TABLE_FILE, canonical, read_provenance
from armload.recording import Recording

if TYPE_CHECKING:
    import pyarrow as pa

PARAMETERS = ("m", "mrx", "mry", "mrz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
IDENTITIES = ("run", "payload", "motion", "world")


def table_columns(n: int) -> list[str]:
    """Names of the real-valued columns for an arm with n joints: 11 + 3n of them, 32 for n = 7.

    >>> len(table_columns(7)), table_columns(7)[:4]
    (32, ['t', 'm', 'mrx', 'mry'])
    """
    return ["t", *PARAMETERS, *(f"{quantity}{j}" for quantity in ("q", "dq", "tau") for j in range(1, n + 1))]


@dataclass(frozen=True, eq=False)
class Dataset:
    """Many runs in one table, in the form learners take.

    X: (rows, 1 + 3n): t, q, dq, tau [s, rad, rad/s, N·m].
    y: (rows, 10): the payload's parameters, in the order of `armload.inertia.NAMES`.
    run, payload, motion, world: (rows,) integers: the run of each row, and the places of its payload, motion and world
        in the lists of the provenance.
    provenance: arm, motions, payloads, worlds, sensors, seed, versions, SHA-256: what the table was made from.
    path: the folder.
    """

    X: NDArray[np.float64] = field(repr=False)
    y: NDArray[np.float64] = field(repr=False)
    run: NDArray[np.int32] = field(repr=False)
    payload: NDArray[np.int32] = field(repr=False)
    motion: NDArray[np.int32] = field(repr=False)
    world: NDArray[np.int32] = field(repr=False)
    provenance: dict[str, Any] = field(repr=False)
    path: Path

    def __len__(self) -> int:
        return len(self.X)

    @property
    def n(self) -> int:
        """Number of joints."""
        return (self.X.shape[1] - 1) // 3

    @property
    def hash(self) -> str:
        """SHA-256 of the provenance and of every number in the table."""
        return self.provenance["sha256"]

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(self.run[-1]) + 1

    def recording(self, run: int) -> Recording:
        """One run as a log."""
        X = self.X[self._rows(run)]
        q, dq, tau = np.split(X[:, 1:], 3, axis=1)
        return Recording(X[:, 0], q, dq, tau, source=f"{self.path}, run {run}")

    def truth(self, run: int) -> InertialParameters:
        """The payload of one run, about the arm's payload frame."""
        return InertialParameters(self.y[self._rows(run)][0], self.provenance["arm"]["frame"])

    def _rows(self, run: int) -> slice:
        if not 0 <= run < self.runs:
            raise DatasetError(f"{self.path} has no run {run}: expected 0 to {self.runs - 1}")
        return slice(*np.searchsorted(self.run, [run, run + 1]))

    def __str__(self) -> str:
        p = self.provenance
        return (
            f"{len(self):,} rows: {self.runs} runs of {p['arm']['name']}, {len(p['payloads'])} payloads × "
            f"{len(p['motions'])} motions × {len(p['worlds'])} worlds, {p['rows_per_run']} rows each, "
            f"sha256 {self.hash[:12]}…"
        )


def open_dataset(path: str | Path) -> Dataset:
    """Open a finished data set and verify that not one number of it or of its provenance has changed.

    Raises:
        DatasetError: no data set, not finished, damaged or changed; the message says what to do.
    """
    import pyarrow as pa

    folder = Path(path)
    provenance = read_provenance(folder)
    if not provenance.get("sha256"):
        raise DatasetError(f"{folder} is not finished: build it again with the same arguments, it goes on where it was")
    try:
        table = read_table(folder / TABLE_FILE)
        n = (len(table.column_names) - len(PARAMETERS) - len(IDENTITIES) - 1) // 3
        columns = table_columns(n)
        values = np.column_stack([table.column(name).to_numpy() for name in columns])
        identity = [table.column(name).to_numpy().astype(np.int32) for name in IDENTITIES]
    except FileNotFoundError:
        raise DatasetError(f"{folder} lacks {TABLE_FILE}: {RESTORE}") from None
    except (OSError, KeyError, ValueError, TypeError, pa.ArrowException) as error:
        raise DatasetError(f"{folder / TABLE_FILE} is damaged ({one_line(error)[:120]}): {RESTORE}") from None
    found = content_hash(provenance, [table])
    if found != provenance["sha256"]:
        raise DatasetError(
            f"{folder} has changed since it was built: its hash is {found[:9]}…, expected {provenance['sha256'][:9]}…: "
            "restore it, or build it anew in an empty folder"
        )
    X, y = np.delete(values, np.s_[1:11], axis=1), np.ascontiguousarray(values[:, 1:11])
    return Dataset(X, y, *identity, provenance=provenance, path=folder)


def read_table(path: Path) -> pa.Table:
    """A Parquet file of this room, its page checksums verified."""
    from pyarrow import parquet

    with parquet.ParquetFile(path, page_checksum_verification=True) as file:
        return file.read()


def content_hash(provenance: dict[str, Any], tables: Iterable[pa.Table]) -> str:
    """SHA-256 of the provenance (without the hash itself) and of all numbers row by row as little-endian doubles.

    It does not depend on how Parquet stores them, nor on how the table is cut into pieces.
    """
    digest = hashlib.sha256(canonical({key: value for key, value in provenance.items() if key != "sha256"}))
    for table in tables:
        for batch in table.to_batches(max_chunksize=65536):
            digest.update(np.column_stack([np.asarray(c, dtype="<f8") for c in batch.columns]).astype("<f8").tobytes())
    return digest.hexdigest()

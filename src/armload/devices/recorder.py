"""A record of all samples, which can be read whatever becomes of the process that writes it.

As CSV it is an ordinary log (`read_recording` reads it) that only ever grows by whole lines. Each line is handed
over by itself, so that a process killed at any moment loses nothing that it had seen; a machine that loses its power
loses what its disk had not written, and the reader drops a last line that was cut off. As MCAP (`mcap_part`) it grows
by chunks of a second, has room for what is said of the samples, and is read by ROS 2 and Foxglove, too.

A log must be finite and strictly increasing in time. What is not goes to a file beside it: `run.csv` keeps its bad
samples in `run.bad.jsonl`, one JSON object per line: `why`, and t, q, dq and tau as they came. JSON has no numbers that
are not finite: they are the strings "NaN", "Infinity" and "-Infinity", which `float` understands. If the robot's clock
starts anew (two samples running before the last one kept), and after every six hours, the log goes on in `run.2.csv`,
`run.3.csv`, …
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import numpy as np

from armload.arms import Arm
from armload.devices.mcap_part import McapPart
from armload.devices.source import Source
from armload.errors import RecordingError
from armload.inertia import InertialParameters
from armload.online import OnlineEstimate
from armload.recording import Sample
from armload.recording.columns import column_names
from armload.recording.growing_file import RECORDS, GrowingFile

# [s] in one file: an MCAP's index waits in memory until its end, 11 MB with one topic; a CSV at 1 kHz reaches 9 GB
_LONGEST = 6 * 3600.0


class Recorder:
    """A log that can be read at any moment, whatever becomes of the process that writes it.

    Args:
        path: a `.csv` or `.mcap` file that does not exist yet, nor what may come beside it: nothing is ever written
            over.
        n: joints. arm: an MCAP names its joints, and says what it holds. epoch: of the source; an MCAP's stamps count
            from it.

    Attributes:
        kept: samples in the log, all its parts together.
        bad: samples in the file beside it.
        paths: the parts of the log, the first one as named.

    Raises:
        RecordingError: the file exists, is neither, or cannot be written.
    """

    def __init__(self, path: str | Path, n: int, arm: Arm | None = None, epoch: float | None = None) -> None:
        self.path = Path(path)
        if self.path.suffix.lower() not in RECORDS:
            raise RecordingError(
                f"a record is written as CSV or MCAP: expected a name that ends in .csv or .mcap, found {self.path}"
            )
        named = 0 if arm is None else arm.n
        if self.path.suffix.lower() == ".mcap" and named != n:
            raise RecordingError(f"{self.path}: an MCAP knows joints by name: expected {n}, found {named}")
        self.n, self._arm, self._epoch = n, arm, epoch
        self.kept = 0
        self.bad = 0
        self.paths: list[Path] = []
        self._bad_lines: GrowingFile | None = None
        self._last, self._began = -math.inf, math.inf  # times of the last sample, and of the first in this file
        self._late = math.inf  # time of the sample before, if it was a late one
        for other in _beside(self.path):  # refused now, not when it is needed
            if other.exists():
                raise RecordingError(f"{other} exists, and belongs to another record: choose another name than {path}")
        self._part = self._next_part()

    def append(self, sample: Sample) -> None:
        """Keep one sample.

        Raises:
            RecordingError: the disk is full or gone; what was written before can be read.
        """
        t, q, dq, tau = sample
        row = [float(t), *np.ravel(q).tolist(), *np.ravel(dq).tolist(), *np.ravel(tau).tolist()]
        if len(row) != 1 + 3 * self.n or np.size(q) != self.n or np.size(dq) != self.n:
            return self._refuse(sample, f"not {self.n} joints")
        if not all(map(math.isfinite, row)):
            return self._refuse(sample, "not finite")
        if row[0] <= self._last:
            anew, self._late = row[0] > self._late, row[0]
            if not anew:
                return self._refuse(sample, f"not after t = {self._last!r} s")
        if row[0] <= self._last or row[0] - self._began >= _LONGEST:
            self._part.close()
            self._part, self._began = self._next_part(), math.inf
        self._part.append(row)
        self._began = min(self._began, row[0])
        self._last, self._late = row[0], math.inf
        self.kept += 1
        return None

    def keep(self, estimate: OnlineEstimate) -> None:
        """Keep what is said of the payload; a CSV has no place for it. Raises as `append`."""
        if isinstance(self._part, McapPart) and self.kept:
            self._part.keep(estimate)

    def say(self, text: str, warning: bool = False) -> None:
        """Keep what happened; a CSV has no place for it. Raises as `append`."""
        if isinstance(self._part, McapPart):
            self._part.say(text, warning)

    def close(self) -> None:
        """Close the files; nothing happens the second time."""
        self._part.close()
        if self._bad_lines is not None:
            self._bad_lines.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next_part(self) -> _CsvPart | McapPart:
        path = _path_of_part(self.path, len(self.paths) + 1)
        if path.suffix.lower() == ".mcap":
            assert self._arm is not None
            part = McapPart(path, self._arm, self._epoch)
        else:
            part = _CsvPart(path, self.n)
        self.paths.append(path)
        return part

    def _refuse(self, sample: Sample, why: str) -> None:
        if self._bad_lines is None:
            self._bad_lines = GrowingFile(_path_of_bad(self.path))
        values = {name: _strict(np.asarray(value).tolist()) for name, value in sample._asdict().items()}
        self._bad_lines.append((json.dumps({"why": why, **values}, allow_nan=False) + "\n").encode())
        self.bad += 1


def next_free(path: str | Path) -> str:
    """The record's name, or the first of run.again1.csv, run.again2.csv, … under which a record can begin."""
    first, k = Path(path), 0
    name = first
    while any(other.exists() for other in (name, *_beside(name))):  # a record that was taken away may have left these
        k += 1
        name = first.with_suffix(f".again{k}{first.suffix}")
    return str(name)


def _beside(path: Path) -> tuple[Path, Path]:
    """What a record may need beside its file."""
    return _path_of_part(path, 2), _path_of_bad(path)


def _path_of_part(path: Path, part: int) -> Path:
    return path if part == 1 else path.with_name(f"{path.stem}.{part}{path.suffix}")


def _path_of_bad(path: Path) -> Path:
    return path.with_name(f"{path.stem}.bad.jsonl")


class Recorded(Source):
    """A source whose samples are kept as they pass.

    Args:
        source: any source; closed with this one.
        path, arm: of the log, see `Recorder`.
    """

    def __init__(self, source: Source, path: str | Path, arm: Arm | None = None) -> None:
        self.recorder = Recorder(path, source.n, arm, source.epoch)
        self.source = source
        self.name, self.n, self.rate, self.speed = source.name, source.n, source.rate, source.speed
        self.notes, self.epoch = source.notes, source.epoch

    def __iter__(self) -> Iterator[Sample]:
        for sample in self.source:
            self.recorder.append(sample)
            yield sample

    def close(self) -> None:
        """Close the source and the log."""
        self.source.close()
        self.recorder.close()

    def arrived(self) -> float | None:
        """When the source's sample arrived."""
        return self.source.arrived()

    def truth(self, t: float) -> InertialParameters | None:
        """What the source knows."""
        return self.source.truth(t)


def _strict(value: Any) -> Any:
    """Numbers, however nested, as strict JSON can hold them."""
    if isinstance(value, list):
        return [_strict(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return value


class _CsvPart:
    """One CSV log of a record."""

    def __init__(self, path: Path, n: int) -> None:
        self._lines = GrowingFile(path)
        try:
            self._lines.append((",".join(column_names(n)) + "\n").encode())
        except BaseException:
            self._lines.discard()  # whoever tries again would leave one empty log after the other
            raise

    def append(self, row: list[float]) -> None:
        self._lines.append((",".join(map(repr, row)) + "\n").encode())

    def close(self) -> None:
        self._lines.close()

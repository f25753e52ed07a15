"""Records of very many episodes: what is large of them stays in the files of their chunks, and is read when asked for.

Nine tenths of a record are its information, its vector and what its joints' scales do. A training goes through them
row by row, one chunk after the other, so that one or two chunks at a time are in memory, however many there are; the
rest of a record, some thirty numbers, is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import ModelError
from armload.lab.training.records import Records

LARGE = ("information", "vector", "moved")
_OPEN = 2  # [chunks] in memory: where the next one begins, the last is not yet done with


class Shards:
    """Some rows of an array that lies in files (`Records.save`), as far as an array is needed: one row, or fewer rows.

    Args:
        paths: the files. name: of the array in each. places: (N, 2) for each row, which file, and which row there.
    """

    def __init__(self, paths: Sequence[str], name: str, places: NDArray[np.int64]) -> None:
        self._paths, self._name, self._places = tuple(paths), name, places

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, rows: Any) -> Any:
        """The array of one row; of several, what can be asked for them."""
        places = self._places[rows]
        if places.ndim == 2:
            return Shards(self._paths, self._name, places)
        return _chunk(self._paths[places[0]])[self._name][places[1]]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[np.float64]:
        del copy  # it always is one
        return np.array([self[k] for k in range(len(self))], dtype=dtype)


@lru_cache(maxsize=_OPEN)
def _chunk(path: str) -> dict[str, NDArray[np.float64]]:
    records = Records.load(path)
    return {name: getattr(records, name) for name in LARGE}


def stored_records(paths: Sequence[str | Path], firsts: Sequence[int]) -> Records:
    """One `Records` of the chunks in some files; what is `LARGE` stays there.

    Args:
        paths: what `Records.save` wrote. firsts: number of each chunk's first episode.

    Raises:
        ModelError: a file is none; as long as the records are used, a file is gone.
    """
    if not paths:
        raise ModelError("no records of episodes: expected one file at least")
    names = [f.name for f in fields(Records) if f.name not in LARGE]
    small: dict[str, list[NDArray]] = {name: [] for name in names}
    places = []
    for k, (path, first) in enumerate(zip(paths, firsts, strict=True)):
        records = Records.load(path)
        records = replace(records, episode=records.episode + first)
        for name in names:
            small[name].append(getattr(records, name))
        places.append(np.stack([np.full(len(records), k), np.arange(len(records))], axis=1))
    where, rows = [str(path) for path in paths], np.concatenate(places)
    large: dict[str, Any] = {name: Shards(where, name, rows) for name in LARGE}
    return Records(**large, **{name: np.concatenate(parts) for name, parts in small.items()})

"""A ROS 1 bag's index in numbers: rosbags keeps an object of some 130 bytes for each message, here it is 24.

Messages come in the same order as from rosbags: by the time of logging, of equal times the connection asked for first.
"""

from __future__ import annotations

from collections.abc import Collection, Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import IndexData

_AT_ONCE = 1 << 14  # messages whose entries are objects for a while


class CompactReader(Reader):
    """A reader of rosbags whose index takes little memory; its `messages` and `connections` are what is used of it."""

    def __init__(self, path: Any) -> None:
        super().__init__(path)
        self._parts: dict[int, list[NDArray[np.int64]]] = {}

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """The entries of one connection in one chunk: (M, 3) time [ns], chunk and offset."""
        read: dict[int, list[IndexData]] = _Lists()
        super().read_index_data(pos, read)
        for connection, entries in read.items():
            indexes[connection] = []
            self._parts.setdefault(connection, []).append(np.array(entries, dtype=np.int64).reshape(-1, 3))

    def messages(
        self, connections: Collection[Any] = (), start: int | None = None, stop: int | None = None
    ) -> Generator[tuple[Any, int, bytes], None, None]:
        """As of rosbags."""
        chosen = [c.id for c in connections or self.connections]
        of_each = [np.concatenate(self._parts.get(number, [np.zeros((0, 3), np.int64)])) for number in chosen]
        entries, which = np.concatenate(of_each), np.repeat(np.arange(len(chosen)), [len(x) for x in of_each])
        del of_each
        if np.any(np.diff(entries[:, 0]) < 0):
            order = np.lexsort((np.arange(len(entries)), which, entries[:, 0]))
            entries, which = entries[order], which[order]
        for k in range(0, len(entries), _AT_ONCE):
            block, of = entries[k : k + _AT_ONCE], which[k : k + _AT_ONCE]
            for i, number in enumerate(chosen):
                self.indexes[number] = [IndexData(*entry) for entry in block[of == i].tolist()]
            yield from super().messages(connections, start, stop)


class _Lists(dict[int, list[IndexData]]):
    """A list for each connection that is asked for."""

    def __missing__(self, connection: int) -> list[IndexData]:
        self[connection] = []
        return self[connection]

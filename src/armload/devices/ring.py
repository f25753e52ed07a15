"""A ring of samples in shared memory: one process writes, others read, nobody waits for anybody.

Every slot holds the sample's number (0, 1, 2, …), its numbers, and a check: the exclusive or of all their bits. A
reader copies slots and believes one only if number and check are right, whatever the writer did in the meantime and in
whatever order the processor shows it. Samples that were overwritten before they were read are counted as lost.

The memory has no name: it is reached through a file descriptor that a child process inherits, and is gone when the
last process that holds it is, however that one ended.
"""

from __future__ import annotations

import mmap
import os
import tempfile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import SourceError

_HEADER = 64  # bytes: written, capacity, columns
_SEED = np.int64(0x5EED)  # a slot of zeros is not a sample


class Ring:
    """The memory itself, and what its one writer does; `RingReader` reads.

    >>> ring = Ring.create(columns=4, capacity=8)
    >>> reader = RingReader(ring)
    >>> ring.write([0.0, 1.0, 2.0, 3.0])
    >>> reader.read().tolist(), reader.lost
    ([[0.0, 1.0, 2.0, 3.0]], 0)
    >>> ring.close()

    Args:
        descriptor: an open file of the right size, from `create` or inherited; closed with the ring.

    Raises:
        SourceError: the file is not a ring.
    """

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self._memory = mmap.mmap(descriptor, os.fstat(descriptor).st_size)
        self.header = np.frombuffer(self._memory, np.int64, _HEADER // 8)
        self.capacity, self.columns = int(self.header[1]), int(self.header[2])
        if self.capacity < 1 or len(self._memory) != _size(self.columns, self.capacity):
            raise SourceError(f"file descriptor {descriptor} is not a ring of samples")
        self.slots = np.frombuffer(self._memory, np.int64, offset=_HEADER).reshape(self.capacity, 2 + self.columns)
        self._values = self.slots[:, 2:].view(np.float64)
        self._row = np.empty(self.columns)

    @classmethod
    def create(cls, columns: int, capacity: int = 8192) -> Ring:
        """New memory for samples of so many numbers; the last capacity − 1 of them can be read."""
        descriptor = _nameless()
        os.truncate(descriptor, _size(columns, capacity))
        os.pwrite(descriptor, np.array([0, capacity, columns]).tobytes(), 0)
        return cls(descriptor)

    @property
    def written(self) -> int:
        """Samples written so far."""
        return int(self.header[0])

    def write(self, values: ArrayLike) -> None:
        """Add a sample (columns,); the oldest one gives way."""
        self._row[:] = values
        number = int(self.header[0])
        k = number % self.capacity
        self.slots[k, 0] = -1
        self._values[k] = self._row
        self.slots[k, 1] = _check(self._row.view(np.int64), np.int64(number))
        self.slots[k, 0] = number
        self.header[0] = number + 1

    def close(self) -> None:
        """Let go of the memory; nothing happens the second time."""
        if self.descriptor < 0:
            return
        del self.header, self.slots, self._values
        self._memory.close()
        os.close(self.descriptor)
        self.descriptor = -1


class RingReader:
    """Where one reader is.

    Attributes:
        next: number of the sample to be read next.
        lost: samples that were overwritten before this reader came to them.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self.next = 0
        self.lost = 0

    def read(self, most: int = 1024) -> NDArray[np.float64]:
        """The samples since the last call, at most so many, (N, columns); N = 0 if there is none."""
        ring = self._ring
        self._skip(ring.written - ring.capacity + 1)  # the writer may be in the oldest slot already
        numbers = np.arange(self.next, min(ring.written, self.next + most))
        slots = ring.slots[numbers % ring.capacity]  # a copy
        self._skip(ring.written - ring.capacity + 1)  # while they were copied
        first = min(self.next - int(numbers[0]), len(numbers)) if len(numbers) else 0
        numbers, slots = numbers[first:], slots[first:]
        values = np.ascontiguousarray(slots[:, 2:])
        wrong = (slots[:, 0] != numbers) | (slots[:, 1] != _check(values, numbers))
        whole = int(np.argmax(wrong)) if wrong.any() else len(numbers)
        self.next += whole
        return values[:whole].view(np.float64)

    def leave(self) -> int:
        """Leave out all but the newest sample; how many those were, which do not count as lost."""
        before, self.next = self.next, max(self.next, self._ring.written - 1)
        return self.next - before

    def _skip(self, oldest: int) -> None:
        if oldest > self.next:
            self.lost += oldest - self.next
            self.next = oldest


def _check(bits: NDArray[np.int64], number: NDArray[np.int64] | np.int64) -> NDArray[np.int64]:
    return np.bitwise_xor.reduce(bits, axis=-1) ^ number ^ _SEED


def _size(columns: int, capacity: int) -> int:
    return _HEADER + 8 * capacity * (2 + columns)


def _nameless() -> int:
    """An empty file in memory without a name."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("armload-samples")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())

"""An array in fewer bytes, and the same array again, bit for bit: what it says twice, and zeros, are left out.

Of matrices that are exactly symmetric only the lower triangle is kept; of a table of two axes what differs from the
line above, if that is less (in a row of the regression, the features of the pose are the same for each joint). Of all
these numbers those whose bits are not all zero are kept (a −0.0 is), behind one bit for each that says which they are.
No number is rounded, and nothing is searched for, as by a compressor: it takes about as long as a few copies. zlib at
its quickest makes them as small, but takes three to six times as long as the whole save does so, and a stream waits
meanwhile (`benchmarks/saved_states.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_BITS = {4: np.dtype("u4"), 8: np.dtype("u8")}  # numbers of so many bytes, seen as their bits
_LEAST = 4096  # [bytes] of an array that is worth the time; changes no number

How = tuple[str, Sequence[int], str]  # type, shape, and what was kept: one of these
_ALL, _LOWER, _CHANGED = "all", "lower triangles", "what differs from the line above"


def spared(array: NDArray) -> tuple[NDArray[np.uint8], How] | None:
    """The bytes that tell an array, and how to read them; None: they would not be fewer, or it is no array of numbers.

    Args:
        array: of any shape; the last two axes are those of matrices.
    """
    kind = _BITS.get(array.dtype.itemsize) if array.dtype.kind in "fiu" and array.dtype.isnative else None
    if kind is None or array.nbytes < _LEAST or not array.flags.c_contiguous:  # another order is another sum
        return None
    bits = array.view(kind)
    kept, what = _kept(bits)
    kept = kept.ravel()
    some = kept != 0
    which, values = np.packbits(some), kept[some]
    if which.nbytes + values.nbytes >= array.nbytes:
        return None
    return np.concatenate([which, values.view(np.uint8)]), (array.dtype.str, array.shape, what)


def whole(data: NDArray[np.uint8], how: How) -> NDArray:
    """The array that `spared` was given.

    Raises:
        ValueError: the bytes are not those of such an array.
    """
    name, shape, what = how
    dtype, count = np.dtype(name), math.prod(shape)
    first = -(-count // 8)
    if dtype.kind not in "fiu" or dtype.itemsize not in _BITS or count < 0 or len(data) < first:
        raise ValueError(f"{len(data)} bytes are no array of {name} {tuple(shape)}")
    kind = _BITS[dtype.itemsize]
    bits = np.zeros(count, kind)
    bits[np.unpackbits(data[:first], count=count).view(bool)] = data[first:].view(kind)
    bits = bits.reshape(shape)
    if what == _LOWER:
        bits = np.bitwise_or(bits, np.tril(bits, -1).swapaxes(-1, -2))
    elif what == _CHANGED:
        bits = np.bitwise_xor.accumulate(bits, axis=0)
    return bits.view(dtype)


def _kept(bits: NDArray) -> tuple[NDArray, str]:
    if _symmetric(bits):
        return np.tril(bits), _LOWER
    if bits.ndim == 2:
        changed = bits.copy()
        changed[1:] ^= bits[:-1]
        if np.count_nonzero(changed) < np.count_nonzero(bits):
            return changed, _CHANGED
    return bits, _ALL


def _symmetric(bits: NDArray) -> bool:
    if bits.ndim < 2 or bits.shape[-1] != bits.shape[-2]:
        return False
    turned = bits.swapaxes(-1, -2)
    return np.array_equal(bits[..., 0, :], turned[..., 0, :]) and np.array_equal(bits, turned)  # most fail at once

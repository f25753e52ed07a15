"""What is left out of an array is there again: each bit of each number."""

import numpy as np
import pytest

from armload.runtime.packing import Packer, Unpacker
from armload.runtime.sparing import spared, whole


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def symmetric(rng):
    A = rng.normal(size=(3, 40, 40))
    return A + A.swapaxes(1, 2)


ARRAYS = {
    "symmetric matrices": (lambda rng: symmetric(rng), 0.55),
    "lower triangles": (lambda rng: np.tril(rng.normal(size=(3, 40, 40)).astype(np.float32)), 0.57),
    "sums of which few are begun": (lambda rng: np.r_[rng.normal(size=(20, 7, 30)), np.zeros((236, 7, 30))], 0.1),
    "rows of which most is the same": (
        lambda rng: np.hstack([rng.normal(size=(7, 20)), np.tile(rng.normal(size=400), (7, 1))]),
        0.22,
    ),
    "a square table": (lambda rng: np.tril(rng.normal(size=(90, 90))), 0.55),
    "whole numbers": (lambda rng: np.r_[rng.integers(-3, 9, 100), np.zeros(900, int)], 0.15),
}


@pytest.mark.parametrize("kind", ARRAYS)
def test_an_array_in_fewer_bytes_is_the_same_array_again(kind, rng):
    make, share = ARRAYS[kind]
    array = make(rng)
    flat = array.reshape(-1)
    if array.dtype.kind == "f":  # what equals another number, or none, and is not the same bits
        flat[[0, -1]] = -0.0, np.nan
    if kind == "symmetric matrices":
        array[:, 3, 5], array[:, 5, 3], array[1, 7, 7] = np.inf, np.inf, -0.0
        array[-1, -1, -1] = np.nan
    data, how = spared(array)
    again = whole(data, how)
    assert data.nbytes < share * array.nbytes
    assert (again.dtype, again.shape, again.flags.c_contiguous) == (array.dtype, array.shape, True)
    assert again.tobytes() == array.tobytes()


def test_an_array_that_takes_no_fewer_bytes_is_written_as_it_is(rng):
    full, A = rng.normal(size=(30, 40)), symmetric(rng)
    A[2, 0, 1] = np.nextafter(A[2, 0, 1], 0.0)  # nearly symmetric
    for array in (full, A, np.asfortranarray(np.tril(A[0])), np.zeros(5), np.array(["a"] * 2000), full > 0.0):
        assert spared(array) is None


def test_a_packed_array_may_be_written_where_the_first_one_may(rng):
    fixed, free = symmetric(rng), symmetric(rng)
    fixed.setflags(write=False)
    packer = Packer({})
    node = packer.node([fixed, free, fixed, np.float64(2.0)])
    again = Unpacker(packer.objects, packer.arrays, {}).value(node)
    assert again[0] is again[2]
    assert [one.flags.writeable for one in again[:2]] == [False, True]
    assert np.array_equal(again[0], fixed)
    assert np.array_equal(again[1], free)
    assert sum(one.nbytes for one in packer.arrays) < 0.6 * (fixed.nbytes + free.nbytes)


@pytest.mark.parametrize(
    "wrong",
    [("|O", (3, 40, 40), "all"), ("<f8", (10**12,), "all"), ("<f8", (3, 40, 41), "all"), ("<f8", (-4800,), "all")],
)
def test_bytes_of_no_such_array_are_refused_before_memory_is_taken(wrong, rng):
    data, _ = spared(symmetric(rng))
    with pytest.raises(ValueError):  # noqa: PT011
        whole(data, wrong)

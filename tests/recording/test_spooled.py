"""A recording on disk is read as an array in memory is, whatever part of it is asked for."""

from __future__ import annotations

import errno
import resource

import numpy as np
import pytest

from armload import Recording
from armload.recording.recording import BLOCK
from armload.recording.spooled import spooled

COUNT = 2 * BLOCK + 100
ROWS = np.random.default_rng(4).integers(-COUNT, COUNT, 50)  # in no order, some of them twice


@pytest.fixture(scope="module")
def both():
    x = np.random.default_rng(3).normal(size=(3, COUNT, 4))
    whole = Recording(0.001 * np.arange(COUNT), *x)
    return whole, spooled([whole.select(slice(0, 1000)), whole.select(slice(1000, COUNT))], "log")


@pytest.mark.parametrize(
    "index",
    [
        slice(None),
        slice(10, BLOCK + 10),
        slice(BLOCK - 2, BLOCK + 2, 3),
        slice(20, 5, -1),
        slice(7, 7),
        5,
        -1,
        (slice(3, 9), 2),
        (4, 1),
        ROWS,
        ROWS.reshape(10, 5),
        (ROWS, 3),
        (ROWS, ROWS % 4),
        np.arange(COUNT) % 1000 == 3,
        [],
    ],
)
def test_any_part_is_what_an_array_gives(both, index):
    for name in ("q", "dq", "tau"):
        whole, disk = (getattr(log, name) for log in both)
        index_of_array = np.array(index, dtype=int) if isinstance(index, list) else index
        np.testing.assert_array_equal(disk[index], whole[index_of_array])


def test_a_part_of_a_part_is_where_it_was(both):
    whole, disk = (log.select(slice(500, 6000)).select(slice(100, 5000)) for log in both)
    np.testing.assert_array_equal(disk.tau[3:4500], whole.tau[3:4500])
    np.testing.assert_array_equal(np.asarray(disk.q), whole.q)


def test_a_row_that_is_not_there_is_an_index_error(both):
    for rows in (COUNT, [-COUNT - 1], [0, COUNT]):
        with pytest.raises(IndexError):
            both[1].q[rows]


def test_samples_come_one_by_one_and_end(both):
    assert sum(1 for _ in both[1].select(slice(0, 50))) == 50


def test_a_folder_without_room_for_the_samples_is_named(tmp_path):
    log = Recording(0.001 * np.arange(COUNT), *np.zeros((3, COUNT, 4)))
    most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, most[1]))  # as where the disk is full
    try:
        with pytest.raises(OSError, match="too large") as error:
            spooled([log], "log", tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, most)
    assert (error.value.errno, error.value.filename) == (errno.EFBIG, str(tmp_path))
    assert not list(tmp_path.iterdir())

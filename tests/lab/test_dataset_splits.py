"""Splits: every row in exactly one part, whole groups together, the same for the same seed."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armload.errors import DatasetError
from armload.lab.dataset import Dataset, split_motions, split_payloads, split_rows, split_worlds

GROUPED = {split_payloads: "payload", split_motions: "motion", split_worlds: "world"}


def table(payloads=20, motions=5, worlds=4, rows=3):
    """A data set of all combinations, with nothing in it but the identities."""
    w, m, p, _ = (x.ravel().astype(np.int32) for x in np.indices((worlds, motions, payloads, rows)))
    run = np.repeat(np.arange(len(p) // rows, dtype=np.int32), rows)
    made_from = {
        "payloads": [{"phi": [float(k)]} for k in range(payloads)],
        "motions": [{"fingerprint": f"motion {k}"} for k in range(motions)],
        "worlds": [{"fingerprint": f"world {k}"} for k in range(worlds)],
        "sha256": "0",
    }
    return Dataset(np.zeros((len(p), 22)), np.zeros((len(p), 10)), run, p, m, w, made_from, Path("none"))


fractions = st.tuples(*[st.integers(0, 10)] * 3).filter(any).map(lambda x: tuple(np.array(x) / sum(x)))


@pytest.mark.parametrize("split", [split_rows, *GROUPED])
@given(seed=st.integers(0, 2**31), shares=fractions)
def test_every_row_is_in_exactly_one_part(split, seed, shares):
    data = table()
    parts = split(data, seed, shares)
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.arange(len(data)))
    for part, share in zip(parts, shares, strict=True):
        assert np.all(np.diff(part) > 0)
        assert (len(part) == 0) == (share == 0)


@pytest.mark.parametrize("split", GROUPED)
@given(seed=st.integers(0, 2**31))
def test_a_group_is_never_in_two_parts(split, seed):
    data = table()
    group = getattr(data, GROUPED[split])
    seen = [set(group[part]) for part in split(data, seed)]
    assert sum(map(len, seen)) == len(set(group))


@pytest.mark.parametrize("split", GROUPED)
def test_what_is_listed_twice_is_never_in_two_parts(split):
    data, what = table(payloads=12, motions=12, worlds=12, rows=1), GROUPED[split]
    listed = data.provenance[f"{what}s"]
    listed[6:] = listed[:6]
    for seed in range(20):
        seen = [set(getattr(data, what)[part] % 6) for part in split(data, seed)]
        assert sum(map(len, seen)) == 6


def test_rows_of_one_payload_do_fall_into_all_parts_when_split_by_row():
    data = table()
    assert all(set(data.payload[part]) == set(data.payload) for part in split_rows(data))


@pytest.mark.parametrize("split", [split_rows, *GROUPED])
def test_the_seed_decides_and_nothing_else(split):
    data = table()
    for one, other in zip(split(data, 5), split(data, 5), strict=True):
        np.testing.assert_array_equal(one, other)
    assert any(not np.array_equal(split(data, 5).train, split(data, seed).train) for seed in range(6, 12))


@given(count=st.integers(3, 300), shares=fractions, seed=st.integers(0, 99))
def test_the_shares_are_met_to_the_nearest_group_that_leaves_none_empty(count, shares, seed):
    data = table(payloads=count, motions=1, worlds=1, rows=1)
    sizes = np.array([len(part) for part in split_payloads(data, seed, shares)])
    wanted = np.array(shares) * count
    assert np.all((np.abs(sizes - wanted) < 2) | (sizes == 1))


def test_the_papers_shares_of_its_own_rows_and_payloads():
    data = table(payloads=77, motions=1, worlds=1, rows=3244)
    assert [len(part) for part in split_rows(data)] == [174852, 37468, 37468]
    assert [len(set(data.payload[part])) for part in split_payloads(data)] == [54, 12, 11]


def test_too_few_groups_are_refused_with_what_to_do():
    data = table(worlds=2)
    with pytest.raises(DatasetError, match=r"has 2 worlds: expected at least 3 to split by worlds"):
        split_worlds(data)
    assert len(split_worlds(data, fractions=(0.5, 0.0, 0.5)).validation) == 0


@pytest.mark.parametrize("bad", [(0.5, 0.5), (0.7, 0.2, 0.2), (1.2, -0.1, -0.1), (np.nan, 0.5, 0.5)])
def test_fractions_that_are_none_are_refused(bad):
    with pytest.raises(DatasetError, match=r"expected three numbers from 0 to 1 that add up to 1"):
        split_rows(table(), fractions=bad)

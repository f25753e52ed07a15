"""Ways to split a data set into training, validation and test rows.

By **row** is what the paper does. It puts neighbours of every test row, a few milliseconds apart and with the same
payload, into training, so that it measures memorising. By **payload**, **motion** or **world** no test row has its
payload, motion or world in training: that measures what a learner makes of something new. Two of a data set's list that
are the same count as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.errors import DatasetError
from armload.lab.dataset.parquet_table import Dataset
from armload.lab.dataset.provenance import canonical

PAPER_FRACTIONS = (0.7, 0.15, 0.15)


class Split(NamedTuple):
    """Rows of a data set, each in exactly one of three ascending index arrays."""

    train: NDArray[np.intp]
    validation: NDArray[np.intp]
    test: NDArray[np.intp]


def split_rows(dataset: Dataset, seed: int = 0, fractions: Sequence[float] = PAPER_FRACTIONS) -> Split:
    """Rows at random, as the paper splits; see above for what this does not measure."""
    return _split(np.arange(len(dataset)), seed, fractions, "rows")


def split_payloads(dataset: Dataset, seed: int = 0, fractions: Sequence[float] = PAPER_FRACTIONS) -> Split:
    """Whole payloads at random: every row of a payload goes the same way."""
    return _split(_alike(dataset, "payload", "phi"), seed, fractions, "payloads")


def split_motions(dataset: Dataset, seed: int = 0, fractions: Sequence[float] = PAPER_FRACTIONS) -> Split:
    """Whole motions at random."""
    return _split(_alike(dataset, "motion", "fingerprint"), seed, fractions, "motions")


def split_worlds(dataset: Dataset, seed: int = 0, fractions: Sequence[float] = PAPER_FRACTIONS) -> Split:
    """Whole worlds at random."""
    return _split(_alike(dataset, "world", "fingerprint"), seed, fractions, "worlds")


def _alike(dataset: Dataset, what: str, known_by: str) -> NDArray[np.intp]:
    """Of each row (rows,), where its payload, motion or world is first listed."""
    first: dict[bytes, int] = {}
    alike = [first.setdefault(canonical(one[known_by]), k) for k, one in enumerate(dataset.provenance[f"{what}s"])]
    return np.array(alike)[getattr(dataset, what)]


def _split(group: NDArray[np.integer], seed: int, fractions: Sequence[float], what: str) -> Split:
    """Deal the groups out by the fractions of their number; group (rows,) is each row's group."""
    names, index = np.unique(group, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(names))
    bounds = np.cumsum(_counts(len(names), fractions, what))
    place = np.empty(len(names), dtype=int)
    place[order] = np.searchsorted(bounds, np.arange(len(names)), side="right")
    return Split(*(np.flatnonzero(place[index] == k) for k in range(3)))


def _counts(total: int, fractions: Sequence[float], what: str) -> list[int]:
    """How many of `total` go to each part: rounded so that they add up, at least one where the fraction is not 0."""
    parts = np.asarray(fractions, dtype=float)
    if parts.shape != (3,) or not np.all(parts >= 0) or abs(parts.sum() - 1.0) > 1e-9:
        raise DatasetError(f"fractions are {tuple(fractions)}: expected three numbers from 0 to 1 that add up to 1")
    wanted = parts > 0
    if total < wanted.sum():
        raise DatasetError(
            f"the data set has {total} {what}: expected at least {wanted.sum()} to split by {what}; split by something "
            "else, or build it with more"
        )
    counts = np.where(wanted, np.maximum(np.floor(parts * total + 1e-9), 1), 0).astype(int)
    while counts.sum() != total:
        surplus = counts - parts * total
        if counts.sum() < total:
            counts[np.argmin(np.where(wanted, surplus, np.inf))] += 1
        else:
            counts[np.argmax(np.where(counts > 1, surplus, -np.inf))] -= 1
    return counts.tolist()

"""Blocks of several stretches are the blocks of the signal that they are of."""

from __future__ import annotations

import numpy as np
import pytest

from armload.regression.block_means import BlockMeans


@pytest.mark.parametrize("counts", [[5], [3, 4], [200, 200], [256, 256, 256, 77, 1], [256] * 10])
def test_joined_stretches_have_the_sums_of_groups_of_blocks_that_follow_each_other(counts):
    rng, parts, signal = np.random.default_rng(1), [], []
    for count in counts:
        values = rng.normal(size=(count, 2, 3))
        part = BlockMeans((2, 3), 1.0)
        part.extend(np.ones(count), values)
        parts.append(part)
        signal.append(values)
    joined, signal = BlockMeans.joined(parts), np.concatenate(signal)
    group = round(joined.block)
    expected = [signal[k : k + group].sum(axis=0) for k in range(0, len(signal), group)]
    np.testing.assert_allclose(joined.sums[: len(expected)], expected, atol=1e-12)
    assert not joined.sums[len(expected) :].any()
    assert joined.duration == len(signal)
    assert joined.rate == 1.0
    assert group == 1 or 2 * len(signal) / group > len(joined.sums)  # no coarser than it must be

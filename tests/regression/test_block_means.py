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


def test_joined_stretches_of_blocks_that_are_longer_and_shorter_lose_none():
    """Of a long one pairs were joined; a short one beside it, ten times as loud, counts for its time all the same."""
    rng, parts, total = np.random.default_rng(5), [], 0.0
    for seconds, loud in ((10.0, 10.0), (200.0, 1.0), (2.0, 10.0)):
        part = BlockMeans(1, 0.25)
        values = loud * rng.choice([-1.0, 1.0], round(seconds / 0.05))
        part.extend(np.full(len(values), 0.05), values[:, None])
        parts.append(part)
        total += values.sum() * 0.05
    assert [part.block for part in parts] == [0.25, 1.0, 0.25]
    joined = BlockMeans.joined(parts)
    means, times, _ = joined.means()
    assert times.sum() == pytest.approx(212.0)
    assert joined.duration == pytest.approx(212.0)
    assert (means[:, 0] * times).sum() == pytest.approx(total)
    assert joined.long_run_variance()[0] == pytest.approx(0.05 * (200.0 + 100.0 * 12.0) / 212.0, rel=0.35)


def test_what_is_discounted_counts_for_its_share_of_a_variance_and_of_the_time():
    rng = np.random.default_rng(2)
    old, new = 2.0 * rng.normal(size=40), rng.normal(size=60)
    blocks = BlockMeans(1, 1.0)
    blocks.extend(np.ones(40), old[:, None])
    blocks.discount(0.25)
    blocks.extend(np.ones(60), new[:, None])
    weights = np.r_[np.full(40, 0.25), np.ones(60)]
    expected = np.average(np.r_[old, new] ** 2, weights=weights)
    assert blocks.long_run_variance()[0] == pytest.approx(expected, rel=1e-12)
    assert blocks.duration == pytest.approx(weights.sum(), rel=1e-12)


def test_blocks_that_are_joined_keep_what_their_parts_count_for():
    rng, parts, weights = np.random.default_rng(3), [], []
    for count, share in ((300, 0.5), (500, 1.0), (77, 0.1)):
        part = BlockMeans(1, 1.0)
        part.extend(np.ones(count), rng.normal(size=(count, 1)))
        part.discount(share)
        part.extend(np.ones(1), np.ones((1, 1)))
        weights.append(share * count + 1.0)
        assert part.duration == pytest.approx(weights[-1], rel=1e-12)
        parts.append(part)
    assert BlockMeans.joined(parts).duration == pytest.approx(sum(weights), rel=1e-12)
    more = BlockMeans(1, 1.0)
    more.extend(np.ones(200), np.ones((200, 1)))
    more.discount(0.3)
    before = more.duration
    more.extend(np.ones(100), np.ones((100, 1)))  # pairs are joined
    assert more.duration == pytest.approx(before + 100.0, rel=1e-12)


def test_a_run_that_is_discounted_for_days_keeps_blocks_enough_and_its_rate():
    """As an empty arm's that is taken up again every half minute: all that it holds counts for 100 s each time."""
    rng, blocks, held = np.random.default_rng(4), BlockMeans(1, 1.0), 0.0
    for _ in range(3000):  # a day
        blocks.extend(np.full(120, 0.25), 3.0 * rng.normal(size=(120, 1)))
        held += 30.0
        if held > 100.0:
            share = 100.0 / blocks.duration
            blocks.discount(share)
            held *= share
    _, times, weights = blocks.means()
    assert held == pytest.approx(100.0, abs=1.5)
    assert blocks.duration == pytest.approx(100.0, abs=0.5)
    assert weights.sum() > 20.0
    assert blocks.block <= 4.0
    assert blocks.rate == pytest.approx(4.0, rel=0.02)
    assert blocks.long_run_variance()[0] == pytest.approx(9.0 * 0.25, rel=0.4)
    assert (times > 0.0).all()

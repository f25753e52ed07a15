"""Rows that are made anew from the lags' states are those that were made at once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from armload.motion import random_motion
from armload.posterior import SmoothPosteriorLeastSquares
from armload.recording import BLOCK
from armload.regression import rows_of_log
from armload.regression.rows_of_log import RowsOfLog
from armload.simulation import simulate_inverse


@pytest.fixture(scope="module")
def log(panda):
    return simulate_inverse(panda, random_motion(panda, 3, duration=10.0), rate=1000.0, seed=1)


@pytest.mark.parametrize("kept", [0.0, 1e7, 1e12])
def test_any_part_of_the_rows_is_that_of_all_rows(panda, log, kept, monkeypatch):
    monkeypatch.setattr(rows_of_log, "_KEPT", kept)
    stream = SmoothPosteriorLeastSquares(panda).stream
    whole = stream.regression().rows(log.t, log.q, log.dq, log.tau)
    rows = RowsOfLog(stream.regression(), log)
    assert len(log) > 2 * BLOCK
    np.testing.assert_array_equal(rows.t, whole.t)
    for start, stop in ((0, len(whole.t)), (700, 1700), (5, 6), (1500, 1500), (300, 900)):
        parts = list(rows.between(start, stop))
        for k, expected in enumerate(whole):
            found = np.concatenate([part[k] for part in parts]) if parts else expected[:0]
            np.testing.assert_array_equal(found, expected[start:stop])


def test_parts_that_follow_each_other_make_the_rows_of_each_block_once(panda, log, monkeypatch):
    monkeypatch.setattr(rows_of_log, "_KEPT", 0.0)
    rows, made, make = RowsOfLog(SmoothPosteriorLeastSquares(panda).stream.regression(), log), [], RowsOfLog._made
    monkeypatch.setattr(RowsOfLog, "_made", lambda self, samples: made.append(samples.start) or make(self, samples))
    edges = np.linspace(0, len(rows.t), 31).astype(int)
    for start, stop in pairwise(edges):
        list(rows.between(start, stop))
    assert made == list(range(0, len(log), BLOCK))

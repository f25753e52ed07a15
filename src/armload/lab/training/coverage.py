"""How well the intervals of a hybrid hold, on episodes that its training had not seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.inertia import NAMES, Z95
from armload.lab.training.calibrating import fit_calibration, nearest
from armload.lab.training.records import TIMES, Records
from armload.posterior import Calibration, MixturePrior
from armload.posterior.evidence import KINDS

FOLDS = 4


@dataclass(frozen=True)
class Coverage:
    """How well the intervals held on episodes that training had not seen.

    pooled: share of all parameters, times and episodes that lay inside.
    cells: (3, B, 10) the same by what there was to compare with (`KINDS`), time and parameter; NaN where nothing was.
    ratio: (3, B, 10) mean half-width over mean absolute error. episodes: how many.
    counts: (3, B) how many of the episodes a cell rests on.
    """

    pooled: float
    cells: NDArray[np.float64]
    ratio: NDArray[np.float64]
    episodes: int
    counts: NDArray[np.int64]

    def table(self) -> dict[str, Any]:
        """The cells and what their axes are, ready for JSON; null where no episode was."""
        return {
            "compared_with": list(KINDS),
            "times": list(TIMES),
            "parameters": list(NAMES),
            "cells": _plain(self.cells.tolist()),
            "ratio": _plain(self.ratio.tolist()),
            "counts": self.counts.tolist(),
        }


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(part) for part in value]
    return round(value, 4) if value == value else None


def cross_validated(records: Records, prior: MixturePrior, seed: int = 0) -> Coverage:
    """Coverage of the intervals on held-out episodes: each fold is answered by a calibration fitted on the others.

    The folds together lie near 95 % whatever the luck of the draw: where one holds more of the wild episodes, the
    others' widths are the smaller. `coverage_on` new episodes tells how lucky the widths are.
    """
    episodes = np.random.default_rng([seed, 8]).permutation(np.unique(records.episode))
    error, half = np.zeros((2, len(records), 10))
    for k in range(FOLDS):
        held = np.isin(records.episode, episodes[k::FOLDS])
        calibration = fit_calibration(records.select(~held), prior, seed=seed + k)
        error[held], half[held] = _answered(records.select(held), prior, calibration)
    return _coverage(records, error, half)


def coverage_on(records: Records, prior: MixturePrior, calibration: Calibration) -> Coverage:
    """Coverage of a finished model's intervals on episodes that it was not trained on."""
    return _coverage(records, *_answered(records, prior, calibration))


def _answered(
    records: Records, prior: MixturePrior, calibration: Calibration
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Absolute errors and half-widths (N, 10)."""
    error, half = np.zeros((2, len(records), 10))
    for k in range(len(records)):
        found = calibration.answer(records.evidence(k), prior)
        error[k] = np.abs(found.mean - records.truth[k])
        half[k] = Z95 * np.sqrt(np.diag(found.covariance))
    return error, half


def _coverage(records: Records, error: NDArray[np.float64], half: NDArray[np.float64]) -> Coverage:
    inside = error <= half
    cells, ratio = np.full((len(KINDS), len(TIMES), 10), np.nan), np.full((len(KINDS), len(TIMES), 10), np.nan)
    counts, which = np.zeros((len(KINDS), len(TIMES)), dtype=int), nearest(records.t, np.array(TIMES))
    for kind in range(len(KINDS)):
        for b in range(len(TIMES)):
            rows = (records.kind == kind) & (which == b)
            counts[kind, b] = rows.sum()
            if rows.any():
                cells[kind, b] = inside[rows].mean(axis=0)
                ratio[kind, b] = half[rows].mean(axis=0) / error[rows].mean(axis=0)
    return Coverage(float(inside.mean()), cells, ratio, len(np.unique(records.episode)), counts)

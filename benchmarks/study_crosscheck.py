"""The study's trees and networks trained with scikit-learn alone: do their errors agree with those of its cells?

    python benchmarks/study_crosscheck.py [--data out/taie2024] [--networks]

Of armload only the data set is taken: splits, bagging, training and errors are scikit-learn's and NumPy's. Trees are
`BaggingRegressor(DecisionTreeRegressor())` with five members; --networks adds one `MLPRegressor` of 500 units with its
default stopping, on inputs and outputs in SI units, and counts its epochs. Writes results/study_crosscheck.json.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
from script import RESULTS, options, say, write
from sklearn.ensemble import BaggingRegressor
from sklearn.model_selection import GroupShuffleSplit, ShuffleSplit
from sklearn.neural_network import MLPRegressor
from sklearn.tree import DecisionTreeRegressor

from armload.lab.study import FULL, Basis


def parts(split: str, payload: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Training (70 %) and test rows (15 %), by row or by payload; trees do not use the rest."""
    kind, by = (ShuffleSplit, None) if split == "row" else (GroupShuffleSplit, payload)
    rest, test = next(kind(1, test_size=0.15, random_state=0).split(payload, groups=by))
    by = None if by is None else by[rest]
    train, _ = next(kind(1, train_size=0.7 / 0.85, random_state=1).split(rest, groups=by))
    return rest[train], test


def cell(name: str) -> list[float]:
    """Errors of a committed cell on its test rows."""
    text = (RESULTS / "taie2024" / f"{name}.json").read_text(encoding="utf-8")
    return json.loads(text)["protocols"]["held_out"]["single"]


def main() -> None:
    """Train, compare, write."""
    given = options(__doc__, data="out/taie2024", networks=False)
    dataset = Basis(Path(given.data), FULL).dataset("ideal")
    X, y, payload = dataset.X, dataset.y, dataset.payload
    result: dict = {"rows": len(X), "trees": {}}
    for split in ("row", "payload"):
        train, test = parts(split, payload)
        begun = time.perf_counter()
        trees = BaggingRegressor(DecisionTreeRegressor(), n_estimators=5, random_state=0).fit(X[train], y[train])
        errors = np.abs(trees.predict(X[test]) - y[test]).mean(axis=0)
        cells = np.array([cell(f"tree-1stage-raw-{split}-ideal-s{seed}") for seed in (0, 1, 2)])
        result["trees"][split] = {
            "scikit_learn": [float(f"{x:.6g}") for x in errors],
            "cells_mean": [float(f"{x:.6g}") for x in cells.mean(axis=0)],
            "cells_spread": [float(f"{x:.3g}") for x in cells.std(axis=0, ddof=1)],
            "seconds": round(time.perf_counter() - begun, 1),
        }
        say(f"trees, {split}: mass {1e3 * errors[0]:.1f} g, cells {1e3 * cells[:, 0].mean():.1f} g")
    if given.networks:
        train, test = parts("row", payload)
        network = MLPRegressor(hidden_layer_sizes=(500,), max_iter=1000, random_state=0).fit(X[train], y[train])
        errors = np.abs(np.asarray(network.predict(X[test]), dtype=float) - y[test]).mean(axis=0)
        result["network"] = {"epochs": network.n_iter_, "scikit_learn": [float(f"{x:.6g}") for x in errors]}
        say(f"network, row: {network.n_iter_} epochs, mass {1e3 * errors[0]:.1f} g")
    write("study_crosscheck", result)


if __name__ == "__main__":
    main()

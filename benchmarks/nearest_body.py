"""How near and how fast the nearest body is found: the package's solver and Clarabel on the same random estimates.

    python benchmarks/nearest_body.py [--cases 60]

Both are timed in one run, so that only the ratio means something. Clarabel runs at its default tolerances, and once
more at 1e-12. Writes benchmarks/results/nearest_body.json.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from script import options, say, write

from armload.inertia import near_consistent, nearest_consistent, pseudo_inertia, pseudo_inertia_to_phi

UNITS = np.array([1.0] + [0.1] * 3 + [0.01] * 6)
LENGTHS = np.diag([10.0, 10.0, 10.0, 1.0])
BALL = np.array([1.0, 0, 0, 0, 2.0, 0, 0, 2.0, 0, 2.0]) * UNITS
MARGIN = 1e-6
ENTRIES = [(i, j) for j in range(4) for i in range(j + 1)]


def svec(J: NDArray) -> NDArray:
    return np.array([J[i, j] * (1.0 if i == j else np.sqrt(2.0)) for i, j in ENTRIES])


def J(phi: NDArray) -> NDArray:
    return LENGTHS @ pseudo_inertia(phi) @ LENGTHS


TO_SVEC = np.array([svec(J(e * UNITS)) for e in np.eye(10)]).T


def by_clarabel(phi: NDArray, information: NDArray, tolerance: float | None = None) -> NDArray:
    weight = information * np.outer(UNITS, UNITS)
    target = phi / UNITS
    size = np.abs(target).max() + MARGIN
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    if tolerance is not None:
        settings.max_iter = 500
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    found = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(weight / np.abs(weight).max())),
        np.zeros(10),
        sparse.csc_matrix(-TO_SVEC),
        (TO_SVEC @ target - MARGIN * svec(np.eye(4))) / size,
        [clarabel.PSDTriangleConeT(4)],
        settings,
    ).solve()
    x = (target + size * np.array(found.x)) * UNITS
    return x + max(0.0, MARGIN - np.linalg.eigvalsh(J(x))[0]) * BALL


def metric(spread: float, rng: np.random.Generator) -> NDArray:
    """The information of numbers in UNITS whose own units differ by up to 10^spread either way."""
    root = (np.eye(10) + 0.3 * rng.normal(size=(10, 10))) * 10.0 ** rng.uniform(-spread, spread, 10)
    return (root.T @ root) / np.outer(UNITS, UNITS)


def estimates(spread: float, count: int) -> list[tuple[NDArray, NDArray]]:
    """Noisy estimates of four points' ten numbers that are no body's, and their information."""
    found: list[tuple[NDArray, NDArray]] = []
    rng = np.random.default_rng(1)
    while len(found) < count:
        points = np.column_stack([0.1 * rng.normal(size=(4, 3)), np.ones(4)])
        phi = pseudo_inertia_to_phi(points.T @ (rng.uniform(0.1, 1.0, 4)[:, None] * points))
        phi = phi + 0.3 * UNITS * rng.normal(size=10)
        if np.linalg.eigvalsh(J(phi))[0] < -MARGIN:
            found.append((phi, metric(spread, rng)))
    return found


def seconds(solve: Callable, cases: list) -> float:
    """Median over the cases of the best of five."""
    times = []
    for phi, information in cases:
        best = np.inf
        for _ in range(5):
            start = time.perf_counter()
            solve(phi, information)
            best = min(best, time.perf_counter() - start)
        times.append(best)
    return float(np.median(times))


def excess(x: NDArray, least: NDArray, phi: NDArray, information: NDArray) -> float:
    away, best = x - phi, least - phi
    return float(away @ information @ away / (best @ information @ best) - 1.0)


def main() -> None:
    asked = options(__doc__, cases=60)
    rows = []
    for spread in (0.0, 1.0, 2.0, 3.0):
        cases = estimates(spread, asked.cases)
        own = [nearest_consistent(*case) for case in cases]
        row: dict[str, float] = {"decades_of_units_either_way": spread, "cases": len(cases)}
        for name, tolerance in (("default", None), ("1e-12", 1e-12)):
            theirs = [by_clarabel(*case, tolerance) for case in cases]
            above = [excess(x, least, *case) for x, least, case in zip(theirs, own, cases, strict=True)]
            row[f"clarabel_{name}_above_ours_median"] = float(f"{np.median(above):.2g}")
            row[f"clarabel_{name}_above_ours_least"] = float(f"{min(above):.2g}")
            row[f"clarabel_{name}_above_ours_most"] = float(f"{max(above):.2g}")
        base = seconds(by_clarabel, cases)
        row["clarabel_over_nearest"] = round(base / seconds(nearest_consistent, cases), 1)
        row["clarabel_over_near"] = round(base / seconds(near_consistent, cases), 1)
        rows.append(row)
        say(str(row))
    what = "squared distance of Clarabel's body over that of nearest_consistent, less 1; time of Clarabel over ours"
    write("nearest_body", {"what": what, "rows": rows})


if __name__ == "__main__":
    main()

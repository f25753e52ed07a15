"""What finished cells say of a population: the comparison of its rows, and the numbers made of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import arm
from armload.lab.benchmark.benchmark_run import Size
from armload.lab.benchmark.populations import ALL, PRIOR, Population, population
from armload.lab.benchmark.rows import BASELINES, BOUND, TARED
from armload.lab.evaluation import Comparison, half_width
from armload.lab.report.shown import GROUPS


@dataclass(frozen=True, eq=False)
class Measured:
    """A population, measured: M rows on R episodes at T times.

    population: which. comparison: of all rows but the bound. seed: (R,) of each episode. refused: by row, how many
    episodes it would not answer. trained: by row, what it was trained on. bound: (R, T, 10) standard deviations of
    the Cramér–Rao bound, None if it is not measured. unfinished: rows that some seeds are missing of.
    """

    population: Population
    comparison: Comparison
    seed: NDArray[np.int64]
    refused: dict[str, int]
    trained: dict[str, str]
    bound: NDArray[np.float64] | None
    unfinished: tuple[str, ...]

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the rows (M,)."""
        return self.comparison.methods

    @property
    def times(self) -> NDArray[np.float64]:
        """(T,) [s] since the runs began."""
        return self.comparison.times

    @property
    def runs(self) -> int:
        """R, how many episodes."""
        return len(self.seed)

    def index(self, time: float) -> int:
        """Which of the times is nearest."""
        return int(np.argmin(np.abs(self.times - time)))

    @cached_property
    def absolute(self) -> NDArray[np.float64]:
        """|error| (M, R, T, 10)."""
        return np.abs(self.comparison.error)

    @cached_property
    def grouped(self) -> NDArray[np.float64]:
        """|error| averaged over the parameters of each group (M, R, T, 3): mass, first moment, inertia."""
        return np.stack([self.absolute[..., part].mean(axis=-1) for part in GROUPS.values()], axis=-1)

    def standard_error(self, errors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of the mean over the episodes, axis 1 of errors (M, R, …); NaN for a single one."""
        if self.runs < 2:
            return np.full_like(errors.mean(axis=1), np.nan)
        return errors.std(axis=1, ddof=1) / np.sqrt(self.runs)

    def seed_spread(self, errors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviation over seeds of their means, for errors (M, R, …); NaN for a single seed."""
        means = np.stack([errors[:, self.seed == seed].mean(axis=1) for seed in np.unique(self.seed)])
        return means.std(axis=0, ddof=1) if len(means) > 1 else np.full_like(means[0], np.nan)

    @cached_property
    def half_width(self) -> NDArray[np.float64]:
        """Half-widths of the rows' own 95 % intervals (M, R, T, 10); infinite where they know nothing."""
        return half_width(self.comparison.std)

    @cached_property
    def coverage(self) -> NDArray[np.float64]:
        """Share of the episodes whose 95 % interval holds the truth (M, T, 10)."""
        return np.mean(self.absolute <= self.half_width, axis=1)

    @cached_property
    def rms(self) -> NDArray[np.float64]:
        """Root mean square errors (M, T, 10)."""
        return np.sqrt(np.mean(self.comparison.error**2, axis=1))

    @cached_property
    def efficiency(self) -> NDArray[np.float64] | None:
        """Root mean square of the bound over that of the errors (M, T, 10): 1 leaves nothing in the data."""
        if self.bound is None:
            return None
        best = np.sqrt(np.mean(self.bound**2, axis=0))
        return best / np.maximum(self.rms, np.finfo(float).tiny)

    @cached_property
    def repeatability(self) -> NDArray[np.float64]:
        """Standard deviation of the estimates within a seed, root mean square over the seeds (M, T, 10).

        Means something where a seed shows one payload on one arm; NaN with fewer than two episodes a seed.
        """
        phi = self.comparison.phi
        if min(np.unique(self.seed, return_counts=True)[1]) < 2:
            return np.full_like(phi[:, 0], np.nan)
        variances = [phi[:, self.seed == seed].var(axis=1, ddof=1) for seed in np.unique(self.seed)]
        return np.sqrt(np.mean(variances, axis=0))

    def paired(self, a: str, b: str, factor: float = 1.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean over the episodes of |error of a| − factor·|error of b|, and its standard error: (T, 3) by group."""
        first, second = (self.grouped[self.rows.index(name)] for name in (a, b))
        difference = (first - factor * second)[None]
        return difference.mean(axis=1)[0], self.standard_error(difference)[0]

    def ratio(self, a: str, b: str) -> NDArray[np.float64]:
        """Mean |error| of a over that of b (T, 3) by group."""
        first, second = (self.grouped[self.rows.index(name)].mean(axis=0) for name in (a, b))
        return first / np.maximum(second, np.finfo(float).tiny)


def gather(cells: Mapping[str, dict[str, Any]], size: Size) -> dict[str, Measured]:
    """What finished cells say of each population, in the order of `populations.ALL`.

    Where a run was stopped, the rows that most seeds are finished of are compared on those; the others are named.
    """
    out = {}
    for name in ALL:
        of = population(name)
        by_row: dict[str, dict[int, dict[str, Any]]] = {}
        for cell in cells.values():
            if cell["population"] == name:
                by_row.setdefault(cell["row"]["name"], {})[cell["seed"]] = cell
        if not by_row:
            continue
        seeds = max((sorted(members) for members in by_row.values()), key=len)
        done = {row: [by_row[row][s] for s in seeds] for row in by_row if set(seeds) <= set(by_row[row])}
        rows = [row for row in _in_order(list(done), size) if row != BOUND]
        if rows:
            bound = np.concatenate([_array(c["std"]) for c in done[BOUND]]) if BOUND in done else None
            unfinished = tuple(row for row in by_row if row not in done)
            out[name] = _measured(of, rows, done, bound, unfinished, size)
    return out


def _measured(
    of: Population,
    rows: list[str],
    done: dict[str, list[dict[str, Any]]],
    bound: NDArray[np.float64] | None,
    unfinished: tuple[str, ...],
    size: Size,
) -> Measured:
    first = done[rows[0]]
    robot, counts = arm(size.robot), [len(cell["truth"]) for cell in first]
    seed = np.repeat([cell["seed"] for cell in first], counts)
    wall = np.array([np.concatenate([cell["wall_s"] for cell in done[row]]) for row in rows])
    shape = (len(rows), len(seed), len(size.times))
    comparison = Comparison(
        methods=tuple(rows),
        baselines=tuple(row for row in rows if row in BASELINES),
        averaged=(),
        labels=tuple(f"seed {s}, episode {k}" for s, n in zip(np.unique(seed), counts, strict=True) for k in range(n)),
        times=np.array(size.times),
        truth=np.concatenate([_array(cell["truth"]) for cell in first]),
        phi=np.array([np.concatenate([_array(cell["phi"]) for cell in done[row]]) for row in rows]),
        std=np.array([np.concatenate([_array(cell["std"]) for cell in done[row]]) for row in rows]),
        samples=np.zeros(shape, dtype=int),
        wall=wall,
        lengths=np.full(len(seed), round(size.rate * of.recipe.duration)),
        robot=size.robot,
        frame=str(robot.frame),
        split="nothing is trained on these episodes",
        seeds=tuple(np.unique(seed).tolist()),
        prior=PRIOR,
    )
    trained = {row: done[row][0]["trained"] for row in rows if done[row][0]["trained"]}
    refused = {row: n for row in rows if (n := sum(len(cell["refused"]) for cell in done[row]))}
    return Measured(of, comparison, seed, refused, trained, bound, unfinished)


def _in_order(rows: list[str], size: Size) -> list[str]:
    """As asked for, then what else there is, then the baselines."""
    place = {name.removesuffix(TARED): k for k, name in enumerate(size.methods)}  # where there is no tare
    place |= {name: k for k, name in enumerate(size.methods)}
    own = sorted((row for row in rows if row not in BASELINES), key=lambda row: (place.get(row, len(place)), row))
    return own + [row for row in BASELINES if row in rows]


def _array(values: Any) -> NDArray[np.float64]:
    """None reads as infinite."""
    found = np.array(values, dtype=float)
    return np.where(np.isnan(found), np.inf, found)

"""Running the benchmark: a cell is one row on the episodes of one seed of a population, kept as soon as it is done."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from armload.arms import Arm, arm
from armload.errors import ArmloadError, IdentificationError
from armload.estimators import Estimate
from armload.identification import METHODS
from armload.lab.benchmark.populations import ALL, REPEAT, Population, population, prior_of
from armload.lab.benchmark.rows import BOUND, Row, bound_std, default_names, fingerprint, rows_for, trained_on
from armload.lab.cells import key_of, load_cells
from armload.lab.episodes import Episode, EpisodeLogs, simulate_episodes
from armload.lab.experiment import Cells, Task, listed, run_tasks

FORMAT = 1  # of a cell; a change makes every cell unfinished
TIMES = (0.02, 0.1, 0.5, 1.0, 3.0, 6.0)  # [s] since the run began
FIRST_SEED = 900_001  # of the episodes: nothing is trained on it or on those that follow
_IN_EVERY_CELL, _OF_ROW = {"population", "seed", "row"}, {field.name for field in fields(Row)}
_REPEATED = 3  # arms and payloads whose repeatability is measured, at most


@dataclass(frozen=True)
class Size:
    """How much is measured.

    populations: names of `populations.ALL`. methods: names of rows (`rows.default_names`). episodes: of a population.
    rate: of the logs [Hz]. robot: which arm. times: [s] since a run began. per_seed: episodes of a seed; None: the
    population's own number.

    Raises:
        IdentificationError: nothing to measure.
    """

    populations: tuple[str, ...] = tuple(ALL)
    methods: tuple[str, ...] = tuple(default_names())
    episodes: int = 100
    rate: float = 1000.0
    robot: str = "panda"
    times: tuple[float, ...] = TIMES
    per_seed: int | None = None

    def __post_init__(self) -> None:
        if not self.populations or self.episodes < 1 or not self.rate > 0:
            raise IdentificationError(
                f"{self.episodes} episodes of {len(self.populations)} populations at {self.rate} Hz asked for: "
                "expected at least one of each"
            )
        for name in self.populations:
            rows_for(population(name), self.methods)

    def seeds(self, of: Population) -> list[tuple[int, int]]:
        """The seeds of a population, each with its number of episodes."""
        each = of.per_seed if self.per_seed is None else self.per_seed
        total = min(self.episodes, _REPEATED * each) if of.name == REPEAT else self.episodes
        counts = [min(each, total - first) for first in range(0, total, each)]
        return [(FIRST_SEED + k, count) for k, count in enumerate(counts)]


QUICK = Size(
    populations=("reference", "untared"),
    methods=("hybrid", "map-gp", "map", "rls-filter+tare", "rls-filter"),
    episodes=4,
    rate=100.0,
    per_seed=2,
)


def cell_name(population: str, seed: int, row: str) -> str:
    """Unique and readable; the file's stem."""
    return f"{population}-{seed}-{row.replace(' ', '-')}"


def keys(size: Size, robot: Arm, rows: dict[str, list[Row]]) -> dict[str, str]:
    """The key of every cell by its name: what it measures, on which logs, and what its method answers on a probe.

    Args:
        size: how much is measured. robot: the arm. rows: by population.
    """
    out, answered = {}, {}
    for name, members in rows.items():
        of = population(name)
        seeds = size.seeds(of)
        looks, prior = of.fingerprint(robot, FIRST_SEED), prior_of(of.recipe, robot)
        for row in members:
            # what the baselines answer depends on the population's prior, what the others do does not
            probe = (row, "" if row.method else key_of(prior.mean.tolist(), prior.covariance.tolist()))
            if probe not in answered:
                answered[probe] = fingerprint(row, robot, prior)
            for seed, count in seeds:
                parts = (FORMAT, looks, answered[probe], seed, count, size.rate, size.times)
                out[cell_name(name, seed, row.name)] = key_of(*parts)
    return out


def run_benchmark(
    size: Size,
    folder: str | Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    until: float | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Cells:
    """Measure what is not finished yet and return all cells of the benchmark that hold, by name.

    Args:
        size: how much is measured.
        folder: of the cells' files. Cells of other populations and methods of the same size are returned too: the
            tables show all there is.
        jobs, cluster, until, say: see `run_tasks`.
    """
    robot = arm(size.robot)
    # of other experiments and versions there may be some, too; which are damaged `run_tasks` says
    cells = {name: cell for name, cell in load_cells(folder, []).items() if _of_benchmark(cell)}
    say("checking what is finished")
    wanted = {name: rows_for(population(name), size.methods) for name in size.populations}
    valid = keys(size, robot, _with_finished(cells, wanted))
    others = {name: cell for name, cell in cells.items() if cell.get("key") == valid.get(name, "")}
    return others | run_tasks(_tasks(size, wanted, valid), folder, jobs=jobs, cluster=cluster, until=until, say=say)


def _of_benchmark(cell: dict[str, Any]) -> bool:
    """Whether a cell is one of this experiment, of a version whose rows are told by the same fields."""
    return cell.keys() >= _IN_EVERY_CELL and isinstance(cell["row"], dict) and cell["row"].keys() == _OF_ROW


def _with_finished(cells: Cells, wanted: dict[str, list[Row]]) -> dict[str, list[Row]]:
    """The rows wanted and those that there are cells of, by population."""
    rows = {name: {row.name: row for row in members} for name, members in wanted.items()}
    for cell in cells.values():
        row = Row(**cell["row"])
        if cell["population"] in ALL and row.method in ("", *METHODS):
            rows.setdefault(cell["population"], {}).setdefault(row.name, row)
    return {name: list(members.values()) for name, members in rows.items()}


def _tasks(size: Size, wanted: dict[str, list[Row]], valid: dict[str, str]) -> list[Task]:
    """All rows on the episodes of one seed are a task; the first seed of every population comes first."""
    tasks = []
    for name, rows in wanted.items():
        for k, (seed, count) in enumerate(size.seeds(population(name))):
            named = {cell_name(name, seed, row.name): row for row in rows}
            own = {cell: valid[cell] for cell in named}
            tasks.append((k, Task(f"{name}, seed {seed}", own, _measured, (named, name, seed, count, size), "row")))
    return [task for _, task in sorted(tasks, key=lambda numbered: numbered[0])]


@lru_cache(maxsize=2)
def _arm_of_process(robot: str) -> Arm:
    return arm(robot)


def _measured(
    missing: Sequence[str], rows: dict[str, Row], name: str, seed: int, count: int, size: Size
) -> Iterator[dict[str, Any]]:
    """Simulate the episodes once and put every missing row through them."""
    of = population(name)
    episodes = of.episodes(_arm_of_process(size.robot), seed, count)
    logs, prior = list(simulate_episodes(episodes, rate=size.rate)), prior_of(of.recipe, _arm_of_process(size.robot))
    for row in (rows[cell] for cell in missing):
        yield {
            "population": name,
            "seed": seed,
            "row": {"name": row.name, "method": row.method, "tared": row.tared},
            "times": list(size.times),
            **measure(row, episodes, logs, prior, size.times),
        }


def measure(
    row: Row, episodes: Sequence[Episode], logs: Sequence[EpisodeLogs], prior: Any, times: Sequence[float]
) -> dict[str, Any]:
    """What a row makes of episodes: `truth` (R, 10), `phi` and `std` (R, T, 10), `wall_s` (R,), `refused`, `trained`.

    A method that is not given the tare answers with the tool that was mounted already in it: the tool is taken off.
    One that refuses a log knows nothing: zeros, infinite standard deviations, and its words under `refused`. The bound
    has no estimates.
    """
    phi, std, wall, refused, trained = [], [], [], [], ""
    for episode, log in zip(episodes, logs, strict=True):
        begun = time.perf_counter()
        if row.name == BOUND:
            phi.append(np.tile(log.truth.phi, (len(times), 1)))
            std.append(bound_std(episode.arm, log, prior, times))
        else:
            try:
                identifier = row.make(episode.arm, log.tare, prior)
                found = identifier.at(log.run, times)
                trained = trained_on(identifier)
                known = episode.tool is not None and log.tare is not None and not row.tared
                tool = episode.tool.parameters.phi if known and episode.tool is not None else np.zeros(10)
            except ArmloadError as error:
                refused.append(str(error))
                found, tool = (
                    [Estimate(t, np.zeros(10), np.diag(np.full(10, np.inf)), 0, "") for t in times],
                    np.zeros(10),
                )
            phi.append(np.array([e.phi for e in found]) - tool)
            std.append(np.array([e.std for e in found]))
        wall.append(round(time.perf_counter() - begun, 4))
    return {
        "truth": [log.truth.phi.tolist() for log in logs],
        "phi": listed(np.array(phi)),
        "std": listed(np.array(std)),
        "wall_s": wall,
        "refused": refused,
        "trained": trained,
    }

"""Episodes turned into what the learned parts are fitted on: evidence at a few times, and the truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import ModelError, one_line
from armload.lab.engine import Engine
from armload.lab.episodes import Episode, simulate_episodes
from armload.posterior import Evidence, SmoothPosteriorLeastSquares
from armload.recording import Recording
from armload.runtime.atomic import replacing

TIMES = (0.02, 0.05, 0.1, 0.5, 1.0, 3.0, 6.0)  # [s] since the run began
_BATCH = 4  # episodes per task


@dataclass(frozen=True, eq=False)
class Records:
    """Evidence and truth of many episodes; row by row: an episode at one time, with or without its tare.

    information (N, 10, 10), vector (N, 10), gain_std (N,), traits (N, T), t (N,), kind (N,): see `Evidence`.
    truth: (N, 10) what identification was to find. episode: (N,) which episode. group: (N,) what it was drawn from.
    moved: (N, n, 10, 10) of the evidence; (N, 0, 10, 10) where joints have no scale of their own.
    """

    information: NDArray[np.float64]
    vector: NDArray[np.float64]
    gain_std: NDArray[np.float64]
    traits: NDArray[np.float64]
    t: NDArray[np.float64]
    kind: NDArray[np.int64]
    truth: NDArray[np.float64]
    episode: NDArray[np.int64]
    group: NDArray[np.str_]
    moved: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.t)

    def select(self, rows: Any) -> Records:
        """The given rows."""
        return Records(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def evidence(self, k: int) -> Evidence:
        """Row k as the identifier sees it."""
        moved = self.moved[k]
        return Evidence(
            self.information[k],
            self.vector[k],
            float(self.gain_std[k]),
            self.traits[k],
            float(self.t[k]),
            int(self.kind[k]),
            moved if len(moved) else None,
        )

    def save(self, path: str | Path) -> Path:
        """Write an .npz file; it appears whole or not at all."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, **{f.name: getattr(self, f.name) for f in fields(self)})
        return path

    @classmethod
    def load(cls, path: str | Path) -> Records:
        """Read what `save` wrote.

        Raises:
            ModelError: not such a file.
        """
        try:
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as data:
                return cls(**{f.name: data[f.name] for f in fields(cls)})
        except Exception as error:  # a damaged archive can fail anywhere between zip, zlib and the array header
            why = one_line(error)
            raise ModelError(f"{path} holds no records of episodes ({why}): delete it and make it again") from None

    @classmethod
    def joined(cls, parts: Sequence[Records]) -> Records:
        """All rows of several, one after another."""
        return cls(**{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)})


def measure_episodes(
    episodes: Sequence[Episode],
    *,
    times: Sequence[float] = TIMES,
    jobs: int = 1,
    on: Engine | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Records:
    """Simulate episodes and put each through the physics, with its tare and, as if there were none, without.

    Args:
        times: [s] since a run began, at which evidence is taken.
        jobs: processes; the records do not depend on it. on: where else they run, as of `armload.lab.engine.engine`.
        progress: called as progress(done, total).

    Raises:
        ModelError: the process of some episodes was killed each time.
    """
    firsts = range(0, len(episodes), _BATCH)
    parts: dict[int, Records] = {}

    def missing() -> Iterator[tuple[int, Sequence[Episode]]]:
        return ((k, episodes[k : k + _BATCH]) for k in firsts if k not in parts)

    for (first, _), part in (on or Engine(jobs)).each(partial(_measured, times=tuple(times)), missing):
        if part is None:
            raise ModelError(
                f"the process that simulated episodes {first} and following was killed each time: expected it to end; "
                "run it with fewer --jobs, or on workers with more memory"
            )
        parts[first] = part
        if progress is not None:
            progress(min(_BATCH * len(parts), len(episodes)), len(episodes))
    return Records.joined([parts[first] for first in firsts])


def _measured(item: tuple[int, Sequence[Episode]], times: tuple[float, ...]) -> Records:
    first, batch = item
    rows: list[tuple[Evidence, NDArray, int, str]] = []
    for k, (episode, logs) in enumerate(zip(batch, simulate_episodes(batch), strict=True), start=first):
        tool = 0.0 if episode.tool is None else episode.tool.parameters.phi
        without = logs.truth.phi if logs.tare is None else logs.truth.phi + tool
        group = f"{episode.population} {episode.world.name}"
        pairs = [(None, without)] + ([] if logs.tare is None else [(logs.tare, logs.truth.phi)])
        for tare, truth in pairs:
            rows += [(e, truth, k, group) for e in evidence_over_time(episode.arm, logs.run, tare, times)]
    evidence = [row[0] for row in rows]
    columns = {f.name: np.array([getattr(e, f.name) for e in evidence]) for f in fields(Evidence) if f.name != "moved"}
    columns["moved"] = np.array([np.zeros((0, 10, 10)) if e.moved is None else e.moved for e in evidence])
    truth, number, group = (np.array([row[k] for row in rows]) for k in (1, 2, 3))
    return Records(**columns, truth=truth, episode=number, group=group)


def evidence_over_time(arm: Any, run: Recording, tare: Recording | None, times: Sequence[float]) -> list[Evidence]:
    """Evidence `times` [s] after a run began."""
    physics = SmoothPosteriorLeastSquares(arm, tare, same_motion=True)
    physics.test_tare = False  # what a training learns is how far such evidence can be trusted
    stops = np.searchsorted(run.t, run.t[0] + np.asarray(times), side="right")
    out, start = [], 0
    for stop in np.maximum(stops, 2):
        part = slice(start, stop)
        if stop > start:
            physics._take(run.t[part], run.q[part], run.dq[part], run.tau[part])
        physics.conclude()
        out.append(physics.evidence())
        start = stop
    return out

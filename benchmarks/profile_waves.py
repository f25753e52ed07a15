"""What more features of the pose would be worth to a profile, and 384 that stand for 1024.

    python benchmarks/profile_waves.py [--arms 16] [--seed 47] [--runs 3] [--whole 3]

Arms, logs and answers are those of `life.py`, part same-day: Pandas that differ from their model as real ones do, 300 s
of one session about any poses of the arm. Each arm answers several runs of 6 s, with motion and payload of other
episodes, after 1 and 6 s, by the hybrid with

20 s elsewhere      a tare of 20 s
384 features        the profile as it is learned
directions          a profile of 1024 features f reduced to 384: the 256 directions V that the logs' poses determine
                    best, eigenvectors of Σ f(q)·f(q)ᵀ, and 128 others for what is left, each times √(1 − |Vᵀf(q)|²), so
                    that the prior variance is the same at every pose
half of them        the same with 128 directions and 64 others
1024 features       not reduced, of the first `whole` arms: a stream's row takes 2 ms, a file 16 MB

The features have one prior variance, so that directions at right angles have it, too. Errors are means over the arms,
over those of another row with the same arms and runs, ± one standard error, by leaving out one arm at a time. *width*
is that of the first moments' 95 % intervals; *left* is how much of the smooth mismatch's prior standard deviation a
profile leaves at the runs' poses. Printed, and written to benchmarks/results/profile_waves.json; 20 minutes of one
core.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from unittest.mock import patch

import numpy as np
from life import COARSE, DAYS, RATE, TIMES, empty_logs, motions_about, score
from numpy.typing import ArrayLike, NDArray
from script import markdown_table, options, say, write

from armload import Recording, arm
from armload.inertia import InertialParameters
from armload.lab.episodes import Episode, draw_episodes
from armload.posterior import learn_profile, profile_learning, profile_session, stream
from armload.posterior.profile import Profile
from armload.recording import GAP
from armload.regression import FilteredRegression, JointFeatures, information
from armload.regression.rows import Row, Rows
from armload.simulation import Run, simulate_many

MANY = 1024  # features that are reduced
SIZES = {"directions": (256, 128), "half of them": (128, 64)}  # directions, others for what is left
SPACING = 20  # [samples] between the poses that the directions are found from, 0.1 s
ELSEWHERE = 7  # episodes between those whose motions and payloads an arm answers
PARTS = {"mass": slice(0, 1), "first moments": slice(1, 4), "inertia": slice(4, 10)}


@dataclass(frozen=True, eq=False)
class Directions(JointFeatures):
    """K directions V (MANY, K) of many features, and others for what is left."""

    V: NDArray[np.float64] = field(default_factory=lambda: np.zeros((MANY, 0)))

    @classmethod
    def of(cls, logs: list[Recording], directions: int, others: int) -> Directions:
        """Those that the poses of logs determine best."""
        n = logs[0].q.shape[1]
        f = JointFeatures(n, MANY, 0).of_pose(np.concatenate([log.q[::SPACING] for log in logs]))
        V = np.linalg.eigh(f.T @ f)[1][:, : -directions - 1 : -1]
        return cls(n, directions + others, V=np.ascontiguousarray(V))

    def of_pose(self, q: ArrayLike) -> NDArray[np.float64]:
        f = JointFeatures(self.n, MANY, 0).of_pose(q) @ self.V
        left = np.sqrt(np.maximum(1.0 - (f**2).sum(axis=1), 0.0))
        others = JointFeatures(self.n, self.pose - f.shape[1], 0).of_pose(q)
        return np.concatenate([f, left[:, None] * others], axis=1)


class DirectedRows(FilteredRegression):
    """Rows whose features of the pose may be directions; others are as they were."""

    def __init__(self, robot: Any, gain: float, mismatch: Any, features: JointFeatures, *how: Any) -> None:
        self.features = features
        super().__init__(robot, gain, mismatch, features, *how)

    def reset(self) -> None:
        super().reset()
        self._directed = np.zeros((2, self.features.pose))  # states of the lags, their last inputs
        self._before = -np.inf  # [s] time of the last row

    def rows(self, t: ArrayLike, q: ArrayLike, dq: ArrayLike, tau: ArrayLike) -> Rows:
        rows = super().rows(t, q, dq, tau)
        if isinstance(self.features, Directions):
            of_pose = slice(self._wide, self._wide + self.features.pose)
            for k, f in enumerate(self.features.of_pose(rows.q)):
                step = rows.t[k] - self._before
                state, last = self._directed if step <= GAP else (np.zeros_like(f), f)
                x = self.gain * (step if step <= GAP else 0.0)
                self._directed = np.array([((2.0 - x) * state + x * (f + last)) / (2.0 + x), f])
                rows.X[k, :, of_pose], self._before = self._directed[0], rows.t[k]
        return rows

    def row(self, *sample: Any) -> Row | None:
        raise NotImplementedError("logs only: `rows`")


@contextmanager
def with_directions() -> Iterator[None]:
    """Rows may be of directions."""
    with (
        patch.object(information, "FilteredRegression", DirectedRows),
        patch.object(profile_session, "FilteredRegression", DirectedRows),
        patch.object(stream, "FilteredRegression", DirectedRows),
    ):
        yield


def learned(robot: Any, logs: list[Recording], features: JointFeatures) -> Profile:
    """A profile with these features of the pose."""
    with (
        patch.object(profile_learning, "CAPACITIES", (features.pose,)),
        patch.object(profile_learning, "JointFeatures", lambda *_: features),
    ):
        return learn_profile(robot, logs, sessions=[0] * DAYS)


def runs_of(e: Episode, others: list[Episode]) -> list[tuple[Recording, NDArray]]:
    """Runs of an arm with motion and payload of other episodes, and the payloads (10,)."""
    made = [
        Run(
            o.motion, InertialParameters(o.payload.parameters.phi), e.world, e.sensors, e.seed + 1000 * i, e.gains, 60.0
        )
        for i, o in enumerate(others)
    ]
    logs = simulate_many(e.arm, made, rate=RATE, duration=TIMES[-1], workers=1, resolution=COARSE)
    return [(log, o.truth.phi) for log, o in zip(logs, others, strict=True)]


def left(profile: Profile, poses: NDArray) -> float:
    """How much of the smooth mismatch's prior deviation is left at poses (N, n), root mean square."""
    prior = (profile.features.of_pose(poses) ** 2) @ profile.scales.features[:, : profile.features.pose].T
    return float(np.sqrt(np.mean(profile.uncertainty(poses) ** 2 / prior)))


def over(a: NDArray, b: NDArray) -> tuple[float, float]:
    """Σa/Σb and its standard error, by leaving out one at a time."""
    each = (a.sum() - a) / (b.sum() - b)
    return float(a.sum() / b.sum()), float(np.sqrt((len(a) - 1) * each.var()))


def compared(found: dict[str, list], name: str, base: str, t: float) -> dict[str, Any]:
    """One row after one time over another, of arms that have both."""
    pairs = list(zip(found[f"{name}|{t:g}"], found[f"{base}|{t:g}"], strict=False))
    error, half, before, wide = (np.array([[x[i] for x in pair[k]] for pair in pairs]) for k in (0, 1) for i in (0, 1))
    out: dict[str, Any] = {"arms": len(pairs), "over": base}
    for part, s in PARTS.items():
        ratio = over(error[..., s].mean(axis=(1, 2)), before[..., s].mean(axis=(1, 2)))
        out[part] = {
            "error": float(error[..., s].mean()),
            "ratio": ratio[0],
            "standard error": ratio[1],
            "width": float(half[..., s].mean() / wide[..., s].mean()),
            "inside": float((error <= half)[..., s].mean()),
        }
    return out


def measured(arms: int, seed: int, runs: int, whole: int) -> tuple[dict[str, list], dict[str, list]]:
    """Errors and half-widths by row and time, of each arm the runs'; and what is left."""
    panda, found, unknown = arm("panda"), {}, {}
    episodes = list(draw_episodes(panda, "elsewhere", arms, seed, motions=arms))
    for k, e in enumerate(episodes):
        others = [episodes[(k + ELSEWHERE * i) % arms] for i in range(runs)]
        made = runs_of(e, others)
        logs = empty_logs(e, [e.world] * DAYS, motions_about(e, "anywhere", k), 20.0, e.seed + 9)
        tare = empty_logs(e, [e.world], [e.tare_motion], 20.0, e.seed + 5)[0]
        profiles = {
            "384 features": learn_profile(panda, logs, sessions=[0] * DAYS),
            **{name: learned(panda, logs, Directions.of(logs, *size)) for name, size in SIZES.items()},
        }
        if k < whole:
            profiles[f"{MANY} features"] = learned(panda, logs, JointFeatures(panda.n, MANY))
        for name in ("20 s elsewhere", *profiles):
            rows: dict[str, list] = {}
            before = None if name in profiles else tare
            for run, truth in made:
                score(rows, name, e, run, truth, tare=before, profile=profiles.get(name))
            for key, values in rows.items():
                found.setdefault(key, []).append(values)
            if name in profiles:
                poses = np.concatenate([run.q[::SPACING] for run, _ in made])
                unknown.setdefault(name, []).append(left(profiles[name], poses))
        say(f"arm {k + 1} of {arms}")
    return found, unknown


def main() -> None:
    asked = options(__doc__, arms=16, seed=47, runs=3, whole=3)
    with with_directions():
        found, unknown = measured(asked.arms, asked.seed, asked.runs, asked.whole)
    names = list(dict.fromkeys(key.split("|")[0] for key in found))
    pairs = [(name, "384 features") for name in names] + [(f"{MANY} features", "directions")] * (asked.whole > 0)
    table = {f"{name}|over {base}|{t:g}": compared(found, name, base, t) for name, base in pairs for t in TIMES}
    rows = []
    for key, row in table.items():
        cells = [f"{row[part]['ratio']:.2f} ± {row[part]['standard error']:.2f}" for part in PARTS]
        inside = " · ".join(f"{100 * row[part]['inside']:.0f}" for part in PARTS)
        name = key.split("|")[0]
        unseen = f"{np.mean(unknown[name]):.2f}" if name in unknown else ""
        width = f"{row['first moments']['width']:.2f}"
        rows.append([name, row["over"], key.split("|")[2], str(row["arms"]), *cells, width, inside, unseen])
    say(markdown_table(["row", "over", "[s]", "arms", *PARTS, "width", "inside [%]", "left"], "ll" + 8 * "r", rows))
    write("profile_waves", {"seed": asked.seed, "runs": asked.runs, "rows": table, "left": unknown})


if __name__ == "__main__":
    main()

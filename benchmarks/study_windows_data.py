"""The windows of `study_windows.py`: what learners that are tied to no motion see of a log, with and without a tare.

A window is a run of 6 s as 30 means over 0.2 s. Its channels are one of

- `raw`: sin q, cos q, dq and tau; with a tare, the same of the tare beside them;
- `residual`: sin q, cos q, dq and r, the filtered torque that the bare model does not explain (`FilteredRegression`);
  with a tare, r less what a fit of the tare says of the arm there;
- `rows`: r, treated likewise, and W of r = W·phi (7·10).

The fit of a tare is a ridge regression of the arm's own mismatch, r = Z·eta; `ridge` is the same with the payload as
further unknowns, phi ~ N(mean, covariance of the training payloads): the simplest physics, a millisecond a log.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from learning_curves import RATE
from numpy.typing import NDArray

from armload import Arm, arm
from armload.arms import rated_effort
from armload.motion import FourierMotion, random_motion
from armload.payloads import draw_payload
from armload.recording import Recording
from armload.regression import Correction, FilteredRegression, GaussianPrior
from armload.runtime.atomic import replacing
from armload.simulation import Run, Sensors, World, simulate_inverse, simulate_many

INPUTS = ("raw", "residual", "rows")
TARES = ("no tare", "with tare")
DURATION, STEP = 6.0, 0.2  # [s] of a window, of a mean
MOTIONS = 2000  # of the training; each is drawn once
SHARD = 500  # episodes in a file
PRIOR_PAYLOADS = 1000  # of the training, whose mean and covariance `ridge` knows
# [effort limits·√s] noise of the ridge regression: best of 0.8, 1.6, 3.2, 6.4, 12.8e-3 on 100 training episodes
NOISE = 3.2e-3
_UNSEEN = 900_000_000  # from where on seeds are that training never draws


class Seen(NamedTuple):
    """What is kept of N episodes: channels (N, 30, c), answers of `ridge` and what it leaves, the truth (N, 10)."""

    raw: NDArray[np.float32]  # sin q, cos q, dq, tau
    tare: NDArray[np.float32]  # the same of the tare
    r: NDArray[np.float32]  # [N·m]
    r_tared: NDArray[np.float32]
    W: NDArray[np.float32]
    ridge: NDArray[np.float32]  # (N, 2, 34): for each of `TARES` phi, its standard deviation, rms and mean of the rest
    phi: NDArray[np.float64]


@lru_cache(maxsize=MOTIONS)
def motion(seed: int) -> FourierMotion:
    """A random motion of the arm."""
    return random_motion(arm("panda"), seed)


def episode(k: int) -> tuple[Recording, Recording, NDArray[np.float64]]:
    """Training episode k: log, tare and truth, by inverse dynamics, on an arm of its own from `World.real_like`."""
    robot = arm("panda")
    sensors, world = Sensors.panda(robot).evenly(), World.real_like(robot, k)
    payload = draw_payload("boxes", k)
    common: dict[str, Any] = {"world": world, "sensors": sensors, "rate": RATE, "duration": DURATION}
    log = simulate_inverse(robot, motion(k % MOTIONS), [(0.0, payload)], **common, seed=2 * k, start=60.0)
    tare = simulate_inverse(robot, motion((k + 1) % MOTIONS), **common, seed=2 * k + 1)
    return log, tare, payload.parameters.phi


def judged_runs(worlds: str, count: int) -> tuple[list[Run], list[Run], list[NDArray[np.float64]]]:
    """Runs of payloads, motions and arms that no training has, their tares' and the truth; arms are those of `worlds`,
    "real_like" or "beyond"."""
    robot, first = arm("panda"), _UNSEEN + (worlds == "beyond") * 100_000
    sensors, made = Sensors.panda(robot).evenly(), getattr(World, worlds)
    loaded, bare, truth = [], [], []
    for k in range(first, first + count):
        payload, world = draw_payload("boxes", k), made(robot, k)
        loaded.append(Run(random_motion(robot, k), payload, world, sensors, k, start=60.0))
        bare.append(Run(random_motion(robot, k + 10_000), None, world, sensors, k + 10_000))
        truth.append(payload.parameters.phi)
    return loaded, bare, truth


def judged(worlds: str, count: int) -> list[tuple[Recording, Recording, NDArray[np.float64]]]:
    """These runs by MuJoCo: log, tare and truth."""
    *both, truth = judged_runs(worlds, count)
    logs = (simulate_many(arm("panda"), runs, rate=RATE, duration=DURATION) for runs in both)
    return list(zip(*logs, truth, strict=True))


@lru_cache(maxsize=1)
def known() -> GaussianPrior:
    """Mean and covariance of training payloads."""
    return GaussianPrior.of([draw_payload("boxes", k).parameters for k in range(PRIOR_PAYLOADS)])


def means(values: NDArray) -> NDArray:
    """Means over `STEP` (30, ...) of one value for each sample (300, ...)."""
    steps, each = round(DURATION / STEP), round(STEP * RATE)
    return values[: steps * each].reshape(steps, each, *values.shape[1:]).mean(axis=1)


def raw_channels(log: Recording) -> NDArray[np.float64]:
    """sin q, cos q, dq, tau (30, 28)."""
    return means(np.column_stack([np.sin(log.q), np.cos(log.q), log.dq, log.tau]))


class Ridge:
    """r = W·phi + Z·eta with Gaussian priors and white noise of each joint, solved in closed form.

    Args:
        robot: the bare arm. noise: of its residual [effort limits·√s].
    """

    def __init__(self, robot: Arm, noise: float = NOISE) -> None:
        self._correction = Correction(robot, rated_effort(robot))
        self._robot, self._weight = robot, np.sqrt(STEP) / (noise * rated_effort(robot))  # of a mean's row
        std = self._correction.prior_std
        self._free = np.flatnonzero(std > 0.0)
        self._precision = np.diag(std[self._free] ** -2.0)

    def rows(self, log: Recording) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """r (30, n), W (30, n, 10) and Z (30, n, free) of a log."""
        r, X = FilteredRegression(self._robot, mismatch=self._correction)(log.t, log.q, log.dq, log.tau)
        X = means(X)
        return means(r), X[:, :, :10], X[:, :, 10:][:, :, self._free]

    def arm(self, r: NDArray, Z: NDArray) -> NDArray[np.float64]:
        """eta of a bare log, without those whose prior is zero."""
        A, b = self._normal(r, Z)
        return np.linalg.solve(A + self._precision, b)

    def payload(self, loaded: tuple, bare: tuple | None) -> NDArray[np.float64]:
        """phi (10,), its standard deviation (10,), rms (n,) and mean (n,) of what the solution leaves [N·m]."""
        r, W, Z = loaded
        X = np.concatenate([W, Z], axis=2)
        A, b = self._normal(r, X)
        prior = known()
        inverse = np.linalg.inv(prior.covariance)
        A[:10, :10] += inverse
        b[:10] += inverse @ prior.mean
        A[10:, 10:] += self._precision
        if bare is not None:
            B, c = self._normal(bare[0], bare[2])
            A[10:, 10:] += B
            b[10:] += c
        scale = 1.0 / np.sqrt(np.diag(A))
        covariance = scale[:, None] * np.linalg.inv(A * np.outer(scale, scale)) * scale
        found = covariance @ b
        left = r - X @ found
        return np.concatenate(
            [found[:10], np.sqrt(np.diag(covariance)[:10]), np.sqrt((left**2).mean(axis=0)), left.mean(axis=0)]
        )

    def _normal(self, r: NDArray, X: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        X = (X * self._weight[:, None]).reshape(-1, X.shape[2])
        return X.T @ X, X.T @ (r * self._weight).ravel()


def seen(episodes: list[tuple[Recording, Recording, NDArray[np.float64]]]) -> Seen:
    """What learners get of episodes."""
    ridge, kept = Ridge(arm("panda")), []
    for log, tare, phi in episodes:
        loaded, bare = ridge.rows(log), ridge.rows(tare)
        r, W, Z = loaded
        answers = np.array([ridge.payload(loaded, None), ridge.payload(loaded, bare)])
        r_tared = r - Z @ ridge.arm(bare[0], bare[2])
        kept.append((raw_channels(log), raw_channels(tare), r, r_tared, W.reshape(len(W), -1), answers, phi))
    *floats, truth = (np.array(column) for column in zip(*kept, strict=True))
    return Seen(*(x.astype(np.float32) for x in floats), truth)


def shard(folder: Path, number: int) -> Seen:
    """Training episodes number·500 … of a folder, made where they are not there yet."""
    path = folder / f"shard-{number:04d}.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        made = seen([episode(k) for k in range(number * SHARD, (number + 1) * SHARD)])
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **made._asdict())  # type: ignore[arg-type]
    with np.load(path) as file:
        return Seen(**file)


def joined(parts: list[Seen]) -> Seen:
    """Shards put together."""
    return Seen(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def channels(windows: Seen, what: str, tare: str) -> NDArray[np.float32]:
    """The channels (N, 30, c) of an input."""
    tared = tare == TARES[1]
    if what == "raw":
        return np.concatenate([windows.raw, windows.tare], axis=2) if tared else windows.raw
    r = windows.r_tared if tared else windows.r
    beside = windows.raw[:, :, :21] if what == "residual" else windows.W
    return np.concatenate([r, beside], axis=2)

"""Training a hybrid for any arm: draw episodes, put them through the physics, learn the payloads and the error bars."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, astuple, replace
from pathlib import Path
from platform import python_version

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, link_fingerprint, rated_mass
from armload.errors import ModelError
from armload.lab.cells import key_of
from armload.lab.engine import Engine
from armload.lab.episodes import LIGHTEST, POPULATIONS, TOOL_SHARE, Episode, draw_episodes
from armload.lab.training.added_families import DRAWS, with_added
from armload.lab.training.calibrating import fit_calibration
from armload.lab.training.coverage import FOLDS, Coverage, cross_validated
from armload.lab.training.records import TIMES, Records, measure_episodes
from armload.lab.training.shards import stored_records
from armload.payloads import draw_payload
from armload.posterior import TRAITS, HybridModel, MixturePrior, Training
from armload.regression import payload_prior_std
from armload.runtime.version import __version__, package_versions

EPISODES = 2400
CHUNK = 300  # episodes that are kept together: what an interruption can lose
_MOTIONS = 120  # of a chunk
_FIRST_SEED = 11  # of the first chunk; other seeds of a training begin far from it
# how often a family is expected; nothing at all is one, and without `light` a screw or a phone is taken for it
FAMILIES = {
    "boxes": 0.2,
    "shapes": 0.25,
    "tools": 0.1,
    "container": 0.2,
    "nothing": 0.1,
    "light": 0.05,
    "tool and payload": 0.1,
}
_PACKAGES = ("armload", "jax", "joblib", "mujoco", "numpy", "pin", "scikit-learn", "scipy")
# a payload unlike all families must not be pulled to one of them: a wide component, in units of the weak prior
_ANYTHING, _ANYTHING_SHARE = 2.0, 0.03


def train_hybrid(
    arm: Arm,
    *,
    episodes: int = EPISODES,
    seed: int = 0,
    folder: str | Path | None = None,
    jobs: int = 1,
    population: str = "broad",
    progress: Callable[[int, int], None] | None = None,
    on: Engine | None = None,
) -> tuple[HybridModel, Coverage]:
    """Train the learned parts for an arm on simulated episodes only.

    Args:
        arm: the bare arm, nominal.
        episodes: how many; a few hundred give a usable model, a thousand and more a calibrated one.
        seed: the same seed gives the same model on the same kind of machine.
        folder: where finished chunks of episodes are kept; the same call goes on from them. None: nowhere.
        jobs: processes; the model does not depend on it.
        population: that the episodes are drawn from.
        progress: called as progress(done, total).
        on: where else episodes are simulated, as of `armload.lab.engine.engine`.

    Returns:
        the model, with all that its file says of it, and the coverage of its kind on episodes held out
        (cross-validated).

    Raises:
        ModelError: too few episodes.
    """
    if episodes < 8 * FOLDS:
        raise ModelError(f"{episodes} episodes asked for: expected at least {8 * FOLDS}")
    records = episode_records(arm, population, episodes, seed, Path(folder) if folder else None, jobs, progress, on)
    prior = payload_mixture(arm, seed)
    checked = cross_validated(records, prior, seed)
    model = HybridModel(
        prior,
        fit_calibration(records, prior, seed=seed),
        arm.name,
        link_fingerprint(arm),
        str(arm.frame),
        arm.n,
        {**checked.table(), "versions": versions()},
        Training(population, episodes, seed, round(checked.pooled, 4)),
    )
    return model, checked


def versions() -> dict[str, str]:
    """Versions of what can change a trained number."""
    return {"python": python_version(), **package_versions(*_PACKAGES)}


def payload_mixture(arm: Arm, seed: int = 0) -> MixturePrior:
    """The payload prior for an arm: draws of every family, up to what the arm is rated for, and those added."""
    rng = np.random.default_rng([seed, 7])
    rated = rated_mass(arm)

    def drawn(family: str, count: int, most: float) -> NDArray[np.float64]:
        smaller = np.exp(rng.uniform(np.log(LIGHTEST), 0.0, size=count))
        sizes = most * np.where(rng.random(count) < POPULATIONS["broad"].lighter, smaller, 1.0)
        seeds = rng.integers(1 << 30, size=count)
        return np.array([draw_payload(family, int(s), m).parameters.phi for s, m in zip(seeds, sizes, strict=True)])

    samples = {f: drawn(f, DRAWS, rated) for f in ("boxes", "shapes", "tools", "container", "light")}
    samples["nothing"] = np.zeros((20, 10))
    tools = drawn("tools", DRAWS, TOOL_SHARE * rated)
    others = np.concatenate([samples["boxes"], samples["shapes"]])
    samples["tool and payload"] = tools + (1.0 - TOOL_SHARE) * others[rng.permutation(len(others))[:DRAWS]]
    fitted = MixturePrior.fit(samples, FAMILIES, seed)
    wide = np.diag((_ANYTHING * payload_prior_std(arm)) ** 2)
    fitted = fitted.joined(MixturePrior(np.ones(1), np.zeros((1, 10)), wide[None], ("anything",)), _ANYTHING_SHARE)
    return with_added(fitted, arm, seed)


def episode_records(
    arm: Arm,
    population: str = "broad",
    episodes: int = EPISODES,
    seed: int = 0,
    folder: Path | None = None,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
    on: Engine | None = None,
) -> Records:
    """What a training rests on: evidence and truth of its episodes. Arguments as of `train_hybrid`.

    With a folder, what is large of the records stays there (`shards`).
    """
    parts: list[Records] = []
    paths: list[Path] = []
    firsts = range(0, episodes, CHUNK)
    for first in firsts:
        count = min(CHUNK, episodes - first)
        path = None if folder is None else folder / f"episodes-{_key(arm, population, seed, first, count)[:12]}.npz"
        if path is None or not path.is_file():
            drawn = draw_chunk(arm, population, seed, first, count)

            def tell(done: int, _: int, first: int = first) -> None:
                if progress is not None:
                    progress(first + done, episodes)

            part = measure_episodes(drawn, jobs=jobs, on=on, progress=tell)
            if path is None:
                parts.append(replace(part, episode=part.episode + first))
                continue
            part.save(path)
        paths.append(path)
    return Records.joined(parts) if folder is None else stored_records(paths, firsts)


def _key(arm: Arm, population: str, seed: int, first: int, count: int) -> str:
    """Of everything that a chunk's records depend on."""
    facts = (arm.fingerprint, arm.known_as, arm.rated_payload, arm.link_spread, arm.motor_torque)
    known = (column for column in astuple(arm.limits) if column is not None)  # an arm without ends keeps its key
    limits = [np.nan_to_num(column, posinf=1e9, neginf=-1e9).tolist() for column in known]
    recipe = asdict(POPULATIONS[population]) if population in POPULATIONS else population
    return key_of(__version__, facts, limits, recipe, seed, first, count, TIMES, TRAITS)


def draw_chunk(arm: Arm, population: str, seed: int, first: int, count: int) -> list[Episode]:
    """The episodes of a training from number `first` on, not simulated; `first` is a multiple of `CHUNK`."""
    return draw_episodes(arm, population, count, 1000 * seed + _FIRST_SEED + first // CHUNK, motions=_MOTIONS)

"""Populations of episodes, by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from armload.arms import Arm
from armload.episodes.episode import Episode
from armload.episodes.motions import MotionSource
from armload.errors import ArmError
from armload.payloads import random_payload
from armload.simulate import Sensors, World

RUN, TARE = 6.0, 20.0  # [s] of the reference population
_POOL = 200  # motions of a kind drawn for one seed; beyond, they are used again in other worlds


def draw_episodes(arm: Arm, population: str, count: int, seed: int) -> list[Episode]:
    """`count` independent episodes; a longer list of the same seed begins with the shorter one.

    "reference": the population of `World.real_like` arms, payloads of one to four boxes, 6 s of a Fourier motion with
    five harmonics, from rest with a blend-in of 0.5 s, and a tare of 20 s on another motion of the bare flange.

    >>> from armload.arms import arm
    >>> episode = draw_episodes(arm("panda"), "reference", 1, seed=0)[0]
    >>> episode.world.name, episode.duration, episode.tare_duration
    ('real-like', 6.0, 20.0)

    Raises:
        ArmError: no such population, or a negative count or seed.
    """
    if population not in POPULATIONS:
        raise ArmError(f"no population is called {population!r}: expected one of {', '.join(POPULATIONS)}")
    if count < 0 or seed < 0:
        raise ArmError(f"{count} episodes of seed {seed} asked for: expected 0 or more of both")
    return POPULATIONS[population](arm, count, seed)


def sensors_of(arm: Arm) -> Sensors:
    """The Panda's sensors, or the like for another arm."""
    return Sensors.panda(arm) if arm.name == "panda" and arm.n == 7 else Sensors.generic(arm)


def _reference(arm: Arm, count: int, seed: int) -> list[Episode]:
    source, sensors = MotionSource(arm), sensors_of(arm)
    runs = [
        source.fourier(np.random.default_rng([seed, k, 1]), RUN, name=f"reference-{arm.name}-{seed}-{k}")
        for k in range(min(count, _POOL))
    ]
    tares = [
        source.fourier(np.random.default_rng([seed, k, 2]), TARE, harmonics=10, name=f"tare-{arm.name}-{seed}-{k}")
        for k in range(min(count, _POOL))
    ]
    episodes = []
    for k in range(count):
        rng = np.random.default_rng([seed, k, 3])
        payload, world, noise = (int(x) for x in rng.integers(1 << 30, size=3))
        # the pool again, every time in another pairing
        again = (k + 7 * (k // _POOL)) % _POOL
        episodes.append(
            Episode(
                arm,
                World.real_like(arm, world),
                runs[k % _POOL],
                RUN,
                random_payload(payload),
                sensors,
                tares[again if k >= _POOL else k],
                TARE,
                seed=noise,
                population="reference",
            )
        )
    return episodes


POPULATIONS: dict[str, Callable[[Arm, int, int], list[Episode]]] = {"reference": _reference}

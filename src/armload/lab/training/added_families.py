"""Two families that the payload prior has beside those of the episodes: wide, thin bodies, and light ones of all kinds.

A family of the prior is fitted on draws alone: torque is linear in phi, so that what a log says does not depend on
which payload it was of, and no episode is simulated for it. The shipped models had them added after their training
(`benchmarks/more_families.py`).

wide    trays, bars, discs, rings, of masses as the other families'. A tray has the mass and the centre of a compact
        body and several times its inertia: without components of its own the prior takes it for compact.
light   boxes, shapes, tools and containers for 3–30 % of what the arm is rated for, evenly in the logarithm. Inertia
        goes with mass to the power 5/3, so that components of heavier bodies say far too little of light ones'.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_mass
from armload.lab.episodes import LIGHTEST, POPULATIONS
from armload.payloads import draw_payload
from armload.posterior import MixturePrior

# how often a wide body is expected, of all payloads, a stated prior: with 0.1 fewer of the trays' intervals hold, with
# 0.2 the inertias of other bodies are off by more than without the family (seeds 700 and 701 of
# `benchmarks/coverage_cells.py`, 7700 of `benchmarks/wide_and_light.py`)
WIDE = 0.15
LIGHT = 0.1  # of the others, the same of light ones of every kind; a stated prior, twice that of the lightest
_LIGHTER = (0.03, 0.3)  # of what the arm is rated for: the other `light` family has less, all families have more
_KINDS = ("boxes", "shapes", "tools", "container")
DRAWS = 1500  # payloads of each kind or family that a prior is fitted on


def with_added(prior: MixturePrior, arm: Arm, seed: int = 0) -> MixturePrior:
    """The same prior, and the two families with their shares."""
    rng, rated = np.random.default_rng([seed, 8]), rated_mass(arm)

    def drawn(family: str, ratings: NDArray[np.float64]) -> NDArray[np.float64]:
        seeds = rng.integers(1 << 30, size=len(ratings))
        return np.array([draw_payload(family, int(s), m).parameters.phi for s, m in zip(seeds, ratings, strict=True)])

    def evenly(low: float, high: float) -> NDArray[np.float64]:
        return rated * np.exp(rng.uniform(np.log(low), np.log(high), size=DRAWS))

    lighter = rng.random(DRAWS) < POPULATIONS["broad"].lighter
    wide = drawn("wide", np.where(lighter, evenly(LIGHTEST, 1.0), rated))
    light = np.concatenate([drawn(kind, evenly(*_LIGHTER)) for kind in _KINDS])
    prior = prior.joined(MixturePrior.fit({"light": light}, {"light": 1.0}, seed), LIGHT)
    return prior.joined(MixturePrior.fit({"wide": wide}, {"wide": 1.0}, seed), WIDE)

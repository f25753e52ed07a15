"""What the benchmark is run on: populations of episodes by name, what each of them tries, what the baselines know."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from armload.arms import Arm, rated_mass
from armload.errors import ArmError
from armload.inertia import InertialParameters
from armload.lab.cells import key_of
from armload.lab.episodes import LIGHTEST, POPULATIONS, TOOL_SHARE, Episode, Recipe, draw_episodes, simulate_episodes
from armload.payloads import draw_payload
from armload.regression import GaussianPrior

REPEAT = "repeat"
_PAYLOADS = 400  # behind the baselines' prior
PRIOR = f"{_PAYLOADS} payloads of the population's family, of other seeds"
_PRIOR_SEED = 20_000_003  # no episode's payload is drawn from it
_PROBE_RATE, _PROBE_DURATION = 50.0, 0.5  # [Hz], [s]


@dataclass(frozen=True)
class Population:
    """A population of the benchmark.

    name: of `armload.lab.episodes.POPULATIONS`, or `repeat`. title: the heading of its column. tries: what it tries.
    one_arm: all episodes of a seed show one payload on one arm, with other motions, tares and noise.
    per_seed: episodes of a seed, at most.
    """

    name: str
    title: str
    tries: str
    one_arm: bool = False
    per_seed: int = 10

    @property
    def recipe(self) -> Recipe:
        """What its episodes are drawn from."""
        return POPULATIONS["reference" if self.one_arm else self.name]

    @property
    def has_tare(self) -> bool:
        """Whether every episode has one."""
        return self.recipe.untared == 0.0

    @property
    def same_motion(self) -> bool:
        """Whether every tare is along the run's own motion."""
        return self.has_tare and self.recipe.same_motion == 1.0

    def episodes(self, arm: Arm, seed: int, count: int) -> list[Episode]:
        """`count` episodes of a seed; a longer list begins with the shorter one."""
        if not self.one_arm:
            return draw_episodes(arm, self.name, count, seed)
        drawn = draw_episodes(arm, "reference", count, seed)
        return [replace(e, world=drawn[0].world, payload=drawn[0].payload) for e in drawn]

    def fingerprint(self, arm: Arm, seed: int) -> str:
        """SHA-256 of what the first episode of a seed looks like: changes with whatever shapes the logs."""
        first = self.episodes(arm, seed, 1)[0]
        short = replace(first, duration=_PROBE_DURATION, tare_duration=_PROBE_DURATION)
        logs = next(simulate_episodes([short], rate=_PROBE_RATE))
        seen = [np.round(np.hstack([x.q, x.tau]), 6).tolist() for x in (logs.run, logs.tare) if x is not None]
        return key_of(arm.fingerprint, str(arm.frame), repr(self), repr(self.recipe), logs.truth.phi.tolist(), seen)


ALL = {
    population.name: population
    for population in (
        Population("reference", "reference", "real-like arms, payloads of boxes, Fourier motions, a tare of 20 s"),
        Population("untared", "no tare", "the same without a tare"),
        Population("container", "container", "payloads of a known family: the paper's container with any filling"),
        Population("beyond", "beyond", "arms beyond the real-like ones: other friction, heavier mismatch, drift"),
        Population("shapes", "shapes", "plates, rods, lumps, grippers instead of boxes"),
        Population("odd", "odd", "payloads unlike all that training saw: dumbbells, poles, panes, rings, off the axis"),
        Population("everyday", "everyday", "motions of work: stops, pick and place, slow, some joints only"),
        Population("same-motion", "same motion", "the tare along the run's own motion"),
        Population("same-place", "same place", "the tare about the run's own mean pose, on another motion"),
        Population("elsewhere", "elsewhere", "the tare in another part of the workspace than the run"),
        Population("tool", "tool", "an unknown tool on the arm, at the tare and in the run"),
        Population(REPEAT, "repeat", "one payload on one arm, other motions, tares and noise", True, 20),
    )
}


def population(name: str) -> Population:
    """A population by name.

    Raises:
        ArmError: there is none of this name.
    """
    if name not in ALL:
        raise ArmError(f"the benchmark has no population {name!r}: expected some of {', '.join(ALL)}")
    return ALL[name]


@cache
def prior_of(recipe: Recipe, arm: Arm) -> GaussianPrior:
    """What the baselines know: mean and covariance of 400 payloads of a recipe, none of which is in an episode."""
    rng, rated, drawn = np.random.default_rng(_PRIOR_SEED), rated_mass(arm), []
    for _ in range(_PAYLOADS):
        left, tool = rated, None
        if rng.random() < recipe.tool:
            tool = draw_payload("tools", int(rng.integers(1 << 30)), TOOL_SHARE * rated).parameters.phi
            left -= tool[0]
        if recipe.lighter and rng.random() < recipe.lighter:
            left *= float(np.exp(rng.uniform(np.log(LIGHTEST), 0.0)))
        phi = draw_payload(str(rng.choice(recipe.payloads)), int(rng.integers(1 << 30)), left).parameters.phi
        shown = tool is not None and rng.random() < recipe.untared  # without a tare the tool is part of the answer
        drawn.append(InertialParameters(phi + tool if shown and tool is not None else phi, arm.frame))
    return GaussianPrior.of(drawn, PRIOR)

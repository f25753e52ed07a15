"""Drawing episodes by a recipe."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_mass
from armload.errors import ArmError
from armload.lab.episodes.episode import Episode
from armload.lab.episodes.motion_kinds import MotionSource
from armload.lab.episodes.recipes import LIGHTEST, POPULATIONS, TOOL_SHARE, Recipe
from armload.motion import Motion
from armload.payloads import draw_payload
from armload.simulation import Gains, Sensors, World

POOL = 200  # motions drawn for one seed; beyond, they are used again
_JITTER = (1e-5, 5e-4)  # [s]
_LAG = 6e-3  # [s] at most


def draw_episodes(
    arm: Arm, population: str | Recipe, count: int, seed: int, *, floor: float | None = 0.0, motions: int = POOL
) -> list[Episode]:
    """`count` independent episodes of a population; a longer list of the same seed begins with the shorter one.

    >>> from armload.arms import arm
    >>> episode = draw_episodes(arm("panda"), "reference", 1, seed=0)[0]
    >>> episode.world.name, episode.duration, episode.tare_duration
    ('real-like', 6.0, 20.0)

    Args:
        arm: any arm, nominal. Payloads and mismatch scale with what it is rated for.
        population: a name in `POPULATIONS`, or a recipe of your own.
        count, seed: of what to draw.
        floor: height of the floor in the base's frame [m]; None: there is none.
        motions: how many are drawn for the runs, each with its tare's; more episodes use them again, on other arms.

    Raises:
        ArmError: no such population, or a negative count or seed, or no motions.
        MotionError: the arm has no room for a motion.
    """
    if isinstance(population, str):
        if population not in POPULATIONS:
            raise ArmError(f"no population is called {population!r}: expected one of {', '.join(POPULATIONS)}")
        name, recipe = population, POPULATIONS[population]
    else:
        name, recipe = "own", population
    if count < 0 or seed < 0 or motions < 1:
        raise ArmError(f"{count} episodes of seed {seed} on {motions} motions asked for: expected 0, 0 and 1 or more")
    draw = _Draw(arm, name, recipe, seed, MotionSource(arm, floor), motions)
    return [draw.episode(k) for k in range(count)]


@dataclass(frozen=True, eq=False)
class _Draw:
    """A recipe at work; what episodes share is made once."""

    arm: Arm
    name: str
    recipe: Recipe
    seed: int
    source: MotionSource
    motions: int
    runs: dict[int, Motion] = field(default_factory=dict)
    tares: dict[tuple[int, bool], Motion] = field(default_factory=dict)

    def episode(self, k: int) -> Episode:
        """Episode k: every part from a stream of its own, so that recipes that share a part share its draws."""
        recipe, arm = self.recipe, self.arm
        rng = np.random.default_rng([self.seed, k, 3])
        payload, world, noise = (int(x) for x in rng.integers(1 << 30, size=3))
        rng = np.random.default_rng([self.seed, k, 4])
        slot = k if k < self.motions else int(rng.integers(self.motions))
        sensors = Sensors.of(arm)
        if recipe.vary_sensors:
            sensors = _varied(sensors, rng)
        softest, stiffest = np.log(recipe.stiffness)
        factor = float(np.exp(rng.uniform(softest, stiffest)))
        chance = rng.random(4)
        rated, tool = rated_mass(arm), None
        if chance[0] < recipe.tool:
            tool = draw_payload("tools", payload, TOOL_SHARE * rated)
            rated -= tool.parameters.mass  # together they stay within what the arm may carry
        if recipe.lighter and rng.random() < recipe.lighter:
            rated *= float(np.exp(rng.uniform(np.log(LIGHTEST), 0.0)))
        made = Episode(
            arm,
            getattr(World, str(rng.choice(recipe.worlds)))(arm, world),
            self._run_motion(slot),
            recipe.duration,
            draw_payload(str(rng.choice(recipe.payloads)), payload, rated),
            sensors,
            tool=tool,
            gains=None if factor == 1.0 else Gains.of(arm).stiffer(factor),
            elapsed=float(rng.uniform(*recipe.elapsed)),
            rate=float(rng.choice(recipe.rates)),
            seed=noise,
            population=self.name,
        )
        if chance[1] < recipe.untared:
            return made
        if chance[2] < recipe.same_motion:
            return replace(made, tare_motion=made.motion, tare_duration=made.duration)
        shortest, longest = recipe.tare_duration
        lasts = shortest + (longest - shortest) * float(rng.random()) ** 2
        tare = self._tare_motion(slot, elsewhere=chance[3] < recipe.elsewhere)
        return replace(made, tare_motion=tare, tare_duration=lasts)

    def _run_motion(self, slot: int) -> Motion:
        if slot not in self.runs:
            self.runs[slot] = self._motion(slot, 1, "run", self.recipe.motions, self.recipe.duration)
        return self.runs[slot]

    def _tare_motion(self, slot: int, elsewhere: bool) -> Motion:
        if (slot, elsewhere) not in self.tares:
            around = None if elsewhere else self.source.centre(self._run_motion(slot))
            longest = self.recipe.tare_duration[1]
            self.tares[slot, elsewhere] = self._motion(slot, 2, "tare", self.recipe.tares, longest, around)
        return self.tares[slot, elsewhere]

    def _motion(
        self,
        slot: int,
        stream: int,
        what: str,
        kinds: tuple[str, ...],
        lasts: float,
        around: NDArray[np.float64] | None = None,
    ) -> Motion:
        kind = str(np.random.default_rng([self.seed, slot, stream + 4]).choice(kinds))
        rng = np.random.default_rng([self.seed, slot, stream])
        name = f"{what}-{kind}-{self.arm.name}-{self.seed}-{slot}"
        return self.source.draw(kind, rng, lasts, name, around, self.recipe.near)


def _varied(sensors: Sensors, rng: np.random.Generator) -> Sensors:
    """Sensors of another make: noisier or quieter, with another clock."""
    louder = np.exp(0.5 * rng.normal(size=4))
    return replace(
        sensors,
        torque_noise=louder[0] * np.asarray(sensors.torque_noise),
        velocity_noise=louder[1] * np.asarray(sensors.velocity_noise),
        vibration=louder[2] * np.asarray(sensors.vibration),
        torque_quantum=min(louder[3], 2.0) * np.asarray(sensors.torque_quantum),
        command_lag=float(rng.uniform(0.0, _LAG)),
        torque_skew=float(rng.uniform(0.0, 2e-3)),
        jitter=float(np.exp(rng.uniform(*np.log(_JITTER)))),
        lost=float(rng.choice([0.0, rng.uniform(0.0, 0.15)])),
    )

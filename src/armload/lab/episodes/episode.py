"""An episode: one arm as it really is, what it does, what it carries, how it is seen; and its tare."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from armload.arms import Arm
from armload.errors import ArmError
from armload.inertia import InertialParameters
from armload.motion import Motion
from armload.payloads import Payload
from armload.recording import Recording
from armload.simulation import Gains, Resolution, Run, Sensors, World, simulate_many
from armload.simulation.resolution import COARSE

_TARE_NOISE = 1 << 30  # the tare's sensor noise is another than the run's
_BATCH = 8  # episodes a process simulates at a time: what memory holds


@dataclass(frozen=True, eq=False)
class Episode:
    """A loaded run and, if there is a tare, the run of the same arm before the payload was put on.

    arm: nominal, as the controller and every method know it.
    world: the arm as it really is.
    motion, duration: what it does with the payload, and how much of it is logged [s].
    payload: what was put on.
    sensors: how both runs are seen.
    tare_motion, tare_duration: what it did before; None: there is no tare.
    tool: on the arm in both runs, unknown to the methods; None: the flange was bare at the tare.
    gains: the controller's; None: the arm's own.
    elapsed: from the start of the tare to the start of the run [s]; a world's offset may drift meanwhile.
    rate: of the logs [Hz].
    seed: of the sensors' noise.
    population: where it was drawn from.
    tare_world: the arm as it was at the tare, where it has changed since; None: it has not.
    """

    arm: Arm
    world: World
    motion: Motion
    duration: float
    payload: Payload = field(repr=False)
    sensors: Sensors = field(repr=False)
    tare_motion: Motion | None = None
    tare_duration: float = 0.0
    tool: Payload | None = field(default=None, repr=False)
    gains: Gains | None = field(default=None, repr=False)
    elapsed: float = 60.0
    rate: float = 200.0
    seed: int = 0
    population: str = ""
    tare_world: World | None = None

    @property
    def truth(self) -> InertialParameters:
        """What identification is to find: the payload with a tare, payload and tool together without."""
        total = InertialParameters(self.payload.parameters.phi, self.arm.frame)
        if self.tool is not None and self.tare_motion is None:
            total = total + InertialParameters(self.tool.parameters.phi, self.arm.frame)
        return total


class EpisodeLogs(NamedTuple):
    """What became of an episode. run, tare: the logs; truth: about the arm's payload frame."""

    run: Recording
    tare: Recording | None
    truth: InertialParameters


def simulate_episodes(
    episodes: Sequence[Episode],
    *,
    rate: float | None = None,
    workers: int = 1,
    resolution: Resolution = COARSE,
) -> Iterator[EpisodeLogs]:
    """The logs of each episode, in their order, a few at a time so that memory stays bounded.

    Args:
        rate: of all logs [Hz]; None: each episode's own.
        workers: processes; the logs do not depend on it.
        resolution: how finely the engine works.

    Raises:
        ArmError: fewer than one worker, or a payload the arm cannot hold.
    """
    if workers < 1:
        raise ArmError(f"{workers} workers asked for: expected at least 1")
    batches = [episodes[k : k + _BATCH] for k in range(0, len(episodes), _BATCH)]
    for logs in _batches(batches, rate, workers, resolution):
        yield from logs


def _batches(
    batches: Sequence[Sequence[Episode]], rate: float | None, workers: int, resolution: Resolution
) -> Iterable[list[EpisodeLogs]]:
    if workers == 1:
        return (_simulated(batch, rate, resolution) for batch in batches)
    from joblib import Parallel, delayed

    parallel: Any = Parallel  # its annotations are narrower than what it takes
    run = parallel(n_jobs=workers, pre_dispatch=workers + 1, batch_size=1, return_as="generator")
    return run(delayed(_simulated)(batch, rate, resolution) for batch in batches)


def _simulated(batch: Sequence[Episode], rate: float | None, resolution: Resolution) -> list[EpisodeLogs]:
    """Simulate a few episodes; runs of one arm, length and rate go through the engine together."""
    groups: dict[tuple, list[tuple[int, str, Run]]] = {}
    for k, e in enumerate(batch):
        hz = e.rate if rate is None else rate
        tool = None if e.tool is None else e.tool.parameters
        carried = InertialParameters(e.payload.parameters.phi)
        loaded = carried if tool is None else carried + InertialParameters(tool.phi)
        runs = [("run", e.duration, Run(e.motion, loaded, e.world, e.sensors, e.seed, e.gains, e.elapsed))]
        if e.tare_motion is not None:
            tare = Run(e.tare_motion, tool, e.tare_world or e.world, e.sensors, e.seed + _TARE_NOISE, e.gains)
            runs.append(("tare", e.tare_duration, tare))
        for part, seconds, run in runs:
            groups.setdefault((id(e.arm), hz, seconds), []).append((k, part, run))
    logs: dict[tuple[int, str], Recording] = {}
    for (_, hz, seconds), members in groups.items():
        arm = batch[members[0][0]].arm
        found = simulate_many(
            arm, [run for *_, run in members], rate=hz, duration=seconds, workers=1, resolution=resolution
        )
        logs.update({(k, part): log for (k, part, _), log in zip(members, found, strict=True)})
    return [EpisodeLogs(logs[k, "run"], logs.get((k, "tare")), e.truth) for k, e in enumerate(batch)]

"""Runs: a motion, a payload, a world and sensors become a log; many of them at once, natively in parallel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import ArmError, MotionError, PayloadError
from armload.inertia import InertialParameters
from armload.motion import Motion
from armload.recording import Recording
from armload.runtime.extras import require
from armload.simulation.controller import Command, Gains
from armload.simulation.plant import build_model, diverged, settled_start
from armload.simulation.resolution import FINE, Resolution
from armload.simulation.rollout import Clock, Prepared, roll_out
from armload.simulation.sensors import Sensors
from armload.simulation.worlds import World

_CHUNK_BYTES = 200e6  # memory one native batch may take


@dataclass(frozen=True, eq=False)
class Run:
    """One run to simulate.

    Args:
        motion: the desired motion.
        payload: inertial parameters, or anything with `.parameters`, about the arm's payload frame or another frame of
            its last link that they name; None: no payload.
        world: the arm as it really is; None: nominal.
        sensors: None: ideal.
        seed: of the sensors' noise.
        gains: the controller's; None: the arm's (`Gains.of`).
        start: when the run begins, on the clock of the world's drift [s].
    """

    motion: Motion
    payload: Any = None
    world: World | None = None
    sensors: Sensors | None = None
    seed: int = 0
    gains: Gains | None = None
    start: float = 0.0


def simulate(
    arm: Arm,
    motion: Motion,
    payload: InertialParameters | Any | None = None,
    *,
    world: World | None = None,
    sensors: Sensors | None = None,
    rate: float = 1000.0,
    duration: float | None = None,
    seed: int = 0,
) -> Recording:
    """Let the arm run a motion with a payload its controller does not know, and return the log.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> log = simulate(arm("panda"), taie2024(), rate=100.0)
    >>> len(log), log.n
    (600, 7)

    Args:
        arm: the nominal arm, as the controller knows it (with whatever is attached).
        motion: with the arm's number of joints; the run starts settled at its start.
        payload: inertial parameters, or anything with `.parameters`, about the arm's payload frame or another frame of
            its last link that they name; None: no payload.
        world: the arm as it really is; None: nominal.
        sensors: None: ideal.
        rate: of the log [Hz]; it has round(duration·rate) samples at t = k/rate.
        duration: of the log [s]; None: the motion's.
        seed: of the sensors' noise.

    Raises:
        MotionError: the motion has another number of joints, or lasts no time.
        PayloadError: the payload is not made of ten inertial parameters.
        ArmError: MuJoCo cannot simulate the arm, or the arm cannot hold the payload.
    """
    return simulate_many(arm, [Run(motion, payload, world, sensors, seed)], rate=rate, duration=duration, workers=1)[0]


def simulate_many(
    arm: Arm,
    runs: Sequence[Run],
    *,
    rate: float = 1000.0,
    duration: float | None = None,
    workers: int = 2,
    progress: Callable[[int, int], None] | None = None,
    resolution: Resolution = FINE,
) -> list[Recording]:
    """Simulate many runs in native batches: what `simulate` does, once per run, in the order of `runs`.

    Args:
        workers: threads.
        resolution: how finely the engine works; `simulate` does it finely.
        progress: called as progress(done, total) after every batch.

    Raises:
        ModuleNotFoundError: MuJoCo or SciPy is not installed; the sentence says how to install them.
    """
    require("mujoco", "scipy.interpolate")
    if not (np.isfinite(rate) and rate > 0):
        raise ArmError(f"the log's rate is {rate}: expected a positive number of Hz")
    batches: dict[int, list[int]] = {}
    for k, run in enumerate(runs):
        batches.setdefault(_samples(arm, run, rate, duration), []).append(k)
    gains = Gains.of(arm)
    logs: dict[int, Recording] = {}
    for samples, indices in batches.items():
        clock = Clock.at(rate, samples, resolution)
        chunk = max(workers, int(_CHUNK_BYTES / (8 * clock.steps * (4 * arm.n + 1))))
        for part in (indices[k : k + chunk] for k in range(0, len(indices), chunk)):
            logs.update(zip(part, _batch(arm, gains, [runs[k] for k in part], clock, workers), strict=True))
            if progress is not None:
                progress(len(logs), len(runs))
    return [logs[k] for k in range(len(runs))]


def _batch(arm: Arm, gains: Gains, runs: list[Run], clock: Clock, workers: int) -> list[Recording]:
    """Simulate runs of equal length together."""
    nominal = World.nominal(arm)
    commands: dict[int, Command] = {}  # what runs share is made once
    actual: dict[int, Arm] = {}
    prepared = []
    for run in runs:
        world = run.world or nominal
        if id(run.motion) not in commands:
            commands[id(run.motion)] = Command.along(arm, run.motion, clock.step, clock.steps, clock.resolution.knots)
        if id(world) not in actual:
            actual[id(world)] = world.arm(arm)
        prepared.append(prepare(actual[id(world)], run.gains or gains, run, world, commands[id(run.motion)], clock))
    logs = []
    for run, (q, dq, tau) in zip(runs, roll_out(prepared, clock, workers), strict=True):
        if diverged(dq) or not np.all(np.isfinite(tau)):
            raise ArmError(
                f"the simulated {arm.name} diverged on the motion {_name(run.motion)!r}: its gains do not suit it"
            )
        world = run.world or nominal
        tau = tau + world.sticking(run.seed)(dq)
        truth = Recording(
            clock.times, q, dq, tau, joint_names=arm.joint_names, source=f"simulated {arm.name}, {_name(run.motion)}"
        )
        logs.append(truth if run.sensors is None else run.sensors.observe(truth, run.seed))
    return logs


def prepare(actual: Arm, gains: Gains, run: Run, world: World, command: Command, clock: Clock) -> Prepared:
    """A run ready to go, with `actual` the world's arm."""
    payload = payload_parameters(run.payload, actual)
    model = build_model(actual if payload is None else actual.with_payload(payload), gains, clock.step)
    if world.rotor_inertia is not None:
        model.dof_armature[:] = world.rotor_inertia
    q, dq, ddq = (x[0] for x in run.motion([0.0]))

    def disturbance(pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return world.disturbance(pose, dq, command.feed_forward[0]).reshape(-1)

    start = settled_start(model, gains, (q, dq, ddq), command.feed_forward[0], disturbance)
    velocity = dq - 0.5 * clock.step * ddq  # v lives half a step before q
    return Prepared(model, world, gains, command, start, velocity, run.start)


def payload_parameters(payload: Any, arm: Arm) -> InertialParameters | None:
    """The ten parameters of what can be given as a payload, about the arm's payload frame; None: nothing."""
    parameters = getattr(payload, "parameters", payload)
    if parameters is None:
        return None
    if not isinstance(parameters, InertialParameters):
        raise PayloadError(f"the payload is a {type(payload).__name__}: expected InertialParameters or a Payload")
    return arm.as_payload(parameters) if np.any(parameters.phi) else None


def _samples(arm: Arm, run: Run, rate: float, duration: float | None) -> int:
    if run.motion.n != arm.n:
        raise MotionError(f"the motion {_name(run.motion)!r} moves {run.motion.n} joints: {arm.name} has {arm.n}")
    seconds = run.motion.duration if duration is None else duration
    samples = round(seconds * rate)
    if samples < 2:
        raise MotionError(f"a log of {seconds} s at {rate} Hz has {samples} sample(s): expected at least 2")
    return samples


def _name(motion: Motion) -> str:
    return getattr(motion, "name", type(motion).__name__)

"""The native rollout, and how a log is read off it.

MuJoCo steps whole runs in C++ threads. What is logged at time t_j = j·h makes the channels one instant of the leapfrog
that the integrator is (see `simulate.plant`; v lives half a step before its q):

    q = q_j,      dq = (v_j + v_{j+1})/2,      tau = ctrl_j − kp·q_j − kd·v_{j+1} + [c(q_j, dq) − c(q_j, v_j)]

The bracket belongs to the integrator, which takes the Coriolis torque c at v_j and so misses it by a first-order error
(6 mN·m rms for the Panda with 2 kg on the committed excitation). With it, tau equals the inverse dynamics at
(q, dq, ddq) to second order in h. h is an integer fraction of the log's period, so that logs are even at any rate.

The rollout cannot call back into Python. Friction and residual d(q, dq) therefore act as a torque along time: first
evaluated along the desired motion, then along the motion that came out (Picard iteration, `Resolution.passes`
rollouts). The log is exact whatever is left of that iteration, because it holds what moved the rigid bodies plus d at
the logged q and dq. The rest only means that the controller acted as if it had misread its own torque by as much.

At rest friction is so steep a damper that the iteration swings up from piece to piece of a run that stands. There its
slope D (n,) at rest may be left to the implicit integrator, with d(q, dq) less what the last pass lets D take off:

    d applied in step j = d(q, dq) + D·(v_{j+1} − v_{j+1} of the last pass)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armload.simulation.controller import Command, Gains
from armload.simulation.plant import quiet
from armload.simulation.resolution import FINE, Resolution
from armload.simulation.worlds import World

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True)
class Clock:
    """step: h [s]; every: steps per row of the log; samples: rows of the log; resolution: what it was made for."""

    step: float
    every: int
    samples: int
    resolution: Resolution = FINE

    @classmethod
    def at(cls, rate: float, samples: int, resolution: Resolution = FINE) -> Clock:
        """The largest step up to the resolution's that divides the period of a log of the given rate [Hz].

        >>> Clock.at(1000.0, 6000).every
        2
        """
        every = max(1, int(np.ceil(1.0 / (rate * resolution.step) - 1e-9)))
        return cls(1.0 / (rate * every), every, samples, resolution)

    @property
    def steps(self) -> int:
        """Steps to the last row, and one more for the velocity half a step after it."""
        return (self.samples - 1) * self.every + 1

    @property
    def times(self) -> NDArray[np.float64]:
        """Time of each row (samples,) [s]."""
        return self.step * self.every * np.arange(self.samples, dtype=float)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A run ready to go: plant, world, gains, command, where it starts (q_0 and v_0, each (n,)), and when [s].

    damping: D (n,) [N·m·s/rad] of the module's text; None: none.
    """

    model: mujoco.MjModel
    world: World
    gains: Gains
    command: Command
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    start: float = 0.0
    damping: NDArray[np.float64] | None = None


def damping_at_rest(run: Prepared) -> NDArray[np.float64]:
    """How the friction grows with velocity at rest (n,) [N·m·s/rad], under the torque of the run's start."""
    torque = run.command.control(run.gains)[0] - run.gains.stiffness * run.position
    return run.world.friction.with_slope(np.zeros_like(torque), torque)[1]


def roll_out(
    runs: Sequence[Prepared], clock: Clock, workers: int
) -> list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """(q, dq, tau) of each run, each (samples, n), noise-free; of no use where a run diverged (`plant.diverged`)."""
    states, applied = _picard(runs, clock, workers)
    return [_log(run, clock, *_leapfrog(run, state), u) for run, state, u in zip(runs, states, applied, strict=True)]


def roll_on(
    run: Prepared, clock: Clock
) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], Prepared]:
    """A piece of a run that goes on: the log of `roll_out` but for its last row, and the same run ready from there.

    The command of what is returned is still the old one.
    """
    states, applied = _picard([run], clock, 1)
    q, v, after = _leapfrog(run, states[0])
    log = _log(run, clock, q, v, after, applied[0])
    onward = replace(
        run, position=q[-1], velocity=v[-1], start=run.start + (clock.samples - 1) * clock.step * clock.every
    )
    return (log[0][:-1], log[1][:-1], log[2][:-1]), onward


def _log(
    run: Prepared,
    clock: Clock,
    q: NDArray[np.float64],
    v: NDArray[np.float64],
    after: NDArray[np.float64],
    disturbance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """What is logged of a leapfrog (steps, n) and the disturbance applied in it: (q, dq, tau), each (samples, n)."""
    rows = slice(None, None, clock.every)
    missed = coriolis_missed(run.model, clock, q, v, after)[rows]
    control = run.command.control(run.gains)[rows]
    q, v, after = q[rows], v[rows], after[rows]
    dq = 0.5 * (v + after)
    rigid = control - disturbance[rows] - run.gains.stiffness * q - run.gains.damping * after + missed
    joint = rigid + run.world.disturbance(q, dq, rigid)
    return q, dq, run.world.measured(joint, run.start + clock.times)


def _picard(runs: Sequence[Prepared], clock: Clock, workers: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The last pass: states after each step (runs, steps, 1 + 2n) and the disturbance applied (runs, steps, n)."""
    import mujoco
    from mujoco import rollout

    models = [run.model for run in runs]
    threads = [mujoco.MjData(models[0]) for _ in range(max(1, min(workers, len(runs))))]
    start = np.array([np.concatenate([[0.0], run.position, run.velocity]) for run in runs])
    control = np.array([run.command.control(run.gains) for run in runs])
    damping = np.array([np.zeros(len(run.position)) if run.damping is None else run.damping for run in runs])[:, None]

    def rolled(applied: NDArray[np.float64], after: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """The states, the disturbance that acted, and v_{j+1}, of which `after` was expected."""
        for model, (taken_off,) in zip(models, damping, strict=True):
            model.dof_damping[:] = taken_off
        with quiet():
            found = rollout.rollout(models, threads, start, control - applied + damping * after)[0]
        states = np.asarray(found, dtype=float)
        for model in models:
            model.dof_damping[:] = 0.0
        moved = states[:, :, 1 + len(runs[0].position) :]
        return states, applied + damping * (moved - after), moved

    commands = ((run.world, run.command) for run in runs)
    applied = np.array([_disturbance(w, clock, c.position, c.velocity, c.feed_forward) for w, c in commands])
    states, applied, after = rolled(applied, np.array([run.command.velocity for run in runs]))
    if any(run.world.disturbed for run in runs):
        for _ in range(clock.resolution.passes - 1):
            applied = np.array([_along(*each) for each in zip(runs, repeat(clock), states, applied, strict=False)])
            states, applied, after = rolled(applied, after)
    return states, applied


def _along(
    run: Prepared, clock: Clock, state: NDArray[np.float64], applied: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The disturbance (steps, n) along the motion that came out with `applied` (steps, n)."""
    q, v, after = _leapfrog(run, state)
    torque = run.command.control(run.gains) - applied - run.gains.stiffness * q - run.gains.damping * after
    return _disturbance(run.world, clock, q, 0.5 * (v + after), torque)


def _leapfrog(
    run: Prepared, state: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """q_j, v_j and v_{j+1} for j = 0 … steps − 1, each (steps, n); MuJoCo returns the state after each step."""
    n = len(run.position)
    q = np.concatenate([run.position[None], state[:-1, 1 : n + 1]])
    v = np.concatenate([run.velocity[None], state[:-1, n + 1 : 2 * n + 1]])
    return q, v, state[:, n + 1 : 2 * n + 1]


def _disturbance(
    world: World, clock: Clock, q: NDArray[np.float64], dq: NDArray[np.float64], torque: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Friction and residual (steps, n) along a motion and its rigid-body torque, given at every step."""
    if not world.disturbed:
        return np.zeros_like(q)
    out = world.friction(dq, torque)
    if world.residual is None:
        return out
    knots = _knots(clock, len(q))
    return out + _between(knots, world.residual(q[knots]), len(q))


def coriolis_missed(
    model: mujoco.MjModel, clock: Clock, q: NDArray[np.float64], v: NDArray[np.float64], after: NDArray[np.float64]
) -> NDArray[np.float64]:
    """c(q_j, (v_j + v_{j+1})/2) − c(q_j, v_j) along a run, (steps, n) [N·m]."""
    import mujoco

    data = mujoco.MjData(model)
    knots = _knots(clock, len(q))
    missed = np.empty((len(knots), model.nv))
    for k, j in enumerate(knots):
        data.qpos[:] = q[j]
        mujoco.mj_fwdPosition(model, data)
        data.qvel[:] = 0.5 * (v[j] + after[j])
        mujoco.mj_fwdVelocity(model, data)
        missed[k] = data.qfrc_bias
        data.qvel[:] = v[j]
        mujoco.mj_fwdVelocity(model, data)
        missed[k] -= data.qfrc_bias
    return _between(knots, missed, len(q))


def _knots(clock: Clock, steps: int) -> NDArray[np.intp]:
    """Steps that are `slow_knots` of the clock's resolution apart [s], the last one among them."""
    return np.unique(np.append(np.arange(0, steps, max(1, int(clock.resolution.slow_knots / clock.step))), steps - 1))


def _between(knots: NDArray[np.intp], values: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Values at every step (steps, n) from values at the knots, by a cubic spline; NaN if one of them is (diverged)."""
    from scipy.interpolate import CubicSpline

    if not np.all(np.isfinite(values)):
        return np.full((steps, values.shape[1]), np.nan)
    if len(knots) == steps:
        return values
    return CubicSpline(knots, values)(np.arange(steps))

"""Sound logs that look wrong: of joints that rub more under load, and with velocities that are noisy or seldom sampled.

    python benchmarks/rubbing_joints.py [--logs 24] [--seed 0]

Logs of 10 s and tares of 20 s, of a Panda and a Gen3 that differ from their model as real ones do (`World.real_like`):
arms with joint torque sensors, with 0.3 to 1 times the rated payload. Friction of the joints grows by a share of the
torque that they bear, log-normal by joint about it; velocities are as noisy as the arm's sheet says (2 mrad/s on
both), or a multiple of that, or differences of positions of 17 bits over 10 ms. The other rows are wrong, and rub by
1 %, too: the arm's offsets and friction changed by three daily deviations since its tare, the tare is of another arm,
or something is taken up within the log.

looks wrong        share that seems to change within the log, or since the tare, or is explained by no body, as the log
                   is read first: those of the next column, and those answered with the noise taken out and load
                   allowed for
doubted            share of which the answer says so
calibrated         share of the answers
inside             share of the true values inside their intervals: mass · first moments · inertia
covered or said    share that lie inside, or whose answer is not called calibrated

Written to benchmarks/results/rubbing_joints.json and a table of docs/hybrid_measured.md, after every case; a quarter of
an hour of one core.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from bodies import body_of
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_logs import GROUPS

from armload import Arm, Recording, arm, identify
from armload.arms import rated_effort, rated_mass
from armload.devices import Simulator
from armload.identification.notes import ALLOWED
from armload.lab.episodes.motion_kinds import MotionSource
from armload.motion import random_motion
from armload.regression import Correction
from armload.simulation import Sensors, World, simulate

ROBOTS = ("panda", "gen3")
STEP = 2.0 * np.pi / 2.0**17  # [rad] of positions of 17 bits
OVER = 0.01  # [s]


@dataclass(frozen=True)
class Case:
    """share: of the torque that joints rub away. noise: of velocities, of the sheet's; None: differences of positions.

    rate: [Hz]. wrong: what is, or nothing.
    """

    share: float = 0.0
    noise: float | None = 1.0
    rate: float = 200.0
    wrong: str = ""


CASES = {
    "nothing": Case(),
    "load 0.5 %": Case(share=0.005),
    "load 1 %": Case(share=0.01),
    "load 2 %": Case(share=0.02),
    "100 Hz": Case(rate=100.0),
    "50 Hz": Case(rate=50.0),
    "noise 3 ×": Case(noise=3.0),
    "differences, 100 Hz": Case(noise=None, rate=100.0),
    "load 1 %, differences, 100 Hz": Case(0.01, None, 100.0),
    "wrong: changed since the tare": Case(0.01, wrong="changed"),
    "wrong: tare of another arm": Case(0.01, wrong="another"),
    "wrong: taken up in the log": Case(0.01, wrong="taken up"),
}


class Logs(NamedTuple):
    """A log, its tare, phi (10,) of what is held at its end, and when that was taken up [s], if within the log."""

    run: Recording
    tare: Recording
    truth: NDArray[np.float64]
    when: float | None = None


def logs_of(known: Arm, case: Case, count: int, seed: int) -> Iterator[Logs]:
    """The logs of a case: the same arms, payloads and motions for all."""
    for k in range(count):
        rng = np.random.default_rng([seed, k, 31])
        world, places = World.real_like(known, 700 + 1000 * seed + k), MotionSource(known, 0.0)
        motion = random_motion(known, 40 + 1000 * seed + k, duration=10.0)
        about = places.draw("long", rng, 20.0, "tare", places.centre(motion), 0.3)
        payload = body_of(float(rng.uniform(0.3, 1.0)) * rated_mass(known), k)
        share = case.share * np.exp(0.4 * rng.normal(size=known.n))
        world = replace(world, friction=replace(world.friction, load=share))
        before = at_the_tare(known, world, case, rng)
        sensors = Sensors.of(known)
        sensors = replace(sensors, velocity_noise=sensors.velocity_noise * (case.noise or 0.0))
        how = {"sensors": sensors, "rate": case.rate}
        tare = simulate(known, about, world=before, seed=9000 + k, **how)
        when = float(rng.uniform(3.0, 7.0)) if case.wrong == "taken up" else None
        if when is not None:
            held = [(0.0, None), (when, payload)]
            source = Simulator(known, motion, held, world=world, speed=None, duration=10.0, seed=k, **how)
            run = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
        else:
            run = simulate(known, motion, payload, world=world, seed=k, **how)
        run, tare = (differenced(log) if case.noise is None else log for log in (run, tare))
        yield Logs(run, tare, payload.parameters.phi, when)


def at_the_tare(known: Arm, world: World, case: Case, rng: np.random.Generator) -> World:
    """The arm as it was then."""
    if case.wrong == "another":
        other = World.real_like(known, 5000 + int(rng.integers(1000)))
        return replace(other, friction=replace(other.friction, load=world.friction.load))
    if case.wrong != "changed":
        return world
    off = 3.0 * Correction(known, rated_effort(known)).daily_std[: 2 * known.n] * rng.normal(size=2 * known.n)
    level = np.maximum(world.friction.level + off[known.n :], 0.1 * world.friction.level)
    return replace(world, offset=world.offset + off[: known.n], friction=replace(world.friction, level=level))


def differenced(log: Recording) -> Recording:
    """The same log with positions of 17 bits, and velocities that are their differences."""
    q, rows = np.round(log.q / STEP) * STEP, max(round(OVER * log.rate), 1)
    dq = np.zeros_like(q)
    dq[rows:] = (q[rows:] - q[:-rows]) / (log.t[rows:] - log.t[:-rows])[:, None]
    return replace(log, q=q, dq=dq).select(slice(rows, None))


def asked_of(known: Arm, logs: Iterator[Logs]) -> dict[str, object]:
    """What is said of the logs of a case."""
    first, doubted, calibrated, inside = [], [], [], []
    for log in logs:
        answer = identify(log.run, known, tare=log.tare)
        doubted.append(len(answer.segments) > 1 or answer.interval != "calibrated")
        first.append(doubted[-1] or ALLOWED in answer.notes)
        calibrated.append(answer.interval == "calibrated")
        inside.append((log.truth >= answer.phi_low) & (log.truth <= answer.phi_high))
    held, trusted = np.array(inside), np.array(calibrated)
    fine = held | ~trusted[:, None]
    return {
        "logs": len(held),
        "looks wrong": round(float(np.mean(first)), 3),
        "doubted": round(float(np.mean(doubted)), 3),
        "calibrated": round(float(trusted.mean()), 3),
        "inside": [round(float(held[:, part].mean()), 3) for part in GROUPS],
        "covered or said": [round(float(fine[:, part].mean()), 3) for part in GROUPS],
    }


def table(found: dict[str, dict[str, dict]]) -> str:
    """The cases as rows."""
    rows = [
        [robot, name]
        + [f"{100 * case[what]:.0f} %" for what in ("looks wrong", "doubted", "calibrated")]
        + [" · ".join(f"{x:.2f}" for x in case[what]) for what in ("inside", "covered or said")]
        for robot, cases in found.items()
        for name, case in cases.items()
    ]
    columns = ["arm", "log", "looks wrong", "doubted", "calibrated", "inside", "covered or said"]
    return markdown_table(columns, "llrrrrr", rows)


def main() -> None:
    asked = options(__doc__, logs=24, seed=0)
    found: dict[str, dict[str, dict]] = {}
    for robot in ROBOTS:
        for name, case in CASES.items():
            seen = asked_of(arm(robot), logs_of(arm(robot), case, asked.logs, asked.seed))
            found.setdefault(robot, {})[name] = seen
            say(f"{robot}, {name}: {seen}")
            write("rubbing_joints", {"seed": asked.seed, "robots": found})
            write_table(ROOT / "docs" / "hybrid_measured.md", "rubbing joints", table(found))


if __name__ == "__main__":
    main()

"""Can a profile be poisoned, and does it notice an arm that is another? Hours of streams that teach it.

    python benchmarks/alarms.py [--arms 4] [--streams 3] [--seed 3] [--cases "push,other arm"]

Each Panda has a profile of six empty days (drift as in `life.py`). Then come streams of three minutes at 25 Hz, every
one on another motion and another day, all offered to the profile as `armload live --learn` does:

empty          nothing is held: share called another arm (false alarms), share learned
30, 60, 120 g  a light thing on the arm from the first sample on, in every stream one after another
1 kg           a payload in the arm from the first sample on, in every stream
hand-over      1 kg taken up half-way
push           a push at the flange for ten seconds, of 5 to 20 N
long push      the same for 40 s
repaired       friction 40 % higher and offsets off by 0.5 N·m (wrist 0.15 N·m), on every stream
other arm      the streams are of another Panda

learned: share of the streams that became a session. said: share that is said not to be as the profile says, and after
how many seconds (median). moved: by how much the mass that the profile takes for the empty arm's moves from first to
last [g], median and largest over the arms. wrong: share of the time in which an answer is called calibrated and its
interval leaves out the mass that is held. Rates have 95 % intervals (Wilson). Cases that are
named replace their own among the results. Printed, and written to benchmarks/results/alarms.json and a table of
docs/profiles.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from bodies import body_of
from life import OFFSET, empty_logs, motions_about, on_a_day
from script import ROOT, cases_of, markdown_table, options, say, write, write_table

from armload import Recording, arm
from armload.lab.episodes import Episode, draw_episodes
from armload.lab.episodes.motion_kinds import MotionSource
from armload.online import OnlineIdentifier
from armload.posterior import Profile, learn_profile
from armload.simulation import Run, World, simulate_many
from armload.simulation.resolution import COARSE

MASSES = {"empty": 0.0, "30 g": 0.03, "60 g": 0.06, "120 g": 0.12, "1 kg": 1.0, "hand-over": 1.0}
PUSHES = {"push": 10.0, "long push": 40.0}  # [s]
CASES = (*MASSES, *PUSHES, "repaired", "other arm")
SECONDS, RATE = 180.0, 25.0
DAYS = 6


def known(e: Episode, k: int) -> Profile:
    """The profile of six empty days."""
    rng = np.random.default_rng([k, 5])
    worlds = [on_a_day(e.world, 1.0, rng) for _ in range(DAYS)]
    return learn_profile(e.arm, empty_logs(e, worlds, motions_about(e, "here", k)[:DAYS], 20.0, e.seed))


def stream_of(e: Episode, case: str, k: int, i: int) -> tuple[Recording, np.ndarray]:
    """A stream of one case, and the mass (N,) that is held."""
    rng = np.random.default_rng([k, i, 17])
    source = MotionSource(e.arm, 0.0)
    motion = source.draw("long", rng, SECONDS, f"stream-{k}-{i}", source.centre(e.motion), 0.5)
    world = on_a_day(e.world, 1.0, rng)
    if case == "other arm":
        world = World.real_like(e.arm, 5000 + k)
    if case == "repaired":
        off = np.where(OFFSET > 0.05, 0.5, 0.15) * np.random.default_rng(k).choice([-1.0, 1.0], e.arm.n)
        friction = replace(world.friction, level=1.4 * world.friction.level)
        world = replace(world, offset=world.offset + off, friction=friction)
    mass = MASSES.get(case, 0.0)
    body = body_of(mass, 31 * k + i).parameters if mass else None
    runs = [Run(motion, body, world, e.sensors, int(rng.integers(1 << 30)), e.gains)]
    if case == "hand-over":
        runs.append(replace(runs[0], payload=None))
    logs = simulate_many(e.arm, runs, rate=RATE, duration=SECONDS, workers=1, resolution=COARSE)
    log, held = logs[0], np.full(len(logs[0].t), mass)
    if case == "hand-over":
        late = log.t > log.t[0] + SECONDS / 2
        log = replace(
            log, **{x: np.where(late[:, None], getattr(log, x), getattr(logs[1], x)) for x in ("q", "dq", "tau")}
        )
        held[~late] = 0.0
    if case in PUSHES:
        begin = log.t[0] + rng.uniform(15.0, 170.0 - PUSHES[case])
        pushed = (log.t >= begin) & (log.t < begin + PUSHES[case])
        direction = rng.normal(size=3)
        force = rng.uniform(5.0, 20.0) * direction / np.linalg.norm(direction)
        jacobian = e.arm.frame_motion(log.q).jacobian  # angular and linear velocity in the frame's axes
        R, _ = e.arm.frame_pose(log.q)
        there = np.einsum("nji,j->ni", R, force)
        torque = np.einsum("nij,ni->nj", jacobian[:, 3:], there)
        log = replace(log, tau=log.tau - pushed[:, None] * torque)
    return log, held


def wilson(hits: int, of: int) -> list[float]:
    """95 % interval of a share."""
    z, p = 1.96, hits / of
    middle, half = p + z * z / (2 * of), z * np.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return [max((middle - half) / (1 + z * z / of), 0.0), min((middle + half) / (1 + z * z / of), 1.0)]


def followed(e: Episode, profile: Profile, log: Recording, held: np.ndarray) -> tuple[Profile | None, float, float]:
    """What a stream teaches, when the arm is said not to be the profile's [s] (inf: never), the share wrong."""
    stream, said, wrong = OnlineIdentifier(e.arm, profile=profile), np.inf, 0
    try:
        for sample, mass in zip(log, held, strict=True):
            last = stream.update(*sample)
            wrong += last.interval == "calibrated" and not last.low[0] <= mass <= last.high[0]
            if not np.isfinite(said) and any("not as its profile says" in note for note in last.notes):
                said = sample.t - log.t[0]
        return stream.learned(), said, wrong / len(held)
    finally:
        stream.close()


def main() -> None:
    asked = options(__doc__, arms=4, streams=3, seed=3, cases="")
    panda = arm("panda")
    chosen, out = cases_of("alarms", CASES, asked.cases, between=",")
    found: dict[str, dict[str, Any]] = {case: {"learned": [], "said": [], "moved": [], "wrong": []} for case in chosen}
    for k, e in enumerate(draw_episodes(panda, "reference", asked.arms, asked.seed, motions=asked.arms)):
        profile = known(e, k)
        before = profile.mounted(panda)[0][0]
        for case in chosen:
            now = profile
            for i in range(asked.streams):
                learned, said, wrong = followed(e, now, *stream_of(e, case, k, i))
                found[case]["wrong"].append(wrong)
                found[case]["learned"].append(learned is not None)
                found[case]["said"].append(said)
                now = now if learned is None else learned
            found[case]["moved"].append(1e3 * float(now.mounted(panda)[0][0] - before))
        say(f"arm {k + 1} of {asked.arms}: moved {[round(found[case]['moved'][-1], 1) for case in chosen]} g")
    for case, one in found.items():
        count, said = len(one["said"]), np.array(one["said"])
        told = int(np.isfinite(said).sum())
        out[case] = {
            "streams": count,
            "learned": [sum(one["learned"]) / count, *wilson(sum(one["learned"]), count)],
            "said": [told / count, *wilson(told, count)],
            "said after [s]": float(np.median(said[np.isfinite(said)])) if told else None,
            "wrong": float(np.mean(one["wrong"])),
            "moved [g]": [float(np.median(np.abs(one["moved"]))), float(np.max(np.abs(one["moved"])))],
        }
    out, rows = {case: out[case] for case in CASES if case in out}, []
    for case, one in out.items():
        share = ["{:.0f} % ({:.0f}–{:.0f})".format(*(100 * x for x in one[what])) for what in ("learned", "said")]
        after = "" if one["said after [s]"] is None else f"{one['said after [s]']:.0f}"
        wrong, moved = f"{100 * one['wrong']:.1f} %", "{:.0f} · {:.0f}".format(*one["moved [g]"])
        rows.append([case, str(one["streams"]), *share, after, wrong, moved])
    hours = sum(one["streams"] for one in out.values()) * SECONDS / 3600.0
    columns = ["stream", "streams", "learned", "said not to be the arm's", "after [s]", "wrong", "moved [g]"]
    say(markdown_table(columns, "lrrrrrr", rows))
    if asked.arms > 2:
        write("alarms", {"arms": asked.arms, "seed": asked.seed, "hours": hours, "cases": out})
        write_table(ROOT / "docs" / "profiles.md", "alarms", markdown_table(columns, "lrrrrrr", rows))


if __name__ == "__main__":
    main()

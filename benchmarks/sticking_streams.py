"""Streams of arms whose joints stick: how often a standstill or a turn is taken for a change of payload.

    python benchmarks/sticking_streams.py [--streams 8] [--seed 7000]

A Panda and an FR3, moved by inverse dynamics from pose to pose, four moves and a standstill of 1.2 s in turn, at 100 Hz
and without a tare. In the middle of three standstills something of 0.3 to 2 kg is taken up or put down at once. Each
arm differs from its model by offsets and by waves over its pose. Friction is smooth in velocity, f·tanh(dq/w), as the
model has it, or follows Dahl's model, dz = (dq − |dq|·z)/5 mrad and f·z, which keeps hold of a joint that stands; f is
what two Pandas rub, or half of that. *learned* is the present code (`online/sticking.py`); with *smooth* no joint is
taken to stick.

noticed    changes with an event from their beginning until a second later
false      all other events
inside     share of the masses in their 95 % interval 0.5, 1 and 2 s after a change
calibrated share of the time in which answers are called so; and wrong: that leave the mass out, too

Written to benchmarks/results/sticking_streams.json and a table of docs/online_measured.md; ten minutes of one core.

Source: Dahl, "A solid friction model", Aerospace Corp. TOR-158, 1968.
"""

from __future__ import annotations

from contextlib import contextmanager
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from bodies import body_of
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, write, write_table

from armload import arm
from armload.online import OnlineIdentifier
from armload.online.sticking import Sticking
from armload.recording import Recording

ROBOTS = ("panda", "fr3")
FRICTION = {"smooth": (False, 1.0), "sticks, half": (True, 0.5), "sticks": (True, 1.0)}  # whether it sticks, level
LEVEL = np.array([0.26, 0.34, 0.34, 0.26, 0.34, 0.24, 0.18])  # [N·m] of two Pandas
RATE, REACH, WIDTH = 100.0, 5e-3, 0.06  # [Hz], [rad], [rad/s]
HOME = np.array([0.0, -0.4, 0.0, -2.1, 0.0, 1.75, 0.78])
SPREAD = np.array([0.9, 0.4, 0.4, 0.4, 0.5, 0.4, 0.9])  # [rad] of the poses about it
STANDS = 1.2  # [s]
WITHIN = 1.0  # [s]
LOOKED = (0.5, 1.0, 2.0)  # [s]


class Cell(NamedTuple):
    """A stream, the mass held at each sample [kg], and when it changes [s]."""

    log: Recording
    mass: NDArray[np.float64]
    changes: list[float]


def held(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share (N, n) of its friction by which each joint is held (Dahl's model, exact over each step)."""
    z = np.zeros_like(q)
    for k in range(1, len(q)):
        step = q[k] - q[k - 1]
        z[k] = np.sign(step) + (z[k - 1] - np.sign(step)) * np.exp(-np.abs(step) / REACH)
    return z


def moved(rng: np.random.Generator) -> tuple[NDArray, NDArray, NDArray, list[float]]:
    """q, dq, ddq (N, n) of all moves and standstills, and when the latter begin [s]."""
    poses, pieces, stands, h = HOME + SPREAD * rng.uniform(-1.0, 1.0, (17, 7)), [], [], 1.0 / RATE
    for k, (a, b) in enumerate(pairwise(poses)):
        T = max(float(np.abs(b - a).max()) / 0.6, 0.6)
        s = np.arange(0.0, T, h)[:, None] / T
        shape = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 / T, 60 * s * (1 - s) * (1 - 2 * s) / T**2
        pieces.append((a + shape[0] * (b - a), shape[1] * (b - a), shape[2] * (b - a)))
        if k % 4 == 3:
            stands.append(sum(len(piece[0]) for piece in pieces) * h)
            still = np.zeros((round(STANDS * RATE), 7))
            pieces.append((still + b, still, still))
    q, dq, ddq = (np.concatenate(x) for x in zip(*pieces, strict=True))
    return q, dq, ddq, stands


def cell(name: str, sticks: bool, level: float, seed: int) -> Cell:
    """A stream of one arm."""
    robot, rng = arm(name), np.random.default_rng(seed)
    q, dq, ddq, stands = moved(rng)
    t, changes = np.arange(len(q)) / RATE, [at + 0.5 for at in stands[:3]]
    body = body_of(float(rng.uniform(0.3, 2.0)), seed).parameters
    there = (t >= changes[0]) & (t < changes[1]) | (t >= changes[2])
    tau = robot.torque(q, dq, ddq)
    tau[there] = robot.with_payload(body).torque(q[there], dq[there], ddq[there])
    friction = level * LEVEL * rng.uniform(0.7, 1.3, 7)
    tau += friction * (held(q) if sticks else np.tanh(dq / WIDTH))
    tau += 0.002 * robot.limits.effort * rng.normal(size=7)
    for _ in range(3):
        way, phase = rng.normal(size=(7, 7)), rng.uniform(0.0, 2.0 * np.pi, 7)
        tau += 0.0005 * robot.limits.effort * np.sin(q @ way + phase)
    noisy = dq + 2e-3 * rng.normal(size=q.shape)
    return Cell(Recording(t, q, noisy, tau + 0.04 * rng.normal(size=q.shape)), np.where(there, body.mass, 0.0), changes)


@contextmanager
def learned(so: bool) -> Any:
    """Whether streams learn how far joints stick."""
    take = Sticking.take
    if not so:
        Sticking.take = lambda *_: None  # type: ignore[method-assign]
    try:
        yield
    finally:
        Sticking.take = take


def followed(name: str, of: Cell) -> dict[str, Any]:
    """What is said of one stream."""
    stream, events, said = OnlineIdentifier(arm(name)), [], []
    for sample in of.log:
        one = stream.update(*sample)
        if one.event is not None and one.event.t not in events:
            events.append(one.event.t)
        said.append((one.t, one.low[0], one.high[0], one.calibrated))
    stream.close()
    t, low, high, calibrated = np.array(said, dtype=float).T
    inside = (low <= of.mass) & (of.mass <= high)
    delays = [next((e - at for e in events if 0.0 <= e - at <= WITHIN), None) for at in of.changes]
    noticed = [delay for delay in delays if delay is not None]
    looked = [[bool(inside[np.searchsorted(t, at + after)]) for at in of.changes] for after in LOOKED]
    wrong = (calibrated > 0.0) & ~inside
    return {
        "noticed": len(noticed),
        "false": len(events) - len(noticed),
        "delays": [round(delay, 3) for delay in noticed],
        "inside": looked,
        "calibrated": float(calibrated.mean()),
        "wrong": float(wrong.mean()),
    }


def table(found: dict[str, list[dict[str, Any]]]) -> str:
    """The cases as rows."""
    rows = []
    for case, seen in found.items():
        inside = " · ".join(f"{100 * np.mean([one['inside'][k] for one in seen]):.0f}" for k in range(len(LOOKED)))
        delays = np.concatenate([one["delays"] for one in seen])
        noticed, false = sum(one["noticed"] for one in seen), sum(one["false"] for one in seen)
        share, wrong = (np.mean([one[x] for one in seen]) for x in ("calibrated", "wrong"))
        delay = f"{np.median(delays):.2f} s" if len(delays) else "–"
        cells = (
            f"{noticed} of {3 * len(seen)}",
            str(false),
            delay,
            inside,
            f"{100 * share:.0f} %",
            f"{100 * wrong:.1f} %",
        )
        rows.append([*case.split("; "), *cells])
    heads = ["arm", "friction", "taken for", "noticed", "false", "delay", "inside after 0.5 · 1 · 2 s [%]"]
    return markdown_table([*heads, "calibrated", "and wrong"], "lllrrrrrr", rows)


def main() -> None:
    asked = options(__doc__, streams=8, seed=7000)
    found: dict[str, list[dict[str, Any]]] = {}
    for name in ROBOTS:
        for friction, (sticks, level) in FRICTION.items():
            cells = [cell(name, sticks, level, asked.seed + k) for k in range(asked.streams)]
            for way, so in (("smooth", False), ("learned", True)):
                with learned(so):
                    seen = [followed(name, one) for one in cells]
                found[f"{name}; {friction}; {way}"] = seen
                say(f"{name}, {friction}, {way}: {[(one['noticed'], one['false']) for one in seen]}")
            write("sticking_streams", {"seed": asked.seed, "streams": found}, None)
            write_table(ROOT / "docs" / "online_measured.md", "sticking streams", table(found))


if __name__ == "__main__":
    main()

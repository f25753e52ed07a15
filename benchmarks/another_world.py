"""Do the intervals hold in a world that shares nothing with the one they were calibrated in but the rigid body?

    python benchmarks/another_world.py [--robots panda,gen3,ur5e,ur10e] [--logs 60] [--seed 0] [--seconds 10] [--jobs 1]

Each log is another arm and payload, with a tare of 20 s, at 200 Hz. Motions are those of minute_logs.py, or *small*
ones: run and tare each about a centre of its own, drawn from the middle quarter of the joints' ranges, no joint further
than 0.6 rad from it, at up to 60 % of its speed limit and 1.3 rad/s; every other log five harmonics of 0.1 Hz, else
from pose to pose, with pauses of up to 0.4 s. The arm follows its motion exactly (Pinocchio), and its torque, in shares
of the effort limit, is another than `World.real_like` draws:

links     2 % of mass, 2 mm of centre, 5 % of inertia, times the arm's `link_spread` (masses times 0.8 to 1.2)
friction  Coulomb (0.3–1.2 %; motor current 3.5–6 %) with a Stribeck peak of up to 10 % and two directions that differ
          by 15 % (1 sigma), viscous (0.05–0.15 % per rad/s; 3–5 %), offsets (0.25 %; 0.2 %)
gears     motor current: a share of the torque is lost (3–7 %)
scale     of all joints (0.5 %; 2 %, 1 sigma), and of each (motor current, 2.6 %)
waves     six for each joint, of all positions and velocities: a·sin(w·q + v·dq + b), w ~ N(0, 1) per rad, v ~ N(0,
          0.36) per rad/s, together 0.22 % (motor current 0.4 %) times 0.5–1.5: what the fits of docs/real_arms.md leave
noise     white (0.12 %; 0.6 %), and half as large beside it a coloured one that falls to 1/e in 14 samples

*without waves*, *without scale errors*: small motions, and the same logs without them. Goes on from out/another_world.
Written to benchmarks/results/another_world.json and a table of docs/hybrid_measured.md: share of the 95 % intervals
that hold the truth of mass · first moments · inertia, ± the standard error if a log counts as one answer. Ten minutes
of one core.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from minute_logs import GROUPS, MOTIONS, PAYLOADS
from numpy.typing import NDArray
from scipy.signal import lfilter
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Arm, Recording, arm, identify
from armload.inertia import InertialParameters
from armload.lab.cells import key_of
from armload.lab.episodes import Episode, Recipe, draw_episodes
from armload.lab.experiment import Task, run_tasks, source_key

RATE = 200.0  # [Hz]
VARIANTS = ("training's motions", "small motions", "without waves", "without scale errors")


class World:
    """An arm of another world, on whose torques nothing was calibrated."""

    def __init__(self, known: Arm, rng: np.random.Generator, without: str) -> None:
        n, effort, spread, motor = known.n, known.limits.effort, known.link_spread, known.motor_torque
        self._rng = rng
        links = known.link_parameters * np.clip(1.0 + 0.02 * spread * rng.normal(size=(n, 1)), 0.8, 1.2)
        links[:, 1:4] += links[:, :1] * 0.002 * min(spread, 3.0) * rng.normal(size=(n, 3))
        links[:, 4:] *= 1.0 + 0.05 * min(spread, 4.0) * rng.normal(size=(n, 1))
        self._arm = known.with_links(links)
        level, viscous = ((0.035, 0.06), (0.03, 0.05)) if motor else ((0.003, 0.012), (0.0005, 0.0015))
        self._coulomb, self._viscous = effort * rng.uniform(*level, n), effort * rng.uniform(*viscous, n)
        self._peak, self._uneven = 0.1 * rng.random(n), 0.15 * rng.normal(size=n)
        self._offset = effort * (0.002 if motor else 0.0025) * rng.normal(size=n)
        self._lost = rng.uniform(0.03, 0.07, n) if motor else np.zeros(n)
        self._width = 0.03 if motor else 0.02  # [rad/s]
        self._noise = effort * (0.006 if motor else 0.0012)
        common, each = (0.02, 0.026) if motor else (0.005, 0.0)
        scale = (1.0 + common * rng.normal()) * (1.0 + each * rng.normal(size=n))
        self._scale = np.ones(n) if without == "without scale errors" else scale
        size = effort * (0.004 if motor else 0.0022) * rng.uniform(0.5, 1.5, n)
        self._size = 0.0 * size if without == "without waves" else size
        self._w, self._v = rng.normal(size=(n, 6, n)), 0.6 * rng.normal(size=(n, 6, n))
        self._a, self._b = rng.normal(size=(n, 6)) / np.sqrt(3.0), rng.uniform(0.0, 2.0 * np.pi, (n, 6))

    def log(self, motion: Any, seconds: float, held: InertialParameters | None) -> Recording:
        """The arm on a motion, with what it holds."""
        t = np.arange(round(seconds * RATE)) / RATE
        q, dq, ddq = motion(t)
        actual = self._arm if held is None else self._arm.with_payload(held)
        torque, way = actual.torque(q, dq, ddq), np.tanh(dq / self._width)
        rubs = self._coulomb * (1.0 + self._peak * np.exp(-((dq / 0.15) ** 2))) * way * (1.0 + self._uneven * way)
        phase = np.einsum("jki,ti->tjk", self._w, q) + np.einsum("jki,ti->tjk", self._v, dq) + self._b
        waves = self._size * np.einsum("jk,tjk->tj", self._a, np.sin(phase))
        clean = self._scale * torque + self._lost * np.abs(torque) * way + rubs + self._viscous * dq
        white, coloured = self._rng.normal(size=(2, *q.shape))
        noise = self._noise * (white + 0.5 * lfilter([0.35], [1.0, -0.93], coloured, axis=0))
        return Recording(
            t,
            q + 2e-6 * self._rng.normal(size=q.shape),
            dq + 1e-3 * self._rng.normal(size=q.shape),
            clean + self._offset + waves + noise,
        )


def small(known: Arm, rng: np.random.Generator, seconds: float, hops: bool) -> Callable[[NDArray], tuple]:
    """A motion about a centre of its own; hops: from pose to pose."""
    low, high = (np.clip(x, -2.6, 2.6) for x in (known.limits.position_low, known.limits.position_high))
    centre = 0.5 * (low + high) + 0.25 * rng.uniform(-1.0, 1.0, known.n) * 0.5 * (high - low)
    room, fastest = np.minimum(0.6, 0.95 * np.minimum(high - centre, centre - low)), 0.6 * known.limits.velocity
    fastest = np.minimum(fastest, 1.3)
    t = np.arange(round(seconds * RATE)) / RATE
    if not hops:
        phase = 2.0 * np.pi * 0.1 * np.arange(1, 6)[:, None] * t  # (5, N)
        rate, share = 2.0 * np.pi * 0.1 * np.arange(1, 6)[:, None], 1.0 / np.arange(1, 6)[:, None]
        a, b = share * rng.normal(size=(5, known.n)), share * rng.normal(size=(5, known.n))
        q = np.sin(phase).T @ a + np.cos(phase).T @ b
        dq = np.cos(phase).T @ (rate * a) - np.sin(phase).T @ (rate * b)
        ddq = -(np.sin(phase).T @ (rate**2 * a) + np.cos(phase).T @ (rate**2 * b))
        size = np.minimum(room / np.abs(q).max(axis=0), fastest / np.abs(dq).max(axis=0))
        return lambda _: (centre + size * q, size * dq, size * ddq)
    q, dq, ddq = (np.zeros((len(t), known.n)) for _ in range(3))
    at, begin = centre + room * rng.uniform(-1.0, 1.0, known.n), 0.0
    while begin < seconds:
        to = centre + room * rng.uniform(-1.0, 1.0, known.n)
        lasts = max(0.5, float((1.875 * np.abs(to - at) / fastest).max())) * rng.uniform(1.0, 1.6)
        now = t >= begin
        s = np.clip((t[now, None] - begin) / lasts, 0.0, 1.0)
        q[now] = at + (10 * s**3 - 15 * s**4 + 6 * s**5) * (to - at)
        dq[now] = (30 * s**2 - 60 * s**3 + 30 * s**4) * (to - at) / lasts
        ddq[now] = (60 * s - 180 * s**2 + 120 * s**3) * (to - at) / lasts**2
        at, begin = to, begin + lasts + rng.uniform(0.0, 0.4)
    return lambda _: (q, dq, ddq)


@cache
def episodes(robot: str, count: int, seed: int, seconds: float) -> list[Episode]:
    """Payloads, motions and tare motions; the arms of these episodes are not used."""
    recipe = Recipe(worlds=("real_like",), payloads=PAYLOADS, motions=MOTIONS, duration=seconds)
    return draw_episodes(arm(robot), recipe, count, 930_001 + seed, motions=count)


def measured(robot: str, variant: str, count: int, seed: int, seconds: float, k: int) -> dict[str, Any]:
    """One log as a cell's numbers."""
    e, known = episodes(robot, count, seed, seconds)[k], arm(robot)
    world, rng = World(known, np.random.default_rng([seed, k, 17]), variant), np.random.default_rng([seed, k, 18])
    truth, before, run = InertialParameters(e.payload.parameters.phi), e.tare_motion, e.motion
    if variant != VARIANTS[0]:
        before, run = (small(known, rng, lasts, k % 2 == 1) for lasts in (e.tare_duration, seconds))
    tare = world.log(before, e.tare_duration, None)
    answer = identify(world.log(run, seconds, truth), known, tare=tare)
    inside = (answer.phi_low <= truth.phi) & (truth.phi <= answer.phi_high)
    return {
        "inside": inside.tolist(),
        "calibrated": answer.interval == "calibrated",
        "error": np.abs(answer.phi - truth.phi).tolist(),
        "half": (0.5 * (answer.phi_high - answer.phi_low)).tolist(),
    }


def summary(logs: list[dict[str, Any]]) -> dict[str, Any]:
    """What is written of one arm in one variant."""
    inside, error, half = (np.array([log[what] for log in logs], dtype=float) for what in ("inside", "error", "half"))
    out: dict[str, Any] = {"logs": len(logs), "calibrated": float(np.mean([log["calibrated"] for log in logs]))}
    for name, part in GROUPS.items():
        each = inside[:, part].mean(axis=1)
        out[name] = {
            "inside": round(float(each.mean()), 3),
            "standard error": round(float(each.std(ddof=1) / np.sqrt(len(each))), 3),
            "error": float(f"{error[:, part].mean():.3g}"),
            "half-width over error": round(float(half[:, part].mean() / error[:, part].mean()), 1),
        }
    return out


def table(robots: dict[str, dict[str, Any]]) -> str:
    """A row for each arm and variant."""
    rows: list[list[str]] = []
    for robot, variants in robots.items():
        for variant, found in variants.items():
            groups = [found[name] for name in GROUPS]
            inside = [f"{100 * g['inside']:.0f} ± {100 * g['standard error']:.0f}" for g in groups]
            errors = " · ".join(f"{1e3 * g['error']:.3g}" for g in groups)
            widths = " · ".join(f"{g['half-width over error']:.1f}" for g in groups)
            said = f"{100 * found['calibrated']:.0f}"
            rows.append([robot, variant, str(found["logs"]), said, *inside, errors, widths])
    columns = ["arm", "world", "logs", "calibrated [%]", *(f"{name} inside [%]" for name in GROUPS)]
    columns += ["error [g · g·m · g·m²]", "half-width over error"]
    return markdown_table(columns, "llrrrrrrr", rows)


def main() -> None:
    """Measure what is asked for, or go on with it."""
    asked = options(__doc__, robots="panda,gen3,ur5e,ur10e", logs=60, seed=0, seconds=10.0, jobs=1)
    robots: dict[str, dict[str, Any]] = {}
    code = source_key()
    for robot in asked.robots.split(","):
        for variant in VARIANTS if arm(robot).motor_torque else VARIANTS[:2]:
            about = (robot, variant, asked.logs, asked.seed, asked.seconds)
            name = "-".join(map(str, about)).replace(" ", "_")
            tasks = [Task.of_one(f"{name}-{k}", key_of(code), measured, *about, k) for k in range(asked.logs)]
            say(f"{robot}, {variant}")
            logs = list(run_tasks(tasks, ROOT / "out" / "another_world", jobs=asked.jobs).values())
            robots.setdefault(robot, {})[variant] = summary(logs)
    write("another_world", {"seed": asked.seed, "seconds": asked.seconds, "robots": robots})
    write_table(ROOT / "docs" / "hybrid_measured.md", "another world", table(robots))


if __name__ == "__main__":
    main()

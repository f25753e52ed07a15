"""How often the 95 % intervals of the centre of mass, and of the inertia about it, hold the truth, beside those of phi.

    python benchmarks/com_intervals.py [--robot panda] [--episodes 200] [--population broad]

Simulated episodes that no training has seen, answered by `identify` after 1 s and 6 s, with the tare where the episode
has one. Episodes with nothing to hold are left out, as nothing has no centre of mass; so are removals. Writes
benchmarks/results/com_intervals.json: shares [1] with their standard error over episodes, the median half-widths, and
how many intervals are the bound that is stated where the mass may be zero. About three minutes.
"""

from __future__ import annotations

import numpy as np
from script import options, say, write

from armload import arm
from armload.identification import Identification, identify
from armload.identification.thresholds import FARTHEST
from armload.inertia import InertialParameters, vech
from armload.lab.episodes import draw_episodes, simulate_episodes

SEED = 910_000  # trainings have seed 0, fresh episodes 1
TIMES = (1.0, 6.0)
LIGHTEST = 0.01  # [kg] below, nothing is held
QUANTITIES = ("phi", "com", "inertia_com")


def six(value: np.ndarray) -> np.ndarray:
    """A vector, or the six numbers of a matrix."""
    return vech(value) if value.ndim == 2 else value


def holds(found: Identification, truth: InertialParameters) -> dict[str, np.ndarray]:
    """For each quantity, which of its intervals hold the truth."""
    out = {}
    for name in QUANTITIES:
        low, high = (six(getattr(found, f"{name}_{end}")) for end in ("low", "high"))
        value = six(getattr(truth, name))
        out[name] = (low <= value) & (value <= high)
    return out


def summary(rows: list[tuple[Identification, dict[str, np.ndarray]]]) -> dict:
    """Shares that hold, with the standard error over episodes, and median half-widths."""
    out: dict = {"episodes": len(rows)}
    for name in QUANTITIES:
        share = np.array([row[1][name].mean() for row in rows])
        each = np.mean([row[1][name] for row in rows], axis=0)
        half = np.median([six(getattr(f, f"{name}_high") - getattr(f, f"{name}_low")) / 2.0 for f, _ in rows], axis=0)
        out[name] = {
            "share": round(float(share.mean()), 4),
            "se": round(float(share.std(ddof=1) / np.sqrt(len(rows))), 4),
            "each": np.round(each, 3).tolist(),
            "median_half_width": [float(f"{x:.3g}") for x in half],
        }
    out["at_the_bound"] = sum(bool(np.any(np.abs(found.com_high) >= FARTHEST)) for found, _ in rows)
    return out


def main() -> None:
    asked = options(__doc__, robot="panda", episodes=200, population="broad")
    robot = arm(asked.robot)
    rows: dict[float, list] = {t: [] for t in TIMES}
    for k, logs in enumerate(simulate_episodes(draw_episodes(robot, asked.population, asked.episodes, seed=SEED))):
        if logs.truth.mass < LIGHTEST:
            continue
        for t in TIMES:
            run = logs.run.between(logs.run.t[0], logs.run.t[0] + t)
            found = identify(run, robot, tare=logs.tare)
            rows[t].append((found, holds(found, logs.truth)))
        if k % 50 == 0:
            say(f"{k} of {asked.episodes}")
    result = {
        "robot": robot.name,
        "population": asked.population,
        "seed": SEED,
        "after": {f"{t:g} s": summary(found) for t, found in rows.items()},
        "held_after": {f"{t:g} s": summary([row for row in found if row[0].held]) for t, found in rows.items()},
    }
    write("com_intervals", result)


if __name__ == "__main__":
    main()

"""A cell whose arm warms up: forty minutes of hand-overs while friction falls and the sensors' offsets move.

    python benchmarks/warming_up.py [--arms 2] [--minutes 0] [--seed 80000] [--jobs 1] [--cells out/warming-up]

Streams as the moving ones of `cell_hours.py` (real-like Pandas, random motions, no tare, something of 0.2 kg and more
taken up and put down in turn, 8 to 40 s apart, within 0.05 to 2 s), at 100 Hz. An arm of the kind

as it is    stays the same
warms up    loses 30 % of its friction, and each sensor's offset moves by what is expected of a day
            (`Correction.daily_std`, 1 sigma), both as 1 − exp(−t/20 min)

Each stream is answered with what a run knew cut back to `REMEMBERED` when it is taken up again, and without (all that
was ever seen of the empty arm counts). What counts as noticed, late, false and inside is said in events.py; calibrated,
and out: the share of all moments whose answer is called calibrated and leaves the mass out. Constants were set on seeds
1 to 3. Printed, and written to benchmarks/results/warming_up.json and a table of docs/online_measured.md; printed only
with another seed than 80000.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from cell_hours import APART, TAKES
from event_scenes import LOOKED, STEP, Change, Stream, body, torque_of
from events import PAGE, code_of_streams, finished_cells, measured_stream, of_part
from script import ROOT, markdown_table, options, write, write_table

from armload import Recording, arm
from armload.arms import rated_effort
from armload.devices import Simulator
from armload.lab.cells import key_of
from armload.lab.experiment import Task
from armload.motion import random_motion
from armload.online import runs
from armload.regression import Correction
from armload.simulation import Sensors, World

SEED, SECONDS, RATE = 80_000, 2400.0, 100.0
KINDS = ("as it is", "warms up")
WARMING, FRICTION = 1200.0, 0.3  # [s]; share of the friction that is lost
MEMORIES = {"cut back": runs.REMEMBERED, "all": np.inf}  # [s]


@dataclass(frozen=True)
class Shift:
    """One stream: its kind and its seed."""

    kind: str
    seed: int


def streamed(shift: Shift) -> Stream:
    """The samples of a stream, and what is true of them; of both kinds with the same arm, motion and payloads."""
    rng, panda = np.random.default_rng([shift.seed, 12]), arm("panda")
    changes, t, phi = [], 20.0, np.zeros(10)
    while t < SECONDS - APART[1]:
        took = float(np.exp(rng.uniform(*np.log(TAKES["moving"]))))
        phi = np.zeros(10) if phi[0] else body(rng, STEP)
        changes.append(Change(t, took, phi))
        t += took + rng.uniform(*APART)
    world = World.real_like(panda, shift.seed)
    more: dict[str, Any] = {"rate": RATE, "speed": None, "duration": SECONDS, "seed": shift.seed}
    source = Simulator(panda, random_motion(panda, shift.seed), [], world=world, sensors=Sensors.panda(panda), **more)
    log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
    tau = log.tau + torque_of(panda, log, Stream(panda, log, changes, [], []))
    if shift.kind == "warms up":
        warm = -np.expm1(-(log.t - log.t[0]) / WARMING)[:, None]
        offsets = rng.normal(size=panda.n) * Correction(panda, rated_effort(panda)).daily_std[: panda.n]
        friction = np.array([world.friction(v, np.zeros(panda.n)) for v in log.dq])
        tau = tau + warm * (offsets - FRICTION * friction)
    return Stream(panda, Recording(log.t, log.q, log.dq, tau), changes, [True] * len(changes), [])


def measured(shift: Shift) -> dict[str, Any]:
    """One stream as a cell's numbers, with either memory."""
    stream, remembered, out = streamed(shift), runs.REMEMBERED, {}
    try:
        for name, seconds in MEMORIES.items():
            runs.REMEMBERED = seconds
            out[name] = measured_stream(stream)
    finally:
        runs.REMEMBERED = remembered
    return out


def show(parts: dict[str, Any]) -> None:
    """The table of docs/online_measured.md."""
    rows = []
    for kind in KINDS:
        for memory in MEMORIES:
            part = parts[f"{kind}, {memory}"]
            told = [part[f"after_{s:g}_s"] for s in LOOKED]
            rows.append(
                (
                    kind,
                    memory,
                    f"{part['false']['hours']:.1f}",
                    str(part["changes"]),
                    f"{part['missed']['count'] - part['late']} and {part['late']} late",
                    str(part["false"]["count"]),
                    " · ".join(f"{100 * x['inside']['count'] / x['inside']['of']:.1f}" for x in told),
                    f"{100 * part['calibrated_and_out']:.1f} %",
                    f"{told[3]['error_g']['50 %']:.1f} ± {told[3]['half_width_g']['50 %']:.0f}",
                )
            )
    columns = (
        "the arm",
        "what a run knew",
        "hours",
        "hand-overs",
        "missed",
        "false events",
        "inside after " + " · ".join(f"{s:g}" for s in LOOKED) + " s [%]",
        "calibrated, and out",
        "error ± half-width [g] after 5 s",
    )
    write_table(PAGE, "warming", markdown_table(columns, "llrrrrrrr", rows))


def main() -> None:
    asked = options(__doc__, arms=2, minutes=0.0, seed=SEED, jobs=1, cells=ROOT / "out" / "warming-up")
    code = code_of_streams("events.py", "event_scenes.py", "cell_hours.py", "warming_up.py")
    shifts = [Shift(kind, asked.seed + k) for k in range(asked.arms) for kind in KINDS]
    tasks = [Task.of_one(f"{x.kind}-{x.seed}", key_of(asdict(x), code), measured, x) for x in shifts]
    cells = finished_cells(tasks, asked)
    parts = {}
    for kind in KINDS:
        for memory in MEMORIES:
            of = [cell[memory] | {"name": name} for name, cell in cells.items() if name.startswith(kind)]
            parts[f"{kind}, {memory}"] = of_part(of)
    result = {"seeds_from": asked.seed, "streams": len(cells), "parts": parts}
    print(json.dumps(result, indent=1))
    if asked.seed == SEED:
        write("warming_up", result)
        show(parts)


if __name__ == "__main__":
    main()

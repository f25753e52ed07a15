"""Hours of a cell's work: how many hand-overs a live stream misses, how many events are false, what the mass is then.

    python benchmarks/cell_hours.py [--streams 60] [--minutes 0] [--seed 70000] [--jobs 1] [--cells out/cell-hours]

`events.py` has every kind of change, five seconds apart, and too few of each to tell a rate of 1 % from none. Here are
streams of ten minutes (real-like Pandas as there, 200 Hz, a random motion of the arm's own again and again, no tare) in
which something of 0.2 kg and more is taken up and put down in turn, 8 to 40 s apart:

moving     the arm moves on; each hand-over takes 0.05 to 2 s (evenly in its logarithm)
standing   the arm stands from 2 s before to 2 s after, as at a gripper; each takes 0.05 to 0.5 s

What is handed over is added to the sensors' torque, as in the scenes of `events.py` that take time; what counts as
noticed, late, false and inside is said there. Streams are cells in out/cell-hours, and are not measured again while
`armload.online`, `armload.posterior`, `armload.regression` and the scenes stay as they are. Constants were set on other
seeds. Printed, and written to benchmarks/results/cell_hours.json and a table of docs/online_measured.md; printed only
with another seed than 70000.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from event_scenes import LOOKED, Change, Resting, Stream, body, torque_of
from events import PAGE, code_of_streams, finished_cells, measured_stream, of_part
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, write, write_table

from armload import Recording, arm
from armload.devices import Simulator
from armload.lab.cells import key_of
from armload.lab.experiment import Task
from armload.motion import Motion, random_motion
from armload.simulation import Sensors, World

SEED, SECONDS = 70_000, 600.0
KINDS = ("moving", "standing")
APART = (8.0, 40.0)  # [s] from the end of one hand-over to the beginning of the next
TAKES = {"moving": (0.05, 2.0), "standing": (0.05, 0.5)}  # [s]
STANDS = 5.0  # [s] of `Resting`, from a second after its stop on


@dataclass(frozen=True)
class Hours:
    """One stream: its kind and its seed."""

    kind: str
    seed: int


def streamed(
    scene: Hours,
    seconds: float = SECONDS,
    apart: tuple[float, float] = APART,
    draw: Callable[[np.random.Generator], NDArray[np.float64]] = body,
) -> Stream:
    """The samples of a stream, and what is true of them; draw: phi (10,) of what is taken up next."""
    rng, panda = np.random.default_rng([scene.seed, KINDS.index(scene.kind), 11]), arm("panda")
    changes, stops, t, phi = [], [], 20.0, np.zeros(10)
    while t < seconds - 2.0 * apart[0]:
        took = float(np.exp(rng.uniform(*np.log(TAKES[scene.kind]))))
        phi = np.zeros(10) if phi[0] else draw(rng)
        changes.append(Change(t, took, phi))
        stops.append(t - 2.0)
        t += took + STANDS * (scene.kind == "standing") + rng.uniform(*apart)
    motion: Motion = random_motion(panda, scene.seed)
    if scene.kind == "standing":
        motion = Resting(motion, tuple(stops), rounds=int(np.ceil(seconds / motion.duration)))
    source = Simulator(
        panda,
        motion,
        [],
        world=World.real_like(panda, scene.seed),
        sensors=Sensors.panda(panda),
        rate=200.0,
        speed=None,
        duration=seconds,
        seed=scene.seed,
    )
    log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
    stream = Stream(panda, log, changes, [True] * len(changes), [])
    loaded = Recording(log.t, log.q, log.dq, log.tau + torque_of(panda, log, stream))
    return Stream(panda, loaded, changes, stream.counted, [])


def measured(scene: Hours) -> dict[str, Any]:
    """One stream as a cell's numbers."""
    return measured_stream(streamed(scene))


def show(parts: dict[str, Any]) -> None:
    """The table of docs/online_measured.md."""
    rows = []
    for kind, part in parts.items():
        missed, false = part["missed"], part["false"]
        told = [part[f"after_{s:g}_s"] for s in LOOKED]
        rows.append(
            (
                kind,
                f"{false['hours']:.1f}",
                str(part["changes"]),
                f"{missed['count'] - part['late']} and {part['late']} late "
                f"({100 * missed['low']:.1f}–{100 * missed['high']:.1f} %)",
                f"{false['count']} ({10 * false['low']:.1f}–{10 * false['high']:.1f})",
                f"{part['delay_s']['50 %']:.2f} s",
                f"{part['delay_after_its_end_s']['50 %']:.2f} s, {part['delay_after_its_end_s']['90 %']:.2f} s",
                " · ".join(f"{100 * x['inside']['count'] / x['inside']['of']:.1f}" for x in told),
                " · ".join(f"{x['error_g']['50 %']:.0f} ± {x['half_width_g']['50 %']:.0f}" for x in (told[0], told[2])),
            )
        )
    columns = (
        "the arm",
        "hours",
        "hand-overs",
        "missed",
        "false events (in ten hours)",
        "delay",
        "after its end",
        "inside after " + " · ".join(f"{s:g}" for s in LOOKED) + " s [%]",
        "error ± half-width [g] after 0.5 · 2 s",
    )
    write_table(PAGE, "hours", markdown_table(columns, "lrrrrrrrr", rows))


def main() -> None:
    asked = options(__doc__, streams=60, minutes=0.0, seed=SEED, jobs=1, cells=ROOT / "out" / "cell-hours")
    code = code_of_streams("event_scenes.py", "cell_hours.py")
    tasks = []
    for k in range(asked.streams):
        scene = Hours(KINDS[k % len(KINDS)], asked.seed + k)
        tasks.append(Task.of_one(f"{scene.kind}-{scene.seed}", key_of(asdict(scene), code), measured, scene))
    cells = finished_cells(tasks, asked)
    parts = {kind: of_part([x for name, x in cells.items() if name.startswith(kind)]) for kind in KINDS}
    result = {"seeds_from": asked.seed, "streams": len(cells), "parts": parts}
    print(json.dumps(result, indent=1))
    if asked.seed == SEED:
        write("cell_hours", result)
        show(parts)


if __name__ == "__main__":
    main()

"""Live streams of other arms than the Panda: what is noticed of light, middle and heavy payloads, and what is wrong.

    python benchmarks/events_of_arms.py [--streams 4] [--minutes 0] [--seed 60000] [--jobs 1] [--arms ur10e,gen3]
                                        [--cells out/events-of-arms]

Streams of 20 s at 200 Hz: a real-like arm (`World.real_like`, the sensors of its sheet), a random motion, a tare of
20 s on another one. After 6 s something is taken up at once, after 13 s it is put down. It weighs 3, 10 or 30 % of what
the arm is rated for. Each arm has as many streams of each as are asked for, with arms of their own.

What counts as noticed, late, false and inside is said in events.py. calibrated, and out: the share of all moments
whose answer is called calibrated and leaves the mass out. Printed, and written to
benchmarks/results/events_of_arms.json and a table of docs/online_measured.md; printed only with another seed than 60000
or some arms.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from event_scenes import LOOKED, Change, Stream
from events import PAGE, code_of_streams, finished_cells, measured_stream, of_part
from script import ROOT, markdown_table, options, write, write_table

from armload import Recording, arm
from armload.arms import rated_mass
from armload.devices import Simulator
from armload.inertia import InertialParameters
from armload.lab.cells import key_of
from armload.lab.experiment import Task
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.simulation import Sensors, World, simulate

SEED, SECONDS, RATE = 60_000, 20.0, 200.0
ARMS = ("gen3", "iiwa14", "fr3", "xarm7", "ur5e", "ur10e")
SHARES = (0.03, 0.1, 0.3)  # of the rated mass
TAKEN, PUT = 6.0, 13.0  # [s]


@dataclass(frozen=True)
class Scene:
    """One stream: its arm, its payload's share of the rated mass, and its seed."""

    arm: str
    share: float
    seed: int


def streamed(scene: Scene) -> Stream:
    """The samples of a stream with its tare, and what is true of them."""
    robot = arm(scene.arm)
    own = scene.seed + 1000 * ARMS.index(scene.arm) + 100 * SHARES.index(scene.share)
    drawn = draw_payload("boxes", own, rated=rated_mass(robot)).parameters
    held = InertialParameters(drawn.phi * scene.share * rated_mass(robot) / drawn.mass, drawn.frame)
    world, sensors = World.real_like(robot, own), Sensors.of(robot)
    more: dict[str, Any] = {"rate": RATE, "speed": None, "duration": SECONDS, "seed": own}
    payloads = [(TAKEN, held), (PUT, None)]
    source = Simulator(robot, random_motion(robot, own), payloads, world=world, sensors=sensors, **more)
    log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
    before = random_motion(robot, own + 50_000, duration=SECONDS)
    tare = simulate(robot, before, world=world, sensors=sensors, rate=RATE, seed=own + 1)
    changes = [Change(TAKEN, 0.0, robot.in_frame(held).phi), Change(PUT, 0.0, np.zeros(10))]
    return Stream(robot, log, changes, [True, True], [], tare=tare)


def measured(scene: Scene) -> dict[str, Any]:
    """One stream as a cell's numbers."""
    return measured_stream(streamed(scene))


def show(parts: dict[str, dict[str, Any]]) -> None:
    """The table of docs/online_measured.md."""
    rows = []
    for part in parts.values():
        told, missed = [part[f"after_{s:g}_s"] for s in LOOKED], part["missed"]["count"]
        rows.append(
            (
                part["arm"],
                f"{part['kg']:.2g}",
                str(part["changes"]),
                f"{part['changes'] - missed}, {part['late']}, {missed - part['late']}",
                str(part["false"]["count"]),
                "–" if part["delay_s"] is None else f"{part['delay_s']['50 %']:.2f} s",
                " · ".join(f"{100 * x['inside']['count'] / x['inside']['of']:.0f}" for x in told),
                f"{100 * part['calibrated']:.0f} %",
                f"{100 * part['calibrated_and_out']:.1f} %",
                f"{told[2]['error_g']['50 %']:.0f} ± {told[2]['half_width_g']['50 %']:.0f}",
            )
        )
    columns = (
        "arm",
        "mass [kg]",
        "changes",
        "in time, late, missed",
        "false events",
        "delay",
        "inside after " + " · ".join(f"{s:g}" for s in LOOKED) + " s [%]",
        "calibrated",
        "calibrated, and out",
        "error ± half-width [g] after 2 s",
    )
    write_table(PAGE, "arms", markdown_table(columns, "lrrrrrrrrr", rows))


def main() -> None:
    asked = options(
        __doc__, streams=4, minutes=0.0, seed=SEED, jobs=1, arms=",".join(ARMS), cells=ROOT / "out" / "events-of-arms"
    )
    names, code = asked.arms.split(","), code_of_streams("events.py", "event_scenes.py", "events_of_arms.py")
    scenes = [Scene(n, share, asked.seed + k) for k in range(asked.streams) for n in names for share in SHARES]
    tasks = [Task.of_one(f"{x.arm}-{x.share:g}-{x.seed}", key_of(asdict(x), code), measured, x) for x in scenes]
    cells = finished_cells(tasks, asked)
    parts = {}
    for name in names:
        for share in SHARES:
            of = [cell | {"name": key} for key, cell in cells.items() if key.startswith(f"{name}-{share:g}-")]
            parts[f"{name}-{share:g}"] = of_part(of) | {"arm": name, "kg": share * rated_mass(arm(name))}
    result = {"seeds_from": asked.seed, "streams": len(cells), "parts": parts}
    print(json.dumps(result, indent=1))
    if asked.seed == SEED and names == list(ARMS):
        write("events_of_arms", result)
        show(parts)


if __name__ == "__main__":
    main()

"""How far something must slide in a gripper before all logs of an arm together tell it.

    python benchmarks/loose_grippers.py [--seeds 61,62,63] [--logs 30] [--out out/loose-grippers]

Arms, motions and boxes of `fleet.py`, each seed with one of every role, half a month after their tare. The same logs
are answered as they are and with what is held sliding between two stops, `GAPS` either way, and `looseness` is asked.
A log is cut where the payload truly changes. Finished arms are kept in FOLDER: run again with the same code, it goes
on where it stopped. Printed, and written to
benchmarks/results/loose_grippers.json and a table of docs/survey.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from alarms import wilson
from fleet import BEGAN, DAY, EMPTY, RATE, WORK, drawn_payloads, role, with_play, world_of
from script import ROOT, markdown_table, options, say, write, write_table

from armload import arm
from armload.identification.thresholds import SETTLED
from armload.lab.cells import key_of
from armload.lab.episodes.motion_kinds import MotionSource
from armload.lab.experiment import Task, run_tasks, source_key
from armload.simulation import Sensors, simulate_inverse
from armload.survey.looseness import LOOSE, looseness
from armload.survey.rows import of_slide
from armload.survey.sliding import slides

GAPS = (0.0, 2.0, 5.0, 10.0)  # [mm] either way
DAYS, ROLES = 30, 4


def of_arm(panda: Any, k: int, seed: int, logs: int) -> dict[str, Any]:
    """What its logs together say of an arm, for each gap."""
    sensors, source = Sensors.panda(panda).evenly(), MotionSource(panda, 0.0)
    how: dict[str, Any] = {"sensors": sensors, "rate": RATE}
    rng = np.random.default_rng([seed, k, 22])
    empty = source.draw("long", rng, EMPTY, f"empty-{k}")
    kinds, centre = ("long", "pick-and-place", "fast", "point-to-point"), source.centre(empty)
    work = [source.draw(kind, rng, WORK, f"{kind}-{k}", centre, 0.5) for kind in kinds]
    turn = np.random.default_rng([seed, k, 23]).uniform(0.0, 2.0 * np.pi)
    axis = np.array([np.cos(turn), np.sin(turn), 0.0])
    tare = simulate_inverse(panda, empty, world=world_of(panda, k, -1, DAYS, seed), seed=seed, **how)
    of_gap: dict[float, list] = {gap: [] for gap in GAPS}
    for i in range(logs):
        day, number, held = DAYS // 2 + i * (DAYS // 2) // logs, int(rng.integers(1 << 30)), drawn_payloads(rng)
        motion, world = work[number % len(work)], world_of(panda, k, day, DAYS, seed)
        log = simulate_inverse(panda, motion, held, world=world, duration=WORK, seed=number, **how)
        edges = [*(t for t, _ in held), WORK]
        parts = [(edges[n] + SETTLED * (n > 0), edges[n + 1]) for n in range(len(held))]
        for gap, rows in of_gap.items():
            played = with_play(panda, motion, log, held, axis, 1e-3 * gap) if gap else log
            rows.append(
                [
                    {"log": f"{i}", "date": BEGAN + DAY * day, "held": p is not None}
                    | {"mass": 0.0 if p is None else float(p.parameters.mass)}
                    | of_slide(slide)
                    for (_, p), slide in zip(held, slides(played, panda, parts, tare), strict=True)
                ]
            )
    found = {gap: looseness(rows) for gap, rows in of_gap.items()}
    told = {f"{gap:g}": None if f is None else {"z": f.z, "gap [mm]": 1e3 * f.gap} for gap, f in found.items()}
    return {"seed": seed, "arm": k, "role": role(k) if k != 2 else "sound", "of gaps": told}


def main() -> None:
    asked = options(__doc__, seeds="61,62,63", logs=30, out="out/loose-grippers")
    code, panda = key_of(source_key(), source_key(__file__, Path(__file__).with_name("fleet.py"))), arm("panda")
    tasks = [
        Task.of_one(f"{seed}-{k}-{asked.logs}", key_of(code, seed, k, asked.logs), of_arm, panda, k, seed, asked.logs)
        for seed in map(int, asked.seeds.split(","))
        for k in range(ROLES)
    ]
    cells = run_tasks(tasks, asked.out, say=say)
    arms = [{name: cell[name] for name in ("seed", "arm", "role", "of gaps")} for cell in cells.values()]
    rows, rates = [], {}
    for gap in GAPS:
        told = [one["of gaps"][f"{gap:g}"] for one in arms]
        z = [0.0 if of is None else of["z"] for of in told]
        hits = sum(x > LOOSE for x in z)
        low, high = wilson(hits, len(z))
        rates[f"{gap:g}"] = [len(z), hits / len(z), low, high]
        share = f"{100 * hits / len(z):.0f} % ({100 * low:.0f}–{100 * high:.0f}) of {len(z)}"
        found = [of["gap [mm]"] for of in told if of is not None and of["z"] > LOOSE]
        rows.append([f"{gap:g}", share, f"{min(z):.1f} … {max(z):.1f}", f"{np.median(found):.1f}" if found else ""])
    heads = ["slides [mm either way]", "arms called loose", "z", "found [mm], median"]
    write_table(ROOT / "docs" / "survey.md", "loose", markdown_table(heads, "rrrr", rows))
    write("loose_grippers", {"logs of each arm": asked.logs, "called": rates, "arms": arms})


if __name__ == "__main__":
    main()

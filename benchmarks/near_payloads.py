"""Payloads that weigh nearly the same, one after another: is one taken for the other, and what does that cost?

    python benchmarks/near_payloads.py [--streams 6] [--minutes 0] [--seed 76000] [--jobs 1] [--cells out/near-payloads]

Streams as those of `cell_hours.py`, of 150 s, with 4 to 8 s from the end of one hand-over to the next. What is taken
up, and put down again, is a box of a lot: it weighs 0.3 or 1 kg, and up to 20 % more or less (evenly), with its centre
of mass 3 mm (1 sigma in each axis) elsewhere; or it is the same box each time. A stream takes up an earlier run again
once it recognises what that held (`Runs.is_earlier`); beside the rule as it is stands that of a fixed standard
deviation for every mass (`RETURN_STD`, without `RETURN_SHARE`). Both see the same streams.

Looked at 0.2, 0.5, 1, 2 and 3.5 s after the end of a hand-over, or, of an arm that stands, after it moves on (faster
than 0.05 rad/s). *false*: events that are not within three seconds of a hand-over's beginning. Streams are cells, as in
`cell_hours.py`. Printed, and written to benchmarks/results/near_payloads.json and a table of docs/online_measured.md;
printed only with another seed than 76000.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from cell_hours import KINDS, Hours, streamed
from event_scenes import Stream
from events import PAGE, code_of_streams, finished_cells
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, write, write_table

from armload.inertia import InertialParameters
from armload.lab.cells import key_of
from armload.lab.experiment import Task
from armload.online import OnlineIdentifier, runs

SEED = 76_000
SECONDS, APART = 150.0, (4.0, 8.0)
AFTER = (0.2, 0.5, 1.0, 2.0, 3.5)  # [s]
MOVES = 0.05  # [rad/s]
LOTS = ((0.3, 0.2), (1.0, 0.2), (0.3, 0.0))  # [kg], and up to which share they differ
FIXED = 100.0  # `RETURN_SHARE` with which `RETURN_STD` alone decides


@dataclass(frozen=True)
class Lot:
    """One stream: what the arm does, the boxes' mass [kg] and the share by which they differ, and by which rule."""

    kind: str
    mass: float
    share: float
    fixed: bool
    seed: int

    def box(self, rng: np.random.Generator) -> NDArray[np.float64]:
        """phi (10,) of the next one."""
        mass, aside = self.mass * (1.0 + self.share * rng.uniform(-1.0, 1.0)), 0.003 * rng.normal(size=3)
        com = np.array([0.005, -0.01, 0.07]) + aside * (self.share > 0.0)
        return InertialParameters.from_com(mass, com, mass * np.diag([1.5e-3, 1.7e-3, 8e-4])).phi


def moments(stream: Stream) -> list[tuple[float, float, float]]:
    """What is looked at: when [s], how long after the arm has its new box and moves [s], and the box's mass [kg]."""
    t, moving = stream.log.t, np.abs(stream.log.dq).max(axis=1) > MOVES
    out = []
    for change in stream.changes:
        from_end = (t >= change.start + change.seconds) & moving
        if change.phi[0] and from_end.any():
            begins = float(t[from_end.argmax()])
            out += [(begins + after, after, float(change.phi[0])) for after in AFTER]
    return sorted(out)


def measured(lot: Lot) -> dict[str, Any]:
    """One stream as a cell's numbers."""
    stream = streamed(Hours(lot.kind, lot.seed), SECONDS, APART, lot.box)
    looked, found, events, before = moments(stream), [], set(), runs.RETURN_SHARE
    identifier = OnlineIdentifier(stream.robot)
    try:
        runs.RETURN_SHARE = FIXED if lot.fixed else before
        for sample in stream.log:
            one = identifier.update(*sample)
            if one.event is not None:
                events.add(one.event.t)
            while looked and one.t >= looked[0][0]:
                _, after, mass = looked.pop(0)
                low, high = float(one.low[0]), float(one.high[0])
                found.append((after, float(one.phi[0]) - mass, 0.5 * (high - low), low <= mass <= high))
    finally:
        runs.RETURN_SHARE = before
        identifier.close()
    begins = np.array([change.start for change in stream.changes])
    false = [t for t in sorted(events) if not ((begins <= t) & (t < begins + 3.0)).any()]
    return {"looks": found, "false": false}


def of_row(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """What several streams say together; errors and half-widths are medians [g]."""
    looks, after = np.array([look for cell in cells for look in cell["looks"]]), {}
    for seconds in AFTER:
        _, error, half, inside = looks[looks[:, 0] == seconds].T
        after[f"{seconds:g}"] = {
            "of": len(error),
            "inside": round(float(inside.mean()), 3),
            "error_g": round(1e3 * float(np.median(np.abs(error))), 1),
            "half_width_g": round(1e3 * float(np.median(half)), 1),
        }
    return {"after": after, "false": sum(len(cell["false"]) for cell in cells)}


def show(rows: list[dict[str, Any]]) -> None:
    """The table of docs/online_measured.md."""
    lines = []
    for row in rows:
        after = row["after"].values()
        lines.append(
            (
                row["kind"],
                f"{row['mass']:g} kg" + (f" ± {100 * row['share']:.0f} %" if row["share"] else ", the same"),
                "15 g" if row["fixed"] else "as it is",
                str(row["false"]),
                " · ".join(f"{100 * x['inside']:.0f}" for x in after) + f" of {row['after']['1']['of']}",
                " · ".join(f"{x['error_g']:.0f} ± {x['half_width_g']:.0f}" for x in after),
            )
        )
    told = " · ".join(f"{x:g}" for x in AFTER)
    last = (f"inside after {told} s [%]", f"error ± half-width [g] after {told} s")
    columns = ("the arm", "boxes", "rule", "false", *last)
    write_table(PAGE, "near", markdown_table(columns, "lllrrr", lines))


def main() -> None:
    asked = options(__doc__, streams=6, minutes=0.0, seed=SEED, jobs=1, cells=ROOT / "out" / "near-payloads")
    code = code_of_streams("event_scenes.py", "cell_hours.py", "near_payloads.py")
    rows = [(kind, *lot, fixed) for kind in KINDS for lot in LOTS for fixed in (False, True)]
    tasks, names = [], {}
    for kind, mass, share, fixed in rows:
        lots = [Lot(kind, mass, share, fixed, asked.seed + k) for k in range(asked.streams)]
        names[kind, mass, share, fixed] = [f"{kind}-{mass:g}-{share:g}-{fixed:d}-{lot.seed}" for lot in lots]
        own = zip(names[kind, mass, share, fixed], lots, strict=True)
        tasks += [Task.of_one(name, key_of(asdict(lot), code), measured, lot) for name, lot in own]
    cells = finished_cells(tasks, asked)
    found = []
    for row, own in names.items():
        if all(name in cells for name in own):
            told = dict(zip(("kind", "mass", "share", "fixed"), row, strict=True))
            found.append(told | of_row([cells[name] for name in own]))
    result = {"seeds_from": asked.seed, "streams": asked.streams, "rows": found}
    print(json.dumps(result, indent=1))
    if asked.seed == SEED:
        write("near_payloads", result)
        show(found)


if __name__ == "__main__":
    main()

"""Do the intervals hold for every kind of log and payload, or on average only? Coverage cell by cell.

    python benchmarks/coverage_cells.py [--logs 12] [--seed 40]

Sound logs of Pandas (`wrong_cases.py`), with a tare of 20 s near the run's poses, and of each of these one thing is
another: the motion, the tare, its age, the world. The physics answers each log once, after 1 and 6 s; then other
payloads take the place of its own: torque is linear in the ten parameters, so that h becomes h + Λ·(phi' − phi), as in
payload_intervals.py. Each log has twelve, two of every family, of a rating drawn between 0.1 and 3 kg evenly in its
logarithm; trays, bars and rings are of 0.3–2 kg. The errors of the torque's scale stay those of its own payload.

Cells by the log (motion, tare, age, world) and by the mass hold the four families that training draws from; those by
family hold all logs. Intervals are those that `identify` reports, whether it doubts a log or not. What a log does not
determine has the interval of what was known before, and does not count here.

determined  share of the inertias that are
inside      share of the true values inside their intervals: mass · first moments · inertia
width       mean half-width over mean error, the same three

Written to benchmarks/results/coverage_cells.json and a table of docs/hybrid_measured.md, after every kind of log; four
minutes of one core.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from payload_intervals import wide
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_cases import CASES, Wrong, changed
from wrong_logs import GROUPS

from armload import arm
from armload.identification.intervals import Before, phi_interval
from armload.inertia import determined
from armload.payloads import draw_payload
from armload.posterior import HybridIdentifier
from armload.posterior.hybrid import answer, std_under_weak_prior
from armload.regression import payload_prior_std

LOGS = {  # kind of log → what is not as in the first, case of wrong_cases.py, age of the tare [days]
    "the first kind": ("none", "nothing", 0.0),
    "everyday motions": ("motion", "nothing, everyday motions", 0.0),
    "a tare elsewhere": ("tare", "nothing, tare elsewhere", 0.0),
    "a tare along the same motion": ("tare", "nothing, same motion", 0.0),
    "no tare": ("tare", "nothing, no tare", 0.0),
    "a tare of yesterday": ("age", "day", 1.0),
    "arms beyond the measured ones": ("world", "nothing, arms beyond", 0.0),
    "another simulator": ("world", "nothing, another simulator", 0.0),
}
FAMILIES = ("boxes", "shapes", "tools", "container", "odd", "trays, bars, rings")
TRAINED = FAMILIES[:4]
RATINGS = (0.1, 3.0)  # [kg]
CLASSES = ((0.0, 0.2), (0.2, 0.7), (0.7, np.inf))  # [kg]
TIMES = (1.0, 6.0)  # [s]


class Judged(NamedTuple):
    """One payload in one log after so many seconds: error, half-width, whether inside, whether determined (10,)."""

    kind: str
    family: str
    mass: float
    t: float
    error: NDArray[np.float64]
    half: NDArray[np.float64]
    inside: NDArray[np.bool_]
    told: NDArray[np.bool_]


def payloads(k: int, seed: int) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Family and phi (10,) of those that take the place of the payload of log k."""
    rng = np.random.default_rng([seed, k, 21])
    for family in FAMILIES:
        for number in rng.integers(1 << 30, size=2):
            rating = float(np.exp(rng.uniform(*np.log(RATINGS))))
            trained = family in TRAINED or family == "odd"
            yield family, draw_payload(family, int(number), rating).parameters.phi if trained else wide(int(number))


def judged(log: Wrong, kind: str, k: int, seed: int) -> Iterator[Judged]:
    """All payloads in one log."""
    panda, age = arm("panda"), LOGS[kind][2]
    weak = payload_prior_std(panda)
    identifier = HybridIdentifier(panda, log.tare)
    identifier.allow_for(age)
    prior, calibration = identifier.model.prior_for(panda), identifier.model.calibration
    for t in TIMES:
        identifier.run(log.run.between(log.run.t[0], log.run.t[0] + t))
        own = identifier.evidence()
        for family, phi in payloads(k, seed):
            vector = own.vector + own.information @ (phi - log.truth)
            trusted = calibration.trusted(replace(own, vector=vector))
            found = answer(trusted, calibration, prior, False)
            std = np.sqrt(np.diag(found.covariance))
            told = determined(std, prior.std, std_under_weak_prior(trusted.information, weak), weak)
            low, high = phi_interval(found.phi, found.phi, std, told, Before(prior.mean, prior.std))
            inside = (low <= phi) & (phi <= high)
            yield Judged(kind, family, float(phi[0]), t, np.abs(found.phi - phi), 0.5 * (high - low), inside, told)


def cells(found: list[Judged]) -> list[dict[str, Any]]:
    """Every cell that has payloads."""
    out = []
    for kind, (what, _, _) in LOGS.items():
        out += cell(what, kind, [x for x in found if x.kind == kind and x.family in TRAINED])
    for low, high in CLASSES:
        name = f"{low:g} kg and more" if np.isinf(high) else f"{low:g}–{high:g} kg"
        out += cell("mass", name, [x for x in found if low <= x.mass < high and x.family in TRAINED])
    for family in FAMILIES:
        out += cell("family", family, [x for x in found if x.family == family])
    return out


def cell(what: str, name: str, some: list[Judged]) -> list[dict[str, Any]]:
    """One cell at each time."""
    out = []
    for t in TIMES:
        now = [x for x in some if x.t == t]
        if not now:
            continue
        error, half, inside, told = (np.array([x[part] for x in now]) for part in range(4, 8))
        some_told = [told[:, part] for part in GROUPS]
        out.append(
            {
                "by": what,
                "cell": name,
                "t": t,
                "payloads": len(now),
                "determined": [round(float(which.mean()), 3) for which in some_told],
                "inside": [
                    round(float(inside[:, part][which].mean()), 3) if which.any() else None
                    for part, which in zip(GROUPS, some_told, strict=True)
                ],
                "width": [
                    round(float(half[:, part][which].mean() / error[:, part][which].mean()), 2) if which.any() else None
                    for part, which in zip(GROUPS, some_told, strict=True)
                ],
                "mass error [g]": round(1e3 * float(error[:, 0].mean()), 1),
            }
        )
    return out


def table(found: list[dict[str, Any]]) -> str:
    """A row for each cell, both times beside each other."""
    rows = []
    for first, last in zip(found[::2], found[1::2], strict=True):
        told = [f"{100 * one['determined'][2]:.0f}" for one in (first, last)]
        shares, widths = (
            [" · ".join("–" if x is None else form.format(x) for x in one[what]) for one in (first, last)]
            for what, form in (("inside", "{:.0%}"), ("width", "{:.1f}"))
        )
        shares = [text.replace("%", "") for text in shares]
        rows.append([first["by"], first["cell"], str(first["payloads"]), *told, *shares, *widths])
    heads = ["inside [%] 1 s", "6 s", "half-width over error 1 s", "6 s"]
    columns = ["another", "cell", "payloads", "inertias determined [%] 1 s", "6 s", *heads]
    return markdown_table(columns, "llrrrrrrr", rows)


def main() -> None:
    asked = options(__doc__, logs=12, seed=40)
    found: list[Judged] = []
    for kind, (_, case, age) in LOGS.items():
        logs = changed("day", "panda", asked.logs, asked.seed) if age else CASES[case]("panda", asked.logs, asked.seed)
        for k, log in enumerate(logs):
            found += judged(log, kind, k, asked.seed)
        say(f"{kind}: {asked.logs} logs")
        made = cells(found)
        write("coverage_cells", {"logs": asked.logs, "seed": asked.seed, "cells": made})
        write_table(ROOT / "docs" / "hybrid_measured.md", "cells", table(made))
    say(table(cells(found)))


if __name__ == "__main__":
    main()

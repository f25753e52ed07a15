"""Bars longer than any that the payload prior was given: how many of their inertias the hybrid's intervals hold.

    python benchmarks/long_bars.py [--episodes 48] [--seed 7900] [--work out/long-bars]

The prior's bars end at 0.45 m for an arm rated for 3 kg (`payloads/wide.py`), lengths growing with the cube root of the
rating. Episodes of `broad` of a Panda, a Gen3 and a UR10e that no training saw are simulated; bars take the place of
their payloads, as in payload_intervals.py: across the flange's axis and turned about it in any way, held at their
middle within 15 mm, of 5 to 60 % of the rating, 20 to 50 mm broad and thick, in lengths of the bins below, evenly, for
a rating of 3 kg. What a log does not determine does not count.

determined  share of the moments and products of inertia that the log is said to determine
inside      share of those inside their 95 % interval, after 1 and 6 s
width       mean half-width over mean error of those, after 1 and 6 s
log alone   inside and width of the same under the weak prior of `map-gp`, the log trusted as the hybrid trusts it
rest        share of those inside of masses · first moments, after 6 s

Writes benchmarks/results/long_bars.json and a table of docs/hybrid_measured.md. Goes on from --work; three minutes of
one core.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, write, write_table
from wide_and_light import Answered, answered, records_of

from armload import arm
from armload.arms import rated_mass
from armload.inertia import Z95, InertialParameters
from armload.payloads import solids
from armload.posterior import shipped_model
from armload.regression import payload_prior_std

ARMS = ("panda", "gen3", "ur10e")
LENGTHS = (0.2, 0.45, 0.6, 0.8, 1.0)  # [m] for an arm rated for 3 kg; the first bin is within the prior
MASSES, BREADTH, OFF = (0.05, 0.6), (0.02, 0.05), 0.015  # [rating], [m], [m]
WHEN = (1.0, 6.0)  # [s]
Alone = tuple[NDArray[np.float64], NDArray[np.float64]]  # error and half-width (10,) of the log alone


def bar(rng: np.random.Generator, lengths: tuple[float, float], rated: float) -> InertialParameters:
    """One across the flange, about its frame, for an arm that is rated for so much [kg]."""
    scale, angle = float(np.cbrt(rated / 3.0)), rng.uniform(0.0, np.pi)
    size = scale * np.array([rng.uniform(*lengths), *rng.uniform(*BREADTH, size=2)])
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    centre = np.array([*rng.normal(0.0, OFF, size=2), rng.uniform(0.0, 0.12)])
    return solids.box(size, mass=rated * rng.uniform(*MASSES), rotation=turn, translation=scale * centre)


def measured(name: str, asked: Any) -> dict[tuple[float, float, float], list[tuple[Answered, Alone]]]:
    """The answers of one arm by bin of lengths and time, with the prior and without."""
    robot = arm(name)
    model, rated, weak = shipped_model(robot), rated_mass(robot), payload_prior_std(robot)
    records, rng = records_of(robot, name, asked), np.random.default_rng([asked.seed, 9])
    found: dict[tuple[float, float, float], list[tuple[Answered, Alone]]] = {}
    for k in range(len(records)):
        log = records.evidence(k)
        for lengths in pairwise(LENGTHS):
            truth = bar(rng, lengths, rated).phi
            when = next((t for t in WHEN if abs(log.t - t) < 0.3), None)
            if when is None:
                continue
            shifted = log.vector + log.information @ (truth - records.truth[k])
            with_bar = replace(log, vector=shifted)
            answer = answered(model.prior, model.calibration, with_bar, truth, weak)
            trusted = model.calibration.trusted(with_bar)
            P = np.linalg.inv(trusted.information + np.diag(weak**-2))
            alone = np.abs(P @ trusted.vector - truth), Z95 * np.sqrt(np.diag(P))
            found.setdefault((*lengths, when), []).append((answer, alone))
    return found


def counted(both: list[tuple[Answered, Alone]]) -> dict[str, float | None]:
    """What the docstring says of some answers."""
    answers = [answer for answer, _ in both]
    error, half = (np.array([getattr(one, part) for one in answers]) for part in ("error", "half"))
    told = np.array([one.told for one in answers], dtype=bool)
    e, h, known = error[:, 4:], half[:, 4:], told[:, 4:]
    inside = (error <= half) & told
    e_alone, h_alone = (np.array(part)[:, 4:][known] for part in zip(*(alone for _, alone in both), strict=True))
    return {
        "answers": len(answers),
        "determined": round(float(known.mean()), 3),
        "inside": round(float((e <= h)[known].mean()), 3) if known.any() else None,
        "width": round(float(h[known].mean() / e[known].mean()), 2) if known.any() else None,
        "log alone, inside": round(float((e_alone <= h_alone).mean()), 3) if known.any() else None,
        "log alone, width": round(float(h_alone.mean() / e_alone.mean()), 2) if known.any() else None,
        "masses inside": round(float(inside[:, 0].sum() / told[:, 0].sum()), 3),
        "first moments inside": round(float(inside[:, 1:4].sum() / told[:, 1:4].sum()), 3),
    }


def table(cells: list[dict[str, Any]]) -> str:
    """A row for each bin of lengths."""
    rows = []
    for cell in cells:
        first, last = cell["after"]["1"], cell["after"]["6"]
        rows.append(
            [
                f"{cell['length [m]'][0]:g}–{cell['length [m]'][1]:g}",
                " · ".join(f"{100 * x['determined']:.0f}" for x in (first, last)),
                " · ".join(f"{100 * x['inside']:.0f}" for x in (first, last)),
                " · ".join(f"{x['width']:.1f}" for x in (first, last)),
                " · ".join(f"{100 * x['log alone, inside']:.0f}" for x in (first, last)),
                " · ".join(f"{x['log alone, width']:.1f}" for x in (first, last)),
                f"{100 * last['masses inside']:.0f} · {100 * last['first moments inside']:.0f}",
            ]
        )
    heads = ["length [m]", "determined [%]", "inside [%]", "half-width over error"]
    heads += ["the log alone: inside [%]", "half-width over error", "masses · first moments inside [%]"]
    return markdown_table(heads, "lrrrrrr", rows)


def main() -> None:
    asked = options(__doc__, episodes=48, seed=7900, work="")
    by_arm = {name: measured(name, asked) for name in ARMS}
    cells = []
    for lengths in pairwise(LENGTHS):
        after = {}
        for t in WHEN:
            answers = [one for found in by_arm.values() for one in found[(*lengths, t)]]
            each = {name: counted(found[(*lengths, t)])["inside"] for name, found in by_arm.items()}
            after[f"{t:g}"] = counted(answers) | {"inside by arm": each}
        cells.append({"length [m]": list(lengths), "after": after})
        say(str(cells[-1]))
    write("long_bars", {"episodes": asked.episodes, "seed": asked.seed, "arms": list(ARMS), "lengths": cells})
    write_table(ROOT / "docs" / "hybrid_measured.md", "long bars", table(cells))


if __name__ == "__main__":
    main()

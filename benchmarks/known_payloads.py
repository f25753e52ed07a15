"""What it brings to know what a payload is: its kind, or all of it from a drawing; and what is said if that is wrong.

    python benchmarks/known_payloads.py [--logs 12] [--seed 45]

Logs of a Panda of four kinds of `coverage_cells.py` (the first kind, everyday motions, a tare elsewhere, no tare), in
which payloads take each other's place as there; after 1 and 6 s.

nothing     the hybrid as it is
family      `--family`: the family that the payload is of; trays, bars and rings are those of `payload_intervals.py`,
            other draws and sizes than the prior's
drawing     `--body`: the payload with an error of 1 % of its mass, 3 mm of each coordinate of its centre and 10 % of
            its inertia (1 sigma each), and said so

error       mean absolute, of mass [g] · first moments [g·m] · inertia [g·m²]
inside      share of the true values inside the 95 % intervals [%], the same three; of all ten, determined or not
width       mean half-width over mean error
right       share of the logs that deny what is known, though it is true [%]
wrong       the same where it is another payload's: of another of the families, the drawing of the next payload

Written to benchmarks/results/known_payloads.json and a table of docs/hybrid_measured.md; three minutes of one core.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from coverage_cells import LOGS, TIMES, payloads
from numpy.typing import NDArray
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_cases import CASES, Wrong
from wrong_logs import GROUPS

from armload import arm
from armload.inertia import Z95, InertialParameters, is_consistent
from armload.payloads.uncertainty import Uncertainty
from armload.posterior import HybridIdentifier, Known, KnownBody
from armload.posterior.hybrid import answer, denies, without_learned_prior
from armload.regression import solution_prior_std

KINDS = ("the first kind", "everyday motions", "a tare elsewhere", "no tare")
OF = {"boxes": "boxes", "shapes": "shapes", "tools": "tools", "container": "container", "trays, bars, rings": "wide"}
KNOWN = ("nothing", "family", "drawing")
MASS, CENTRE, INERTIA = 0.01, 3e-3, 0.1


def drawing(phi: NDArray[np.float64], rng: np.random.Generator) -> KnownBody:
    """phi (10,) with an error, and the covariance that whoever drew it would state."""
    body = InertialParameters(phi)
    std = Uncertainty(MASS * body.mass, CENTRE, INERTIA)
    while True:  # until it is a body that can exist
        drawn = InertialParameters(rng.multivariate_normal(phi, std.covariance(body)))
        if is_consistent(drawn.phi):
            return KnownBody(drawn.phi, std.covariance(drawn))


def judged(log: Wrong, kind: str, k: int, seed: int) -> Iterator[dict[str, Any]]:
    """What is found of all payloads in one log, with what may be known of each; every log has drawings of its own."""
    panda, rng = arm("panda"), np.random.default_rng([seed, k, KINDS.index(kind)])
    identifier, wide = HybridIdentifier(panda, log.tare), solution_prior_std(panda)
    prior, calibration = identifier.model.prior_for(panda), identifier.model.calibration
    some = [(family, phi) for family, phi in payloads(k, seed) if family in OF]
    drawn = [drawing(phi, rng) for _, phi in some]
    for t in TIMES:
        identifier.run(log.run.between(log.run.t[0], log.run.t[0] + t))
        own = identifier.evidence()
        for j, (family, phi) in enumerate(some):
            other = (j + 2) % len(some)  # there are two payloads of each family
            trusted = calibration.trusted(replace(own, vector=own.vector + own.information @ (phi - log.truth)))
            alone = without_learned_prior(trusted, wide)
            said, wrong = prior.split(OF[family]), prior.split(OF[some[other][0]])
            right = denies(trusted, *said)
            body, others = Known(body=drawn[j]), Known(body=drawn[other])
            for known, found, denied, noticed in (
                ("nothing", answer(trusted, calibration, prior, False), False, False),
                (
                    "family",
                    answer(trusted, calibration, prior if right else said[0], False, whole=prior),
                    right,
                    denies(trusted, *wrong),
                ),
                (
                    "drawing",
                    answer(trusted, calibration, prior, False, known=body, alone=alone),
                    body.denied(*alone) is not None,
                    others.denied(*alone) is not None,
                ),
            ):
                half = Z95 * np.sqrt(np.diag(found.covariance))
                about = {"family": family, "t": t, "known": known, "right": denied, "wrong": noticed}
                yield about | {"error": np.abs(found.phi - phi), "half": half}


def lines(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A line for each family, time and what is known."""
    cells = defaultdict(list)
    for one in found:
        for family in (one["family"], "all"):
            cells[family, one["t"], one["known"]].append(one)
    out = []
    for family in (*OF, "all"):
        for t in TIMES:
            for known in KNOWN:
                some = cells[family, t, known]
                error, half = (np.array([one[key] for one in some]) for key in ("error", "half"))
                out.append(
                    {
                        "family": family,
                        "t": t,
                        "known": known,
                        "payloads": len(some),
                        "error": [float(1e3 * error[:, part].mean()) for part in GROUPS],
                        "inside": [float((error <= half)[:, part].mean()) for part in GROUPS],
                        "width": [float(half[:, part].mean() / error[:, part].mean()) for part in GROUPS],
                        "right": float(np.mean([one["right"] for one in some])),
                        "wrong": float(np.mean([one["wrong"] for one in some])),
                    }
                )
    return out


def table(made: list[dict[str, Any]]) -> str:
    """A row for each family and what is known, both times beside each other."""
    rows = []
    for family in (*OF, "all"):
        for known in KNOWN:
            both = [x for x in made if (x["family"], x["known"]) == (family, known)]
            cells = [
                text
                for key, form, unit in (("error", "{:.3g}", 1), ("inside", "{:.0f}", 100), ("width", "{:.1f}", 1))
                for text in (" · ".join(form.format(unit * value) for value in x[key]) for x in both)
            ]
            told = [
                "" if known == "nothing" else " · ".join(f"{100 * x[key]:.0f}" for x in both)
                for key in ("right", "wrong")
            ]
            rows.append([family, known, str(both[0]["payloads"]), *cells, *told])
    heads = [f"{what}{at}" for what in ("error", "inside [%]", "width") for at in (" 1 s", ", 6 s")]
    columns = ["payload", "known", "number", *heads, "right denied [%]", "wrong denied"]
    return markdown_table(columns, "llrrrrrrrrr", rows)


def main() -> None:
    asked = options(__doc__, logs=12, seed=45)
    found: list[dict[str, Any]] = []
    for kind in KINDS:
        for k, log in enumerate(CASES[LOGS[kind][1]]("panda", asked.logs, asked.seed)):
            found += judged(log, kind, k, asked.seed)
        say(f"{kind}: {asked.logs} logs")
    made = lines(found)
    write("known_payloads", {"logs": asked.logs, "seed": asked.seed, "lines": made})
    write_table(ROOT / "docs" / "hybrid_measured.md", "known payloads", table(made))
    say(table(made))


if __name__ == "__main__":
    main()

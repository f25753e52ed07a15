"""How much of how well a component of the payload prior fits should count: beta of `posterior.payload_prior`.

    python benchmarks/coarsening.py [--logs 12] [--seed 0]

Logs of wrong_cases.py, 6 s with a tare of 20 s: sound ones (of the benchmark's reference population, of its other
shapes, and of a second simulator), and such of which a tool or a hand is off since the tare. The physics answers each
once; its evidence is then judged under priors of several beta. beta was chosen on seeds 1, 2 and 3.

inside    share of the true values inside their intervals: mass · first moments · inertia; of logs whose tare holds
          something else, also those of answers that are called approximate, as something was exchanged
width     mean half-width over mean error
error     mean error: mass [g] · first moments [g·m] · inertia [g·m²]

Written to benchmarks/results/coarsening.json and a table of docs/hybrid_measured.md.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from script import ROOT, markdown_table, options, say, write, write_table
from wrong_cases import CASES

from armload import arm
from armload.inertia import Z95
from armload.posterior import Evidence, HybridIdentifier, shipped_model
from armload.posterior.hybrid import answer

BETAS = (1.0, 0.8, 0.7, 0.5)
ROWS = {
    "sound": ("nothing", "nothing, other shapes", "nothing, another simulator"),
    "tool or hand off": ("tool off since the tare", "hand off since the tare"),
}
GROUPS = {"mass": (slice(0, 1), 1e3), "first moments": (slice(1, 4), 1e3), "inertia": (slice(4, 10), 1e3)}


def judged(logs: list[tuple[Evidence, np.ndarray]], beta: float) -> dict[str, dict[str, float]]:
    """The measures of answers under the prior of one beta."""
    panda = arm("panda")
    model = shipped_model(panda)
    prior, error, half, said = replace(model.prior_for(panda), beta=beta), [], [], []
    for evidence, truth in logs:
        found = answer(model.calibration.trusted(evidence), model.calibration, prior, False)
        error.append(np.abs(found.phi - truth))
        half.append(Z95 * np.sqrt(np.diag(found.covariance)))
        said.append(found.exchanged)
    e, h, fine = np.array(error), np.array(half), np.array(said)
    inside = (e <= h) | fine[:, None]
    return {
        name: {
            "inside": round(float(inside[:, part].mean()), 3),
            "width": round(float(h[:, part].mean() / e[:, part].mean()), 2),
            "error": round(unit * float(e[:, part].mean()), 2),
        }
        for name, (part, unit) in GROUPS.items()
    }


def main() -> None:
    asked = options(__doc__, logs=12, seed=0)
    panda, logs = arm("panda"), {row: [] for row in ROWS}
    for row, cases in ROWS.items():
        for name in cases:
            for log in CASES[name]("panda", asked.logs, asked.seed):
                identifier = HybridIdentifier(panda, log.tare)
                identifier.run(log.run)
                logs[row].append((identifier.evidence(), log.truth))
            say(f"{name}: {asked.logs} logs")
    found = {row: {f"{beta:g}": judged(of, beta) for beta in BETAS} for row, of in logs.items()}
    rows = []
    for row, of in found.items():
        for beta, groups in of.items():
            parts = [
                " · ".join(f"{g[what]:{form}}" for g in groups.values())
                for what, form in (("inside", ".2f"), ("width", ".1f"), ("error", ".2f"))
            ]
            rows.append([f"{row}, {len(logs[row])}", beta, *parts])
    table = markdown_table(["logs", "beta", "inside", "half-width over error", "error"], "lrrrr", rows)
    say(table)
    write("coarsening", {"logs": {row: len(of) for row, of in logs.items()}, "seed": asked.seed, "found": found})
    write_table(ROOT / "docs" / "hybrid_measured.md", "coarsening", table)


if __name__ == "__main__":
    main()

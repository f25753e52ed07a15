"""The hybrids that are part of armload: how often their intervals held on episodes left out, as their training found.

    python benchmarks/shipped_models.py

Reads the reports that `armload train --report` wrote (benchmarks/results/hybrid_NAME.json) and writes a table of
docs/hybrid_measured.md. Trains nothing.
"""

from __future__ import annotations

import json

import numpy as np
from script import RESULTS, ROOT, markdown_table, write_table

from armload.arms import ARMS
from armload.posterior.model_file import SHIPPED


def row(name: str) -> list[str]:
    """Episodes, coverage of all, by time and parameter, and half-width over error, with and without a tare."""
    report = json.loads((RESULTS / f"hybrid_{name}.json").read_text(encoding="utf-8"))
    cells, ratio = (np.array(report[key], dtype=float)[:2] for key in ("cells", "ratio"))
    sides = {"link": "joint torque", "motor": "motor current"}
    return [
        f"`{name}`",
        sides[ARMS[name].torque_side],
        str(report["episodes"]),
        f"{100 * report['pooled']:.1f} %",
        f"{100 * np.nanmin(cells):.1f} – {100 * np.nanmax(cells):.1f} %",
        f"{np.nanmean(ratio):.1f}",
    ]


def main() -> None:
    columns = ["arm", "measures", "episodes", "intervals that held", "by parameter and time", "half-width over error"]
    table = markdown_table(columns, "llrrrr", [*map(row, SHIPPED)])
    write_table(ROOT / "docs" / "hybrid_measured.md", "shipped models", table)


if __name__ == "__main__":
    main()

"""What other trainings make of a statement: its number for each seed that was trained.

The interval of a statement is over arms or payloads, for one training; it does not hold what another seed changes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from armload.lab.study.numbers import READING, Cell, Cells, cap
from armload.lab.study.statements import RULES

_LEARNED = ("tree", "network", "mixed")


def by_training(cells: Cells, claim: Mapping[str, Any]) -> list[float]:
    """The number of a statement by each seed, all networks with the cap of those that have several seeds.

    Args:
        cells: finished cells by name. claim: of `load_claims`.

    Returns:
        One number for each seed with all its cells; empty where there are fewer than two, or no training matters.
    """
    seeds = sorted({cell["spec"]["seed"] for cell in cells.values() if _main(cell)})
    most = max(
        (c for cell in cells.values() if _main(cell) and cell["spec"]["seed"] and (c := cap(cell))), default=None
    )
    found = []
    for seed in seeds:
        kept = {
            name: cell
            for name, cell in cells.items()
            if cell["spec"]["kind"] not in _LEARNED
            or (_main(cell) and cell["spec"]["seed"] == seed and cap(cell) in (None, most))
        }
        if (measured := RULES[claim["rule"]].measure(kept, claim.get("learner"), "row")) is not None:
            found.append(measured.value)
    return found if len(set(found)) > 1 else []


def _main(cell: Cell) -> bool:
    """Whether it is a trained ensemble that is no reading's."""
    return cell["spec"]["kind"] in _LEARNED and cell["spec"].get("ablation") != READING

"""The tables of docs/paper_travel.md, from benchmarks/results/study_travel.json.

python benchmarks/study_travel_page.py
"""

from __future__ import annotations

import json
from typing import Any

from script import RESULTS, ROOT, markdown_table, write_table

from armload.lab.study.claims import load_claims

GROUPS = {  # what stands first in a claim's id
    "fig4-tree-network": "one stage: trees before networks",
    "fig4-network-tree": "one stage: networks before trees",
    "fig5-tree-network": "two stages: trees before networks",
    "stages-network-single": "networks: one stage before two (mass, first moments)",
    "stages-tree-single": "trees: one stage before two (mass, first moments)",
    "stages-network-two": "networks: two stages before one (inertia)",
    "stages-tree-two": "trees: two stages before one (inertia)",
    "fig7-network": "networks before least squares",
    "fig7-tree": "trees before least squares",
}
WORDS = {True: "holds", False: "reversed", None: "open"}


def counts(found: list[Any]) -> str:
    """How many percentages hold, are open, and are reversed, of those that are measured."""
    there = [one[2] for one in found if one is not None]
    if not there:
        return "–"
    return " · ".join(str(sum(direction is wanted for direction in there)) for wanted in (True, None, False))


def groups(settings: dict[str, Any]) -> str:
    """Rows by group of claims; columns by setting and split."""
    rows = []
    for start, name in GROUPS.items():
        row = [name]
        for setting in settings.values():
            chosen = [claim for key, claim in setting["claims"].items() if key.startswith(start)]
            row += [counts([claim[split] for claim in chosen]) for split in ("row", "payload")]
        rows.append(row)
    every = ["all percentages"]
    for setting in settings.values():
        chosen = [
            claim for key, claim in setting["claims"].items() if key.split("-")[0] in ("fig4", "fig5", "stages", "fig7")
        ]
        every += [counts([claim[split] for claim in chosen]) for split in ("row", "payload")]
    heads = [f"{name}, {split} held out" for name in settings for split in ("rows", "payloads")]
    return markdown_table(("claims", *heads), "l" + "l" * len(heads), [*rows, every])


def shown(one: list[Any] | None) -> str:
    """A percentage with its interval and direction."""
    if one is None:
        return "–"
    value, (low, high), direction = one
    bounds = "" if low is None else f" [{low:.3g}, {high:.3g}]"
    return f"{value:.3g}{bounds} {WORDS[direction]}"


def each(settings: dict[str, Any]) -> str:
    """Every percentage, rows held out."""
    paper = {claim["id"]: claim for claim in load_claims()}
    names = next(iter(settings.values()))["claims"]
    rows = [
        [paper[key]["text"], str(paper[key]["paper"]), *(shown(s["claims"][key]["row"]) for s in settings.values())]
        for key in names
        if paper[key]["paper"] is not None
    ]
    return markdown_table(("claim", "paper [%]", *settings), "lr" + "l" * len(settings), rows)


def main() -> None:
    settings = json.loads((RESULTS / "study_travel.json").read_text(encoding="utf-8"))["settings"]
    page = ROOT / "docs" / "paper_travel.md"
    write_table(page, "travel", groups(settings))
    write_table(page, "each claim", each(settings))


if __name__ == "__main__":
    main()

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
ZERO = ("container", "Ixy")  # payloads, and what is identically zero in each of them: nothing to compare


def comparable(setting: str, claim: str, parameters: dict[str, str]) -> bool:
    """Whether payloads of the setting differ in the claim's parameter."""
    payloads, parameter = ZERO
    return not (setting.endswith(payloads) and parameters[claim] == parameter)


def counts(found: list[Any]) -> str:
    """How many percentages hold, are open, and are reversed, of those that are measured."""
    there = [one[2] for one in found if one is not None]
    if not there:
        return "–"
    return " · ".join(str(sum(direction is wanted for direction in there)) for wanted in (True, None, False))


def groups(settings: dict[str, Any]) -> str:
    """Rows by group of claims; columns by setting and split."""
    parameters = {claim["id"]: claim["parameter"] for claim in load_claims()}
    rows = []
    for start, name in [*GROUPS.items(), (tuple(GROUPS), "all percentages")]:
        row = [name]
        for called, setting in settings.items():
            chosen = [
                claim
                for key, claim in setting["claims"].items()
                if key.startswith(start) and comparable(called, key, parameters)
            ]
            row += [counts([claim[split] for claim in chosen]) for split in ("row", "payload")]
        rows.append(row)
    heads = [f"{name}, {split} held out" for name in settings for split in ("rows", "payloads")]
    return markdown_table(("claims", *heads), "l" + "l" * len(heads), rows)


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
    parameters = {key: claim["parameter"] for key, claim in paper.items()}
    rows = [
        [
            paper[key]["text"],
            str(paper[key]["paper"]),
            *(
                shown(s["claims"][key]["row"]) if comparable(called, key, parameters) else "not comparable"
                for called, s in settings.items()
            ),
        ]
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

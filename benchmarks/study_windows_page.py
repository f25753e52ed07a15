"""The figure and the tables of docs/learning.md on learners over windows, from benchmarks/results/study_windows.json.

python benchmarks/study_windows_page.py
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from learning_page import mass, shown
from numpy.typing import NDArray
from script import RESULTS, ROOT, markdown_table, write_table
from study_windows import INPUTS, WORLDS
from study_windows_data import TARES

from armload.lab.report.style import COLOURS, look

TITLES = {"real_like": "arms as in the training", "beyond": "arms beyond it"}
PHYSICS = ("ridge", "map-gp", "same-prior", "hybrid")
LEARNERS = {"conv": "convolution", "gru": "GRU", "transformer": "transformer", "statistics": "network on statistics"}
ON_TOP = "ridge's answer"

Errors = dict[str, NDArray[np.float64]]  # |error| (runs, 10) in g, g·m and g·m², by kind of arm


def physics(cells: list[dict[str, Any]]) -> dict[str, Errors]:
    """Of what is not trained, by its name."""
    judged = {cell["worlds"]: cell["errors"] for cell in cells if "worlds" in cell}
    return {name: {w: _sizes(judged[w][name]) for w in WORLDS} for name in judged[WORLDS[0]]}


def learners(cells: list[dict[str, Any]]) -> dict[tuple[str, str, str, int, int], tuple[Errors, dict[str, Any]]]:
    """Of learners, with their cells, by (learner, input, tare, episodes, seed)."""
    trained = [cell for cell in cells if "learner" in cell]
    return {
        tuple(cell[k] for k in ("learner", "input", "tare", "episodes", "seed")): (
            {w: _sizes(cell["errors"][w]) for w in WORLDS},
            cell,
        )
        for cell in trained
    }


def _sizes(errors: list[list[float]]) -> NDArray[np.float64]:
    return 1e3 * np.abs(np.array(errors, dtype=float))


def table(cells: list[dict[str, Any]]) -> str:
    """Every method on the same runs: mass ± standard error, first moments, inertia; and what a training costs."""
    known = physics(cells)

    def row(name: str, seen: str, errors: Errors, cost: str = "–") -> list[str]:
        return [name, seen, *(shown(errors[w]) for w in WORLDS), cost]

    rows = [row("training mean", "–", known["training mean"])]
    rows += [row(f"{p}, {t}", "–", known[f"{p}, {t}"]) for t in TARES for p in PHYSICS if f"{p}, {t}" in known]
    found = learners(cells)
    most = max(key[3] for key in found)
    order = {what: k for k, what in enumerate((*INPUTS, ON_TOP))}
    for key in sorted(found, key=lambda k: (order[k[1]], list(LEARNERS).index(k[0]), k[2], -k[3], k[4])):
        kind, what, tare, episodes, seed = key
        errors, cell = found[key]
        marks = ["" if episodes == most else f"{episodes} episodes", "" if seed == 0 else f"seed {seed}"]
        name = ", ".join([LEARNERS[kind], tare, *filter(None, marks)])
        rows.append(row(name, what, errors, f"{cell['cost_s']:.0f}"))
    columns = ("method", "input", *TITLES.values(), "train [CPU s]")
    return markdown_table(columns, "llllr", rows)


def gained(cells: list[dict[str, Any]]) -> str:
    """What learners add to the ridge regression: |its error| − |error with the learner's correction|, run by run."""
    known, rows = physics(cells), []
    for (kind, what, tare, _, seed), (errors, _) in sorted(learners(cells).items(), key=lambda item: str(item[0])):
        if what != ON_TOP:
            continue
        before, parts = known[f"ridge, {tare}"], []
        for worlds in WORLDS:
            for columns, digits in ((slice(0, 1), 0), (slice(1, 4), 1), (slice(4, 10), 2)):
                better = (before[worlds] - errors[worlds])[:, columns].mean(axis=1)
                parts.append(f"{better.mean():.{digits}f} ± {better.std(ddof=1) / np.sqrt(len(better)):.{digits}f}")
        rows.append([f"{LEARNERS[kind]}, {tare}" + (f", seed {seed}" if seed else ""), *parts])
    heads = [
        f"{title}: {part}" for title in TITLES.values() for part in ("mass [g]", "moments [g·m]", "inertia [g·m²]")
    ]
    return markdown_table(("learner of the ridge's error", *heads), "l" + "r" * len(heads), rows)


def figure(cells: list[dict[str, Any]]) -> None:
    """Error of the mass of every method, with its standard error; filled: with a tare."""
    import matplotlib.pyplot as plt

    known, found = physics(cells), learners(cells)
    most = max(key[3] for key in found)
    lines: list[tuple[str, str, dict[str, Errors]]] = [("training mean", "#8A8A8A", {TARES[0]: known["training mean"]})]
    for what, colour in zip((*INPUTS, ON_TOP), (COLOURS[1], COLOURS[4], COLOURS[5], COLOURS[2]), strict=True):
        for kind, name in LEARNERS.items():
            of = {t: found[key][0] for t in TARES if (key := (kind, what, t, most, 0)) in found}
            if of:
                lines.append((f"{name}: {what}", colour, of))
    lines += [(p, COLOURS[0], {t: known[f"{p}, {t}"] for t in TARES if f"{p}, {t}" in known}) for p in PHYSICS]
    with look():
        canvas, panels = plt.subplots(1, 2, figsize=(8.6, 0.5 + 0.26 * len(lines)), sharey=True, sharex=True)
        for axes, worlds in zip(panels, WORLDS, strict=True):
            for place, (_, colour, of) in enumerate(lines):
                for tare, errors in of.items():
                    mean, spread = mass(errors[worlds])
                    fill = colour if tare == TARES[1] else "white"
                    axes.errorbar(mean, place, xerr=spread, fmt="o", ms=6, color=colour, mfc=fill, capsize=2)
            axes.set(xscale="log", title=TITLES[worlds], xlabel="mean error of the mass [g]")
            axes.set_xticks([20, 50, 100, 200, 500], ["20", "50", "100", "200", "500"])
            axes.minorticks_off()
        panels[0].set_yticks(range(len(lines)), [name for name, *_ in lines])
        panels[0].invert_yaxis()
        canvas.tight_layout()
        canvas.savefig(ROOT / "docs" / "pictures" / "windows.png", dpi=110)
        plt.close(canvas)


def main() -> None:
    cells = json.loads((RESULTS / "study_windows.json").read_text(encoding="utf-8"))["cells"]
    page = ROOT / "docs" / "learning.md"
    figure(cells)
    write_table(page, "learners over windows", table(cells))
    write_table(page, "learners on top of physics", gained(cells))


if __name__ == "__main__":
    main()

"""The figure and the table of docs/learning.md, from results/learning_curves.json and learning_networks.json.

python benchmarks/learning_page.py
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import RESULTS, ROOT, markdown_table, write_table

from armload.lab.report.style import COLOURS, look

AXES = {
    "payloads": lambda p, m, a: p if m == a == 1 else None,
    "motions": lambda p, m, a: m if p == 1000 and a == 1 else None,
    "arms": lambda p, m, a: a if p == 1000 and m == 1 else None,
    "motions and arms": lambda p, m, a: m if p == 1000 and m == a else None,
}
SETS = {"payload": "new payloads", "motion": "and new motions", "arm": "and new arms"}
PHYSICS = ("training mean", "map-gp", "same-prior", "same-prior, with tare", "hybrid, with tare")
GROUPS = (slice(0, 1), slice(1, 4), slice(4, 10))  # mass, first moments, inertia


def pooled(cells: list[dict[str, Any]], name: str) -> NDArray[np.float64]:
    """|error| (runs, 10) in g, g·m and g·m², of all seeds."""
    return 1e3 * np.abs(np.concatenate([np.array(cell["errors"][name], dtype=float) for cell in cells]))


def mass(errors: NDArray[np.float64]) -> tuple[float, float]:
    """Mean error of the mass and its standard error over runs [g]."""
    return float(errors[:, 0].mean()), float(errors[:, 0].std(ddof=1) / np.sqrt(len(errors)))


def shown(errors: NDArray[np.float64]) -> str:
    """Mass ± standard error · first moments · inertia."""
    moment, inertia = (errors[:, part].mean() for part in GROUPS[1:])
    return f"{mass(errors)[0]:.0f} ± {mass(errors)[1]:.0f} · {moment:.1f} · {inertia:.1f}"


def trainings(cells: list[dict[str, Any]], learner: str = "trees") -> dict[tuple[int, ...], list[dict[str, Any]]]:
    """Cells of a learner by (payloads, motions, arms), all seeds."""
    found: dict[tuple[int, ...], list[dict[str, Any]]] = {}
    for cell in cells:
        if cell["name"].startswith(learner):
            found.setdefault(tuple(cell["counts"]), []).append(cell)
    return found


def table(cells: list[dict[str, Any]]) -> str:
    """Every training and every rival: errors in each set, and the cost of a training."""
    rows = []
    for learner in ("trees", "networks"):
        for counts, same in sorted(trainings(cells, learner).items()):
            simulate, train = (np.mean([cell["cost_s"][part] for cell in same]) for part in ("simulate", "train"))
            errors = [shown(pooled(same, name)) for name in ("training's own logs", *SETS)]
            marks = [f"{same[0]['logs']} logs"] * (same[0]["logs"] != 1000) + ["one seed"] * (len(same) == 1)
            name = f"{learner}: {' · '.join(map(str, counts))}" + (f" ({', '.join(marks)})" if marks else "")
            rows.append([name, *errors, f"{simulate:.0f} + {train:.0f}"])
    judged = {s: [cell for cell in cells if cell.get("set") == s] for s in SETS}
    for method in PHYSICS:
        rows.append([method, "–", *(shown(pooled(judged[s], method)) for s in SETS), "–"])
    columns = ("payloads · motions · arms", "its own logs", *SETS.values(), "simulate + train [CPU s]")
    return markdown_table(columns, "llllll", rows)


def figure(cells: list[dict[str, Any]]) -> None:
    """Error of the mass over what was trained on, a panel for each set."""
    import matplotlib.pyplot as plt

    trained, networks = trainings(cells), trainings(cells, "networks")
    with look():
        canvas, panels = plt.subplots(1, 3, figsize=(8.6, 4.0), sharey=True)
        for axes, (name, title) in zip(panels, SETS.items(), strict=True):
            for (label, place), colour in zip(AXES.items(), COLOURS, strict=False):
                points = sorted((x, mass(pooled(c, name))) for k, c in trained.items() if (x := place(*k)) is not None)
                if len(points) < 2:  # the others are not measured yet
                    continue
                x, y, spread = ([p[0] for p in points], [p[1][0] for p in points], [p[1][1] for p in points])
                axes.errorbar(x, y, spread, marker="o", ms=4, capsize=2, color=colour, label=f"trees over {label}")
                beside = sorted(
                    (x, mass(pooled(c, name))[0]) for k, c in networks.items() if (x := place(*k)) is not None
                )
                if len(beside) > 1:
                    axes.plot(
                        *zip(*beside, strict=True),
                        "s",
                        ls=(0, (4, 2)),
                        ms=4,
                        mfc="white",
                        color=colour,
                        label=f"networks over {label}",
                    )
            rivals = [cell for cell in cells if cell.get("set") == name]
            for method, colour, style in zip(
                PHYSICS, ("#8A8A8A", *COLOURS[4:]), ("--", ":", "-.", ":", "-"), strict=True
            ):
                axes.axhline(mass(pooled(rivals, method))[0], color=colour, linestyle=style, label=method)
            axes.set(xscale="log", yscale="log", title=title, xlabel="how many were trained on")
        panels[0].set_ylabel("mean error of the mass [g]")
        ticks = (10, 20, 50, 100, 200, 500, 1000, 2000)
        panels[0].set_yticks(ticks, [str(tick) for tick in ticks])
        panels[0].minorticks_off()
        handles, labels = panels[0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="lower center", ncols=3, fontsize=8)
        canvas.tight_layout(rect=(0, 0.27, 1, 1))
        canvas.savefig(ROOT / "docs" / "pictures" / "learning.png", dpi=110)
        plt.close(canvas)


def main() -> None:
    results = [RESULTS / f"learning_{name}.json" for name in ("curves", "networks")]
    cells = [cell for file in results for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]]
    figure(cells)
    write_table(ROOT / "docs" / "learning.md", "learning curves", table(cells))


if __name__ == "__main__":
    main()

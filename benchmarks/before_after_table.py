"""What before_after.py found, as Markdown."""

from __future__ import annotations

from typing import Any

SCORES = ("mass_g", "first_moment_g_m", "inertia_g_m2", "coverage")


def table(result: dict[str, Any]) -> str:
    """Largest changes, the hybrid's errors and coverage, the time of an update."""

    def changed(change: dict[str, float]) -> str:
        return " | ".join(f"{x:.1g}" for x in change.values())

    out = ["| largest change of | logs | kg | kg·m | kg·m² |", "|---|---|---|---|---|"]
    for name, line in result["answers"]["methods"].items():
        out.append(f"| {name} | {line['logs']} | {changed(line['largest_change'])} |")
    for line in result["real_logs"]:
        (m, n), (v, w) = line["mass_kg"], line["half_width_kg"]
        log = f"{line['log']}: {m} ± {v} → {n} ± {w} kg, pauses of {line['pauses_s']} s"
        out.append(f"| {log} | 1 | {changed(line['largest_change'])} |")
    for name, line in result["online"]["streams"].items():
        events = "same events" if line["events_equal"] else "other events"
        since = "" if line["differs_from_s"] is None else f", differs from {line['differs_from_s']:g} s"
        out.append(f"| stream {name}, {events}{since} | 1 | {changed(line['largest_change'])} |")
    heads = ("t", "mass [g]", "first moments [g·m]", "inertia [g·m²]", "inside 95 %", "not worse")
    out += ["", f"| hybrid, before → after | {' | '.join(heads)} |", "|---" * 7 + "|"]
    for line in result["answers"]["hybrid"]:
        cells = []
        for score in SCORES:
            (before, after), more, se = line[score], line[f"{score}_more"], line[f"{score}_more_se"]
            cells.append(f"{before:.4g} → {after:.4g} ({more:+.1g} ± {se:.1g})")
        out.append(f"| {line['what']} | {line['t']:g} s | {' | '.join(cells)} | {line['not_worse']} |")
    out += ["", "| update, before → after [µs] | p50 | p99 | p99.9 | mean |", "|---|---|---|---|---|"]
    online = result["online"]
    lines = {"all": online["thread"]} | {name: line["thread"] for name, line in online["streams"].items()}
    for name, line in lines.items():
        costs = (line[score] for score in ("p50", "p99", "p99.9", "mean"))
        cells = (f"{cost['us'][0]} → {cost['us'][1]}: {cost['ratio']}" for cost in costs)
        out.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(out)

"""The page of a survey: what was held, when and by which arm, how each arm drifts, what to look at and to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armload.lab.report import Section, write_report
from armload.lab.report.shown import Table
from armload.lab.report.style import COLOURS, look, new_figure, whole
from armload.survey.findings import LAST, SHARE_CHANGED, SHARE_MOVES, ArmFinding, arm_findings, by_log, doubtful
from armload.survey.looseness import LOOSE
from armload.survey.rows import ANSWERED, SEPARATOR, UNUSABLE, original_of, shows_the_arm
from armload.survey.shift import SHIFTED
from armload.survey.table_file import read_rows
from armload.survey.time_axis import are_dated, mark, time_label, times_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_ROWS = 60  # of the table of doubtful logs: the survey itself has them all
_MOST_ARMS = 24  # that are drawn each in a panel, those with something to do first
_MOST_DRAWN = 500  # points that are drawn as lines, each: a page of thousands would be slow
_LONGEST = 220  # characters of a reason in a table
_TAIL = 0.01  # share of the dots on either side that may lie beyond a panel: one odd log must not flatten all others


def write_survey_report(table: str | Path, out: str | Path) -> list[str]:
    """Write one HTML file of a survey, and return what to do, a sentence for each arm that asks for it.

    Args:
        table: what `survey` wrote. out: the page.

    Raises:
        UsageError: the table cannot be read. ReportError: the page cannot be written.
    """
    rows, n = read_rows(table)
    findings = arm_findings(rows)
    write_report(out, survey_sections(rows, findings, n), f"Survey of {_counted(len(findings), 'arm')}")
    return [finding.advice for finding in findings if finding.advice]


def survey_sections(rows: Sequence[dict[str, Any]], findings: Sequence[ArmFinding], n: int) -> list[Section]:
    """The page's sections, for `write_report`. rows: of arms with n joints. findings: what they say of each arm."""
    copies = {(row["log"], row["episode"]): of for row in rows if (of := original_of(row)) is not None}
    sections = [
        _what_to_do(rows, findings, len(copies)),
        _payloads(rows, findings),
        _arms(rows, findings, n),
        _doubts(rows, findings),
    ]
    return [*sections, _copies(copies)] if copies else sections


def _what_to_do(rows: Sequence[dict[str, Any]], findings: Sequence[ArmFinding], copies: int) -> Section:
    logs = {(row["log"], row["episode"]) for row in rows}
    held = [row for row in rows if row["status"] == ANSWERED and row["held"]]
    lost = sum(row["status"] == UNUSABLE for row in rows)
    advice = [f"**Since {_since(f)}:** {f.advice}." for f in findings if f.advice] or ["No arm asks for anything."]
    asked = any(f.changed is not None for f in findings)
    text = [
        f"{_counted(len(logs), 'log')} of {_counted(len(findings), 'arm')}: {_counted(len(held), 'payload')} carried, "
        f"{_counted(lost, 'log')} not answered." + (f" Copies of others among them: {copies}." if copies else ""),
        *advice,
        ""
        if asked
        else "Without a tare or a profile nobody can say whether an arm is as it was: see `--tare` and `--profile`.",
    ]
    columns = (
        "arm",
        "logs",
        "not answered",
        "payloads",
        "median mass [kg]",
        "changed",
        "shift",
        "payload moves",
        "slides",
        "since",
    )
    cells = tuple(
        (
            f.arm,
            str(f.logs),
            str(f.unusable),
            str(f.payloads),
            "" if f.mass is None else f"{f.mass:.3f}",
            _share(f.changed, f.retare and (f.changed or 0.0) >= SHARE_CHANGED),
            "" if f.shift is None else f"{f.shift.z:.1f}{' !' if f.shift.found else ''}",
            _share(f.moves, f.loose and (f.moves or 0.0) >= SHARE_MOVES),
            "" if f.slide is None else f"{f.slide.z:.1f}{' !' * f.slide.found}",
            _since(f),
        )
        for f in findings
    )
    note = (
        f"changed and payload moves: share of an arm's last {LAST} logs that say so; shift: z of its offsets and "
        f"friction over the days, beyond {SHIFTED:g} it is another arm; slides: z of what is held sliding in the "
        f"gripper, by the last logs together, beyond {LOOSE:g} it does. ! asks for something to be done."
    )
    return Section("What to do", "\n\n".join(x for x in text if x), (Table("Arms", columns, cells, note),))


def _payloads(rows: Sequence[dict[str, Any]], findings: Sequence[ArmFinding]) -> Section:
    held = [row for row in rows if row["status"] == ANSWERED and row["held"]]
    if not held:
        return Section("Payloads", "Nothing was held in any log.")
    dated = are_dated(held)
    with look():
        over_time = new_figure(4.2)
        ax, drawn = over_time.subplots(), []
        for k, finding in enumerate(findings):
            of = [row for row in held if row["arm"] == finding.arm]
            x, mass = times_of(of, dated), np.array([row["mass"] for row in of])
            half = np.abs(np.array([[row["mass_low"], row["mass_high"]] for row in of]).reshape(-1, 2).T - mass)
            style: dict[str, Any] = {
                "rasterized": len(held) > _MOST_DRAWN,
                "color": COLOURS[k % len(COLOURS)],
                "markersize": 3.5,
                "elinewidth": 0.7,
            }
            drawn.append(ax.errorbar(x, mass, half, fmt="osD^v"[k // len(COLOURS) % 5], alpha=0.75, **style))
            mark(ax, x, 9)
        ax.set_xlabel(time_label(held, dated, "payloads of an arm"))
        ax.set_ylabel("mass [kg]")
        if len(findings) <= 30:
            # matplotlib leaves out what has a label that begins with an underscore, as an arm's name may
            unnamed = over_time.legend(drawn, ["arm"] * len(drawn), loc="outside right upper", fontsize=8)
            for label, finding in zip(unnamed.get_texts(), findings, strict=True):
                label.set_text(finding.arm)
        histogram = new_figure(2.6)
        ax = histogram.subplots()
        ax.hist([row["mass"] for row in held], bins="auto", color=COLOURS[0], edgecolor="white")
        ax.set_xlabel("mass [kg]")
        ax.set_ylabel("payloads")
        whole(ax.yaxis)
    return Section(
        "Payloads",
        "",
        figures=(
            (over_time, "What each arm held; bars are 95 % intervals."),
            (histogram, "How heavy it was."),
        ),
    )


def _arms(rows: Sequence[dict[str, Any]], findings: Sequence[ArmFinding], n: int) -> Section:
    """Offsets and friction, a panel for each arm, over time."""
    if not any(row["status"] == ANSWERED for row in rows):
        return Section("Drift of the arms", "No log was answered.")
    shown = sorted(findings, key=lambda f: not f.advice)[:_MOST_ARMS]
    figures = []
    for name, what in (("offset", "Torque offset"), ("coulomb", "Coulomb friction")):
        beyond = "beyond that of its tare or profile, or of its model where there is none"
        figures.append((_drift(rows, shown, n, name), f"{what} of each joint, {beyond}."))
    more = len(findings) > _MOST_ARMS
    left = f" The first {_MOST_ARMS} of {len(findings)} arms, those that ask for something first." if more else ""
    scale = (
        "Arms that ask to be tared anew have a scale of their own, the others share one; a log far off may lie beyond."
    )
    return Section("Drift of the arms", f"A dot is a log in which the arm moved. {scale}{left}", figures=tuple(figures))


def _drift(rows: Sequence[dict[str, Any]], shown: Sequence[ArmFinding], n: int, name: str) -> Figure:
    across, dated = min(4, len(shown)), are_dated(rows)
    down = -(-len(shown) // across)
    with look():
        figure = new_figure(0.7 + 1.5 * down)
        panels = figure.subplots(down, across, sharex=True, squeeze=False).ravel()
        alike: list[tuple[Any, list[float]]] = []
        for ax, finding in zip(panels, shown, strict=False):
            logs = [
                of
                for of in by_log([row for row in rows if row["arm"] == finding.arm and shows_the_arm(row)])
                if of[0][f"{name}_1"] is not None
            ]
            x, drawn = times_of([of[0] for of in logs], dated), []
            for j in range(n):
                y = [float(np.mean([row[f"{name}_{j + 1}"] for row in of])) for of in logs]
                ax.plot(x, y, ".", markersize=3, color=COLOURS[j % len(COLOURS)], label=f"joint {j + 1}")
                drawn += y
            if finding.retare:  # it has a scale of its own, or the others were flat lines
                _limit([(ax, drawn)])
            else:
                alike.append((ax, drawn))
            mark(ax, x, 6)
            ax.tick_params(labelsize=7)
            ax.set_title(finding.arm + (" !" if finding.advice else ""), loc="left", fontsize=8.5)
        _limit(alike)
        for ax in panels[len(shown) :]:
            ax.set_visible(False)
        figure.supxlabel(time_label(rows, dated), fontsize=9)
        figure.supylabel("torque [N·m]", fontsize=9)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=n, markerscale=2)
    return figure


def _limit(panels: Sequence[tuple[Any, list[float]]]) -> None:
    """One scale for some panels, by nearly all of their dots."""
    values = np.concatenate([drawn for _, drawn in panels]) if panels else np.array([])
    if not len(values):
        return
    low, high = np.quantile(values, [_TAIL, 1.0 - _TAIL])
    aside = 0.3 * max(high - low, 1e-3)
    for ax, _ in panels:
        ax.set_ylim(low - aside, high + aside)


def _doubts(rows: Sequence[dict[str, Any]], findings: Sequence[ArmFinding]) -> Section:
    """A line for each log, of its first row that is doubted; what is said of its arm already comes last."""
    known = {f.arm for f in findings if f.retare}
    of_logs: dict[tuple[str, int | None], dict[str, Any]] = {}
    for row in sorted(doubtful(rows), key=lambda row: _urgency(row, known)):
        of_logs.setdefault((row["log"], row["episode"]), row)
    found = list(of_logs.values())
    if not found:
        return Section("Logs in doubt", "None.")
    folder = _folder([row["log"] for row in found])
    cells = tuple(
        (
            _named(row["log"], row["episode"], folder),
            row["arm"],
            "" if row["t0"] is None else f"{row['t0']:.1f}–{row['t1']:.1f}",
            "" if row["status"] == UNUSABLE else f"{row['mass']:.3f}",
            _cut(row["reason"].removeprefix(f"{row['log']}").lstrip(" :,") or _first_doubt(row)),
        )
        for row in found[:_MOST_ROWS]
    )
    more = f" The first {_MOST_ROWS} of {len(found)}." if len(found) > _MOST_ROWS else ""
    where = f" Logs are in {folder}." if folder else ""
    table = Table(
        "Logs that cannot be answered, and answers that are doubted",
        ("log", "arm", "time [s]", "mass [kg]", "why"),
        cells,
        f"The first doubt of each log; the table of the survey has the whole text.{where}",
        prose=(4,),
    )
    return Section("Logs in doubt", f"Look at these before anything is concluded from them.{more}", (table,))


def _copies(copies: Mapping[tuple[str, int | None], str]) -> Section:
    """Which logs are copies, and of which; each counts as a log of its own."""
    folder = _folder([*(log for log, _ in copies), *copies.values()])
    cells = tuple(
        (_named(log, episode, folder), original.removeprefix(folder)) for (log, episode), original in copies.items()
    )
    more = f" The first {_MOST_ROWS} of {len(cells)}." if len(cells) > _MOST_ROWS else ""
    where = f"Logs are in {folder}." if folder else ""
    table = Table("Logs that are copies of others", ("log", "copy of"), cells[:_MOST_ROWS], where)
    return Section("Copies", f"Each counts as a log of its own, here and in every figure.{more}", (table,))


def _named(log: str, episode: int | None, folder: str) -> str:
    return log.removeprefix(folder) + ("" if episode is None else f", episode {episode}")


def _urgency(row: dict[str, Any], known: set[str]) -> int:
    """What could not be answered first; last what is only of an arm that is not as it was."""
    if row["status"] == UNUSABLE:
        return 0
    return 2 if row["arm"] in known and row["changed"] and row["consistent"] and not row["moves"] else 1


def _first_doubt(row: dict[str, Any]) -> str:
    return row["notes"].split(SEPARATOR)[0] or ("no body has these parameters" if not row["consistent"] else "")


def _folder(logs: Sequence[str]) -> str:
    """What all names begin with, up to a slash."""
    common = logs[0]
    while not all(log.startswith(common) for log in logs):
        common = common[:-1]
    return common[: common.rfind("/") + 1]


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _since(finding: ArmFinding) -> str:
    if finding.since is None:
        return ""
    if isinstance(finding.since, str):
        return finding.since
    return datetime.fromtimestamp(finding.since, UTC).strftime("%Y-%m-%d %H:%M UTC")


def _share(value: float | None, act: bool) -> str:
    return "" if value is None else f"{100 * value:.0f} %{' !' if act else ''}"


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"

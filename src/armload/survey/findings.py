"""What the rows of a survey say of each arm: whether it is still as at its tare, and whether it holds things firmly.

Both questions are asked of an arm's last `LAST` logs, so that one log in doubt is no alarm, and an arm that was put
right is sound again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armload.survey.looseness import Looseness, looseness
from armload.survey.rows import ANSWERED, UNUSABLE
from armload.survey.shift import Shift, shifts

# [logs] that decide about an arm as it is now: some hours of a cell that works. A stated choice
LAST = 10
# of them, at least so many must ask the question: fewer say nothing
FEWEST = 3
# share of them of which the arm is not as it was: a changed arm shows it in nearly all of its logs, a sound one in
# hardly any, so that any share between would do (`benchmarks/fleet.py`)
SHARE_CHANGED = 0.5
# share of those with something held of which no rigid body explains the torques: half of loose ones do
# (`benchmarks/wrong_logs.py`), of sound ones hardly any
SHARE_MOVES = 0.25


@dataclass(frozen=True)
class ArmFinding:
    """An arm, as its rows show it.

    logs, unusable: how many, and how many of them cannot be answered. payloads: rows with something held.
    mass: their median [kg], None where there are none.
    changed, moves: share of the last logs that say so; None: too few could tell.
    retare, loose: whether that is enough to act. since: date of the first log of the run that led to it [s since 1970],
        or the log's name where logs have no date; of a sound arm None.
    joint: that tells most of the change, from 1; 0: none does.
    shift: the most likely day since when the arm is another one, and how likely; None: it was seen on too few days.
    slide: how far what it holds slides in the gripper, and how surely; None: too few logs tell.
    """

    arm: str
    logs: int
    unusable: int
    payloads: int
    mass: float | None
    changed: float | None
    moves: float | None
    retare: bool
    loose: bool
    since: float | str | None = None
    joint: int = 0
    shift: Shift | None = None
    slide: Looseness | None = None

    @property
    def advice(self) -> str:
        """What to do about the arm; "" where nothing is."""
        advice = []
        if self.retare:
            if self.shift is not None and self.shift.found and (self.changed or 0.0) < SHARE_CHANGED:
                shifted = f"which shifted by {self.shift.size:+.2g} N·m"
                how = f", by the {self.shift.what} of joint {self.joint} most, {shifted}"
            else:
                how = f" at its tare or in its profile, at joint {self.joint} most"
            advice.append(
                f"is not as it was{how}: record it empty, and tare it or learn its profile anew; if it was exchanged, "
                "learn the new one from its own logs alone"
            )
        if self.loose:
            far = f" by {1e3 * self.slide.gap:.0f} mm either way" if self.slide is not None and self.slide.found else ""
            advice.append(f"holds things that seem to {'slide' if far else 'move'}{far}: look at its gripper")
        return f"{self.arm} {', and '.join(advice)}" if advice else ""


def arm_findings(rows: Sequence[dict[str, Any]]) -> list[ArmFinding]:
    """What the rows say of each arm, by name."""
    n = max((sum(name.startswith("offset_") for name in row) for row in rows), default=0)
    shifted = shifts([row for row in rows if row["status"] == ANSWERED], n)
    arms = sorted({row["arm"] for row in rows})
    return [_of_arm(arm, [row for row in rows if row["arm"] == arm], shifted.get(arm)) for arm in arms]


def doubtful(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows to look at: logs that cannot be answered, and answers of which something is said to be wrong."""
    return [row for row in rows if row["status"] == UNUSABLE or row["moves"] or row["changed"] or not row["consistent"]]


def by_log(rows: Sequence[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """The answered rows, log by log, the oldest first; logs without a date by name."""
    logs: dict[tuple[str, int | None], list[dict[str, Any]]] = {}
    for row in rows:
        if row["status"] == ANSWERED:
            logs.setdefault((row["log"], row["episode"]), []).append(row)
    return sorted(logs.values(), key=lambda of: (of[0]["date"] is None, of[0]["date"] or 0.0, of[0]["log"]))


def _of_arm(arm: str, rows: Sequence[dict[str, Any]], shift: Shift | None) -> ArmFinding:
    logs = by_log(rows)
    asked = [of for of in logs if any(row["misfit"] is not None for row in of)]
    holding = [of for of in logs if any(row["held"] for row in of)]
    changed, since = _lately([any(row["changed"] for row in of) for of in asked], asked, SHARE_CHANGED)
    moves, first = _lately([any(row["moves"] for row in of if row["held"]) for of in holding], holding, SHARE_MOVES)
    slide = looseness(logs)
    if first is None and slide is not None and slide.found:
        first = slide.since
    retare, loose = since is not None, first is not None
    joints = [row["misfit_joint"] for of in asked[-LAST:] for row in of if row["changed"]]
    joint = int(np.bincount(joints).argmax()) if retare and joints else 0
    if shift is not None and shift.found:
        if not retare:
            joint = shift.joint
        retare, since = True, min(since, shift.since) if isinstance(since, float) else shift.since
    masses = [row["mass"] for row in rows if row["status"] == ANSWERED and row["held"]]
    return ArmFinding(
        arm,
        len({(row["log"], row["episode"]) for row in rows}),
        sum(row["status"] == UNUSABLE for row in rows),
        len(masses),
        float(np.median(masses)) if masses else None,
        changed,
        moves,
        retare,
        loose,
        since if retare else first,
        joint,
        shift,
        slide,
    )


def _lately(
    flags: Sequence[bool], logs: Sequence[list[dict[str, Any]]], share: float
) -> tuple[float | None, float | str | None]:
    """Share of the last logs that say so, and since when, if that is enough to act; None where too few were asked."""
    if len(flags) < FEWEST:
        return None, None
    last = float(np.mean(flags[-LAST:]))
    if last < share or sum(flags[-LAST:]) < 2:
        return last, None
    # the change that parts the logs best in two: the likelihood of a constant rate before and one after it
    from_here = max(range(len(flags)), key=lambda k: _log_likelihood(flags[:k]) + _log_likelihood(flags[k:]))
    row = logs[from_here][0]
    return last, row["log"] if row["date"] is None else row["date"]


def _log_likelihood(flags: Sequence[bool]) -> float:
    hits, count = sum(flags), len(flags)
    return sum(x * np.log(x / count) for x in (hits, count - hits) if x)

"""What was true at the moments of a stream whose probabilities are looked at: `reliability_of`.

p_held      something is held.
p_change    the payload is not the one that the run at work began with, or is being handed over (docs/online.md).
p_contact   somebody pushes, but for the first and last fifth of a push, which are hardly felt.

Which run is at work follows from what the stream says, as in `armload.online.runs`. A new `since` is an event, and so
is the beginning of a settling: the last event goes on, or is corrected. While it settles, the run before it is at work.
Then a new run begins, with what is held at that moment; or the run before goes on, as it was no change (`AS_BEFORE`). A
run that begins may yet give way to the one before the last (`TAKEN_UP`), which holds what that began with. What was
taken up again, and recognised, is no change, and neither is the same payload in a run of its own; a run that begins
amid a hand-over holds something else than what is held at the hand-over's end.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from event_scenes import Stream
from numpy.typing import NDArray

BINS = np.array([0.0, 0.02, 0.1, 0.3, 0.7, 0.9, 0.98, 1.0])
FELT = np.array([0.02, *(3 * [0.002])])  # [kg], [kg·m] what is as large is another payload
LEAST = 0.01  # [kg] less is nothing
AS_BEFORE, TAKEN_UP = 1, 2  # what a "return" is: the run before the event goes on, that before the last is taken up
T, SETTLING, RETURN, HELD, CHANGE, CONTACT, SINCE, IS_HELD = 0, 5, 6, 7, 8, 9, 10, 11  # columns of what a stream said


def began_with(said: NDArray, held: NDArray) -> NDArray[np.float64]:
    """What the run at work began with (N, 10), of what a stream said (N, 12) and what was held (N, 10) then."""
    out, noticed = np.empty_like(held), False  # whether an event is settling
    earlier, previous, current = None, None, held[0]
    for k, now in enumerate(said):
        before = said[max(k - 1, 0)]
        noticed = noticed or now[SINCE] != before[SINCE] or now[SETTLING] > before[SETTLING]
        if noticed and now[SETTLING] == 0.0:
            noticed = False
            if now[RETURN] != AS_BEFORE:
                earlier, previous, current = previous, current, held[k]
        if now[RETURN] == TAKEN_UP and before[RETURN] != TAKEN_UP:
            assert earlier is not None, "a run is taken up that there was not"
            earlier, current = None, earlier
        out[k] = current
    return out


def reliability_of(stream: Stream, said: NDArray, held: NDArray, every: NDArray) -> dict[str, Any]:
    """Of the moments `every` of a stream: how often its probabilities were right.

    Args:
        said: (N, 12) what the stream said, columns as above. held: (N, 10) what was held then. every: their numbers.
    """
    t = said[:, T]
    changed = (np.abs(held - began_with(said, held))[:, :4] > FELT).any(axis=1)
    for change in stream.changes:
        changed |= (t >= change.start) & (t <= change.start + change.seconds)
    pushed, edge = np.zeros(len(t), dtype=bool), np.zeros(len(t), dtype=bool)
    for push in stream.pushes:
        rise = 0.2 * (push.end - push.start)
        pushed |= (t > push.start) & (t < push.end)
        edge |= (np.abs(t - push.start) < rise) | (np.abs(t - push.end) < rise + 0.2)
    out = {
        "p_change": counted(said[every, CHANGE], changed[every]),
        "p_contact": counted(said[every, CONTACT][~edge[every]], pushed[every][~edge[every]]),
    }
    if stream.base is not None:
        out["p_held"] = counted(said[every, HELD], held[every, 0] + stream.base > LEAST)
    return out


def counted(p: NDArray, true: NDArray) -> list[tuple[int, float, int]]:
    """Of each bin of probabilities: how many moments, their sum, and how often it was so."""
    which = np.clip(np.searchsorted(BINS, p, side="right") - 1, 0, len(BINS) - 2)
    return [(int((x := which == k).sum()), float(p[x].sum()), int(true[x].sum())) for k in range(len(BINS) - 1)]


def turns_of_held(turns: int, said: NDArray, true: NDArray, every: NDArray) -> dict[str, int]:
    """How often `held` turned, and should have; in how many of the moments `every` it was wrong.

    Args:
        turns: how often it turned. said, true: (N,) what it was, and should have been. every: their numbers.
    """
    should = int(true[0]) + int(np.count_nonzero(true[1:] != true[:-1]))
    return {"turned": turns, "should": should, "wrong": int((said != true)[every].sum()), "moments": len(every)}

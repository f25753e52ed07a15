"""Why the service does not know what an arm holds: a typed reason, and a sentence."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from armload.online import OnlineEstimate

SILENT = 0.5  # [s] without a sample: five times the longest gap within which samples belong together (`recording.GAP`)
CONFIRMED = 1.0  # [s] of samples after an interruption, before the answer of before it is given again


class Unknown(StrEnum):
    """The reasons, the first that holds is told."""

    STARTING = "starting"  # the arm's process is not there yet, or gave no answer yet and no connection has failed
    COMPILING = "compiling"  # functions are compiled, which is done once for each machine
    SOURCE_LOST = "source lost"  # not connected: no robot, a killed reader, a stall of 3 s
    SOURCE_ENDED = "source ended"  # a log came to its end
    SILENT = "silent"  # connected, and no sample for half a second
    BEHIND = "behind"  # samples come, and are more than half a second old when they are answered
    UNUSABLE = "samples unusable"  # the identifier leaves them out
    IMPLAUSIBLE = "samples implausible"  # they cannot come from this arm
    UNCONFIRMED = "unconfirmed"  # interrupted, and no second of samples has told since that it is as it was
    CHANGING = "changing"  # the payload is being handed over, or has just been
    CONTACT = "contact"  # something else touches the arm
    UNDETERMINED = "undetermined"  # what came so far does not determine the mass


class Why(NamedTuple):
    """A reason, and what to say."""

    reason: Unknown
    text: str


class Link(NamedTuple):
    """What is known of a connection: its state as in `Reconnecting`, why it was lost, times [s, monotonic]."""

    state: str
    why: str | None
    connections: int
    resumed: float | None
    heard: float | None


def why_unknown(
    estimate: OnlineEstimate | None,
    link: Link,
    now: float,
    trouble: str | None = None,
    doubt: str | None = None,
    compiling: str | None = None,
) -> Why | None:
    """The first reason that holds; None: the answer can be used.

    Args:
        estimate: the newest, its age and lag as of `now`. now: [s, monotonic].
        trouble: what keeps samples from being used. doubt: why they cannot come from this arm.
        compiling: why samples wait for functions that are compiled (`CatchingUp`); None: they do not.
    """
    if link.state == "lost":
        return Why(Unknown.SOURCE_LOST, link.why or "the source was lost")
    if link.state == "ended":
        return Why(Unknown.SOURCE_ENDED, "the source has ended")
    if compiling is not None and link.state == "streaming" and (estimate is None or estimate.lag > SILENT):
        return Why(Unknown.COMPILING, compiling)
    if estimate is None or link.heard is None:
        return Why(Unknown.STARTING, "no sample has come yet")
    if link.state == "connecting":
        return Why(Unknown.SOURCE_LOST, link.why or "the source is being opened")
    if now - link.heard > SILENT:
        return Why(Unknown.SILENT, f"no sample for {now - link.heard:.1f} s")
    if estimate.lag > SILENT:
        return Why(Unknown.BEHIND, f"the samples are {estimate.lag:.1f} s old when they are answered")
    if trouble is not None:
        return Why(Unknown.UNUSABLE, trouble)
    if doubt is not None:
        return Why(Unknown.IMPLAUSIBLE, doubt)
    if link.connections > 1 and link.resumed is not None:
        since = now - link.resumed
        if since < CONFIRMED or estimate.age > since:
            return Why(
                Unknown.UNCONFIRMED, "since the interruption too little has been seen to tell whether it holds the same"
            )
    if (passing := passing_by(estimate)) is not None:
        return passing
    if not estimate.determined[0]:
        return Why(Unknown.UNDETERMINED, "the samples do not determine the mass yet")
    return None


def passing_by(estimate: OnlineEstimate) -> Why | None:
    """What goes on at present, so that the newest samples are not of one payload alone; None: nothing does."""
    if estimate.changing:
        return Why(Unknown.CHANGING, "the payload is changing")
    if estimate.touched:
        return Why(Unknown.CONTACT, "something touches the arm")
    return None

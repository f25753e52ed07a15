"""Estimates as lines of JSON, for a pipe."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from typing import Any

from armload.inertia import InertialParameters
from armload.online import OnlineEstimate
from armload.runtime.finite import finite
from armload.service.session import Session


def lines(session: Session, every: float = 0.1, duration: float | None = None) -> Iterator[str]:
    """One JSON object per `every` seconds of the stream's clock, one at each change, and one for the last sample.

    The fields are those of `OnlineEstimate.to_dict`, and `robot`; `lost`, how many samples the source had to drop so
    far; and `truth`, phi as it really is, where the source knows. What is not determined yet says so in the line. While
    samples have no times that rise, a line comes every `every` seconds of this machine's clock.

    Args:
        session: runs here, in this thread. every: 0: one line per sample. duration: end after so long [s].

    Raises:
        SourceError: the connection was lost.
    """
    printed, changed, last, clock, since = -math.inf, None, None, None, time.monotonic()
    for estimate in session.estimates(duration):
        last, now = estimate, time.monotonic()
        if estimate.t != clock:
            clock, since = estimate.t, now
        event = estimate.event and (estimate.event.t, estimate.event.kind)
        # a clock that was set back counts as later; a thousandth less, or rounding would double the distance
        if abs(estimate.t - printed) >= 0.999 * every or event != changed or now - since >= every:
            printed, changed, last, since = estimate.t, event, None, now
            yield _json(estimate, session)
    if last is not None:
        yield _json(session.estimate or last, session)


def line_of(estimate: OnlineEstimate, robot: str, truth: InertialParameters | None = None) -> dict[str, Any]:
    """The estimate as one JSON object; what is not a finite number is null."""
    fields = {"robot": robot, **estimate.to_dict()}
    return finite(fields if truth is None else {**fields, "truth": truth.phi.tolist()})


def _json(estimate: OnlineEstimate, session: Session) -> str:
    fields = line_of(estimate, session.arm.name, session.truth(estimate.t))
    return json.dumps({**fields, "lost": session.lost}, allow_nan=False)

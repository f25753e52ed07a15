"""What an identifier said of a stream, and which of its events belong to which change, for `sensitivity.py`."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload import Recording
from armload.inertia import Z95
from armload.online import OnlineIdentifier

LOOKED = (0.5, 1.0, 2.0)  # [s] after a change
LATE = 3.0  # [s]


@dataclass(frozen=True)
class Watched:
    """What the identifier said: events when noticed, and over time (T, 4): t, mass, half-width, whether settling."""

    events: list[dict[str, Any]]
    said: NDArray[np.float64]
    cpu: float

    def at(self, t: float) -> NDArray[np.float64]:
        """The last thing said by t."""
        return self.said[np.searchsorted(self.said[:, 0], t, side="right") - 1]


def watched(identifier: OnlineIdentifier, log: Recording) -> Watched:
    """Feed it a stream."""
    events: dict[float, dict[str, Any]] = {}
    said, last, looked, start = [], None, -np.inf, time.process_time()
    for sample in log:
        estimate = identifier.update(*sample)
        if estimate.event is not last:
            last = estimate.event
            if last is not None:
                events[last.t] = {"t": round(last.t, 4), "kind": last.kind}
        if sample.t - looked >= 0.0095:
            looked = sample.t
            said.append((sample.t, estimate.phi[0], Z95 * estimate.std[0], estimate.settling))
    identifier.close()
    return Watched(list(events.values()), np.array(said, dtype=float), time.process_time() - start)


def step(k: int, held: list[tuple[float, Any]], found: Watched) -> dict[str, Any]:
    """A change: what it was, and what was said at times after it."""
    t, now = held[k]
    before = held[k - 1][1]
    back = k > 1 and held[k - 2][1] is now
    at = np.array([found.at(t + after) for after in LOOKED])
    return {
        "t": t,
        "by": round(_mass(now) - _mass(before), 4),
        "kind": "grasp" if before is None else "release" if now is None else "swap",
        "back": back,
        "mass": round(_mass(now), 5),
        "error": (at[:, 1] - _mass(now)).round(5).tolist(),
        "half_width": at[:, 2].round(5).tolist(),
        "settling": at[:, 3].astype(bool).tolist(),
    }


def _mass(payload: Any) -> float:
    return 0.0 if payload is None else payload.parameters.mass


def matched(steps: list[dict], events: list[dict]) -> tuple[list[dict], list[dict]]:
    """Give each change its event (`delay`, `said`; late ones too), and return the changes and all other events."""
    rest = []
    for k, step in enumerate(steps):
        until = steps[k + 1]["t"] if k + 1 < len(steps) else np.inf
        own = [e for e in events if step["t"] <= e["t"] < until]
        step["delay"] = step["said"] = None
        if own and own[0]["t"] - step["t"] <= LATE:
            step["delay"], step["said"] = round(own[0]["t"] - step["t"], 4), own[0]["kind"]
            own = own[1:]
        rest += [e | {"after": round(e["t"] - step["t"], 3)} for e in own]
    first = steps[0]["t"] if steps else np.inf
    return steps, rest + [e | {"after": None} for e in events if e["t"] < first]

"""What a stream's answers are relative to: an earlier log, how old it is by now, and what was held then."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from armload.errors import IdentificationError
from armload.inertia import InertialParameters
from armload.online import OnlineEstimate
from armload.recording import Recording
from armload.service.recent import Recent
from armload.service.unknown import passing_by

_LONGEST, _SHORTEST = 30.0, 3.0  # [s] of what was just seen that a tare is made of


@dataclass(frozen=True, eq=False)
class Tare:
    """The tare of a stream.

    recording: the log itself. age: how old it was when it was given [s], as far as that is known; 0: of the stream's
        own session.
    held: what was, while it was recorded; None: not known.
    taken: whether it was taken on the stream itself. given: when it was [s, monotonic].
    """

    recording: Recording
    age: float = 0.0
    held: InertialParameters | None = None
    taken: bool = False
    given: float = field(default_factory=time.monotonic)

    @property
    def age_now(self) -> float:
        """How old it is by now [s], as far as `age` is known; in whole minutes since then, so that replays agree."""
        return self.age + 60.0 * ((time.monotonic() - self.given) // 60.0)


def tare_log(recent: Recent, estimate: OnlineEstimate | None) -> Recording:
    """The last half minute of a stream as a tare, given what it says now.

    Raises:
        IdentificationError: the payload is changing, something touches the arm, or too little was seen.
    """
    why = None if estimate is None else passing_by(estimate)
    if why is not None:
        raise IdentificationError(f"{why.text}, and a tare is of what stays as it is; wait and try again")
    log = recent.recording(_LONGEST)
    seen = 0.0 if log is None else log.duration
    if log is None or seen < _SHORTEST:
        raise IdentificationError(
            f"{seen:.1f} s were seen since the payload changed: a tare needs at least {_SHORTEST:.0f} s of motion; "
            "wait and try again"
        )
    return log

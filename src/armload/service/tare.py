"""What a stream's answers are relative to: an earlier log, how old it is by now, and what was held then."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from armload.inertia import InertialParameters
from armload.recording import Recording


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

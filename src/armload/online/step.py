"""By how much the mass has changed: a first guess, then the difference between the runs before and after."""

from __future__ import annotations

import numpy as np

from armload.estimators import Identifier
from armload.online.event import Event
from armload.online.thresholds import STEP_STD
from armload.posterior import PosteriorLeastSquares


class MassStep:
    """Follows one change of payload from its first guess until its kind is known.

    Args:
        spread: standard deviation of a payload's mass, before anything is known of it [kg].
    """

    def __init__(self, spread: float) -> None:
        self._spread = spread
        self.reset()

    def reset(self) -> None:
        """Forget the change."""
        self._before: PosteriorLeastSquares | None = None  # the run that ended, until the kind is known
        self._told = 0.0

    def of(self, event: Event, ended: Identifier | None, run: PosteriorLeastSquares) -> float:
        """Change of mass [kg] of an event as it comes; `ended`: the run that answered last, `run`: the one at work."""
        if event.kind == "change":
            self._before = ended if isinstance(ended, PosteriorLeastSquares) else None
            self._told = event.mass
            return event.mass
        better = self._between(run)
        if better is not None:
            self._told = better
        if better is not None or event.kind == "return":
            self._before = None
        return self._told

    def _between(self, run: PosteriorLeastSquares) -> float | None:
        """From the run that ended to another, if both are known well and relative to the same."""
        before = self._before
        if before is None:
            return None
        now, then = run.last, before.last
        if float(np.hypot(now.std[0], then.std[0])) > STEP_STD * self._spread:
            return None
        if run.reference is before:
            return float(now.phi[0])
        if before.reference is run:
            return -float(then.phi[0])
        return float(now.phi[0] - then.phi[0]) if run.reference is before.reference else None

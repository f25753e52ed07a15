"""The runs of a stream: one for each payload, the last two kept, in case what they held is held again."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armload.estimators import Estimate
from armload.online.thresholds import SAME_RUN, STEP_STD, TARE_FROM
from armload.posterior import PosteriorLeastSquares
from armload.regression import payload_prior_std

Gaussian = tuple[NDArray[np.float64], NDArray[np.float64]]


class Runs:
    """The runs of a stream.

    Attributes:
        unit: standard deviation of a payload's mass beforehand [kg]. current: the run at work. previous: the one before
            it. earlier: the one before that, which may come back.
    """

    def __init__(self, first: PosteriorLeastSquares) -> None:
        self._first = self.current = first
        self.unit = float(payload_prior_std(first.arm)[0])
        self.previous: PosteriorLeastSquares | None = None
        self.earlier: PosteriorLeastSquares | None = None

    def __iter__(self) -> Iterator[PosteriorLeastSquares]:
        """All runs that are kept, each once."""
        kept = (self._first, self.current, self.previous, self.earlier)
        return iter({id(run): run for run in kept if run is not None}.values())

    def reset(self) -> None:
        """Forget the stream; the next sample is the first of the first run."""
        for run in self:
            run.close()
        self.current, self.previous, self.earlier = self._first, None, None
        self.current.reset()

    def follow(self, run: PosteriorLeastSquares) -> PosteriorLeastSquares | None:
        """Begin a new run after the current one; returns one that is not kept any more, if it is none of the others."""
        dropped, self.earlier, self.previous, self.current = self.earlier, self.previous, self.current, run
        return self._unless_kept(dropped)

    def go_back(self) -> PosteriorLeastSquares | None:
        """Take the earlier run up again; the current one is returned, if it is none of the others."""
        assert self.earlier is not None
        dropped, self.current, self.earlier = self.current, self.earlier, None
        return self._unless_kept(dropped)

    def _unless_kept(self, run: PosteriorLeastSquares | None) -> PosteriorLeastSquares | None:
        return None if any(run is kept for kept in (self.current, self.previous, self.earlier)) else run

    def reference_for_next(self, held: bool) -> PosteriorLeastSquares | None:
        """The run that the next one takes for a tare: the empty arm's, if it was known to be empty for long enough."""
        run = self.current
        known = float(run.last.std[0]) <= STEP_STD * self.unit  # else nobody can tell whether anything is held
        if run.reference is None and known and not held and run.stream.seconds >= TARE_FROM:
            return run
        return run.reference

    def is_earlier(self, estimate: Estimate) -> bool:
        """Whether an estimate's mass and first moments are those of the earlier run."""
        earlier, current = self.earlier, self.current
        if earlier is None:
            return False
        if current.reference is earlier:
            then = np.zeros(10), np.zeros((10, 10))
        elif current.reference is earlier.reference:
            then = earlier.last.phi, earlier.last.covariance
        else:
            return False
        phi, covariance = (estimate.phi - then[0])[:4], (estimate.covariance + then[1])[:4, :4]
        return bool(phi @ np.linalg.solve(covariance, phi) < SAME_RUN)

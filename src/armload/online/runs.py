"""The runs of a stream: one for each payload, the last two kept, in case what they held is held again."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armload.inertia import Z95, held
from armload.online.thresholds import LIGHT, REMEMBERED, RETURN_SHARE, RETURN_STD, SAME_RUN, STEP_STD, TARE_FROM
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
        self._empty: PosteriorLeastSquares | None = None  # the run, where it was known to hold nothing
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
        self.current, self.previous, self.earlier, self._empty = self._first, None, None, None
        self.current.reset()

    def follow(self, run: PosteriorLeastSquares) -> PosteriorLeastSquares | None:
        """Begin a new run after the current one; returns one that is not kept any more, if it is none of the others."""
        dropped, self.earlier, self.previous, self.current = self.earlier, self.previous, self.current, run
        return self._unless_kept(dropped)

    def go_back(self) -> PosteriorLeastSquares | None:
        """Take the earlier run up again; the current one is returned, if it is none of the others."""
        assert self.earlier is not None
        self.current.stream.hold()  # a solution of it may read what is discounted
        dropped, self.current, self.earlier, self._empty = self.current, self.earlier, None, None
        self.current.stream.remember(REMEMBERED)
        return self._unless_kept(dropped)

    def _unless_kept(self, run: PosteriorLeastSquares | None) -> PosteriorLeastSquares | None:
        return None if any(run is kept for kept in (self.current, self.previous, self.earlier)) else run

    def note_steady(self) -> None:
        """The arm is steady: what the current run holds now is what it held before a change that may come.

        By its own rows: while the payload changes, or may, an answer is of both, and holds less than either.
        """
        mass, std = float(self.current.last.phi[0]), float(self.current.last.std[0])
        known = std <= STEP_STD * self.unit  # else nobody can tell whether anything is held
        empty = known and not held(mass, std, known) and can_be(mass, std, self.unit, tool_std(self.current))
        self._empty = self.current if empty else None

    def reference_for_next(self) -> PosteriorLeastSquares | None:
        """The run that the next one takes for a tare: the empty arm's, if it was known to be empty for long enough."""
        run = self.current
        empty = run.reference is None and run is self._empty and run.stream.seconds >= TARE_FROM
        return run if empty else run.reference

    def is_earlier(self) -> bool:
        """Whether the mass and first moments of the current run are those of the earlier one.

        Nothing is the same each time; of payloads the mass has to be known to a share of it, as others weigh nearly as
        much.
        """
        if self.earlier is None:
            return False
        enough, then = RETURN_STD * self.unit, self.earlier.last
        if held(float(then.phi[0]), float(then.std[0]), True):
            enough = min(enough, RETURN_SHARE * float(then.phi[0]))
        if self.current.last.std[0] > enough or (step := _step(self.earlier, self.current)) is None:
            return False
        phi, covariance = step[0][:4], step[1][:4, :4]
        return bool(phi @ np.linalg.solve(covariance, phi) < SAME_RUN)

    def mass_step(self, before: PosteriorLeastSquares | None, run: PosteriorLeastSquares | None = None) -> float | None:
        """By how much the mass of a run, else the current one, differs from one before [kg].

        None where either is not known well enough.
        """
        run = run or self.current
        if before is None or run is before or np.hypot(run.last.std[0], before.last.std[0]) > STEP_STD * self.unit:
            return None
        step = _step(before, run)
        return None if step is None else float(step[0][0])


def can_be(mass: float, std: float, unit: float, tool: float = 0.0) -> bool:
    """Whether anything has a mass, known to std [kg]: none is below nothing, but the tool may weigh less than its file.

    unit: of a payload, as of `Runs`. tool: standard deviation of what the tool weighs, of which 95 % count [kg].
    """
    return mass > -LIGHT * unit - std - Z95 * tool


def tool_std(run: PosteriorLeastSquares) -> float:
    """How far the mass of a run may be off by the tool that the arm was given with [kg]; a tare has that error, too."""
    error = run.arm.attached_error
    return 0.0 if error is None or run.stream.tares else float(np.sqrt(error.covariance[0, 0]))


def _step(before: PosteriorLeastSquares, run: PosteriorLeastSquares) -> Gaussian | None:
    """By how much phi (10,) differs from one run to another, and its covariance; None: they have no arm in common."""
    now, then = run.last, before.last
    if run.reference is before:
        return now.phi, now.covariance
    if before.reference is run:
        return -then.phi, then.covariance
    if run.reference is before.reference:
        return now.phi - then.phi, now.covariance + then.covariance
    return None

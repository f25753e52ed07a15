"""A stream's last answer, and what may be said of it: what the data determine, what is held, what is in doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.estimators import Estimate, Identifier
from armload.identification.answer import body_of
from armload.identification.intervals import Before
from armload.identification.known_payload import determined_with
from armload.inertia import determined, held, held_probability
from armload.online.concluding import doubts_of
from armload.online.known_payload import denied_by, taken_by
from armload.online.learning import change_of_arm
from armload.online.thresholds import STANDS
from armload.posterior import PosteriorLeastSquares
from armload.posterior.scales import AnotherArm

_STANDING = "standing: nothing new is learned until the arm moves, or what it holds changes"
_STANDING_MOTOR = "standing: a change of payload is noticed only when the arm moves"
CHANGING = "the payload is changing"
LEFT_OUT = "samples that do not fit are left out: something pulls at the arm, or the payload is changing"


class Judgement:
    """The last answer and what is said of it.

    Args:
        frame: of the answers. weak: standard deviation (10,) of the weak prior. before: what is known beforehand.

    Attributes:
        estimate: the answer. around: (10,) where its intervals are. run: that it is of; None: of no run alone.
        determined: which parameters (10,) the data determine. held: whether anything is. p_held: how probable that is.
        newest: time of the newest sample that counts in it [s]; −∞ before one does.
        another: that the arm is not the one of its tare or profile, once a run has found so; None: none has.
        doubted: whether something speaks against its error bars. notes: what else there is to say.
    """

    def __init__(self, frame: str, weak: NDArray[np.float64], before: Before) -> None:
        self._frame, self._weak, self.before = frame, weak, before
        self.reset()

    def reset(self) -> None:
        """What is known beforehand."""
        mean, std = self.before
        self.estimate = Estimate(0.0, mean, np.diag(std**2), 0, self._frame)
        self.around, self.doubted = mean, False
        self.run: Identifier | None = None
        self.another: AnotherArm | None = None
        self._than: str | None = None  # what it is another one than, as of `OnlineEstimate.relative_to`
        self.newest = -np.inf
        self.determined, self.held, self.p_held = np.zeros(10, dtype=bool), False, 0.0
        self.notes: tuple[str, ...] = ()

    def take(self, estimate: Estimate, run: Identifier) -> None:
        """A newer answer, of which the last judgement holds."""
        self.estimate, self.run, self.around = estimate, run, estimate.phi
        if isinstance(run, PosteriorLeastSquares) and run.stream.another is not None and run.stream.another.found:
            self.another = run.stream.another
        self.doubted = change_of_arm(run, another=self.another) is not None

    def arm_changed(self, run: Identifier, relative_to: str) -> str | None:
        """That the arm is not as at its tare or profile, also where an earlier run found it; None: it is.

        Args: as of `judge`.
        """
        if self.another is not None:
            self._than = relative_to = self._than or relative_to
        return change_of_arm(run, relative_to, self.another)

    def follow(self, estimate: Estimate) -> None:
        """A newer answer while samples are left out, of no run alone."""
        self.estimate, self.run, self.around = estimate, None, estimate.phi

    def counts(self, t: float, run: Identifier) -> tuple[bool, bool]:
        """Whether a sample at t [s] that a run took makes `newest` newer, or says nothing new, as the arm stands."""
        if not isinstance(run, PosteriorLeastSquares):
            self.newest = t
        elif run.fresh:
            row = run.stream.row
            if row is not None and row.h <= 0.0 and run is self.run and self.newest > -np.inf:
                return False, run.data_t - self.newest > STANDS
            self.newest = run.data_t
        elif run is self.run:
            return False, False
        else:
            self.newest = -np.inf
        return True, False

    def age(self, now: float) -> float:
        """How much older than now [s] the newest sample is that counts; 0 before one does."""
        return now - self.newest if self.newest > -np.inf else 0.0

    def conclude(self, estimate: Estimate, run: Identifier, arm: Arm, t: float) -> None:
        """The last answer of a stream, at t [s], already judged: it becomes a body, and is doubted as of a log."""
        exchanged = isinstance(run, PosteriorLeastSquares) and run.exchanged
        self.estimate = replace(estimate, phi=body_of(estimate, bool(self.determined[0]), exchanged))
        self.run, self.around, self.newest = run, estimate.phi, t
        self.doubted, notes = doubts_of(run, estimate, arm)
        self.notes = (*self.notes, *notes)

    def judge(self, estimate: Estimate, run: Identifier, relative_to: str, moving: bool, stands: bool) -> None:
        """What the data determine, and whether anything is there.

        Args:
            estimate: to be judged. run: that it is of. relative_to: what, as of `OnlineEstimate`.
            moving: whether the arm moves. stands: whether what was seen lately says nothing new, as it stands.
        """
        std, before = estimate.std, self.before
        by_samples = determined(std, before.std, run.weak_std, self._weak)
        self.determined = determined_with(by_samples, taken_by(run), std, before)
        self.held = held(float(estimate.phi[0]), float(std[0]), bool(self.determined[0]))
        self.p_held = held_probability(float(estimate.phi[0]), float(std[0]), float(self._weak[0]))
        notes = []
        if not moving:
            notes.append("not moving: inertia undetermined" if not self.determined[4:].all() else "not moving")
        if stands:
            motor = isinstance(run, PosteriorLeastSquares) and run.stream.posterior.torque == "motor"
            notes.append(_STANDING_MOTOR if motor else _STANDING)
        if (changed := self.arm_changed(run, relative_to)) is not None:
            notes.append(changed)
        if self.held and (denied := denied_by(run)) is not None:
            notes.append(denied)
        self.notes = tuple(notes)

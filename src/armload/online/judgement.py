"""A stream's last answer, and what may be said of it: what the data determine, what is held, what is in doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.estimators import Estimate, Identifier
from armload.identification.answer import body_of, is_removal
from armload.identification.found import explained
from armload.identification.intervals import Before
from armload.identification.known_payload import denied_by, determined_with, rests_on_prior
from armload.identification.mounted_tool import allowing_for
from armload.identification.reporting import doubt_of, removal
from armload.inertia import DROPPED, Inexact, determined, held, held_probability
from armload.online.doubts import Doubts
from armload.online.thresholds import STANDS
from armload.online.watch import PayloadWatch
from armload.posterior import HybridIdentifier, PosteriorLeastSquares
from armload.posterior.known import Gaussian
from armload.regression import payload_prior_std

_STANDING = "standing: nothing new is learned until the arm moves, or what it holds changes"
_STANDING_MOTOR = "standing: a change of payload is noticed only when the arm moves"
_SLOW_MOTOR = "too slow: friction hides a change of payload until a joint moves faster"
_CHANGING = "the payload is changing"
_LEFT_OUT = "samples that do not fit are left out: "  # and the likeliest of `_MAYBE`
_LIFTED = "something lifts the arm, or what was on it from the start was taken off, which is believed after a minute"
_MAYBE = (  # of p_change, p_contact and p_drift, the largest while they are large
    "the payload may be changing",
    "something may be touching the arm",
    "the torques drift slowly, as an arm does that warms up: the intervals do not allow for it",
)


class Judgement:
    """The last answer and what is said of it.

    Args:
        arm: whose payload it is. prior: as of `Identifier.payload_prior`. tared: whether the arm is known from
            elsewhere, with whatever was mounted there.

    Attributes:
        before, around, determined, held, p_held, rests_on_prior, torque_gain_std, notes: as of `OnlineEstimate`.
        estimate: the answer. run: that it is of; None: of no run alone.
        newest: time of the newest sample that counts in it [s]; −∞ before one does.
        doubts: what was asked of the runs besides the payload. doubted: whether that speaks against its error bars.
    """

    def __init__(self, arm: Arm, prior: tuple[NDArray[np.float64], NDArray[np.float64]] | None, tared: bool) -> None:
        self._arm, self._weak, self._tared = arm, payload_prior_std(arm), tared
        self.before = self._first = Before(*(prior or (np.zeros(10), self._weak)))
        self.doubts = Doubts(arm)
        self.reset()

    def reset(self) -> None:
        """What is known beforehand."""
        mean, std = self.before = self._first
        self.estimate = Estimate(0.0, mean, np.diag(std**2), 0, str(self._arm.frame))
        self.around, self.newest = mean, -np.inf
        self.run: Identifier | None = None
        self.doubted = not self._tool_trusted(None)
        self.doubts.reset()
        self.determined, self.held, self.p_held = np.zeros(10, dtype=bool), False, 0.0
        self.rests_on_prior, self.torque_gain_std = np.ones(10, dtype=bool), None
        self.notes: tuple[str, ...] = ()

    def allowing(self, estimate: Estimate, run: Identifier, mixed: bool = False, concluded: bool = False) -> Estimate:
        """An answer of a run that allows for the error of the tool that the arm was given with.

        mixed: whether it is of other runs, too.
        """
        if (tool := self._tool_of(run)) is None:
            return estimate
        posterior = run if isinstance(run, PosteriorLeastSquares) and not (mixed or run.exchanged) else None
        known, log_only = (None, None) if posterior is None else (posterior.known, posterior.log_only)
        return allowing_for(tool, estimate, known, log_only, quick=not concluded)

    def take(self, estimate: Estimate, run: Identifier | None) -> None:
        """A newer answer, of which the last judgement holds; of no run alone while samples are left out."""
        self._take(estimate, run)
        if run is not None:
            self.doubted = bool(self.doubts.sentences) or not self._tool_trusted(run)

    def counts(self, run: PosteriorLeastSquares) -> tuple[bool, bool]:
        """Whether a sample that a run took makes `newest` newer, or says nothing new, as the arm stands."""
        if run.fresh:
            if run.stream.stands and run is self.run and self.newest > -np.inf:
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

    def judge(self, estimate: Estimate, run: Identifier, relative_to: str, moving: bool, stands: bool) -> None:
        """What the data determine, and whether anything is there.

        Args:
            estimate: to be judged. run: that it is of. relative_to: as of `OnlineEstimate`. moving: whether the arm
                moves. stands: whether what was seen lately says nothing new, as it stands.
        """
        if isinstance(run, HybridIdentifier):  # what the log denies is not known beforehand
            self.before = Before(*(run.payload_prior or self._first))
        std, before, posterior = estimate.std, self.before, run if isinstance(run, PosteriorLeastSquares) else None
        taken = posterior.known if posterior is not None and posterior.taken else None
        shown = determined(std, before.std, run.weak_std, self._weak)
        self.determined = determined_with(shown, taken, std, before)
        self.rests_on_prior = ~self.determined | rests_on_prior(shown, taken, std, run.weak_std)
        mass, std_of_mass = float(estimate.phi[0]), float(std[0])
        self.p_held = held_probability(mass, std_of_mass, float(self._weak[0]))
        # while a payload changes nobody knows the mass, which is no reason to say that it was dropped
        stays = self.held and self.p_held > DROPPED
        self.held = held(mass, std_of_mass, bool(self.determined[0])) or stays
        notes = []
        if not moving:
            notes.append("not moving: inertia undetermined" if not self.determined[4:].all() else "not moving")
        if stands:
            motor = posterior is not None and posterior.stream.posterior.torque == "motor"
            notes.append(_STANDING_MOTOR if motor else _STANDING)
        if is_removal(estimate, bool(self.determined[0])):
            notes.append(removal(relative_to))
        notes += self.doubts.sentences
        if (tool := self._tool_of(run)) is not None:
            notes += tool.notes
        denies_family = isinstance(run, HybridIdentifier) and run.denies_family
        if self.held and posterior is not None and (taken is None or denies_family):
            denied = denied_by(posterior.known, self._with_tool_s_error(posterior.log_only, run), denies_family)
            notes += [] if denied is None else [denied]
        self.notes = tuple(notes)

    def left_out(self, watch: PayloadWatch) -> None:
        """Say that samples are left out."""
        self.notes += (_CHANGING if watch.settling else _LIFTED if watch.lifted else _LEFT_OUT + _likeliest(watch),)

    def words(self, unsure: PayloadWatch | None, blind: bool, moving: bool) -> tuple[str, ...]:
        """The notes, and what the last rows may be, if the watch is not sure of them."""
        notes = self.notes
        said = any(note in (_CHANGING, _LIFTED) or note.startswith(_LEFT_OUT) for note in notes)
        if unsure is not None and not said:
            notes += (_likeliest(unsure),)
        if blind and _STANDING_MOTOR not in self.notes:
            notes += (_SLOW_MOTOR if moving else _STANDING_MOTOR,)
        return notes

    def conclude(self, estimate: Estimate, run: Identifier, relative_to: str, t: float) -> None:
        """The last answer of a stream, at t [s], already judged: it becomes a body, and is doubted as of a log.

        Args:
            estimate, run, relative_to: as of `judge`.
        """
        exchanged = run.exchanged if isinstance(run, PosteriorLeastSquares) else False
        sound = exchanged or explained(estimate, self._with_tool_s_error(run.unprojected, run))
        doubt = doubt_of(exchanged, sound, None, 0.0, relative_to=relative_to)
        self._take(estimate, run)
        self.estimate = replace(estimate, phi=body_of(estimate, bool(self.determined[0]), exchanged))
        self.newest, mass = t, (float(estimate.phi[0]), float(estimate.std[0]))
        self.held = held(*mass, bool(self.determined[0]))  # as of a log
        self.doubted = doubt is not None or bool(self.doubts.sentences) or not self._tool_trusted(run)
        self.notes += () if doubt is None else (doubt,)

    def _tool_of(self, run: Identifier | None) -> Inexact | None:
        """The error of the tool that a run's answer has; a tare, or the empty run before, has it, too."""
        shared = self._tared or getattr(run, "reference", None) is not None
        return None if shared else self._arm.attached_error

    def _with_tool_s_error(self, said: Gaussian | None, run: Identifier | None) -> Gaussian | None:
        tool = self._tool_of(run)
        return said if said is None or tool is None else (said[0], said[1] + tool.covariance)

    def _tool_trusted(self, run: Identifier | None) -> bool:
        tool = self._tool_of(run)
        return tool is None or tool.calibrated

    def _take(self, estimate: Estimate, run: Identifier | None) -> None:
        self.estimate, self.run, self.around = estimate, run, estimate.phi
        if isinstance(run, PosteriorLeastSquares):  # of no other: a run that ends is solved anew in a second thread
            self.torque_gain_std = run.stream.posterior.gain_std


def _likeliest(watch: PayloadWatch) -> str:
    """What the last rows may be, of what a steady arm with the same payload is not."""
    return _MAYBE[int(np.argmax(watch.likely))]

"""A change of payload that settles: the run after it is made, and takes the samples that may be of the new payload."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass, field

import numpy as np

from armload.online.lasting import Lasting
from armload.online.modes import Modes
from armload.online.thresholds import LAG, LONG_ENOUGH
from armload.posterior import PosteriorLeastSquares
from armload.posterior.sequential import SequentialPosterior
from armload.recording import Sample
from armload.regression import payload_prior_std


def next_run(
    run: PosteriorLeastSquares, reference: PosteriorLeastSquares | None, until: float, sticks: float
) -> PosteriorLeastSquares:
    """The run after one that ends: that one's rows from `until` [s] on are taken back, `reference` becomes a tare.

    sticks: as of `Sticking.share`; 0 where torque is measured at the motors, whose rows allow for it anyway.
    """
    run.stream.finish(until)
    following = run.another(reference)
    stream = following.stream
    stream.prepare()
    if sticks > 0.0:
        coulomb = stream.correction.coulomb(stream.posterior.eta)
        stream.allow_for_sticking(sticks * coulomb**2 / 3.0)
    return following


@dataclass
class Change:
    """A change that is settling.

    Attributes:
        t: when it was noticed [s]. began: when it began [s]. state: the posterior of the run before, which samples are
            looked at with. following: the run after it. taken_from: since when that run takes samples [s], if it does;
            stayed: for how long the payload seems to have been the same by then [s].
        lasting: what those samples say of a change that goes on.
    """

    t: float
    began: float
    state: SequentialPosterior
    following: Future[PosteriorLeastSquares] | PosteriorLeastSquares
    taken_from: float | None = None
    stayed: float = 0.0
    lasting: Lasting = field(default_factory=Lasting)

    @property
    def run(self) -> PosteriorLeastSquares:
        """The run after the change, waited for."""
        if isinstance(self.following, Future):
            self.following = self.following.result()
        return self.following

    def looked(self, t: float, modes: Modes, row_t: float) -> None:
        """A sample at t [s] completed a row at `row_t` [s]: whether the run takes samples, and from which on."""
        if modes.other < 0.5 or modes.stays < LAG:
            self.taken_from = None
        elif self.taken_from is None or self.taken_from < row_t - modes.stays:
            self.begin(t, modes.stays)

    def begin(self, t: float, stayed: float) -> None:
        """The run takes samples from t [s] on, when the payload seems to have stayed for so long [s]."""
        self.run.reset()
        self.taken_from, self.stayed, self.lasting = t, stayed, Lasting()

    def take(self, sample: Sample, louder: float) -> None:
        """A sample, for the run if it takes samples; `louder`: as of `Lasting.take`."""
        if self.taken_from is not None:
            before = self.run.stream.rows
            self.run.update(sample)
            if self.run.stream.rows > before:
                self.lasting.take(self.run.stream, louder)

    def stays(self, modes: Modes, row_t: float) -> bool:
        """Whether the payload has been the same for so long that it would show, had it gone on changing.

        At the mean rate since the change began its mass would spread by rate·T/√12 over T: three of its deviations.
        """
        (shift, spread), T = modes.shift(), modes.stays
        seen = abs(float(shift[0])) * T / (row_t - self.began) > 3.0 * np.sqrt(12.0 * float(spread[0, 0]))
        return T >= LAG and (seen or T > LONG_ENOUGH)

    def ended(self, modes: Modes) -> Lasting:
        """The payload stays, and the run is taken up: what its rows say of a hand-over that goes on all the same."""
        if self.taken_from is None:
            self.begin(self.t, 0.0)
        assert self.taken_from is not None
        lasted = max(self.taken_from - self.stayed, self.t) - self.began  # what is slow is noticed late
        self.lasting.begin(modes.shift()[0], lasted, self.stayed, payload_prior_std(self.run.arm))
        return self.lasting

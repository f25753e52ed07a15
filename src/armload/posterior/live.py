"""MAP least squares as an identifier for live robots: `map` and `map-gp`, an answer after every row."""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armload.estimators import Estimate, Identifier
from armload.posterior.map import PosteriorLeastSquares
from armload.posterior.stream import StreamingPosterior
from armload.recording import Sample
from armload.regression import payload_prior_std

FAST = 2.5e-3  # [s] samples that come closer than this share the work of a row and of an answer between them


class StreamingIdentifier(Identifier):
    """MAP least squares sample by sample, in bounded time.

    Args:
        method: what it is the live form of, with its tare.
        publish: the answer is at most this old [s].

    Attributes:
        stream: the posterior of the run; None before the first sample.
        reference: the earlier run that is a tare, if one is.
        fresh: whether the last update brought a new answer. data_t: time of the newest sample in the answer [s].
    """

    def __init__(self, method: PosteriorLeastSquares, publish: float = 0.01) -> None:
        self.method, self.arm, self.publish = method, method.arm, publish
        self.name = getattr(self, "name", method.name)
        self.stream: StreamingPosterior | None = None
        self.reference: StreamingIdentifier | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        if self.stream is not None:
            self.stream.reset()
        self._count, self._began, self._due = 0, None, False
        self._last_t = self._row_t = self.data_t = -np.inf
        self._phi, self._covariance = self._before()
        self.fresh = False

    def update(self, sample: Sample) -> Estimate:
        """Take one sample (t, q, dq, tau) and return the estimate so far, at most `publish` old."""
        self.prepare()
        assert self.stream is not None
        if self._began is None:
            self._began = sample.t
        self._count += 1
        slow, self._last_t = sample.t - self._last_t > FAST, sample.t
        new = self.stream.take(*sample)
        self.fresh = self._due and (slow or not new)  # of a fast stream, a row and an answer share no sample
        if new:  # it is due if it would be too old by the next row
            self._due = self._due or 2.0 * sample.t - self.data_t - self._row_t > 1.05 * self.publish
            self._row_t = sample.t
            self.fresh = self._due and slow
        if self.fresh:
            self._phi, self._covariance = self._answer(self._row_t - self._began)
            self.data_t, self._due = self._row_t, False
        return Estimate(sample.t, self._phi, self._covariance, self._count, str(self.arm.frame))

    @property
    def last(self) -> Estimate:
        """The last answer."""
        return Estimate(self._last_t, self._phi, self._covariance, self._count, str(self.arm.frame))

    def beside(self, reference: StreamingIdentifier | None = None) -> Self:
        """Another run of the same arm, that has seen nothing yet.

        Args:
            reference: an earlier run with the same mounted as at the tare; it is a tare, too, and estimates are of
                what was added since.
        """
        other = copy(self)
        other.stream, other.reference = None, reference
        other.reset()
        return other

    def prepare(self) -> None:
        """Do now what the first sample would have to wait for."""
        if self.stream is None:
            reference = None if self.reference is None else self.reference.stream
            self.stream = self.method.streaming(reference)

    def close(self) -> None:
        """Stop the thread that finds the scales; the identifier may go on."""
        if self.stream is not None:
            self.stream.close()

    def _before(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi and covariance before the first row."""
        return np.zeros(10), np.diag(payload_prior_std(self.arm) ** 2)

    def _answer(self, seconds: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # noqa: ARG002
        """phi and covariance from the stream as it stands, `seconds` after the run began."""
        assert self.stream is not None
        return self.stream.answer()

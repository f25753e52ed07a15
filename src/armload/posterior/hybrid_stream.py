"""The hybrid for a live robot: every sample counts, the answer is never older than ten milliseconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.estimators import Estimate
from armload.inertia import near_consistent, nearest_consistent
from armload.posterior.evidence import Evidence
from armload.posterior.hybrid import answer, shipped_model, std_alone
from armload.posterior.live import StreamingIdentifier
from armload.posterior.map import SmoothPosteriorLeastSquares
from armload.posterior.model_file import HybridModel
from armload.recording import Recording, Sample
from armload.regression import payload_prior_std


class StreamingHybrid(StreamingIdentifier):
    """The hybrid on the streaming posterior of its physics (`least_squares.streaming`).

    It gives what `HybridIdentifier` gives, up to the scales' lag: but a tare along the same motion is a tare like any
    other here.

    Args:
        arm: the bare arm. tare: an earlier log of it, if there is one.
        model: the learned parts; None: those shipped for the arm.
        publish: the answer is at most this old [s].

    Raises:
        ModelError: no model is shipped for this arm, or it was trained for another one.
    """

    name = "hybrid"

    def __init__(
        self, arm: Arm, tare: Recording | None = None, model: HybridModel | None = None, publish: float = 0.01
    ) -> None:
        self.model = shipped_model(arm) if model is None else model
        self._payloads = self.model.prior_for(arm)
        self.calibrated = self.model.calibrated
        self.known = (self._payloads.mean, self._payloads.std)
        self._weak = payload_prior_std(arm)
        self._tare_time = 0.0 if tare is None else tare.duration
        super().__init__(SmoothPosteriorLeastSquares(arm, tare), publish)
        for nearest in (near_consistent, nearest_consistent):  # their first call loads a solver: not in mid-stream
            nearest(-self._weak, np.diag(self._weak**-2.0))

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        super().reset()
        self._trusted: Evidence | None = None
        self._squares, self._values = 0.0, 0

    def update(self, sample: Sample) -> Estimate:
        """Take one sample (t, q, dq, tau) and return the estimate so far, at most `publish` old."""
        self._squares += float(sample.dq @ sample.dq)
        self._values += len(sample.dq)
        return super().update(sample)

    def _before(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._payloads.mean, np.diag(self._payloads.std**2)

    def _answer(self, seconds: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        assert self.stream is not None
        stream, speed = self.stream, float(np.sqrt(self._squares / self._values))
        tare_time = self._tare_time
        if self.reference is not None and self.reference.stream is not None:
            tare_time += self.reference.stream.seconds
        evidence = Evidence.of(
            stream.information, stream.vector, stream.posterior, seconds, tare_time, speed, self._weak
        )
        self._trusted = self.model.calibration.trusted(evidence)
        tool = self.arm.attached is not None
        return answer(self._trusted, self.model.calibration, self._payloads, tool, quick=True)

    @property
    def alone(self) -> NDArray[np.float64]:
        """Standard deviation (10,) of the last estimate under the weak prior of `payload_prior_std` instead."""
        return std_alone(self._trusted, self._weak)

"""The MAP least squares as identifiers: with the arm's rigid mismatch alone, and with its smooth one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.estimators import BatchIdentifier, Estimate
from armload.posterior.problem import Posterior, Scales
from armload.posterior.solve import solve
from armload.posterior.stream import StreamingPosterior
from armload.recording import Recording, Sample
from armload.regression import Correction, GaussianPrior, JointFeatures, payload_prior_std, solution_prior_std
from armload.regression.information import RegressionData
from armload.regression.noise import RIGID, SMOOTH, NoiseModel


class PosteriorLeastSquares(BatchIdentifier):
    """MAP least squares with the arm's rigid mismatch as an unknown, for a log of any motion of any arm.

    >>> from armload.arms import arm
    >>> PosteriorLeastSquares(arm("panda")).name
    'map'

    Args:
        arm: the bare arm.
        tare: an earlier recording of the same arm, on any motion, with whatever was mounted then; estimates are
            relative to it.
        gain: λ of the lag [1/s].
        refresh: the posterior is solved anew at most this often [s] while streaming; `run` solves at the end only.
        prior: what is known about the payload before; None: the weak prior of `payload_prior_std`.
    """

    name = "map"
    _noise: NoiseModel = RIGID
    _iterations = 12

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        gain: float = 20.0,
        refresh: float = 0.02,
        prior: GaussianPrior | None = None,
    ) -> None:
        self.arm, self.gain, self.refresh, self.prior = arm, gain, refresh, prior
        self._correction = Correction(arm, rated_effort(arm))
        self._tare: RegressionData | None = None
        self._start: Scales | None = None
        if tare is not None:
            self._tare = self._data()
            self._tare.add(tare.t, tare.q, tare.dq, tare.tau)
            self._start = self._from_tare(self._tare)
        self.reset()

    def _data(self) -> RegressionData:
        """An empty regression of the kind this method accumulates."""
        return RegressionData(self._correction, self.gain, block=self._noise.block)

    def _from_tare(self, tare: RegressionData) -> Scales | None:  # noqa: ARG002
        """Scales found from the tare once, for all later solutions to begin with; None: begin with those stated."""
        return None

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        self._run: RegressionData | None = None
        self._waiting: list[Sample] = []
        self._solved_at, self._posterior, self._count = -np.inf, None, 0

    def update(self, sample: Sample) -> Estimate:
        """Take one sample (t, q, dq, tau) and return the estimate so far, at most `refresh` old.

        Samples between two solutions wait and are taken together: a row at a time would cost ten times as much.
        """
        self._waiting.append(sample)
        due = self._posterior is None or not 0.0 <= sample.t - self._solved_at < self.refresh
        if due or len(self._waiting) >= self._CHUNK:
            t, q, dq, tau = (np.array(column) for column in zip(*self._waiting, strict=True))
            self._waiting.clear()
            self._take(t, q, dq, tau)
        return self._estimate(float(sample.t)) if due else self._last(sample.t)

    @property
    def posterior(self) -> Posterior:
        """The last solution, with the arm's mismatch and the residual."""
        if self._posterior is None:
            raise RuntimeError("no sample has been seen: call update or run first")
        return self._posterior

    def streaming(self, reference: StreamingPosterior | None = None) -> StreamingPosterior:
        """The same method for a live stream, with the same tare.

        Args:
            reference: an earlier run of the stream with the same mounted as at the tare; it is another one.
        """
        tares, start = () if self._tare is None else (self._tare,), self._start
        if reference is not None:
            tares, start = (*reference.tares, reference.finish()), reference.posterior.scales
        empty = self._data()
        std = solution_prior_std(self.arm)
        return StreamingPosterior(self._correction, empty.features, self._noise, std, tares, start, self.gain)

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        if self._run is None:
            self._run = self._data()
        self._run.add(t, q, dq, tau)
        self._count += len(t)

    def _estimate(self, t: float) -> Estimate:
        assert self._run is not None
        runs = [self._run] if self._tare is None else [self._tare, self._run]
        prior_std = solution_prior_std(self.arm)
        self._posterior = solve(runs, prior_std, self.prior, self._noise, self._iterations, self._start)
        self._solved_at = t
        return self._last(t)

    def _last(self, t: float) -> Estimate:
        seen = self._count + len(self._waiting)
        return Estimate(float(t), self.posterior.phi, self.posterior.covariance, seen, str(self.arm.frame))


class SmoothPosteriorLeastSquares(PosteriorLeastSquares):
    """MAP least squares with the arm's rigid and its smooth mismatch as unknowns: the physics of the default method.

    The smooth part (`JointFeatures`) is a Gaussian process over the pose and one over each joint's velocity. Only with
    it is the rest of the residual small enough to be taken for noise.

    >>> from armload.arms import arm
    >>> SmoothPosteriorLeastSquares(arm("panda")).name
    'map-gp'

    Args:
        arm, tare, gain, refresh, prior: as for `PosteriorLeastSquares`.
        features: of the smooth part; None: 128 of the pose, 12 of the velocity.
    """

    name = "map-gp"
    _noise = SMOOTH
    _iterations = 5

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        gain: float = 20.0,
        refresh: float = 0.1,
        prior: GaussianPrior | None = None,
        features: JointFeatures | None = None,
    ) -> None:
        self.features = features or JointFeatures(arm.n)
        super().__init__(arm, tare, gain, refresh, prior)

    def _data(self) -> RegressionData:
        return RegressionData(self._correction, self.gain, self.features, self._noise.block)

    def _from_tare(self, tare: RegressionData) -> Scales:
        return solve([tare], payload_prior_std(self.arm), None, self._noise, self._iterations).scales

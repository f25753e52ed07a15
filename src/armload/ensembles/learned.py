"""A learned model on a live stream: an answer from the first sample, averaged as samples come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.ensembles.trained_model import LearnedModel
from armload.estimators import Estimate, Identifier
from armload.recording import Recording, Sample
from armload.runtime.kernels import kernel

# standard deviation of a parameter that did not vary in training: it is not known exactly. A stated prior
_LEAST = np.array([0.025] + [0.0025] * 9)  # [kg, kg·m, kg·m²]


class LearnedIdentifier(Identifier):
    """A learned model as a stream identifier: the cumulative average of its predictions (Taie et al. 2024, Fig. 8).

    phī(k) = Σ_{j ≤ k} K(x_j) / k,  x_j = (t_j − t_1, q_j, dq_j, tau_j),  K the mean over the members (eq. 8).

    The covariance is diagonal: the variance of the members' own averages, plus the square of the model's error on
    payloads held out from training where that is known (`LearnedModel.error_std`). The spread of the members
    does not contain the error that they have in common. It is infinite before the first sample, when phi is the
    training mean, and for a model of one member whose error is unknown.

    The model knows a motion from its start, so the first sample must be that start. A stream cannot know whether a
    motion will be followed, so `update` never refuses a sample; `trace` and `run` check the whole recording first
    (`LearnedModel.check`). A sample that holds a number that is not finite is passed over.

    Args:
        model: from `load_model` or `save_model`.
        arm: the arm the stream comes from.
        single: give each sample's own prediction instead of the average.
        any_motion: also take recordings of motions the model was not trained on; to measure how it fails there.

    Raises:
        ModelError: the model belongs to another arm or frame.
    """

    def __init__(self, model: LearnedModel, arm: Arm, *, single: bool = False, any_motion: bool = False) -> None:
        model.check(arm)
        self.model, self.arm, self.single, self.any_motion = model, arm, single, any_motion
        self.name = f"{model.kind} ensemble" + (", single sample" if single else "")
        self.payload_prior = (model.phi_mean, np.maximum(model.phi_std, _LEAST))
        self._model_variance = (
            np.zeros(10) if model.error_std is None else model.error_std**2
        )  # added to that of the members
        if model.error_std is None and model.compiled.n_members == 1:
            self._model_variance = np.full(10, np.inf)
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next sample is the start of a motion."""
        self._start: float | None = None
        self._count = 0
        self._averages = np.zeros((self.model.compiled.n_members, 10))  # each member's, so far
        self._last = Estimate(float("nan"), self.model.phi_mean, np.diag(np.full(10, np.inf)), 0, self.model.frame)

    def update(self, sample: Sample) -> Estimate:
        """Take one sample and return the average, or with `single` its own prediction."""
        self._check_size(sample)
        self._follow(*sample)
        return self._last

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        for sample in zip(t.tolist(), q, dq, tau, strict=True):
            self._follow(*sample)

    def _estimate(self, t: float) -> Estimate:  # noqa: ARG002
        return self._last

    def _follow(self, t: float, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        if self._start is None:
            self._start = t
        row = np.empty(1 + 3 * self.arm.n)
        if _fill(row, t - self._start, q, dq, tau):
            self._count += 1
            phi, covariance = np.zeros(10), np.zeros((10, 10))
            predictions, count = self.model.compiled.row(row), 1 if self.single else self._count
            _average(self._averages, predictions, count, self._model_variance, phi, covariance)
            self._last = Estimate(t, phi, covariance, self._count, self.model.frame)

    def _check(self, recording: Recording) -> None:
        """Whole recordings must follow a motion of the model (unless `any_motion`), and be of its arm."""
        if not self.any_motion:
            self.model.check(self.arm, recording)
        super()._check(recording)


@kernel
def _fill(row, t, q, dq, tau):  # pragma: no cover - compiled
    """Write a sample into a row (1 + 3n,) of features; whether all of it is finite."""
    n = (row.shape[0] - 1) // 3
    row[0] = t
    for k in range(n):
        row[1 + k], row[1 + n + k], row[1 + 2 * n + k] = q[k], dq[k], tau[k]
    for value in row:  # noqa: SIM110 - numba knows no all() of a generator
        if not np.isfinite(value):
            return False
    return True


@kernel
def _average(averages, predictions, count, model_variance, mean, covariance):  # pragma: no cover - compiled
    """Update each member's running average (M, k) by its prediction (M, k), number `count`; averages are changed.

    model_variance: (k,) added to the variance of the members. mean, covariance: zeros (k,) and (k, k), filled in.
    """
    M, k = averages.shape
    for m in range(M):
        for j in range(k):
            before = averages[m, j] if count > 1 else 0.0
            averages[m, j] = before + (predictions[m, j] - before) / count
            mean[j] += averages[m, j]
    for j in range(k):
        mean[j] /= M
        square = 0.0
        for m in range(M):
            square += (averages[m, j] - mean[j]) ** 2
        covariance[j, j] = model_variance[j] + (square / (M - 1) if M > 1 else 0.0)

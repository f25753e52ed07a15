"""A learned model on a live stream: an answer from the first sample, averaged as samples come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.identifier import Estimate, Identifier
from armload.learners.compiled import member_spread
from armload.learners.model import LearnedModel
from armload.recording import Recording, Sample


class LearnedIdentifier(Identifier):
    """A learned model as a stream identifier: the cumulative average of its predictions (Taie et al. 2024, Fig. 8).

    phī(k) = Σ_{j ≤ k} K(x_j) / k,  x_j = (t_j − t_1, q_j, dq_j, tau_j),  K the mean over the members (eq. 8).

    The covariance is diagonal: the variance of the members' own averages, plus the square of the model's error on
    payloads held out from training where that is known (`LearnedModel.error_std`). The members' disagreement alone
    says nothing of how far they are from the truth together. It is infinite before the first sample, when phi is the
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
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next sample is the start of a motion."""
        self._start: float | None = None
        self._t = float("nan")
        self._count = 0
        self._averages: NDArray[np.float64] | None = None  # (M, 10) each member's average so far

    def update(self, sample: Sample) -> Estimate:
        """Take one sample and return the average, or with `single` its own prediction."""
        t, q, dq, tau = sample
        if self._start is None:
            self._start = t
        row = np.concatenate([[t - self._start], q, dq, tau])
        if np.isfinite(row).all():
            said = self.model.compiled.members(row[None])[:, 0]
            self._t = t
            self._count += 1
            if self._averages is None or self.single:
                self._averages = said
            else:
                self._averages = self._averages + (said - self._averages) / self._count
        return self._estimate()

    def trace(self, recording: Recording, every: int = 1) -> list[Estimate]:
        """The estimates along a recording of a motion the model knows.

        Raises:
            ModelError: the recording follows no motion of the model (unless `any_motion`), or is of another arm.
        """
        if not self.any_motion:
            self.model.check(self.arm, recording)
        return super().trace(recording, every)

    def _estimate(self) -> Estimate:
        if self._averages is None:
            phi, spread = self.model.phi_mean, np.full(10, np.inf)
        else:
            phi, spread = self._averages.mean(axis=0), member_spread(self._averages)
            if self.model.error_std is not None:
                spread = np.hypot(np.where(np.isfinite(spread), spread, 0.0), self.model.error_std)
        return Estimate(self._t, phi, np.diag(spread**2), self._count, self.model.frame)

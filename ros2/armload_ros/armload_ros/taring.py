"""The joint states of which a tare is made."""

from __future__ import annotations

import numpy as np

from armload import Recording
from armload.arms import Arm
from armload.online import Gate
from armload.recording import Sample


class Taring:
    """Collects the samples that can be of the arm, on a clock that rises whatever the stamps do.

    Args:
        arm: the arm.
    """

    def __init__(self, arm: Arm) -> None:
        self._gate = Gate(arm)
        self._samples: list[Sample] = []

    def take(self, sample: Sample) -> float:
        """Take notice of a sample; how many seconds of such there are."""
        usable = self._gate.take(*sample)
        if usable is not None:
            self._samples.append(usable)
        return self._samples[-1].t - self._samples[0].t if self._samples else 0.0

    def recording(self, joint_names: tuple[str, ...]) -> Recording:
        """All of them."""
        t, q, dq, tau = map(np.array, zip(*self._samples, strict=True))
        return Recording(t, q, dq, tau, joint_names=joint_names)

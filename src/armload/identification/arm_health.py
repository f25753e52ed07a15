"""What a log says of the arm itself: offsets, friction, what is left over, and whether the arm is as it was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload.posterior import PosteriorLeastSquares
from armload.regression.noise import whole_noise


@dataclass(frozen=True)
class ArmHealth:
    """An arm as one log, or a part of one, shows it.

    offset, coulomb: (n,) torque offsets and Coulomb friction [N·m]: by how much they differ from those at the tare, or
        of the profile's mean session, where there is one (`relative`), else as found beside the model.
    residual: rms over the joints of the residual's long-run deviation √S, over the one expected of such an arm.
    restlessness: how restless the torques are, of what they were at the tare or in the profile (`posterior.restless`).
        None: there was neither, or torque is motor current.
    misfit: T of `posterior.drift`, whether it is as at its tare or in its profile; None: not tested.
    joint: the joint that tells most of it, from 1; 0 where `misfit` is None. changed: whether T is beyond what sound
        logs show.
    """

    relative: bool
    offset: tuple[float, ...]
    coulomb: tuple[float, ...]
    residual: float
    restlessness: float | None = None
    misfit: float | None = None
    joint: int = 0
    changed: bool = False

    @classmethod
    def of(cls, run: PosteriorLeastSquares) -> ArmHealth:
        """As a concluded run shows it."""
        stream, found = run.stream, run.posterior
        correction, drift = stream.correction, stream.drift
        noise = found.residual**2 / whole_noise(correction, stream.noise)
        restless = stream.restlessness
        both = (correction.offset(found.eta), correction.coulomb(found.eta))
        offset, coulomb = both if drift is None else (drift.offset, drift.coulomb)
        return cls(
            relative=drift is not None,
            offset=tuple(offset.tolist()),
            coulomb=tuple(coulomb.tolist()),
            residual=float(np.sqrt(noise.mean())),
            restlessness=restless or None,
            misfit=None if drift is None else drift.statistic,
            joint=0 if drift is None else drift.joint + 1,
            changed=drift is not None and drift.changed,
        )

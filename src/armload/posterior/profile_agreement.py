"""Whether the logs of a profile agree on what is mounted: each is weighed beside all others.

A log that holds a payload looks like an arm that is heavier on average, and every answer by the profile would be off by
its share. So each log k is taken for a run with something added, and what the others say of the arm for its tare,

    r_k = W·(phi_0 + phi) + Z·(eta + delta) + G·g + e,        sound where |m| ≤ 3 standard deviations

as `check_fits` asks of a log that is added later.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import IdentificationError
from armload.inertia import HELD, Z95
from armload.posterior.calibration import KAPPA_UNKNOWN
from armload.posterior.profile_session import without_drift
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.recording import Recording
from armload.regression import Correction, payload_prior_std
from armload.regression.information import RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH


class DisagreementError(IdentificationError):
    """A log of a profile carries what the others do not; `log`: its number among them."""

    def __init__(self, message: str, log: int) -> None:
        super().__init__(message)
        self.log = log

    def __reduce__(self) -> tuple[Any, ...]:  # a pool of processes hands errors over, and breaks where it cannot
        return type(self), (str(self), self.log)


def carried(
    correction: Correction,
    data: Sequence[RegressionData],
    scales: Scales,
    drift: NDArray[np.float64],
    repeated: float,
) -> NDArray[np.float64]:
    """Mass and its standard deviation (K, 2) [kg] of what each log carries beside what is mounted in the others.

    Where torque is motor current, variances are `KAPPA_UNKNOWN` times what the physics says.

    Args:
        data: of each log. scales: of the logs solved together, with the noise of each (K, n). drift: (d,) variance of a
            session's own. repeated: by how much the noise counts for more.
    """
    own = [
        without_drift(part.A / S[:, None, None], part.b / S[:, None], drift)
        for part, S in zip(data, scales.noise, strict=True)
    ]
    A, b = sum(A for A, _ in own), sum(b for _, b in own)
    noise, out = np.ones((1, correction.arm.n)), np.zeros((len(data), 2))
    overrated = KAPPA_UNKNOWN if correction.arm.motor_torque else 1.0
    session = Session(1, 1.0, tuple(np.sqrt(drift) / correction.daily_std))
    for k, (part, (A_k, b_k)) in enumerate(zip(data, own, strict=True)):
        others = RegressionData(correction, GAIN, part.features, SMOOTH.block)
        others.A, others.b, others.noise = (A - A_k) / repeated, (b - b_k) / repeated, noise[0]
        run = RegressionData.joined([part])
        run.session = session
        start = Scales(noise, scales.eta, scales.features, scales.payloads)
        found = solve([others, run], payload_prior_std(correction.arm), None, SMOOTH, 3, start)
        out[k] = found.phi[0], np.sqrt(overrated * found.covariance[0, 0])
    return out


def check_agree(logs: Sequence[Recording], masses: NDArray[np.float64]) -> None:
    """See that no log carries what the others do not; masses as of `carried`.

    Raises:
        DisagreementError: one does; the one that is farthest from the others is named.
    """
    mass, std = masses.T
    if not (np.abs(mass) > HELD * std).any():
        return
    k = int(np.argmax(np.abs(mass)))
    told = ", ".join(f"{log.source} {m:+.3g}" for log, m in zip(logs, mass, strict=True))
    raise DisagreementError(
        f"{logs[k].source} carries {mass[k]:+.3g} ± {Z95 * std[k]:.2g} kg beside what is mounted in the other logs "
        f"(each beside the others: {told} kg): a profile needs the same mounted in all of them; leave out the logs of "
        "a payload, or name a tool that was mounted with --tool",
        k,
    )

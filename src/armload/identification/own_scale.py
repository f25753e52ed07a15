"""How many times the torque of an arm's own links a log holds: told where the links are known well.

A torque that is s times as large as it should be, as in another unit, makes all links seem to weigh s times as much.
With l the links' inertial parameters and S what is known of their errors x (`Correction.prior_std`),

    x = (s − 1)·l + e,    e ~ N(0, S),

and with m, P the posterior of x for s = 1, of the log, its tare and all that is unknown besides,

    I = lᵀ·S⁻¹·(S − P)·S⁻¹·l,    s − 1 = lᵀ·S⁻¹·m / I,    variance 1/I.

The links' errors beside s may be larger than S says, as those of a real Panda are: then the variance is, too, by how
many times what is left of mᵀ·S⁻¹·m exceeds the number of link parameters that the log determines, tr(1 − P·S⁻¹).

Source: the score test (Rao 1948) of the linear Gaussian model; MacKay, Neural Computation 4, 1992 (determined ones).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armload.identification.last_equations import LastEquations
from armload.identification.thresholds import LINKS_ALIKE, OTHER_SCALE


class OwnScale(NamedTuple):
    """The torque that a log holds over that which the arm's own links need, and its standard deviation."""

    scale: float
    std: float

    @property
    def is_another(self) -> bool:
        """Whether it surely is not 1."""
        return abs(self.scale - 1.0) > OTHER_SCALE * float(np.hypot(self.std, LINKS_ALIKE))


def own_scale(last: LastEquations) -> OwnScale | None:
    """The scale of the torques of a run that has ended, and of its tare; None: torque is motor current, or tells none.

    Args:
        last: of the log.
    """
    found, problem, known = last
    arm = found.arm
    if found.posterior.gears or arm.motor_torque:
        return None
    std = found.stream.correction.prior_std[-10 * arm.n :]
    uncertain = std > 0.0
    links = np.arange(problem.eta.stop - 10 * arm.n, problem.eta.stop)[uncertain]
    m, P, S = known.mean[links], known.covariance[np.ix_(links, links)], std[uncertain] ** 2
    seen = np.diag(S) - P
    pull = arm.link_parameters.ravel()[uncertain] / S
    information = float(pull @ seen @ pull)
    if not information > 0.0:
        return None
    more = float(pull @ m) / information
    left, determined = m - more * seen @ pull, float(np.trace(seen / S))
    larger = max(1.0, float(left**2 @ (1.0 / S)) / max(determined - 1.0, 1.0))
    return OwnScale(1.0 + more, float(np.sqrt(larger / information)))

"""Whether an arm is as it was at its tare: the change of its offsets and friction since, and how surely it is one.

The run's rows have unknowns of their own, delta ~ N(0, D), by which offsets and friction differ from those at the tare
(`problem.Problem`). With P the posterior covariance of delta, and E the part of D that the tare's age explains,

    T = deltaᵀ·(P + E)⁻¹·delta

is small where nothing else has changed. It is large for a tare of another day, of another arm, or of another base.
With a profile, E is the drift of the arm's own sessions, and T is large where this one is not of their kind.

A joint that rubs more under load rubs more than at the tare by a share of what was added: that is no drift. A log of
which T is large is read once more with it (`identification.identify_log`). Of a stream, which is not, E has it, for
joints that lose `LINK_LOSS` of the torque that they bear, before its arm is called changed.

Motor currents cannot be asked: friction differs from run to run on a sound arm, too, by more than T allows (T = 1000 of
the real UR10e pair, though what its gears lose is an unknown). They are told by friction that only gears have
(`Posterior.gears`): an arm with much friction behind its gears, or more of it at the tare, is asked all the same.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.posterior.scales import Drift, Posterior
from armload.posterior.solve import solve
from armload.regression import Correction, GaussianPrior
from armload.regression.information import RegressionData, Session
from armload.regression.mismatch import LINK_LOSS
from armload.regression.noise import NoiseModel

# [daily deviations] that the test allows for: with a wider prior little else changes (`benchmarks/tare_drift.py`)
TESTED = 1.0
# [daily deviations] that an answer allows for once the arm has been found changed: about ten days', or a repair
ALLOWED = 3.0
# T above which an arm is not as it was at its tare: sound simulated logs stay below 20, arms beyond the measured ones,
# whose sensors drift, reach it seldom (`benchmarks/tare_drift.py`)
CHANGED = 60.0
# [s] within which a tare is of the same session: an arm that is warm changes little in an hour. A stated prior
SESSION = 3600.0
ASKED_FROM = 0.9  # [s] of a stream before it is asked, at the full solution after 1 s: the wrist has moved
STEPS = 2  # of expectation–maximisation from the scales of the solution that is tested


def drift_since_tare(
    runs: list[RegressionData],
    prior_std: NDArray[np.float64],
    prior: GaussianPrior | None,
    noise: NoiseModel,
    found: Posterior,
    read_once: bool = False,
    given: int = -1,
    steps: int = STEPS,
) -> Drift:
    """Test whether the last run's arm is that of its tare.

    Args:
        runs, prior_std, prior, noise: as of `solve`. found: their solution, for its scales.
        read_once: as of `drift_of`. given: the first run that is of the last one's session; those before are its tare.
        steps: of expectation–maximisation; with 1 the scales stay.
    """
    explained, own = runs[-1].session, [copy(run) for run in runs[given:]]
    if explained.drift < TESTED:  # else the solution itself has allowed for as much
        for run in own:
            run.session = replace(explained, number=1, drift=TESTED)
        found = solve([*runs[:given], *own], prior_std, prior, noise, steps, found.scales)
    return drift_of(found, runs[-1].correction, explained, read_once)


def drift_of(found: Posterior, correction: Correction, explained: Session, read_once: bool = False) -> Drift:
    """The test of a solution that has allowed for a drift.

    Args:
        explained: the session, with what its age explains. read_once: whether joints may rub more for what was added.
    """
    n, change = correction.arm.n, found.drift
    C = found.drift_covariance + np.diag(explained.variance(correction))
    own = [change[j::n] @ np.linalg.solve(C[j::n, j::n], change[j::n]) for j in range(n)]
    statistic = within = float(change @ np.linalg.solve(C, change))
    if read_once and not correction.loss_std:  # else it is an unknown of its own
        rubs = correction.coulomb(np.arange(len(change))).astype(int)
        C[rubs, rubs] += (LINK_LOSS * found.borne) ** 2
        within = float(change @ np.linalg.solve(C, change))
    return Drift(
        offset=correction.offset(change),
        coulomb=correction.coulomb(change),
        statistic=statistic,
        joint=int(np.argmax(own)),
        changed=within > CHANGED,
    )

"""How well logs are foretold by what others say of the arm: by which factor a log's noise counts for more.

What the features cannot say of an arm's mismatch repeats from log to log, so that many logs tell less than their noise
alone would have it. The factor is the one at which logs that are left out have the highest density,

    ln p(d_k | others, factor),    d_k the block means of log k, all together

A profile's logs are left out in turns as it is learned. A session that is added later is foretold by the profile before
it, and its density is added to those of the sessions added so far: the more logs there are, the more what repeats
counts. So a profile never believes more than foretells its next sessions.

Sources: Geisser & Eddy, JASA 1979 (predictive density of what is left out); Dawid, J. R. Stat. Soc. A 147, 1984 (of
what comes next, one after another).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.posterior.problem import Problem
from armload.posterior.profile import Profile
from armload.posterior.scales import Scales
from armload.regression import Correction, payload_prior_std
from armload.regression.information import RegressionData
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH
from armload.runtime.one_thread import one_thread

# by which factor the noise of a log may count for more, by steps that a density can tell apart
REPEATED = tuple(2.0**k for k in range(7))
_PREDICTED = 1.0  # [s] of a block that is predicted: residuals stay correlated for about as long
_MOST_BLOCKS = 64  # of a log: their covariance is a matrix


class Foreteller:
    """What some logs say of an arm, as it foretells others.

    Args:
        known: information on what sessions share, with its noise (`RegressionData.noise`).
        scales: of the smooth part and the mismatch. drift: (d,) variance of a session's own.
    """

    def __init__(self, known: RegressionData, scales: Scales, drift: NDArray[np.float64]) -> None:
        assert known.noise is not None
        problem = Problem([known], payload_prior_std(known.correction.arm), None, SMOOTH, same=True)
        self._drift, self._selection = drift, problem.selections[0]
        self._found = problem.posterior(replace(scales, noise=known.noise[None], drifts=np.zeros((0, 0))))

    def log_density(self, data: RegressionData, S: NDArray[np.float64]) -> float:
        """Of the block means of a log whose noise is S (n,), but for a constant."""
        found, E, drift, n = self._found, self._selection, self._drift, len(S)
        means, times = _blocks(data)
        total = 0.0
        for j in range(n):
            X, u = means[:, j, :-1], 10 + j + n * np.arange(len(drift) // n)
            e = means[:, j, -1] - X[:, : len(E)] @ (E @ found.mean) - X[:, len(E) :] @ found.weights[j]
            V = found.covariance_of(E, j, X) + (X[:, u] * drift[j::n]) @ X[:, u].T
            total += _log_density(e, V + np.diag(S[j] / times))
        return total


@one_thread()
def counting_repeats(known: Profile, correction: Correction, data: RegressionData, S: NDArray[np.float64]) -> Profile:
    """A profile whose noise counts for as much as foretells this session best, and those that were added before it.

    It counts for no less than before, as what was chosen rests on the logs that the profile was learned from, and for
    twice as much at most, so that no single session decides.

    Args:
        data: of a session that is to be added. S: (n,) its noise.
    """
    run, scales = known.data(correction, GAIN, SMOOTH.block), known.start(correction)
    densities = np.zeros(len(REPEATED))
    for i, repeated in enumerate(REPEATED):
        run.noise = np.full(known.n, repeated / known.repeated)
        densities[i] = Foreteller(run, scales, known.drift).log_density(data, S)
    foretold = densities - densities.max() + (0.0 if known.foretold is None else known.foretold)
    repeated = min(max(known.repeated, REPEATED[int(np.argmax(foretold))]), 2.0 * known.repeated)
    share = known.repeated / repeated
    return replace(known, A=share * known.A, b=share * known.b, repeated=repeated, foretold=foretold)


def _log_density(e: NDArray[np.float64], V: NDArray[np.float64]) -> float:
    """Of e under N(0, V), but for a constant."""
    L = np.linalg.cholesky(V)
    white = np.linalg.solve(L, e)
    return -0.5 * float(white @ white) - float(np.log(np.diag(L)).sum())


def _blocks(data: RegressionData) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Means (B, n, size + 1) and durations (B,) of blocks of `_PREDICTED` or longer, `_MOST_BLOCKS` at most."""
    means, times, _ = data.blocks.means()
    each = max(round(_PREDICTED / data.blocks.block), -(-len(times) // _MOST_BLOCKS), 1)
    each = min(each, len(times))
    whole = len(times) // each * each
    sums = (means[:whole] * times[:whole, None, None]).reshape(-1, each, *means.shape[1:]).sum(axis=1)
    total = times[:whole].reshape(-1, each).sum(axis=1)
    return sums / total[:, None, None], total

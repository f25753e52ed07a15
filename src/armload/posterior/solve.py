"""MAP least squares: payload and arm mismatch together, with an uncertainty that knows the residual is correlated.

    r = W·phi + Z·eta + G·g + e,   phi ~ N(0, P_phi), eta ~ N(0, P_eta), g_j ~ N(0, P_g), e_j of long-run variance S_j

r, W, Z, G come from the acceleration-free filtered regression (`regression.rows`); eta is what the arm's rigid-body
model gets wrong (`regression.mismatch`), g_j are the weights of joint j's smooth functions of pose and velocity
(`regression.features`).
The information A = Σ_j ∫ X_jᵀ·X_j dt / S_j with X = [W Z G] accumulates in constant memory; the posterior is
x = (A + P⁻¹)⁻¹·b, joint by joint with g_j eliminated first. S_j (batch means of the residual) and the scales of the
priors of offsets, friction and features (expectation–maximisation) are found from the data in a few iterations.

Tares enter the same model: they see phi_0 (whatever was mounted then) with the same eta and g, the later run sees
phi_0 + phi. Virtual calibration [Kurdas 2022] is the special case without eta and g.

Sources: information form and EM: Bishop 2006, ch. 3 and 9; arm and load together: Khalil, Gautier, Lemoine, ICRA 2007.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.posterior.problem import Problem
from armload.posterior.scales import AnotherArm, Drift, Posterior, Scales, Tilt
from armload.posterior.sequential import SequentialPosterior
from armload.regression import GaussianPrior
from armload.regression.information import RegressionData
from armload.regression.noise import RIGID, NoiseModel
from armload.runtime.one_thread import one_thread


@dataclass(eq=False)
class Solution:
    """The posterior of the accumulated rows, and the same as a state that takes further rows of the last run.

    another: whether the last run is of another arm than the first; None: not tested.
    drift: by how much the arm differs from what it was at its tare; None: not tested.
    tilt: by how much gravity is turned from what was given; None: not tested.
    restlessness: how restless the torques are, of what they were at the tare; 0 where that is not known.
    without_tare: whether it does without what the first run, the tare, says of the arm.
    """

    posterior: Posterior
    state: SequentialPosterior
    another: AnotherArm | None = None
    drift: Drift | None = None
    tilt: Tilt | None = None
    restlessness: float = 0.0
    without_tare: bool = False

    @property
    def finite(self) -> bool:
        """Whether it is of numbers."""
        return bool(np.isfinite(self.state.information.sum() + self.state.vector.sum()))

    @classmethod
    def of(cls, problem: Problem, scales: Scales) -> Solution:
        """Of a problem at some scales."""
        return cls(problem.answer(scales, problem.posterior(scales)), problem.sequential(scales))


def solve(
    runs: list[RegressionData],
    prior_std: NDArray[np.float64],
    prior: GaussianPrior | None = None,
    noise: NoiseModel = RIGID,
    iterations: int = 12,
    start: Scales | None = None,
) -> Posterior:
    """Posterior of the payload of the last run; runs before it are tares, all with the same mounted.

    Unknowns z = [phi_0, phi, eta], and g_j: tares carry phi_0, the last run phi_0 + phi. Each payload is
    near zero within `prior_std` (10,), a tare's moments also within `_REACH` of its mass; the last one follows `prior`
    where that is given. `start` holds scales found before, of the same runs or of all but the last; one step of
    expectation–maximisation fewer than `iterations` is made from there.
    """
    with one_thread():
        problem, scales = improved(runs, prior_std, prior, noise, iterations - 1, start)
        return problem.answer(scales, problem.posterior(scales))


def solve_to_go_on(
    runs: list[RegressionData],
    prior_std: NDArray[np.float64],
    prior: GaussianPrior | None,
    noise: NoiseModel,
    iterations: int,
    start: Scales | None,
) -> Solution:
    """The same, with the state that takes further rows. Arguments as of `solve`."""
    with one_thread():
        return Solution.of(*improved(runs, prior_std, prior, noise, iterations - 1, start))


def improved(
    runs: list[RegressionData],
    prior_std: NDArray[np.float64],
    prior: GaussianPrior | None,
    noise: NoiseModel,
    steps: int,
    start: Scales | None,
) -> tuple[Problem, Scales]:
    """The problem, and its scales after so many steps of expectation–maximisation. Arguments as of `solve`."""
    problem = Problem(runs, prior_std, prior, noise)
    scales = problem.scales(start)
    for _ in range(steps):
        scales = problem.improved(scales, problem.posterior(scales))
    return problem, scales

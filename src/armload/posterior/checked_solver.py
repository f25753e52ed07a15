"""What is asked of a run besides its payload: whether arm, gravity and what is held are as its model takes them for.

At every full solution of a stream, with that one's scales, and once more at the end, where the answer is then found
anew with what was noticed. A `Solution` holds what was asked of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armload.posterior import tilt
from armload.posterior.another_arm import FROM, another_arm, apart
from armload.posterior.drift import ALLOWED, ASKED_FROM, TESTED, drift_since_tare
from armload.posterior.restless import RESTLESS, restlessness
from armload.posterior.scales import Posterior, Scales
from armload.posterior.solve import Solution, improved, solve_to_go_on
from armload.regression import GaussianPrior
from armload.regression.information import RegressionData, Session
from armload.regression.noise import NoiseModel
from armload.runtime.one_thread import one_thread


@dataclass(frozen=True, eq=False)
class CheckedSolver:
    """Full solutions of a run, and what is asked of them.

    prior_std, prior, noise: as of `solve`. session: of the run.
    asks: whether anything is asked; a training's episodes are as stated.
    given: how many of the runs, the first ones, were recorded before the stream: its tare.
    read_once: whether nobody reads what looks wrong once more (`drift`): of a live stream.
    """

    prior_std: NDArray[np.float64]
    prior: GaussianPrior | None
    noise: NoiseModel
    session: Session
    asks: bool = True
    given: int = 0
    read_once: bool = False

    def solve(self, runs: list[RegressionData], start: Scales | None, iterations: int) -> Solution:
        """The solution of all runs, of which nothing is asked. Arguments as of `solve`."""
        return solve_to_go_on(runs, self.prior_std, self.prior, self.noise, iterations, start)

    def go_on(self, runs: list[RegressionData], start: Scales | None) -> Solution:
        """One step of expectation–maximisation from the scales of the last solution, and what a stream is asked."""
        about, times = (self.prior_std, self.prior, self.noise), [run.blocks.duration for run in runs]
        seconds, own = times[-1], sum(times[self.given :])
        with one_thread():
            problem, scales = improved(runs, *about, 1, start)
            out = Solution.of(problem, scales)
            shown = sum(times) >= tilt.ASKED_FROM if out.posterior.torque == "link" else seconds >= FROM
            if self.asks and shown:
                out.tilt = tilt.tilt_so_far(problem, scales)
        out.restlessness = self._restlessness(out.posterior, runs[-1])
        if not self.asks or out.posterior.gears:
            return out
        tared = self.given > 0 and runs[0].noise is None  # else by a profile, which waits: a push is no drift
        if (tared and own >= ASKED_FROM) or (out.posterior.drift.size and seconds >= FROM):
            drift = drift_since_tare(runs, *about, out.posterior, self.read_once, self.given, steps=1)
            out.drift = replace(drift, allowed=self.session.drift >= TESTED)
        if out.posterior.drift.size and seconds >= FROM:
            out.another = replace(another_arm(runs, *about, out.posterior), left_out=False)
        return out

    def conclude(self, runs: list[RegressionData], start: Scales | None, iterations: int) -> Solution:
        """The solution of all runs, with what is noticed of arm and tare. Arguments as of `solve`.

        A drift beyond what the session explains is allowed for, also by what is asked afterwards; the tare of another
        arm is done without, unless the run is restless without it, too: then no arm explains it, but a load that moves.
        """
        out, run, about = self.solve(runs, start, iterations), runs[-1], (self.prior_std, self.prior, self.noise)
        if self.asks and out.finite:
            if len(runs) > 1 and not out.posterior.gears:
                drift = drift_since_tare(runs, *about, out.posterior, self.read_once)
                if drift.changed:
                    run.session = replace(self.session, number=1, drift=max(ALLOWED, self.session.drift))
                    out = self.solve(runs, start, iterations)
                another = another_arm(runs, *about, out.posterior)
                if another.found:
                    alone = apart(runs, *about, iterations, out.posterior)
                    if self._restlessness(alone.posterior, run) <= RESTLESS:
                        out, runs = replace(alone, without_tare=True), runs[1:]
                    else:
                        another = None
                out.drift, out.another = drift, another
            out.tilt = tilt.tilt_of_base(runs, *about, out.posterior)
            run.session = self.session
        out.restlessness = self._restlessness(out.posterior, run)
        return out

    def _restlessness(self, found: Posterior, run: RegressionData) -> float:
        """0 where there is no tare to compare with, and of motor currents."""
        known = len(found.power) > 1 and found.torque == "link"
        return restlessness(found.power, self.noise.residual * run.correction.effort) if known else 0.0

"""The equations of a log's last solution, solved once more for what is asked of the arm beside the payload."""

from __future__ import annotations

from typing import NamedTuple

from armload.posterior import PosteriorLeastSquares
from armload.posterior.elimination import JointGaussian
from armload.posterior.problem import Problem
from armload.regression import payload_prior_std
from armload.runtime.one_thread import one_thread


class LastEquations(NamedTuple):
    """Of an identifier that has answered for a log.

    problem: of the tare and the run, with the weak prior of a payload. known: what they say at the last scales.
    """

    identifier: PosteriorLeastSquares
    problem: Problem
    known: JointGaussian

    @classmethod
    @one_thread()
    def of(cls, identifier: PosteriorLeastSquares) -> LastEquations:
        """The same, solved."""
        stream, std = identifier.stream, payload_prior_std(identifier.arm)
        problem = Problem([*stream.tares, stream.accumulated()], std, None, stream.noise)
        return cls(identifier, problem, problem.posterior(problem.scales(identifier.posterior.scales)))

"""Whether something is held, of a stream: while a payload changes nobody knows its mass, and nothing is dropped."""

import numpy as np
import pytest

from armload import RecursiveLeastSquares, arm
from armload.estimators import Estimate
from armload.online.judgement import Judgement


@pytest.fixture
def judged():
    """Whether something is held after masses ± standard deviations [kg], one after the other."""
    panda = arm("panda")
    judgement, run = Judgement(panda, None, tared=False), RecursiveLeastSquares(panda)

    def after(*masses, concluded=False):
        out = []
        for mass, std in masses:
            estimate = Estimate(1.0, mass * np.eye(10)[0], np.diag(np.full(10, std**2)), 1, "panda_link8")
            judgement.judge(estimate, run, "nothing", moving=True, stands=False)
            out.append(judgement.held)
        if concluded:
            judgement.conclude(estimate, run, "nothing", 1.0)
            out.append(judgement.held)
        return out

    return after


def test_what_is_held_is_held_until_nothing_is_much_likelier(judged):
    assert judged((0.48, 0.01), (1.0, 0.5), (1.4, 0.31), (1.7, 0.05)) == [True] * 4  # one payload for another
    assert judged((0.26, 0.09), (0.26, 0.005), (0.11, 0.057), (0.05, 0.04)) == [True, True, True, False]  # put down


def test_nothing_is_held_before_it_is_sure(judged):
    assert judged((0.25, 0.1), (0.29, 0.1), (0.31, 0.1), (0.29, 0.1)) == [False, False, True, True]


def test_at_its_end_a_stream_holds_what_a_log_would(judged):
    assert judged((0.26, 0.005), (0.1, 0.04), concluded=True) == [True, True, False]

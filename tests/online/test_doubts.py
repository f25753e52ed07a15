"""What a stream's runs have found against its error bars, and for how long it holds."""

from types import SimpleNamespace

import pytest

from armload import arm
from armload.online.doubts import Doubts


def looked(doubts, run, *told):
    """Whether the payload is said to move on its own after each of (seconds, restlessness) of a run's solutions."""
    out = []
    for seconds, restlessness in told:
        run.stream.seconds, run.stream.restlessness = seconds, restlessness
        run.stream.solutions += 1
        doubts.look(run, "tare")
        out.append(any("restless" in sentence for sentence in doubts.sentences))
    return out


@pytest.fixture
def run():
    return new_run()


def new_run():
    stream = SimpleNamespace(
        solutions=0,
        posterior=SimpleNamespace(torque="link", gears=()),
        another=None,
        drift=None,
        tilt=None,
    )
    return SimpleNamespace(stream=stream, profile=None)


@pytest.fixture
def doubts():
    return Doubts(arm("panda"))


def test_a_run_of_many_minutes_is_not_said_to_swing_as_it_gets_more_restless(doubts, run):
    """Its arm has been in more poses than its smooth mismatch has features: a rigid payload seems to move."""
    assert looked(doubts, run, (20.0, 1.1), (160.0, 1.1), (480.0, 1.8), (600.0, 2.2), (1200.0, 2.7)) == 5 * [False]


def test_what_swings_is_said_to_as_long_as_it_shows(doubts, run):
    assert looked(doubts, run, (0.5, 3.0), (2.0, 3.0), (50.0, 2.5), (600.0, 2.5)) == [False, True, True, True]
    assert looked(doubts, run, (620.0, 1.9), (1200.0, 2.7)) == [False, False]


def test_another_run_is_asked_anew_whether_its_payload_swings(doubts, run):
    assert looked(doubts, run, (300.0, 1.5), (320.0, 2.5)) == [False, False]
    assert looked(doubts, new_run(), (2.0, 2.5)) == [True]
    assert looked(doubts, run, (321.0, 2.5)) == [True]  # it goes on: what it holds now may swing

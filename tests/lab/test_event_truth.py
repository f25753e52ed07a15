"""What counts as a changed payload where the reliability of a stream's probabilities is counted."""

import importlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
PHI = np.array([1.0, 0.0, 0.0, 0.05, *(6 * [0.01])])
MOMENTS = np.round(np.arange(0.0, 30.0, 0.1), 1)  # [s]


@pytest.fixture
def truth(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module("event_truth")


@pytest.fixture
def scenes(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module("event_scenes")


@dataclass
class Told:
    """A stream by hand: what is held becomes `kg` of PHI within `seconds` from `start`, and events as they are said.

    changes: (start, seconds, kg). events: (noticed, settled, kind of return, from when it is said).
    """

    changes: list = field(default_factory=list)
    events: list = field(default_factory=list)
    pushes: list = field(default_factory=list)
    p_change: float = 0.0

    def made(self, truth, scenes):
        changes = [scenes.Change(start, seconds, kg * PHI) for start, seconds, kg in self.changes]
        stream = scenes.Stream(None, None, changes, [True] * len(changes), self.pushes)
        said = np.zeros((len(MOMENTS), 11))
        said[:, truth.T], said[:, truth.CHANGE], said[:, truth.CONTACT] = MOMENTS, self.p_change, 0.95
        for noticed, settled, kind, known in self.events:
            said[noticed <= MOMENTS, truth.SINCE] = noticed
            said[noticed <= MOMENTS, truth.RETURN] = 0.0
            said[known <= MOMENTS, truth.RETURN] = kind
            said[(noticed <= MOMENTS) & (settled > MOMENTS), truth.SETTLING] = 1.0
        return stream, said, stream.held(MOMENTS)

    def changed(self, truth, scenes):
        """The moments [s] that count as changed."""
        made = self.made(truth, scenes)
        counts = [truth.reliability_of(*made, np.array([k]))["p_change"] for k in range(len(MOMENTS))]
        return MOMENTS[[sum(x[2] for x in of_one) == 1 for of_one in counts]].tolist()


def between(*times):
    """The moments of [a, b) for each pair of times [s]."""
    return [t for a, b in zip(times[::2], times[1::2], strict=True) for t in MOMENTS[(a <= MOMENTS) & (b > MOMENTS)]]


def test_nothing_has_changed_where_nothing_changes_whatever_is_said(truth, scenes):
    assert Told().changed(truth, scenes) == []
    assert Told(events=[(8.0, 9.0, 0, 99.0), (12.0, 12.5, truth.AS_BEFORE, 12.5)]).changed(truth, scenes) == []


def test_a_change_counts_until_a_run_begins_with_the_new_payload(truth, scenes):
    step = [(5.0, 0.0, 1.0)]
    assert Told(step).changed(truth, scenes) == between(5.0, 30.0)
    assert Told(step, [(5.2, 6.0, 0, 99.0)]).changed(truth, scenes) == between(5.0, 6.0)
    # settled between two looks
    assert Told(step, [(5.2, 5.2, 0, 99.0)]).changed(truth, scenes) == between(5.0, 5.2)


def test_a_change_that_is_called_off_goes_on_to_count(truth, scenes):
    off = (5.2, 5.6, truth.AS_BEFORE, 5.6)
    assert Told([(5.0, 0.0, 1.0)], [off]).changed(truth, scenes) == between(5.0, 30.0)
    assert Told([(5.0, 0.0, 1.0)], [off, (9.0, 9.5, 0, 99.0)]).changed(truth, scenes) == between(5.0, 9.5)


def test_what_is_taken_up_again_and_recognised_again_and_again_is_no_change(truth, scenes):
    starts = (5.0, 10.0, 15.0, 20.0, 25.0)
    changes = [(t, 0.0, float(k % 2 == 0)) for k, t in enumerate(starts)]
    events = [(t + 0.2, t + 0.5, truth.TAKEN_UP if k else 0, t + 1.0) for k, t in enumerate(starts)]
    ends = [x for t in starts for x in (t, t + 0.5)]
    assert Told(changes, events).changed(truth, scenes) == between(*ends)
    # a run of another payload that gives way to one before is wrong from then on
    other = [*changes[:1], (10.0, 0.0, 0.5)]
    assert Told(other, events[:2]).changed(truth, scenes) == between(5.0, 5.5, 10.0, 10.5, 11.0, 30.0)


def test_a_hand_over_counts_as_long_as_it_lasts_and_after_it_if_its_run_began_before_its_end(truth, scenes):
    slow = [(5.0, 4.0, 0.4)]
    assert Told(slow, [(6.0, 10.0, 0, 99.0)]).changed(truth, scenes) == between(5.0, 10.0)
    assert Told(slow, [(6.0, 7.0, 0, 99.0)]).changed(truth, scenes) == between(5.0, 30.0)
    # 10 g are not felt, whenever they come
    assert Told(slow, [(6.0, 8.9, 0, 99.0)]).changed(truth, scenes) == between(5.0, 9.1)
    assert Told([(5.0, 0.0, 0.01)]).changed(truth, scenes) == between(5.0, 5.1)


def test_moments_are_counted_in_the_bin_of_what_was_called(truth, scenes):
    push = scenes.Push(10.05, 20.05, "panda_link8", np.ones(3))
    made = Told([(5.0, 0.0, 1.0)], pushes=[push], p_change=0.05).made(truth, scenes)
    said = truth.reliability_of(*made, np.arange(len(MOMENTS)))
    assert [x[0] for x in said["p_change"]] == [0, 300, 0, 0, 0, 0, 0]
    assert said["p_change"][1] == (300, pytest.approx(15.0), 250)
    n, _, so = said["p_contact"][5]  # 8.05 to 12.05 s and 17.85 to 22.25 s are its edges
    assert so == len(between(12.05, 17.85))
    assert n - so == len(between(0.0, 8.05, 22.25, 30.0))
    assert said["p_held"][0][::2] == (300, 249)  # at 5 s it is about to be


def test_turns_of_held_are_counted_beside_those_that_should_be(truth):
    true = np.array([False, True, True, False, False])
    said = np.array([False, False, True, True, False])
    found = truth.turns_of_held(4, said, true, np.arange(1, 5))
    assert found == {"turned": 4, "should": 2, "wrong": 2, "moments": 4}
    assert truth.turns_of_held(1, ~said, np.full(5, True), np.arange(5))["should"] == 1  # held from the start

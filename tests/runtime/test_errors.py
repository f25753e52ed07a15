"""Errors reach whoever asked, from any process."""

import pickle

import pytest

from armload import errors
from armload.posterior.profile_agreement import DisagreementError

CLASSES = [one for one in vars(errors).values() if isinstance(one, type) and issubclass(one, errors.ArmloadError)]
MORE = {errors.EpisodesError: (3, 5), DisagreementError: 2}  # what they are made with besides a message


@pytest.mark.parametrize("kind", [*CLASSES, DisagreementError])
def test_an_error_of_another_process_arrives_as_it_was(kind):
    made = kind("what was found", MORE[kind]) if kind in MORE else kind("what was found")
    arrived = pickle.loads(pickle.dumps(made))
    assert (type(arrived), str(arrived), vars(arrived)) == (kind, str(made), vars(made))

"""Errors reach whoever asked, from any process."""

import pickle

import pytest

from armload import errors

CLASSES = [one for one in vars(errors).values() if isinstance(one, type) and issubclass(one, errors.ArmloadError)]


@pytest.mark.parametrize("kind", CLASSES)
def test_an_error_of_another_process_arrives_as_it_was(kind):
    made = kind("two episodes", (3, 5)) if kind is errors.EpisodesError else kind("what was found")
    arrived = pickle.loads(pickle.dumps(made))
    assert (type(arrived), str(arrived), vars(arrived)) == (kind, str(made), vars(made))

"""Where a simulated arm stands, of which nobody says it."""

import numpy as np
import pytest

from armload.arms import ARMS, arm
from armload.errors import MotionError
from armload.excitation import Constraints, Surroundings
from armload.excitation.start import pose_to_begin_at


@pytest.mark.parametrize("name", ARMS)
def test_every_built_in_arm_has_a_pose_to_begin_a_motion_at_with_its_rated_payload_above_the_floor(name):
    known = arm(name)

    def allowed(pose):
        return Constraints(known, pose, surroundings=Surroundings(known, floor=0.0))

    pose = pose_to_begin_at(known, allowed, 0.0)
    allowed(pose)  # it does not refuse the start
    assert np.all(pose >= known.limits.position_low)
    assert np.all(pose <= known.limits.position_high)


def test_an_arm_that_may_begin_in_the_middle_of_its_joints_stands_there():
    panda = arm("panda")
    pose = pose_to_begin_at(panda, lambda pose: Constraints(panda, pose), 0.0)
    np.testing.assert_array_equal(pose, panda.limits.middle)


def test_an_arm_without_a_pose_to_begin_at_stands_in_the_middle():
    def refused(_):
        raise MotionError("a wall all around")

    panda = arm("panda")
    np.testing.assert_array_equal(pose_to_begin_at(panda, refused, 0.0), panda.limits.middle)

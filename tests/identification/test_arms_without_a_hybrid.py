"""A built-in arm for which no hybrid is shipped: motion, simulation and answer work by its name alone."""

import pytest

from armload.arms import ARMS, arm
from armload.errors import ArmloadError
from armload.identification import identify
from armload.motion import check_motion, excitation, random_motion, rated_load
from armload.payloads import draw_payload
from armload.posterior.model_file import SHIPPED
from armload.simulation import Sensors, World, simulate

# one of each family: motor currents with six and seven joints, torque sensors of two makes
WITHOUT = ("gen3", "iiwa14", "ur5", "xarm7")


def test_hybrids_are_shipped_for_arms_of_the_catalogue_and_for_none_of_these():
    assert set(SHIPPED) <= set(ARMS)
    assert not set(SHIPPED) & set(WITHOUT)


@pytest.mark.parametrize("name", WITHOUT)
def test_its_physics_answers_with_approximate_intervals_that_hold_the_mass(name):
    robot = arm(name)
    how = {"world": World.real_like(robot, 0), "sensors": Sensors.of(robot), "rate": 250.0}
    payload = draw_payload("boxes", 1, rated=robot.rated_payload).parameters
    motion = excitation(robot)
    assert check_motion(robot, motion, rated_load(robot)).ok
    answer = identify(
        simulate(robot, motion, payload, seed=1, **how),
        robot,
        tare=simulate(robot, random_motion(robot, 10), seed=2, **how),
    )
    assert (answer.robot, answer.frame, answer.method) == (name, robot.frame, "map-gp")
    assert (answer.interval, answer.consistent, answer.held) == ("approximate", True, True)
    assert answer.phi_low[0] < payload.mass < answer.phi_high[0]
    assert answer.phi_high[0] - answer.phi_low[0] < 0.3 * payload.mass


def test_a_hybrid_that_is_asked_for_by_name_is_refused_with_what_there_is():
    robot = arm("iiwa14")
    log = simulate(robot, excitation(robot), rate=250.0)
    with pytest.raises(ArmloadError, match=r"iiwa14.*train"):
        identify(log, robot, method="hybrid")

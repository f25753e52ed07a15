"""A built-in arm whose links are nominal, with a hybrid or without: motion, simulation and answer work by its name."""

import re

import pytest

from armload.arms import ARMS, arm
from armload.errors import ArmloadError
from armload.identification import identify
from armload.motion import check_motion, excitation, random_motion, rated_load
from armload.payloads import draw_payload
from armload.posterior import shipped_model
from armload.posterior.model_file import SHIPPED
from armload.simulation import Sensors, World, simulate

# one of each family: motor currents with six and seven joints, torque sensors of two makes
NOMINAL = ("gen3", "iiwa14", "ur5", "xarm7")


@pytest.mark.parametrize("name", ["gen3", *(pytest.param(name, marks=pytest.mark.full) for name in NOMINAL[1:])])
def test_it_is_answered_with_intervals_that_hold_the_mass_and_are_calibrated_where_a_hybrid_is_shipped(name):
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
    assert (answer.robot, answer.frame, answer.method) == (name, robot.frame, "hybrid")
    interval = "calibrated" if shipped_model(robot).calibrated else "approximate"
    assert (answer.interval, answer.consistent, answer.held) == (interval, True, True)
    assert answer.phi_low[0] < payload.mass < answer.phi_high[0]
    assert answer.phi_high[0] - answer.phi_low[0] < 0.3 * payload.mass


def test_every_built_in_arm_has_a_hybrid():
    assert set(SHIPPED) == set(ARMS)


def test_a_hybrid_that_is_asked_for_by_name_is_refused_with_what_there_is(tmp_path):
    heavier = re.sub(r'mass value="([\d.e+-]+)"', lambda m: f'mass value="{1.01 * float(m[1])}"', arm("xarm7").urdf)
    (tmp_path / "stranger.urdf").write_text(heavier)
    robot = arm(tmp_path / "stranger.urdf", "link_eef")
    log = simulate(robot, excitation(arm("xarm7")), rate=250.0)
    with pytest.raises(ArmloadError, match=r"no hybrid is shipped.*train"):
        identify(log, robot, method="hybrid")


def test_of_a_link_without_mass_it_is_said_that_its_weight_counts_as_payload(tmp_path):
    sound = arm("ur5e")
    urdf = re.sub(r'(<link name="forearm_link">)\s*<inertial>.*?</inertial>', r"\1", sound.urdf, flags=re.DOTALL)
    (tmp_path / "gap.urdf").write_text(urdf)
    robot = arm(tmp_path / "gap.urdf", "tool0")
    log, tare = (simulate(sound, random_motion(sound, seed), rate=100.0, seed=seed) for seed in (1, 2))
    said = "gives no mass to what elbow_joint moves: what that weighs counts as payload"
    for answer, notes in ((identify(log, robot), 1), (identify(log, robot, tare=tare), 0), (identify(log, sound), 0)):
        assert sum(said in note for note in answer.notes) == notes

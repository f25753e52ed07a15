"""A known weight on an arm with a profile tells how far its torque sensors are off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm, identify
from armload.errors import IdentificationError
from armload.inertia import InertialParameters
from armload.lab.episodes.motion_kinds import MotionSource
from armload.payloads import draw_payload
from armload.posterior import learn_profile, load_profile, save_profile, with_known_weight
from armload.posterior.torque_gain import common_gain
from armload.simulation import Run, Sensors, World, simulate_many
from armload.simulation.resolution import COARSE

GAIN = np.array([1.03, 1.03, 0.98, 1.04, 1.02, 0.97, 1.0])
WEIGHT = InertialParameters.from_com(2.0, (0.0, 0.0, 0.08), np.diag([4e-3, 4e-3, 2e-3]))  # [kg, m, kg·m²]
PAYLOAD = draw_payload("boxes", 4, 2.4)


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def logs(panda):
    """Four empty logs, one of the weight and one of a payload, of an arm whose sensors are off."""
    world, source, rng = (
        replace(World.real_like(panda, 8), gain=GAIN),
        MotionSource(panda, 0.0),
        np.random.default_rng(2),
    )
    first = source.draw("long", rng, 10.0, "first")
    around = source.centre(first)
    motions = [first, *(source.draw("long", rng, 10.0, f"{k}", around, 0.3) for k in range(5))]
    held = [None] * 4 + [WEIGHT, InertialParameters(PAYLOAD.parameters.phi)]
    runs = [
        Run(motion, body, world, Sensors.panda(panda), k)
        for k, (motion, body) in enumerate(zip(motions, held, strict=True))
    ]
    return simulate_many(panda, runs, rate=100.0, duration=10.0, workers=1, resolution=COARSE)


@pytest.fixture(scope="module")
def profile(panda, logs):
    return learn_profile(panda, logs[:4], sessions=[0] * 4)


@pytest.fixture(scope="module")
def weighed(panda, logs, profile):
    return with_known_weight(profile, panda, logs[4], 2.0, 0.002)


@pytest.mark.full  # some seconds
def test_the_gains_of_the_joints_that_carry_the_weight_are_found(weighed):
    assert weighed.gain[1] == pytest.approx(GAIN[1] - 1.0, abs=0.03)  # joints 2 and 4 bear most of it
    assert weighed.gain[3] == pytest.approx(GAIN[3] - 1.0, abs=0.015)
    assert 1e-3 <= weighed.gain_std < 0.03


@pytest.mark.full
def test_the_gain_of_each_joint_has_an_interval_that_holds_and_is_wide_where_the_weight_is_not_felt(weighed):
    std = weighed.gain_joint_std
    assert np.all(np.abs(weighed.gain - (GAIN - 1.0)) < 3.0 * std)
    prior = 6.0 * 0.005  # of a joint sensor that may be far off
    assert std.max() <= prior
    assert std[3] < 0.5 * std[6]  # the elbow bears the weight, the flange's axis hardly


@pytest.mark.full
def test_another_payload_is_then_found_in_its_own_mass(panda, logs, profile, weighed, tmp_path):
    without, with_ = (identify(logs[5], panda, profile=known) for known in (profile, weighed))
    truth = PAYLOAD.parameters.mass
    assert abs(with_.mass - truth) < 0.6 * abs(without.mass - truth)
    assert with_.phi_low[0] <= truth <= with_.phi_high[0]
    assert without.torque_gain_std == 0.005
    assert with_.torque_gain_std == pytest.approx(weighed.gain_std)
    read = load_profile(save_profile(weighed, tmp_path / "weighed.profile"))
    np.testing.assert_allclose(read.gain, weighed.gain)
    np.testing.assert_allclose(read.gain_joint_std, weighed.gain_joint_std)
    assert identify(logs[5], panda, profile=read).mass == pytest.approx(with_.mass, abs=1e-4)


@pytest.mark.full
@pytest.mark.parametrize(("mass", "std"), [(0.0, 0.1), (-1.0, 0.1), (np.nan, 0.1), (2.0, -1.0), (5.0, 0.002)])
def test_a_weight_that_is_none_or_that_the_log_does_not_bear_is_refused(panda, logs, profile, mass, std):
    with pytest.raises(IdentificationError, match="weight"):
        with_known_weight(profile, panda, logs[4], mass, std)


@pytest.mark.full  # some seconds
def test_a_weight_by_which_all_joints_are_off_alike_is_to_be_weighed_again(weighed):
    """Joints' sensors are off by some per cent, and not all by the same: 9 % of all is the weight's."""
    assert common_gain(weighed) is None
    n = len(GAIN)
    assert common_gain(replace(weighed, gain=np.full(n, -0.09), gain_joint_std=np.full(n, 0.01))) == pytest.approx(
        -0.09
    )
    assert common_gain(replace(weighed, gain=None)) is None


@pytest.mark.full  # some seconds
@pytest.mark.parametrize("said", [1.5, 0.6])
def test_a_weight_that_is_far_from_what_was_said_is_refused_on_motor_currents_too(said):
    """A joint's constant may be off by 12 % (1 sigma), those of all joints alike are not."""
    robot = arm("ur10e")
    world, source, rng = World.real_like(robot, 8), MotionSource(robot, 0.0), np.random.default_rng(2)
    motions = [source.draw("long", rng, 10.0, f"{k}") for k in range(4)]
    held = InertialParameters.from_com(6.0, (0.0, 0.0, 0.08), np.diag([2e-2, 2e-2, 1e-2]))
    runs = [Run(motion, held if k == 3 else None, world, Sensors.of(robot), k) for k, motion in enumerate(motions)]
    logs = simulate_many(robot, runs, rate=100.0, duration=10.0, workers=1, resolution=COARSE)
    known = learn_profile(robot, logs[:3], sessions=[0] * 3)
    assert common_gain(with_known_weight(known, robot, logs[3], 6.0, 0.002)) is None
    with pytest.raises(IdentificationError, match="expected the weight of"):
        with_known_weight(known, robot, logs[3], 6.0 * said, 0.002)

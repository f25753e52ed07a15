"""What a bound comes to: the torque's own calibration, the side it is measured on, and what was known before."""

import numpy as np
import pytest

from armload.arms import arm
from armload.errors import MotionError
from armload.excitation import Accuracy, Constraints, Criterion, PayloadRange, design_until
from armload.excitation.promise import of_gain, promised

READY = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
POSE_OF_MOTORS = np.array([0.0, -1.57, 1.57, -1.57, -1.57, 0.0])
LITTLE = np.full(10, 1e-9)


@pytest.mark.parametrize(("name", "share"), [("panda", 0.005), ("ur10e", np.sqrt(0.02**2 + 0.02**2 + 0.017**2))])
def test_no_motion_promises_a_mass_better_than_the_torque_is_calibrated(name, share):
    criterion, payload = Criterion(arm(name)), PayloadRange(2.0)
    found = promised(criterion, LITTLE, payload)
    assert found[0] == pytest.approx(1.959964 * share * 2.0, rel=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(20):  # any payload of the range, at any share of its mass
        phi = payload.payload(rng.uniform(), rng.uniform(-1.0, 1.0, 3)).phi
        assert np.all(1.959964 * share * np.abs(phi) <= found * (1.0 + 1e-9))


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_what_a_load_leaves_unknown_is_in_proportion_to_it_and_the_same_wherever_its_centre_is(name):
    criterion = Criterion(arm(name))
    light, heavy = (of_gain(criterion, PayloadRange(mass, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))) for mass in (1.0, 3.0))
    np.testing.assert_allclose(heavy, 3.0 * light)
    # joints whose gains differ leave a moment of a payload that has none: the mass times a lever, and its square
    lever = light[1] / light[0]
    np.testing.assert_allclose(light / light[0], np.repeat([1.0, lever, lever**2], [1, 3, 6]))
    assert lever > 0.1


def test_nothing_held_leaves_nothing_to_the_gain():
    assert not of_gain(Criterion(arm("panda")), PayloadRange(0.0)).any()


def test_motor_currents_promise_less_than_torque_sensors_do_for_the_same_bound():
    width, nothing = np.full(10, 1e-3), PayloadRange(0.0)
    motor, link = (promised(Criterion(arm(name)), width, nothing) for name in ("ur10e", "panda"))
    assert np.all(motor > 3.0 * link)


def test_no_promise_is_wider_than_what_was_known_before():
    criterion = Criterion(arm("ur10e"))
    before = criterion.prior_half_width
    np.testing.assert_allclose(promised(criterion, before, PayloadRange(0.0)), before)


def test_what_the_gain_alone_does_not_allow_is_refused_and_a_lighter_payload_named():
    panda = arm("panda")
    keep = Constraints(panda, READY, share=0.7, payload=PayloadRange(3.0))
    with pytest.raises(MotionError, match=r"calibrated to 0.5 % .*leaves 2.94 times .*less than 1 kg would do"):
        design_until(keep, Criterion(panda), Accuracy(mass=0.01))
    arm_with_motors = arm("ur10e")
    keep = Constraints(arm_with_motors, POSE_OF_MOTORS, share=0.9, payload=PayloadRange(3.0))
    with pytest.raises(
        MotionError,
        match=r"calibrated to 2 % in all and by joint, and gears keep 1.7 % of a load to themselves \(1 sigma\)",
    ):
        design_until(keep, Criterion(arm_with_motors), Accuracy(mass=0.01))

"""Arms that are far larger or stronger than the built-in ones, or whose files say so: everything is in proportion."""

from dataclasses import replace

import numpy as np
import pytest

from armload.arms import Arm, arm, rated_effort, rated_mass
from armload.identification import identify
from armload.inertia import InertialParameters
from armload.motion import random_motion
from armload.online import OnlineIdentifier
from armload.regression.prior import payload_size
from armload.simulation import simulate

LINKS = [900.0, 700.0, 500.0, 220.0, 120.0, 60.0]  # [kg]
EFFORTS = [30e3, 36e3, 22e3, 9e3, 8e3, 5e3]  # [N·m]
AXES = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
PLACES = ["0 0 0.5", "0.2 0 0.3", "0 0 1.5", "0.9 0 0.2", "0.7 0 0", "0.2 0 0"]  # [m]
CENTRES = [(0.0, 0.0, 0.2), (0.0, 0.0, 0.8), (0.6, 0.0, 0.1), (0.3, 0.0, 0.0), (0.1, 0.0, 0.0), (0.03, 0.0, 0.0)]  # [m]


def palletiser(efforts=EFFORTS):
    """An arm of six joints, a reach of 3 m and some 250 kg of payload."""
    text = '<robot name="palletiser"><link name="link0"/>'
    for k, (mass, effort, axis, place, centre) in enumerate(zip(LINKS, efforts, AXES, PLACES, CENTRES, strict=True)):
        inertia = " ".join(f'{name}="{0.05 * mass}"' for name in ("ixx", "iyy", "izz")) + ' ixy="0" ixz="0" iyz="0"'
        com = " ".join(map(str, centre))
        text += f"""<link name="link{k + 1}"><inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia {inertia}/>
            </inertial></link><joint name="joint{k + 1}" type="revolute"><parent link="link{k}"/>
            <child link="link{k + 1}"/><origin xyz="{place}"/><axis xyz="{axis}"/>
            <limit lower="-1.5" upper="1.5" effort="{effort}" velocity="1.6"/></joint>"""
    text += """<link name="tool0"/><joint name="flange" type="fixed"><parent link="link6"/><child link="tool0"/>
        <origin xyz="0.1 0 0"/></joint></robot>"""
    return Arm("palletiser", text, "tool0")


def crate(mass):
    """A body of a mass [kg], of half a metre, gripped at its side."""
    return InertialParameters.from_com(mass, (0.45, 0.05, 0.1), mass * np.diag([0.03, 0.03, 0.03]))


@pytest.mark.parametrize("mass", [200.0, 350.0, 500.0])
def test_what_a_heavy_arm_does_not_determine_lies_within_what_was_known_before(mass):
    heavy = palletiser()
    body = crate(mass)
    log = simulate(heavy, random_motion(heavy, seed=1, duration=3.0), body, rate=100.0)
    found = identify(log, heavy)
    assert not found.determined[7]  # Iyy
    assert np.all((found.phi_low <= body.phi) & (body.phi <= found.phi_high))


def test_what_an_arm_holds_grows_by_the_cube_root_of_its_mass_beyond_the_built_in_arms():
    heavy = replace(palletiser(), rated_payload=160.0)
    assert payload_size(heavy) == pytest.approx(2.0)
    assert payload_size(arm("ur20")) == payload_size(arm("panda")) == 1.0


@pytest.mark.parametrize("absurd", [1e9, 1e7])
def test_an_effort_limit_that_no_arm_has_counts_as_none(absurd):
    none, sound = palletiser(["0"] * 6), palletiser()
    np.testing.assert_array_equal(rated_effort(palletiser([absurd] * 6)), rated_effort(none))
    np.testing.assert_array_equal(rated_effort(sound), EFFORTS)
    assert rated_mass(palletiser([absurd] * 6)) == rated_mass(none) < 4.0 * rated_mass(sound)


def test_a_strong_arm_without_limits_has_its_samples_listened_to():
    heavy = palletiser(["0"] * 6)
    q = np.array([0.0, 1.5, 0.0, 0.0, 0.0, 0.0])
    torque = heavy.with_payload(crate(500.0)).torque(q)
    assert np.abs(torque).max() > 2e4
    stream = OnlineIdentifier(heavy, method="map")
    stream.update(0.0, q, np.zeros(6), torque)
    assert stream.health.used == 1
    stream.update(0.01, q, np.zeros(6), 1e3 * torque)
    assert stream.health.left_out["implausible"] == 1
    stream.close()

"""Torques that are not in N·m, or of a sensor that is far off, are told by what the arm's own links need."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload import arm, identify
from armload.identification.last_equations import LastEquations
from armload.identification.own_scale import own_scale
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.motion import random_motion
from armload.payloads import test_payload as box_of_the_examples
from armload.posterior import HybridIdentifier, learn_profile
from armload.recording import Recording, read_recording
from armload.simulation import Sensors, World, simulate

POUND_FEET = 1.0 / 1.3558179483314004  # [lbf·ft/(N·m)]


def recorded(name: str, seed: int) -> tuple[Recording, Recording]:
    """The log of an arm that holds the box, and its tare."""
    robot = arm(name)
    about = {"world": World.real_like(robot, seed), "sensors": Sensors.of(robot), "rate": 100.0}
    held = box_of_the_examples()
    log = simulate(robot, random_motion(robot, seed, duration=6.0), held, seed=1, **about)
    return log, simulate(robot, random_motion(robot, seed + 50, duration=6.0), seed=2, **about)


def told(name: str, log: Recording, tare: Recording | None = None):
    """The scale that the arm's own links tell."""
    identifier = HybridIdentifier(arm(name), tare)
    identifier.run(log)
    return own_scale(LastEquations.of(identifier))


def times(log: Recording, factor: float) -> Recording:
    return replace(log, tau=factor * log.tau)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("panda", POUND_FEET),
        ("fr3", 1.3),
        pytest.param("panda", 1.3, marks=pytest.mark.full),
        pytest.param("fr3", POUND_FEET, marks=pytest.mark.full),
    ],
)
def test_torques_in_another_unit_are_told_by_the_links_that_they_carry(name, factor):
    log, tare = (times(one, factor) for one in recorded(name, 700))
    for before in (None, tare):
        answer = identify(log, name, tare=before)
        assert answer.interval == "approximate"
        assert any(note.startswith(f"the torques are {factor:.1f}") for note in answer.notes)
        assert all(part.answer.interval == "approximate" for part in answer.segments)


@pytest.mark.parametrize("name", ["panda", "fr3", "iiwa7", "gen3"])
def test_the_scale_that_links_tell_is_that_of_the_torques_within_its_error(name):
    log, tare = recorded(name, 701)
    one = told(name, log, tare)
    assert one is not None
    assert not one.is_another
    assert abs(one.scale - 1.0) < 3.0 * one.std
    twelve_percent = told(name, times(log, 1.12), times(tare, 1.12))
    assert twelve_percent is not None
    assert twelve_percent.scale / one.scale == pytest.approx(1.12, abs=0.02)


def test_the_scale_of_a_sound_arm_is_no_doubt():
    """One whose links make it 1.06, by four of its standard deviations."""
    panda = arm("panda")
    log = list(simulate_episodes(draw_episodes(panda, "reference", 2, seed=77, motions=3)))[1]
    seen = told("panda", log.run, log.tare)
    assert seen is not None
    assert seen.scale - 1.0 > 3.5 * seen.std
    assert not seen.is_another


def test_a_real_panda_s_links_need_the_torques_that_it_shows(real_data):
    log = read_recording(real_data / "panda_unloaded_1khz.csv", arm("panda"))
    found = {factor: told("panda", times(log, factor)) for factor in (1.0, POUND_FEET, 1.3)}
    assert [one is not None and one.is_another for one in found.values()] == [False, True, True]
    for factor, one in found.items():
        assert one is not None
        assert one.scale == pytest.approx(factor, abs=0.05)


def test_a_scale_that_a_known_weight_has_told_is_believed():
    log, tare = (times(one, 1.25) for one in recorded("panda", 703))
    profile = learn_profile(arm("panda"), [tare])
    told_so = replace(profile, gain=np.full(7, 0.25), gain_std=0.003)
    without, believed = (identify(log, "panda", profile=one).notes for one in (profile, told_so))
    assert any("times what the links" in note for note in without)
    assert not any("times what the links" in note for note in believed)


def test_motor_currents_do_not_tell_their_scale():
    log, tare = recorded("ur5e", 702)
    assert told("ur5e", log, tare) is None

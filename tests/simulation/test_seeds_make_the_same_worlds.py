"""A seed makes the world and the log it always made: figures that move to another file must not move a draw."""

import hashlib
import re

import numpy as np
import pytest

from armload.arms import arm
from armload.motion import random_motion, taie2024
from armload.simulation import Gains, Sensors, World, moderate_stiffness, simulate

# SHA-256, first 16 digits. Worlds and logs: numbers to 1e-6, none nearer than 1e-11 to where rounding turns, so that
# another processor's arithmetic makes the same. Control: to 1e-9.
WORLDS = {
    "panda": "2dad9629ceae54cb",
    "fr3": "a30b03d6d468286c",
    "ur5e": "32e138467c0495d0",
    "ur10e": "09b7ed5da1aa4e1e",
    "unknown": "c2c617a59be256c5",
}
CONTROL = {
    "panda": "db1aa163e1ebdce0",
    "fr3": "f5f5a3855984164b",
    "ur5e": "a1755e49b2235c27",
    "ur10e": "6f32fcfca760ce0b",
    "unknown": "2d5ca2d4bf9416d2",
}
LOGS = {"panda": "be2927ec922b3c02", "ur10e": "916a0f46c4a73d11"}


def digest(*arrays, digits):
    made = hashlib.sha256()
    for array in arrays:
        made.update((np.round(np.asarray(array, dtype=float), digits) + 0.0).tobytes())
    return made.hexdigest()[:16]


def arm_called(name, tmp_path):
    """A built-in arm; or a UR10e with every mass 1 % off, which is no arm that armload knows."""
    if name != "unknown":
        return arm(name)
    text = re.sub(r'(?<=<mass value=")[^"]+', lambda mass: f"{1.01 * float(mass[0]):.9g}", arm("ur10e").urdf)
    path = tmp_path / "unknown.urdf"
    path.write_text(text, encoding="utf-8")
    made = arm(path)
    assert made.known_as is None
    return made


def numbers(world):
    given = (world.gain, world.rotor_inertia, world.stiction)
    drift = () if world.drift is None else (world.drift.size, [world.drift.time])
    waves = (world.residual.waves, world.residual.cosine, world.residual.sine)
    return [world.links, world.offset, *world.friction.numbers, *waves, *(x for x in given if x is not None), *drift]


@pytest.mark.parametrize("name", WORLDS)
def test_worlds_are_those_the_seeds_always_made(name, tmp_path):
    robot = arm_called(name, tmp_path)
    worlds = [draw(robot, seed) for seed in range(3) for draw in (World.real_like, World.beyond)]
    assert digest(*(x for world in worlds for x in numbers(world)), digits=6) == WORLDS[name]


@pytest.mark.parametrize("name", CONTROL)
def test_gains_and_sensors_are_those_an_arm_always_had(name, tmp_path):
    robot = arm_called(name, tmp_path)
    gains, sensors = Gains.of(robot), Sensors.of(robot)
    seen = (sensors.torque_noise, sensors.velocity_noise, sensors.position_noise, sensors.vibration)
    rest = [sensors.command_lag, sensors.velocity_skew, sensors.torque_skew, sensors.jitter, sensors.lost]
    found = digest(
        gains.stiffness, gains.damping, moderate_stiffness(robot), *seen, sensors.torque_quantum, rest, digits=9
    )
    assert found == CONTROL[name]


@pytest.mark.parametrize("name", LOGS)
def test_a_log_is_the_one_its_seeds_always_made(name):
    robot = arm(name)
    motion = taie2024() if robot.n == 7 else random_motion(robot, 3)
    log = simulate(robot, motion, rate=100.0, world=World.real_like(robot, 5), sensors=Sensors.of(robot), seed=4)
    assert digest(log.t, log.q, log.dq, log.tau, digits=6) == LOGS[name]

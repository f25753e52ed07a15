"""What slides in a gripper: told by a log about as far as it does, and by all logs of an arm together."""

from __future__ import annotations

import re

import numpy as np
import pytest
from test_findings import DAY, row

from armload import Recording, arm
from armload.inertia import InertialParameters
from armload.motion import random_motion
from armload.survey.findings import arm_findings
from armload.survey.looseness import MOST, looseness
from armload.survey.sliding import WAYS, slides

HEAVY, HALF_WAY = 1.5, 0.01  # [kg], [m]


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def torques(panda):
    """Time, motion, and the torque of a body that lies against one stop and against the other, 45° from x to y."""
    motion, t = random_motion(panda, 5, duration=12.0), np.arange(1200) / 100.0
    q, dq, ddq = motion(t)
    u = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    bodies = [
        InertialParameters.from_com(HEAVY, side * HALF_WAY * u + (0.0, 0.0, 0.05), np.diag([4e-3, 4e-3, 2e-3]))
        for side in (1.0, -1.0)
    ]
    return t, q, dq, u, [panda.with_payload(body).torque(q, dq, ddq) for body in bodies]


def test_a_body_that_lies_where_gravity_puts_it_slides_as_far_as_it_does(panda, torques):
    t, q, dq, u, (high, low) = torques
    rotation, _ = panda.frame_pose(q)
    along = -rotation[:, 2] @ u  # gravity, in the flange's axes
    (found,) = slides(Recording(t, q, dq, np.where((along > 0.0)[:, None], high, low)), panda, [(0.0, 12.0)])
    assert found is not None
    way = WAYS // 4  # 45°
    assert found.moment[way] == pytest.approx(HEAVY * HALF_WAY, rel=0.05)
    assert int(np.argmax(found.moment / found.std)) == way


def test_a_body_that_is_held_firmly_does_not_slide_nor_tells_a_standing_arm_anything(panda, torques):
    t, q, dq, _, (firm, _) = torques
    found, none = slides(Recording(t, q, dq, firm), panda, [(0.0, 12.0), (12.5, 13.0)])
    assert none is None
    assert found is not None
    assert np.all(np.abs(found.moment) < found.std)
    stands = Recording(t, np.tile(q[0], (len(t), 1)), np.zeros_like(q), np.tile(firm[0], (len(t), 1)))
    (found,) = slides(stands, panda, [(0.0, 12.0)])
    assert found is not None
    assert np.all(found.std > 0.01)  # or nothing at all


def fleet(count, gap, *, feigned=0.0, seed=0):
    """Logs of one arm: what they tell of 0.3 to 2 kg that slide along the third direction; a fifth hold nothing."""
    rng, made = np.random.default_rng(seed), []
    for day in range(count):
        mass = 0.0 if day % 5 == 0 else float(rng.uniform(0.3, 2.0))
        std = rng.uniform(0.002, 0.004, WAYS)
        c = feigned + std * rng.normal(size=WAYS) + mass * gap * np.cos(np.pi / WAYS * (np.arange(WAYS) - 2))
        told = {f"slide_{k}": float(x) for k, x in enumerate(c, start=1)}
        told |= {f"slide_std_{k}": float(x) for k, x in enumerate(std, start=1)}
        made.append([row("arm", day, mass=mass, held=mass > 0.0) | told])
    return made


def test_many_logs_find_what_none_of_them_shows():
    found = looseness(fleet(30, 0.005))
    assert found is not None
    assert found.found
    assert found.gap == pytest.approx(0.005, abs=3.0 * found.std)
    assert found.angle <= 75.0  # 30°, as far as thirty logs tell
    alone = [looseness([*fleet(6, 0.0), one]) for one in fleet(8, 0.005, seed=3)]
    assert not any(x is not None and x.found for x in alone)


def test_what_does_not_grow_with_the_mass_is_the_arms_own_and_no_sliding():
    for seed in range(10):
        found = looseness(fleet(30, 0.0, feigned=0.005, seed=seed))
        assert found is not None
        assert not found.found
    pulled = looseness(fleet(30, -0.005))
    assert pulled is not None
    assert pulled.gap * np.cos(np.pi / WAYS * (pulled.angle / 15.0 - 2)) <= 0.0 or not pulled.found


def test_a_gripper_that_was_mended_is_sound_again_and_too_few_logs_say_nothing():
    mended = [*fleet(30, 0.005), *fleet(MOST, 0.0, seed=1)]
    found = looseness(mended)
    assert found is not None
    assert not found.found
    assert looseness(fleet(5, 0.005)) is None  # four of them hold something
    assert looseness([[row("arm", day)] for day in range(20)]) is None  # nobody asked


def test_an_arm_is_advised_with_how_far_and_since_when():
    logs = [*fleet(10, 0.0, seed=4), *fleet(30, 0.006, seed=5)]
    rows = [one | {"date": 1.79e9 + DAY * day, "log": f"{day:02d}.csv"} for day, of in enumerate(logs) for one in of]
    (found,) = arm_findings(rows)
    assert found.loose
    assert re.search(r"slide by (5|6|7) mm either way", found.advice)
    assert found.since is not None
    assert (float(found.since) - 1.79e9) / DAY == pytest.approx(10, abs=5)

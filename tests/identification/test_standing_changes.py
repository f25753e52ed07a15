"""What is taken up or put down while an arm stands is found, and what stands there without a payload is not."""

from __future__ import annotations

import numpy as np
import pytest

from armload import Recording, arm, read_recording
from armload.identification import identify
from armload.identification.notes import MAY_CHANGE, rested
from armload.identification.standing_changes import changes_at_rest
from armload.identification.thresholds import MOVES, PRESLIDING
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.posterior import SmoothPosteriorLeastSquares
from armload.regression import Correction
from armload.simulation import World, simulate

Q = np.array([0.1, -0.4, 0.2, -1.9, 0.3, 1.7, 0.6])
RATE, SECONDS = 200.0, 8.0  # [Hz, s]
OFFSET = np.array([0.15, -0.2, 0.1, 0.2, -0.04, 0.05, 0.02])  # [N·m]
COULOMB = np.array([0.25, 0.25, 0.2, 0.35, 0.35, 0.2, 0.26])  # [N·m] of two Pandas
NOISE = np.array([0.08, 0.08, 0.08, 0.08, 0.02, 0.02, 0.02])  # [N·m]


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def payload():
    return draw_payload("boxes", 3, 1.0).parameters


@pytest.fixture(scope="module")
def correction(panda):
    return Correction(panda, panda.limits.effort)


def standing(panda, payload, share):
    """A log of an arm that stands, and holds share(t) of a payload."""
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    q = np.tile(Q, (len(t), 1))
    bare = panda.torque(q)
    held = panda.with_payload(payload).torque(q) - bare
    noise = NOISE * np.random.default_rng(4).normal(size=q.shape)
    return Recording(t, q, np.zeros_like(q), bare + share(t)[:, None] * held + OFFSET + noise)


def test_what_is_taken_up_while_the_arm_stands_is_found_and_answered(panda, payload):
    found = identify(standing(panda, payload, lambda t: (t > 5.0).astype(float)), panda)
    before, after = found.segments
    assert after.start == pytest.approx(5.0, abs=0.03)
    assert not before.answer.held
    assert after.answer.phi_low[0] <= payload.mass <= after.answer.phi_high[0]
    assert found.mass == after.answer.mass == pytest.approx(payload.mass, abs=0.15)


def test_what_is_put_down_while_the_arm_stands_is_no_longer_held(panda, payload):
    found = identify(standing(panda, payload, lambda t: (t < 4.0).astype(float)), panda)
    assert [part.answer.held for part in found.segments] == [True, False]


def test_a_hand_over_that_takes_long_has_a_beginning_and_an_end(panda, payload):
    found = identify(standing(panda, payload, lambda t: np.clip((t - 3.0) / 2.0, 0.0, 1.0)), panda)
    assert [part.start for part in found.segments] == [0.0, pytest.approx(3.2, abs=0.2), pytest.approx(4.8, abs=0.2)]
    assert found.mass == pytest.approx(payload.mass, abs=0.15)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_standing_arm_whose_payload_stays_is_one_part(panda, payload, share):
    assert len(identify(standing(panda, payload, lambda t: np.full_like(t, share)), panda).segments) == 1


def test_what_is_too_near_to_the_end_to_be_answered_is_a_doubt(panda, payload):
    found = identify(standing(panda, payload, lambda t: (t > SECONDS - 0.4).astype(float)), panda)
    assert len(found.segments) == 1
    assert MAY_CHANGE in found.notes
    assert found.interval == "approximate"


def rows(steps):
    """Rows of an arm whose joints and residuals are what `steps` say from a time on: t [s], q offset [rad], r [N·m]."""
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    q, r = np.tile(Q, (len(t), 1)), np.tile(OFFSET, (len(t), 1))
    for start, turned, torque in steps:
        q[t >= start] = Q + turned
        r[t >= start] = OFFSET + torque
    return t, q, r


def seen(steps, correction):
    return changes_at_rest(*rows(steps), correction, lambda: COULOMB)


def of_payload(panda, payload):
    return panda.with_payload(payload).torque(Q[None])[0] - panda.torque(Q[None])[0]


def test_the_same_torque_is_a_payload_in_a_pose_that_stays_and_friction_where_the_joints_have_turned(
    panda, payload, correction
):
    weighs = 0.4 * of_payload(panda, payload)
    rubs = np.sign(weighs) * 2.0 * COULOMB
    assert seen([(4.0, 0.0, weighs)], correction) == [pytest.approx(4.0, abs=0.06)]
    assert seen([(4.0, 2.0 * PRESLIDING, rubs)], correction) == []
    assert seen([(4.0, 2.0 * PRESLIDING, 4.0 * of_payload(panda, payload))], correction) != []


def test_an_arm_that_comes_back_to_its_pose_has_another_friction_and_no_payload(panda, payload, correction):
    rubs = np.sign(of_payload(panda, payload)) * 2.0 * COULOMB
    assert seen([(4.0, 2.0 * MOVES, 0.0), (4.05, 0.0, rubs)], correction) == []


def test_what_no_payload_explains_is_none(correction):
    turned = np.array([6.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # about the vertical: no weight does that
    assert seen([(4.0, 0.0, turned)], correction) == []


@pytest.mark.parametrize(("name", "said"), [("ur5e", True), ("panda", False)])
def test_what_a_motor_s_torque_hardly_shows_while_the_arm_stands_at_the_end_is_said(name, said):
    robot = arm(name)
    log = simulate(robot, random_motion(robot, 5, duration=4.0), world=World.real_like(robot, 3), rate=200.0, seed=1)
    step = np.diff(log.t).mean()
    stands = Recording(
        np.r_[log.t, log.t[-1] + step * np.arange(1, 401)],
        *(np.vstack([part, np.tile(end, (400, 1))]) for part, end in ((log.q, log.q[-1]), (log.dq, 0.0 * log.dq[-1]))),
        np.vstack([log.tau, np.tile(log.tau[-1], (400, 1))]),
    )
    assert rested(log, robot) == ()
    assert bool(rested(stands, robot)) == said
    assert any("the arm stands in the last 2." in note for note in rested(stands, robot)) == said


def test_the_torque_of_a_real_ur10e_changes_while_it_stands_and_holds_the_same(real_data):
    """As a payload would change it: why motor currents are not asked."""
    robot = arm("ur10e")
    log = read_recording(real_data / "ur10e_loaded_2805g.csv", robot)
    physics = SmoothPosteriorLeastSquares(robot)
    rows = physics.stream.regression().rows(log.t, log.q, log.dq, log.tau)
    correction = physics.stream.correction
    coulomb = 0.05 * correction.effort  # what is expected of gears
    assert changes_at_rest(rows.t, rows.q, rows.r, correction, lambda: coulomb)
    assert len(identify(log, robot).segments) == 1

"""A tool that is not known exactly makes what it carries less certain, by as much as it is itself."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from armload import arm, identify
from armload.errors import PayloadError
from armload.inertia import InertialParameters, vech
from armload.motion import random_motion
from armload.payloads import Payload, franka_hand, read_payload
from armload.payloads import test_payload as make_payload
from armload.payloads.payload_file import write_payload
from armload.payloads.uncertainty import Uncertainty
from armload.simulation import World, simulate

MASS, COM = 0.7, np.array([0.01, -0.03, 0.06])
INERTIA = np.array([[2e-3, 1e-4, 0.0], [1e-4, 1.5e-3, -2e-4], [0.0, -2e-4, 1e-3]])


@pytest.fixture(scope="module")
def simulated_run():
    """A Panda, its log with a payload below a gripper, what is said of the gripper (80 g too little), the payload."""
    robot = arm("panda")
    inertia = np.diag([1e-3, 1e-3, 5e-4])
    gripper, stated = (InertialParameters.from_com(mass, (0.0, 0.01, 0.05), inertia) for mass in (0.5, 0.42))
    truth = make_payload().parameters
    motion = random_motion(robot, seed=53, duration=6.0)
    both = InertialParameters(truth.phi + gripper.phi, robot.frame)
    return robot, simulate(robot, motion, both, world=World.real_like(robot, seed=3), rate=100.0, seed=3), stated, truth


def test_the_covariance_is_that_of_many_tools_drawn_as_uncertain():
    rng, size = np.random.default_rng(0), 40_000
    off = Uncertainty(mass=0.01, com=1e-3, inertia=0.05)
    m, r = MASS + 0.01 * rng.normal(size=size), COM + 1e-3 * rng.normal(size=(size, 3))
    six = vech(INERTIA) + 0.05 * np.trace(INERTIA) / 3.0 * rng.normal(size=(size, 6))
    square = np.einsum("ni,ni->n", r, r)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None]
    drawn = np.column_stack([m, m[:, None] * r, six + m[:, None] * np.array([vech(x) for x in square])])
    found = off.covariance(InertialParameters.from_com(MASS, COM, INERTIA))
    std = drawn.std(axis=0)
    np.testing.assert_allclose(np.sqrt(np.diag(found)), std, rtol=0.03)
    np.testing.assert_allclose(found / np.outer(std, std), np.corrcoef(drawn.T), atol=0.04)


def test_what_is_known_exactly_has_no_covariance():
    assert not Uncertainty().covariance(InertialParameters.zero()).any()


def test_a_file_says_how_well_a_tool_is_known_and_keeps_it(tmp_path):
    file, again = tmp_path / "tool.json", tmp_path / "again.json"
    file.write_text(json.dumps({"mass": 0.7, "com": [0, 0, 0.05], "std": {"mass": 0.02, "com": 0.003}}))
    tool = read_payload(file)
    assert tool.uncertainty == Uncertainty(mass=0.02, com=0.003)
    write_payload(again, tool)
    assert read_payload(again).uncertainty == tool.uncertainty
    write_payload(again, franka_hand())
    assert read_payload(again).uncertainty == Uncertainty()


@pytest.mark.parametrize(
    ("std", "said"),
    [
        ([0.1], "expected an object"),
        ({"weight": 0.1}, "some of mass"),
        ({"mass": -1}, "0 or more"),
        ({"com": "x"}, "std"),
    ],
)
def test_an_uncertainty_that_is_none_is_refused_by_the_name_of_its_file(tmp_path, std, said):
    file = tmp_path / "tool.json"
    file.write_text(json.dumps({"mass": 0.7, "com": [0, 0, 0.05], "std": std}))
    with pytest.raises(PayloadError, match=rf"tool\.json.*{said}"):
        read_payload(file)


@pytest.mark.parametrize("tared", [False, True])
@pytest.mark.full  # some seconds
def test_an_answer_is_as_uncertain_as_its_tool(analytic_log, tared):
    panda, hand = arm("panda"), franka_hand()
    body = InertialParameters.from_com(1.0, COM, 1e-3 * np.eye(3))
    both = body + InertialParameters(hand.parameters.phi)
    log = analytic_log(panda, both)
    tare = analytic_log(panda, None, start=50.0, phase=0.4) if tared else None
    off = Uncertainty(mass=0.05, com=2e-3, inertia=0.1)
    exact, unsure = (
        identify(log, panda, tare=tare, tool=t, method="map") for t in (hand, replace(hand, uncertainty=off))
    )
    assert exact.relative_to == unsure.relative_to == "tool"
    added = unsure.covariance - exact.covariance
    expected = off.covariance(hand.parameters)
    np.testing.assert_allclose(np.diag(added), np.diag(expected), rtol=1e-6, atol=1e-12)


def saved_answer(path, phi, covariance, frame, interval="calibrated"):
    """A file with what of a saved result says how well it is known."""
    path.write_text(
        json.dumps({"phi": list(phi), "covariance": covariance.tolist(), "frame": frame, "interval": interval})
    )
    return path


def drawn_covariance(phi):
    """Some covariance of ten numbers, with errors of some percent that belong together."""
    root = np.random.default_rng(4).normal(size=(10, 10)) * (0.02 * np.abs(phi) + 1e-5)[:, None]
    return root @ root.T


@pytest.mark.parametrize("frame", ["panda_link8", "panda_link7"])
def test_an_answer_is_as_uncertain_as_the_identified_tool_that_it_is_less(analytic_log, tmp_path, frame):
    panda, hand = arm("panda"), franka_hand().parameters
    reach = 0.107 if frame == "panda_link7" else 0.0  # [m] of the flange beyond link 7 along z, axes parallel
    own = InertialParameters(hand.phi).moved(np.eye(3), (0.0, 0.0, reach)).phi
    covariance = drawn_covariance(own)
    body = InertialParameters.from_com(1.0, COM, 1e-3 * np.eye(3), "panda_link8")
    log = analytic_log(panda, body + hand, duration=1.0)
    exact = identify(log, panda, tool=InertialParameters(own, frame), method="map")
    unsure = identify(log, panda, tool=saved_answer(tmp_path / "tool.json", own, covariance, frame), method="map")
    added = unsure.covariance - exact.covariance
    turn = np.eye(4)  # (m, m·r) about the flange, of those about the tool's frame
    turn[3, 0] = -reach
    np.testing.assert_allclose(added[:4, :4], turn @ covariance[:4, :4] @ turn.T, rtol=1e-6, atol=1e-12)


def test_what_is_less_an_approximate_answer_is_approximate(analytic_log, tmp_path):
    panda, hand = arm("panda"), franka_hand().parameters
    log = analytic_log(
        panda, InertialParameters.from_com(1.0, COM, 1e-3 * np.eye(3), "panda_link8") + hand, duration=1.0
    )
    file, covariance = tmp_path / "tool.json", np.diag(1e-8 + 1e-4 * hand.phi**2)
    for interval in ("calibrated", "approximate"):
        saved_answer(file, hand.phi, covariance, "panda_link8", interval)
        assert identify(log, panda, tool=file).interval == interval


def test_a_saved_answer_stays_as_uncertain_when_it_is_written_again(tmp_path):
    phi = franka_hand().parameters.phi
    saved_answer(tmp_path / "held.json", phi, drawn_covariance(phi), "panda_link8", "approximate")
    write_payload(tmp_path / "again.json", read_payload(tmp_path / "held.json"))
    again = read_payload(tmp_path / "again.json")
    np.testing.assert_array_equal(again.covariance, drawn_covariance(phi))
    assert again.measured is not None
    assert not again.measured.calibrated


def test_a_covariance_that_is_none_is_refused_and_what_std_says_is_believed(tmp_path):
    phi, file = franka_hand().parameters.phi, tmp_path / "held.json"
    for wrong in (-np.eye(10), np.triu(np.full((10, 10), 0.1)) + np.eye(10)):
        saved_answer(file, phi, wrong, "panda_link8")
        with pytest.raises(PayloadError, match=r"held\.json: the covariance"):
            read_payload(file)
    saved_answer(file, phi, drawn_covariance(phi), "panda_link8")
    file.write_text(json.dumps(json.loads(file.read_text()) | {"std": {"mass": 0.02}}))
    assert np.sqrt(read_payload(file).covariance[0, 0]) == pytest.approx(0.02)


def test_a_weighed_payload_tells_what_its_tool_weighs_and_not_the_other_way_round(simulated_run):
    """phi of the payload alone given its mass: the Gaussian of log and tool together, conditioned on one coordinate."""
    robot, run, stated, truth = simulated_run
    mass, std = truth.mass, 0.002
    off = Payload("gripper", stated, uncertainty=Uncertainty(0.08, 0.002, 0.1))
    loose = identify(run, robot, tool=off, method="map-gp")
    known = identify(run, robot, tool=off, method="map-gp", mass=(mass, std))
    C = np.asarray(loose.covariance)
    gain = C[:, 0] / (C[0, 0] + std**2)
    unit = np.sqrt(np.diag(C))
    np.testing.assert_allclose((known.covariance - C + np.outer(gain, C[0])) / np.outer(unit, unit), 0.0, atol=1e-2)
    np.testing.assert_allclose((known.phi - loose.phi - gain * (mass - loose.phi[0])) / unit, 0.0, atol=0.05)
    assert not any("is not what the log says" in note for note in known.notes)


@pytest.mark.parametrize("method", ["hybrid", "map-gp"])
def test_a_weighed_payload_is_as_heavy_as_it_was_weighed_below_a_tool_that_is_not(simulated_run, method):
    robot, run, stated, truth = simulated_run
    off = Payload("gripper", stated, uncertainty=Uncertainty(0.08, 0.002, 0.1))
    known = identify(run, robot, tool=off, method=method, mass=(truth.mass, 0.002))
    assert known.mass == pytest.approx(truth.mass, abs=0.002)
    assert known.phi_high[0] - known.phi_low[0] < 0.009
    assert np.all((known.phi_low <= truth.phi) & (truth.phi <= known.phi_high))

"""A tool that is not known exactly makes what it carries less certain, by as much as it is itself."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from armload import arm, identify
from armload.errors import PayloadError
from armload.inertia import InertialParameters, vech
from armload.payloads import franka_hand, read_payload
from armload.payloads.payload_file import write_payload
from armload.payloads.uncertainty import Uncertainty

MASS, COM = 0.7, np.array([0.01, -0.03, 0.06])
INERTIA = np.array([[2e-3, 1e-4, 0.0], [1e-4, 1.5e-3, -2e-4], [0.0, -2e-4, 1e-3]])


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
def test_an_uncertainty_that_is_none_is_refused(tmp_path, std, said):
    file = tmp_path / "tool.json"
    file.write_text(json.dumps({"mass": 0.7, "com": [0, 0, 0.05], "std": std}))
    with pytest.raises(PayloadError, match=said):
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

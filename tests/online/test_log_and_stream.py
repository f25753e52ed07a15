"""A log is a stream that ends: `identify` says of a log what the stream says once it is concluded."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from armload.arms import arm, payload_regressor
from armload.errors import IdentificationError
from armload.identification import identify, known_of, with_tool
from armload.identification.tare_age import DAY
from armload.inertia import InertialParameters
from armload.motion import random_motion, taie2024
from armload.online import OnlineIdentifier
from armload.payloads import Payload
from armload.payloads import test_payload as make_payload
from armload.payloads.uncertainty import Uncertainty
from armload.recording import Recording
from armload.simulation import World, simulate

TOOL = InertialParameters.from_com(0.4, (0.0, 0.01, 0.05), np.diag([1e-3, 1e-3, 5e-4]))
WEIGHED = Payload("gripper", TOOL, uncertainty=Uncertainty(0.1, 0.005, 0.2))


@cache
def logs(name, rate=200.0, seconds=2.0, seed=3):
    """A run with a payload and a tare on another motion, of an arm that differs from its model."""
    robot = arm(name)
    world = World.real_like(robot, seed=seed)
    motion = taie2024() if name == "panda" else random_motion(robot, seed=7, duration=seconds + 1.0)
    run = simulate(robot, motion, make_payload().parameters, world=world, rate=rate, seed=1).between(0.0, seconds)
    tare = simulate(robot, random_motion(robot, seed=5, duration=4.0), world=world, rate=rate, seed=2)
    return robot, run, tare


def with_a_gap(log):
    keep = (log.t < log.t[0] + 0.8) | (log.t > log.t[0] + 1.3)
    return Recording(log.t[keep], log.q[keep], log.dq[keep], log.tau[keep])


@pytest.fixture(scope="module")
def panda_logs():
    return logs("panda")


@pytest.fixture(scope="module")
def same_motion(panda_logs):
    robot, run, _ = panda_logs
    world = World.real_like(robot, seed=3)
    return robot, run, simulate(robot, taie2024(), world=world, rate=200.0, seed=9).between(0.0, 3.0)


def case(kind, panda_logs, same_motion):
    """(arm, run, tare, tool) of a kind of log."""
    robot, run, tare = panda_logs
    if kind == "same motion":
        robot, run, tare = same_motion
    if kind == "motor torque":
        robot, run, tare = logs("ur10e", seed=4)
    if kind == "30 Hz":
        robot, run, tare = logs("panda", rate=30.0)
    if kind == "gaps":
        run = with_a_gap(run)
    wants_tare = kind in ("tare", "old tare", "same motion", "motor torque")
    tools = {"tool": TOOL, "weighed tool": WEIGHED, "weighed tool and payload": WEIGHED}
    return robot, run, tare if wants_tare else None, tools.get(kind)


KINDS = ("untared", "tare", "old tare", "same motion", "tool", "30 Hz", "gaps", "motor torque")
KINDS += ("weighed tool", "weighed tool and payload")
CASES = [(kind, None) for kind in KINDS]
CASES += [pytest.param(kind, "map-gp", marks=() if kind == "untared" else pytest.mark.full) for kind in KINDS]


@pytest.mark.parametrize(("kind", "method"), CASES)
def test_identify_says_what_the_concluded_stream_says(kind, method, panda_logs, same_motion):
    robot, run, tare, tool = case(kind, panda_logs, same_motion)
    age = 9 * DAY if kind == "old tare" else 0.0
    mass = (make_payload().parameters.mass - TOOL.mass, 0.002) if kind == "weighed tool and payload" else None
    known = None if mass is None else known_of(robot, mass, None, if_held=True)
    answer = identify(run, robot, tare=tare, tool=tool, method=method, tare_age=age, mass=mass)
    carrying = robot if tool is None else with_tool(robot, tool)
    stream = OnlineIdentifier(carrying, tare, method, known=known, tare_age=age)
    for sample in run:
        stream.update(*sample)
    end = stream.conclude()
    stream.close()
    assert stream.event is None
    assert stream.health.used == answer.n_samples == end.n_samples == len(run)
    assert (end.method, end.relative_to) == (answer.method, answer.relative_to)
    unit = np.maximum(end.std, 1e-6)
    np.testing.assert_allclose((end.phi - answer.phi) / unit, 0.0, rtol=0, atol=1e-5)
    assert end.determined.tolist() == answer.determined.tolist()
    assert end.held == answer.held
    assert end.rests_on_prior.tolist() == answer.rests_on_prior.tolist()
    assert end.torque_gain_std == answer.torque_gain_std
    assert end.same_arm_assumed == answer.same_arm_assumed == (kind == "motor torque")
    for ours, theirs in ((end.low, answer.phi_low), (end.high, answer.phi_high)):
        np.testing.assert_allclose((ours - theirs) / unit, 0.0, rtol=0, atol=1e-5)


def test_a_stream_is_as_unsure_as_its_tool_until_its_empty_run_has_weighed_it(panda_logs):
    """The error of a tool that is on all the time is in what the empty arm shows, too, and cancels then."""
    robot, run, tare = panda_logs
    once_taken = Recording(tare.t[-1] + 0.005 + run.t, run.q, run.dq, run.tau)
    with_tools = [
        Recording(part.t, part.q, part.dq, part.tau + robot.with_payload(TOOL).torque(*motion) - robot.torque(*motion))
        for part in (tare, once_taken)
        for motion in [(part.q, part.dq, np.gradient(part.dq, part.t, axis=0))]
    ]
    ends = {}
    for name, carrying in (("exact", robot.with_payload(TOOL)), ("weighed", with_tool(robot, WEIGHED))):
        stream, ends[name] = OnlineIdentifier(carrying), []
        for part in with_tools:
            for sample in part:
                last = stream.update(*sample)
            ends[name].append(last)
        stream.close()
    (empty, loaded), (empty_weighed, loaded_weighed) = ends["exact"], ends["weighed"]
    assert empty.relative_to == empty_weighed.relative_to == "tool"
    added = WEIGHED.covariance
    np.testing.assert_allclose(empty_weighed.covariance - empty.covariance, added, atol=1e-3 * added.max())
    assert loaded.relative_to == loaded_weighed.relative_to == "before"
    np.testing.assert_allclose(loaded_weighed.std, loaded.std, rtol=0.05)


@pytest.mark.parametrize("age", [None, 0.0])
def test_a_stream_doubts_its_bars_while_its_tool_s_inertia_is_assumed(panda_logs, age):
    robot, run, tare = panda_logs
    tool = Payload.without_inertia("tool", TOOL.mass, TOOL.com)
    stream = OnlineIdentifier(with_tool(robot, tool), None if age is None else tare)
    for sample in run:
        last = stream.update(*sample)
    stream.close()
    untared = age is None
    assert (last.interval == "approximate") is untared
    assert any("tool tool: the inertia is not given" in note for note in last.notes) is untared


@pytest.mark.parametrize("method", [None, "map-gp"])
@pytest.mark.full  # some seconds
def test_a_field_means_the_same_in_a_stream_s_json_and_in_a_log_s(method, panda_logs):
    """A standing arm first, whose inertia is not determined; then a log that no body explains."""
    robot, run, _ = panda_logs
    pose = np.tile(run.q[0], (300, 1))
    still = Recording(np.arange(300) * 0.01, pose, 0 * pose, robot.with_payload(TOOL).torque(pose))
    q, dq, ddq = taie2024()(run.t)
    hollow = np.array([1.0, 0, 0, 0.05, -0.1, 0, 0, -0.1, 0, -0.1]) - make_payload().parameters.phi
    torn = replace(run, tau=run.tau + payload_regressor(robot.frame_motion(q), dq, ddq) @ hollow)
    for log in (still, torn):
        answer = identify(log, robot, method=method).to_dict()
        stream = OnlineIdentifier(robot, method=method)
        for sample in log:
            stream.update(*sample)
        said = stream.conclude().to_dict()
        stream.close()
        same = ("method", "frame", "relative_to", "n_samples", "interval", "determined", "consistent", "held")
        for name in (*same, "rests_on_prior", "torque_gain_std", "same_arm_assumed"):
            assert said[name] == answer[name], name
        unit = np.maximum(np.array(answer["phi_high"]) - answer["phi_low"], 1e-6)
        for name in ("phi", "phi_low", "phi_high"):
            np.testing.assert_allclose((np.array(said[name]) - answer[name]) / unit, 0.0, rtol=0, atol=1e-5)
        for name in ("mass", "com", "inertia_com"):
            assert np.array(said[name]) == pytest.approx(np.array(answer[name]), rel=1e-3, abs=1e-5), name
    assert answer["interval"] == "approximate"


@pytest.mark.full  # some seconds
def test_a_stream_allows_for_the_age_of_its_tare_also_once_it_was_saved(panda_logs, tmp_path):
    robot, run, tare = panda_logs
    widths = {}
    for age in (0.0, 9 * DAY):
        stream = OnlineIdentifier(robot, tare, tare_age=age)
        for sample in run:
            last = stream.update(*sample)
        stream.save(tmp_path / "state.npz")
        again = OnlineIdentifier.restore(tmp_path / "state.npz", robot)
        widths[age] = last.std[0], stream.conclude().std[0], again.conclude().std[0]
        for identifier in (stream, again):
            identifier.close()
    assert widths[9 * DAY][0] > 1.05 * widths[0.0][0]
    assert widths[9 * DAY][2] == pytest.approx(widths[9 * DAY][1], rel=1e-9)
    with pytest.raises(IdentificationError, match="the tare's age is -1 s"):
        OnlineIdentifier(robot, tare, tare_age=-1.0)


def test_a_tare_along_the_same_motion_is_the_better_evidence_on_a_stream_too(same_motion):
    robot, run, tare = same_motion
    stream, other = OnlineIdentifier(robot, tare), OnlineIdentifier(robot, replace(tare, t=tare.t + 100.0))
    plain = OnlineIdentifier(robot)
    for sample in run:
        ends = [identifier.update(*sample) for identifier in (stream, other, plain)]
    for identifier in (stream, other, plain):
        identifier.close()
    truth = make_payload().parameters.phi
    assert abs(ends[0].phi[0] - truth[0]) < 0.02
    assert ends[0].std[0] < 0.5 * ends[2].std[0]
    assert ends[1].phi[0] == pytest.approx(ends[0].phi[0], abs=1e-6)  # whatever the tare's clock

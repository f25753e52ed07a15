"""The vendors' own clients, served by robots that are not there (`servers`): our simulator, on the wire."""

import contextlib
import json
import os
import re
import runpy
import signal
import socket
import struct
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload.arms import ARMS, arm
from armload.devices import FrankaSource, Load, open_source
from armload.devices.franka import writer as franka_robot
from armload.errors import SourceError
from armload.inertia import InertialParameters, to_order
from armload.motion import random_motion, taie2024
from armload.online import OnlineIdentifier
from armload.payloads import test_payload as heavy_payload
from armload.recording import read_recording
from armload.simulation import World, simulate

pytestmark = pytest.mark.full
SERVERS = Path(__file__).resolve().parent / "servers"
FRANKAS = [("panda", "panda_py", 5), ("fr3", "pylibfranka", 10)]
LOST = [700, 701, 1500]
ENOUGH = 2500  # samples to identify a payload from, of 20000 of which a busy client drops some
LOAD = InertialParameters.from_com(
    1.5, (0.02, -0.03, 0.06), [[4e-3, 3e-4, -2e-4], [3e-4, 5e-3, 1e-4], [-2e-4, 1e-4, 6e-3]]
)


@pytest.fixture
def address():
    """A loopback address of this worker's own: the clients' ports are fixed."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")
    return f"127.0.7.{10 + int(worker)}"


@contextlib.contextmanager
def serving(program, log, address, tmp_path, *arguments):
    """The server's process, and its events as they come."""
    path = tmp_path / "served.npz"
    np.savez(path, **log)
    command = [sys.executable, SERVERS / f"{program}.py", path, "--address", address, *map(str, arguments)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        events = map(json.loads, process.stdout)
        try:
            assert next(events)["event"] == "ready"
            yield process, events
        finally:
            process.kill()


def tell(process, order):
    """Tell an arm that stands to go, or to stand still again."""
    process.stdin.write(order + "\n")
    process.stdin.flush()


def franka_urdf(robot):
    """The arm's description as an FR3 would send it: plain joint names, and limits that shrink towards the ends."""
    text = robot.urdf.replace(f"{robot.name}_", "")
    return re.sub(
        r"(<limit [^>]*/>)",
        r'\1<position_based_velocity_limits velocity_offset="0.2" deceleration_limit="5.0" />',
        text,
    )


@contextlib.contextmanager
def franka(robot, version, address, tmp_path, *, seconds=2.5, motion=None, lose=(), rest=60.0, stand=False):
    """A simulated robot with a payload behind the Franka Control Interface; also its log, at whole milliseconds.

    stand: it moves while it should, so that nothing of the motion is over before a client is there.
    """
    motion = motion or (taie2024() if robot.name == "panda" else random_motion(robot, 3))
    world = World.real_like(replace(robot, link_spread=1.0), 2)  # one whose links are as well known as a Panda's
    run = simulate(robot, motion, heavy_payload(), world=world, duration=seconds)
    log = {"t": np.round(10.0 + run.t, 3), "q": run.q, "dq": run.dq, "tau": run.tau}
    if rest:  # it stops where it is, for longer than any test on any machine takes
        still = np.full(round(1000 * rest), -1)
        log = {name: np.concatenate([column, column[still]]) for name, column in log.items()}
        log["t"][len(run) :] += np.round(np.arange(1, len(still) + 1) / 1000, 3)
        log["dq"][len(run) :] = 0.0
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(franka_urdf(robot))
    arguments = ["--version", version, "--urdf", urdf, *(["--lose", *lose] if len(lose) else [])]
    arguments += ["--stand"] if stand else []
    with serving("franka_server", log, address, tmp_path, *arguments) as (process, events):
        yield log, process, events


def collect(source, begin=lambda: None):
    """All samples until the source is lost, (N, 1 + 3n), and the error then; `begin` is called at the first."""
    rows = []

    def states():
        for s in source:
            if not rows:
                begin()
            yield np.concatenate([[s.t], s.q, s.dq, s.tau])

    with pytest.raises(SourceError) as lost:
        rows.extend(states())
    return np.array(rows), str(lost.value)


@pytest.fixture(params=FRANKAS, ids=[name for name, *_ in FRANKAS])
def system(request):
    name, package, version = request.param
    pytest.importorskip(package, reason=f"{package} has no wheel for this Python")
    return name, version


def test_every_state_arrives_as_the_robot_sent_it(system, address, tmp_path):
    name, version = system
    robot = arm(name)
    with franka(robot, version, address, tmp_path, lose=LOST, rest=0.0, stand=True) as (log, process, events):
        record = tmp_path / "run.csv"
        with open_source(f"{name}://{address}", robot, record=record) as source:
            assert (source.n, source.rate, source.name) == (7, 1000.0, f"{name}://{address}")
            rows, text = collect(source, lambda: tell(process, "go"))
            assert source.lost == 0
        stood = next(event for event in events if event["event"] == "moves")["tick"]
    assert f"{name}://{address} was lost" in text  # the log was over: the server fell silent
    assert "see that the robot is switched on, its cable is in, and FCI is activated in Desk" in text
    t = rows[:, 0]
    assert np.all(np.diff(t) > 0)
    place = np.round(1000 * (t - log["t"][0])).astype(int) - stood
    moving, place = place >= 0, place[place >= 0]
    assert not np.any(rows[~moving, 8:15])
    np.testing.assert_allclose(t[moving], log["t"][place] + 1e-3 * stood, atol=1e-9)
    sent = np.hstack([log["q"], log["dq"], log["tau"]])[place]
    if version == 5:
        np.testing.assert_array_equal(rows[moving, 1:], sent)
    else:
        np.testing.assert_array_equal(rows[moving, 1:], sent.astype(np.float32))
    # lost packets are gaps in time; a busy machine adds some of its own, as the client keeps only the newest
    assert not set(LOST) & set(place)
    assert len(place) > 500
    kept = read_recording(record, robot)
    np.testing.assert_array_equal(np.column_stack([kept.t, kept.q, kept.dq, kept.tau]), rows)


def test_a_load_arrives_as_mass_centre_and_inertia_column_by_column(system, address, tmp_path):
    name, version = system
    robot = arm(name)
    mass, *rest = to_order(LOAD, "franka")
    with franka(robot, version, address, tmp_path) as (log, _, events):
        with open_source(f"{name}://{address}", robot) as source:
            samples = iter(source)
            next(samples)
            source.set_load(mass, rest[:3], rest[3:])
            status = source.read_once()
            assert status.m_load == pytest.approx(1.5)
            assert status.m_ee == 0.0
            assert np.abs(log["dq"] - status.dq).max(axis=1).min() < 1e-6
            assert len(next(samples).q) == 7  # the stream goes on
        received = next(event for event in events if event["event"] == "load")["numbers"]
    com, matrix = LOAD.com, LOAD.inertia_com
    assert received == pytest.approx([1.5, *com, *matrix[:, 0], *matrix[:, 1], *matrix[:, 2]], rel=1e-12)


def test_a_payload_goes_from_the_vendor_s_stream_into_the_robot_s_own_load(system, address, tmp_path):
    """The whole way: the maker's client streams a simulated robot, armload identifies, the load is sent at rest."""
    name, version = system
    robot = arm(name)
    with franka(robot, version, address, tmp_path, seconds=20.0, rest=0.0, stand=True) as (_, process, events):
        online = OnlineIdentifier(robot)
        with open_source(f"{name}://{address}", robot) as source:
            samples = iter(source)
            next(samples)
            tell(process, "go")
            for sample in samples:
                if np.any(sample.dq):
                    estimate = online.update(*sample)
                    if online.health.used == ENOUGH:
                        tell(process, "stop")
                elif online.health.used >= ENOUGH:
                    break
            online.close()
            assert estimate.held
            load = Load.of(estimate, robot)
            sent = franka_robot.set_load(source, load, robot, write=True, allow_undetermined_inertia=name == "fr3")
        received = next(event for event in events if event["event"] == "load")["numbers"]
    truth = heavy_payload().parameters
    assert received == pytest.approx([sent.mass, *sent.com, *sent.inertia], rel=1e-12)
    assert received[0] == pytest.approx(truth.mass, abs=0.15)
    assert received[1:4] == pytest.approx(truth.com, abs=0.02)
    matrix = estimate.parameters.inertia_com
    assert received[4:] == pytest.approx([*matrix[:, 0], *matrix[:, 1], *matrix[:, 2]], rel=1e-9)


def test_a_served_arm_moves_from_when_it_is_told_to_until_it_is_told_to_stop(address, tmp_path):
    """Through plain sockets: a late client misses nothing of the motion, which is not over before it has enough."""
    place = runpy.run_path(str(SERVERS / "franka_server.py"))["State"](5).at
    with (
        franka(arm("panda"), 5, address, tmp_path, seconds=10.0, rest=0.0, stand=True) as (log, process, events),
        socket.create_connection((address, 1337)) as commands,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as states,
    ):
        states.bind((commands.getsockname()[0], 0))
        states.settimeout(60.0)
        commands.sendall(struct.pack("<3I2H", 0, 1, 16, 5, states.getsockname()[1]))

        def state():
            message = states.recv(1 << 16)
            numbers = np.frombuffer(message, "<f8", place["dtheta"].stop, 8)
            return struct.unpack_from("<Q", message)[0] - 10000, numbers[place["q"]], numbers[place["dq"]]

        for _ in range(200):
            tick, q, dq = state()
            assert not dq.any()
            np.testing.assert_array_equal(q, log["q"][0])
        tell(process, "go")
        while not dq.any():
            tick, q, dq = state()
        begun = next(event for event in events if event["event"] == "moves")["tick"]
        assert begun > 200 - 1
        np.testing.assert_array_equal(q, log["q"][tick - begun])
        tell(process, "stop")
        while dq.any():
            tick, q, dq = state()
        stood = next(event for event in events if event["event"] == "stands")["tick"]
        for _ in range(200):
            np.testing.assert_array_equal(q, log["q"][stood - begun])
            assert not dq.any()
            tick, q, dq = state()


def test_a_server_that_dies_is_a_source_that_is_lost(system, address, tmp_path):
    name, version = system
    with (
        franka(arm(name), version, address, tmp_path) as (_, process, _),
        open_source(f"{name}://{address}", arm(name)) as source,
    ):
        samples = iter(source)
        for _ in range(200):
            next(samples)
        process.kill()
        with pytest.raises(SourceError, match="was lost"):
            list(samples)
    with pytest.raises(SourceError, match="cannot be reached"):
        open_source(f"{name}://{address}", arm(name))


@pytest.mark.parametrize("backlog", [0, 8], ids=["packets are dropped", "no error"])
@pytest.mark.parametrize(
    ("name", "package", "port"),
    [("panda", "panda_py", 1337), ("fr3", "pylibfranka", 1337), ("ur", "rtde_receive", 30004)],
)
def test_an_address_that_does_not_answer_is_given_up_before_the_client_does(name, package, port, backlog, address):
    """A listener that accepts nobody: with its queue full the kernel drops packets, as a wrong address does."""
    pytest.importorskip(package, reason=f"{package} has no wheel for this Python")
    with socket.create_server((address, port), backlog=backlog), contextlib.ExitStack() as stack:
        if not backlog:
            for _ in range(3):
                waiting = stack.enter_context(socket.socket())
                waiting.setblocking(False)
                waiting.connect_ex((address, port))
        # the FR3's client gives up an unanswered connection after a second itself
        text = "Connection timeout" if name == "fr3" and not backlog else "it does not answer"
        with pytest.raises(SourceError, match=rf"at {address} cannot be reached \(.*{text}.*\): check its address"):
            open_source(f"{name}://{address}", arm("ur10e" if name == "ur" else name))


def test_the_wrong_client_for_a_robot_says_which_is_the_right_one(system, address, tmp_path):
    name, version = system
    with (
        franka(arm(name), 15 - version, address, tmp_path),
        pytest.raises(SourceError, match=r"cannot be reached.*(a Panda is panda|an FR3 is fr3)"),
    ):
        open_source(f"{name}://{address}", arm(name))


def test_the_thread_that_opens_a_robot_keeps_its_priority(system, address, tmp_path):
    name, version = system
    with franka(arm(name), version, address, tmp_path), FrankaSource(address, arm(name), name) as source:
        assert os.sched_getscheduler(0) == os.SCHED_OTHER
        source.state()
        assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_the_maker_s_model_means_by_a_load_what_we_mean(address, tmp_path):
    """libfranka's own rigid-body model, fed with our arm and our load, needs the gravity torque we expect."""
    pytest.importorskip("pylibfranka", reason="pylibfranka has no wheel for this Python")
    robot = arm("fr3")
    mass, *rest = to_order(LOAD, "franka")
    with franka(robot, 10, address, tmp_path), FrankaSource(address, robot) as source:
        model = source.robot.load_model()
        source.set_load(mass, rest[:3], rest[3:])
        for _ in range(20):
            state = source.robot.read_once()
            if state.m_load > 0:
                break
        assert state.m_load == pytest.approx(mass)
        loaded, q = robot.with_payload(LOAD), np.array(state.q)
        np.testing.assert_allclose(np.array(model.gravity(state)), loaded.torque(q), atol=1e-5)
        theirs = np.array(model.mass(state)).reshape(7, 7)
        np.testing.assert_allclose(theirs, loaded.mass_matrix(q), atol=1e-7)
        assert np.abs(loaded.torque(q) - robot.torque(q)).max() > 1.0


def test_a_ur_arm_gives_positions_velocities_and_currents_as_torque(address, tmp_path, capfd):
    pytest.importorskip("rtde_receive", reason="ur-rtde has no wheel for this Python")
    robot = arm("ur10e")
    run = simulate(robot, random_motion(robot, 1), heavy_payload(), rate=500.0, duration=2.2)
    constants = np.array(ARMS["ur10e"].torque_constants)
    t = 100.0 + run.t
    log = {"timestamp": t, "actual_q": run.q, "actual_qd": run.dq, "actual_current": run.tau / constants}
    with serving("ur_server", log, address, tmp_path) as (_, events):
        with open_source(f"ur://{address}", robot, record=tmp_path / "run.csv") as source:
            assert (source.n, source.rate) == (6, 500.0)
            rows, text = collect(source)
        asked = next(event for event in events if event["event"] == "fields")
    assert asked["rate"] == 500.0
    assert "was lost" in text
    assert "see that the robot is switched on, its cable is in, and RTDE is enabled" in text
    with pytest.raises(SourceError, match="cannot be reached"):
        open_source(f"ur://{address}", robot)
    assert capfd.readouterr() == ("", "")  # the client prints a line of its own at either end
    place = np.round(500 * (rows[:, 0] - t[0])).astype(int)
    assert np.all(np.diff(place) > 0)
    np.testing.assert_array_equal(rows[:, :13], np.column_stack([t, run.q, run.dq])[place])
    np.testing.assert_allclose(rows[:, 13:], run.tau[place], rtol=1e-12)
    assert len(place) > 0.2 * len(t)  # the client keeps only the newest
    assert len(read_recording(tmp_path / "run.csv", robot)) == len(place)


def test_a_reader_that_did_not_run_for_a_while_has_not_lost_its_ur_arm(address, tmp_path):
    pytest.importorskip("rtde_receive", reason="ur-rtde has no wheel for this Python")
    robot = arm("ur10e")
    t = 100.0 + np.arange(3000) / 500.0
    log = {"timestamp": t, **dict.fromkeys(("actual_q", "actual_qd", "actual_current"), np.zeros((3000, 6)))}
    with serving("ur_server", log, address, tmp_path), open_source(f"ur://{address}", robot) as source:
        samples = iter(source)
        before = next(samples).t
        source.process.send_signal(signal.SIGSTOP)
        time.sleep(1.5)
        source.process.send_signal(signal.SIGCONT)
        while (now := next(samples).t) < before + 1.5:
            assert now >= before

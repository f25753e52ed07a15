"""What is told to a controller: only at rest, of what is determined, within the rating, in steps that move nothing."""

import contextlib
import json
import re
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload.arms import arm
from armload.devices import Counted, Detached, Load, check_writable, controller_of
from armload.devices.opening import check_spec
from armload.errors import SentError, SinkError, SourceError, SourceSetupError, UsageError
from armload.inertia import InertialParameters, is_consistent
from armload.motion import FourierMotion, save_motion, taie2024
from armload.online import OnlineEstimate, OnlineIdentifier
from armload.payloads import test_payload
from armload.service import ArmSettings
from armload.service.feedback import STEP, Feedback
from armload.simulation import simulate

SERVERS = Path(__file__).resolve().parents[1] / "devices" / "servers"
HELD = test_payload().parameters
HAND = InertialParameters.from_com(0.7, (0.0, 0.0, 0.04), 2e-3 * np.eye(3), "panda_link8")
Q = np.array([0.0, 0.4, 0.0, -1.6, 0.0, 2.0, 0.7])


@pytest.fixture
def answer(analytic_log, kept):
    """What a stream says of the test payload."""
    if "said" not in kept:
        with contextlib.closing(OnlineIdentifier(arm("panda"), method="map")) as identifier:
            for sample in analytic_log(arm("panda"), HELD, duration=3.0):
                kept["said"] = identifier.update(*sample)
    return kept["said"]


@pytest.fixture(scope="module")
def kept():
    """What is made once."""
    return {}


def changed(said: OnlineEstimate, **fields) -> OnlineEstimate:
    return OnlineEstimate.of({**vars(said), **fields})


class Asked:
    """A controller that takes what the guard lets through, and keeps it."""

    def __init__(self, end_effector=0.0, rated=None):
        panda = arm("panda")
        self.arm = panda if rated is None else replace(panda, rated_payload=rated)
        self.dq, self.end_effector, self.deaf, self.ended = [0.0] * 7, end_effector, False, 0
        self.told = [InertialParameters.zero("panda_link8")]

    def counted(self):
        return Counted(self.dq, self.end_effector, self.told[-1])

    def put(self, load):
        body = check_writable(
            load,
            self.arm,
            moving=False,
            end_effector=self.end_effector,
            write=True,
            allow_undetermined_inertia=True,
            allow_nothing=True,
        )
        if not self.deaf:
            self.told.append(body)

    def done(self):
        self.ended += 1

    def close(self):
        pass


def feedback(controller, mounted=None):
    notes = []
    return Feedback(arm("panda"), controller, mounted, notes.append), notes


def told(one, said, known=True, most=200, doubts=()):
    """Let it step until it waits."""
    for _ in range(most):
        one.offer(said, Q, known, doubts)
        one.step()
        if one.waits is None or not one.waits.startswith("told in steps"):
            return one.waits
    raise AssertionError("it goes on and on")


def test_a_load_goes_in_steps_of_which_none_changes_a_joint_s_torque_by_more_than_its_share(answer):
    controller = Asked()
    one, notes = feedback(controller)
    assert told(one, answer) is None
    steps, panda = controller.told, arm("panda")
    np.testing.assert_allclose(steps[-1].phi, answer.phi, atol=1e-9)
    torques = np.array([panda.with_payload(body).torque(Q) if body.mass else panda.torque(Q) for body in steps])
    share = np.abs(np.diff(torques, axis=0)) / panda.limits.effort
    assert len(steps) > 5
    assert share.max() <= STEP * (1.0 + 1e-6)
    assert all(is_consistent(body.phi) for body in steps[1:])
    assert notes == [f"the controller counts {answer.phi[0]:.3f} kg"]
    assert controller.ended == 1


def test_what_is_put_down_is_told_in_steps_down_to_nothing(answer):
    controller = Asked()
    one, _ = feedback(controller)
    told(one, answer)
    empty = changed(answer, phi=np.zeros(10), held=False, determined=np.ones(10, dtype=bool))
    before = len(controller.told)
    assert told(one, empty) is None
    assert len(controller.told) - before > 5
    assert not controller.told[-1].phi.any()


def test_an_answer_in_doubt_is_not_told_but_what_was_put_down_is(answer):
    controller = Asked()
    one, _ = feedback(controller)
    doubts = ("the base leans by 5°",)
    assert told(one, answer, doubts=doubts) == "the answer is in doubt: the base leans by 5°"
    assert len(controller.told) == 1
    told(one, answer)
    empty = changed(answer, phi=np.zeros(10), held=False, determined=np.ones(10, dtype=bool))
    assert told(one, empty, doubts=doubts) is None
    assert not controller.told[-1].phi.any()


@pytest.mark.parametrize(
    ("fields", "known", "says"),
    [
        ({}, False, "the answer is unknown"),
        ({"age": 11.0}, True, "the arm has stood for long: it moves first"),
        ({"determined": np.array([True, False, *[True] * 8])}, True, "the centre of mass is undetermined"),
    ],
)
def test_nothing_is_told_of_what_is_not_known(answer, fields, known, says):
    controller = Asked()
    one, _ = feedback(controller)
    assert told(one, changed(answer, **fields), known) == says
    assert len(controller.told) == 1


def test_nothing_is_told_to_an_arm_that_moves(answer):
    controller = Asked()
    controller.dq = [0.0, 0.02, *[0.0] * 5]
    one, _ = feedback(controller)
    assert told(one, answer) == "the arm moves"
    assert len(controller.told) == 1


def test_what_the_guard_refuses_is_said_once_and_not_told(answer):
    controller = Asked(rated=1.0)
    one, notes = feedback(controller)
    heavy = changed(answer, phi=10.0 * answer.phi)
    for _ in range(3):
        waits = told(one, heavy)
    assert controller.told[-1].mass <= 1.0
    assert "rated for 1 kg" in waits
    assert len(notes) == 1


def test_a_controller_that_does_not_count_what_it_was_told_is_refused(answer):
    controller = Asked()
    controller.deaf = True
    one, _ = feedback(controller)
    assert "was told" in told(one, answer)


def test_whatever_a_controller_fails_with_is_said_once_and_it_is_tried_again(answer):
    class Failing(Asked):
        def __init__(self, what):
            super().__init__()
            self.fails = what

        def counted(self):
            self.fail("counted")
            return super().counted()

        def done(self):
            self.fail("done")
            super().done()

        def fail(self, what):
            if self.fails == what:
                raise RuntimeError("lost\nat once")

    for what in ("counted", "done"):
        controller = Failing(what)
        one, notes = feedback(controller)
        for _ in range(3):
            one.offer(answer, Q, what == "counted")
            one.step()
            assert one.waits == "lost at once"
        assert notes == ["no load is told to the controller: lost at once"]
        controller.fails = None
        assert told(one, answer) is None


def test_what_ur_rtde_raises_is_an_error_of_the_robot_and_the_next_look_connects_again(monkeypatch):
    def lost(*_):
        raise RuntimeError("lost")

    still = {"isConnected": lambda: True, "getActualQd": lambda: [0.0] * 6, "disconnect": lambda: None}
    nothing = {"getPayload": lambda: 0.0, "getPayloadCog": lambda: [0.0] * 3, "getPayloadInertia": lambda: [0.0] * 6}
    receives = [SimpleNamespace(**still, **{key: lost for key in nothing}), SimpleNamespace(**still, **nothing)]
    control = SimpleNamespace(setTargetPayload=lambda *_: True, stopScript=lost, disconnect=lambda: ended.append(None))
    ended, robot = [], arm("ur10e")
    for module, name, made in (
        ("rtde_receive", "RTDEReceiveInterface", lambda *_: receives.pop(0)),
        ("rtde_control", "RTDEControlInterface", lambda *_: control),
    ):
        monkeypatch.setitem(sys.modules, module, SimpleNamespace(**{name: made}))
    controller = controller_of("ur://127.0.0.1", robot, lambda: None)
    with pytest.raises(SourceError, match=r"127\.0\.0\.1 .*lost"):
        controller.counted()
    assert controller.counted().load.mass == 0.0
    controller.put(Load(InertialParameters.zero("tool0"), (True,) * 10))
    with pytest.raises(SinkError, match=r"127\.0\.0\.1 .*lost"):
        controller.done()
    controller.close()
    assert len(ended) == 1


@pytest.mark.parametrize(("end_effector", "mass"), [(0.0, 0.7), (0.7, 0.0)])
def test_what_was_mounted_is_told_where_the_robot_does_not_count_it_already(answer, end_effector, mass):
    controller = Asked(end_effector)
    one, _ = feedback(controller, HAND)
    assert told(one, changed(answer, relative_to="tare")) is None
    assert controller.told[-1].mass == pytest.approx(answer.phi[0] + mass, abs=1e-9)


def test_what_lacks_something_that_nobody_names_is_not_told(answer):
    one, _ = feedback(controller := Asked())
    assert "add what was mounted then" in told(one, changed(answer, relative_to="tare"))
    assert len(controller.told) == 1


def test_only_a_robot_s_source_can_be_told():
    with pytest.raises(SourceError, match="no load can be written to sim"):
        controller_of("sim", arm("panda"), lambda: None)
    with pytest.raises(UsageError, match=r"left: no load can be written to run\.csv"):
        ArmSettings("panda", name="left", source="run.csv", apply="auto")


def told_at(spec, robot):
    """The kind of controller behind a source; that its client is not installed is said of a robot that can be told."""
    try:
        return type(controller_of(spec, arm(robot), lambda: None))
    except SourceSetupError:
        return SourceSetupError


@pytest.mark.parametrize(("source", "robot"), [("ur://127.0.0.1", "ur10e"), ("fr3://127.0.0.1", "fr3")])
def test_a_robot_that_can_be_read_can_be_told_however_its_address_is_written(source, robot):
    scheme, address = source.split("://")
    for spec in (source, f"{scheme.upper()}://{address}", f"{scheme.capitalize()}://{address}"):
        check_spec(spec)
        assert ArmSettings(robot, name="left", source=spec, apply="auto").source == spec
        assert told_at(spec, robot) is told_at(source, robot)


# ---------------------------------------------------------------------- loopback robots and the makers' clients


@contextlib.contextmanager
def robot_at(program, *arguments, orders=""):
    """A loopback robot's process, killed whatever happens, and what it says; it gets `orders` once it is ready."""
    command = [sys.executable, str(SERVERS / f"{program}.py"), *map(str, arguments)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        said, ready = [], threading.Event()

        def hear():
            for line in process.stdout:
                said.append(json.loads(line))
                ready.set()

        thread = threading.Thread(target=hear, daemon=True)
        thread.start()
        try:
            assert ready.wait(60.0)
            process.stdin.write(orders)
            process.stdin.flush()
            yield said
        finally:
            process.kill()
            thread.join(30.0)


def told_by_its_client(controller, said, robot):
    """Steps until the robot counts it; what it counts then."""
    one = Feedback(robot, controller, InertialParameters.zero(robot.frame), lambda _: None)
    until = time.monotonic() + 400.0
    try:
        while time.monotonic() < until:
            one.offer(said, np.zeros(robot.n) + 0.5, True)
            one.step()
            if one.waits is None:
                return controller.counted().load
            time.sleep(0.02)
    finally:
        one.close()
    raise AssertionError(one.waits)


def told_by_a_service(source, mass, near, seconds, *more):
    """`armload serve SOURCE --apply auto` until the controller counts about so many kg, which are returned as shown."""
    command = [sys.executable, "-m", "armload", "serve", source, "--apply", "auto", "--mounted", "nothing", *more]
    end = time.monotonic() + seconds
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as service:
        assert service.stdout is not None
        try:
            for text in service.stdout:
                line = json.loads(text)
                applied = line.get("applied")
                if applied and applied["waits"] is None and abs(applied["mass"] - mass) < near:
                    break
                assert line.get("connection") != "ended"
                assert time.monotonic() < end, line
        finally:
            service.terminate()
            service.wait(60.0)
    assert service.returncode == 0
    return applied["mass"]


@pytest.mark.full
@pytest.mark.parametrize(("name", "package", "version"), [("panda", "panda_py", 5), ("fr3", "pylibfranka", 10)])
def test_a_franka_robot_counts_what_was_identified_and_nothing_again_once_it_is_put_down(
    answer, name, package, version, tmp_path
):
    pytest.importorskip(package, reason=f"{package} has no wheel for this Python")
    robot = arm(name)
    said = changed(answer, frame=robot.frame, phi=0.3 * answer.phi, around=0.3 * answer.phi)
    still = {"t": 10.0 + 1e-3 * np.arange(240_000)}
    still |= {key: np.full((240_000, 7), x) for key, x in (("q", 0.5), ("dq", 0.0), ("tau", 1.0))}
    log = tmp_path / "still.npz"
    np.savez(log, **still)
    urdf = tmp_path / "robot.urdf"
    limits = r'\1<position_based_velocity_limits velocity_offset="0.2" deceleration_limit="5.0" />'
    urdf.write_text(re.sub(r"(<limit [^>]*/>)", limits, robot.urdf.replace(f"{name}_", "")))
    address = "127.0.7.77"
    with (
        robot_at("franka_server", log, "--address", address, "--version", version, "--urdf", urdf) as s,
        contextlib.closing(Detached(f"{name}://{address}", robot)) as source,
    ):
        controller = controller_of(f"{name}://{address}", robot, lambda: source)
        counted = told_by_its_client(controller, said, robot)
        np.testing.assert_allclose(counted.phi, said.phi, atol=1e-5)
        loads = [event["numbers"][0] for event in s if event["event"] == "load"]
        assert len(loads) > 2
        assert loads == sorted(loads)
        nothing = changed(said, phi=np.zeros(10), held=False, determined=np.ones(10, dtype=bool))
        assert told_by_its_client(controller, nothing, robot).mass == 0.0


@pytest.mark.full
def test_a_ur_counts_what_was_identified_through_the_real_control_interface(answer):
    pytest.importorskip("rtde_control", reason="ur-rtde has no wheel for this Python")
    robot = arm("ur10e")
    said = changed(answer, frame=robot.frame, phi=0.3 * answer.phi, around=0.3 * answer.phi)
    address = "127.0.7.78"
    with robot_at("ur_robot", "0.5,-1.2,1.5,-0.8,0.5,0.5", "--address", address) as s:
        controller = controller_of(f"ur://{address}", robot, lambda: None)
        counted = told_by_its_client(controller, said, robot)
        np.testing.assert_allclose(counted.phi, said.phi, atol=1e-6)
        events = [event["event"] for event in s]
    assert events.count("payload") > 1
    assert events.count("script") == 1
    assert "moving" not in events


@pytest.mark.full
@pytest.mark.timeout(900)
def test_a_service_tells_its_robot_what_it_identified_and_reads_it_back(tmp_path):
    """`armload serve fr3://… --apply auto` beside a loopback robot that moves and rests with a payload, in turns."""
    pytest.importorskip("pylibfranka", reason="pylibfranka has no wheel for this Python")
    robot = arm("fr3")
    held = InertialParameters(0.3 * HELD.phi, robot.frame)
    moved = simulate(robot, taie2024(), held, rate=1000.0)
    still, turns, address = 15_000, 6, "127.0.7.79"
    rest = robot.with_payload(held).torque(moved.q[-1]) + np.random.default_rng(1).normal(0.0, 0.02, (still, 7))
    once = {
        "q": np.vstack([moved.q, np.repeat(moved.q[-1:], still, axis=0)]),
        "dq": np.vstack([moved.dq, np.zeros((still, 7))]),
        "tau": np.vstack([moved.tau, rest]),
    }
    log, urdf = tmp_path / "turns.npz", tmp_path / "robot.urdf"
    rows = turns * len(once["q"])
    np.savez(log, t=10.0 + 1e-3 * np.arange(rows), **{key: np.tile(each, (turns, 1)) for key, each in once.items()})
    limits = r'\1<position_based_velocity_limits velocity_offset="0.2" deceleration_limit="5.0" />'
    urdf.write_text(re.sub(r"(<limit [^>]*/>)", limits, robot.urdf.replace("fr3_", "")))
    command = ("franka_server", log, "--address", address, "--version", 10, "--urdf", urdf, "--real-time")
    with robot_at(*command) as said:
        shown = told_by_a_service(f"fr3://{address}", held.mass, 0.1, 300.0)
        loads = [event["numbers"] for event in said if event["event"] == "load"]
    masses = [numbers[0] for numbers in loads]
    assert len(masses) > 2
    assert masses[-1] == pytest.approx(shown, abs=1e-5)  # what the service shows was read back
    np.testing.assert_allclose(loads[-1][1:4], held.com, atol=0.03)


@pytest.mark.full
@pytest.mark.timeout(900)
def test_a_service_tells_a_ur_between_two_motions_of_its_program_what_it_identified(tmp_path):
    """`armload serve ur://… --apply auto` beside a loopback UR whose own program moves and rests, through ur-rtde."""
    pytest.importorskip("rtde_control", reason="ur-rtde has no wheel for this Python")
    centre, address = np.array([0.3, -1.2, 1.4, -1.0, 1.3, 0.4]), "127.0.7.80"
    sine = 0.25 * np.array([[1.0, 0.3, -1.6 / 3]] * 6) * np.linspace(0.5, 1.0, 6)[:, None]
    cosine = 0.2 * np.array([[1.0, -1.0, 1.0 / 3]] * 6) * np.linspace(1.0, 0.6, 6)[:, None]
    motion = FourierMotion(centre, sine, cosine, 6.0, "program").smooth()
    program = tmp_path / "program.json"
    save_motion(program, motion)
    at = ",".join(f"{x:.6f}" for x in motion.position([0.0])[0])
    orders = f"mount\nwork {program}\n"
    with robot_at("ur_robot", "--address", address, "--", at, orders=orders) as said:
        shown = told_by_a_service(f"ur://{address}", HELD.mass, 0.5 * HELD.mass, 400.0, "--robot", "ur10e")
        scripts = [event for event in said if event["event"] == "script"]
        loads = [event["numbers"] for event in said if event["event"] == "payload"]
    assert len(loads) > 2
    assert loads[-1][0] == pytest.approx(shown, abs=1e-5)  # what the service shows was read back
    assert loads[-1][0] == pytest.approx(HELD.mass, abs=0.3)
    np.testing.assert_allclose(loads[-1][1:4], HELD.com, atol=0.03)
    assert scripts
    assert all(event["speed"] < 0.02 for event in scripts), scripts  # [rad/s]
    assert "moving" not in [event["event"] for event in said]  # no script commanded a motion


def test_what_was_not_taken_is_not_told_again_at_once_but_another_load_and_who_asks_are(answer, monkeypatch):
    class Refusing(Asked):
        def put(self, load):
            super().put(load)
            self.told.pop()
            tried.append(load.parameters.mass)
            raise SentError("the robot refused the load")

    monkeypatch.setattr("armload.service.feedback._FIRST", 1e6)  # [s]
    monkeypatch.setattr("armload.service.feedback._MOST", 1e6)
    tried = []
    one, notes = feedback(Refusing())
    for _ in range(20):
        one.offer(answer, Q, True)
        one.step()
    assert len(tried) == 1
    assert one.waits.startswith("the robot refused the load (told again in ")
    assert one.mass == 0.0  # as the controller says, which was asked again
    assert notes == ["the robot refused the load"]
    one.offer(changed(answer, phi=1.5 * answer.phi), Q, True)
    one.step()
    assert len(tried) == 2
    one.offer(changed(answer, phi=1.5 * answer.phi), Q, True)
    assert one.finish() == "the robot refused the load"
    assert len(tried) == 3


def test_a_controller_that_is_lost_after_a_step_is_said_to_have_been_told_and_to_count_nobody_knows_what(answer):
    class Lost(Asked):
        def counted(self):
            if len(self.told) > 3:
                raise SourceError("the robot was lost")
            return super().counted()

    one, notes = feedback(Lost())
    waits = told(one, answer)
    assert "was told" in waits
    assert "does not say what it counts now (the robot was lost)" in waits
    assert one.mass is None
    assert notes == [waits]


def test_a_refusal_between_two_steps_says_how_much_is_counted(answer):
    class Tired(Asked):
        def put(self, load):
            if len(self.told) > 3:
                raise SinkError("the robot refused the load")
            super().put(load)

    one, _ = feedback(controller := Tired())
    mass = answer.phi[0]
    waits = told(one, answer)
    assert waits == f"the robot refused the load; it counts {controller.told[-1].mass:.3f} of {mass:.3f} kg"


def test_a_controller_whose_client_waits_for_ever_is_said_to_be_silent_and_ends_nothing(answer, monkeypatch):
    asked, answers = threading.Event(), threading.Event()

    class Silent(Asked):
        def put(self, load):
            super().put(load)
            if len(self.told) == 3:
                asked.set()
                answers.wait()

        def close(self):
            self.ended = -1

    monkeypatch.setattr("armload.service.feedback._SILENT", 0.0)
    monkeypatch.setattr("armload.service.feedback.FRESH", 1e6)
    one, _ = feedback(controller := Silent())
    one.offer(answer, Q, True)
    one.step()
    assert one.applied()["mass"] == controller.told[-1].mass
    assert one.applied()["waits"].startswith("told in steps")
    one.start()
    assert asked.wait(30.0)
    said = one.applied()
    assert said["mass"] is None
    assert "the controller has not answered" in said["waits"]
    one.close()
    assert controller.ended != -1  # its client is busy
    answers.set()


def test_a_refused_step_ends_the_series(answer):
    class Refusing(Asked):
        def put(self, _):
            raise SinkError("the robot refused the load")

    one, _ = feedback(controller := Refusing())
    assert told(one, answer) == "the robot refused the load"
    assert controller.ended == 1

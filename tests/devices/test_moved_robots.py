"""`armload measure` on robots that are not there, through the makers' own clients.

Each server (`servers`) moves armload's simulated arm by the maker's protocol, and prints what it was told, in order.
"""

import functools
import json
import os
import pty
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from armload.arms import arm
from armload.devices.remote_mover import DetachedMover
from armload.errors import SourceError
from armload.excitation import Obstacle, Surroundings
from armload.inertia import to_order
from armload.motion import FourierMotion, save_motion
from armload.payloads import test_payload as held_payload
from armload.recording import read_recording

pytestmark = pytest.mark.full
SERVERS = Path(__file__).resolve().parent / "servers"
ROS_PYTHON = os.environ.get("ARMLOAD_ROS_PYTHON", str(SERVERS.parents[2] / ".venv-ros" / "bin" / "python"))
# what was started in the background of a shell is deaf to Ctrl-C, and so are its children
HEARS_CTRL_C = ("env", "--default-signal=INT")
POSES = {
    "ur10e": [0.3, -1.2, 1.4, -1.0, 1.3, 0.4],
    "panda": [0.0, -0.5, 0.1, -2.0, 0.1, 1.7, 0.5],
    "fr3": [0.0, -0.5, 0.1, -2.0, 0.1, 1.7, 0.5],
}
NEAR = 0.03  # [rad] that each joint stands away from where the motion begins
MAKES = {"ur": ("ur10e", "rtde_control", "ur_robot.py"), "fr3": ("fr3", "pylibfranka", "franka_robot.py")}
MAKES["panda"] = ("panda", "panda_py", "franka_robot.py")
MAKES["ros2"] = ("panda", None, "ros_robot.py")


class Late(Exception):
    """A client or its robot gave up the other: both have to answer within milliseconds, which tests cannot promise."""


def in_time(test):
    """Tried with a new robot, three times more at most, where a link was lost that nobody had cut.

    What made one late may last: each time a while after the one before.
    """

    @functools.wraps(test)
    def wrapped(serve):
        for wait in (2.0, 10.0, 30.0):
            try:
                return test(serve())
            except Late:
                time.sleep(wait)
        return test(serve())

    del wrapped.__wrapped__  # pytest asks for the arguments of what was wrapped
    return wrapped


class Served:
    """A server, what it said, and `armload measure` against it."""

    def __init__(self, make, tmp_path, address):
        self.name, _, program = MAKES[make]
        self.robot, self.folder = arm(self.name), tmp_path
        self.spec = "ros2:///joint_states" if make == "ros2" else f"{make}://{address}"
        self.python = ROS_PYTHON if make == "ros2" else sys.executable
        if make == "ros2":
            domain = str(101 + os.getpid() % 100)
            self.env = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": domain}
        else:
            self.env = dict(os.environ)
        self.events, self.runs = [], []
        pose = np.array(POSES[self.name])
        sine = 0.12 * np.array([[1.0, 0.3, -1.6 / 3]] * len(pose)) * np.linspace(0.5, 1.0, len(pose))[:, None]
        cosine = 0.1 * np.array([[1.0, -1.0, 1.0 / 3]] * len(pose)) * np.linspace(1.0, 0.6, len(pose))[:, None]
        self.motion = FourierMotion(pose, sine, cosine, 5.0, "small").smooth()
        save_motion(tmp_path / "small.json", self.motion)
        at = ",".join(f"{x:.6f}" for x in self.motion.position([0.0])[0] + NEAR)
        command = [self.python, SERVERS / program, "--robot", self.name, "--address", address, "--", at]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=self.env)
        self.listener = threading.Thread(target=self._listen, daemon=True)
        self.listener.start()
        try:
            self.wait("ready")
        except BaseException:
            self.close()
            raise

    def _listen(self):
        for line in self.process.stdout:
            self.events.append(json.loads(line))

    def said(self, since=0):
        return [event["event"] for event in self.events[since:]]

    def wait(self, event, since=0, seconds=90.0, run=None):
        until = time.monotonic() + seconds
        while event not in self.said(since):
            if time.monotonic() > until or (run is not None and run.poll() is not None):
                pytest.fail(f"no {event} among {self.said(since)}" + ("" if run is None else run.communicate()[1]))
            time.sleep(0.02)

    def box_in_the_way(self):
        """A box where the motion goes farthest from its start: nothing touches it before."""
        q = self.motion.position(np.linspace(0.0, self.motion.duration, 200))
        place = self.robot.frame_pose(q)[1]
        box = Obstacle(tuple(place[np.linalg.norm(place - place[0], axis=1).argmax()].tolist()), (0.02, 0.02, 0.02))
        before = np.linspace(q[0] + NEAR, q[0], 20)
        assert Surroundings(self.robot, None, (box,)).clearance(before)[:, 2].min() > 0.05
        return "--box=" + ",".join(f"{x:.4f}" for x in (*box.centre, *box.edges))

    def measure(self, *arguments, wait=True, typed=None):
        told = f"sh -c {shlex.quote('echo mount > ' + str(self.folder / 'told'))}"
        self.logs = self.folder / f"logs{len(self.runs)}"
        command = [self.python, "-m", "armload", "measure", self.spec, "--robot", self.name, "--method", "map"]
        command += ["--off-path", "0.3"]  # a busy machine is late: what stops an arm off its path is in test_movers.py
        command += ["--motion", self.folder / "small.json", "--dir", self.logs, "--grip", told]
        terminal = pty.openpty() if typed is not None else None
        try:
            run = subprocess.Popen(
                [*HEARS_CTRL_C, *map(str, command), *map(str, arguments)],
                stdin=subprocess.DEVNULL if terminal is None else terminal[1],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env=self.env,
            )
            self.runs.append(run)
            if terminal is not None:
                os.write(terminal[0], f"{typed}\n".encode())
                return self._ended(run)
        finally:
            for end in terminal or ():
                os.close(end)
        threading.Thread(target=self._mount, args=(run,), daemon=True).start()
        return self._ended(run) if wait else run

    @staticmethod
    def _ended(run):
        out, err = run.communicate(timeout=240.0)
        if run.returncode == 2:
            in_vain(err)
        return run.returncode, out, err

    def _mount(self, run):
        while run.poll() is None:
            if (self.folder / "told").exists():
                (self.folder / "told").unlink()
                self.process.stdin.write("mount\n")
                self.process.stdin.flush()
            time.sleep(0.02)

    def close(self):
        for run in self.runs:  # what a failing test has left
            run.kill()
            if not run.stdout.closed:
                run.communicate()
        self.process.kill()
        self.process.wait()
        self.listener.join(60.0)
        for stream in (self.process.stdin, self.process.stdout):
            stream.close()


def in_vain(err):
    """Raise `Late` where a run says that the link was lost."""
    if any(words in err for words in ("was lost", "stopped by itself", "no state for", "did not answer within")):
        raise Late(err)


@pytest.fixture(params=MAKES)
def serve(request, tmp_path):
    """Starts a robot; the one before is gone then."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    if request.param == "ros2":
        if not Path(ROS_PYTHON).exists():
            pytest.skip("no ROS 2: make .venv-ros/.stamp, or ARMLOAD_ROS_PYTHON")
    else:
        pytest.importorskip(MAKES[request.param][1], reason="the maker's client has no wheel for this Python")
    made = []

    def start():
        for before in made:
            before.close()
        (folder := tmp_path / str(len(list(tmp_path.iterdir())))).mkdir()
        made[:] = [Served(request.param, folder, f"127.0.7.{40 + worker}")]
        return made[0]

    yield start
    for last in made:
        last.close()


def child_of(process):
    """The process that streams the commands."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    return int(children[0])


@in_time
def test_nothing_moves_without_consent_nor_past_a_limit_nor_into_a_box(served):
    for arguments, typed, said in (
        ((), None, "nobody is at a terminal to agree"),
        ((), "no", "nothing was moved: there was no consent"),
        (("--move", "--floor", "0.9"), None, "the arm hits the floor"),
        (("--move", "--approach", "0.02"), None, "more than the 0.02 rad of --approach"),
        (("--move", served.box_in_the_way()), None, "the arm hits a box: "),
        ((served.box_in_the_way(),), "yes", "the arm hits a box: "),  # nobody is asked: a yes does not help
    ):
        code, out, err = served.measure(*arguments, typed=typed)
        assert (code, out) == (2, "")
        assert said in err.splitlines()[-1]
    code, out, _ = served.measure("--dry-run")
    assert code == 0
    assert "with the payload: small, 5.0 s" in out
    assert set(served.said()) == {"ready"}


@in_time
def test_whatever_ends_it_the_arm_comes_to_rest_and_the_log_can_be_read(served):
    path = served.motion.position(np.linspace(0.0, served.motion.duration, 5001))
    ways = ["Ctrl-C", "kill", "kill of the one that streams"]
    for how in ways[:2] if served.spec.startswith("ros2") else ways:  # ROS 2's controller needs no stream
        since = len(served.events)
        run = served.measure("--move", wait=False)
        log = served.logs / "empty.csv"
        until = time.monotonic() + 120.0
        while not (log.exists() and served.said(since).count("moving") == 2):  # to the start, and then
            assert time.monotonic() < until, served.said(since)
            if run.poll() is not None:
                err = run.communicate()[1]
                in_vain(err)
                pytest.fail(err)
            time.sleep(0.02)
        since = len(served.events)  # a busy machine may let the arm come to rest before it is told to
        time.sleep(1.5)
        if how == "Ctrl-C":
            run.send_signal(signal.SIGINT)
        elif how == "kill":
            run.kill()
        else:
            os.kill(child_of(run), signal.SIGKILL)
        served.wait("rest", since, 20.0)
        _, err = run.communicate(timeout=60.0)
        rest = np.array(next(event for event in served.events[since:] if event["event"] == "rest")["q"])
        if how != "kill of the one that streams":  # then the robot's own brake leaves the path
            assert np.abs(path - rest).max(axis=1).min() < 0.01
        assert run.returncode == {"Ctrl-C": 130, "kill": -9}.get(how, 2)
        if run.returncode == 2:
            assert "what was recorded until then is in" in err
        recording = read_recording(log, served.robot)
        assert np.abs(recording.dq).max() > 0.02


@in_time
def test_a_robot_that_loses_its_power_ends_the_measurement_soon_with_a_sentence(served):
    run = served.measure("--move", wait=False)
    log = served.logs / "empty.csv"
    until = time.monotonic() + 120.0
    while not (log.exists() and served.said().count("moving") == 2):  # to the start, and then
        assert time.monotonic() < until, served.said()
        if run.poll() is not None:
            err = run.communicate()[1]
            in_vain(err)
            pytest.fail(err)
        time.sleep(0.02)
    time.sleep(1.0)
    served.process.kill()
    out, err = run.communicate(timeout=40.0)  # that its client waits for the robot to come back is no matter
    assert (run.returncode, out) == (2, "")
    assert f"what was recorded until then is in {log}" in err.splitlines()[-1]
    assert "Traceback" not in err
    assert read_recording(log, served.robot).duration > 0.3


@pytest.mark.parametrize("serve", ["fr3", "panda", "ur"], indirect=True)
@in_time
def test_an_order_is_obeyed_with_the_next_samples_even_where_the_client_holds_the_interpreter(served):
    seen, answered = [0], []
    try:
        with DetachedMover(served.spec, served.robot) as mover:

            def count():
                for _ in mover:
                    seen[0] += 1

            counter = threading.Thread(target=count)
            counter.start()
            for _ in range(10):
                before = seen[0]
                mover.commanded()
                answered.append(seen[0] - before)
                time.sleep(0.03)
        counter.join()
    except SourceError as error:
        in_vain(str(error))
        raise
    assert seen[0] > 100
    assert np.median(answered) < 20  # a thread of its own for orders: a hundred and more, up to a second each


@in_time
def test_the_answer_is_written_in_the_controller_s_order_after_both_runs(served):
    out = served.folder / "answer.json"
    writes = ("--apply", "--mounted", "nothing", "--undetermined-inertia")
    if served.spec.startswith("ros2"):
        assert "takes no payload" in served.measure("--move", "--apply")[2]
        writes = ()
    code, _, err = served.measure("--move", *writes, "--out", out)
    assert code == 0, err
    answer = json.loads(out.read_text())
    truth = held_payload().parameters
    assert answer["mass"] == pytest.approx(
        truth.mass, abs=0.025 * served.robot.rated_payload
    )  # by a small, slow motion
    half = 0.5 * (np.array(answer["com_high"]) - answer["com_low"])
    assert np.all(np.abs(np.array(answer["com"]) - truth.com) < 2.0 * half)  # as sure as the loop's timing lets it be
    said = served.said()
    assert said.count("moving") == 3  # to the start, without and with the payload
    if not writes:
        assert "payload" not in said
        return
    assert said.index("mounted") < said.index("payload")
    numbers = next(event for event in served.events if event["event"] == "payload")["numbers"]
    written = to_order(held_payload().parameters, "ur" if served.name == "ur10e" else "franka")
    assert len(numbers) == len(written)
    assert numbers[0] == pytest.approx(answer["mass"], rel=1e-6)
    assert numbers[1:4] == pytest.approx(answer["com"], rel=1e-6)
    matrix = np.array(answer["inertia_com"])
    expected = matrix.ravel(order="F") if len(numbers) == 13 else matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    assert numbers[4:] == pytest.approx(expected.tolist(), rel=1e-6)


@pytest.mark.parametrize("serve", ["ur"], indirect=True)
@in_time
def test_an_arm_that_would_not_follow_is_told_by_the_plan_and_never_moved(served):
    for fault, says in (("slider", "its speed slider is at 50 %"), ("protective", "it is in a protective stop")):
        served.process.stdin.write(f"{fault}\n")
        served.process.stdin.flush()
        served.wait(fault)
        for argument in ("--dry-run", "--move"):
            code, out, err = served.measure(argument)
            assert (code, out) == (2, "")
            assert says in err.splitlines()[-1]
            assert "nothing was moved" in err.splitlines()[-1]
    assert not {"script", "moving"} & set(served.said())


@pytest.mark.parametrize("serve", ["ur"], indirect=True)
@in_time
def test_a_payload_that_the_controller_does_not_count_is_no_answer_that_was_written_nor_one_that_was_not(served):
    served.process.stdin.write("forget\n")
    served.process.stdin.flush()
    served.wait("forget")
    code, out, err = served.measure("--move", "--apply", "--mounted", "nothing", "--undetermined-inertia")
    assert (code, out) == (2, "")
    line = err.splitlines()[-1]
    assert "kg and counts 0.000 kg: see on its pendant" in line
    assert line.endswith("tells the answer")
    assert "written" not in line
    assert served.said().count("payload") == 1

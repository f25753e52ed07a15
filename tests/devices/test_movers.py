"""An arm that is moved: where a movement may begin, that it ends at rest, and what stops it."""

import itertools
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from armload.arms import arm
from armload.devices import Load, SimulatedMover, StreamedMover, Supervision, Thresholds
from armload.devices.franka.mover import FrankaMover
from armload.devices.remote_mover import DetachedMover, RemoteMover
from armload.devices.ur.mover import URMover
from armload.errors import SafetyError, SinkError, SourceError
from armload.inertia import InertialParameters
from armload.motion import Course, StraightMotion, random_motion, taie2024
from armload.payloads import test_payload as heavy_payload
from armload.recording import Sample
from armload.simulation import Run, World, simulate_many

MOTION = taie2024()
START = MOTION.position([0.0])[0]
RATE = 250.0
CYCLE = 4e-3  # [s] of an arm that streams


@pytest.fixture
def mover(panda):
    with SimulatedMover(panda, START, speed=None, rate=RATE, ahead=0.05) as made:
        yield made


def run(mover, motion, at=None, do=lambda: None):
    """Samples of a movement; `do` is called at the sample of that number."""
    mover.follow(motion)
    samples = []
    for sample in mover:
        samples.append(sample)
        if len(samples) == at:
            do()
        if not mover.moving:
            return samples
    raise AssertionError("the mover ended")


def test_a_movement_follows_its_motion_and_ends_at_rest(mover):
    samples = run(mover, MOTION)
    t = np.array([s.t for s in samples])
    np.testing.assert_allclose(np.diff(t), 1 / RATE, atol=1e-9)
    assert t[-1] - t[0] == pytest.approx(MOTION.duration, abs=0.3)
    q = np.array([s.q for s in samples])
    offsets = np.arange(-0.05, 0.05, 2e-3)
    assert min(np.abs(q - MOTION.position(t - t[0] - d)).max() for d in offsets) < 0.01
    assert np.abs(samples[-1].dq).max() < 1e-3
    assert mover.why is None


def test_an_arm_stands_until_it_is_moved(mover):
    q = np.array([sample.q for sample, _ in zip(mover, range(100), strict=False)])
    assert np.ptp(q, axis=0).max() < 1e-6
    mover.stop("nothing moves: this is no order for later")
    here = mover.commanded()
    assert len(run(mover, StraightMotion(here, here + 0.05, 1.0))) > 250


@pytest.mark.parametrize(
    ("motion", "said"),
    [
        (StraightMotion(START + 0.02, START, 2.0), "0.020 rad from where the motion"),
        (StraightMotion(START[:6], START[:6] + 0.1, 2.0), "moves 6 joints"),
    ],
)
def test_a_movement_begins_where_the_arm_is_or_not_at_all(mover, motion, said):
    with pytest.raises(SafetyError, match=said):
        mover.follow(motion)
    q = np.array([sample.q for sample, _ in zip(mover, range(100), strict=False)])
    assert np.ptp(q, axis=0).max() < 1e-6


def test_a_second_movement_waits_for_the_first(mover):
    mover.follow(MOTION)
    next(iter(mover))
    with pytest.raises(SafetyError, match="moves already"):
        mover.follow(MOTION)


def test_a_stop_ends_at_rest_on_the_path_within_the_braking_time(mover, panda):
    samples = run(mover, MOTION, 400, lambda: mover.stop("enough"))
    assert mover.why == "enough"
    path = MOTION.position(np.linspace(0.0, MOTION.duration, 6001))
    assert max(np.abs(path - s.q).max(axis=1).min() for s in samples[::20]) < 0.01
    assert np.abs(samples[-1].dq).max() < 0.01
    longest = max(Course(MOTION, panda.limits).braking_time(t) for t in (1.6, 1.62, 1.64))
    still = next(k for k in range(400, len(samples)) if all(np.abs(s.dq).max() < 0.02 for s in samples[k:]))
    assert (still - 400) / RATE < longest + 0.05 + 0.15  # computed ahead, and swinging out
    # it stands where it stopped, and goes on from there only by a motion that begins there
    with pytest.raises(SafetyError, match="from where the motion"):
        mover.follow(MOTION)
    here = mover.commanded()
    assert len(run(mover, StraightMotion(here, here + 0.05, 1.0))) > 200


def test_what_pushes_stops_the_arm(mover):
    mover._payload = InertialParameters(15.0 * heavy_payload().parameters.phi)
    samples = run(mover, MOTION, 400, mover.mount)
    assert "beside what a payload of 3 kg can cause" in mover.why
    assert len(samples) < 600
    assert np.abs(samples[-1].dq).max() < 0.1  # 22 kg swing on a Panda's springs


def test_a_payload_the_arm_is_rated_for_does_not(panda):
    rated = InertialParameters.from_com(3.0, (0.0, 0.0, 0.1), 0.004 * np.eye(3))
    with SimulatedMover(panda, START, mounted=rated, speed=None, rate=RATE, ahead=0.1) as mover:
        assert len(run(mover, MOTION)) > 1400
        assert mover.why is None


@pytest.mark.parametrize(("name", "most"), [("panda", 0.05), ("ur10e", 0.4)])
def test_arms_like_the_measured_ones_are_not_stopped(name, most):
    """The largest torque that no payload explains, of the rated one, over simulated worlds."""
    robot = arm(name)
    motion = MOTION if name == "panda" else random_motion(robot, 1)
    watch = Supervision(robot, motion, Thresholds())
    runs = [Run(motion, None, World.real_like(robot, seed)) for seed in range(4)]
    found = -1.0
    for log in simulate_many(robot, runs, rate=50.0, workers=1):
        ddq = motion(log.t)[2]
        for k, row in enumerate(zip(log.t, log.q, log.dq, log.tau, strict=True)):
            found = max(found, float(np.max(watch.beyond(Sample(*row), ddq[k], row[0]) / watch._effort)))
    assert found < most


def sample_of(robot, t, q, dq=None, tau=None):
    dq = np.zeros(robot.n) if dq is None else dq
    return Sample(t, q, dq, robot.torque(q, dq) if tau is None else tau)


def test_an_arm_may_be_late_but_not_off_its_path(panda):
    watch, course = Supervision(panda, MOTION, Thresholds()), Course(MOTION, panda.limits)
    for t in np.arange(0.0, 3.0, 0.1):
        late = MOTION(np.array([t - 0.2]))
        assert watch.problem(t, sample_of(panda, t, late[0][0], late[1][0]), course) is None
    off = MOTION.position([3.0])[0] + np.eye(7)[3] * 0.06
    said = watch.problem(3.0, sample_of(panda, 3.0, off), course)
    assert said is not None
    assert "panda_joint4 is 0.06" in said
    far = sample_of(panda, 3.0, MOTION.position([2.4])[0])  # where it should have been long ago
    assert "off the path" in watch.problem(3.0, far, course)


def test_a_torque_counts_when_it_lasts(panda):
    watch, course = Supervision(panda, MOTION, Thresholds()), Course(MOTION, panda.limits)
    q = MOTION.position([0.0])[0]
    hit = panda.torque(q) + np.array([0.0, 0, 0, 0, 0, 0, 11.0])
    times = np.arange(0.0, 0.06, 0.005)
    said = [watch.problem(t, sample_of(panda, t, q, tau=hit), course) is not None for t in times]
    assert said == [t >= 0.02 - 1e-9 for t in times]
    watch = Supervision(panda, MOTION, Thresholds())
    for t, tau in ((0.0, hit), (0.005, panda.torque(q)), (0.02, hit), (0.035, hit)):
        assert watch.problem(t, sample_of(panda, t, q, tau=tau), course) is None


def test_an_arm_of_which_nothing_is_heard_is_stopped(panda):
    watch, course = Supervision(panda, MOTION, Thresholds()), Course(MOTION, panda.limits)
    q, silent = MOTION.position([0.0])[0], np.full(7, np.nan)
    assert watch.problem(0.0, sample_of(panda, 0.0, q), course) is None
    assert watch.problem(0.05, Sample(0.05, silent, silent, silent), course) is None
    assert "no usable sample for 0.15 s" in watch.problem(0.15, Sample(0.15, silent, silent, silent), course)


@pytest.mark.parametrize("wrong", [{"tracking": 0.0}, {"external": -1.0}, {"tracking": float("nan")}])
def test_thresholds_are_positive(wrong):
    with pytest.raises(SafetyError, match="expected a positive number"):
        Thresholds(**wrong)


class Controls:
    """What ur-rtde's control client is asked; it fails at `fails`, as that raises."""

    def __init__(self, fails=""):
        self.fails, self.asked = fails, []

    def __call__(self, *_):
        return self.do("connect") or self

    def __getattr__(self, name):
        return lambda *_: self.do(name)

    def do(self, name):
        self.asked.append(name)
        if name == self.fails:
            raise RuntimeError(f"{name}:\n no")


@pytest.fixture
def ur(monkeypatch):
    """A factory of UR movers whose control client fails at something."""
    robot = arm("ur10e")
    still = {"getActualQd": lambda: [0.0] * 6, "getTargetQ": lambda: [0.0] * 6, "isConnected": lambda: True}
    still |= {"getRobotMode": lambda: 7, "getSafetyMode": lambda: 1, "getTargetSpeedFraction": lambda: 1.0}
    counts = {"getPayload": lambda: 1.0, "getPayloadCog": lambda: [0.0, 0.0, 0.1]}
    counts["getPayloadInertia"] = lambda: [1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0]
    receive = SimpleNamespace(**still, **counts, disconnect=lambda: None)
    received = SimpleNamespace(RTDEReceiveInterface=lambda *_: receive)
    monkeypatch.setitem(sys.modules, "rtde_receive", received)

    def make(fails):
        controls = Controls(fails)
        monkeypatch.setitem(sys.modules, "rtde_control", SimpleNamespace(RTDEControlInterface=controls))
        return URMover("127.0.0.1", robot), controls

    return make


@pytest.mark.parametrize(
    ("fails", "says"),
    [
        ("connect", "takes no payload .connect: no.: set it to remote control"),
        ("setTargetPayload", "refused the payload: setTargetPayload: no"),
        ("stopScript", "^the arm counts the payload, but .* cannot be ended .stopScript: no.: see whether it runs"),
    ],
)
def test_a_ur_that_takes_no_payload_is_a_sentence_and_its_script_is_ended(ur, fails, says):
    mover, controls = ur(fails)
    load = Load(InertialParameters.from_com(1.0, (0.0, 0.0, 0.1), 1e-3 * np.eye(3), "tool0"))
    with pytest.raises(SinkError, match=says) as said:
        mover.write(load)
    assert "\n" not in str(said.value)
    assert controls.asked[-1] == ("connect" if fails == "connect" else "disconnect")


@pytest.mark.parametrize("fails", ["connect", "setWatchdog"])
def test_a_ur_that_takes_no_movements_is_a_sentence_whatever_else_fails(ur, fails):
    mover, controls = ur(fails)
    controls.servoStop = lambda *_: controls.do(fails)
    motion = StraightMotion(np.zeros(6), 0.1 * np.ones(6), 2.0)
    with pytest.raises(SafetyError, match=f"does not take movements .{fails}: no.: switch it on"):
        mover.follow(motion)
    assert not mover.moving
    mover.close()


def test_a_ur_that_does_not_follow_is_stopped_and_what_may_hold_it_is_said(ur):
    """In a protective stop, or behind a speed slider, states and targets go on as if nothing had happened."""
    mover, controls = ur("")
    controls.servoJ = lambda *_: True
    looks = itertools.count()  # each state is looked at twice
    mover._source.client.getTimestamp = lambda: 1.0 + CYCLE * (next(looks) // 2)
    mover._source.client.getActualQ = mover._source.client.getActualCurrent = lambda: [0.0] * 6
    mover.follow(StraightMotion(np.zeros(6), 0.3 * np.ones(6), 2.0), Thresholds(external=1e3))
    for _ in mover:
        if not mover.moving:
            break
    assert re.search(r"off the path .*see on its pendant whether it is stopped or paused, and .*slider", mover.why)
    mover.close()


@pytest.mark.parametrize(
    ("says", "value", "said"),
    [
        ("getRobotMode", 5, "would not follow: it is held by its brakes; switch it on, and release its brakes"),
        ("getSafetyMode", 3, "it is in a protective stop; end that on its pendant"),
        ("getSafetyMode", 12, "it is in safety mode 12"),
        ("getTargetSpeedFraction", 0.5, "its speed slider is at 50 %; set it to 100 %"),
    ],
)
def test_a_ur_that_would_not_follow_is_refused_before_its_program_is_replaced(ur, says, value, said):
    mover, controls = ur("")
    setattr(mover._source.client, says, lambda: value)
    with pytest.raises(SafetyError, match=said):
        mover.follow(StraightMotion(np.zeros(6), 0.3 * np.ones(6), 2.0))
    assert not controls.asked
    mover.close()


def test_a_ur_is_never_asked_to_catch_up_with_what_came_late_or_with_a_clock_that_was_set(ur):
    """servoJ stands at its last target: each one is a cycle along the path."""
    mover, controls = ur("")
    cycle, targets, rng = 2e-3, [np.zeros(6)], np.random.default_rng(1)
    client, state = mover._source.client, SimpleNamespace(t=1.0, looks=0)

    def timestamp():  # each state is looked at twice
        if state.looks % 2 == 0:
            state.t += cycle if rng.random() < 0.9 else rng.uniform(-0.09, 0.09)
        state.looks += 1
        return state.t

    client.getTimestamp = timestamp
    client.getActualQ = lambda: targets[-1]
    client.getActualCurrent = lambda: [0.0] * 6
    controls.servoJ = lambda q, *_: not targets.append(np.array(q))
    motion = StraightMotion(np.zeros(6), 0.3 * np.ones(6), 2.0)
    mover.follow(motion, Thresholds(external=1e3))
    for _ in mover:
        if not mover.moving:
            break
    assert mover.why is None
    step = np.diff(targets, axis=0)
    assert step.min() > -1e-12
    assert step.max() <= cycle * motion.velocity(motion.instants(500.0)).max() * 1.001
    np.testing.assert_allclose(targets[-1], 0.3, atol=1e-9)
    mover.close()


@pytest.mark.parametrize(
    ("seconds", "said"), [(0.8, "was stopped by its watchdog: no target .* 0.8"), (0.0, "pendant")]
)
def test_a_ur_whose_watchdog_ended_its_program_says_so(ur, monkeypatch, seconds, said):
    mover, controls = ur("")
    clock = SimpleNamespace(now=5.0)
    monkeypatch.setattr("armload.devices.ur.mover.time", SimpleNamespace(monotonic=lambda: clock.now))
    mover.follow(StraightMotion(np.zeros(6), 0.3 * np.ones(6), 2.0))
    controls.servoJ = lambda *_: True
    mover._servo(np.zeros(6))
    clock.now += seconds
    controls.servoJ = lambda *_: False
    with pytest.raises(SourceError, match=said):
        mover._servo(np.zeros(6))
    mover.close()


@pytest.mark.parametrize("mode", ["Guiding", "kReflex", "UserStopped", "kAutomaticErrorRecovery"])
def test_a_franka_robot_in_another_mode_is_refused_before_it_is_commanded(mode):
    mover = FrankaMover.__new__(FrankaMover)  # a robot and its client are not needed for this
    state = SimpleNamespace(robot_mode=SimpleNamespace(name=mode), q_d=np.zeros(7))
    mover.name, mover.n, mover._movement, mover._mode = "fr3://robot", 7, None, None
    mover._source = SimpleNamespace(state=lambda: state)
    with pytest.raises(SafetyError, match=r"would not follow: .*; (let go|acknowledge|release|wait)"):
        mover.follow(StraightMotion(np.zeros(7), 0.1 * np.ones(7), 2.0))
    mover._mode = "kIdle"
    assert mover.hindrance() is None


def test_a_ur_is_not_lost_because_this_process_did_not_run(ur, monkeypatch):
    """Its client has heard nothing either when the process goes on."""
    mover, _ = ur("")
    clock, looks = SimpleNamespace(now=5.0), iter([1.0, 1.0, 1.0, 1.0, *[1.002] * 10_000])
    client = mover._source.client
    client.getActualQ = client.getActualCurrent = lambda: [0.0] * 6

    def timestamp():
        clock.now += 1e-3
        return next(looks)

    client.getTimestamp = timestamp
    monkeypatch.setattr("armload.devices.ur.source.time", SimpleNamespace(monotonic=lambda: clock.now))
    samples = iter(mover)
    assert next(samples).t == 1.0
    clock.now += 3.0
    assert next(samples).t == 1.002
    with pytest.raises(SourceError, match=r"was lost: no sample for 1\.0 s"):  # one that says nothing is
        next(samples)
    mover.close()


def test_a_ur_that_is_not_where_it_was_to_go_says_what_may_have_held_it(ur):
    mover, _ = ur("")
    with pytest.raises(SafetyError, match=r"move the arm to its start first, and .*its speed slider is at 100 %"):
        mover.follow(motion := StraightMotion(0.018 * np.ones(6), 0.3 * np.ones(6), 2.0))
    remote = DetachedMover.__new__(DetachedMover)  # as the process says it that has the robot
    remote.name, remote.arm, remote.n, remote._begun, remote._ended = mover.name, mover.arm, mover.n, 0, 0
    remote._call = lambda called: getattr(RemoteMover(mover), called)()
    with pytest.raises(SafetyError, match=r"move the arm to its start first, and .*its speed slider is at 100 %"):
        remote.follow(motion)
    mover.close()


@pytest.mark.parametrize("ended", ["readOnce", "writeOnce"])
def test_a_franka_robot_that_stopped_by_itself_says_what_did_and_what_to_do(ended):
    def reflex(*_):
        raise RuntimeError("libfranka: Move command aborted:\n motion aborted by reflex")

    mover = FrankaMover.__new__(FrankaMover)  # a robot and its client are not needed for this
    mover.name, mover._control = "fr3://robot", SimpleNamespace(**{ended: reflex})
    mover._client = SimpleNamespace(JointPositions=lambda _: SimpleNamespace())
    with pytest.raises(SourceError, match=r"aborted by reflex; see in Desk .* acknowledge it .* cable"):
        mover._state() if ended == "readOnce" else mover._write(np.zeros(7))


class Obedient(StreamedMover):
    """An arm that is where it was commanded to be a cycle ago."""

    def __init__(self, robot, at):
        super().__init__(robot)
        self.name, self.rate, self.t, self.targets = "obedient", 1 / CYCLE, 0.0, [np.array(at)]

    def __iter__(self):
        while True:
            self.t += CYCLE
            sample = sample_of(self.arm, self.t, self.targets[-1])
            movement = self._took(sample, lambda: self.t)
            if movement is not None:
                self._brakes(movement, self.t - movement.begun)
                self.targets.append(movement.target(self.t - movement.begun + CYCLE))
            yield sample

    def commanded(self):
        return self.targets[-1]

    def close(self):
        pass


def test_what_is_left_to_the_start_is_taken_up_without_a_jump(panda):
    left = np.array([4e-3, -4e-3, 0.0, 1e-3, 0.0, 0.0, -2e-3])
    mover = Obedient(panda, START + left)
    run(mover, MOTION)
    q = np.array(mover.targets)
    np.testing.assert_array_equal(q[0], START + left)
    np.testing.assert_allclose(q[-1], MOTION.position([MOTION.duration])[0], atol=1e-9)
    assert np.abs(np.diff(q, 3, axis=0)).max() < CYCLE**3 * panda.limits.jerk.min()  # within what a Panda takes
    path = MOTION.position(np.linspace(0.0, MOTION.duration, 6001))
    assert max(np.abs(path - pose).max(axis=1).min() for pose in q[::20]) < 5e-3


@pytest.mark.parametrize("meanwhile", ["problem", "_brakes"])
def test_a_stop_from_another_thread_is_never_lost_and_its_reason_is_kept(panda, monkeypatch, meanwhile):
    """It comes while the newest sample is looked at, or between that and the command."""
    mover = Obedient(panda, START)
    owner = Supervision if meanwhile == "problem" else Obedient
    before = getattr(owner, meanwhile)

    def asked(*args):
        if 1.0 < mover.t < 1.0 + CYCLE:
            mover.stop("asked")
        return before(*args)

    monkeypatch.setattr(owner, meanwhile, asked)
    samples = run(mover, MOTION)
    assert mover.why == "asked"
    assert samples[-1].t < 2.0


def test_a_stop_that_comes_after_the_end_stops_nothing(panda):
    mover = Obedient(panda, START)
    motion = StraightMotion(START, START + 0.1, 1.0)
    run(mover, motion, round(1.1 / CYCLE), lambda: mover.stop("too late"))
    assert mover.why is None


def test_an_arm_that_does_not_follow_is_never_taken_for_one_that_arrived(panda):
    mover = Obedient(panda, START)
    mover.follow(StraightMotion(START, START + 0.2, 1.0))
    for sample in mover:
        mover.targets[-1] = START  # stuck
        if sample.t > 1.4 or not mover.moving:
            break
    assert "off the path" in mover.why


def test_the_simulator_takes_no_payload_from_us(mover):
    with pytest.raises(SinkError, match="takes no payload"):
        mover.write(None)


class Gap(Obedient):
    """The 100th sample of a movement comes late, on its own clock and on ours."""

    def __init__(self, robot, at, passed, waited):
        super().__init__(robot, at)
        self.now, self._count, self._gap = 0.0, 0, (passed, waited)

    def __iter__(self):
        for sample in super().__iter__():
            self.now += CYCLE
            self._count += 1
            if self._count == 100:  # before the next sample is looked at
                self.t += self._gap[0]
                self.now += self._gap[1]
            yield sample


def moved_with_a_gap(panda, monkeypatch, passed, waited):
    mover = Gap(panda, START, passed, waited)
    clock = SimpleNamespace(monotonic=lambda: mover.now)
    for module in ("mover", "heard"):
        monkeypatch.setattr(f"armload.devices.{module}.time", clock)
    run(mover, MOTION)
    assert not mover.moving
    return mover, np.array(mover.targets)


@pytest.mark.parametrize("seconds", [0.15, 0.4, 20.0])
def test_an_arm_that_was_not_heard_stays_at_its_last_command(panda, monkeypatch, seconds):
    mover, q = moved_with_a_gap(panda, monkeypatch, seconds, seconds)
    assert f"no sample came for {seconds:.2f} s" in mover.why
    here = q[100]
    assert np.abs(np.diff(q[:100], axis=0)).max() > 1e-3  # it was on its way
    np.testing.assert_allclose(q[101:], np.broadcast_to(here, q[101:].shape), atol=1e-9)
    assert len(q) < 100 + 0.3 / CYCLE


@pytest.mark.parametrize("passed", [-10.0, -0.3, 0.3, 10.0])
def test_a_clock_that_jumps_stops_the_arm_on_its_path_without_a_jump(panda, monkeypatch, passed):
    mover, q = moved_with_a_gap(panda, monkeypatch, passed, 0.0)
    assert f"the clock of its samples jumped by {passed:+.2f} s" in mover.why
    ordinary = np.abs(np.diff(np.array(MOTION.position(np.arange(0.0, 1.0, CYCLE))), axis=0)).max()
    assert np.abs(np.diff(q, axis=0)).max() < 1.5 * ordinary
    np.testing.assert_allclose(q[-1], q[-20], atol=1e-9)
    path = MOTION.position(np.linspace(0.0, MOTION.duration, 6001))
    assert np.abs(path - q[-1]).max(axis=1).min() < 1e-3

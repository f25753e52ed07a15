"""A whole measurement on the simulator: said, checked, agreed to, run, ended early, answered; and what stops it."""

import signal
import time
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from armload.devices import SimulatedMover, Thresholds
from armload.errors import RecordingError, SafetyError, SourceError, UsageError
from armload.estimators import Estimate
from armload.excitation import Accuracy, Obstacle
from armload.inertia import InertialParameters
from armload.measuring import Basis, Procedure, Room, plan_of
from armload.measuring.plan import BACK, EMPTY, LOADED, TO_START
from armload.motion import PathMotion, taie2024
from armload.motion.point_to_point import PointToPoint
from armload.payloads import test_payload as held_payload
from armload.posterior import KnownMass
from armload.recording import Sample, read_recording
from armload.recording.growing_file import GrowingFile
from armload.simulation import Sensors, World

WHOLE = taie2024()
START = WHOLE.position([0.0])[0]
_T = np.linspace(0.0, 3.0, 301)
_Q, _DQ, _DDQ = WHOLE(2 * _T)
MOTION = PathMotion(_T, START + 0.25 * (_Q - START), 0.5 * _DQ, _DDQ)  # a quarter of the way in half the time
NEAR = START + np.array([0.1, 0, 0, -0.1, 0, 0, 0.1])
RATE = 250.0
BY_MAP = Basis(method="map")


class Orders:
    """Who is asked, and what was said, in order."""

    def __init__(self, agrees=True):
        self.agrees, self.seen, self.plans = agrees, [], []

    def consent(self, plan):
        self.seen.append("consent")
        self.plans.append(plan)
        return self.agrees

    def mount(self, mover):
        def mounting():
            self.seen.append("mount")
            mover.mount()

        return mounting


@pytest.fixture
def simulated(panda):
    made = []

    def make(at=START, kind=SimulatedMover, payload=None, **settings):
        world = World.real_like(panda, 2)
        payload = held_payload() if payload is None else payload
        standard = {"world": world, "sensors": Sensors.of(panda), "speed": None, "rate": RATE, "ahead": 0.1}
        made.append(kind(panda, at, payload, **standard | settings))
        return made[-1]

    yield make
    for mover in made:
        mover.close()


def poses(mover, samples=60):
    return np.array([sample.q for sample, _ in zip(mover, range(samples), strict=False)])


def test_a_measurement_finds_the_payload_and_moves_in_the_order_that_was_said(panda, simulated, tmp_path):
    mover, orders = simulated(NEAR), Orders()
    procedure = Procedure(mover, panda, MOTION, tmp_path / "logs", basis=BY_MAP, say=orders.seen.append)
    assert [leg.purpose for leg in procedure.plan.legs] == [TO_START, EMPTY, LOADED]
    found = procedure.run(orders.consent, orders.mount(mover))
    moves = [f"moving {purpose}" for purpose in (TO_START, EMPTY)]
    assert orders.seen == ["consent", *moves, "mount", f"moving {LOADED}", "identifying"]
    truth = held_payload().parameters
    assert found.answer.relative_to == "tare"
    assert found.answer.mass == pytest.approx(truth.mass, abs=0.08)
    assert np.allclose(found.answer.com, truth.com, atol=0.01)
    assert found.reached is None
    assert found.seconds == pytest.approx(MOTION.duration + 0.2, abs=0.1)
    empty, loaded = (read_recording(path, panda) for path in (found.empty, found.loaded))
    assert np.abs(empty.q[[0, -1]] - START).max() < 0.02
    more = loaded.tau[0] - empty.tau[0]
    expected = panda.with_payload(truth).torque(START) - panda.torque(START)
    assert np.allclose(more, expected, atol=0.5)


def test_the_loaded_run_ends_as_soon_as_enough_is_known(panda, simulated, tmp_path):
    mover, orders = simulated(), Orders()
    wanted = Accuracy(mass=0.5, moment=0.05)
    procedure = Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP, accuracy=wanted)
    found = procedure.run(orders.consent, orders.mount(mover))
    assert found.reached
    assert found.seconds < 0.9 * MOTION.duration
    loaded = read_recording(found.loaded, panda)
    assert np.abs(loaded.dq[-1]).max() < 0.02
    assert wanted.holds(1.96 * np.sqrt(np.diag(found.answer.covariance)))


def test_without_consent_nothing_moves_and_nothing_is_made(panda, simulated, tmp_path):
    mover, orders = simulated(NEAR), Orders(agrees=False)
    folder = tmp_path / "logs"
    with pytest.raises(SafetyError, match="nothing was moved: there was no consent"):
        Procedure(mover, panda, MOTION, folder).run(orders.consent, orders.mount(mover))
    assert np.abs(poses(mover) - NEAR).max() < 0.01
    assert orders.seen == ["consent"]
    assert not folder.exists()


def test_an_arm_that_would_not_follow_is_refused_before_anybody_is_asked(panda, simulated, tmp_path, monkeypatch):
    mover, orders, folder = simulated(), Orders(), tmp_path / "new"
    procedure = Procedure(mover, panda, MOTION, folder)
    monkeypatch.setattr(mover, "hindrance", lambda: "its brakes hold")
    with pytest.raises(SafetyError, match=r"nothing was moved: .* would not follow: its brakes hold"):
        procedure.run(orders.consent, orders.mount(mover))
    with pytest.raises(SafetyError, match="would not follow: its brakes hold"):
        procedure.check()
    assert not orders.seen
    assert not folder.exists()


def test_who_does_not_agree_once_the_payload_is_on_is_not_told_that_nothing_was_moved_at_all(
    panda, simulated, tmp_path
):
    mover, orders = simulated(), Orders()

    def mount():
        orders.mount(mover)()
        orders.agrees = False
        mover.follow(PointToPoint([START, NEAR], [0.0], [1.0]))  # somebody moves the arm elsewhere
        for _ in zip(mover, range(int(1.5 * RATE)), strict=False):
            pass

    with pytest.raises(SafetyError, match="nothing was moved with the payload on: there was no consent"):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP).run(orders.consent, mount)
    assert orders.seen == ["consent", "mount", "consent"]
    assert (tmp_path / "empty.csv").exists()


@pytest.mark.parametrize(
    ("motion", "at", "room", "said"),
    [
        (MOTION, START, {"floor": 0.45}, "the arm hits the floor"),
        (PointToPoint([START, START + 0.8], [0.0], [0.4]), START, {}, "velocity limit"),
        (MOTION, START + np.eye(7)[5] * 0.5, {"approach": 0.4}, "panda_joint6 is 0.50 rad from where"),
        (MOTION, np.array([0.0, 1.6, 0.0, -0.2, 0.0, 1.0, 0.0]), {"approach": 9.0}, "to the start: the arm hits"),
    ],
    ids=["a floor in the way", "too fast", "too far from the start", "a way there through the floor"],
)
def test_what_passes_a_limit_is_refused_before_anybody_is_asked(panda, simulated, tmp_path, motion, at, room, said):
    mover, orders = simulated(at, sensors=None, world=None), Orders()
    with pytest.raises(SafetyError, match=said):
        Procedure(mover, panda, motion, tmp_path, room=Room(**room)).run(orders.consent, orders.mount(mover))
    assert not orders.seen
    assert np.abs(poses(mover) - at).max() < 0.02


class Restless(SimulatedMover):
    """Does something at the 100th sample of the second movement, such as being interrupted."""

    def __init__(self, *arguments, do, **settings):
        super().__init__(*arguments, **settings)
        self.do, self.movements, self.count = do, 0, 0

    def follow(self, motion, thresholds=None):
        self.movements, self.count = self.movements + 1, 0
        super().follow(motion, thresholds)

    def __iter__(self):
        for sample in super().__iter__():
            self.count += 1
            if self.movements == 2 and self.count == 100:
                self.do(self)
            yield sample


def test_a_box_in_the_way_is_refused_before_anybody_is_asked(panda, simulated, tmp_path):
    mover, orders = simulated(), Orders()
    place = panda.frame_pose(MOTION.position(np.array([1.5])))[1][0]
    box = Obstacle((float(place[0]), float(place[1]), float(place[2])), (0.1, 0.1, 0.1))
    procedure = Procedure(mover, panda, MOTION, tmp_path / "logs", room=Room(boxes=[box]))
    with pytest.raises(SafetyError, match=r"the arm hits a box: .* is at box 1 at t = "):
        procedure.run(orders.consent, orders.mount(mover))
    assert orders.seen == []
    assert not (tmp_path / "logs").exists()
    np.testing.assert_allclose(poses(mover), np.tile(START, (60, 1)), atol=2e-3)


def test_a_plan_says_how_near_the_payload_comes_to_a_wall(panda):
    wall = Obstacle((3.0, 0.0, 0.5), (2.0, 10.0, 10.0))  # its face is at x = 2 m
    plan = plan_of(panda, MOTION, START, room=Room(boxes=[wall]))
    rotation, place = panda.frame_pose(MOTION.position(np.linspace(0.0, MOTION.duration, 2001)))
    ball = place + 0.1 * rotation[:, :, 2]  # of 0.15 m, the farthest in front
    assert plan.to_dict()["box_clearance"] == pytest.approx(2.0 - 0.15 - ball[:, 0].max(), abs=1e-4)
    assert "nearest to a box: " in str(plan)
    assert plan_of(panda, MOTION, START).to_dict()["box_clearance"] is None


def test_movements_are_checked_with_the_payload_that_was_weighed(panda):
    light, rated = (plan_of(panda, MOTION, START, heaviest=kg).legs[0].check for kg in (0.5, None))
    assert panda.rated_payload is not None
    t = np.linspace(0.0, MOTION.duration, 3001)
    q, dq, ddq = MOTION(t)
    body = InertialParameters.from_com(0.5, (0.0, 0.0, 0.1), 0.4 * 0.5 * 0.05**2 * np.eye(3))
    np.testing.assert_allclose(light.peak["torque"], np.abs(panda.with_payload(body).torque(q, dq, ddq)).max(axis=0))
    assert light.peak["torque"][1] < rated.peak["torque"][1]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_arm_comes_to_rest_and_its_log_can_be_read(panda, simulated, tmp_path, number):
    before = signal.getsignal(signal.SIGINT)  # what a shell runs in the background ignores it
    mover, orders = simulated(kind=Restless, do=lambda _: signal.raise_signal(number)), Orders()
    procedure = Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP, say=orders.seen.append)
    with pytest.raises(KeyboardInterrupt):
        procedure.run(orders.consent, orders.mount(mover))
    assert mover.why == f"interrupted by {number.name}"
    log = f"what was recorded until then is in {tmp_path / 'loaded.csv'}"
    assert f"the arm was interrupted on its way with the payload, and it is at rest; {log}" in orders.seen
    loaded = read_recording(tmp_path / "loaded.csv", panda)
    assert 100 <= len(loaded) < 400
    assert np.abs(loaded.dq).max() > 0.1
    assert np.abs(loaded.dq[-1]).max() < 0.02
    assert np.ptp(poses(mover), axis=0).max() < 0.01
    assert signal.getsignal(signal.SIGINT) is before


def test_who_interrupts_an_arm_that_is_lost_is_not_told_that_it_rests(panda, simulated, tmp_path):
    def lose(_):
        signal.raise_signal(signal.SIGINT)
        raise SourceError("the arm was lost")

    mover, orders = simulated(kind=Restless, do=lose), Orders()
    with pytest.raises(KeyboardInterrupt):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP, say=orders.seen.append).run(
            orders.consent, orders.mount(mover)
        )
    assert any("with the payload, and whether it rests is not known" in str(said) for said in orders.seen)


def test_a_push_ends_the_measurement_with_a_sentence(panda, simulated, tmp_path):
    heavy = InertialParameters(15.0 * held_payload().parameters.phi)

    def grow(mover):
        mover._payload = heavy
        mover.mount()

    mover, orders = simulated(kind=Restless, do=grow), Orders()
    with pytest.raises(SafetyError, match=r"stopped on its way with the payload: .* feels .*loaded.csv"):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP).run(orders.consent, orders.mount(mover))


def test_a_lost_arm_is_said_with_what_was_recorded(panda, simulated, tmp_path):
    def lose(_):
        raise SourceError("the arm was lost")

    mover, orders = simulated(kind=Restless, do=lose), Orders()
    with pytest.raises(SourceError, match=r"the arm was lost; what was recorded until then is in .*loaded.csv"):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP).run(orders.consent, orders.mount(mover))
    assert len(read_recording(tmp_path / "loaded.csv", panda)) == 99


def test_an_arm_whose_log_cannot_grow_is_stopped_and_what_was_kept_can_be_read(panda, simulated, tmp_path, monkeypatch):
    def full(*_):
        raise RecordingError("the disk is full")

    mover, orders = simulated(kind=Restless, do=lambda _: monkeypatch.setattr(GrowingFile, "append", full)), Orders()
    with pytest.raises(RecordingError, match=r"^the disk is full; the arm was stopped on its way with the payload: "):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP).run(orders.consent, orders.mount(mover))
    assert not mover.moving
    assert np.ptp(poses(mover), axis=0).max() < 0.01
    assert len(read_recording(tmp_path / "loaded.csv", panda)) == 99


class Overrun(SimulatedMover):
    """Whoever takes its samples was too slow for 40 of them on the way with the payload."""

    def __init__(self, *arguments, **settings):
        super().__init__(*arguments, **settings)
        self.lost, self.movements, self.samples = 0, 0, self._samples
        self._samples = self.overrun()

    def follow(self, motion, thresholds=None):
        super().follow(motion, thresholds)
        self.movements, self.count = self.movements + 1, 0

    def overrun(self):
        for sample in self.samples:
            self.count = self.count + 1 if self.movements == 2 else 0
            if 100 < self.count <= 140:
                self.lost += 1
            else:
                yield sample


def test_samples_that_a_log_lacks_are_said(panda, simulated, tmp_path):
    mover, orders, said = simulated(kind=Overrun, rate=1000.0), Orders(), []
    procedure = Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP, say=said.append)
    procedure.run(orders.consent, orders.mount(mover))
    lacks = [line for line in said if "lacks" in line]
    assert len(lacks) == 1
    assert f"this process did not run for a while: {tmp_path / 'loaded.csv'} lacks 40 samples" in lacks[0]


class Broken(SimulatedMover):
    """Its samples end on the way with the payload, or from there on all have one time."""

    def __init__(self, *arguments, ends, **settings):
        super().__init__(*arguments, **settings)
        self.samples, self.ends = self._samples, ends
        self._samples = self.broken()
        self.movements = 0

    def follow(self, motion, thresholds=None):
        super().follow(motion, thresholds)
        self.movements, self.count = self.movements + 1, 0

    def broken(self):
        stood = None
        for sample in self.samples:
            self.count = self.count + 1 if self.movements == 2 else 0
            if self.count > 100 and self.ends:
                return
            stood = sample.t if self.count == 100 else stood
            yield sample if stood is None else sample._replace(t=stood)


@pytest.mark.parametrize(
    ("ends", "said"),
    [(True, "ended while the arm was on its way"), (False, "has stood still for 1 s while the arm was on its way")],
    ids=["the samples end", "their clock stands still"],
)
def test_a_movement_whose_end_was_not_seen_is_never_taken_for_a_whole_one(panda, simulated, tmp_path, ends, said):
    mover, orders = simulated(kind=Broken, ends=ends), Orders()
    with pytest.raises(SourceError, match=rf"{said}: .*; what was recorded until then is in .*loaded.csv"):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP).run(orders.consent, orders.mount(mover))
    assert len(read_recording(tmp_path / "loaded.csv", panda)) == 100


class Silent(SimulatedMover):
    """Its client waits for ever, from the 100th sample of a movement on: nothing comes, and no error."""

    def ticking(self, _):
        yield from (sample for sample, _ in zip(self, range(100), strict=False))
        while True:
            yield None


def test_an_arm_whose_client_waits_for_ever_counts_as_lost(panda, simulated, tmp_path, monkeypatch):
    monkeypatch.setattr("armload.devices.mover._LOST", 0.05)
    mover, orders = simulated(kind=Silent), Orders()
    with pytest.raises(SourceError, match=r"was lost: no sample for 0.05 s while the arm was on its way; .*empty.csv"):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP).run(orders.consent, orders.mount(mover))
    assert len(read_recording(tmp_path / "empty.csv", panda)) == 100


class BackByALittle(SimulatedMover):
    """The clock of its samples goes back by 50 ms on the way with the payload: too little to stop an arm."""

    def __init__(self, *arguments, **settings):
        super().__init__(*arguments, **settings)
        self.samples, self._samples = self._samples, self.broken()
        self.movements = self.count = 0

    def follow(self, motion, thresholds=None):
        super().follow(motion, thresholds)
        self.movements, self.count = self.movements + 1, 0

    def broken(self):
        for sample in self.samples:
            self.count += 1
            back = 0.05 * (self.movements == 2 and self.count > 100)
            yield sample._replace(t=sample.t - back)


def test_a_part_of_a_run_is_never_taken_for_all_of_it(panda, simulated, tmp_path):
    mover, orders = simulated(kind=BackByALittle), Orders()
    with pytest.raises(RecordingError, match=r"went back on the way with the payload, .*loaded.csv, .*loaded.2.csv"):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP).run(orders.consent, orders.mount(mover))


def test_what_fails_after_the_empty_run_says_how_to_go_on_and_that_goes_on(panda, simulated, tmp_path):
    def lose(_):
        raise SourceError("the arm was lost")

    mover, orders = simulated(kind=Restless, do=lose), Orders()
    say = orders.seen.append
    with pytest.raises(SourceError):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP, say=say).run(orders.consent, orders.mount(mover))
    empty = tmp_path / "empty.csv"
    assert orders.seen[-1] == f"the empty run is whole: once the payload is on, --tare {empty} goes on from there"
    (tmp_path / "loaded.csv").unlink()
    held = simulated(mounted=held_payload())
    basis = Basis(read_recording(empty, panda), method="map")
    found = Procedure(held, panda, MOTION, tmp_path, basis=basis).run(orders.consent, lambda: None)
    assert found.answer.mass == pytest.approx(held_payload().parameters.mass, abs=0.08)


def test_an_empty_run_that_fails_is_not_called_whole(panda, simulated, tmp_path):
    def lose(_):
        raise SourceError("the arm was lost")

    mover, orders = simulated(kind=Restless, do=lose, at=NEAR), Orders()  # the second movement is the empty run
    say = orders.seen.append
    with pytest.raises(SourceError):
        Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP, say=say).run(orders.consent, orders.mount(mover))
    assert orders.seen[-1] == f"moving {EMPTY}"


def test_an_arm_moved_meanwhile_is_asked_for_anew(panda, simulated, tmp_path):
    mover, orders = simulated(), Orders()
    procedure = Procedure(mover, panda, MOTION, tmp_path, basis=BY_MAP)
    elsewhere = Procedure(mover, panda, PointToPoint([START, NEAR], [0.0], [3.0]), tmp_path / "other")

    def mount():
        orders.agrees = False
        elsewhere._move(elsewhere.plan, EMPTY)

    with pytest.raises(SafetyError, match="no consent"):
        procedure.run(orders.consent, mount)
    second = orders.plans[1]
    assert [leg.purpose for leg in second.legs] == [TO_START, LOADED]
    assert not (tmp_path / "loaded.csv").exists()


def test_a_measurement_begins_at_rest_and_writes_over_nothing(panda, simulated, tmp_path):
    mover = simulated()
    mover.follow(MOTION)
    for sample in mover:
        if np.abs(sample.dq).max() > 0.2:
            break
    with pytest.raises(SafetyError, match="moves: a measurement begins at rest"):
        Procedure(mover, panda, MOTION, tmp_path)
    (tmp_path / "empty.csv").touch()
    with pytest.raises(RecordingError, match=r"empty.csv exists"):
        Procedure(simulated(), panda, MOTION, tmp_path)


class Standing:
    """An arm that stands, whose samples are so old [s] when they are looked at, one every 0.1 s of a clock."""

    name = "an arm"

    def __init__(self, lags):
        self.lags, self.seen, self._lag = lags, 0, 0.0

    def __iter__(self):
        for lag in self.lags:
            self.seen, self._lag = self.seen + 1, lag
            yield Sample(0.1 * self.seen, START, np.zeros(7), np.zeros(7))

    def lag(self):
        return self._lag

    def commanded(self):
        return START


def test_samples_that_waited_are_waited_for_only_while_they_get_newer(panda, tmp_path, monkeypatch):
    caught_up, stays = Standing([0.0, *np.arange(60.0, 0.0, -0.1), *[0.0] * 4]), Standing([0.3] * 1000)
    for mover in (caught_up, stays):
        clock = SimpleNamespace(monotonic=lambda mover=mover: 0.1 * mover.seen, time=time.time)
        monkeypatch.setattr("armload.measuring.procedure.time", clock)
        if mover is caught_up:
            assert Procedure(mover, panda, MOTION, tmp_path).plan.legs
        else:
            with pytest.raises(SafetyError, match=r"are 0\.3 s old when they are looked at, and do not get newer"):
                Procedure(mover, panda, MOTION, tmp_path)
    assert stays.seen < 60


def test_a_motion_that_ends_elsewhere_goes_back_in_between(panda):
    there = PointToPoint([START, NEAR], [0.0], [2.0])
    plan = plan_of(panda, there, START)
    assert [leg.purpose for leg in plan.legs] == [EMPTY, BACK, LOADED]
    ends = [leg.motion.position([0.0, leg.motion.duration]) for leg in plan.legs]
    for before, after in pairwise(ends):
        np.testing.assert_allclose(before[1], after[0], atol=1e-9)
    assert f"{plan.duration:.1f} s" in str(plan)


def test_a_plan_says_how_far_and_how_fast(panda):
    plan = plan_of(panda, MOTION, START, empty_run=False)
    t = np.linspace(0.0, MOTION.duration, 3001)
    q = MOTION.position(t)
    p = panda.frame_pose(q)[1]
    np.testing.assert_allclose(plan.tool, [p.min(axis=0), p.max(axis=0)], atol=2e-3)
    assert plan.speed == pytest.approx(np.linalg.norm(np.gradient(p, t, axis=0), axis=1).max(), rel=0.02)
    row = next(line for line in str(plan).splitlines() if line.startswith("panda_joint5"))
    said = [float(x) for x in row.split()[1:4]]
    assert said == pytest.approx([q[:, 4].min(), q[:, 4].max(), np.abs(MOTION.velocity(t)[:, 4]).max()], abs=0.011)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("mass=10g", Accuracy(mass=0.01)),
        ("mass=0.01, moment=1.5g.m", Accuracy(mass=0.01, moment=1.5e-3)),
        ("inertia=1e-3", Accuracy(inertia=1e-3)),
        ("inertia=1g·m²,mass=1.5kg", Accuracy(mass=1.5, inertia=1e-3)),
    ],
)
def test_accuracy_is_read_with_its_units(text, wanted):
    read = Accuracy.read(text)
    assert (read.mass, read.moment, read.inertia) == pytest.approx((wanted.mass, wanted.moment, wanted.inertia))


@pytest.mark.parametrize("text", ["", "mass", "mass=-1g", "mass=1m", "weight=1g", "mass=1g,mass=2g", "mass=1.2.3"])
def test_what_is_no_accuracy_is_refused(text):
    with pytest.raises(UsageError, match="is no accuracy: expected"):
        Accuracy.read(text)


def test_accuracy_counts_half_widths_and_a_mass_that_was_weighed():
    std = np.array([0.02, *[0.001] * 3, *[0.0005] * 6])
    estimate = Estimate(1.0, np.zeros(10), np.diag(std**2), 100, "f")
    assert Accuracy(mass=0.04, moment=0.002, inertia=0.001).reached(estimate)
    for tight in ({"mass": 0.039}, {"moment": 0.0019}, {"inertia": 9.7e-4}):
        assert not Accuracy(**tight).reached(estimate)
    assert Accuracy(mass=0.01).reached(estimate, KnownMass(0.1, 0.002))


def test_thresholds_reach_the_arm(panda, simulated, tmp_path):
    mover, orders = simulated(), Orders()
    with pytest.raises(SafetyError, match=r"off the path \(more than 0.001 rad\)"):
        Procedure(mover, panda, MOTION, tmp_path, thresholds=Thresholds(tracking=0.001)).run(
            orders.consent, orders.mount(mover)
        )

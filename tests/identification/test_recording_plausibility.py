"""Sound logs pass, whatever they carry; logs in wrong units, of wrong columns or of wrong arms do not."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armload.arms import arm, rated_effort, rated_mass
from armload.devices import Simulator
from armload.errors import RecordingError
from armload.identification import check_gravity_was_missing, check_plausible
from armload.identification.exchanged import check_for_exchanged_torques
from armload.identification.torque_scale import torque_scale, torque_scales
from armload.inertia import InertialParameters
from armload.lab.episodes import draw_episodes
from armload.motion import random_motion, taie2024
from armload.payloads import draw_payload, franka_hand
from armload.payloads import test_payload as box_of_the_examples
from armload.recording import Recording, read_recording, with_gravity, write_recording
from armload.recording.windows import integrals, windows
from armload.simulation import Run, Sensors, World, simulate, simulate_many

DEGREE = 180.0 / np.pi


def heavy(mass, seed):
    """A payload with its centre of mass up to 0.2 m off the flange."""
    com = np.random.default_rng(seed).normal(size=3)
    com *= 0.15 / np.linalg.norm(com)
    com[2] = abs(com[2]) + 0.05
    return InertialParameters.from_com(mass, com, np.eye(3) * mass * 0.05**2)


@pytest.fixture(scope="module")
def sound():
    """By arm: logs in real-like worlds, without payload, at the rated payload and at twice the rated payload."""
    out = {}
    for name in ("panda", "ur10e"):
        robot = arm(name)
        sensors = Sensors.panda(robot) if name == "panda" else Sensors.generic(robot)
        runs = []
        for seed in range(2):
            motion = taie2024() if name == "panda" and seed == 0 else random_motion(robot, seed)
            for share in (0, 1, 2):
                payload = heavy(share * robot.rated_payload, seed) if share else None
                runs.append(Run(motion, payload, World.real_like(robot, seed), sensors, seed))
        out[name] = robot, simulate_many(robot, runs, rate=250.0)
    return out


@pytest.fixture(scope="module")
def real(real_data):
    """The real logs with the arm they are of."""
    ur = arm(real_data / "ur10e.urdf", "tool0")
    return {
        "panda": (arm("panda"), read_recording(real_data / "panda_unloaded_1khz.csv")),
        "ur10e": (ur, read_recording(real_data / "ur10e_unloaded.csv")),
        "ur10e loaded": (ur, read_recording(real_data / "ur10e_loaded_2805g.csv")),
        "ur10": (arm("ur10e"), read_recording(real_data / "ur10_ros2_bag.db3", arm("ur10e"))),
    }


@pytest.fixture(scope="module")
def wrong(real):
    """The same at no more than 200 Hz: for what is refused at any rate."""
    return {
        name: (robot, log.select(slice(None, None, max(1, round(log.rate / 200)))))
        for name, (robot, log) in real.items()
    }


@pytest.mark.full
@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_simulated_logs_up_to_twice_the_rated_payload_pass(sound, name):
    robot, logs = sound[name]
    for log in logs:
        check_plausible(log, robot)


@pytest.mark.parametrize("name", ["panda", "ur10e", "ur10e loaded", "ur10"])
def test_real_logs_pass(real, name):
    robot, log = real[name]
    check_plausible(log, robot)


def degraded(log, kind):
    rng = np.random.default_rng(0)
    match kind:
        case "noise":
            return replace(
                log,
                q=log.q + 1e-3 * rng.normal(size=log.q.shape),
                dq=log.dq + 0.03 * rng.normal(size=log.q.shape),
                tau=log.tau + rng.normal(size=log.q.shape),
            )
        case "half the samples lost":
            return log.select(rng.random(len(log)) > 0.5)
        case "gaps":
            return log.select((log.t % 2.0) > 0.7)
        case "20 Hz":
            return log.select(slice(None, None, round(log.rate / 20)))
        case "two samples":
            return log.select(slice(0, 2))
        case "one second":
            return log.between(log.t[0] + 2.0, log.t[0] + 3.0)
    raise AssertionError(kind)


@pytest.mark.parametrize("kind", ["noise", "half the samples lost", "gaps", "20 Hz", "two samples", "one second"])
@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_poor_but_sound_logs_pass(sound, name, kind):
    robot, logs = sound[name]
    check_plausible(degraded(logs[1], kind), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e", "ur10e loaded"])
@pytest.mark.parametrize("kind", ["noise", "half the samples lost", "gaps", "20 Hz", "one second"])
def test_poor_real_logs_pass(real, name, kind):
    robot, log = real[name]
    check_plausible(degraded(log, kind), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_an_arm_that_never_moves_passes(name):
    robot = arm(name)
    q = random_motion(robot, 3)(1.0)[0]
    tau = robot.torque(q) * 1.1
    t = np.arange(500) * 0.01
    check_plausible(Recording(t, np.tile(q, (500, 1)), np.zeros((500, robot.n)), np.tile(tau, (500, 1))), robot)


def unrated(robot):
    """The arm from a description without effort limits, as many exporters write it."""
    return replace(robot, urdf=re.sub('effort="[^"]*"', 'effort="0"', robot.urdf))


@pytest.mark.parametrize("name", ["panda", "ur10e", "ur10e loaded", "ur10"])
def test_real_logs_pass_where_the_description_has_no_effort_limits(real, name):
    robot, log = real[name]
    assert np.all(np.isinf(unrated(robot).limits.effort))
    check_plausible(log, unrated(robot))


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_simulated_logs_pass_where_the_description_has_no_effort_limits(sound, name):
    robot, logs = sound[name]
    for log in logs:
        check_plausible(log, unrated(robot))


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_the_wrong_arm_is_refused_where_the_description_has_no_effort_limits(wrong, name):
    robot, log = wrong[name]
    for other, said in (
        (replace(robot, gravity=(9.81, 0.0, 0.0)), r"with gravity about 0,0,-9\.81 m/s² .*--gravity"),
        (robot.with_links(2.5 * robot.link_parameters), r"check the robot, .*--gravity"),
    ):
        with pytest.raises(RecordingError, match=said):
            check_plausible(log, unrated(other))


def swapped(x):
    return x[:, [1, 0, *range(2, x.shape[1])]]


WRONG = {
    "degrees": (
        lambda r: {"q": r.q * DEGREE, "dq": r.dq * DEGREE},
        r"positions look like degrees \(q\d = .* at row \d+",
    ),
    "q in degrees": (lambda r: {"q": r.q * DEGREE}, r"positions look like degrees"),
    "dq in degrees": (lambda r: {"dq": r.dq * DEGREE}, r"dq1 is not the derivative of q1: .* degrees per second"),
    "dq in rpm": (lambda r: {"dq": r.dq * 30 / np.pi}, r"dq1 is not .* revolutions per minute"),
    "dq backwards": (lambda r: {"dq": -r.dq}, r"dq1 is not the derivative of q1: .* opposite sign"),
    "dq of motor": (lambda r: {"dq": r.dq * 101}, r"the derivative is 0\.0099 times dq"),
    "no dq": (lambda r: {"dq": 0 * r.dq}, r"dq1 is zero although q1 moves"),
    "dq swapped": (lambda r: {"dq": swapped(r.dq)}, r"dq1 is not .* another joint \(dq2 fits q1\)"),
    "milliseconds": (lambda r: {"t": r.t * 1e3}, r"t looks like milliseconds: --columns t_unit=ms"),
    "microseconds": (lambda r: {"t": r.t * 1e6}, r"t looks like microseconds: --columns t_unit=us"),
    "nanoseconds": (lambda r: {"t": r.t * 1e9}, r"t looks like nanoseconds: --columns t_unit=ns"),
    "seconds as ms": (lambda r: {"t": r.t * 1e-3}, r"q\d changes by .* cannot do .* t looks too small"),
    "seconds as ns": (lambda r: {"t": r.t * 1e-9}, r"q\d changes by .* cannot do .* t looks too small"),
    "no tau": (lambda r: {"tau": 0 * r.tau}, r"tau is zero in all joints and rows"),
    "tau in N·mm": (lambda r: {"tau": 1e3 * r.tau}, r"tau\d = .* at row \d+ .* times the limit"),
    "wrap": (
        lambda r: {"q": r.q + 2 * np.pi * (np.arange(len(r)) > 99)[:, None] * (np.arange(r.n) == 2)},
        r"q3 jumps by 6\.2\d+ rad in .* at row 100 \(t = .* s\) \(a full turn: unwrap the angle\)",
    ),
}


@pytest.mark.parametrize("fault", WRONG)
@pytest.mark.parametrize("source", ["sound", "real"])
@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_wrong_units_and_columns_are_refused_by_name(request, source, name, fault):
    robot, log = request.getfixturevalue(source)[name]
    log = log if isinstance(log, Recording) else log[1]
    change, says = WRONG[fault]
    with pytest.raises(RecordingError, match=says) as refusal:
        check_plausible(replace(log, **change(log)), robot)
    assert "\n" not in str(refusal.value)


WRONG_TORQUE = {
    "backwards": (lambda r, _: -r.tau, r"tau has the opposite sign of the torque"),
    "amperes": (lambda r, _: r.tau / 11.0, r"tau holds only \d+% of the torque"),
    "third": (lambda r, _: r.tau / 3.0, r"tau is 0\.[23]\d times the torque"),
    "without gravity": (
        lambda r, a: r.tau - a.torque(r.q),
        r"tau (holds only \d+% of|seems to have gravity taken out)",
    ),
    "reversed": (lambda r, _: r.tau[:, ::-1], r"tau"),
}


@pytest.mark.parametrize("fault", WRONG_TORQUE)
@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_torque_in_wrong_units_or_of_a_wrong_channel_is_refused(wrong, name, fault):
    robot, log = wrong[name]
    change, says = WRONG_TORQUE[fault]
    with pytest.raises(RecordingError, match=says):
        check_plausible(replace(log, tau=change(log, robot)), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_the_wrong_arm_is_refused(wrong, name):
    robot, log = wrong[name]
    for factor in (0.4, 2.5):
        with pytest.raises(RecordingError, match=r"check the robot, .*--gravity"):
            check_plausible(log, robot.with_links(factor * robot.link_parameters))


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_the_true_gravity_is_named_where_a_real_log_is_said_to_be_of_a_wall_or_a_ceiling(wrong, name):
    robot, log = wrong[name]
    for gravity in ((9.81, 0.0, 0.0), (0.0, 0.0, 9.81)):
        with pytest.raises(RecordingError, match=r"far better with gravity about 0,0,-9\.81 m/s² .*--gravity"):
            check_plausible(log, replace(robot, gravity=gravity))


def test_the_external_channel_need_not_hold_the_arms_weight(real):
    robot, log = real["panda"]
    check_plausible(replace(log, tau=log.tau - robot.torque(log.q), channel="external"), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
@pytest.mark.parametrize("at", ["its last value", "zero"])
def test_torque_that_stands_still_while_the_arm_moves_is_refused_by_row(real, name, at):
    robot, log = real[name]
    middle = int(np.argmax(np.abs(log.dq).sum(axis=1)))
    stop = middle + int(2.0 * log.rate)
    tau = log.tau.copy()
    tau[middle:stop] = tau[middle] if at == "its last value" else 0.0
    with pytest.raises(RecordingError, match=rf"tau stays exactly the same in all joints from row {middle} "):
        check_plausible(replace(log, tau=tau), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_a_torque_that_never_changes_while_its_joint_moves_is_refused_by_joint(real, name):
    robot, log = real[name]
    joint = int(np.argmax(np.ptp(log.q, axis=0)))
    tau = log.tau.copy()
    tau[:, joint] = 0.0
    with pytest.raises(RecordingError, match=rf"tau{joint + 1} is 0 in all rows although q{joint + 1} moves"):
        check_plausible(replace(log, tau=tau), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_a_torque_that_stands_still_while_its_joint_moves_is_refused_by_joint(wrong, name):
    robot, log = wrong[name]
    first, last = np.array([1, 2]) * len(log) // 3
    moving = np.flatnonzero(np.ptp(log.q[first:last], axis=0) > 0.3)
    assert len(moving) >= 3
    for joint in moving:
        tau = log.tau.copy()
        tau[first:last, joint] = tau[first, joint]
        with pytest.raises(RecordingError, match=rf"tau{joint + 1} stays exactly the same from row {first} .* remove"):
            check_plausible(replace(log, tau=tau), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_a_torque_sensor_at_its_limit_is_told_by_the_joint(wrong, name):
    robot, log = wrong[name]
    tau = log.tau.copy()
    tau[:, 1] = np.maximum(tau[:, 1], np.quantile(tau[:, 1], 0.3))
    with pytest.raises(RecordingError, match=r"tau2 is exactly .*, its least value, .* at its limit"):
        check_plausible(replace(log, tau=tau), robot)


@pytest.mark.parametrize("digits", [1, 2, 3])
def test_a_torque_that_is_rounded_is_not_taken_for_one_that_stands_still(sound, wrong, digits):
    for robot, log in [*((robot, log) for robot, logs in sound.values() for log in logs), *wrong.values()]:
        check_plausible(replace(log, tau=log.tau.round(digits)), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_joints_in_the_order_of_the_alphabet_are_refused_by_name(sound, wrong, name, tmp_path):
    robot, logs = sound[name]
    order = [2, 1, 0, *range(3, robot.n)]  # elbow, shoulder lift, shoulder pan of a UR
    for log in (*logs, wrong[name][1]):
        other = replace(log, q=log.q[:, order], dq=log.dq[:, order], tau=log.tau[:, order], joint_names=None)
        with pytest.raises(RecordingError, match=r"joints 1 and 3 seem to be exchanged|order of the joints"):
            check_plausible(other, robot)
    write_recording(tmp_path / "log.csv", other)  # a file that counts its joints names none, either
    with pytest.raises(RecordingError, match=r"joints 1 and 3 seem to be exchanged|order of the joints"):
        check_plausible(read_recording(tmp_path / "log.csv", robot), robot)


@pytest.mark.parametrize(
    "name", ["panda", "ur10e", *(pytest.param(x, marks=pytest.mark.full) for x in ("ur10e loaded", "ur10"))]
)
@pytest.mark.parametrize("pair", [(4, 5), (3, 4), (1, 2)])
def test_exchanged_torque_columns_of_a_real_log_are_named(wrong, name, pair):
    robot, log = wrong[name]
    order = np.arange(log.n)
    order[[pair[0] - 1, pair[1] - 1]] = pair[1] - 1, pair[0] - 1
    with pytest.raises(RecordingError, match=rf"tau{pair[0]} and tau{pair[1]} seem to be exchanged .*exchange them"):
        check_plausible(replace(log, tau=log.tau[:, order]), robot)


def test_torques_exchanged_fit_as_the_log_with_them_exchanged_does(wrong):
    """What is computed once for all pairs is nothing of tau."""
    for robot, log in (wrong["panda"], wrong["ur10e loaded"]):
        orders = [[1, 0, *range(2, robot.n)], list(range(robot.n))[::-1]]
        logs = [replace(log, tau=log.tau[:, order]) for order in orders]
        assert torque_scales(log, robot, orders) == [torque_scale(other, robot) for other in logs]
        assert torque_scales(log, robot, orders, 24) == [torque_scale(other, robot, most=24) for other in logs]
        assert torque_scales(log.select(slice(2)), robot, orders) == [None, None]


@pytest.mark.parametrize("whole", [False, True])
def test_torques_exchanged_alone_and_joints_exchanged_whole_are_told_apart(whole):
    """Each looks like the other: to exchange what is not exchanged would spoil the positions."""
    robot, seed = arm("gen3"), 2
    t = np.arange(0.0, 6.0, 0.02)
    q, dq, ddq = random_motion(robot, seed)(t)
    tau = robot.with_payload(heavy(0.3 * robot.rated_payload, seed)).torque(q, dq, ddq)
    order = [0, 1, 2, 3, 4, 6, 5]
    log = Recording(t, *((q[:, order], dq[:, order]) if whole else (q, dq)), tau[:, order])
    said = "joints 6 and 7 seem to be exchanged, in q, dq and tau" if whole else "tau6 and tau7 seem to be exchanged"
    with pytest.raises(RecordingError, match=said):
        check_plausible(log, robot)


def test_a_turned_sign_that_looks_like_a_base_mounted_otherwise_is_named_beside_it():
    robot, seed = arm("gen3"), 2
    t = np.arange(0.0, 6.0, 0.02)
    q, dq, ddq = random_motion(robot, seed)(t)
    tau = robot.with_payload(heavy(0.3 * robot.rated_payload, seed)).torque(q, dq, ddq)
    turned = np.where(np.arange(robot.n) == 1, -1.0, 1.0)
    with pytest.raises(RecordingError, match=r"far better with gravity about .* or check the order and the signs of"):
        check_plausible(Recording(t, turned * q, turned * dq, tau), robot)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
@pytest.mark.parametrize("tilt", [(1.7, 0.0, -9.66), (9.81, 0.0, 0.0)])
def test_a_base_that_leans_is_not_taken_for_exchanged_columns(sound, name, tilt):
    """Whatever else is said of a base that leans by ten or ninety degrees, no columns are named."""
    robot, logs = sound[name]
    leaning = replace(robot, gravity=np.array(tilt))
    for log in logs:
        check_for_exchanged_torques(log, leaning, torque_scale(log, leaning))


def mounted(robot, gravity):
    """The robot with gravity as `--gravity` takes it."""
    return replace(robot, gravity=np.array([float(x) for x in gravity.split(",")]))


def assert_named(log, robot, hung, gravity):
    """A sound log of a base that hangs is told so where it is taken for one of a base that stands."""
    check_plausible(log, hung)
    with pytest.raises(RecordingError, match=rf"far better with gravity about {gravity} m/s² .*--gravity"):
        check_plausible(log, robot)


@pytest.mark.parametrize(
    ("name", "seed", "gravity"),
    [("panda", 5, "0,-9.81,0"), ("fr3", 0, "0,0,9.81"), ("gen3", 1, "0,-9.81,0"), ("iiwa14", 0, "0,9.81,0")],
)
def test_a_base_on_a_wall_or_a_ceiling_is_not_taken_for_exchanged_joints(name, seed, gravity):
    robot = arm(name)
    hung = mounted(robot, gravity)
    t = np.arange(0.0, 3.0, 0.02)
    q, dq, ddq = random_motion(robot, seed)(t)
    log = Recording(t, q, dq, hung.with_payload(heavy(0.3 * robot.rated_payload, seed)).torque(q, dq, ddq))
    assert_named(log, robot, hung, gravity)


@pytest.mark.parametrize(("seed", "gravity"), [(2, "9.81,0,0"), (7, "0,-9.81,0")])
def test_a_base_on_a_wall_is_named_where_the_log_fits_no_payload(panda, seed, gravity):
    """Here no exchange of joints or columns comes near, and only the misfit tells that something is wrong."""
    hung = mounted(panda, gravity)
    t = np.arange(0.0, 6.0, 0.02)
    q, dq, ddq = random_motion(panda, seed)(t)
    held = draw_payload("boxes", seed, 0.9).parameters
    log = Recording(t, q, dq, hung.with_payload(held).torque(q, dq, ddq))
    assert_named(log, panda, hung, gravity)


@pytest.mark.parametrize(
    ("name", "seed", "gravity"),
    [("panda", 0, "0,0,9.81"), ("panda", 2, "0,0,9.81"), ("ur10e", 1, "0,0,9.81"), ("ur10e", 0, "9.81,0,0")],
)
@pytest.mark.full  # some seconds
def test_a_base_on_a_ceiling_or_a_wall_is_not_taken_for_a_sign_a_unit_or_gravity_taken_out(name, seed, gravity):
    robot = arm(name)
    hung = mounted(robot, gravity)
    how = {"rate": 100.0, "duration": 6.0, "world": World.real_like(hung, seed), "seed": seed}
    log = simulate(hung, random_motion(robot, seed), box_of_the_examples(), **how)
    assert_named(log, robot, hung, gravity)
    turned = replace(log, tau=-log.tau)
    with pytest.raises(RecordingError, match=r"^(?!.*far better with gravity)"):
        check_plausible(turned, hung)


@pytest.mark.parametrize("seed", [2, 3])
def test_a_base_that_leans_by_45_degrees_is_not_taken_for_another_robot(panda, seed):
    leaning = replace(panda, gravity=np.array([6.94, 0.0, -6.94]))
    world = World.real_like(leaning, seed)
    log = simulate(
        leaning, random_motion(panda, seed), box_of_the_examples(), rate=100.0, duration=6.0, world=world, seed=seed
    )
    check_plausible(log, leaning)
    with pytest.raises(RecordingError, match=r"far better with gravity about 6\.94,0,-6\.94 m/s² .*--gravity"):
        check_plausible(log, panda)


def test_a_payload_that_is_put_down_within_a_log_is_not_taken_for_exchanged_columns(panda):
    """A motion in which 2.8 kg that are put down after 1.5 s look like the torques of joints 1 and 5 exchanged."""
    episode = draw_episodes(panda, "reference", 16, 300, motions=6)[11]
    t = np.arange(0.0, 6.0, 5e-3)
    q, dq, ddq = episode.motion(t)
    held = panda.with_payload(episode.payload.parameters).torque(q, dq, ddq)
    log = Recording(t, q, dq, np.where((t < 1.52)[:, None], held, panda.torque(q, dq, ddq)))
    seen, other = torque_scale(log, panda), torque_scale(replace(log, tau=log.tau[:, [4, 1, 2, 3, 0, 5, 6]]), panda)
    assert other.misfit < 0.45 * seen.misfit  # it does look so
    check_for_exchanged_torques(log, panda, seen)


def test_a_payload_that_is_put_down_is_not_taken_for_no_torque(panda):
    """2.5 kg put down after 8 s of a slow motion, which look like another share of the arm's own torque."""
    t, rng = np.arange(0.0, 12.0, 0.02), np.random.default_rng(105)
    w = np.array([0.2, 0.3, 0.25, 0.3, 0.35, 0.3, 0.4])
    size, phase = 0.25 * rng.uniform(0.2, 1.0, 7), rng.uniform(0.0, 6.28, 7)
    centre = np.array([0.0, -0.3, 0.0, -2.0, 0.0, 1.6, 0.8]) + rng.uniform(-0.8, 0.8, 7)
    angle = w * t[:, None] + phase
    q, dq, ddq = centre + size * np.sin(angle), size * w * np.cos(angle), -size * w**2 * np.sin(angle)
    held = panda.with_payload(draw_payload("boxes", 105, 2.5).parameters).torque(q, dq, ddq)
    log = Recording(t, q, dq, np.where((t < 8.0)[:, None], held, panda.torque(q, dq, ddq)))
    assert torque_scale(log, panda).is_wrong  # it does look so
    check_plausible(log, panda)


def test_a_rated_payload_that_is_put_down_is_not_taken_for_another_robot(panda):
    """3 kg put down in the middle of a motion, which as a whole fit no payload."""
    t = np.arange(0.0, 6.0, 0.02)
    q, dq, ddq = random_motion(panda, 1, duration=6.0)(t)
    heavy = InertialParameters.from_com(3.0, (0.0, 0.0, 0.12), 0.01 * np.eye(3))
    held = panda.with_payload(heavy).torque(q, dq, ddq)
    log = Recording(t, q, dq, np.where((t < 3.2)[:, None], held, panda.torque(q, dq, ddq)))
    seen = torque_scale(log, panda)
    assert seen.misfit > 2.5  # it does look so
    assert not seen.is_wrong
    check_plausible(log, panda)


@pytest.mark.parametrize("turns", [6.1, 7.0])
def test_a_sign_that_turns_within_a_log_is_not_taken_for_a_payload_that_changes(panda, turns):
    """What follows has the misfit of no payload, where a log that is as wrong as a whole is looked at in parts."""
    t = np.arange(0.0, 12.0, 0.02)
    q, dq, ddq = random_motion(panda, 1, duration=6.0)(t)
    tau = panda.torque(q, dq, ddq)
    log = Recording(t, q, dq, np.where((t < turns)[:, None], tau, -tau))
    with pytest.raises(RecordingError, match="does not fit panda with any payload"):
        check_plausible(log, panda)


def test_positions_outside_the_limits_are_refused_by_joint_and_row(sound, panda):
    log = sound["panda"][1][0]
    q = log.q.copy()
    shift = panda.limits.position_high[3] + 0.04 - q[:, 3].max()
    q[:, 3] += shift
    check_plausible(replace(log, q=q, tau=panda.torque(q)), panda)  # calibration may be off by so much
    q[:, 3] += 0.02
    k = int(np.flatnonzero(q[:, 3] > panda.limits.position_high[3] + 0.05)[0])
    says = rf"q4 = -0\.0\d+ rad at row {k} \(t = .*outside the limits of panda's panda_joint4"
    with pytest.raises(RecordingError, match=says):
        check_plausible(replace(log, q=q), panda)


def test_joint_names_of_another_arm_or_order_are_refused(sound, panda):
    log = sound["panda"][1][0]
    with pytest.raises(RecordingError, match=r"joints in another order"):
        check_plausible(replace(log, joint_names=panda.joint_names[::-1]), panda)
    with pytest.raises(RecordingError, match=r"joints of another arm"):
        check_plausible(replace(log, joint_names=tuple("abcdefg")), panda)
    with pytest.raises(RecordingError, match=r"log has 7 joints \(q1\.\.q7\), ur10e has 6"):
        check_plausible(log, arm("ur10e"))


def test_too_fast_is_refused_by_joint_and_row(sound, panda):
    log = sound["panda"][1][0]
    dq = log.dq.copy()
    dq[77, 4] = -7.0
    with pytest.raises(RecordingError, match=r"dq5 = -7 rad/s at row 77 .* 2 times the limit of panda_joint5"):
        check_plausible(replace(log, dq=dq), panda)


def test_the_torque_scale_is_one_for_the_arm_itself_and_the_factor_for_another():
    robot = arm("panda")
    (log,) = simulate_many(robot, [Run(taie2024(), heavy(3.0, 0))], rate=500.0)
    fit = torque_scale(log, robot)
    assert fit.scale == pytest.approx(1.0, abs=0.01)
    assert fit.misfit < 0.05
    for factor in (0.5, 2.0):
        other = robot.with_links(robot.link_parameters / factor)
        fit = torque_scale(replace(log, tau=robot.torque(*taie2024()(log.t))), other)
        assert fit.scale == pytest.approx(factor, rel=0.05)


def test_sound_logs_hold_the_share_of_the_arms_own_torque_that_the_page_says(real, sound):
    page = (Path(__file__).resolve().parents[2] / "docs/recordings.md").read_text(encoding="utf-8")
    text = " ".join(page[page.index("For comparison, s of sound logs:") :].split())
    said = re.search(
        r"Panda (\S+), a real UR10e .*? (\S+) \(unloaded\) and (\S+) \(with 2.8 kg\), .*? payload "
        r"(\S+) to (\S+) \(Panda\) and (\S+) to (\S+) \(UR10e\)\. The residual was below (\S+) in",
        text,
    )
    assert said is not None
    found = [torque_scale(log, robot) for robot, log in (real[name] for name in ("panda", "ur10e", "ur10e loaded"))]
    made = [[torque_scale(log, robot) for log in logs] for robot, logs in sound.values()]
    s = [fit.scale for fit in found] + [edge(fit.scale for fit in fits) for fits in made for edge in (min, max)]
    assert [f"{x:.2f}" for x in s] == list(said.groups()[:7])
    assert max(fit.misfit for fits in (found, *made) for fit in fits) < float(said[8])


def test_windows_never_span_a_gap_and_integrate_exactly():
    t = np.delete(np.arange(0, 10, 0.01), np.s_[300:340])
    log = Recording(t, *(np.c_[f(t)] for f in (np.sin, np.cos, np.sin)))
    parts = windows(log)
    assert not np.any((t[parts.first] < 3.0) & (t[parts.last] > 3.39))
    assert np.all(parts.first[1:] >= parts.last[:-1])
    assert np.sum(t[parts.last] - t[parts.first]) > 9.0
    change = log.q[parts.last] - log.q[parts.first]
    np.testing.assert_allclose(integrals(log, lambda rows: log.dq[rows], parts), change, atol=1e-5)  # trapezoids: h²/12


@pytest.mark.parametrize("seed", range(6))
def test_friction_that_keeps_hold_of_resting_joints_is_no_wrong_robot(seed):
    """A pick-and-place log of motor currents: at rest each joint is held by the friction of its last move."""
    robot, rng, t = arm("ur5e"), np.random.default_rng(seed), np.arange(0.0, 6.0, 0.008)
    poses = rng.uniform([-1.0, -2.0, -1.0, -1.0, -1.0, -1.0], [1.0, -0.9, 1.0, 1.0, 1.0, 1.0], size=(4, 6))
    q, dq, ddq = np.zeros((3, len(t), 6))
    q += poses[0]
    held = np.tile(np.sign(rng.normal(size=6)), (len(t), 1))
    for k, move in enumerate(np.diff(poses, axis=0)):
        s = np.clip(t - 0.5 - 2.0 * k, 0.0, 1.0)
        q += np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, move)
        dq += np.outer(30 * s**2 - 60 * s**3 + 30 * s**4, move)
        ddq += np.outer(60 * s - 180 * s**2 + 120 * s**3, move)
        held[t >= 0.5 + 2.0 * k] = np.sign(move)
    tau = robot.torque(q, dq, ddq) + 0.12 * rated_effort(robot) * held
    check_plausible(Recording(t, q, dq, tau), robot)
    with pytest.raises(RecordingError, match=r"opposite sign|does not fit|holds only"):
        check_plausible(Recording(t, q, dq, -tau), robot)


@pytest.mark.parametrize("name", ["ur10e_unloaded.csv", "ur10e_loaded_2805g.csv"])
def test_motor_currents_are_called_so_with_what_to_do(real_data, name):
    """The real logs' torque is current times these constants: divided by them again it is what the robot measured."""
    robot, constants = arm("ur10e"), np.array([11.98, 11.976, 9.836, 10.70, 10.70, 10.70])
    log = read_recording(real_data / name, robot)
    with pytest.raises(
        RecordingError, match=r"look like currents, in A.*tau_unit=A multiplies each .*11\.98, 11\.976, 9\.836"
    ):
        check_plausible(replace(log, tau=log.tau / constants), robot)
    stranger = replace(robot, known_as=None)
    with pytest.raises(
        RecordingError, match=r'look like currents, in A.*"torque_constants=…", 6 numbers .*from the maker'
    ):
        check_plausible(replace(log, tau=log.tau / constants), stranger)


@pytest.mark.parametrize("name", ["ur10e_unloaded.csv", "ur10e_loaded_2805g.csv"])
def test_torque_without_gravity_is_called_so_with_what_to_do(real_data, name):
    """As UR's ROS 2 driver reports it: the real torque less the gravity of the arm."""
    robot = arm("ur10e")
    log = read_recording(real_data / name, robot)
    taken = replace(log, tau=log.tau - robot.torque(log.q))
    with pytest.raises(RecordingError, match=r"gravity taken out.*--compensated nothing"):
        check_plausible(taken, robot)
    check_plausible(with_gravity(taken, robot), robot)


def test_gravity_that_was_never_taken_out_is_not_put_back(real_data):
    """With it twice, the empty arm's log would be one of a payload; the same torque without gravity is restored."""
    robot = arm("ur10e")
    empty, loaded = (
        read_recording(real_data / name, robot) for name in ("ur10e_unloaded.csv", "ur10e_loaded_2805g.csv")
    )
    for logs in ([loaded], [loaded, empty]):
        with pytest.raises(RecordingError, match=r"ur10e_\w+\.csv: tau seems to have gravity in it already"):
            check_gravity_was_missing([with_gravity(log, robot) for log in logs], robot)
        with pytest.raises(RecordingError, match="gravity in it already"):  # whoever checks any log
            check_plausible(
                read_recording(real_data / "ur10e_loaded_2805g.csv", robot, columns="compensated=nothing"), robot
            )
        taken = [with_gravity(replace(log, tau=log.tau - robot.torque(log.q)), robot) for log in logs]
        check_gravity_was_missing(taken, robot)
        for log, restored in zip(logs, taken, strict=True):
            assert_allclose(restored.tau, log.tau, atol=1e-9)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", ["panda", "ur5e"])
def test_a_tare_tells_with_the_run_whether_gravity_is_in_the_torque(name, seed):
    robot = arm(name)
    world, sensors = World.real_like(robot, 700 + seed), Sensors.of(robot)
    logs = [
        simulate(
            robot, random_motion(robot, 70 + seed + k, duration=6.0), payload, world=world, sensors=sensors, rate=200.0
        )
        for k, payload in enumerate((heavy(0.5 * rated_mass(robot), seed), None))
    ]
    with pytest.raises(RecordingError, match="gravity in it already"):
        check_gravity_was_missing([with_gravity(log, robot) for log in logs], robot)
    set_to = franka_hand().parameters if name == "panda" else None
    loaded = robot if set_to is None else robot.with_payload(set_to)
    taken = [replace(log, tau=log.tau - loaded.torque(log.q)) for log in logs]
    restored = [with_gravity(log, robot, set_to) for log in taken]
    check_gravity_was_missing(restored, robot)
    assert_allclose(restored[0].tau, logs[0].tau, atol=1e-9)


def test_gravity_is_put_back_once():
    robot, still = arm("panda"), np.zeros((3, 7))
    log = with_gravity(Recording(np.arange(3) * 0.1, still, still, still), robot)
    with pytest.raises(RecordingError, match="said twice"):
        with_gravity(log, robot)
    assert log.between(0.0, 0.15).gravity_of is log.gravity_of


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
@pytest.mark.parametrize("name", ["ur5e", "ur10e"])
@pytest.mark.full  # some seconds
def test_currents_and_torque_without_gravity_are_called_so_where_their_size_says_nothing(name, seed):
    """In six seconds friction and a payload could make up any share of the arm's own torque."""
    robot = arm(name)
    how = {"world": World.real_like(robot, 500 + seed), "sensors": Sensors.of(robot), "rate": 200.0, "seed": seed}
    log = simulate(robot, random_motion(robot, 40 + seed, duration=6.0), heavy(1.0 * seed, seed), **how)
    check_plausible(log, robot)
    with pytest.raises(RecordingError, match="look like currents, in A"):
        check_plausible(replace(log, tau=log.tau / 11.0), robot)
    with pytest.raises(RecordingError, match="gravity taken out"):
        check_plausible(replace(log, tau=log.tau - robot.torque(log.q)), robot)


def test_a_torque_that_is_no_current_is_not_called_one(panda):
    log = simulate(panda, taie2024(), None, rate=200.0)
    with pytest.raises(RecordingError, match="of the torque panda needs") as caught:
        check_plausible(replace(log, tau=0.1 * log.tau), panda)
    assert "current" not in str(caught.value)


def to_and_fro(robot, seed):
    """A periodic motion, whose acceleration is opposite to its position, with gears as a real UR10e's."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 10.0, 8e-3)
    q, dq, ddq = np.tile([0.0, -1.4, 1.6, -1.6, -1.5, 0.0], (len(t), 1)), 0.0, 0.0
    for k in range(1, 6):
        w, size = 0.24 * np.pi * k, 0.33 * np.array([1.2, 0.5, 0.7, 0.9, 0.9, 1.4]) * rng.uniform(-1.0, 1.0, 6)
        angle = w * t[:, None] + rng.uniform(0.0, 2.0 * np.pi, 6)
        q, dq, ddq = q + size * np.sin(angle), dq + w * size * np.cos(angle), ddq - w**2 * size * np.sin(angle)
    gears = 0.05 * np.tanh(dq / 0.03) + 0.05 * dq + 0.02 * ddq + 0.007 * rng.normal(size=q.shape)
    return Recording(t, q, dq, robot.torque(q, dq, ddq) + rated_effort(robot) * gears)


@pytest.mark.parametrize(("name", "seed"), [("ur3e", 1), ("ur3e", 4), ("ur5e", 3)])
def test_rotors_and_viscous_friction_are_no_gravity_taken_out(name, seed):
    robot = arm(name)
    log = to_and_fro(robot, seed)
    check_plausible(log, robot)
    with pytest.raises(RecordingError, match="gravity taken out"):
        check_plausible(replace(log, tau=log.tau - robot.torque(log.q)), robot)


@pytest.mark.parametrize("seed", [6, 16])
def test_viscous_friction_and_rotors_are_no_exchanged_joints(seed):
    """They make a wrist joint's torque look like another's."""
    robot = arm("ur3e")
    log = to_and_fro(robot, seed)
    check_plausible(log, robot)
    order = [2, 1, 0, 3, 4, 5]
    with pytest.raises(RecordingError, match="joints 1 and 3 seem to be exchanged"):
        check_plausible(replace(log, **{x: getattr(log, x)[:, order] for x in ("q", "dq", "tau")}), robot)


@pytest.mark.parametrize(("name", "mass", "seed"), [("ur5e", 3.0, 6), ("ur5e", 3.0, 20), ("ur3e", 2.0, 5)])
def test_what_is_put_down_within_a_log_of_motor_currents_is_no_gravity_taken_out(name, mass, seed):
    robot = arm(name)
    how = {"world": World.real_like(robot, 500 + seed), "sensors": Sensors.of(robot), "rate": 200.0, "seed": seed}
    held, motion = [(0.0, heavy(mass, seed)), (3.0, None)], random_motion(robot, 40 + seed, duration=6.0)
    source = Simulator(robot, motion, held, speed=None, duration=6.0, **how)
    check_plausible(Recording(*map(np.array, zip(*source, strict=True))), robot)

"""Worlds beyond the measured ones: every part of their torque is what it says, against closed forms and Pinocchio."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from armload.arms import arm, rated_effort
from armload.errors import ArmError
from armload.inertia import InertialParameters, is_consistent
from armload.motion import FourierMotion, StraightMotion, random_motion
from armload.simulation import (
    ContinuedRun,
    Drift,
    Friction,
    Gains,
    Resolution,
    Run,
    SmoothTorque,
    World,
    simulate,
    simulate_inverse,
    simulate_many,
)

PAYLOAD = InertialParameters.from_com(2.0, (0.02, -0.03, 0.08), np.diag([8e-3, 9e-3, 6e-3]))
COARSE = Resolution.coarse()


def motion_of(arm) -> FourierMotion:
    pose = [0.1, -0.4, 0.2, -1.9, 0.1, 1.7, 0.3] if arm.n == 7 else [0.0, -1.2, 1.5, -1.0, -1.5, 0.0]
    rng = np.random.default_rng(0)
    return FourierMotion(np.array(pose), *(0.15 * rng.normal(size=(2, arm.n, 3))), period=6.0).smooth()


def rms(x) -> np.ndarray:
    return np.sqrt(np.mean(np.square(x), axis=0))


# ---------------------------------------------------------------- friction


def test_friction_has_the_levels_peak_slope_and_share_it_is_given():
    one = np.ones(1)
    fast, slow = np.array([[50.0], [-50.0]]), np.array([[0.01], [-0.01]])
    two = Friction(2.0 * one, 1e-3 * one, asymmetry=0.25 * one)
    np.testing.assert_allclose(two(fast).ravel(), [2.5, -1.5])
    peak = Friction(2.0 * one, 1e-3 * one, stribeck=one, stribeck_velocity=0.01 * one)
    np.testing.assert_allclose(peak(slow).ravel(), [2.0 + np.exp(-1.0), -2.0 - np.exp(-1.0)], rtol=1e-6)
    np.testing.assert_allclose(peak(fast).ravel(), [2.0, -2.0])
    np.testing.assert_allclose(Friction(0 * one, one, viscous=0.3 * one)(fast).ravel(), [15.0, -15.0])
    pressed = Friction(0 * one, 1e-3 * one, load=0.1 * one)
    np.testing.assert_allclose(pressed(fast, np.array([[-40.0], [-40.0]])).ravel(), [4.0, -4.0])
    np.testing.assert_array_equal(pressed(fast), np.zeros((2, 1)))


@pytest.mark.parametrize("seed", range(6))
def test_friction_never_drives(any_arm, seed):
    rng = np.random.default_rng(seed)
    dq, torque = rng.normal(size=(2, 500, any_arm.n)) * [[[0.5]], [[50.0]]]
    assert np.all(World.beyond(any_arm, seed).friction(dq, torque) * dq >= 0)


def test_friction_that_cannot_be_is_refused():
    with pytest.raises(ArmError, match="viscous of the friction has shape"):
        Friction(np.ones(3), np.ones(3), viscous=np.ones(2))
    with pytest.raises(ArmError, match="expected numbers above 0 rad/s"):
        Friction(np.ones(3), np.zeros(3))


# ---------------------------------------------------------------- what the sensor shows


@pytest.mark.parametrize("resolution", [Resolution(), COARSE], ids=["fine", "coarse"])
@pytest.mark.parametrize("motor_side", [False, True], ids=["joint", "motor"])
def test_a_log_beyond_is_the_sum_of_the_world_s_parts(some_arm, motor_side, resolution):
    world = World.beyond(some_arm, 1 + motor_side, motor_side)
    drift = Drift(np.linspace(0.1, 0.5, some_arm.n), 100.0)
    world = replace(world, drift=drift, friction=replace(world.friction, load=np.full(some_arm.n, 0.01)))
    run = Run(motion_of(some_arm), PAYLOAD, world, start=50.0)
    log = simulate_many(some_arm, [run], rate=1000.0, resolution=resolution)[0]
    ddq = CubicSpline(log.t, log.dq)(log.t, 1)
    rigid = some_arm.with_links(world.links).with_payload(PAYLOAD).torque(log.q, log.dq, ddq)
    if motor_side:
        rigid = rigid + world.rotor_inertia * ddq
    joint = rigid + world.friction(log.dq, rigid) + world.residual(log.q)
    expected = world.gain * joint + world.sticking(run.seed)(log.dq) + world.offset + drift(50.0 + log.t)
    left = rms(log.tau - expected)
    assert np.all(left < 2e-4 * rated_effort(some_arm))
    assert np.all(rms(log.tau - rigid) > 5e-3 * rms(log.tau - log.tau.mean(axis=0)))


def test_stiction_holds_any_torque_at_rest_another_at_each_rest_and_none_in_motion():
    world = replace(World.real_like(arm("ur10e"), 3), gain=None)
    dq = np.repeat([0.0, 1.0, 0.0, -1.0, 0.0], 100)[:, None] * np.ones(6)
    stuck = world.sticking(4)(dq)
    rests = stuck.reshape(5, 100, 6)[::2]
    assert np.all(rests == rests[:, :1])
    assert np.all(np.abs(rests) <= world.stiction)
    assert len(np.unique(rests[:, 0])) == 18
    assert np.all(np.abs(stuck[np.abs(dq[:, 0]) > 0.5]) < 1e-3 * world.stiction)
    assert np.all(stuck[0] != world.sticking(5)(dq)[0])
    assert not World.real_like(arm("panda"), 3).sticking(4)(np.zeros((5, 7))).any()


def test_stiction_is_the_same_however_a_run_is_cut():
    world, rng = World.real_like(arm("ur10e"), 3), np.random.default_rng(0)
    dq = np.cumsum(0.1 * rng.normal(size=(2000, 6)), axis=0)
    whole, pieces = world.sticking(4)(dq), world.sticking(4)
    cut = np.concatenate([pieces(part) for part in np.split(dq, [1, 2, 700, 701, 1500])])
    np.testing.assert_array_equal(cut, whole)
    assert np.abs(whole).max() > 1.0


def test_a_run_that_goes_on_is_the_run_in_one_piece_stiction_and_all():
    ur = arm("ur10e")
    world = World.real_like(ur, 3)
    motion = random_motion(ur, 3, duration=2.0)
    whole = simulate_many(ur, [Run(motion, PAYLOAD, world, seed=6)], rate=200.0)[0]
    going = ContinuedRun(ur, motion, PAYLOAD, world=world, rate=200.0, seed=6)
    tau = np.concatenate([going.advance(50)[3] for _ in range(6)])
    assert rms(world.sticking(6)(whole.dq)).max() > 0.1
    # pieces iterate towards the motor's friction on their own
    assert np.all(rms(tau - whole.tau[:300]) < 0.05 * rated_effort(ur))


@pytest.mark.parametrize("name", ["ur10e", "ur5e", "xarm7"])
def test_an_arm_that_is_told_to_stand_stands_whatever_friction_its_joints_have(name):
    robot = arm(name)
    pose = random_motion(robot, 1).position([0.0])[0]
    standing = StraightMotion(pose, pose, 5.0)
    going = ContinuedRun(robot, standing, world=World.real_like(robot, 0), rate=500.0, comes_to_rest=True)
    assert max(np.abs(going.advance(10)[2]).max() for _ in range(150)) < 1e-6


def test_a_run_that_comes_to_rest_has_the_torque_of_its_own_motion_by_pinocchio():
    """The log holds what moved the bodies, whatever the iteration for friction leaves."""
    ur = arm("ur10e")
    motion, world = random_motion(ur, 3, duration=2.0), World.real_like(ur, 3)
    going = ContinuedRun(ur, motion, PAYLOAD, world=world, rate=500.0, comes_to_rest=True)
    t, q, dq, tau = map(np.concatenate, zip(*(going.advance(10) for _ in range(100)), strict=True))
    ddq = CubicSpline(t, dq)(t, 1)
    rigid = world.arm(ur).with_payload(PAYLOAD).torque(q, dq, ddq) + world.rotor_inertia * ddq
    expected = world.measured(rigid + world.disturbance(q, dq, rigid), t) + world.sticking(0)(dq)
    # between two pieces the acceleration jumps, which a spline does not know
    assert np.all(np.median(np.abs(tau - expected), axis=0) < 5e-4 * rated_effort(ur))
    assert np.all(rms(dq) > 0.05)


def test_a_drift_starts_at_nothing_and_ends_at_its_size():
    drift = Drift(np.array([0.2, -0.4]), 60.0)
    np.testing.assert_allclose(drift([0.0, 60.0, 1e6]), [[0, 0], np.array([0.2, -0.4]) * (1 - np.exp(-1)), [0.2, -0.4]])


def test_a_rotor_s_inertia_shows_only_in_acceleration(panda):
    hold = FourierMotion(motion_of(panda).offset, np.zeros((7, 1)), np.zeros((7, 1)), period=1.0)
    world = replace(World.nominal(panda), rotor_inertia=np.full(7, 0.5))
    still, bare = (simulate(panda, hold, PAYLOAD, world=w, rate=100.0) for w in (world, None))
    np.testing.assert_allclose(still.tau, bare.tau, atol=1e-6)


# ---------------------------------------------------------------- how they are drawn


def test_worlds_beyond_are_reproducible_distinct_and_made_of_bodies_that_exist(any_arm):
    worlds = [World.beyond(any_arm, seed) for seed in (0, 0, 1, 2, 3)]
    assert len({w.fingerprint for w in worlds}) == 4
    assert all(is_consistent(phi) for w in worlds for phi in w.links)


def test_every_part_of_a_world_enters_its_fingerprint(panda):
    world = World.real_like(panda, 0)
    changed = [
        replace(world, gain=np.full(7, 1.01)),
        replace(world, rotor_inertia=np.full(7, 1.01)),
        replace(world, drift=Drift(np.full(7, 0.1), 10.0)),
        replace(world, friction=replace(world.friction, viscous=np.full(7, 0.1))),
        replace(world, friction=replace(world.friction, load=np.full(7, 0.1))),
    ]
    assert len({w.fingerprint for w in (world, *changed)}) == 6


def test_worlds_beyond_scatter_one_to_three_times_as_wide_as_real_like_ones(panda):
    beyond = [World.beyond(panda, seed, motor_side=False) for seed in range(150)]
    ratio = np.exp(np.mean(np.log([w.friction.level / [0.25, 0.25, 0.2, 0.35, 0.35, 0.2, 0.26] for w in beyond])))
    assert ratio == pytest.approx(np.sqrt(3.0), rel=0.12)  # the median of a log-uniform factor, the spread's own −5 %
    q = np.random.default_rng(0).uniform(-3, 3, size=(300, 7))
    sizes = np.array([rms(w.residual(q)) for w in beyond]) / [0.20, 0.28, 0.19, 0.20, 0.08, 0.05, 0.045]
    assert 0.6 < sizes.mean(axis=1).min() < 1.3
    assert 2.2 < sizes.mean(axis=1).max() < 3.6
    assert all(np.abs(w.gain - 1).max() <= 0.01 for w in beyond)
    masses = np.array([w.links[:, 0] for w in beyond]) / panda.link_parameters[:, 0]
    assert masses.std() == pytest.approx(0.02 * np.sqrt(8 / (2 * np.log(3))), rel=0.2)  # E[s²] = (9 − 1)/(2·ln 3)


def test_motor_side_friction_is_a_tenth_of_the_rated_torque():
    ur = arm("ur10e")
    levels = np.array([World.beyond(ur, seed, motor_side=True).friction.level for seed in range(60)])
    share = np.median(levels / rated_effort(ur), axis=0)
    assert np.all((share > 0.06) & (share < 0.12))


def test_an_arm_known_to_measure_motor_current_is_simulated_so(panda):
    ur, seeds = arm("ur10e"), range(40)
    for drawn in (World.real_like, World.beyond):
        worlds = [drawn(ur, seed) for seed in seeds]
        share = np.array([world.friction.level / rated_effort(ur) for world in worlds])
        assert 0.05 * 0.1 < share.min() < 0.06
        assert 0.06 < np.median(share) < 0.12
        assert all(world.rotor_inertia is not None and np.all(world.gain != 1.0) for world in worlds)
    assert all(World.real_like(panda, seed).rotor_inertia is None for seed in seeds)


@pytest.mark.parametrize("draw", [World.real_like, World.beyond])
def test_gears_before_a_motor_s_torque_lose_as_much_as_a_ur10e_s(draw):
    """Fitted to its logs (`benchmarks/real_residuals.py`): 4 to 7 % in joints 2 to 6; a UR10's 3 to 5 %."""
    frictions = [draw(arm("ur10e"), seed).friction for seed in range(40)]
    losses = np.array([friction.load for friction in frictions])
    assert losses.min() >= 0.02
    assert losses.max() <= 0.12
    low, high = np.percentile(losses, [10, 90])
    assert low < 0.035
    assert high > 0.10
    slope = np.array([friction.viscous for friction in frictions]) / rated_effort(arm("ur10e"))
    assert 0.03 < np.median(slope) < 0.08  # of the rated torque per rad/s: 0.05 of a UR10e and of a UR10


def test_links_scatter_as_far_as_the_description_of_the_arm_may_be_off(panda):
    def scatter(robot):
        worlds = [World.real_like(robot, seed) for seed in range(100)]
        return np.std([world.links[:, 0] / robot.link_parameters[:, 0] for world in worlds])

    assert scatter(panda) == pytest.approx(0.02, rel=0.15)
    assert scatter(replace(panda, link_spread=5.0)) == pytest.approx(0.1, rel=0.15)


def test_what_existing_seeds_give_stays(panda):
    world = World.real_like(panda, 0)
    np.testing.assert_allclose(world.offset[:3], [0.210137298096, -0.287881118708, -0.0858743918601], rtol=1e-9)
    np.testing.assert_allclose(world.friction.level[:3], [0.201327919294, 0.310220702338, 0.167227355274], rtol=1e-9)
    np.testing.assert_allclose(
        world.residual(np.full((1, 7), 0.3))[0, :3], [-0.190343325931, -0.342204417229, -0.235049074061], rtol=1e-7
    )


def test_ripple_is_each_joint_s_own_and_repeats_with_a_turn():
    ripple = SmoothTorque.ripple([0.3, 0.1], np.random.default_rng(0))
    q = np.random.default_rng(1).uniform(-6, 6, size=(4000, 2))
    np.testing.assert_allclose(rms(ripple(q)), [0.3, 0.1], rtol=0.05)
    np.testing.assert_allclose(ripple(q + 2 * np.pi), ripple(q), atol=1e-12)
    np.testing.assert_allclose(ripple(q + np.array([0.0, 0.5]))[:, 0], ripple(q)[:, 0], atol=1e-12)


def test_stiffer_gains_sag_less(panda):
    hold = FourierMotion(motion_of(panda).offset, np.zeros((7, 1)), np.zeros((7, 1)), period=1.0)
    gains = Gains.of(panda)
    sag = [
        np.abs(log.q[-1] - hold.offset).max()
        for log in simulate_many(
            panda, [Run(hold, PAYLOAD, gains=gains.stiffer(f)) for f in (0.5, 1.0, 2.0)], rate=50.0
        )
    ]
    np.testing.assert_allclose(sag, sag[1] * np.array([2.0, 1.0, 0.5]), rtol=0.05)


# ---------------------------------------------------------------- by inverse dynamics


def test_inverse_dynamics_take_a_payload_as_the_simulation_does(panda):
    motion = motion_of(panda)
    one, same, none = (simulate_inverse(panda, motion, held) for held in (PAYLOAD, [(0.0, PAYLOAD)], None))
    np.testing.assert_array_equal(one.tau, same.tau)
    carried = panda.with_payload(PAYLOAD).torque(one.q, np.zeros_like(one.q), np.zeros_like(one.q))
    bare = panda.torque(one.q, np.zeros_like(one.q), np.zeros_like(one.q))
    assert np.median(np.abs(one.tau - none.tau - carried + bare), axis=0).max() < 1.0  # gravity is most of it


@pytest.mark.parametrize("drawn", [World.real_like, World.beyond])
def test_an_arm_with_a_link_without_mass_is_refused_by_the_joint_that_moves_it(drawn):
    links = arm("panda").link_parameters.copy()
    links[2] = 0.0
    with pytest.raises(
        ArmError, match=r"panda gives no mass to what panda_joint3 moves: expected a mass at every joint"
    ):
        drawn(arm("panda").with_links(links), 1)

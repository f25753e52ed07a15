"""The simulation obeys its own equation of motion, and its logs carry the payload and nothing else unless asked."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from armload.arms import arm, full_arm_regressor
from armload.errors import ArmError, MotionError, PayloadError
from armload.inertia import InertialParameters, is_consistent
from armload.motion import FourierMotion, taie2024
from armload.posterior import PosteriorLeastSquares
from armload.regression import FilteredRegression, first_order_lag
from armload.simulation import (
    Command,
    Friction,
    Gains,
    Resolution,
    Run,
    SmoothTorque,
    World,
    build_model,
    rollout,
    runs,
    simulate,
    simulate_inverse,
)
from armload.simulation import simulate_many as many

PAYLOAD = InertialParameters.from_com(2.0, (0.02, -0.03, 0.08), np.diag([8e-3, 9e-3, 6e-3]))
PAPER_RATE = 3244 / 6  # [Hz]


def motion_of(arm) -> FourierMotion:
    if arm.n == 7:
        return taie2024()
    rng = np.random.default_rng(0)
    sine, cosine = rng.normal(size=(2, arm.n, 5)) * 0.1
    return FourierMotion(np.array([0.0, -1.2, 1.5, -1.0, -1.5, 0.0]), sine, cosine, period=6.0).smooth()


def hold(arm, q=None) -> FourierMotion:
    """A motion that stays where it is."""
    q = np.array([0.3, -0.4, 0.2, -1.8, 0.1, 1.5, 0.3][: arm.n]) if q is None else q
    return FourierMotion(q, np.zeros((arm.n, 1)), np.zeros((arm.n, 1)), period=1.0)


def mismatch(arm, log) -> np.ndarray:
    """tau − inverse dynamics at the logged q, dq and the derivative of the logged dq, (N, n)."""
    return log.tau - arm.torque(log.q, log.dq, CubicSpline(log.t, log.dq)(log.t, 1))


def rms(x) -> np.ndarray:
    return np.sqrt(np.mean(np.square(x), axis=0))


def least_squares(arm, log) -> np.ndarray:
    r, W = FilteredRegression(arm)(log.t, log.q, log.dq, log.tau)
    return np.linalg.lstsq(W.reshape(-1, 10), r.ravel(), rcond=None)[0]


# ---------------------------------------------------------------- the plant


def test_a_step_is_a_leapfrog_with_implicit_damping(any_arm):
    gains, h = Gains.of(any_arm), 5e-4
    loaded = any_arm.with_payload(PAYLOAD)
    model = build_model(loaded, gains, h)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    for q, v, noise in rng.normal(size=(5, 3, any_arm.n)):
        ctrl = gains.stiffness * q + 10.0 * noise
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, ctrl
        mujoco.mj_step(model, data)
        after = data.qvel.copy()
        effective = ctrl - gains.stiffness * q - gains.damping * after
        scale = np.abs(effective).max()
        np.testing.assert_allclose(effective, loaded.torque(q, v, (after - v) / h), rtol=0, atol=1e-11 * scale + 1e-9)
        np.testing.assert_allclose(data.qpos, q + h * after, rtol=0, atol=1e-13)


def test_joint_limits_and_effort_limits_do_not_act(panda):
    gains = Gains.of(panda)
    model = build_model(panda, gains)
    data = mujoco.MjData(model)
    q = panda.limits.position_high + 0.3
    ctrl = gains.stiffness * q + 3.0 * panda.limits.effort
    data.qpos[:], data.ctrl[:] = q, ctrl
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_actuator, 3.0 * panda.limits.effort, atol=1e-9)
    np.testing.assert_allclose(data.qfrc_constraint, 0.0, atol=1e-15)


def test_impossible_inertia_is_one_clear_sentence(panda):
    links = panda.link_parameters.copy()
    links[3, 4:] *= -1.0
    with pytest.raises(ArmError, match="MuJoCo cannot simulate panda"):
        build_model(panda.with_links(links))


# ---------------------------------------------------------------- the nominal world


@pytest.mark.parametrize("rate", [100.0, PAPER_RATE, 1000.0])
@pytest.mark.parametrize("payload", [None, PAYLOAD], ids=["bare", "loaded"])
def test_nominal_log_is_the_inverse_dynamics_of_arm_and_payload(panda, payload, rate):
    log = simulate(panda, taie2024(), payload, rate=rate)
    loaded = panda if payload is None else panda.with_payload(payload)
    inner = slice(5, -5)  # the spline that differentiates dq is worse at its ends
    assert rms(mismatch(loaded, log)[inner]).max() < 5e-4


def test_what_is_left_falls_with_the_square_of_the_step(panda):
    left = []
    for step in (5e-4, 2.5e-4):
        log = many(panda, [Run(taie2024(), PAYLOAD)], resolution=Resolution(step=step))[0]
        left.append(rms(mismatch(panda.with_payload(PAYLOAD), log))[:4])
    np.testing.assert_allclose(left[1] / left[0], 0.25, atol=0.05)


@pytest.mark.parametrize("rate", [PAPER_RATE, 1000.0])
def test_least_squares_recovers_the_payload_without_noise(any_arm, rate):
    phi = least_squares(any_arm, simulate(any_arm, motion_of(any_arm), PAYLOAD, rate=rate))
    assert phi[0] == pytest.approx(PAYLOAD.mass, rel=1e-3)
    np.testing.assert_allclose(phi[1:4], PAYLOAD.first_moment, rtol=0, atol=1e-3)
    np.testing.assert_allclose(phi[4:], PAYLOAD.phi[4:], rtol=0, atol=1e-3)


def test_the_default_method_recovers_the_payload_without_noise(any_arm):
    # though it allows for a mismatch of the arm that is not there
    phi = PosteriorLeastSquares(any_arm).run(simulate(any_arm, motion_of(any_arm), PAYLOAD)).phi
    # the links' prior, wide for nominal figures, keeps a little of the payload: most on the UR5e
    assert phi[0] == pytest.approx(PAYLOAD.mass, rel=3e-3)
    np.testing.assert_allclose(phi[1:4], PAYLOAD.first_moment, rtol=0, atol=1e-3)


def test_controller_tracks_without_payload_and_sags_with_it(panda):
    motion = taie2024()
    free, loaded = (simulate(panda, motion, payload, rate=200.0) for payload in (None, PAYLOAD))
    q_d = motion(free.t)[0]
    assert np.abs(free.q - q_d).max() < 1e-5
    assert 1e-3 < np.abs(loaded.q - q_d).max() < 1e-2


def test_attached_hand_is_known_to_the_controller(panda):
    motion, arm = taie2024(), panda.with_payload(PAYLOAD)
    log = simulate(arm, motion, rate=200.0)
    assert np.abs(log.q - motion(log.t)[0]).max() < 1e-5
    np.testing.assert_allclose(least_squares(panda, log)[0], PAYLOAD.mass, rtol=1e-3)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (3.0, -2.0, -9.1)], ids=["upright", "tilted"])
@pytest.mark.parametrize("real", [False, True], ids=["nominal", "real-like"])
def test_a_run_starts_settled(any_arm, gravity, real):
    arm = replace(any_arm, gravity=gravity, motor_torque=False)
    world = World.real_like(arm, seed=2) if real else World.nominal(arm)
    log = simulate(arm, hold(arm), PAYLOAD, world=world, rate=100.0)
    assert np.abs(log.q - log.q[0]).max() < (1e-7 if real else 1e-12)
    assert np.abs(log.dq).max() < (1e-5 if real else 1e-11)
    held = arm.with_links(world.links).with_payload(PAYLOAD).torque(log.q[0])
    np.testing.assert_allclose(log.tau[0], held + world.offset + world.disturbance(log.q[0], log.dq[0])[0], atol=1e-4)
    sag = Gains.of(arm).stiffness * (hold(arm).offset - log.q[0])
    np.testing.assert_allclose(log.tau[0] - world.offset, arm.torque(hold(arm).offset) + sag, atol=1e-4)


def test_a_run_that_starts_in_motion_has_no_transient(panda):
    motion = FourierMotion(hold(panda).offset, np.full((7, 1), 0.1), np.zeros((7, 1)), period=3.0)
    log = simulate(panda, motion, PAYLOAD, rate=500.0, duration=0.5)
    deviation = log.q - motion(log.t)[0]
    assert rms(mismatch(panda.with_payload(PAYLOAD), log)).max() < 2e-3
    # the sag changes with the pose, over seconds; a transient would swing within 50 ms
    assert np.abs(deviation[:25] - deviation[0]).max() < 0.1 * np.abs(deviation).max()


def test_logs_are_even_and_as_long_as_asked(panda):
    log = simulate(panda, taie2024(), rate=PAPER_RATE)
    assert len(log) == 3244
    np.testing.assert_allclose(log.t, np.arange(3244) / PAPER_RATE, rtol=0, atol=1e-12)
    assert log.joint_names == panda.joint_names
    assert log.channel == "measured"
    assert len(simulate(panda, taie2024(), rate=50.0, duration=2.0)) == 100


@pytest.mark.parametrize("rate", [10.0, 540.67, 1000.0, 1999.0, 8000.0])
def test_clock_divides_the_period_of_the_log(rate):
    clock = rollout.Clock.at(rate, 11)
    assert clock.step <= Resolution().step * (1 + 1e-9)
    assert clock.step * clock.every == pytest.approx(1 / rate)
    np.testing.assert_allclose(clock.times, np.arange(11) / rate)


# ---------------------------------------------------------------- worlds


def test_real_like_log_is_actual_links_plus_friction_residual_and_offset(any_arm):
    world = World.real_like(replace(any_arm, motor_torque=False), seed=5)
    log = simulate(any_arm, motion_of(any_arm), PAYLOAD, world=world)
    actual = any_arm.with_links(world.links).with_payload(PAYLOAD)
    beyond = world.offset + world.friction(log.dq) + world.residual(log.q)
    left = mismatch(actual, replace_tau(log, log.tau - beyond))
    assert rms(left).max() < 1e-2
    assert rms(beyond).min() > 10 * rms(left).max()


def replace_tau(log, tau):
    return replace(log, tau=tau)


def iteration_error(prepared, clock):
    """What the Picard iteration leaves: d(applied) − d(at the motion that came out), (steps, n) [N·m]."""
    (state,), (applied,) = rollout._picard([prepared], clock, 1)
    return applied - rollout._along(prepared, clock, state, applied)


def test_friction_and_residual_converge_to_the_motion_that_comes_out(some_arm):
    gains, clock, motion = Gains.of(some_arm), rollout.Clock.at(500.0, 3000), motion_of(some_arm)
    world = World.real_like(replace(some_arm, motor_torque=False), seed=1)
    command = Command.along(some_arm, motion, clock.step, clock.steps)
    prepared = runs.prepare(world.arm(some_arm), gains, Run(motion, PAYLOAD, world), world, command, clock)
    left = {}
    for passes in (1, 2, 4):
        fine = replace(clock, resolution=Resolution(passes=passes))
        left[passes] = rms(iteration_error(prepared, fine)).max()
    assert left[2] < 0.25 * left[1]
    assert left[4] < 0.1 * left[2]
    assert left[2] < max(0.01, 5e-5 * some_arm.limits.effort.max())


def test_with_the_friction_of_a_motors_side_the_controller_misreads_its_torque_by_a_few_percent_at_most():
    ur = arm("ur10e")
    gains, clock, motion = Gains.of(ur), rollout.Clock.at(500.0, 3000), motion_of(ur)
    world = World.real_like(ur, seed=1)
    command = Command.along(ur, motion, clock.step, clock.steps)
    prepared = runs.prepare(world.arm(ur), gains, Run(motion, PAYLOAD, world), world, command, clock)
    left = rms(iteration_error(prepared, clock))
    assert np.all(left < 0.06 * ur.limits.effort)


def test_friction_disturbs_the_motion(panda):
    nominal = World.nominal(panda)
    sticky = replace(nominal, friction=Friction(np.full(7, 3.0), np.full(7, 0.06)))
    motion = taie2024()
    smooth, rough = (simulate(panda, motion, world=world, rate=200.0) for world in (nominal, sticky))
    assert np.abs(rough.q - motion(rough.t)[0]).max() > 100 * np.abs(smooth.q - motion(smooth.t)[0]).max()


def test_offset_is_the_sensor_s_and_moves_nothing(panda):
    world = replace(World.nominal(panda), offset=np.full(7, 0.5))
    plain, off = (simulate(panda, taie2024(), PAYLOAD, world=w, rate=100.0) for w in (None, world))
    np.testing.assert_array_equal(off.q, plain.q)
    np.testing.assert_allclose(off.tau, plain.tau + 0.5, atol=1e-12)


def test_worlds_are_reproducible_distinct_and_made_of_bodies_that_exist(any_arm):
    prints = {World.real_like(any_arm, seed).fingerprint for seed in (0, 0, 1, 2)}
    assert len(prints) == 3
    for seed in range(5):
        assert all(is_consistent(phi) for phi in World.real_like(any_arm, seed).links)
    nominal = World.nominal(any_arm)
    np.testing.assert_array_equal(nominal.links, any_arm.link_parameters)
    assert not nominal.disturbed


def test_a_world_does_not_depend_on_what_is_attached(panda):
    bare, with_hand = World.real_like(panda, 3), World.real_like(panda.with_payload(PAYLOAD), 3)
    np.testing.assert_allclose(with_hand.links, bare.links, atol=1e-12)


def test_panda_worlds_scatter_as_measured(panda):
    worlds = [World.real_like(panda, seed) for seed in range(150)]
    offsets, frictions = np.array([w.offset for w in worlds]), np.array([w.friction.level for w in worlds])
    np.testing.assert_allclose(rms(offsets), [0.2, 0.3, 0.12, 0.25, 0.05, 0.08, 0.02], rtol=0.25)
    np.testing.assert_allclose(frictions.mean(axis=0), [0.25, 0.25, 0.2, 0.35, 0.35, 0.2, 0.26], rtol=0.1)
    masses = np.array([w.links[:, 0] for w in worlds]) / panda.link_parameters[:, 0]
    assert masses.std() == pytest.approx(0.02, rel=0.15)


def test_smooth_torque_has_its_rms_over_all_poses_and_is_smooth():
    target = np.array([0.2, 0.05, 1.0])
    rng = np.random.default_rng(0)
    functions = [SmoothTorque.drawn(target, rng) for _ in range(10)]
    q = rng.uniform(-20, 20, size=(4000, 3))
    np.testing.assert_allclose([rms(f(q)) for f in functions], np.tile(target, (10, 1)), rtol=0.1)
    step = 0.05 * rng.normal(size=q.shape) / np.sqrt(3)  # 0.05 rad against length scales of 0.7 rad and more
    changes = np.array([rms(f(q + step) - f(q)) for f in functions])
    assert np.all(changes < 0.1 * target)
    assert np.all(changes > 0.01 * target)


def test_residual_lies_outside_the_span_of_links_and_offsets(panda):
    t = np.arange(0, 20, 0.02)
    joints = np.arange(7)
    q = hold(panda).offset + 0.7 * np.sin(t[:, None] * (1.0 + 0.17 * joints) + joints)
    dq = 0.7 * (1.0 + 0.17 * joints) * np.cos(t[:, None] * (1.0 + 0.17 * joints) + joints)
    Y = full_arm_regressor(panda, q, dq)
    momentum = 20.0 * Y.momentum
    W = momentum + first_order_lag(t, Y.drift - momentum, 20.0, initial=-momentum[0])
    A = np.concatenate([W, np.tile(np.eye(7), (len(t), 1, 1))], axis=2).reshape(-1, 77)
    for seed in range(3):
        residual = World.real_like(panda, seed).residual(q)
        y = first_order_lag(t, residual, 20.0, initial=residual[0])
        left = (y.ravel() - A @ np.linalg.lstsq(A, y.ravel(), rcond=None)[0]).reshape(y.shape)
        assert np.all(rms(left) > 0.15 * np.array([0.20, 0.28, 0.19, 0.20, 0.08, 0.05, 0.045]))


# ---------------------------------------------------------------- many runs


def test_many_runs_are_the_same_as_one_by_one(panda):
    short = replace(taie2024(), period=4.0)
    world = World.real_like(panda, 1)
    wanted = [
        Run(taie2024(), None),
        Run(short, PAYLOAD, world),
        Run(taie2024(), PAYLOAD),
        Run(short, None),
        Run(taie2024(), None, world),
    ]
    seen = []
    logs = many(panda, wanted, rate=100.0, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (5, 5)
    for run, log in zip(wanted, logs, strict=True):
        single = simulate(panda, run.motion, run.payload, world=run.world, rate=100.0)
        assert len(log) == len(single)
        np.testing.assert_allclose(log.q, single.q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(log.tau, single.tau, rtol=0, atol=1e-9)


def test_chunks_do_not_change_anything(panda, monkeypatch):
    wanted = [Run(taie2024(), PAYLOAD if k % 2 else None) for k in range(5)]
    together = many(panda, wanted, rate=50.0, duration=1.0)
    monkeypatch.setattr(runs, "_CHUNK_BYTES", 1.0)
    apart = many(panda, wanted, rate=50.0, duration=1.0)
    for a, b in zip(together, apart, strict=True):
        np.testing.assert_array_equal(a.tau, b.tau)


def test_a_payload_is_simulated_where_it_is_whatever_frame_it_is_given_about(panda):
    at_7 = InertialParameters(PAYLOAD.phi, "panda_link7")
    about_8 = panda.in_frame(at_7)
    moved, given = (simulate(panda, taie2024(), body, rate=100.0, duration=0.5) for body in (about_8, at_7))
    np.testing.assert_array_equal(given.tau, moved.tau)
    moved, given = (simulate_inverse(panda, taie2024(), [(0.0, body)]) for body in (about_8, at_7))
    np.testing.assert_array_equal(given.tau, moved.tau)


def test_anything_with_parameters_is_a_payload(panda):
    class Box:
        parameters = InertialParameters(PAYLOAD.phi, frame="flange")

    a, b = (simulate(panda, taie2024(), p, rate=50.0, duration=1.0) for p in (Box(), PAYLOAD))
    np.testing.assert_array_equal(a.tau, b.tau)


def test_mistakes_are_named(panda):
    ur_motion = FourierMotion(np.zeros(6), np.zeros((6, 1)), np.zeros((6, 1)), period=1.0)
    with pytest.raises(MotionError, match="moves 6 joints: panda has 7"):
        simulate(panda, ur_motion)
    with pytest.raises(PayloadError, match="the payload is a float"):
        simulate(panda, taie2024(), 2.0)
    with pytest.raises(ArmError, match="rate is -1"):
        simulate(panda, taie2024(), rate=-1.0)
    with pytest.raises(MotionError, match="expected at least 2"):
        simulate(panda, taie2024(), duration=0.0)
    with pytest.raises(ArmError, match="has 7 links: ur10e has 6"):
        simulate(arm("ur10e"), ur_motion, world=World.nominal(panda))
    with pytest.raises(ArmError, match="offset of the world"):
        replace(World.nominal(panda), offset=np.zeros(6))


def test_a_simulation_that_diverges_says_so_and_leaves_no_file_behind(tmp_path, monkeypatch):
    """MuJoCo writes its warnings to MUJOCO_LOG.TXT in the working folder, and goes on with 1e5 rad."""
    monkeypatch.chdir(tmp_path)
    panda = arm("panda")
    locked = re.sub(
        r'(name="panda_joint7".*?)lower="[^"]*" upper="[^"]*"', r'\1lower="0.5" upper="0.5"', panda.urdf, flags=re.S
    )
    assert locked != panda.urdf
    build_model(replace(panda, urdf=locked))
    wild = Run(taie2024(), gains=Gains(np.full(7, 1e5), np.zeros(7)))
    with pytest.raises(ArmError, match="diverged"):
        many(panda, [wild], rate=100.0)
    assert not list(tmp_path.iterdir())

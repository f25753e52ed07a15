"""The Bayesian Cramér–Rao bound against closed forms, against errors drawn from its own model, and by its order."""

import json
from dataclasses import replace

import numpy as np
import pytest

from armload.app.cli import main
from armload.arms import arm
from armload.errors import IdentificationError
from armload.motion import random_motion, taie2024
from armload.posterior import advise, bound, efficiency, scales_of
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.recording import Recording, write_recording
from armload.regression import Correction, GaussianPrior, JointFeatures, payload_prior_std
from armload.regression.information import RegressionData, Session
from armload.regression.noise import RIGID, SMOOTH
from armload.simulation import Sensors, World

GAIN = 20.0
REACH = 0.4  # [m] of the one-joint arm below
ONE_JOINT = """<robot name="pendulum"><link name="base"/>
<link name="bar"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link><link name="tip"/>
<joint name="hinge" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" velocity="4" effort="50"/></joint>
<joint name="flange" type="fixed"><parent link="bar"/><child link="tip"/><origin xyz="0.4 0 0"/></joint></robot>"""
POSE = np.array([0.2, -0.6, 0.3, -1.8, 0.2, 1.6, 0.4])
FEW = JointFeatures(7, 16, 4)


def one_joint(tmp_path, axis):
    path = tmp_path / "pendulum.urdf"
    path.write_text(ONE_JOINT.format(axis=axis))
    return replace(arm(path, "tip"), rated_payload=4.0)


def standing(q, duration, rate=200.0):
    t = np.arange(round(duration * rate) + 1) / rate
    q = np.tile(q, (len(t), 1))
    return Recording(t, q, np.zeros_like(q), np.zeros_like(q), source="standing")


def told(prior_std, direction, k):
    """Covariance of phi, before N(0, diag(prior_std²)), after one number direction·phi known with information k."""
    P = np.diag(prior_std**2)
    seen = P @ direction
    return P - np.outer(seen, seen) * k / (1.0 + k * direction @ seen)


def exact_arm(pendulum, noise, offset=0.0):
    """An exact arm but for white noise and a torque offset."""
    eta = np.zeros(Correction(pendulum, np.array([50.0])).size)
    eta[0] = offset**2
    return Scales(np.full((1, 1), noise), eta, np.zeros((1, 0)), np.ones(10))


def later_is_no_worse(smaller, larger):
    """larger − smaller ⪰ 0, in units of the larger one."""
    scale = np.sqrt(np.diag(larger))
    return np.linalg.eigvalsh((larger - smaller) / np.outer(scale, scale))[0] > -1e-9


@pytest.mark.parametrize("offset", [0.0, 0.3])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_standing_pendulum_weighs_the_closed_form(tmp_path, angle, offset):
    """tau = −9.81·(m·(l·cos q) + m·rx·cos q + m·rz·sin q) + offset, seen through the lag from rest, in white noise S.

    A joint at rest counts for 1/11 (its friction is not known there).
    """
    pendulum, S, T = one_joint(tmp_path, "0 1 0"), 0.02, 0.24  # a longer standstill counts no more than its first block
    found = bound(
        pendulum,
        standing([angle], T),
        scales=exact_arm(pendulum, S, offset),
        features=JointFeatures(1, 0, 0),
        gain=GAIN,
    )
    y = np.zeros(10)
    y[[0, 1, 3]] = -9.81 * np.array([REACH * np.cos(angle), np.cos(angle), np.sin(angle)])
    seen = T - 2 * (1 - np.exp(-GAIN * T)) / GAIN + (1 - np.exp(-2 * GAIN * T)) / (2 * GAIN)  # ∫ (1 − e^(−λt))² dt
    k = 1.0 / (11.0 * S / seen + offset**2)
    expected = told(payload_prior_std(pendulum), y, k)
    assert np.sqrt(np.diag(found.covariance[-1])) == pytest.approx(np.sqrt(np.diag(expected)), rel=1e-3)
    assert y @ found.covariance[-1] @ y == pytest.approx(
        1.0 / (k + 1.0 / (y @ np.diag(found.prior_std**2) @ y)), rel=2e-2
    )
    assert np.isinf(found.condition[-1])


@pytest.mark.parametrize("drift", [0.0, 1.0, 30.0])
def test_a_tare_of_another_session_tells_the_offset_as_far_as_it_has_not_drifted(tmp_path, drift):
    """Offset o ~ N(0, o²) at the tare, o + d at the run, d ~ N(0, drift²): the pendulum above, empty and loaded.

    The tare knows o to (1/o² + 1/s)⁻¹, s the variance of a mean of its noise, and the run's offset to drift² more.
    """
    pendulum, S, T, offset = one_joint(tmp_path, "0 1 0"), 0.02, 0.24, 3.0
    scales = exact_arm(pendulum, S, offset)
    daily = Correction(pendulum, np.array([50.0])).daily_std[0]
    found = bound(
        pendulum,
        standing([0.7], T),
        tare=standing([0.7], T),
        scales=replace(scales, noise=np.full((2, 1), S), payloads=np.ones(20)),
        mounted=np.zeros(10),
        features=JointFeatures(1, 0, 0),
        gain=GAIN,
        session=Session(1, drift, (1.0 / daily, 0.0, 0.0)),
    )
    y = np.zeros(10)
    y[[0, 1, 3]] = -9.81 * np.array([REACH * np.cos(0.7), np.cos(0.7), np.sin(0.7)])
    seen = T - 2 * (1 - np.exp(-GAIN * T)) / GAIN + (1 - np.exp(-2 * GAIN * T)) / (2 * GAIN)
    mean = 11.0 * S / seen
    k = 1.0 / (mean + drift**2 + 1.0 / (1.0 / offset**2 + 1.0 / mean))
    # rows at 200 Hz of a torque that rises within 0.05 s: the closed form's integral is off by 1.5 %
    assert found.std[-1] == pytest.approx(np.sqrt(np.diag(told(payload_prior_std(pendulum), y, k))), rel=2e-3)
    assert y @ found.covariance[-1] @ y == pytest.approx(
        1.0 / (k + 1.0 / (y @ np.diag(found.prior_std**2) @ y)), rel=2e-2
    )


def test_a_swinging_joint_tells_the_inertia_about_its_axis(tmp_path):
    """About a vertical axis r = F[(m·l² + 2·l·m·rx + Izz)·ddq]: one combination, whatever else moves."""
    turntable, S, T, speed, w = one_joint(tmp_path, "0 0 1"), 0.05, 30.0, 2.0, 3.0
    t = np.arange(int(T * 500) + 1) / 500.0
    q, dq = (-speed / w * np.cos(w * t))[:, None], (speed * np.sin(w * t))[:, None]
    log = Recording(t, q, dq, np.zeros_like(q))
    found = bound(turntable, log, scales=exact_arm(turntable, S), features=JointFeatures(1, 0, 0), gain=GAIN, times=[T])
    lagged = speed * w * GAIN / np.hypot(GAIN, w) * np.cos(w * t - np.arctan2(w, GAIN))
    weight = 1.0 / (1.0 + 10.0 / np.cosh(dq[:, 0] / 0.06) ** 2)
    y = np.zeros(10)
    y[[0, 1, 9]] = REACH**2, 2 * REACH, 1.0
    k = np.trapezoid(weight * lagged**2, t) / S
    expected = told(payload_prior_std(turntable), y, k)
    assert found.std[-1] == pytest.approx(np.sqrt(np.diag(expected)), rel=1e-3)
    assert y @ found.covariance[-1] @ y == pytest.approx(
        1.0 / (k + 1.0 / (y @ np.diag(found.prior_std**2) @ y)), rel=1e-2
    )


def test_errors_drawn_from_the_model_have_the_bound_as_their_covariance(panda):
    """Payload, what was mounted at the tare, arm and noise drawn from their priors: the MAP's errors, whitened."""
    rng = np.random.default_rng(7)
    runs = [random_motion(panda, seed, duration=2.0, harmonics=4) for seed in (1, 2)]
    light = np.array([m * np.r_[1.0, x, 0.02, 0.02, 0.02] for m, *x in rng.uniform(0.1, 0.2, size=(40, 7))])
    family = light[:, :10] * (1.0 + 0.3 * rng.normal(size=(40, 10)))
    prior, mounted = GaussianPrior.of(family), 0.3 * payload_prior_std(panda)
    found = bound(panda, runs[1], tare=runs[0], prior=prior, mounted=mounted, features=FEW)

    correction, data = Correction(panda, panda.limits.effort), []
    for motion in runs:
        t = np.linspace(0.0, 2.0, 401)
        q, dq, _ = motion(t)
        data.append(RegressionData(correction, GAIN, FEW, SMOOTH.block))
        data[-1].add(t, q, dq, np.zeros_like(q))
    roots = []  # of A_j: the noise in b_j has covariance S_j·A_j
    for run in data:
        values, vectors = np.linalg.eigh(run.A)
        roots.append(vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :])
    errors, draws = [], 250
    for _ in range(draws):
        payload = prior.mean + prior.root @ rng.normal(size=10)
        before = mounted * rng.normal(size=10)
        eta = np.sqrt(found.scales.eta) * rng.normal(size=correction.size)
        weights = np.sqrt(found.scales.features) * rng.normal(size=(7, FEW.size))
        for run, phi, root, S in zip(data, (before, before + payload), roots, found.scales.noise, strict=True):
            for j in range(7):
                x = np.concatenate([phi, eta, weights[j]])
                run.b[j] = run.A[j] @ x + np.sqrt(S[j]) * root[j] @ rng.normal(size=len(x))
        errors.append(solve(data, mounted, prior, SMOOTH, 1, found.scales).phi - payload)
    errors = np.array(errors)
    scale = found.std[-1]
    white = np.linalg.solve(np.linalg.cholesky(found.covariance[-1] / np.outer(scale, scale)), (errors / scale).T)
    low, high = (1 - np.sqrt(10 / draws)) ** 2, (1 + np.sqrt(10 / draws)) ** 2  # Marchenko & Pastur 1967
    spread = np.linalg.eigvalsh(white @ white.T / draws)
    assert 0.9 * low < spread[0] <= spread[-1] < 1.1 * high
    assert np.mean(white**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / (10 * draws)))
    # so the MAP is efficient, parameter by parameter
    assert efficiency(np.sqrt(np.mean(errors**2, axis=0)), found) == pytest.approx(
        np.ones(10), abs=4 / np.sqrt(2 * draws)
    )


def test_more_data_never_make_the_bound_larger(panda):
    run, tare = taie2024(), random_motion(panda, 5, duration=3.0)
    bare = np.zeros(10)
    along = bound(panda, run, features=FEW, times=[0.2, 0.5, 1.0, 2.0, 4.0, 6.0])
    for earlier, later in zip(along.covariance, along.covariance[1:], strict=False):
        assert later_is_no_worse(later, earlier)
    assert later_is_no_worse(along.covariance[0], along.prior_covariance)
    tared = bound(panda, run, tare=tare, mounted=bare, features=FEW).covariance[-1]
    assert later_is_no_worse(tared, along.covariance[-1])
    assert np.all(np.diag(tared) < np.diag(along.covariance[-1]))
    assert tared[0, 0] < 0.2 * along.covariance[-1, 0, 0]
    # what was mounted at the tare being unknown can only cost
    anything = bound(panda, run, tare=tare, features=FEW).covariance[-1]
    assert later_is_no_worse(tared, anything)


def test_a_mismatch_that_repeats_does_not_average_out_in_the_rigid_model(tmp_path):
    """Beyond ten seconds more of the same motion tells nothing for `RIGID`; without its novelty the noise halves."""
    pendulum = one_joint(tmp_path, "0 0 1")
    t = np.arange(40 * 200 + 1) / 200.0
    q, dq = np.cos(np.pi * t)[:, None], -np.pi * np.sin(np.pi * t)[:, None]
    log, nothing = Recording(t, q, dq, np.zeros_like(q)), JointFeatures(1, 0, 0)
    y = np.zeros(10)
    y[[0, 1, 9]] = REACH**2, 2 * REACH, 1.0  # what it tells of
    left = {}
    for noise in (RIGID, replace(RIGID, novelty=np.inf)):
        found = bound(pendulum, log, noise=noise, features=nothing, times=[10.0, 20.0, 40.0])
        left[noise.novelty] = np.einsum("i,tij,j->t", y, found.covariance, y)
    gained = -np.diff(left[np.inf])  # 1/k − 1/(2k), 1/(2k) − 1/(4k): what the arm's own inertia leaves stays
    assert gained[0] / gained[1] == pytest.approx(2.0, rel=0.05)
    assert np.all(np.abs(np.diff(left[10.0])) < 0.03 * gained)


def test_a_pose_tells_nothing_along_gravity_and_nothing_of_inertia(panda):
    found = bound(panda, standing(POSE, 2.0))
    rotation = panda.frame_pose(POSE)[0]
    down = rotation.reshape(3, 3).T @ np.array([0.0, 0.0, -1.0])
    along = np.r_[0.0, down, np.zeros(6)]
    weak = payload_prior_std(panda)
    assert np.sqrt(along @ found.covariance[-1] @ along) == pytest.approx(weak[1], rel=1e-6)
    assert found.std[-1, 4:] == pytest.approx(weak[4:], rel=1e-6)
    assert not found.determined[-1, 4:].any()
    shares, directions = found.combinations
    assert np.sum(shares > 1 - 1e-6) == 7  # ten parameters, three numbers: force, two moments
    assert np.linalg.norm(directions[:7] @ along) == pytest.approx(1.0, abs=1e-6)
    assert np.isinf(found.condition[-1])


def test_the_torque_plays_no_part(panda, analytic_log):
    log = analytic_log(panda, duration=1.0)
    noisy = replace(log, tau=log.tau + np.random.default_rng(0).normal(size=log.tau.shape))
    a, b = bound(panda, log, features=FEW), bound(panda, noisy, features=FEW)
    assert np.array_equal(a.covariance, b.covariance)


def test_a_motion_is_a_log_that_follows_it(panda):
    motion = taie2024()
    t = np.arange(1001) / 1000.0  # a log at another rate
    q, dq, ddq = motion(t)
    logged = bound(panda, Recording(t, q, dq, panda.torque(q, dq, ddq)), features=FEW, times=[1.0])
    assert bound(panda, motion, features=FEW).std[0] == pytest.approx(logged.std[0], rel=2e-3)


def test_efficiency_is_bound_over_error_and_several_bounds_average_as_variances(panda):
    a = bound(panda, taie2024(), features=FEW, times=[1.0, 2.0])
    b = bound(panda, taie2024(), tare=taie2024(), features=FEW, times=[1.0, 2.0])
    assert efficiency(2.0 * a.std, a) == pytest.approx(np.full((2, 10), 0.5))
    assert efficiency(a.std[-1], [a, b]) == pytest.approx(np.sqrt(0.5 * (1.0 + (b.std[-1] / a.std[-1]) ** 2)))
    for errors, bounds in ((np.zeros(10), a), (np.ones(9), a), (np.ones(10), [])):
        with pytest.raises(IdentificationError):
            efficiency(errors, bounds)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"times": [7.0]}, "6 s"),
        ({"times": [2.0, 1.0]}, "increasing"),
        ({"times": []}, "increasing"),
        ({"mounted": np.ones(4)}, "mounted"),
        ({"scales": Scales(np.ones((1, 7)), np.ones(3), np.ones((7, 2)), np.ones(10))}, "features"),
    ],
)
def test_what_cannot_be_asked_is_refused(panda, settings, word):
    with pytest.raises(IdentificationError, match=word):
        bound(panda, taie2024(), **settings)


def test_an_arm_with_other_joints_is_refused():
    with pytest.raises(IdentificationError, match="7 joints"):
        bound(arm("ur10e"), taie2024())


@pytest.mark.parametrize(("constant", "finer"), [("_RATE", 100.0), ("_FEATURES", (64, 8))])
@pytest.mark.full  # some seconds
def test_the_joint_named_is_that_of_a_finer_comparison(panda, monkeypatch, constant, finer):
    motions = []
    for seed in range(3):
        whole = random_motion(panda, seed, duration=5.0)
        for moved in ([0], [6], [1, 2], [5, 6]):
            motions.append(whole.scaled(np.isin(np.arange(7), moved) * 0.5))
    found = [advise(panda, motion) for motion in motions]
    monkeypatch.setattr(f"armload.posterior.advice.{constant}", finer)
    for motion, coarse in zip(motions, found, strict=True):
        other = advise(panda, motion)
        assert other.joint == coarse.joint
        assert other.shrinks == pytest.approx(coarse.shrinks, abs=0.01)


def test_the_joint_advised_gains_what_is_said(panda):
    """On the full model, and more than the base joint, which turns about gravity and tells a pose nothing new of it."""
    log = standing(POSE, 4.0)
    advice = advise(panda, log)
    assert advice is not None
    assert advice.gained

    def determined(joint):
        q, dq, angle = log.q.copy(), log.dq.copy(), 2 * np.pi * advice.frequency * log.t
        q[:, joint] += advice.swing * np.sin(angle)
        dq[:, joint] += advice.swing * 2 * np.pi * advice.frequency * np.cos(angle)
        return bound(panda, replace(log, q=q, dq=dq)).determined[-1]

    names = np.array(["m", "m·rx", "m·ry", "m·rz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"])
    after = determined(panda.joint_names.index(advice.joint))
    assert set(advice.gained) <= set(names[after])
    assert after.sum() > determined(0).sum()
    assert advise(panda, taie2024(), taie2024()) is None


def test_the_scales_of_worlds_are_the_spread_of_what_worlds_add_to_the_torque(panda):
    worlds = [World.real_like(panda, seed) for seed in range(60)]
    scales = scales_of(panda, worlds, Sensors.panda(panda), 200.0, FEW)
    rng = np.random.default_rng(3)
    low, high = panda.limits.position_low, panda.limits.position_high
    q, dq = rng.uniform(low, high, size=(300, 7)), rng.normal(size=(300, 7))
    added = np.array([world.disturbance(q, dq) + world.offset for world in worlds])
    spread = np.mean((added - added.mean(axis=0)) ** 2, axis=(0, 1))
    correction = Correction(panda, panda.limits.effort)
    drift = correction.regressor(q, dq, np.zeros_like(q)).drift[:, :, :21]  # offset, Coulomb, viscous
    expected = np.mean(drift**2 @ scales.eta[:21], axis=0) + scales.features[:, 0] + scales.features[:, -1]
    assert spread == pytest.approx(expected, rel=0.15)
    links = np.array([world.links for world in worlds]) - World.nominal(panda).links
    assert scales.eta[30:] == pytest.approx(np.mean(links**2, axis=0).ravel())
    assert scales.noise[0, 0] == pytest.approx((0.045**2 + 0.0357**2 / 12) / 200.0, rel=1e-3)
    # real ones are worse than simulated ones, and an estimator expects so
    tare = random_motion(panda, 3)
    milder = bound(panda, taie2024(), tare=tare, scales=scales, features=FEW)
    assert np.all(milder.std[-1] < bound(panda, taie2024(), tare=tare, features=FEW).std[-1])
    with pytest.raises(IdentificationError, match="two or more"):
        scales_of(panda, worlds[:1], Sensors.panda(panda), 200.0)


# ---------------------------------------------------------------------- the command


@pytest.fixture
def check(capsys):
    def run(*arguments, code=0):
        assert main(["motion", "check", *map(str, arguments)]) == code
        return capsys.readouterr()

    return run


def pose_log(panda, path, **changes):
    log = standing(POSE, 2.0)
    log = replace(log, tau=panda.torque(log.q), **changes)
    write_recording(path, log)
    return log


def test_check_of_a_log_says_what_it_determines(panda, check, tmp_path):
    pose_log(panda, tmp_path / "pose.csv")
    said = json.loads(check(tmp_path / "pose.csv", "--robot", "panda", "--json").out)
    alone = bound(panda, standing(POSE, 2.0))
    assert said["kind"] == "log"
    assert said["within_limits"]
    assert said["without_tare"]["times"] == [1.0, 2.0]
    assert said["without_tare"]["half_width"] == pytest.approx(alone.half_width)
    assert said["without_tare"]["determined"] == alone.determined.tolist()
    assert said["without_tare"]["condition"] == [None, None]
    assert said["with_tare"]["tare"].endswith("pose.csv")
    out = check(tmp_path / "pose.csv", "--robot", "panda").out
    assert "panda_joint" in out.split("not determined: ")[1]
    assert all(name in out.split("not determined: ")[1].split(";")[0] for name in ("Ixx", "Izz"))


def test_check_of_a_motion_shows_the_bound_after_the_tare_asked_for(panda, check):
    said = json.loads(check("taie2024", "--robot", "panda", "--tare", "random:3", "--json").out)
    tared = bound(panda, taie2024(), tare=random_motion(panda, 3))
    assert said["with_tare"]["half_width"] == pytest.approx(tared.half_width)
    assert said["margin"].keys() == {"position", "velocity", "acceleration", "jerk", "torque"}
    assert said["advice"] is None


def test_a_log_beyond_a_limit_is_a_no(panda, check, tmp_path):
    t = np.arange(401) / 200.0
    q = np.tile(POSE, (len(t), 1))
    q[:, 0] += 0.8 * np.sin(3.5 * t)
    dq = np.zeros_like(q)
    dq[:, 0] = 2.8 * np.cos(3.5 * t)  # limit: 2.175 rad/s
    ddq = np.zeros_like(q)
    ddq[:, 0] = -9.8 * np.sin(3.5 * t)
    write_recording(tmp_path / "fast.npz", Recording(t, q, dq, panda.torque(q, dq, ddq)))
    out = check(tmp_path / "fast.npz", "--robot", "panda", code=3).out
    assert "panda_joint1 passes its velocity limit by 0.625 rad/s at t = 0.00 s" in out


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("none.csv", "--robot", "panda"), "none.csv"),
        (("none.json", "--robot", "panda"), "none.json"),
        (("taie2024", "--robot", "panda", "--tare", "none.bag"), "none.bag"),
        (("taie2024", "--robot", "ur10e"), "7 joints"),
        (("POSE", "--robot", "panda", "--payload", "none"), "--payload"),
    ],
)
def test_what_cannot_be_checked_is_one_sentence(panda, check, tmp_path, arguments, word):
    pose_log(panda, tmp_path / "pose.csv")
    said = check(*(str(tmp_path / "pose.csv") if a == "POSE" else a for a in arguments), code=2)
    assert said.out == ""
    assert word in said.err
    assert said.err.count("\n") == 1

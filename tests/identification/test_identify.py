"""One log in, one answer out: intervals, what is determined, tare, tool, frames, and bodies that can exist."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from armload.arms import arm, payload_regressor
from armload.errors import IdentificationError, RecordingError
from armload.estimators import Estimate, FilteredRecursiveLeastSquares
from armload.identification import METHODS, identify
from armload.identification.found import Found
from armload.identification.intervals import Before
from armload.identification.notes import COMPUTED
from armload.identification.thresholds import MISFIT
from armload.inertia import Z95, InertialParameters, distance_to_body, is_consistent, nearest_body
from armload.lab.episodes import Recipe, draw_episodes, simulate_episodes
from armload.motion import random_motion, taie2024
from armload.payloads import Payload
from armload.payloads import test_payload as box_of_the_examples
from armload.payloads.uncertainty import Uncertainty
from armload.posterior import PosteriorLeastSquares, shipped_model
from armload.recording import Recording, read_recording, shared_samples
from armload.recording.copies import copied_samples
from armload.regression import payload_prior_std
from armload.simulation import Sensors, World, simulate

BOX = InertialParameters.from_com(1.2, (0.02, -0.03, 0.07), np.diag([4e-3, 3e-3, 2e-3]))
TOOL = InertialParameters.from_com(0.8, (0.0, 0.01, 0.04), np.diag([1e-3, 1e-3, 5e-4]))


@pytest.fixture(scope="module")
def real_like():
    """A Panda that differs from its model, and its sensors."""
    panda = arm("panda")
    return panda, {"world": World.real_like(panda, 5), "sensors": Sensors.panda(panda), "rate": 500.0}


@pytest.fixture(scope="module")
def simulated(real_like):
    """A factory of that Panda's logs: simulated(held, seed, motion=…); each is made once."""
    panda, how = real_like
    held = {"nothing": None, "box": BOX, "tool": TOOL, "both": TOOL + BOX}
    motions = {"run": taie2024(), "tare": random_motion(panda, 8, duration=8.0, harmonics=8)}
    return cache(lambda name, seed, motion="run": simulate(panda, motions[motion], held[name], seed=seed, **how))


@pytest.fixture(scope="module")
def loaded(simulated):
    return simulated("box", 1)


@pytest.fixture(scope="module")
def alone(real_like, simulated):
    """A factory of the default answers to those logs alone: alone(held, seed); each is made once."""
    panda, _ = real_like
    return cache(lambda name, seed: identify(simulated(name, seed), panda))


def test_the_answer_is_the_method_s_estimate_moved_to_the_nearest_body(loaded, real_like):
    panda, _ = real_like
    answer, estimate = identify(loaded, panda, method="map"), PosteriorLeastSquares(panda).run(loaded)
    assert not is_consistent(estimate.phi)
    assert answer.consistent
    assert is_consistent(answer.phi)
    metric = np.linalg.inv(estimate.covariance)
    away = np.array(answer.phi) - estimate.phi
    # no body on the way from the answer to the truth, nor a mix of it and another body, is nearer
    for body in (BOX.phi, TOOL.phi, 2.0 * BOX.phi, (BOX + TOOL).phi):
        nearer = np.array(answer.phi) + 1e-3 * (body - np.array(answer.phi)) - estimate.phi
        assert away @ metric @ away <= nearer @ metric @ nearer * (1 + 1e-6)
    assert answer.parameters.mass == answer.mass
    again = InertialParameters.from_com(answer.mass, answer.com, answer.inertia_com)
    assert again.phi == pytest.approx(np.array(answer.phi), abs=1e-12)


@pytest.mark.parametrize("method", [None, *(name for name, entry in METHODS.items() if not entry.needs)])
def test_every_interval_is_finite_and_holds_the_point(loaded, real_like, method):
    panda, _ = real_like
    log = loaded.between(0.0, 3.0).select(slice(None, None, 5))  # 100 Hz
    answer = identify(log, panda, method=method)
    phi, low, high = (np.array(x) for x in (answer.phi, answer.phi_low, answer.phi_high))
    assert np.isfinite([phi, low, high]).all()
    assert np.all(low <= phi)
    assert np.all(phi <= high)
    assert answer.interval == ("calibrated" if answer.method == "hybrid" else "approximate")


@pytest.fixture(scope="module")
def still():
    """A Panda that holds the box and does not move: gravity in one pose."""
    panda, pose = arm("panda"), np.tile([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8], (400, 1))
    return Recording(np.arange(400) * 0.01, pose, 0 * pose, panda.with_payload(BOX).torque(pose))


@pytest.mark.parametrize("method", [None, "map-gp", "map"])
def test_an_arm_that_does_not_move_determines_the_mass_and_not_the_inertia(panda, still, method):
    answer = identify(still, panda, method=method)
    assert answer.determined[0]
    assert answer.phi[0] == pytest.approx(BOX.mass, abs=0.1)
    assert not any(answer.determined[4:])
    assert np.all(np.array(answer.phi_low)[4:] <= BOX.phi[4:])
    assert np.all(BOX.phi[4:] <= np.array(answer.phi_high)[4:])
    assert any("does not determine" in note and "Izz" in note for note in answer.notes)


def test_undetermined_parameters_carry_the_interval_of_what_was_known_before(panda, still):
    before = Z95 * payload_prior_std(panda)
    assert np.array(identify(still, panda, method="map-gp").phi_high)[4:] == pytest.approx(before[4:])
    prior, answer = shipped_model(panda).prior, identify(still, panda)
    assert answer.method == "hybrid"
    expected = [prior.mean[4:] - Z95 * prior.std[4:], prior.mean[4:] + Z95 * prior.std[4:]]
    assert [answer.phi_low[4:], answer.phi_high[4:]] == [pytest.approx(x) for x in expected]


def test_a_tare_with_a_tool_leaves_what_was_added_and_a_known_tool_what_it_carries(panda, simulated, alone):
    both, tare = simulated("both", 3), simulated("tool", 5, "tare")
    by_tare, by_tool = identify(both, panda, tare=tare), identify(both, panda, tool=TOOL)
    assert (by_tare.relative_to, by_tool.relative_to) == ("tare", "tool")
    for answer in (by_tare, by_tool):
        assert answer.phi_low[0] < BOX.mass < answer.phi_high[0]
        assert answer.com == pytest.approx(BOX.com, abs=0.025)
    assert alone("both", 3).mass > BOX.mass + 0.6 * TOOL.mass


@pytest.mark.full  # some seconds
def test_what_was_taken_off_since_the_tare_is_negative_and_said_so(panda, simulated):
    answer = identify(simulated("tool", 4), panda, tare=simulated("both", 3))
    assert answer.mass == pytest.approx(-BOX.mass, abs=0.05)
    assert (answer.held, answer.consistent) == (False, False)
    assert "taken off" in answer.notes[0]
    assert "below zero" in str(answer)
    assert "within three standard deviations" not in str(answer)


@pytest.mark.full
def test_taken_off_asks_for_as_much_evidence_as_held(panda, simulated):
    now, tare = simulated("tool", 4), simulated("nothing", 3)
    added = identify(now, panda, tare=tare)
    sigma = (added.phi_high[0] - added.phi_low[0]) / 2 / Z95
    for sigmas, says, may_be in ((1.5, False, False), (2.5, False, True), (3.5, True, False)):
        heavier = InertialParameters.from_com(added.mass + sigmas * sigma, TOOL.com, TOOL.inertia_com)
        answer = identify(now, panda, tare=tare, tool=heavier)
        assert any("was taken off" in note or "is negative" in note for note in answer.notes) == says
        assert any("may have been taken off" in note for note in answer.notes) == may_be


@pytest.mark.full  # some seconds
def test_gear_friction_in_the_torques_of_an_arm_that_nobody_knows_is_found_from_the_log(tmp_path):
    known = arm("ur5e")
    text = re.sub(r'mass value="([\d.e+-]+)"', lambda m: f'mass value="{1.01 * float(m[1])}"', known.urdf)
    (tmp_path / "like_a_ur.urdf").write_text(text)
    stranger = arm(tmp_path / "like_a_ur.urdf", "tool0")
    told = replace(stranger, motor_torque=True)
    motion = random_motion(told, 4, duration=8.0, harmonics=4)
    log = simulate(stranger, motion, BOX, seed=1, world=World.real_like(told, 3), rate=250.0)
    assert (stranger.known_as, stranger.motor_torque) == (None, False)
    assert identify(log, stranger).phi == pytest.approx(identify(log, told).phi)


@pytest.mark.full  # some seconds
def test_an_empty_arm_holds_nothing_and_a_light_payload_is_held_with_a_tare(real_like, simulated, alone):
    panda, how = real_like
    light = InertialParameters.from_com(0.25, (0, 0, 0.05), np.diag([2e-4] * 3))
    empty, tare = simulated("nothing", 3), simulated("nothing", 4, "tare")
    assert not alone("nothing", 3).held
    assert not identify(empty, panda, tare=tare).held
    assert identify(simulate(panda, taie2024(), light, seed=7, **how), panda, tare=tare).held


@pytest.mark.parametrize("method", [None, "difference"])
@pytest.mark.parametrize("part", ["all of it", "its first half", "its second half, from zero on", "every other sample"])
def test_a_log_is_not_its_own_tare(loaded, real_like, method, part):
    panda, _ = real_like
    half = len(loaded) // 2
    rows = {"its first half": slice(half), "its second half, from zero on": slice(half, None)}
    rows |= {"every other sample": slice(None, None, 2)}
    tare = loaded.select(rows.get(part, slice(None)))
    if part == "its second half, from zero on":
        tare = replace(tare, t=tare.t - tare.t[0])
    with pytest.raises(RecordingError, match=f"share {len(tare)} measured samples: .* leave the tare out"):
        identify(loaded, panda, tare=tare, method=method)


@pytest.mark.parametrize("form", ["3 decimals", "6 decimals", "5 digits", "float32", "degrees"])
def test_a_log_in_fewer_digits_is_not_its_own_tare(loaded, real_like, form):
    """What another program wrote of the same run weighs nothing against it, whatever the arm holds."""
    panda, _ = real_like
    forms = {
        "3 decimals": lambda x: x.round(3),
        "6 decimals": lambda x: x.round(6),
        "5 digits": lambda x: np.vectorize(lambda number: float(f"{number:.5g}"))(x),
        "float32": np.float32,
        "degrees": lambda x: np.deg2rad(np.rad2deg(x).round(6)),
    }
    of = forms[form]
    copy = replace(loaded, q=of(loaded.q), dq=of(loaded.dq), tau=loaded.tau if form == "degrees" else of(loaded.tau))
    for tare in (copy, copy.between(1.0, 3.0)):
        with pytest.raises(RecordingError, match=r"share \d+ measured samples: .* leave the tare out"):
            identify(loaded, panda, tare=tare)


def test_two_runs_of_one_motion_are_no_copies_of_each_other(simulated, real_data):
    real = [read_recording(real_data / f"ur10e_{which}.csv") for which in ("unloaded", "loaded_2805g")]
    for log, other in (real, (simulated("box", 1), simulated("box", 2))):
        assert copied_samples(log, log) > 0.5 * len(log)
        assert copied_samples(log, other) == 0


def test_the_beginning_of_a_log_is_a_tare_for_the_rest_of_it(loaded, real_like):
    panda, _ = real_like
    tare, rest = loaded.between(0.0, 3.0), loaded.between(3.0, 10.0)
    answer = identify(rest, panda, tare=tare)
    assert not answer.held  # nothing was added
    assert answer.phi_low[0] < 0.0 < answer.phi_high[0]


def test_samples_of_an_arm_that_stands_are_the_same_only_at_the_same_times(panda, still):
    """A pose that is taken again measures the same: a stand in another log is no copy of this one."""
    later = replace(still, t=still.t + 60.0)
    lighter = replace(still, tau=panda.torque(still.q))
    other = replace(still, tau=np.concatenate([still.tau[:200], lighter.tau[200:]]))
    assert shared_samples(still, still) == len(still)
    assert shared_samples(still, still.select(slice(50, 150))) == 100
    assert [shared_samples(still, log) for log in (later, lighter, other)] == [0, 0, 0]


def test_another_frame_moves_the_same_body(loaded, alone):
    here, there = alone("box", 1), identify(loaded, arm("panda", "panda_link7"))
    assert there.mass == pytest.approx(here.mass, abs=0.01)
    # panda_link8 sits 0.107 m along z of panda_link7, axes parallel
    assert np.array(there.com) - here.com == pytest.approx([0, 0, 0.107], abs=0.01)


def test_an_age_is_of_a_tare_and_in_seconds(panda, analytic_log):
    log, tare = analytic_log(panda, BOX), analytic_log(panda, phase=1.0)
    with pytest.raises(IdentificationError, match="there is no tare"):
        identify(log, panda, tare_age=86400.0)
    with pytest.raises(IdentificationError, match="the tare's age is '3d': expected seconds"):
        identify(log, panda, tare=tare, tare_age="3d")


def test_only_measured_torque_at_a_useful_rate_is_taken(panda, analytic_log):
    log = analytic_log(panda, BOX)
    with pytest.raises(IdentificationError, match="external torque"):
        identify(Recording(log.t, log.q, log.dq, log.tau, channel="external"), panda)
    with pytest.raises(IdentificationError, match="10 Hz"):
        identify(log.select(slice(None, None, 20)), panda)
    with pytest.raises(IdentificationError, match="unknown method 'magic'"):
        identify(log, panda, method="magic")
    with pytest.raises(IdentificationError, match="did you mean 'hybrid'"):
        identify(log, panda, method="hybird")


def test_a_log_at_the_lowest_rate_is_taken_whatever_its_clock(panda, analytic_log):
    log = analytic_log(panda, BOX)
    slow = log.select(slice(None, None, round(log.rate / 20.0)))
    for t in (slow.t * 1.001, 1.7e9 + slow.t, slow.t):
        identify(replace(slow, t=t), panda, method="map")
    with pytest.raises(IdentificationError, match=r"sampled at 18\.2 Hz: expected at least 20 Hz"):
        identify(replace(slow, t=slow.t * 1.1), panda, method="map")


def test_a_tool_mounted_after_the_tare_is_taken_off_the_answer(panda, simulated):
    for mounted, seed, relative_to, said in (
        ("nothing", 4, "tool", "after the tare"),
        ("tool", 5, "tare", "already"),
    ):
        answer = identify(simulated("both", 3), panda, tare=simulated(mounted, seed, "tare"), tool=TOOL)
        assert answer.relative_to == relative_to
        assert answer.phi_low[0] < BOX.mass < answer.phi_high[0]
        assert any(said in note for note in answer.notes)


@pytest.mark.parametrize("tared", [True, False])
def test_a_weighed_mass_is_believed_beside_a_tool_that_is_hardly_known_and_tells_of_it(panda, simulated, tared):
    lighter = InertialParameters(0.85 * TOOL.phi)  # 0.12 kg too light, of which 0.06 kg is one standard deviation
    tool = Payload("gripper", lighter, uncertainty=Uncertainty(mass=0.06, com=0.002, inertia=0.1))
    log, tare = simulated("both", 3), simulated("nothing", 4, "tare") if tared else None
    alone = identify(log, panda, tare=tare, tool=tool)
    assert alone.phi_low[0] < BOX.mass < alone.phi_high[0]
    assert alone.phi_high[0] - alone.phi_low[0] > 2 * Z95 * 0.06
    answer = identify(log, panda, tare=tare, tool=tool, mass=(BOX.mass, 2e-3))
    assert answer.mass == pytest.approx(BOX.mass, abs=4e-3)
    assert answer.phi_high[0] - answer.phi_low[0] == pytest.approx(2 * Z95 * 2e-3, rel=0.1)
    assert np.all((answer.com_low < BOX.com) & (BOX.com < answer.com_high))
    if tared:  # what is left of the tool's error is no longer taken for the payload's moments
        assert np.linalg.norm(answer.com - BOX.com) < 0.5 * np.linalg.norm(alone.com - BOX.com)
    assert not any("is not what the log says" in note for note in answer.notes)
    other = identify(log, panda, tare=tare, tool=tool, mass=(BOX.mass + 0.5, 2e-3))  # beyond the tool's error, too
    assert any("is not what the log says" in note for note in other.notes)
    np.testing.assert_allclose(other.phi, alone.phi)
    np.testing.assert_allclose(other.covariance, alone.covariance)


def test_a_tool_in_grams_is_refused(panda, analytic_log):
    with pytest.raises(IdentificationError, match="730 kg"):
        identify(analytic_log(panda, BOX), panda, tool=InertialParameters(1e3 * np.array([0.73] + [0.0] * 9)))


def test_a_known_tool_that_is_not_mounted_is_missed_and_said_to_be(panda, simulated):
    answer = identify(simulated("nothing", 3), panda, tool=TOOL)
    assert answer.phi_low[0] < -TOOL.mass < answer.phi_high[0] < 0.0
    assert (answer.held, answer.consistent) == (False, False)
    assert "less is mounted" in answer.notes[0]


@pytest.mark.full  # some seconds
def test_a_known_tool_that_is_on_neither_at_the_tare_nor_in_the_log_is_said_to_be_off(panda, simulated):
    answer = identify(simulated("nothing", 3), panda, tare=simulated("nothing", 4, "tare"), tool=TOOL)
    assert answer.mass == pytest.approx(-TOOL.mass, abs=0.03)
    assert not answer.consistent
    assert any("neither at the tare nor in the log" in note for note in answer.notes)


@pytest.mark.full  # some seconds
def test_where_the_tare_does_not_tell_of_the_tool_the_intervals_hold_both_cases():
    ur, light = arm("ur10e"), 0.25 * TOOL.phi
    tool = InertialParameters(light, "tool0")
    how = {"world": World.real_like(ur, 3), "sensors": Sensors.generic(ur), "rate": 100.0}
    tare = simulate(ur, random_motion(ur, 53, duration=15.0), None, seed=4, **how)
    log = simulate(ur, random_motion(ur, 54, duration=8.0), InertialParameters(2.5 * BOX.phi + light), seed=5, **how)
    answer = identify(log, ur, tare=tare, tool=tool)
    assert any("does not tell for sure" in note for note in answer.notes)
    assert answer.interval == "approximate"
    plain = identify(log, ur, tare=tare)
    assert answer.phi_high[0] - answer.phi_low[0] > plain.phi_high[0] - plain.phi_low[0] + 0.9 * tool.mass
    assert answer.phi_low[0] < 2.5 * BOX.mass < answer.phi_high[0]


@pytest.mark.full  # some seconds
def test_a_base_that_stands_otherwise_than_was_said_is_noticed(real_like):
    panda, how = real_like
    true = arm("panda", gravity=(0.0, -4.0, -8.96))
    log = simulate(true, taie2024(), BOX, seed=3, **how)
    right, wrong = identify(log, true), identify(log, panda)
    assert not any("--gravity" in note for note in right.notes)
    assert any("--gravity" in note for note in wrong.notes)
    assert (right.interval, wrong.interval) == ("calibrated", "approximate")


@pytest.mark.full  # some seconds
def test_arms_as_they_are_are_not_called_strange(panda):
    """Half a minute of slow motion, on arms further from their description than most."""
    recipe = Recipe(worlds=("beyond",), motions=("slow",), untared=1.0, duration=30.0)
    for logs in simulate_episodes(draw_episodes(panda, recipe, 3, seed=5)):
        assert not any("check the robot" in note for note in identify(logs.run, panda).notes)


@pytest.mark.parametrize("tared", [False, True])
@pytest.mark.full  # some seconds
def test_a_log_that_no_body_explains_is_called_so_by_the_default_method(panda, simulated, tared):
    """A kilogram whose principal moments are all negative, added through the regressor to an empty arm's torque."""
    empty, tare = simulated("nothing", 3), simulated("nothing", 4, "tare") if tared else None
    q, dq, ddq = taie2024()(empty.t)
    Y = payload_regressor(panda.frame_motion(q), dq, ddq)

    def carrying(inertia):
        phi = np.array([1.0, 0.0, 0.0, 0.05, inertia, 0.0, 0.0, inertia, 0.0, inertia])
        return identify(replace(empty, tau=empty.tau + Y @ phi), panda, tare=tare)

    sound, impossible = carrying(5e-3), carrying(-0.05)
    assert (sound.method, sound.interval) == ("hybrid", "calibrated")
    assert not any("no body fits" in note for note in sound.notes)
    assert (impossible.method, impossible.interval) == ("hybrid", "approximate")
    said = "and something else put on" if tared else "no body fits within the error bars"
    assert any(said in note for note in impossible.notes)
    assert impossible.consistent != tared  # without a tare the nearest body is reported all the same


@pytest.mark.parametrize("name", ["lmi", "log-cholesky", "hybrid"])
def test_what_a_log_says_is_judged_before_a_body_is_made_of_it(panda, loaded, name):
    identifier = METHODS[name].make(panda)
    assert identifier.unprojected is None
    estimate = identifier.run(loaded)
    mean, covariance = identifier.unprojected
    assert is_consistent(estimate.phi)
    assert not is_consistent(mean)
    away = nearest_body(mean, covariance) - mean
    assert distance_to_body(mean, covariance) ** 2 == pytest.approx(away @ np.linalg.inv(covariance) @ away, rel=1e-6)
    identifier.reset()
    assert identifier.unprojected is None


@pytest.mark.full  # some seconds
def test_sound_logs_have_a_body_within_the_error_bars(panda):
    for logs in simulate_episodes(draw_episodes(panda, "broad", 4, seed=31)):
        for tare in (None, logs.tare):
            assert not any("no body fits" in note for note in identify(logs.run, panda, tare=tare).notes)


@pytest.fixture(scope="module")
def real_answer(real_data):
    """A factory of the default answers to real logs; each is made once."""

    @cache
    def made(log, tare, robot):
        own = arm(real_data / robot, "tool0") if robot.endswith(".urdf") else arm(robot)
        before = None if tare is None else read_recording(real_data / tare, own)
        return identify(read_recording(real_data / log, own), own, tare=before)

    return made


@pytest.mark.parametrize(
    ("log", "tare", "robot"),
    [
        ("panda_unloaded_1khz.csv", None, "panda"),
        pytest.param("ur10e_loaded_2805g.csv", None, "ur10e.urdf", marks=pytest.mark.full),
        ("ur10e_loaded_2805g.csv", "ur10e_unloaded.csv", "ur10e.urdf"),
        pytest.param("ur10e_unloaded.csv", None, "ur10e.urdf", marks=pytest.mark.full),
    ],
)
def test_real_logs_have_a_body_within_the_error_bars(real_answer, log, tare, robot):
    answer = real_answer(log, tare, robot)
    assert answer.method == "hybrid"
    assert not any("no body fits" in note or "friction drives" in note for note in answer.notes)
    assert len(answer.segments) == 1  # the payload stays


@pytest.mark.parametrize("seed", [2, 4])
@pytest.mark.full  # some seconds
def test_a_base_on_a_ceiling_is_said_where_a_short_log_passes_as_one_of_a_base_that_stands(seed):
    panda = arm("panda")
    hung = replace(panda, gravity=(0.0, 0.0, 9.81))
    how = {"rate": 100.0, "duration": 3.0, "world": World.real_like(hung, seed), "seed": seed}
    log = simulate(hung, random_motion(panda, seed), box_of_the_examples(), **how)
    wrong, right = identify(log, panda), identify(log, hung)
    assert "far better with gravity about 0,0,9.81 m/s² in the axes of the base than with 0,0,-9.81" in wrong.notes[0]
    assert wrong.interval == "approximate"
    assert not any("far better" in note for note in right.notes)


def test_error_bars_that_lean_on_the_prior_are_named_and_those_that_a_log_tells_are_not(
    panda, simulated, loaded, alone
):
    told, leaning = identify(loaded, panda, tare=simulated("nothing", 3)), alone("box", 1)
    assert all(told.determined)
    assert not any("rest on what payloads are usually like" in note for note in told.notes)
    (said,) = (note for note in leaning.notes if "rest on what payloads are usually like" in note)
    assert "map-gp" in said
    assert "mass" not in said
    assert not any("usually like" in note for note in identify(loaded, panda, method="map-gp").notes)


def test_an_undetermined_interval_of_a_method_without_a_prior_holds_its_own(real_like):
    panda, how = real_like
    heavy = InertialParameters.from_com(5.0, (0.0, 0.0, 0.06), np.diag([1e-2, 1e-2, 1e-2]))
    log = simulate(panda, taie2024(), heavy, seed=3, **how).between(0.0, 1.0)
    answer = identify(log, panda, method="rls")
    assert not answer.determined[0]
    assert "does not tell whether anything is held" in str(answer)
    assert answer.phi_high[0] >= answer.phi[0] > Z95 * payload_prior_std(panda)[0]


def test_a_method_without_a_prior_reports_its_own_interval_of_what_the_log_narrows(real_like):
    panda, how = real_like
    held = InertialParameters.from_com(1.5, (0.0, 0.0, 0.06), np.diag([4e-3, 4e-3, 4e-3]))
    log = simulate(panda, taie2024(), held, seed=3, **how).between(0.0, 3.0)
    own = FilteredRecursiveLeastSquares(panda).run(log)
    half = Z95 * own.std[0]
    assert 0.05 < half < 0.3  # [kg] where what is known of any payload is 3 kg
    answer = identify(log, panda, method="rls-filter")
    assert answer.determined[0]
    assert answer.held
    assert [answer.phi_low[0], answer.phi_high[0]] == pytest.approx([own.phi[0] - half, own.phi[0] + half], abs=0.02)
    assert answer.interval == "approximate"


def test_one_sound_log_in_a_thousand_lies_farther_from_all_bodies_than_is_taken():
    assert chi2.sf(MISFIT**2, 10) == pytest.approx(1e-3, rel=1e-12)


def test_an_answer_near_what_the_log_says_spares_the_search_for_the_nearest_body_and_changes_no_verdict():
    rng, verdicts = np.random.default_rng(5), []
    body, unit = (
        nearest_body(np.array([1.0, *[0.01] * 3, *[0.004] * 6]), np.eye(10)),
        np.array([1.0, *[0.1] * 3] + [0.01] * 6),
    )
    for _ in range(40):
        covariance = np.outer(unit, unit) * 1e-4 * np.exp(rng.normal()) * np.eye(10)
        mean = body + rng.uniform(0.5, 4.0) * np.sqrt(np.diag(covariance)) * rng.normal(size=10)
        estimate = Estimate(1.0, body, covariance, 1, "f")
        found = Found(estimate, Before(body, unit), "m", "w", unprojected=(mean, covariance))
        verdicts.append(found.explained)
        assert found.explained == (distance_to_body(mean, covariance) <= MISFIT)
    assert len(set(verdicts)) == 2


def test_the_links_of_a_real_panda_are_not_called_another_arm_s(real_answer):
    sound = real_answer("panda_unloaded_1khz.csv", None, "panda")
    assert not any("differ from those of" in note for note in sound.notes)


@pytest.mark.parametrize("which", [10, 18])
@pytest.mark.full  # some seconds
def test_friction_of_one_way_is_no_offset_of_an_arm_s_torque(which):
    """Two sound UR5e that rub more one way than the other, by up to a half of their friction."""
    robot = arm("ur5e")
    (logs,) = simulate_episodes([draw_episodes(robot, "reference", 24, 350, motions=6)[which]])
    found = identify(logs.run, robot, tare=logs.tare)
    assert not any("times as far off" in note for note in found.notes)
    assert found.interval == "calibrated"


def test_a_torque_that_is_computed_and_not_measured_is_told_by_its_lack_of_friction(real_like):
    panda, motion = real_like[0], random_motion(real_like[0], 7, duration=6.0)
    t = np.arange(0.0, 6.0, 5e-3)
    q, dq, ddq = motion(t)
    noise = 0.05 * np.random.default_rng(3).normal(size=q.shape)
    wanted = Recording(t, q, dq, panda.torque(q, dq, ddq) + noise)  # whatever the arm holds
    assert COMPUTED in identify(wanted, panda).notes
    rubs = np.tanh(dq / 0.05) * [0.25, 0.25, 0.2, 0.35, 0.35, 0.2, 0.26]
    assert COMPUTED not in identify(replace(wanted, tau=wanted.tau + rubs), panda).notes


def test_a_computed_torque_is_never_called_calibrated_where_gears_would_rub_in_it():
    """A UR's target_moment, named by its user: what is held is not in it."""
    robot = arm("ur5e")
    t = np.arange(0.0, 6.0, 5e-3)
    q, dq, ddq = random_motion(robot, 7, duration=6.0)(t)
    empty = random_motion(robot, 8, duration=6.0)(t)
    wanted, before = (Recording(t, *x[:2], robot.torque(*x)) for x in ((q, dq, ddq), empty))
    for found in (identify(wanted, robot), identify(wanted, robot, tare=before)):
        assert COMPUTED in found.notes
        assert found.interval == "approximate"


@pytest.mark.parametrize(
    ("name", "turned"),
    [
        ("ur10e", [5]),
        ("ur10e", range(6)),
        *(pytest.param(*other, marks=pytest.mark.full) for other in (("panda", [6]), ("ur10e", [3]))),
    ],
)
@pytest.mark.full  # some seconds
def test_friction_that_drives_a_joint_is_told_by_the_joint(name, turned):
    """A torque with its sign turned; or all positions and velocities, which is the same for friction."""
    robot = arm(name)
    how = {"world": World.real_like(robot, 5), "sensors": Sensors.of(robot), "rate": 200.0}
    log = simulate(robot, random_motion(robot, 6, duration=6.0), BOX, seed=7, **how)
    sign = np.ones(robot.n)
    sign[list(turned)] = -1.0
    other = replace(log, tau=log.tau * sign) if len(turned) < robot.n else replace(log, q=-log.q, dq=-log.dq)
    answer = identify(other, robot)
    assert answer.interval == "approximate"
    (named,) = re.findall(r"friction drives joints? ([0-9, ]+) where", answer.notes[0])
    told = {int(joint) - 1 for joint in named.split(",")}
    assert told <= set(turned)
    assert len(told) > 0.8 * len(turned)
    assert not any("friction drives" in note for note in identify(log, robot).notes)


@pytest.mark.parametrize("samples", [2, 3, 5])
def test_a_log_of_some_milliseconds_is_answered_and_tells_little(samples, loaded, real_like):
    panda, _ = real_like
    answer = identify(loaded.select(np.arange(len(loaded)) < samples), panda)
    assert answer.phi_low[0] < BOX.mass < answer.phi_high[0]
    assert not answer.determined[1:].any()  # the mass may be: it is weighed in one pose

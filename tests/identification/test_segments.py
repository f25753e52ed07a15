"""A payload that changes within a log is found, said, and each part answered; a sound log is left whole."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from armload import Recording, arm, read_recording, write_recording
from armload.app.cli import main
from armload.devices import Simulator
from armload.errors import IdentificationError
from armload.identification import identify
from armload.identification.added_mass import MASS_MAY_CHANGE, of_mass
from armload.identification.notes import MAY_CHANGE, SHIFTS
from armload.identification.segments import changes_of_payload
from armload.identification.tare_age import DAY, SESSION, drift_after, drift_since, in_words
from armload.identification.thresholds import PAYLOAD_CHANGED, PAYLOAD_MAY_CHANGE
from armload.inertia import InertialParameters
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.motion import random_motion, taie2024
from armload.payloads import draw_payload, franka_hand
from armload.posterior.drift import ALLOWED
from armload.simulation import Sensors, World, simulate, simulate_inverse

MASS = 1.5  # [kg]


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def payload():
    return draw_payload("boxes", 3, MASS)


def log_of(panda, held, seed=5, clock=0.0):
    how = {"world": World.real_like(panda, 900 + seed), "sensors": Sensors.panda(panda), "rate": 200.0}
    source = Simulator(panda, taie2024(), held, speed=None, duration=6.0, seed=seed, **how)
    t, *rest = map(np.array, zip(*source, strict=True))
    return Recording(t + clock, *rest)


@pytest.fixture(scope="module")
def taken_up(panda, payload):
    """A log whose clock shows the time of day."""
    return log_of(panda, [(0.0, None), (2.5, payload)], clock=1.7e9)


@pytest.mark.full
def test_two_changes_within_six_seconds_are_found_and_no_third(panda, payload):
    found = identify(log_of(panda, [(0.0, None), (2.0, payload), (4.0, None)]), panda)
    assert [part.start for part in found.segments] == [0.0, pytest.approx(2.0, abs=0.15), pytest.approx(4.0, abs=0.15)]
    assert [part.answer.held for part in found.segments] == [False, True, False]


def test_a_payload_taken_up_within_a_log_is_found_and_each_part_answered(panda, payload, taken_up):
    found = identify(taken_up, panda)
    assert len(found.segments) == 2
    before, after = found.segments
    assert before.start == 0.0  # since the log's start, whatever its clock shows
    assert before.stop == after.start == pytest.approx(2.5, abs=0.15)
    assert after.answer.held
    assert not before.answer.held
    assert after.answer.mass == pytest.approx(payload.parameters.mass, abs=0.25)
    assert found.mass == after.answer.mass
    assert any("the payload changes within the log" in note for note in found.notes)
    assert json.loads(json.dumps(found.to_dict()))["segments"][1]["mass"] == found.mass


@pytest.mark.full  # some seconds
@pytest.mark.parametrize("when", [3.0, 6.0])
def test_what_was_on_at_the_tare_and_comes_off_within_a_log_is_found(panda, when):
    """No body has what is left then, which is no sign of one that swings."""
    body = draw_payload("boxes", 3, 0.8)
    how = {"world": World.real_like(panda, 3), "sensors": Sensors.of(panda), "rate": 100.0}
    held = [(0.0, body), (22.0 + when, None)]
    source = Simulator(panda, random_motion(panda, 3), held, speed=None, duration=34.0, seed=3, **how)
    log = Recording(*map(np.array, zip(*source, strict=True)))
    found = identify(log.between(22.0, 34.0), panda, tare=log.between(0.0, 20.0))
    assert [part.start for part in found.segments] == [0.0, pytest.approx(when, abs=0.1)]
    low, high = found.phi_low[0], found.phi_high[0]
    assert low <= -body.parameters.mass <= high < low + 0.2
    assert found.notes[0].startswith("something was taken off since the tare")


@pytest.mark.full  # some seconds
@pytest.mark.parametrize("seed", [3, 4])
def test_a_payload_taken_up_at_times_that_jitter_is_found(panda, seed):
    """Torques at wrong times look as if a part of the payload swung, but what swings never weighs nothing."""
    body = draw_payload("boxes", 3, 1.2)
    how = {"world": World.real_like(panda, seed), "sensors": Sensors.of(panda), "rate": 25.0}
    source = Simulator(
        panda, random_motion(panda, seed), [(0.0, None), (28.0, body)], speed=None, duration=36.0, seed=seed, **how
    )
    log = Recording(*map(np.array, zip(*source, strict=True)))
    tare, run = log.between(0.0, 20.0), log.between(22.0, 36.0)
    late = np.random.default_rng(seed).uniform(-0.012, 0.012, len(run.t))
    found = identify(replace(run, t=run.t + late), panda, tare=tare)
    assert [part.start for part in found.segments] == [0.0, pytest.approx(6.0, abs=0.15)]
    assert found.phi_low[0] <= body.parameters.mass <= found.phi_high[0]


@pytest.mark.full  # some seconds
def test_what_is_taken_up_shortly_before_the_end_is_found(panda, payload):
    found = identify(log_of(panda, [(0.0, None), (5.2, payload)]), panda)
    assert [part.start for part in found.segments] == [0.0, pytest.approx(5.2, abs=0.1)]
    assert found.phi_low[0] <= payload.parameters.mass <= found.phi_high[0]


@pytest.mark.parametrize("held", [None, "payload"])
def test_a_log_whose_payload_stays_is_one_part(panda, payload, held):
    log = log_of(panda, [(0.0, None if held is None else payload)], seed=6)
    found = identify(log, panda)
    assert len(found.segments) == 1
    assert (found.segments[0].start, found.segments[0].stop) == (0.0, pytest.approx(log.duration))
    assert not any("changes within" in note for note in found.notes)


def test_a_light_thing_taken_up_is_doubted_by_its_mass_and_a_sound_log_is_not(panda):
    light, how = draw_payload("boxes", 0, 0.2), {"sensors": Sensors.panda(panda), "rate": 200.0}
    assert light.parameters.mass < 0.07
    (episode,) = draw_episodes(panda, "reference", 1, seed=300, motions=6)
    (sound,) = simulate_episodes([replace(episode, payload=light)])
    source = Simulator(
        panda, episode.motion, [(0.0, None), (3.0, light)], speed=None, duration=6.0, seed=1, world=episode.world, **how
    )
    log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
    found = changes_of_payload(log, panda, sound.tare, kappa=1.5)
    assert found.times or found.doubted
    whole = changes_of_payload(sound.run, panda, sound.tare, kappa=1.5)
    assert not whole.times
    assert not whole.doubted


@pytest.mark.parametrize("tared", [True, pytest.param(False, marks=pytest.mark.full)], ids=["tared", "untared"])
@pytest.mark.full  # some seconds
def test_a_change_in_a_log_of_motor_currents_does_not_hide_itself(tared):
    """What it leaves unexplained looks like an arm unlike its model, of which more would be allowed."""
    robot, payload = arm("ur10e"), draw_payload("boxes", 4, 2.0)
    how = {"world": World.real_like(robot, 504), "sensors": Sensors.of(robot), "rate": 200.0}
    motion = random_motion(robot, 44, duration=6.0)
    tare = simulate(robot, random_motion(robot, 45, duration=20.0), seed=9, **how) if tared else None
    for when in (3.3, 9.0):
        source = Simulator(robot, motion, [(0.0, None), (when, payload)], speed=None, duration=6.0, seed=4, **how)
        log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
        found = identify(log, robot, tare=tare)
        assert len(found.segments) == 1 + (when < 6.0)
        assert MAY_CHANGE not in found.notes


def drifting(log, robot, share, seed):
    """The same with torques that drift, each by a share of its effort limit, one way or the other."""
    way = np.random.default_rng(seed).choice([-1.0, 1.0], robot.n)
    return replace(log, tau=log.tau + np.outer(log.t / log.t[-1] - 0.5, share * way * robot.limits.effort))


@pytest.mark.parametrize("name", ["panda", pytest.param("ur10e", marks=pytest.mark.full)])
@pytest.mark.parametrize("tared", [True, pytest.param(False, marks=pytest.mark.full)], ids=["tared", "untared"])
@pytest.mark.full  # some seconds
def test_torques_that_drift_are_no_change_of_payload(name, tared):
    """And the joint that drifts most, of its effort limit, is named with what it drifts by."""
    robot, payload = arm(name), draw_payload("boxes", 4, 1.5)
    how = {"world": World.real_like(robot, 504), "sensors": Sensors.of(robot), "rate": 200.0}
    motion, about = random_motion(robot, 44, duration=6.0), random_motion(robot, 45, duration=20.0)
    tare = simulate(robot, about, seed=9, **how) if tared else None
    sound = simulate(robot, motion, payload, seed=4, **how)
    assert changes_of_payload(sound, robot, tare).drift is None
    found = changes_of_payload(drifting(sound, robot, 0.02, 4), robot, tare)
    assert found.times == []
    assert found.drift is not None
    way = np.random.default_rng(4).choice([-1.0, 1.0], robot.n)
    joint = found.drift.joint - 1
    assert found.drift.torque == pytest.approx(0.02 * way[joint] * robot.limits.effort[joint], rel=0.5)
    answer = identify(drifting(sound, robot, 0.02, 4), robot, tare=tare)
    assert answer.interval == "approximate"
    assert len(answer.segments) == 1
    assert "drift within the log" in answer.notes[0]


@pytest.mark.parametrize("name", ["panda", "ur10e"])
@pytest.mark.full  # some seconds
def test_a_payload_that_is_taken_up_while_torques_drift_a_little_is_a_change(name):
    robot, payload = arm(name), draw_payload("boxes", 4, 1.5)
    how = {"world": World.real_like(robot, 504), "sensors": Sensors.of(robot), "rate": 200.0}
    source = Simulator(
        robot, random_motion(robot, 44), [(0.0, None), (3.3, payload)], speed=None, duration=6.0, seed=4, **how
    )
    log = Recording(*map(np.array, zip(*source, strict=True)))  # type: ignore[arg-type]
    found = changes_of_payload(drifting(log, robot, 0.002, 4), robot)
    assert found.times == [pytest.approx(3.3, abs=0.15)]
    assert found.drift is None


@pytest.mark.parametrize(
    ("seed", "size", "held", "share"),
    [pytest.param(1, 0.3, (0.5, 1.0), 0.0, marks=pytest.mark.full), (3, 0.2, (1.0,), 0.02), (1, 1.0, (0.3,), 0.02)],
    ids=["in two steps", "beside a drift", "beside a drift that is larger"],
)
@pytest.mark.full  # some seconds
def test_a_change_that_no_drift_alone_explains_is_found(panda, seed, size, held, share):
    """In a small motion a payload's torque is much like an offset, and one taken up in steps like a ramp."""
    body, motion = draw_payload("boxes", seed, 1.0).parameters, random_motion(panda, 40 + seed)
    motion = replace(motion, sine=size * motion.sine, cosine=size * motion.cosine)
    when = np.linspace(0.0, 6.0, len(held) + 2)[1:-1]
    steps = [(t, InertialParameters(part * body.phi, body.frame)) for t, part in zip(when, held, strict=True)]
    how = {"world": World.real_like(panda, 500 + seed), "sensors": Sensors.panda(panda), "rate": 100.0}
    log = simulate_inverse(panda, motion, [(0.0, None), *steps], seed=seed, **how)
    found = changes_of_payload(drifting(log, panda, share, seed), panda, kappa=1.5)
    assert found.times == [pytest.approx(t, abs=0.1) for t in when]


def test_no_change_is_found_in_windows_of_a_real_pair_of_motor_currents(real_data):
    robot = arm("ur10e")
    log, tare = (read_recording(real_data / f"ur10e_{name}.csv", robot) for name in ("loaded_2805g", "unloaded"))
    for start in (6.0, 18.0, 24.0, 48.0):
        part = log.between(log.t[0] + start, log.t[0] + start + 6.0)
        assert not changes_of_payload(part, robot, tare, kappa=1.0).doubted  # kappa is not believed


def moving_on(panda, held):
    """A log of 6 s, and its tare."""
    how = {"world": World.real_like(panda, 907), "sensors": Sensors.panda(panda), "rate": 100.0}
    log = simulate_inverse(panda, taie2024(), held, seed=7, **how)
    return identify(log, panda, tare=simulate_inverse(panda, random_motion(panda, 8), seed=8, **how))


def test_a_payload_that_slips_slowly_is_called_approximate_in_all_its_parts(panda, payload):
    """Each part takes it for rigid, at a place where it was for a moment only."""
    body = InertialParameters(4.0 * payload.parameters.phi, payload.parameters.frame)
    slips = [
        (t, InertialParameters.from_com(body.mass, body.com + np.array([x, 0.0, 0.0]), body.inertia_com, body.frame))
        for t, x in zip(np.linspace(1.0, 6.0, 51), np.linspace(0.0, 0.05, 51), strict=True)
    ]
    found = moving_on(panda, [(0.0, body), *slips])
    assert len(found.segments) > 1
    assert not (found.phi_low[1] <= slips[-1][1].phi[1] <= found.phi_high[1])  # where it is at the end
    assert found.interval == "approximate"
    assert found.notes[0] == SHIFTS
    assert {part.answer.interval for part in found.segments} == {"approximate"}


def test_what_is_added_to_a_payload_or_taken_off_is_no_shift(panda, payload):
    half = InertialParameters(0.5 * payload.parameters.phi, payload.parameters.frame)
    found = moving_on(panda, [(0.0, half), (3.0, payload)])
    assert len(found.segments) == 2
    assert SHIFTS not in found.notes
    assert found.interval == "calibrated"


def test_the_mass_of_what_was_added_is_chi_squared_of_one_where_nothing_was():
    """Oracle: draws of the evidence of logs of one payload, whose quantiles are those of SciPy's distribution."""
    rng = np.random.default_rng(0)
    root = rng.normal(size=(10, 10)) * np.r_[10.0, [100.0] * 3, [1e3] * 6][:, None]
    Λ = root @ root.T
    draws = [of_mass(Λ, root @ rng.normal(size=10)) for _ in range(4000)]
    for share in (0.5, 0.9, 0.99):
        assert np.quantile(draws, share) <= 1.15 * chi2.ppf(share, 1)


def test_what_is_found_and_what_is_doubted_are_quantiles_of_what_sound_logs_show():
    assert pytest.approx(chi2.isf(1e-3, 10)) == PAYLOAD_CHANGED
    assert pytest.approx(chi2.isf(1e-2, 10)) == PAYLOAD_MAY_CHANGE
    assert pytest.approx(chi2.isf(1e-2, 1)) == MASS_MAY_CHANGE


# ------------------------------------------------------------------ how old a tare is


def test_an_age_allows_for_more_the_older_it_is_and_for_nothing_within_a_session():
    assert drift_after(SESSION) == 0.0
    assert drift_after(DAY) == 1.0
    assert drift_after(4 * DAY) == 2.0
    assert drift_after(1000 * DAY) == ALLOWED


def test_clocks_that_show_the_time_of_day_tell_the_age_and_others_do_not(panda):
    log, tare = (log_of(panda, [(0.0, None)], seed=k, clock=c) for k, c in ((7, 1.7e9), (8, 1.7e9 - 4 * DAY)))
    drift, notes = drift_since(tare, log, None)
    assert drift == pytest.approx(2.0, abs=0.01)
    assert "4d old" in notes[0]
    assert drift_since(log_of(panda, [(0.0, None)], seed=8), log_of(panda, [(0.0, None)], seed=7), None) == (0.0, ())
    assert drift_since(tare, log, DAY) == (1.0, ())


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(90.0, "1.5min"), (7200.0, "2h"), (3 * DAY, "3d"), (1230 * DAY, "1230d"), (1e6 * DAY, "1000000d")],
)
def test_an_age_is_said_as_it_can_be_given(seconds, words):
    from armload.app.cli.arguments import duration

    assert in_words(seconds) == words
    assert duration(words) == seconds


@pytest.mark.parametrize("age", [-1.0, np.nan, np.inf])
def test_an_age_that_is_no_time_is_refused(panda, age):
    log = log_of(panda, [(0.0, None)])
    with pytest.raises(IdentificationError, match="expected a time of 0 or more"):
        drift_since(log, log, age)


# ------------------------------------------------------------------ on the command line


@pytest.fixture(scope="module")
def files(panda, payload, tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    world, sensors = World.real_like(panda, 31), Sensors.panda(panda)
    how = {"world": world, "sensors": sensors, "rate": 200.0}
    write_recording(folder / "loaded.csv", simulate(panda, taie2024(), payload, seed=1, **how))
    write_recording(folder / "empty.csv", simulate(panda, taie2024(), None, seed=2, duration=6.0, **how))
    return folder


def answer(capsys, *arguments):
    assert main(["identify", *map(str, arguments), "--robot", "panda", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.full  # some seconds
def test_a_weighed_mass_is_in_the_answer_and_one_that_the_log_contradicts_is_said(files, capsys):
    truth = draw_payload("boxes", 3, MASS).parameters.mass
    log, tare = files / "loaded.csv", files / "empty.csv"
    right = answer(capsys, log, "--tare", tare, "--mass", f"{truth:.4f}±0.002")
    assert right["mass"] == pytest.approx(truth, abs=4e-3)
    wrong = answer(capsys, log, "--tare", tare, "--mass", f"{truth + 0.6:.4f}+-0.002")
    assert wrong["interval"] == "approximate"
    assert any("is not what the log says" in note for note in wrong["notes"])
    assert wrong["phi"] == answer(capsys, log, "--tare", tare)["phi"]  # and no mass between the two


@pytest.mark.full  # some seconds
def test_a_known_centre_is_in_the_answer_and_one_that_the_log_contradicts_is_said(files, capsys):
    r = draw_payload("boxes", 3, MASS).parameters.com
    log, tare = files / "loaded.csv", files / "empty.csv"
    plain = answer(capsys, log, "--tare", tare)
    right = answer(capsys, log, "--tare", tare, "--com", ",".join(f"{x:.5f}" for x in r) + "±0.001")
    assert right["com"] == pytest.approx(r, abs=2e-3)
    widths = [np.array(x["com_high"]) - np.array(x["com_low"]) for x in (right, plain)]
    assert np.all(widths[0] < widths[1])
    wrong = answer(capsys, log, "--tare", tare, "--com", f"{r[0] - 0.1:.5f},{r[1]:.5f},{r[2]:.5f}+-0.001")
    assert wrong["interval"] == "approximate"
    assert any("the centre of mass given" in note and "is not what the log says" in note for note in wrong["notes"])
    assert wrong["phi"] == plain["phi"]
    given = ("--com", f"{r[0] - 0.1:.5f},{r[1]:.5f},{r[2]:.5f}+-0.001", "--mass", f"{plain['mass']:.4f}+-0.001")
    for more in (("--tare", tare), ()):
        weighed = answer(capsys, log, *more, *given)
        assert weighed["phi_high"][0] - weighed["phi_low"][0] < 0.005  # what is believed of both
        assert not weighed["rests_on_prior"][0]


def test_an_old_tare_widens_the_interval(files, capsys):
    log, tare = files / "loaded.csv", files / "empty.csv"

    def width(*more):
        found = answer(capsys, log, "--tare", tare, "--method", "map-gp", *more)
        return found["phi_high"][0] - found["phi_low"][0]

    assert width("--tare-age", "9d") > 1.02 * width()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--tare-age", "1d"], "there is no --tare"),
        (["--tare-age", "soon"], "is not a time"),
        (["--mass", "heavy"], "is not a weighed mass"),
        (["--mass", "1.2"], "is not a weighed mass"),
        (["--mass", "1.2±0"], "above zero"),
        (["--mass", "-1±0.1"], "is a mass of -1 kg: expected one above zero"),
        (["--mass", "0±0.01"], "above zero"),
        (["--mass", "1e9±1"], "the known mass is 1e+09 kg: expected at most 9 kg, 3 times what panda is rated for"),
        (["--mass", "1200±2"], "give kilograms"),
        (["--mass", "1.2±0.1", "--method", "rls"], "cannot use what is known"),
        (["--com", "0,0,0.1"], "is not a centre of mass"),
        (["--com", "0,0.1±0.01"], "is not a centre of mass"),
        (["--com", "0,0,0.1±0"], "above zero"),
        (["--com", "0,0,0.1±0.01", "--method", "rls"], "cannot use what is known"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(files, capsys, arguments, said):
    assert main(["identify", str(files / "loaded.csv"), "--robot", "panda", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert said in printed.err


@pytest.mark.full  # some seconds
def test_a_weighed_mass_is_that_of_what_the_tool_carries_and_of_what_is_held_at_the_end(panda, payload, taken_up):
    mass, tool = payload.parameters.mass, franka_hand()
    how = {"world": World.real_like(panda, 31), "sensors": Sensors.panda(panda), "rate": 200.0}
    both = InertialParameters(payload.parameters.phi) + InertialParameters(tool.parameters.phi)
    log, tare = simulate(panda, taie2024(), both, seed=1, **how), simulate(panda, taie2024(), None, seed=2, **how)
    found = identify(log, panda, tare=tare, tool=tool, mass=(mass, 2e-3))
    assert found.relative_to == "tool"
    assert found.mass == pytest.approx(mass, abs=4e-3)
    assert not any("is not what the log says" in note for note in found.notes)
    before, after = identify(taken_up, panda, mass=(mass, 2e-3)).segments
    assert after.answer.mass == pytest.approx(mass, abs=4e-3)
    assert not before.answer.held

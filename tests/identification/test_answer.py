"""What an answer says: intervals that follow from one Gaussian, words and tables, what is missing, whom to believe."""

import re
from dataclasses import replace

import numpy as np
import pytest

import armload
from armload import HybridIdentifier, OnlineIdentifier, arm, write_recording
from armload.arms import Arm
from armload.identification import identify
from armload.identification.arm_notes import arm_changed, carries_more, gravity_turned
from armload.identification.intervals import intervals
from armload.identification.reporting import removal
from armload.identification.thresholds import FARTHEST
from armload.inertia import NAMES, Z95, InertialParameters, com_interval, inertia_com_std, phi_to_com, vech
from armload.lab.episodes import Recipe, draw_episodes, simulate_episodes
from armload.motion import random_motion, taie2024
from armload.payloads import Payload, write_payload
from armload.posterior.scales import Drift
from armload.recording import Recording
from armload.simulation import Sensors, World, simulate

BOX = InertialParameters.from_com(1.2, (0.02, -0.03, 0.07), np.diag([4e-3, 3e-3, 2e-3]))
PRODUCTS = [1, 2, 4]  # of the six numbers of an inertia


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture(scope="module")
def how(panda):
    return {"world": World.real_like(panda, 5), "sensors": Sensors.panda(panda), "rate": 250.0}


@pytest.fixture(scope="module")
def loaded(panda, how):
    return simulate(panda, taie2024(), BOX, seed=1, **how)


@pytest.fixture(scope="module")
def empty(panda, how):
    return simulate(panda, random_motion(panda, 8, duration=15.0, harmonics=8), None, seed=2, **how)


@pytest.fixture(scope="module")
def answer(panda, loaded, empty):
    return identify(loaded, panda, tare=empty)


@pytest.fixture(scope="module")
def plain(panda, loaded):
    """The answer without a tare."""
    return identify(loaded, panda)


def spread(phi, relative, seed=0):
    """A covariance with correlations, standard deviations in the given share of some size."""
    A = np.random.default_rng(seed).normal(size=(10, 14))
    C = A @ A.T
    std = relative * np.array([1.0] + [0.1] * 3 + [0.01] * 6) * max(phi[0], 0.1)
    return C / np.sqrt(np.outer(np.diag(C), np.diag(C))) * np.outer(std, std)


# ---------------------------------------------------------------------- intervals


@pytest.mark.parametrize("relative", [0.01, 0.1, 0.25])
def test_the_centre_s_interval_holds_the_truth_as_often_as_it_says(relative):
    """Fieller's interval is exact: 95 % of draws about a truth have intervals that hold it, however lopsided."""
    rng, P = np.random.default_rng(1), spread(BOX.phi, relative)
    draws = rng.multivariate_normal(BOX.phi, P, size=4000)
    low, high = np.transpose([com_interval(phi, P) for phi in draws], (1, 0, 2))
    inside = (low <= BOX.com) & (BOX.com <= high)
    assert inside.mean(axis=0) == pytest.approx(0.95, abs=0.012)


def test_the_inertia_s_standard_deviation_is_that_of_draws_where_they_are_narrow():
    P = spread(BOX.phi, 0.01)
    draws = np.random.default_rng(2).multivariate_normal(BOX.phi, P, size=20000)
    found = np.array([vech(phi_to_com(phi)[2]) for phi in draws]).std(axis=0)
    assert inertia_com_std(BOX.phi, P) == pytest.approx(found, rel=0.03)


def test_where_the_mass_may_be_zero_the_centre_s_interval_is_a_finite_bound():
    light = InertialParameters.from_com(0.05, (0.0, 0.02, 0.06), np.diag([1e-4, 1e-4, 1e-4])).phi
    P = spread(light, 1.0)
    half = Z95 * np.sqrt(np.diag(P))
    found = intervals(light, light - half, light + half, P)
    assert np.all(np.isfinite(np.concatenate([np.ravel(x) for x in found])))
    assert (found.com_low.tolist(), found.com_high.tolist()) == ([-FARTHEST] * 3, [FARTHEST] * 3)
    assert np.all(np.diag(found.inertia_com_low) == 0.0)
    # every body within the interval about the origin lies within the bounds
    rng = np.random.default_rng(3)
    for _ in range(200):
        points, weights = rng.normal(size=(12, 3)) * 0.1, rng.random(12)
        body = sum(
            (InertialParameters.from_com(w, p, 1e-9 * np.eye(3)) for w, p in zip(weights, points, strict=True)),
            InertialParameters.zero(),
        )
        body = InertialParameters(body.phi * min(1.0, float(np.min((light + half)[[4, 7, 9]] / body.phi[[4, 7, 9]]))))
        assert np.all((found.inertia_com_low <= body.inertia_com) & (body.inertia_com <= found.inertia_com_high))


def test_the_covariance_is_that_of_the_intervals(answer):
    half = Z95 * np.sqrt(np.diag(answer.covariance))
    assert half == pytest.approx((answer.phi_high - answer.phi_low) / 2, rel=1e-9)
    assert np.linalg.eigvalsh(answer.covariance / np.outer(half, half))[0] > 0.0
    assert answer.com_low == pytest.approx(com_interval(answer.phi, answer.covariance)[0], abs=1e-4)


def test_no_interval_of_a_body_s_moments_is_below_zero(answer):
    assert np.all(np.diag(answer.inertia_com_low) >= 0.0)
    assert np.all(vech(answer.inertia_com_low)[PRODUCTS] < 0.0)


# ---------------------------------------------------------------------- words


def test_an_estimate_s_plus_minus_is_half_of_its_95_percent_interval(panda, loaded):
    estimate = HybridIdentifier(panda).run(loaded)
    text = str(estimate)
    half = float(re.search(r"m = \S+ ± (\S+) kg\n", text)[1])
    assert half == pytest.approx(Z95 * estimate.std[0], abs=6e-6)
    assert text.count("95 %") == 1


def test_an_answer_s_plus_minus_is_half_of_its_95_percent_interval(answer):
    text = str(answer)
    value, half = re.search(r"^mass +(\S+) ± (\S+) +kg$", text, re.MULTILINE).groups()
    assert float(value) == pytest.approx(answer.mass, abs=6e-4)
    assert float(half) == pytest.approx((answer.phi_high[0] - answer.phi_low[0]) / 2, abs=6e-4)
    assert text.count("95 %") == 1


def test_what_is_undetermined_and_what_rests_on_the_prior_is_marked_in_place(panda, loaded, plain):
    found = plain
    leaning = found.determined & found.rests_on_prior
    assert leaning[4:].any()
    lines = str(found).splitlines()
    for name, marked in zip(("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"), leaning[4:], strict=True):
        (line,) = (line for line in lines if f" {name} " in line)
        assert line.endswith("rests on the prior") == marked
    pose = np.tile(loaded.q[0], (300, 1))
    still = Recording(np.arange(300) * 0.01, pose, 0 * pose, panda.with_payload(BOX).torque(pose))
    found = identify(still, panda)
    assert not found.determined[4:].any()
    assert found.rests_on_prior[4:].all()
    assert sum("undetermined" in line for line in str(found).splitlines()) >= 6


def test_reprs_are_one_short_line(panda, loaded, answer):
    online = OnlineIdentifier(panda)
    shown = [loaded, answer, HybridIdentifier(panda), online, HybridIdentifier(panda).run(loaded), online.conclude()]
    online.close()
    for thing in shown:
        assert len(repr(thing)) < 200
        assert "\n" not in repr(thing)
        assert "array" not in repr(thing)
    assert f"{answer.mass:.3f}" in repr(answer)


def test_notebooks_show_a_small_table(loaded, answer):
    for thing, rows in ((answer, 10), (replace(loaded, source="<b>log</b>"), 8)):
        html = thing._repr_html_()
        assert html.count("<tr>") == html.count("</tr>") == rows
        assert "<b>" not in html
    assert f"{answer.mass:.3f} ± " in answer._repr_html_()


def test_arrays_of_an_answer_are_numpy_s_and_cannot_be_written_to(answer):
    for name in ("phi", "phi_low", "phi_high", "determined", "com", "inertia_com", "covariance", "rests_on_prior"):
        value = getattr(answer, name)
        assert isinstance(value, np.ndarray)
        with pytest.raises(ValueError, match="read-only"):
            value[...] = 0


# ---------------------------------------------------------------------- what is given


@pytest.mark.full  # some seconds
def test_names_and_paths_stand_for_what_they_name(panda, loaded, empty, plain, tmp_path):
    write_recording(tmp_path / "run.csv", loaded)
    write_recording(tmp_path / "empty.npz", empty)
    write_payload(tmp_path / "tool.json", Payload("tool", InertialParameters(0.1 * BOX.phi, "panda_link8")))
    (tmp_path / "mine.urdf").write_text(panda.urdf)
    here = identify(
        armload.read_recording(tmp_path / "run.csv", panda),
        panda,
        tare=armload.read_recording(tmp_path / "empty.npz", panda),
        tool=armload.read_payload(tmp_path / "tool.json").parameters,
    )
    named = armload.identify(
        str(tmp_path / "run.csv"), "panda", tare=tmp_path / "empty.npz", tool=tmp_path / "tool.json"
    )
    assert named.phi.tolist() == here.phi.tolist()
    assert named.log == "run.csv"
    by_file = armload.identify(loaded, tmp_path / "mine.urdf")
    assert by_file.phi == pytest.approx(plain.phi, abs=0.05)


def test_dir_shows_the_interface_only():
    assert dir(armload) == sorted(armload.__all__)


# ---------------------------------------------------------------------- whom to believe


def test_a_doubted_answer_with_a_tool_is_not_called_calibrated(panda, how):
    """Nothing is mounted where a tool was named: no body has the parameters that are left."""
    bare = simulate(panda, taie2024(), None, seed=5, **how)
    found = identify(bare, panda, tool=BOX)
    assert (found.consistent, found.held) == (False, False)
    assert found.interval == "approximate"
    assert "no body can have these parameters" in str(found)


@pytest.mark.parametrize("tared", [False, True])
@pytest.mark.full  # some seconds
def test_no_answer_that_no_body_can_have_is_called_calibrated(panda, loaded, empty, tared):
    found = identify(empty, panda, tare=loaded) if tared else identify(empty, panda, tool=BOX)
    assert not found.consistent
    assert found.interval == "approximate"


# ---------------------------------------------------------------------- what is missing


def test_where_figures_are_nominal_the_first_advice_is_a_tare():
    ur = arm("ur10e")
    world, sensors = World.real_like(ur, 3), Sensors.generic(ur)
    log = simulate(
        ur,
        random_motion(ur, 54, duration=8.0),
        InertialParameters(2.0 * BOX.phi),
        world=world,
        sensors=sensors,
        rate=100.0,
        seed=5,
    )
    tare = simulate(ur, random_motion(ur, 53, duration=15.0), None, world=world, sensors=sensors, rate=100.0, seed=4)
    untared, tared = identify(log, ur), identify(log, ur, tare=tare)
    assert untared.notes[0].startswith("record a tare")
    assert not any("record a tare" in note for note in tared.notes)
    assert "a tare of this very arm, which nothing here confirms" in str(tared)
    assert "this very arm" not in str(untared)


def test_of_joint_sensors_a_tare_is_confirmed_and_nothing_is_assumed(answer):
    assert "this very arm" not in str(answer)


def test_a_pause_of_a_log_is_said(panda, loaded, plain):
    later = loaded.t + 3600.0 * (np.arange(len(loaded)) >= len(loaded) // 2)
    found = identify(replace(loaded, t=later), panda)
    assert any(note.startswith("the log pauses for 60min, 3.1 s after") for note in found.notes)
    assert not any("pauses" in note for note in plain.notes)


def test_a_standing_arm_lacks_motion(panda):
    pose = np.tile(taie2024()(np.zeros(1))[0], (300, 1))
    still = Recording(np.arange(300) * 0.01, pose, 0 * pose, panda.with_payload(BOX).torque(pose))
    (said,) = (note for note in identify(still, panda, method="map-gp").notes if "does not determine" in note)
    assert "with a tare or without: move the wrist" in said
    assert all(name in said for name in ("Ixx", "Iyy", "Izz"))


@pytest.mark.full  # some seconds
def test_what_is_said_to_lack_motion_a_tare_does_not_tell_either(panda):
    """Short everyday motions: a tare tells what is said to be hidden, and nothing of what is said to lack motion."""
    recipe = Recipe(duration=1.0, motions=("point-to-point", "slow", "partial"))
    gained = {"hide": 0, "does not determine": 0}
    for logs in simulate_episodes(draw_episodes(panda, recipe, 8, seed=78)):
        alone, tared = identify(logs.run, panda), identify(logs.run, panda, tare=logs.tare)
        told = {name for name, known in zip(NAMES, tared.determined, strict=True) if known}
        for note in alone.notes:
            for what in gained:
                if f" {what} " in note:
                    named = re.split(r"[,: ]+", note.split(f" {what} ")[1])
                    gained[what] += len(told & set(named))
    assert gained["hide"] > 0
    assert gained["does not determine"] == 0


def test_an_empty_hand_gets_no_advice_on_inertia(panda, how):
    bare = simulate(panda, taie2024(), None, seed=5, **how)
    found = identify(bare, panda)
    assert not found.held
    assert found.notes == ()


def test_a_method_that_was_named_is_not_explained(panda, loaded, plain):
    for answer in (plain, *(identify(loaded, panda, method=method) for method in ("map-gp", "rls"))):
        text = " ".join([str(answer), *answer.notes])
        assert "asked for" not in text
        assert "holds for any motion" not in text


def test_of_what_joints_in_another_order_look_like_that_is_said():
    level = (0.0, 0.0, -9.81)
    assert "joints in another order" in gravity_turned(level, (1.51, 4.19, -8.74), True)  # by 27°
    assert "another order" not in gravity_turned(level, (0.51, 0.0, -9.8), True)  # by 3°
    assert "joints are in another order" in removal("arm")
    assert "another order" not in removal("tare")


def test_of_an_arm_that_changed_it_is_said_what_the_intervals_do_not_allow_for(panda):
    drift = Drift(np.full(7, 0.1), np.zeros(7), 40.0, 0, True)
    assert "the intervals allow for it, but not for another arm's links" in (arm_changed(panda, drift, None) or "")
    assert "another arm" not in (arm_changed(panda, replace(drift, allowed=False), None) or "another arm")


def torso():
    """A lift that carries two arms; the left one has a finger."""

    def link(name):
        inertia = '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>'
        return f'<link name="{name}"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>{inertia}</inertial></link>'

    def joint(name, kind, parent, child):
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="0.2 0 0.1"/><axis xyz="0 1 0"/>'
        return (
            f'<joint name="{name}" type="{kind}">{ends}<limit lower="-2" upper="2" effort="90" velocity="3"/></joint>'
        )

    joints = [("lift", "prismatic", "base", "torso")]
    for side in ("left", "right"):
        joints.append((f"{side}_1", "revolute", "torso", f"{side}_upper"))
        joints.append((f"{side}_2", "revolute", f"{side}_upper", f"{side}_hand"))
    joints.append(("left_finger", "prismatic", "left_hand", "left_tip"))
    links = "".join(link(child) for *_, child in joints)
    return f'<robot name="torso"><link name="base"/>{links}{"".join(joint(*each) for each in joints)}</robot>'


def test_what_a_torso_carries_beside_the_arm_is_named_with_what_is_doubted(monkeypatch):
    cell = Arm("torso", torso(), "left_hand")
    assert cell.held == (("right_1", 1), ("right_2", 1), ("left_finger", 3))
    assert replace(cell, gravity=(0.0, 0.0, -9.7)).held == cell.held
    (said,) = carries_more(cell)
    assert said.startswith("lift also bears what right_1 … right_2 move, which counts as standing at zero")
    t = np.linspace(0.0, 4.0, 401)
    q = np.stack([0.2 * np.sin(t), np.sin(1.3 * t), np.sin(1.7 * t)], axis=1)
    dq, ddq = (np.gradient(x, t, axis=0) for x in (q, np.gradient(q, t, axis=0)))
    log = Recording(t, q, dq, cell.torque(q, dq, ddq))
    assert said not in identify(log, cell).notes
    monkeypatch.setattr("armload.identification.reporting._doubts", lambda *_: ["doubted"])
    assert identify(log, cell).notes[:2] == ("doubted", said)


def test_arms_that_no_joint_carries_beside_each_other_and_fingers_are_not_named(panda):
    beside = torso().replace('name="lift" type="prismatic"', 'name="lift" type="fixed"')
    assert carries_more(Arm("cell", beside, "left_hand")) == []
    assert carries_more(panda) == []

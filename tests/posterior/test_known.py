"""What is known beside a log narrows what is left to be found, and is never taken against the log without a word."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import chi, norm

from armload import arm, identify
from armload.app.cli import main
from armload.app.cli.arguments import centre
from armload.errors import IdentificationError, ModelError
from armload.identification import known_of
from armload.identification.known_payload import denied_by
from armload.inertia import HELD, Z95, InertialParameters
from armload.lab.episodes import draw_episodes, simulate_episodes
from armload.measuring import Basis
from armload.motion import random_motion, taie2024
from armload.online import OnlineIdentifier
from armload.payloads import Payload, draw_payload, franka_hand, write_payload
from armload.payloads.uncertainty import Uncertainty
from armload.posterior import HybridIdentifier
from armload.posterior.known import FAR, UNLIKE, Known, KnownBody, KnownCentre, KnownMass
from armload.recording import write_recording
from armload.simulation import Sensors, World, simulate

PHI = np.array([1.2, 0.02, -0.03, 0.1, 8e-3, 1e-4, -2e-4, 9e-3, 1e-4, 3e-3])  # a payload
COM = (0.02, -0.02, 0.08)


def gaussian(seed, scale=1.0):
    """phi about `PHI`: all ten correlated, the mass known to 2 %."""
    rng = np.random.default_rng(seed)
    units = scale * np.array([0.02] + [4e-3] * 3 + [1e-3] * 6)
    root = rng.normal(size=(10, 10)) * units[:, None] / np.sqrt(10.0)
    C = root @ root.T
    return rng.multivariate_normal(PHI, C), C


def test_a_gaussian_given_one_of_its_coordinates_is_what_many_draws_near_it_show():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(10, 10))
    mean, C = rng.normal(size=10), root @ root.T
    known = KnownMass(float(mean[0] + 1.5), 0.3)
    found, covariance = known.given(mean, C)
    draws = rng.multivariate_normal(mean, C, size=400_000)
    weight = np.exp(-0.5 * ((draws[:, 0] - known.mass) / known.std) ** 2)
    seen = weight @ draws / weight.sum()
    assert found == pytest.approx(seen, abs=0.05 * np.sqrt(np.diag(C)).max())
    spread = (weight[:, None] * (draws - seen)).T @ (draws - seen) / weight.sum()
    assert covariance == pytest.approx(spread, abs=0.05 * np.diag(C).max())


def test_phi_given_mass_and_centre_is_the_joint_gaussian_conditioned():
    """The joint Gaussian of phi, a reading of the scale and three of the drawing, conditioned in information form."""
    mean, C = gaussian(1)
    known = Known(KnownMass(1.21, 0.01), KnownCentre(COM, 2e-3))
    weighed, after = KnownMass(1.21, 0.01).given(mean, C)
    noise = np.diag([0.01**2] + [2e-3**2 * (weighed[0] ** 2 + after[0, 0])] * 3)
    H = np.zeros((4, 10))
    H[0, 0], H[1:, 0], H[1:, 1:4] = 1.0, -np.array(COM), np.eye(3)
    information = np.linalg.inv(C) + H.T @ np.linalg.inv(noise) @ H
    read = np.array([1.21, 0.0, 0.0, 0.0])
    expected = np.linalg.solve(information, np.linalg.solve(C, mean) + H.T @ np.linalg.solve(noise, read))
    found, covariance = known.given(mean, C)
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-12)
    assert covariance == pytest.approx(np.linalg.inv(information), rel=1e-6, abs=1e-14)


def test_phi_given_a_centre_is_what_draws_with_that_centre_show():
    mean, C = gaussian(2)
    known = KnownCentre(COM, 3e-3)
    found, covariance = known.given(mean, C)
    draws = np.random.default_rng(0).multivariate_normal(mean, C, size=400_000)
    away = draws[:, 1:4] / draws[:, :1] - np.array(COM)
    weight = np.exp(-0.5 * np.sum((away / known.std) ** 2, axis=1))
    seen = weight @ draws / weight.sum()
    std = np.sqrt(np.diag(C))
    assert np.abs(found - seen).max() < 0.05 * std.max()
    assert np.all(np.abs(found - seen) < 0.1 * std)
    spread = (weight[:, None] * (draws - seen)).T @ (draws - seen) / weight.sum()
    assert np.sqrt(np.diag(covariance)) == pytest.approx(np.sqrt(np.diag(spread)), rel=0.05)


def test_an_error_of_the_torques_scale_leaves_a_known_centre_alone():
    mean, C = gaussian(3, 1e-3)
    _, covariance = KnownCentre(tuple(mean[1:4] / mean[0]), 1e-3).given(mean, C + 0.05**2 * np.outer(mean, mean))
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.05 * mean[0], rel=0.01)


def test_what_is_known_is_of_the_payload_and_not_of_the_tool_beside():
    mean, C = gaussian(4)
    tool, known = 0.5 * PHI[::-1], Known(KnownMass(1.2, 2e-3), KnownCentre(COM, 1e-3))
    alone, beside = known.given(mean, C), known.with_tool(tool).given(mean + tool, C)
    assert beside[0] - tool == pytest.approx(alone[0])
    assert beside[1] == pytest.approx(alone[1])


def test_an_error_of_the_tool_is_an_error_of_what_the_log_says_of_the_payload():
    mean, C = gaussian(4)
    tool, E = 0.5 * PHI[::-1], gaussian(5)[1]
    known = Known(KnownMass(1.2, 2e-3), KnownCentre(COM, 1e-3))
    beside = known.with_tool(tool).with_error(E)
    alone = known.given(mean, C + E)
    found = beside.given(mean + tool, C)
    assert found[0] - tool == pytest.approx(alone[0])
    assert found[1] == pytest.approx(alone[1])
    off = mean + tool + 5.0 * np.sqrt(C[0, 0]) * np.eye(10)[0]  # five deviations of the log, a fifth of the tool's
    assert known.with_tool(tool).denied(off, C)
    assert not beside.with_error(625.0 * C).denied(off, C)


def test_three_coordinates_are_as_seldom_denied_as_one_mass():
    assert chi.sf(FAR, 3) == pytest.approx(2.0 * norm.sf(HELD), rel=1e-3)


def test_ten_parameters_are_as_seldom_denied_as_one_mass():
    assert chi.sf(UNLIKE, 10) == pytest.approx(2.0 * norm.sf(HELD), rel=1e-3)


def test_two_gaussians_of_one_body_are_what_their_product_is():
    """In information form: precisions add, and so do the pulls."""
    (mean, C), (phi, R) = gaussian(6), gaussian(7)
    known = Known(body=KnownBody(phi, R))
    information = np.linalg.inv(C) + np.linalg.inv(R)
    expected = np.linalg.solve(information, np.linalg.solve(C, mean) + np.linalg.solve(R, phi))
    found, covariance = known.given(mean, C)
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-10)
    assert covariance == pytest.approx(np.linalg.inv(information), rel=1e-5, abs=1e-12)
    assert known.which.all()
    assert known.denied(mean, C) == ()
    assert known.denied(3.0 * mean, C) == (known.body,)
    assert known.given(3.0 * mean, C) is None
    assert known.believed(3.0 * mean, C) is None


def test_all_that_a_log_denies_is_left_out_and_not_the_first_of_it_alone():
    """Of another part that was weighed and whose drawing was taken, neither is believed."""
    mean, C = gaussian(8)
    known = Known(KnownMass(2.4, 2e-3), body=KnownBody(2.0 * PHI, 1e-4 * C))
    assert known.denied(mean, C) == (known.mass, known.body)
    assert known.given(mean, C) is None
    assert known.believed(mean, C) is None
    said = denied_by(known, (mean, C))
    assert said is not None
    assert "the mass given" in said
    assert "the body given" in said


@pytest.mark.parametrize("share", [1e-6, 1e-9, 1e-12])
def test_what_is_known_almost_exactly_leaves_variances_above_zero(share):
    mean, C = gaussian(9)
    for known in (KnownMass(mean[0], share), KnownBody(mean, share**2 * C)):
        found, covariance = known.given(mean, C)
        assert np.all(np.isfinite(found))
        assert np.all(np.diag(covariance) > 0.0)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(share * np.sqrt(C[0, 0]), rel=1e-3)


@pytest.mark.parametrize(
    ("phi", "covariance", "said"),
    [
        (PHI[:9], np.eye(10), "ten finite parameters"),
        (np.full(10, np.nan), np.eye(10), "ten finite parameters"),
        (PHI, np.eye(9), "ten finite parameters"),
        (PHI, np.diag([0.0] + [1.0] * 9), "each above zero"),
        (PHI, np.ones((10, 10)), "not positive definite"),
    ],
)
def test_a_body_that_is_none_or_known_exactly_is_refused(phi, covariance, said):
    with pytest.raises(IdentificationError, match=said):
        KnownBody(phi, covariance)


STATED = Uncertainty(0.01, 2e-3, 0.05)


@pytest.fixture(scope="module")
def tray():
    """A tray, a log of 4 s with it, a tare, and the arm that it was held by."""
    panda = arm("panda")
    held = draw_payload("wide", 5, 3.0).parameters
    how = {"world": World.real_like(panda, 9), "sensors": Sensors.of(panda), "rate": 200.0}
    log = simulate(panda, taie2024(), held, seed=4, **how)
    tare = simulate(panda, random_motion(panda, 2, duration=8.0), None, seed=6, **how)
    return held, log.between(log.t[0], log.t[0] + 4.0), tare, panda


def inside(low, held, high):
    """Whether nine of ten intervals hold at least, as nearly all such tens do."""
    return np.sum((np.asarray(low) <= held.phi) & (held.phi <= np.asarray(high))) >= 9


@pytest.mark.parametrize("method", [None, "map-gp"])
@pytest.mark.full  # some seconds
def test_a_drawing_tells_what_a_log_does_not_and_a_tray_is_not_held_against_what_is_usual(tray, method):
    held, log, tare, panda = tray
    plain = identify(log, panda, tare=tare, method=method)
    drawn = identify(log, panda, tare=tare, method=method, body=Payload("tray", held, uncertainty=STATED))
    assert not any("not what the log says" in note for note in drawn.notes)
    assert drawn.determined.all()
    assert not drawn.rests_on_prior.any()
    assert inside(drawn.phi_low, held, drawn.phi_high)
    widths = [(x.phi_high - x.phi_low)[4:].mean() for x in (plain, drawn)]
    assert widths[1] < 0.8 * widths[0]
    assert drawn.interval == plain.interval


def test_a_drawing_of_another_body_is_said_by_what_differs_most_and_left_out(tray):
    _, log, tare, panda = tray
    other = Payload("other", draw_payload("container", 5, 3.0).parameters, uncertainty=STATED)
    plain, told = identify(log, panda, tare=tare), identify(log, panda, tare=tare, body=other)
    assert "the body given is not what the log says" in told.notes[0]
    assert told.interval == "approximate"
    assert told.phi == pytest.approx(plain.phi, abs=1e-9)


def test_a_drawing_in_another_frame_is_turned_with_its_uncertainty(tray):
    held, log, tare, panda = tray
    elsewhere = arm("panda", "panda_link7")
    drawn = Payload("tray", elsewhere.in_frame(InertialParameters(held.phi, "panda_link8")), uncertainty=STATED)
    here = identify(log, panda, tare=tare, body=Payload("tray", held, uncertainty=STATED))
    there = identify(log, panda, tare=tare, body=drawn)
    assert there.phi == pytest.approx(here.phi, abs=2e-3)


def test_a_drawing_of_nothing_is_refused(tray):
    _, log, tare, panda = tray
    nothing = Payload("nothing", InertialParameters(np.zeros(10)), uncertainty=STATED)
    with pytest.raises(IdentificationError, match="the body nothing has no mass"):
        identify(log, panda, tare=tare, body=nothing)


@pytest.mark.parametrize("body", [franka_hand(), Payload.without_inertia("ball", 0.9, (0.0, 0.0, 0.06))])
def test_a_drawing_of_which_nobody_says_how_well_it_is_known_is_refused(tray, body):
    _, log, tare, panda = tray
    with pytest.raises(IdentificationError, match="how well it is known"):
        identify(log, panda, tare=tare, body=body)


@pytest.mark.parametrize(
    "family", ["nothing", "anything", "tool and payload", "spoons", "", ["wide", "nothing"], ("wide", 3), b"wide", 3]
)
def test_python_too_refuses_a_family_that_nobody_may_know(panda, family):
    with pytest.raises(IdentificationError, match="expected some of boxes, shapes, tools, container, wide, light"):
        identify("run.csv", panda, family=family)


@pytest.mark.parametrize("family", ["wide, boxes", ["wide", "boxes"], ("wide", "boxes")])
def test_families_are_known_as_one_text_or_one_by_one(panda, family):
    known = Basis(family=family).known(panda)
    assert known is not None
    assert known.families == ("wide", "boxes")


@pytest.mark.full  # some seconds
def test_a_family_is_believed_until_the_log_denies_it(tray):
    held, log, tare, panda = tray
    families = (), "wide", ("container", "tools")
    plain, wide, denied = (identify(log, panda, tare=tare, family=family) for family in families)
    assert not any("is none of" in note for note in (*plain.notes, *wide.notes))
    assert inside(wide.phi_low, held, wide.phi_high)
    assert np.abs(wide.phi - plain.phi)[4:].max() > 1e-6
    assert "is none of container, tools" in " ".join(denied.notes)
    assert denied.interval == "approximate"
    assert denied.phi == pytest.approx(plain.phi, abs=1e-9)


@pytest.mark.parametrize("family", ["container", "light"])
@pytest.mark.full  # some seconds
def test_a_family_that_the_log_denies_says_nothing_of_what_is_undetermined_either(tray, family):
    _, log, tare, panda = tray
    plain, denied = identify(log, panda, tare=tare), identify(log, panda, tare=tare, family=family)
    assert f"is none of {family}" in denied.notes[0]
    assert denied.held
    np.testing.assert_array_equal(denied.determined, plain.determined)
    np.testing.assert_allclose(denied.phi_low, plain.phi_low, atol=1e-9)
    np.testing.assert_allclose(denied.phi_high, plain.phi_high, atol=1e-9)
    ends = []
    for known in (None, Known(families=(family,), if_held=True)):
        stream = OnlineIdentifier(panda, tare, known=known)
        for sample in log.select(np.arange(len(log)) < 400):
            last = stream.update(*sample)
        stream.close()
        ends.append(last)
    assert f"is none of {family}" in " ".join(ends[1].notes)
    np.testing.assert_array_equal(ends[1].determined, ends[0].determined)
    np.testing.assert_allclose(ends[1].low, ends[0].low, atol=1e-9)


def test_a_drawing_determines_only_what_it_says(tray):
    """An inertia that it leaves open by three times its size is determined by a log that tells it, or not at all."""
    held, log, _, panda = tray
    short = log.between(0.0, 1.0)
    open_ended = Payload("tray", held, uncertainty=Uncertainty(0.01, 2e-3, 3.0))
    alone, vague = identify(short, panda), identify(short, panda, body=open_ended)
    exact = identify(short, panda, body=Payload("tray", held, uncertainty=STATED))
    assert not alone.determined[4:].all()
    assert vague.determined[:4].all()
    assert not vague.determined[4:].all()
    assert inside(vague.phi_low, held, vague.phi_high)
    assert exact.determined.all()


def test_of_a_kind_that_was_given_nobody_is_sent_to_another_method(tray):
    _, log, tare, panda = tray
    notes = " ".join(identify(log, panda, tare=tare, family="wide").notes)
    assert "of the kind given (wide)" in notes
    assert "map-gp instead" not in notes


def test_a_family_is_for_a_method_that_has_learned_of_it(tray):
    _, log, tare, panda = tray
    with pytest.raises(IdentificationError, match="map-gp has learned of no families"):
        identify(log, panda, tare=tare, family="wide", method="map-gp")
    prior = HybridIdentifier(panda).model.prior
    with pytest.raises(ModelError, match="no family is called spoons: expected some of"):
        prior.split("spoons")
    with pytest.raises(ModelError, match="all families are named"):
        prior.split(*prior.families)


def test_a_stream_knows_a_drawing_and_a_family_while_something_is_held_and_goes_on_from_its_file(tray, tmp_path):
    held, log, tare, panda = tray
    covariance = STATED.covariance(held)
    known = Known(body=KnownBody(held.phi, covariance), families=("wide",), if_held=True)
    stream, half = OnlineIdentifier(panda, tare, known=known), len(log) // 2
    for sample in log.select(np.arange(len(log)) < half):
        stream.update(*sample)
    stream.save(tmp_path / "state.npz")
    again, ends = OnlineIdentifier.restore(tmp_path / "state.npz", panda, known=known), []
    for each in (stream, again):
        for sample in log.select(np.arange(len(log)) >= half):
            last = each.update(*sample)
        each.close()
        ends.append(last)
    assert inside(ends[0].low, held, ends[0].high)
    assert ends[0].determined.all()
    np.testing.assert_array_equal(ends[0].phi, ends[1].phi)
    empty = OnlineIdentifier(panda, tare, known=known)
    for sample in simulate(panda, taie2024(), None, rate=200.0, seed=5).between(0.0, 1.0):
        last = empty.update(*sample)
    empty.close()
    assert not last.held
    assert abs(last.phi[0]) < 0.1


def test_the_command_line_knows_drawings_and_families(tray, tmp_path, capsys):
    held, log, tare, _ = tray
    run, empty, body = (tmp_path / name for name in ("run.csv", "empty.csv", "tray.json"))
    write_recording(run, log)
    write_recording(empty, tare)
    write_payload(body, Payload("tray", InertialParameters(held.phi, "panda_link8"), uncertainty=STATED))
    about = [str(run), "--robot", "panda", "--tare", str(empty)]
    assert main(["identify", *about, "--body", str(body), "--family", "wide", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert inside(answer["phi_low"], held, answer["phi_high"])
    assert all(answer["determined"])
    assert main(["identify", *about, "--family", "spoons", "--json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "no family is called spoons" in err
    more = ["--speed", "max", "--headless", "--body", str(body), "--family", "wide"]
    assert main(["live", *about, *more]) == 0
    assert all(json.loads(capsys.readouterr().out.splitlines()[-1])["determined"])


def test_on_a_stream_nothing_is_claimed_of_an_empty_hand_nor_of_another_payload():
    mean, C = gaussian(5)
    known = Known(KnownMass(1.2, 2e-3), KnownCentre(COM, 3e-3), if_held=True)
    assert known.given(mean, C) is not None
    assert known.given(np.zeros(10), C) is None  # nothing
    assert known.given(np.zeros(10), 100.0 * C) is None  # nobody knows
    assert known.given(2.0 * mean, C) is None  # something else
    elsewhere = mean + np.r_[0.0, 0.1, np.zeros(8)]
    assert known.given(elsewhere, C) is None
    assert KnownMass in map(type, known.denied(2.0 * mean, C))
    assert list(map(type, known.denied(elsewhere, C))) == [KnownCentre]


@pytest.mark.full
def test_a_known_mass_makes_the_moments_better_and_their_intervals_narrower_and_they_hold():
    panda = arm("panda")
    better, inside = [], []
    for log in simulate_episodes(draw_episodes(panda, "untared", 8, seed=17, motions=6)):
        plain, weighed = HybridIdentifier(panda), HybridIdentifier(panda)
        weighed.known = Known(KnownMass(log.truth.mass, 1e-3))
        before, after = plain.run(log.run), weighed.run(log.run)
        assert abs(after.phi[0] - log.truth.mass) < 5e-3
        assert np.all(after.std <= before.std * (1 + 1e-9))
        better.append(np.abs(before.phi - log.truth.phi)[1:4].sum() - np.abs(after.phi - log.truth.phi)[1:4].sum())
        inside.append(np.abs(after.phi - log.truth.phi)[1:] <= Z95 * after.std[1:])
    assert np.mean(better) > 0.0
    assert np.mean(inside) > 0.85


@pytest.mark.full
def test_a_known_centre_makes_the_moments_better_and_their_intervals_narrower_and_they_hold():
    panda = arm("panda")
    narrower, better, inside = [], [], []
    for k, log in enumerate(simulate_episodes(draw_episodes(panda, "untared", 8, seed=18, motions=6))):
        r = log.truth.com + 2e-3 * np.random.default_rng(k).normal(size=3)
        before, after = identify(log.run, panda), identify(log.run, panda, com=(r, 2e-3))
        assert not any("is not what the log says" in note for note in after.notes)
        half = [0.5 * (x.phi_high - x.phi_low)[1:4] for x in (before, after)]
        narrower.append(half[1].mean() / half[0].mean())
        error = [np.abs(x.phi - log.truth.phi)[1:4].mean() for x in (before, after)]
        better.append(error[0] - error[1])
        inside.append((after.com_low <= log.truth.com) & (log.truth.com <= after.com_high))
        inside.append((after.phi_low <= log.truth.phi)[:3] & (log.truth.phi <= after.phi_high)[:3])
    assert np.median(narrower) < 0.8
    assert np.mean(better) > 0.0
    assert np.mean(inside) > 0.85


@pytest.mark.parametrize(
    ("mass", "std"), [(np.nan, 0.1), (1.0, 0.0), (1.0, -1.0), (np.inf, 1.0), (0.0, 0.1), (-1.0, 0.1)]
)
def test_a_mass_that_is_none_is_refused(mass, std):
    with pytest.raises(IdentificationError, match="expected a number and a standard deviation above zero"):
        KnownMass(mass, std)


@pytest.mark.parametrize(
    ("com", "std", "said"),
    [
        ((0.0, np.nan, 0.0), 1e-3, "expected three numbers"),
        ((0.0, 0.0), 1e-3, "expected three numbers"),
        (COM, 0.0, "above zero"),
        ((20.0, -20.0, 80.0), 2.0, "is it in millimetres"),
    ],
)
def test_a_centre_that_is_none_is_refused(com, std, said):
    with pytest.raises(IdentificationError, match=said):
        KnownCentre(com, std)


def test_a_centre_is_read_as_it_is_typed():
    assert centre("0.02,-0.02,0.08±0.002") == (COM, 0.002)
    assert centre("-1e-2,0,0.08+-0.01") == ((-0.01, 0.0, 0.08), 0.01)


@pytest.mark.parametrize(
    ("mass", "com"),
    [(1.5, None), ((1.5,), None), (("heavy", 0.1), None), (None, (0.0, 0.0, 0.1)), (None, (COM, (0.1, 0.1, 0.1)))],
)
def test_what_is_known_in_another_form_is_refused_in_a_sentence(mass, com):
    with pytest.raises(IdentificationError, match="expected two things"):
        Known.of(mass, com)


def test_a_body_whose_inertia_is_zero_is_asked_for_it(panda):
    point = InertialParameters.from_com(0.6, COM, np.zeros((3, 3)), "panda_link8")
    body = Payload("point", point, uncertainty=Uncertainty(0.01, 0.002, 0.1))
    with pytest.raises(IdentificationError, match=r"body point .* expected its inertia"):
        known_of(panda, None, None, body)

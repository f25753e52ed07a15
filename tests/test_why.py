"""The two studies behind docs/why.md: their person pushes as springs do, and the page says what was measured."""

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from armload.motion import random_motion

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "why.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module", params=["closed_loop", "hand_guided"])
def study(request):
    """What a script of benchmarks/ studies, and what it measured."""
    script = script_of(request.param)
    return script.STUDY, json.loads(script.STUDY.result.read_text(encoding="utf-8"))


def script_of(name):
    folder = str(ROOT / "benchmarks")
    sys.path.insert(0, folder)
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(folder)


# ---------------------------------------------------------------- results and page


def test_the_summary_is_that_of_the_rows(study):
    study, result = study
    written, again = result["summary_mean_and_standard_deviation"], study.summarise(result["rows"])
    assert len(written) == len(again) > 0
    for old, new in zip(written, again, strict=True):
        assert old.keys() == new.keys()
        for key, value in new.items():
            assert old[key] == (value if isinstance(value, str) else pytest.approx(value)), key


def test_the_page_shows_the_table_the_figure_and_the_command(study):
    study, result = study
    assert study.table(result["summary_mean_and_standard_deviation"]) in PAGE
    assert study.command in PAGE
    assert result["command"].startswith(study.command)
    assert f"({study.figure.relative_to(ROOT / 'docs')})" in PAGE
    assert study.figure.stat().st_size < 120_000


# ---------------------------------------------------------------- the person


def person_of(panda, rounds=2):
    script = script_of("hand_guided")
    schedule = script.Schedule(rounds)
    path = random_motion(panda, 3, duration=rounds * script.GUIDED, harmonics=3).scaled(script.CALMER)
    return script, schedule, path, script.Person(panda, path, schedule, 3)


def test_hands_push_as_the_gradient_of_their_springs_energy(panda):
    script, _, path, person = person_of(panda)
    t = 0.3 + script.GUIDED + script.HELD  # the second round: firm, and the path moves
    k = round((t + script.SETTLE) / 1e-3)
    person._speed = (np.zeros_like(person._flange), np.zeros_like(person._flange))  # springs alone
    q = path.position([2.0])[0] + 0.05 * np.sin(np.arange(7.0))

    def energy(q):
        (R,), (p,) = panda.frame_pose(q[None])
        elbow = person._elbow.frame_pose(q[None, : person._elbow.n])[1][0]
        turned = 0.5 * (np.trace(R.T @ person._turn[k]) - 1.0)  # cosine of the angle between
        away = np.sum((p - person._flange[k]) ** 2) + np.sum((elbow - person._at_elbow[k]) ** 2)
        return 0.5 * script.STIFFNESS * away + script.TURNING * (1.0 - turned)

    gradient = [(energy(q + 1e-5 * e) - energy(q - 1e-5 * e)) / 2e-5 for e in np.eye(7)]
    torque = person._push(t, k, q, np.zeros(7))
    assert person._grip[k] == 1.0
    assert np.abs(torque).max() > 5.0
    np.testing.assert_allclose(torque, -np.array(gradient), atol=1e-5)


def test_hands_brake_what_moves_away_from_them(panda):
    script, _, path, person = person_of(panda)
    q, k = path.position([1.0])[0], round((1.0 + script.SETTLE) / 1e-3)
    for dq in np.random.default_rng(0).normal(size=(5, 7)):
        assert (person._push(1.0, k, q, dq) - person._push(1.0, k, q, np.zeros(7))) @ dq < 0.0


def test_nobody_touches_in_what_counts_as_a_pause(panda):
    script, schedule, path, person = person_of(panda)
    t = np.arange(0.0, schedule.duration - 1e-9, 0.01)
    pause = schedule.untouched(t)
    assert 0.1 < pause.mean() < 0.4
    assert not np.any(schedule.guided(t) & pause)
    for at in t[pause]:
        k = round((at + script.SETTLE) / 1e-3)
        assert not np.any(person._push(at, k, path.position([at])[0] + 0.3, np.ones(7)))


def test_a_leading_hand_does_its_push_s_work_at_the_flange(panda):
    """Power in the joints equals force times speed of the flange, by differences of the pose."""
    script, _, path, _ = person_of(panda)
    hand, t = script.Leader(panda, path, 1), 2.0
    (q,), (dq,), _ = path([t])
    ahead, behind = panda.frame_pose(np.array([q + 1e-6 * dq, q - 1e-6 * dq]))[1]
    force = hand.push[round((t + script.SETTLE) / 1e-3)]
    assert np.linalg.norm(force) > 1.0
    assert hand(t, q, dq) @ dq == pytest.approx(force @ (ahead - behind) / 2e-6, rel=1e-5)


def test_the_path_is_walked_once_and_rests_in_the_pauses(panda):
    _, schedule, _, _ = person_of(panda)
    t = np.arange(0.0, schedule.duration + 1e-9, 0.01)
    way = schedule.way(t)
    assert way[0] == 0.0
    assert way[-1] == pytest.approx(1.0)
    assert np.all(np.diff(way) >= 0.0)
    resting = ~schedule.guided(t)
    assert np.all(np.diff(way)[resting[:-1] & resting[1:]] == 0.0)


def test_what_the_page_says_of_the_largest_residuals_and_of_the_leading_hand_was_measured():
    rows, words = (
        (
            json.loads(script_of(name).STUDY.result.read_text(encoding="utf-8"))["rows"]
            for name in ("closed_loop", "hand_guided")
        ),
        " ".join(PAGE.split()),
    )
    controlled, guided = rows
    largest = {
        key: [row["residual_max_Nm"] for row in controlled if (row["payload"], row["declared"]) == key]
        for key in (("1.5 kg", "nothing"), ("2.8 kg", "nothing"))
    }
    assert min(largest["1.5 kg", "nothing"]) < 10.0 < max(largest["1.5 kg", "nothing"]) < 20.0
    heavy = largest["2.8 kg", "nothing"]
    assert f"it probably does ({min(heavy):.0f} to {max(heavy):.0f} N·m)" in words
    after = max(row["residual_max_Nm"] for row in controlled if row["declared"] == "identified")
    assert f"no run exceeded {after:.1f} N·m" in words
    led = [row for row in guided if (row["log"], row["method"]) == ("led", "hybrid")]
    most = max(row["mass_error_kg"] for row in led)
    assert f"costs the hybrid up to {most:.2f} kg, a third of the lightest payload" in words
    assert most / min(row["true_mass_kg"] for row in led) == pytest.approx(1 / 3, abs=0.02)
    assert (sum(row["mass_covered"] for row in led), len(led)) == (5, 6)

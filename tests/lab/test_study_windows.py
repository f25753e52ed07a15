"""Windows of any motion and arm: what is in them, what their simplest physics finds, and what is judged."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from armload import arm
from armload.motion import random_motion
from armload.payloads import draw_payload
from armload.simulation import World, simulate_inverse

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def data(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module("study_windows_data")


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module("study_windows")


def logs(world=None):
    robot, payload = arm("panda"), draw_payload("boxes", 3)
    common = {"world": world, "rate": 50.0, "duration": 6.0, "tracking": 0.0}
    log = simulate_inverse(robot, random_motion(robot, 1), [(0.0, payload)], **common)
    return log, simulate_inverse(robot, random_motion(robot, 2), **common), payload.parameters.phi


def test_on_an_arm_as_its_model_says_the_ridge_regression_finds_the_payload(data):
    (log, tare, phi) = logs()
    answers = data.seen([(log, tare, phi)]).ridge[0].astype(float)
    scale = np.array([0.05] + [5e-3] * 3 + [5e-3] * 6)  # [kg, kg·m, kg·m²] a fortieth of what the prior leaves
    assert np.all(np.abs(answers[:, :10] - phi) < scale)
    assert np.all(answers[1, 10:20] <= answers[0, 10:20])  # a tare tells more


def test_a_fit_of_the_tare_takes_much_of_the_arm_off_the_residual(data):
    robot = arm("panda")
    common = {"world": World.real_like(robot, 5), "rate": 50.0, "duration": 6.0}
    bare, tare = (simulate_inverse(robot, random_motion(robot, k), **common) for k in (3, 4))
    windows = data.seen([(bare, tare, np.zeros(10))])  # nothing is held: all of the residual is the arm's
    with_tare, without = (np.sqrt(np.mean(np.square(r))) for r in (windows.r_tared, windows.r))
    assert with_tare < 0.7 * without  # of another motion


def test_an_input_holds_the_channels_that_it_is_named_after(data):
    windows = data.seen([logs()])
    log = logs()[0]
    first = np.mean(log.tau[:10], axis=0)
    for tare, raw in zip(data.TARES, (28, 56), strict=True):
        shapes = {what: data.channels(windows, what, tare).shape for what in data.INPUTS}
        assert shapes == {"raw": (1, 30, raw), "residual": (1, 30, 28), "rows": (1, 30, 77)}
    np.testing.assert_allclose(data.channels(windows, "raw", "no tare")[0, 0, 21:], first, rtol=1e-5, atol=1e-5)
    W = data.channels(windows, "rows", "no tare")[0, :, 7:].reshape(30, 7, 10)
    r = data.channels(windows, "rows", "no tare")[0, :, :7]
    np.testing.assert_allclose(W @ logs()[2], r, atol=0.02 * np.abs(r).max())  # r = W·phi on an exact arm


def test_training_and_judged_runs_share_no_payload_motion_or_arm(data):
    found = [data.judged_runs(worlds, 1) for worlds in ("real_like", "beyond")]
    drawn = [run for loaded, bare, _ in found for run in (*loaded, *bare)]
    assert min(run.seed for run in drawn) >= 900_000_000
    assert all(run.world.seed >= 900_000_000 for run in drawn)
    assert {run.world.name for run in drawn} == {"real-like", "beyond"}


def test_every_cell_has_its_own_name_and_another_size_of_training_changes_learners_only(script, tmp_path):
    small, large = ({t.name: t.keys[t.name] for t in script.tasks(tmp_path, n)} for n in (4, 6))
    assert len(small) == len(script.tasks(tmp_path, 4))
    same = {name for name in small if large.get(name) == small[name]}
    assert {name for name in small if name.startswith(("judged", "shard"))} == same


def test_the_page_shows_the_committed_cells_and_says_what_they_say(written):
    page, text, result = written("study_windows_page", "learning.md", "study_windows")
    cells = result["cells"]
    assert page.table(cells) in text
    assert page.gained(cells) in text
    words = " ".join(text.split())
    mass = {
        key: {
            worlds: (errors[worlds][:, 0].mean(), errors[worlds][:, 0].std(ddof=1) / np.sqrt(len(errors[worlds])))
            for worlds in errors
        }
        for key, (errors, _) in page.learners(cells).items()
        if key[1] != page.ON_TOP
    }
    whole = {key: found for key, found in mass.items() if key[3] == 2000}
    for worlds, kind, said in (
        ("real_like", "conv", "on new arms (convolution)"),
        ("beyond", "gru", "beyond them (GRU)"),
    ):
        best = min(whole, key=lambda key: whole[key][worlds][0])
        assert best[0] == kind
        assert "{:.0f} ± {:.0f} g {}".format(*whole[best][worlds], said) in words
    without, tare, raw = (
        [
            found["beyond"][0]
            for (_, seen, given, *_), found in whole.items()
            if (seen == "raw") is is_raw and given == told
        ]
        for is_raw, told in ((False, "no tare"), (False, "with tare"), (True, "with tare"))
    )
    assert f"from {min(without):.0f}–{max(without):.0f} to {min(tare):.0f}–{max(tare):.0f} g" in words
    assert f"raw signals stay at {min(raw):.0f}–{max(raw):.0f}" in words
    more = [mass["conv", "residual", "with tare", count, 0]["real_like"][0] for count in (500, 1000, 2000)]
    assert "{:.0f}, {:.0f} and {:.0f} g with 500, 1000 and 2000".format(*more) in words

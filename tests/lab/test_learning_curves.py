"""The parts of the learning curves: what a training holds, what is never seen by it, and what a row is."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from armload import InertialParameters, arm
from armload.payloads import draw_payload, random_payload

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def curves(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module("learning_curves")


def test_a_training_holds_as_many_payloads_as_it_says_and_repeats_them(curves):
    phi = np.array([curves.training_log(k, (3, 1, 1), 0)[1] for k in range(7)])
    assert len(np.unique(phi, axis=0)) == 3
    np.testing.assert_array_equal(phi[:3], phi[3:6])
    np.testing.assert_array_equal(phi[1], random_payload(1).parameters.phi)


def test_only_what_is_counted_changes_from_log_to_log(curves):
    (one, _), (other, _) = (curves.training_log(k, (1, 1, 2), 0) for k in (0, 1))
    (same, _), (moved, _) = (curves.training_log(k, (1, 2, 1), 0) for k in (0, 1))
    assert np.abs(one.q - other.q).max() < 0.01 < np.abs(same.q - moved.q).max()
    assert np.abs(one.tau - other.tau).mean() > 0.1  # another arm, which differs from its model in its own way


def test_a_log_is_the_inverse_dynamics_of_its_payload_but_for_the_arm_s_own_residual(curves):
    log, phi = curves.training_log(0, (5, 1, 1), 0)
    robot = arm("panda")
    ddq = np.gradient(log.dq, log.t, axis=0)
    bare, loaded = (
        np.abs(log.tau - a.torque(log.q, log.dq, ddq)).mean()
        for a in (robot, robot.with_payload(InertialParameters(phi)))
    )
    assert loaded < 0.7 * bare


def test_no_payload_that_is_judged_was_trained_on(curves, monkeypatch):
    monkeypatch.setattr(curves, "RUNS", 2)
    curves.judged.cache_clear()
    truth = [phi for _, _, phi in curves.judged("payload", 0)]
    curves.judged.cache_clear()
    trained = np.array([draw_payload("boxes", k).parameters.phi for k in range(1000)])
    assert min(np.abs(trained - phi).max(axis=1).min() for phi in truth) > 0.0


def test_trainings_of_another_size_are_measured_anew_and_the_physics_beside_them_is_not(curves):
    small, large = ({task.name: task.keys[task.name] for task in curves.tasks(n, 2)} for n in (10, 20))
    assert len(small) == 1 + 2 * (len(curves.SETS) + len(curves.PLAN))
    changed = {name for name in small if small[name] != large[name]}
    assert changed == {name for name in small if name.startswith("trees")}
    assert len({small[name] for name in changed}) == len(changed)


def test_the_page_shows_the_committed_cells_and_says_what_they_say(written):
    page, text, *results = written("learning_page", "learning.md", "learning_curves", "learning_networks")
    cells = [cell for result in results for cell in result["cells"]]
    assert page.table(cells) in text
    words = " ".join(text.split())

    def of(method, where, name="mass"):
        errors = page.pooled([cell for cell in cells if cell.get("set") == where], method)
        return errors[:, 0].mean() if name == "mass" else errors[:, 1:4].mean()

    trees, networks = (page.trainings(cells, learner) for learner in ("trees", "networks"))
    ten = page.mass(page.pooled(trees[10_000, 10_000, 10_000], "arm"))
    assert "{:.0f} ± {:.0f} g at best, against {:.0f} and".format(*ten, of("map-gp", "arm")) in words
    assert f"and {of('hybrid, with tare', 'arm'):.0f}. Ten times the data cost" in words
    best = min(page.mass(page.pooled(same, "arm"))[0] for same in trees.values())
    assert best == ten[0]
    on_motions = {counts: page.mass(page.pooled(same, "motion")) for counts, same in trees.items()}
    found = on_motions.pop((10_000, 10_000, 10_000))
    first = [mass for mass, _ in on_motions.values()]
    mean, least = of("training mean", "motion"), of("map-gp", "motion")
    assert f"with 1000 logs {min(first):.0f} to {max(first):.0f} g (the training mean: {mean:.0f})" in words
    assert f"{found[0]:.0f} ± {found[1]:.0f} g, where least squares errs by {least:.0f} and" in words
    wide = page.mass(page.pooled(networks[1000, 1000, 1000], "motion"))
    assert f"{wide[0]:.0f} ± {wide[1]:.0f} g on new motions (trees {on_motions[1000, 1000, 1000][0]:.0f}" in words
    assert wide[0] / least == pytest.approx(7.0, abs=0.3)  # physics stays seven times nearer
    assert {len(same) for learner in (trees, networks) for same in learner.values()} == {2}  # two seeds of everything

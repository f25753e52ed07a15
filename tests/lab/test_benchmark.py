"""The benchmark: what takes part where, cells that are measured once, numbers with known answers, what is written."""

import json
from dataclasses import replace

import numpy as np
import pytest

from armload.app.cli import main
from armload.errors import ArmloadError, IdentificationError
from armload.estimators import Estimate, Identifier
from armload.identification import METHODS
from armload.lab import load_cells, save_cell
from armload.lab.benchmark import ALL, QUICK, Size, default_names, gather, left_out, run_benchmark, write_results
from armload.lab.benchmark.benchmark_results import summary_json
from armload.lab.benchmark.benchmark_run import cell_name, measure
from armload.lab.benchmark.benchmark_tables import AHEAD, group_table, losses_table, repeatability_table
from armload.lab.benchmark.front import front, table
from armload.lab.benchmark.populations import population, prior_of
from armload.lab.benchmark.rows import BASELINES, BOUND, Row, fingerprint, rows_for
from armload.lab.benchmark.targets import verdicts
from armload.lab.cells import finished_cell
from armload.lab.episodes import EpisodeLogs, Recipe, draw_episodes
from armload.lab.report.shown import GROUPS
from armload.regression import GaussianPrior

# ---------------------------------------------------------------------------- populations


def test_the_help_of_the_command_names_every_population(capsys):
    assert main(["benchmark", "--help"]) == 0
    listed = capsys.readouterr().out.split("Populations: ")[1].split(".")[0]
    assert listed.replace("\n", " ").split(", ") == list(ALL)


def test_the_repeated_payload_is_on_one_arm_and_everything_else_changes(panda):
    first, second = population("repeat").episodes(panda, 3, 2)
    assert first.payload is second.payload
    assert first.world is second.world
    assert first.seed != second.seed
    t = np.linspace(0.0, 6.0, 7)
    assert not np.allclose(first.motion(t)[0], second.motion(t)[0])
    assert first.tare_motion is not None
    assert second.tare_motion is not None
    assert not np.allclose(first.tare_motion(t)[0], second.tare_motion(t)[0])


@pytest.mark.parametrize(
    ("recipe", "mass"),
    [
        (Recipe(), 1.5),  # uniform from 0.2 to 2.8 kg
        # a tool of 0.2 to 1.8 kg, drawn for 0.6 of the rating, takes from what is left of it
        pytest.param(Recipe(tool=1.0), 1.5 * (1.0 - 0.6 * 1.0 / 3.0), marks=pytest.mark.full),
        (Recipe(tool=1.0, untared=1.0), 1.5 * (1.0 - 0.6 * 1.0 / 3.0) + 0.6 * 1.0),
    ],
)
def test_the_baselines_know_the_payloads_that_are_to_be_found(panda, recipe, mass):
    prior = prior_of(recipe, panda)
    assert prior.mean[0] == pytest.approx(mass, abs=4.0 * prior.std[0] / np.sqrt(400))


@pytest.mark.full  # some seconds
def test_the_baselines_know_no_payload_of_an_episode_but_its_family(panda):
    truths = [episode.truth.phi for episode in draw_episodes(panda, "container", 10, 900_001, motions=1)]
    prior = prior_of(ALL["container"].recipe, panda)
    score = (np.array(truths) - prior.mean) / prior.std
    assert np.abs(score.mean(axis=0)).max() < 4.0 / np.sqrt(10)


# ---------------------------------------------------------------------------- rows


def test_every_method_that_needs_only_logs_takes_part_unless_it_is_slow():
    names = {name.removesuffix("+tare") for name in default_names()}
    assert {name for name, method in METHODS.items() if method.needs in ("training", "motion")} == set(left_out())
    assert set(METHODS) - names - set(left_out()) == {"ekf", "lmi", "log-cholesky", "polynomial"}


@pytest.mark.parametrize("name", ALL)
def test_a_method_runs_where_its_tare_is_and_the_baselines_everywhere(name):
    of, rows = ALL[name], [row.name for row in rows_for(ALL[name], default_names())]
    assert rows[-3:] == [*BASELINES, BOUND]
    assert len(set(rows)) == len(rows)
    assert ("difference" in rows) == (name == "same-motion")
    assert ("joint" in rows) == of.has_tare
    assert ("wls+tare" in rows, "wls" in rows) == (of.has_tare, not of.has_tare)
    assert {"map", "rls", "rls-filter"} <= set(rows)


@pytest.mark.parametrize(
    ("name", "says"), [("rls_filter", "rls-filter"), ("tree", "trained"), ("map+tare", "no calibration")]
)
def test_a_row_that_cannot_be_is_refused_with_the_reason(name, says):
    with pytest.raises(IdentificationError, match=says):
        Size(methods=(name,))


def test_the_fingerprint_of_a_row_knows_its_answers(panda):
    known, other = prior_of(ALL["reference"].recipe, panda), prior_of(ALL["container"].recipe, panda)
    plain, tared = Row("rls-filter", "rls-filter", False), Row("rls-filter+tare", "rls-filter", True)
    mean = Row("training mean", "", True)
    assert fingerprint(plain, panda, known) == fingerprint(plain, panda, other)
    assert fingerprint(plain, panda, known) != fingerprint(tared, panda, known)
    assert fingerprint(mean, panda, known) != fingerprint(mean, panda, other)


# ---------------------------------------------------------------------------- measuring


class Says(Identifier):
    """The same at every sample, or nothing."""

    name = "says"

    def __init__(self, arm, phi):
        self.arm, self.phi = arm, phi

    def reset(self):
        self.count = 0

    def _take(self, t, *_):
        self.count += len(t)

    def _estimate(self, t):
        if self.phi is None:
            raise IdentificationError("this log says nothing")
        return Estimate(t, self.phi, np.eye(10), self.count, str(self.arm.frame))


class Teller(Row):
    """A row whose answer is given."""

    def make(self, arm, _, prior):
        return Says(arm, prior)


@pytest.fixture
def with_tool(panda, analytic_log):
    (episode,) = draw_episodes(panda, "tool", 1, 4)
    log = analytic_log(panda, duration=1.0, rate=50.0)
    return [episode], [EpisodeLogs(log, log, episode.truth)]


def test_who_does_not_see_the_tare_is_told_the_tool(with_tool):
    episodes, logs = with_tool
    payload, tool = episodes[0].payload.parameters.phi, episodes[0].tool.parameters.phi
    for tared, answer in ((True, payload), (False, payload + tool)):
        found = measure(Teller("x", "", tared), episodes, logs, answer, (0.1, 0.5))
        np.testing.assert_allclose(found["phi"], [[payload, payload]], rtol=0, atol=1e-6)
        np.testing.assert_allclose(found["truth"], [payload])


def test_a_refusal_counts_as_knowing_nothing(with_tool):
    episodes, logs = with_tool
    found = measure(Teller("x", "", True), episodes, logs, None, (0.1, 0.5))
    assert found["refused"] == ["this log says nothing"]
    assert found["phi"] == [[[0.0] * 10] * 2]
    assert found["std"] == [[[None] * 10] * 2]


# ---------------------------------------------------------------------------- numbers with known answers

SMALL = Size(populations=("reference",), methods=("hybrid", "map"), episodes=4, times=(0.1, 6.0), per_seed=2)
SIGNED = np.array([1.0, -2.0, 3.0, -6.0])  # errors of the hybrid in the four episodes, in units of ONE
ONE = 1e-3


def made(errors, row, name="reference", std=2.5, seeds=(900_001, 900_002)):
    """Cells of one row: errors (R,) the same for all parameters, at both times, doubled at the first."""
    cells = {}
    for seed, part in zip(seeds, np.array_split(np.asarray(errors), len(seeds)), strict=True):
        truth = np.tile(np.arange(1.0, 11.0), (len(part), 1))
        phi = truth[:, None] + ONE * part[:, None, None] * np.array([2.0, 1.0])[:, None]
        cells[cell_name(name, seed, row)] = {
            "name": cell_name(name, seed, row),
            "population": name,
            "seed": seed,
            "row": {"name": row, "method": row, "tared": True},
            "truth": truth.tolist(),
            "phi": phi.tolist(),
            "std": np.full(phi.shape, std * ONE).tolist(),
            "wall_s": [0.1] * len(part),
            "refused": [],
            "trained": "",
        }
    return cells


@pytest.fixture
def results():
    cells = made(SIGNED, "hybrid") | made(2.0 * SIGNED, "map") | made(SIGNED, "training mean")
    return gather(cells | made(0.0 * SIGNED, BOUND, std=1.5), SMALL)


def test_errors_their_uncertainty_and_their_spread_over_seeds(results):
    m = results["reference"]
    assert m.rows == ("hybrid", "map", "training mean")
    mean, deviation = np.abs(SIGNED).mean(), np.abs(SIGNED).std(ddof=1)
    np.testing.assert_allclose(m.absolute.mean(axis=1)[0, 1], ONE * mean)
    np.testing.assert_allclose(m.grouped.mean(axis=1)[1], ONE * mean * np.array([[4.0], [2.0]]) * np.ones(3))
    np.testing.assert_allclose(m.standard_error(m.absolute)[0, 1], ONE * deviation / 2.0)
    np.testing.assert_allclose(m.seed_spread(m.absolute)[0, 1], ONE * np.std([1.5, 4.5], ddof=1))


def test_intervals_hold_what_lies_within_1_96_standard_deviations(results):
    m = results["reference"]  # half-width 4.9: of 1, 2, 3, 6 three lie inside, of twice that two
    np.testing.assert_allclose(m.half_width[0], 1.959964 * 2.5 * ONE)
    np.testing.assert_allclose(m.coverage[0], [[0.5] * 10, [0.75] * 10])


def test_efficiency_is_the_bound_over_the_root_mean_square(results):
    m = results["reference"]
    np.testing.assert_allclose(m.efficiency[0, 1], 1.5 / np.sqrt(np.mean(SIGNED**2)))


def test_two_methods_are_compared_episode_by_episode(results):
    m = results["reference"]
    mean, error = m.paired("hybrid", "map")
    np.testing.assert_allclose(mean[1], -ONE * np.abs(SIGNED).mean())
    np.testing.assert_allclose(error[1], ONE * np.abs(SIGNED).std(ddof=1) / 2.0)
    np.testing.assert_allclose(m.paired("hybrid", "map", 0.5)[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(m.ratio("hybrid", "map"), 0.5)


def test_repeatability_is_the_spread_within_a_seed_and_no_bias():
    cells = made(10.0 + SIGNED, "hybrid", "repeat")
    m = gather(cells, Size(populations=("repeat",), times=(0.1, 6.0)))["repeat"]
    expected = ONE * np.sqrt(np.mean([np.var([1.0, -2.0], ddof=1), np.var([3.0, -6.0], ddof=1)]))
    np.testing.assert_allclose(m.repeatability[0, 1], expected)
    assert repeatability_table(m, (6.0,)).rows[0][2:] == (f"{1e3 * expected:.3g}",) * 10


def test_who_is_ahead_of_the_hybrid_is_marked_and_listed():
    rng = np.random.default_rng(0)
    errors = rng.uniform(3.0, 4.0, 40)
    cells = made(errors, "hybrid") | made(0.5 * errors, "map") | made(errors + 1e-9, "training mean")
    results = gather(cells, SMALL)
    rows = {row[0]: row[1] for row in group_table(results, "mass", 6.0).rows}
    assert AHEAD in rows["map"]
    assert AHEAD not in rows["hybrid"] + rows["training mean"]
    assert [row[-1] for row in losses_table(results).rows] == ["map"] * 2 * len(GROUPS)


def test_the_first_page_says_where_the_hybrid_loses_and_which_targets_it_missed():
    errors = np.random.default_rng(2).uniform(3.0, 4.0, 40)
    cells = made(errors, "hybrid") | made(0.5 * errors, "map-gp") | made(2.0 * errors, "training mean")
    summary = json.loads(json.dumps(summary_json(gather(cells, SMALL), SMALL)))
    text = {section.title: section.text for section in front(summary, "p.png", "all.md")}
    mean = errors.mean()
    assert "on 1 populations: 6 cells. In 6 cells another row is ahead" in text["Where hybrid loses"]
    for title, cell in (("Up to 0.1 s: 3 cells", 2 * mean), ("Later: 3 cells", mean)):
        assert f"- {title} (mass 1, first moment 1, inertia 1). Ahead in them: map-gp 3." in text["Where hybrid loses"]
        assert f"{cell:.1f} g against {cell / 2:.1f} g" in text["Where hybrid loses"]
    assert "hybrid at most map-gp: mass on `reference` after 6 s, 2.00 times" in text["Targets"]
    (row,) = table(summary).rows
    assert row[5] == f"{mean:.1f} ± {errors.std(ddof=1) / np.sqrt(40):.1f}"  # the hybrid's mass after 6 s
    assert (row[1], row[7], row[8]) == ("–", "–", "50")  # 1 s and rls-filter are not measured; 4.9 holds the last time


def test_where_nothing_that_is_judged_was_measured_the_tables_say_so_and_name_nobody(tmp_path):
    errors = np.random.default_rng(3).uniform(3.0, 4.0, 40)
    cells = made(errors, "ols") | made(0.5 * errors, "rls-filter") | made(2.0 * errors, "training mean")
    assert "none of hybrid, map-gp, map was measured" in losses_table(gather(cells, SMALL)).note
    written = write_results(cells, SMALL, tmp_path / "s.json", tmp_path / "p.md", tmp_path / "r.html")
    pages = [path.read_text(encoding="utf-8") for path in written.values() if path.suffix == ".md"]
    assert len(pages) == 2
    assert not any("None" in page for page in pages)


def test_a_target_is_reached_missed_or_not_clear():
    errors = np.random.default_rng(1).uniform(3.0, 4.0, 40)
    small = gather(made(errors, "hybrid") | made(1.1 * errors, "map-gp"), SMALL)
    large = gather(made(errors, "hybrid") | made(0.5 * errors, "map-gp"), SMALL)
    assert {v["verdict"] for v in verdicts(small)} == {"reached"}
    assert {v["verdict"] for v in verdicts(large)} == {"missed"}
    noisy = np.tile([1.0, -1.0], 20) * 0.5
    unclear = gather(made(errors, "hybrid") | made(errors - 0.01 + noisy, "map-gp"), SMALL)
    assert "not clear" in {v["verdict"] for v in verdicts(unclear) if v["target"] == "hybrid at most map-gp"}


def test_a_row_that_is_not_finished_is_left_out_and_named():
    cells = made(SIGNED, "hybrid") | made(SIGNED[:2], "map", seeds=(900_001,))
    m = gather(cells, SMALL)["reference"]
    assert (m.rows, m.unfinished, m.runs) == (("hybrid",), ("map",), 4)


# ---------------------------------------------------------------------------- the run

ASKED = ["benchmark", "--quick", "--populations", "untared", "--episodes", "3"]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A quick benchmark of one method, through the command line."""
    folder = tmp_path_factory.mktemp("benchmark")
    assert main([*ASKED, "--methods", "rls-filter", "--out", str(folder)]) == 0
    return folder


@pytest.mark.full  # some seconds
def test_what_is_measured_is_not_measured_again_and_a_further_method_is_all_that_is_left(finished, capsys):
    before = {path.name: path.stat().st_mtime_ns for path in (finished / "cells").iterdir()}
    assert len(before) == 2 * 4  # two seeds; the method, two baselines, the bound
    assert main([*ASKED, "--methods", "rls-filter,wls", "--out", str(finished)]) == 0
    text = capsys.readouterr().err
    assert "part 2 of 2: untared, seed 900002, 1 row" in text
    after = {path.name: path.stat().st_mtime_ns for path in (finished / "cells").iterdir()}
    assert set(after) - set(before) == {"untared-900001-wls.json", "untared-900002-wls.json"}
    assert all(after[name] == at for name, at in before.items())


@pytest.mark.full
def test_a_cell_counts_only_with_its_key(finished):
    cell = load_cells(finished / "cells")["untared-900001-rls-filter"]
    assert finished_cell(finished / "cells", cell["name"], cell["key"]) == cell
    assert finished_cell(finished / "cells", cell["name"], "another") is None
    assert finished_cell(finished / "cells", "untared-900009-rls-filter", cell["key"]) is None


@pytest.mark.full  # some seconds
def test_a_longer_run_keeps_the_episodes_of_the_shorter(finished):
    short = load_cells(finished / "cells")["untared-900001-rls-filter"]
    assert np.shape(short["phi"]) == (2, 6, 10)
    last = load_cells(finished / "cells")["untared-900002-rls-filter"]
    assert np.shape(last["phi"]) == (1, 6, 10)
    assert short["phi"] != last["phi"]


@pytest.mark.full  # some seconds
def test_the_files_say_the_same_as_the_cells(finished):
    cell = load_cells(finished / "cells")
    errors = np.abs(
        np.concatenate(
            [np.array(c["phi"])[:, -1] - np.array(c["truth"]) for n, c in cell.items() if n.endswith("rls-filter")]
        )
    )
    summary = json.loads((finished / "benchmark.json").read_text("utf-8"))
    found = summary["populations"]["untared"]
    assert found["episodes"] == 3
    np.testing.assert_allclose(found["methods"]["rls-filter"]["mae"][-1], errors.mean(axis=0), rtol=1e-3)
    page, tables, report = (
        (finished / name).read_text("utf-8") for name in ("benchmark.md", "benchmark_tables.md", "report.html")
    )
    assert f"{1e3 * errors[:, 0].mean():.3g} ±" in tables.replace(".0 ±", " ±")
    assert "training mean" in tables
    assert "same-prior least squares" in tables
    assert f"| {1e3 * errors[:, 0].mean():.0f} ±" in page  # rls-filter at the last time
    assert "(pictures/benchmark.png)" in page
    assert (finished / "pictures" / "benchmark.png").read_bytes().startswith(b"\x89PNG")
    assert report.count("data:image/svg") == 3
    assert "<script" not in report


def test_nothing_finished_is_nothing_written(tmp_path):
    size = replace(QUICK, populations=("untared",), methods=("rls-filter",))
    cells = run_benchmark(size, tmp_path / "cells", until=-1.0)
    assert cells == {}
    with pytest.raises(ArmloadError, match="nothing is measured"):
        write_results(cells, size, tmp_path / "a.json", tmp_path / "a.md", tmp_path / "a.html")
    assert not (tmp_path / "a.json").exists()


def test_cells_of_another_experiment_or_version_in_the_folder_are_passed_over(tmp_path):
    save_cell(tmp_path, {"name": "tree-1stage-raw-row-ideal-s0", "key": "of the study", "spec": {}})
    save_cell(tmp_path, {"name": "no key"})
    of_before = {"population": "untared", "seed": 1, "row": {"name": "rls", "method": "rls", "tared": False, "more": 1}}
    save_cell(tmp_path, {"name": "untared-1-rls", "key": "of another version", **of_before})
    size = replace(QUICK, populations=("untared",), methods=("rls-filter",))
    assert run_benchmark(size, tmp_path, until=-1.0) == {}


def test_the_prior_is_the_same_every_time(panda):
    first, second = (prior_of.__wrapped__(ALL["shapes"].recipe, panda) for _ in range(2))
    assert isinstance(first, GaussianPrior)
    np.testing.assert_array_equal(first.covariance, second.covariance)

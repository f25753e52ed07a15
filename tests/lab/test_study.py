"""The study's machinery: cells that are measured once, protocols with known errors, a quick run that resumes."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from armload.app.cli import main
from armload.errors import DatasetError
from armload.estimators import Estimate, Identifier
from armload.inertia import InertialParameters
from armload.lab import load_cells, save_cell
from armload.lab.evaluation import EvaluationRun
from armload.lab.study import FULL, QUICK, Basis, Size, Spec, plan, run_study, study_run, write_results
from armload.lab.study.claims import VERDICTS, evaluate
from armload.lab.study.protocols import measure_learned, measure_stream
from armload.lab.study.readings import reading_specs
from armload.lab.study.rivals import rivals
from armload.lab.study.study_page import pages, summary_json, write_pages
from armload.lab.study.study_tables import LEAST_SQUARES
from armload.recording import Recording, write_recording

ROOT = Path(__file__).resolve().parents[2]
# every cell of the plan, each as cheap as can be
SMALL = Size(every=26, rows=12, worlds=2, payloads=1, motions=1, max_epochs=2, members=2, hidden=8)
TRUTH = InertialParameters(np.arange(1.0, 11.0))


class Constant(Identifier):
    """Says the same at every sample."""

    name = "constant"

    def __init__(self, arm, phi):
        self.arm, self.phi, self.count = arm, phi, 0

    def reset(self):
        self.count = 0

    def _take(self, t, *_):
        self.count += len(t)

    def _estimate(self, t):
        return Estimate(t, self.phi, np.eye(10), self.count, str(self.arm.frame))


@pytest.fixture
def runs(analytic_log, panda):
    log = analytic_log(panda, duration=1.0, rate=100.0)
    late = Recording(log.t + 50.0, log.q, log.dq, log.tau)
    return {"test_payload_nominal": [EvaluationRun(log, TRUTH, "a"), EvaluationRun(late, TRUTH, "b")]}


# ---------------------------------------------------------------------------- cells


@pytest.mark.parametrize("size", [FULL, QUICK])
def test_no_two_cells_of_the_plan_share_a_name_or_a_key(size):
    cells = plan(size)
    assert len({cell.name for cell in cells}) == len({cell.key("basis") for cell in cells}) == len(cells)


def test_the_key_knows_every_setting_and_the_basis_but_not_the_table():
    spec = Spec("network", split="row")
    others = [
        Spec("network", split="payload"),
        Spec("network", split="row", seed=1),
        Spec("network", split="row", max_epochs=60),
        Spec("network", split="row", drop=("t",)),
    ]
    assert len({spec.key("a"), spec.key("b"), *(other.key("a") for other in others)}) == 6
    assert Spec("network", split="row", ablation="scale").key("a") == spec.key("a")


def test_the_plan_holds_what_the_paper_trains_on_both_splits_without_a_cap():
    cells = plan(FULL)
    for kind in ("tree", "network"):
        for stages in (1, 2):
            for split in ("row", "payload"):
                assert Spec(kind, stages=stages, split=split) in cells


def test_every_method_of_least_squares_that_is_planned_has_its_row_on_the_page():
    planned = {cell.method for cell in plan(FULL) if cell.kind == "benchmark"} - {"training-mean"}
    assert planned == set(LEAST_SQUARES)


def test_a_cell_reads_back_as_it_was_written_and_a_stranger_is_named(tmp_path):
    cell = {"name": "tree-x", "key": "k", "protocols": {"held_out": {"single": [0.1] * 10}}}
    save_cell(tmp_path, cell)
    assert load_cells(tmp_path) == {"tree-x": cell}
    (tmp_path / "other.json").write_text("[1, 2")
    with pytest.raises(DatasetError, match=r"other\.json is not a cell"):
        load_cells(tmp_path)


# ---------------------------------------------------------------------------- protocols


def test_errors_that_cancel_over_a_run_count_for_single_samples_only(runs):
    def predict(X):
        sign = np.where(np.arange(len(X)) % 2, 1.0, -1.0)
        return TRUTH.phi + 0.5 * sign[:, None]

    measured = measure_learned(predict, runs)["protocols"]["test_payload_nominal"]
    assert measured["single"] == pytest.approx([0.5] * 10)
    assert np.array(measured["running"]) == pytest.approx(np.zeros((2, 10)), abs=1e-6)
    assert np.array(measured["first"]) == pytest.approx(np.full((2, 10), 0.5))


def test_a_learned_method_sees_time_from_the_start_of_each_run(runs):
    starts = []

    def predict(X):
        starts.append(X[0, 0])
        return np.tile(TRUTH.phi, (len(X), 1))

    measure_learned(predict, runs)
    assert starts == [0.0, 0.0]


def test_a_stream_s_error_is_that_of_its_last_estimate(runs, panda):
    measured = measure_stream(lambda _: Constant(panda, TRUTH.phi + 0.25), runs)
    protocol = measured["protocols"]["test_payload_nominal"]
    for kind in ("running", "second_half", "first"):
        assert np.array(protocol[kind]) == pytest.approx(np.full((2, 10), 0.25))
    assert measured["izz"]["test_payload_nominal"]["truth"] == TRUTH.phi[9]


# ---------------------------------------------------------------------------- the run


def some(size):
    """Of the plan what is cheap and differs in more than a setting: least squares, a baseline, trees, one network."""
    cells, first = [], set()
    for spec in plan(size):
        kind = (spec.kind, spec.method, spec.stages, spec.split if spec.kind == "tree" else "")
        dear = spec.kind == "mixed" or (spec.kind == "network" and spec.stages == 2) or "hybrid" in spec.method
        if kind not in first and spec.sensors == "ideal" and not dear:
            first.add(kind)
            cells.append(spec)
    return cells


def measure(folder, cells_of, **options):
    """The cells of a small study, measured where they are not there; rivals and readings beside the whole plan only."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_run, "plan", cells_of)
        if cells_of is some:
            patch.setattr(study_run, "rival_tasks", lambda _: [])
            patch.setattr(study_run, "reading_tasks", lambda _: [])
        return run_study(Basis(folder, SMALL), folder / "cells", **options)


@pytest.fixture(scope="module", params=[pytest.param(plan, marks=pytest.mark.full, id="all"), some])
def small(tmp_path_factory, request):
    """A small study, stopped at once and then run to the end: its folder, cells by both, and messages."""
    folder, messages = tmp_path_factory.mktemp("study"), []
    first = measure(folder, request.param, until=0.0, say=messages.append)
    cells = measure(folder, request.param, say=messages.append)
    return folder, request.param, first, cells, messages


@pytest.fixture(scope="module")
def written(small):
    """The files of that study."""
    folder, _, _, cells, _ = small
    at = folder / "written"
    return write_results(cells, at / "a" / "s.json", at / "p.md", at / "r.html")


@pytest.mark.full  # some seconds
def test_a_study_that_was_stopped_goes_on_and_measures_nothing_twice(small):
    folder, cells_of, first, cells, messages = small
    tasks = len(cells_of(SMALL)) + (0 if cells_of is some else len(reading_specs(SMALL)) + 1)
    # the rivals of one rate and noise are one task
    assert len(first) < len(cells) == tasks + (0 if cells_of is some else len(rivals(SMALL)) - 1)
    assert len([line for line in messages if line.startswith("cell")]) == tasks
    again = []
    assert measure(folder, cells_of, say=again.append) == cells
    assert again == []


@pytest.mark.full
def test_the_same_seed_gives_the_same_numbers(small):
    folder, cells_of, _, cells, _ = small
    name = next(name for name in cells if name.startswith("tree-2stage"))
    (folder / "cells" / f"{name}.json").unlink()
    assert measure(folder, cells_of)[name]["protocols"] == cells[name]["protocols"]


@pytest.mark.full  # each process simulates the runs anew; the runner's own test is quick
def test_the_numbers_do_not_depend_on_how_many_cells_are_measured_at_once(small):
    folder, cells_of, _, cells, _ = small
    # none that JAX trains: each worker would import and compile it
    left = ("benchmark-rls-s0", "tree-1stage-raw-row-ideal", "tree-2stage-raw-payload-ideal")
    names = [next(name for name in cells if name.startswith(start)) for start in left]
    for name in names:
        (folder / "cells" / f"{name}.json").unlink()
    messages = []
    again = measure(folder, cells_of, jobs=2, say=messages.append)
    assert len(messages) == len(names)
    for name in names:
        for field in ("key", "spec", "epochs", "file_bytes", "protocols", "izz"):
            assert again[name].get(field) == cells[name].get(field)
    assert load_cells(folder / "cells") == again


@pytest.mark.full  # of the runner, which does it, the tests are quick: another key is measured again
def test_a_cell_of_another_size_is_measured_again(small):
    folder, cells_of, _, cells, _ = small
    name = "benchmark-training-mean-row-s0"
    path = folder / "cells" / f"{name}.json"
    path.write_text(json.dumps({**cells[name], "key": "of another basis", "protocols": {}}))
    assert measure(folder, cells_of)[name] == cells[name] | {"wall_s": json.loads(path.read_text())["wall_s"]}


@pytest.mark.full  # each protocol has a quick test on made-up runs
def test_every_learned_cell_has_all_protocols_and_finite_errors(small):
    _, _, _, cells, _ = small
    for name, cell in cells.items():
        if name.startswith("reading"):
            held_out = cell["protocols"]["held_out"]
            payloads, averaged = np.array(held_out["payloads"]), np.array(held_out["averaged"])
            assert np.all(averaged <= payloads * (1 + 1e-5) + 1e-12)  # triangle inequality
            assert payloads.min() >= 0.0
            assert len(cell["protocols"]["test_payload_real_like"]["running"]) == SMALL.worlds + 1
        if name.startswith("rival"):
            assert all(np.isfinite(p["second_half"]).all() for p in cell["protocols"].values())
        if name.startswith(("tree", "network", "mixed")):
            assert {"held_out", "test_payload_nominal", "test_payload_real_like", "off_family", "other_motion"} <= set(
                cell["protocols"]
            )
            assert all(np.isfinite(p["single"]).all() for p in cell["protocols"].values())


@pytest.mark.full  # those of the committed cells are quick
def test_page_summary_and_report_are_written_from_the_cells(written):
    files = written
    summary = json.loads(files["summary"].read_text(encoding="utf-8"))
    assert {"rows", "payloads", "seeds", "command", "versions", "wall_s", "methods", "claims"} <= set(summary)
    assert summary["payloads"] == len(range(0, 77, SMALL.every))
    verdicts = {claim["verdict"] for claim in summary["claims"]}
    assert verdicts <= set(VERDICTS)
    page = files["page"].read_text(encoding="utf-8")
    assert all(claim["id"] in page or claim["repeats"] for claim in summary["claims"])
    page = files["tables"].read_text(encoding="utf-8")
    assert "training mean" in page
    assert "same-prior least squares" in page


@pytest.mark.full  # some seconds
def test_the_committed_page_and_summary_are_what_the_committed_cells_say(tmp_path):
    results, messages = ROOT / "benchmarks" / "results", []
    cells = run_study(Basis(tmp_path, FULL), results / "taie2024", until=-1.0, say=messages.append)
    assert messages == []  # no cell is left to measure
    claims = evaluate(cells)
    assert json.loads((results / "taie2024.json").read_text(encoding="utf-8")) == summary_json(cells, claims)
    committed = pages(ROOT / "docs" / "paper.md")
    for name, path in write_pages(cells, claims, tmp_path / "paper.md").items():
        assert path.read_text(encoding="utf-8") == committed[name].read_text(encoding="utf-8")


@pytest.mark.parametrize("log", ["a.csv", "b.csv"])
def test_a_cell_is_measured_again_on_another_real_log_and_kept_where_there_is_none(tmp_path, monkeypatch, log):
    (tmp_path / "a.csv").write_text("the study's own")
    (tmp_path / "b.csv").write_text("another")
    monkeypatch.setattr(study_run, "_OWN_LOG", hashlib.sha256((tmp_path / "a.csv").read_bytes()).hexdigest())
    spec, done = Spec("benchmark", "rls"), tmp_path / "cells"

    def key(real_log):
        return study_run.cell_keys(Basis(tmp_path, SMALL, real_log), done)(spec)

    without, on_log = key(None), key(tmp_path / log)
    assert len({without, key(tmp_path / "a.csv"), key(tmp_path / "b.csv")}) == 3
    assert key(tmp_path / "a.csv") == spec.key(Basis(tmp_path, SMALL).fingerprint)  # as that of the committed cells
    save_cell(done, {"name": spec.name, "key": on_log})
    assert key(None) == (on_log if log == "a.csv" else without)
    assert key(tmp_path / log) == on_log
    with pytest.raises(DatasetError, match="cannot be read"):
        key(tmp_path / "gone.csv")


def test_a_real_log_that_is_too_short_is_named_with_what_is_expected(tmp_path, analytic_log, panda):
    path = tmp_path / "short.csv"
    write_recording(path, analytic_log(panda, duration=6.0, rate=50.0))
    with pytest.raises(DatasetError, match=r"short.csv lasts 6.0 s: expected at least 20 s"):
        Basis(tmp_path, SMALL, path)._on_real_log()


def test_a_real_log_that_cannot_be_read_ends_the_command_before_anything_is_measured(tmp_path, capsys):
    path = tmp_path / "odd.csv"
    path.write_text("clock,angle\n0,1\n")
    command = ["reproduce", "taie2024", "--quick", "--out", str(tmp_path / "out"), "--real-log", str(path)]
    assert main(command) == 2
    out, err = capsys.readouterr()
    (said,) = err.splitlines()
    assert out == ""
    assert said.endswith(f"expected a recording that `armload identify {path} --robot panda` reads without --columns")


def test_the_torque_added_to_a_real_log_does_not_depend_on_its_rate(tmp_path, analytic_log, panda):
    added = {}
    for rate in (1000, 100):
        log = analytic_log(panda, duration=20.5, rate=float(rate))
        write_recording(tmp_path / f"{rate}.csv", log)
        run = Basis(tmp_path, SMALL, tmp_path / f"{rate}.csv")._on_real_log()["test_payload_semi_real"][0]
        added[rate] = run.recording.tau - log.between(10.0, 16.0).tau
    exact = added[1000][:: 1000 // 100]
    assert added[100] == pytest.approx(exact, abs=2e-3 * np.abs(exact).max())


def test_the_command_stops_in_time_names_what_is_missing_and_writes_the_page(tmp_path, capsys):
    command = ["reproduce", "taie2024", "--quick", "--hours", "0", "--out", str(tmp_path)]
    assert main(command) == 0
    out, err = capsys.readouterr()
    assert "stopped before cell 1" in err
    assert str(tmp_path / "paper.md") in out
    assert "not measured yet" in (tmp_path / "paper.md").read_text(encoding="utf-8")
    assert main([*command, "--real-log", str(tmp_path / "none.csv")]) == 2
    assert "no real log at" in capsys.readouterr().err


def test_a_quick_run_says_on_top_of_its_pages_and_report_that_its_verdicts_mean_nothing(tmp_path):
    said = "This was a quick run: its verdicts mean nothing."
    for quick in (False, True):
        files = write_results({}, tmp_path / "s.json", tmp_path / "p.md", tmp_path / "r.html", quick=quick)
        for name, heading in (("page", "## "), ("tables", "## "), ("report", "<h2>")):
            text = files[name].read_text(encoding="utf-8")
            first = text.split(heading)[1 if name == "report" else 0]  # before the first heading, or under it
            assert (said in first) == quick
            assert (said in text) == quick

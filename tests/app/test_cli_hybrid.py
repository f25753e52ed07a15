"""The hybrid on the command line: trained for any arm, read by identify and report, refused for another arm."""

import io
import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from armload.app.cli import main
from armload.app.cli.train_hybrid import cells_table, summary, summary_lines
from armload.arms import ARMS, arm, link_fingerprint
from armload.inertia import InertialParameters
from armload.lab.training import Coverage, train_hybrid
from armload.lab.training import hybrid as training
from armload.lab.training.hybrid import EPISODES
from armload.lab.training.records import TIMES
from armload.motion import excitation, random_motion
from armload.posterior import Calibration, HybridModel, MixturePrior, Training
from armload.posterior import model_file as model
from armload.posterior.evidence import KINDS
from armload.posterior.model_file import SHIPPED
from armload.recording import write_recording
from armload.regression import payload_prior_std
from armload.simulation import Sensors, World, simulate

URDF = """<?xml version="1.0"?><robot name="two"><link name="base"/>
<joint name="shoulder" type="revolute"><origin xyz="0 0 0.5"/><parent link="base"/><child link="upper"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="60" velocity="3"/></joint>
<link name="upper"><inertial><origin xyz="0 0 0.15"/><mass value="3"/>
<inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.005"/></inertial></link>
<joint name="elbow" type="revolute"><origin xyz="0 0 0.3"/><parent link="upper"/><child link="fore"/>
<axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="30" velocity="3"/></joint>
<link name="fore"><inertial><origin xyz="0 0 0.1"/><mass value="1.5"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.002"/></inertial></link></robot>
"""
BODY = InertialParameters.from_com(0.8, (0.02, 0.03, 0.06), np.diag([2e-3, 2e-3, 1e-3]))


@pytest.fixture
def call(capsys):
    """Run a command that must end with the given exit code and return what it printed."""

    def run(*argv, code=0):
        assert main([str(a) for a in argv]) == code, capsys.readouterr().err
        return capsys.readouterr()

    return run


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A folder with the description of an arm of two joints, its logs, and a hybrid of one Gaussian for it."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "two.urdf").write_text(URDF)
    two = arm(folder / "two.urdf")
    how = {"world": World.real_like(two, 3), "sensors": Sensors.generic(two), "rate": 200.0}
    for name, payload, seed in (("run", BODY, 1), ("tare", None, 2)):
        motion = random_motion(two, seed)
        write_recording(folder / f"{name}.csv", simulate(two, motion, payload, seed=seed, **how))
    std = payload_prior_std(two)
    prior = MixturePrior(np.ones(1), np.zeros((1, 10)), np.diag(std**2)[None], ("anything",))
    calibration = Calibration(None, 1.0, np.array([0.1, 6.0]), np.full((3, 2, 10), 1.96))
    for name, pooled, episodes in (("checked", 0.95, 2400), ("trial", 0.80, 2400), ("small", 0.95, 300)):
        checked = Training("broad", episodes, 0, pooled)
        made = HybridModel(prior, calibration, two.name, link_fingerprint(two), str(two.frame), two.n, {}, checked)
        made.save(folder / f"{name}.safetensors")
    return folder


@pytest.fixture
def coverage():
    """A table in which one cell is low, one is wide, and no tare showed the run's own motion before 3 s."""
    cells, ratio = np.full((len(KINDS), len(TIMES), 10), 0.95), np.full((len(KINDS), len(TIMES), 10), 2.5)
    cells[2, :3] = ratio[2, :3] = np.nan
    cells[0, 1, 4], ratio[1, 2, 9] = 0.91, 4.0
    counts = np.full(cells.shape[:2], 1000)
    counts[2, 3], cells[2, 3] = 2, 0.5  # two episodes: one of them lay outside
    return Coverage(0.9512, cells, ratio, 2400, counts)


# ---------------------------------------------------------------------- a model of one's own


@pytest.mark.parametrize(
    ("name", "interval"), [("checked", "calibrated"), ("trial", "approximate"), ("small", "approximate")]
)
def test_identify_reads_a_hybrid_and_calls_calibrated_only_what_held(call, small, name, interval):
    argv = ("identify", small / "run.csv", "--robot", small / "two.urdf", "--method", small / f"{name}.safetensors")
    out = call(*argv, "--tare", small / "tare.csv", "--json")
    found = json.loads(out.out)
    assert (found["method"], found["interval"], found["relative_to"]) == ("hybrid", interval, "tare")
    assert found["phi_low"][0] <= BODY.mass <= found["phi_high"][0]
    assert found["consistent"]
    printed = call(*argv, "--tare", small / "tare.csv").out
    assert f"{name}.safetensors" in printed


def test_without_a_hybrid_of_its_own_an_arm_gets_map_gp(call, small):
    found = json.loads(call("identify", small / "run.csv", "--robot", small / "two.urdf", "--json").out)
    assert (found["method"], found["interval"]) == ("map-gp", "approximate")


def test_a_hybrid_of_another_arm_is_refused_in_a_sentence(call, small, analytic_log, tmp_path):
    write_recording(tmp_path / "panda.csv", analytic_log(arm("panda"), rate=100.0))
    argv = ("identify", tmp_path / "panda.csv", "--robot", "panda", "--method", small / "checked.safetensors")
    refused = call(*argv, "--json", code=2)
    assert refused.out == ""
    assert "trained for two: panda is another arm" in refused.err
    assert refused.err.count("\n") == 1


MISSING = [pytest.param(name, "is missing", marks=() if name == "ur10e" else pytest.mark.full) for name in SHIPPED]


@pytest.mark.parametrize(("name", "state"), [*MISSING, ("panda", "cannot be read")])
def test_a_model_that_is_part_of_armload_and_not_there_is_an_error_and_no_other_method(
    call, tmp_path, monkeypatch, name, state
):
    write_recording(tmp_path / "run.csv", simulate(arm(name), excitation(arm(name)), duration=2.0, rate=50.0))
    monkeypatch.setattr("armload.posterior.model_file.__file__", str(tmp_path / "model.py"))
    if state == "cannot be read":
        (tmp_path / "models").mkdir()
        (tmp_path / "models" / f"{name}.safetensors").write_bytes(b"half of it")
    log = (tmp_path / "run.csv", "--robot", name)
    for argv in (("identify", *log), ("identify", *log, "--method", "hybrid"), ("live", *log, "--headless")):
        refused = call(*argv, code=2)
        assert (refused.out, refused.err.count("\n")) == ("", 1)
        assert f"the hybrid model of {name} is part of armload" in refused.err
        assert f"{state}: install armload again" in refused.err
    assert json.loads(call("identify", *log, "--method", "map", "--json").out)["method"] == "map"


def test_the_models_that_are_part_of_armload_are_those_stated():
    folder = Path(model.__file__).parent / "models"
    assert sorted(SHIPPED) == sorted(path.stem for path in folder.glob("*.safetensors"))
    assert set(SHIPPED) <= set(ARMS)


@pytest.mark.parametrize("command", ["identify", "live"])
@pytest.mark.parametrize(("name", "state"), [("mine.safetensors", "does not exist"), (".", "is not a file")])
def test_a_model_named_by_a_file_that_is_none_is_refused_by_that_name(call, small, tmp_path, command, name, state):
    path = tmp_path / "models" / name
    (tmp_path / "models").mkdir()
    headless = ("--headless",) if command == "live" else ()
    argv = (command, small / "run.csv", "--robot", small / "two.urdf", "--method", path, *headless)
    refused = call(*argv, code=2)
    assert (refused.out, refused.err.count("\n")) == ("", 1)
    assert f"the model {path} {state}: expected the .safetensors file" in refused.err
    assert "map-gp" not in refused.err  # a path is no method's name spelt wrong


def test_the_name_of_the_method_without_a_model_says_how_to_get_one(call, small):
    argv = ("identify", small / "run.csv", "--robot", small / "two.urdf", "--method", "hybrid")
    assert "armload train --method hybrid" in call(*argv, code=2).err


@pytest.mark.full  # some seconds
def test_report_draws_a_hybrid_beside_the_others(call, small):
    argv = ("report", small / "run.csv", "--robot", small / "two.urdf", "--tare", small / "tare.csv")
    call(*argv, "--model", small / "checked.safetensors", "--out", small / "r.html")
    page = (small / "r.html").read_text()
    for name in ("map-gp", "rls-filter", "checked"):
        assert name in page


# ---------------------------------------------------------------------- what training says


def test_the_worst_cells_are_named(coverage):
    pooled, lowest, widest = summary_lines(coverage)
    assert "95.1 % on 2400 episodes" in pooled
    assert lowest.startswith("lowest coverage: 91.0 % (Ixx, 0.05 s, no tare), 95.0 %")
    assert ": 4.0 (Izz, 0.1 s, tare), 2.5" in widest


def test_the_table_has_a_row_for_every_cell_that_was_seen(coverage):
    page = io.StringIO()
    Console(file=page, width=180).print(cells_table(coverage))
    rows = [line.split() for line in page.getvalue().splitlines() if " s " in line]
    assert len(rows) == 2 * len(TIMES) + 4
    assert sum(row.count("91.0") for row in rows) == 1


def test_the_report_is_json_with_null_where_nothing_was_seen(coverage, panda):
    found = json.loads(json.dumps(summary(panda, coverage), allow_nan=False))
    assert np.shape(found["cells"]) == np.shape(found["ratio"]) == (3, len(TIMES), 10)
    assert found["cells"][2][0] == [None] * 10
    assert found["cells"][0][1][4] == 0.91
    assert (found["pooled"], found["compared_with"], found["times"]) == (0.9512, list(KINDS), list(TIMES))


def test_help_states_the_default_that_training_has(call):
    assert f"default: {EPISODES};" in call("train", "--help").out


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        ([], "--robot (a hybrid) or --dataset (an ensemble)"),
        (["--method", "hybrid"], "--robot"),
        (["--method", "ensemble", "--robot", "panda", "--out", "m.safetensors"], "--dataset"),
        (["--method", "hybrid", "--robot", "panda", "--dataset", "d"], "leave out --dataset"),
        (["--robot", "panda", "--kind", "tree", "--members", "2"], "leave out --kind, --members"),
        (["--dataset", "d", "--out", "m.safetensors", "--jobs", "2", "--json"], "leave out --jobs, --json"),
        (["--dataset", "d"], "--out"),
        (["--robot", "panda", "--episodes", "10"], "at least 32"),
        (["--robot", "panda", "--out", "model.pt"], ".safetensors"),
        (["--robot", "nobody"], "nobody"),
        (["--robot", "panda", "--frame", "nowhere"], "nowhere"),
    ],
)
def test_options_that_do_not_go_together_are_refused_before_anything_is_simulated(call, argv, named):
    refused = call("train", *argv, code=2)
    assert (refused.out, refused.err.count("\n")) == ("", 1)
    assert named in refused.err


def test_python_and_the_command_line_write_the_same_model(call, small, coverage, monkeypatch, tmp_path):
    """What is learned is given here: what the file says of it must not depend on who asked for it."""
    learned = HybridModel.load(small / "checked.safetensors")
    monkeypatch.setattr(training, "episode_records", lambda *_: None)
    monkeypatch.setattr(training, "payload_mixture", lambda *_: learned.prior)
    monkeypatch.setattr(training, "cross_validated", lambda *_: coverage)
    monkeypatch.setattr(training, "fit_calibration", lambda *_, **__: learned.calibration)
    asked = tmp_path / "asked.safetensors"
    argv = ("--robot", small / "two.urdf", "--episodes", "40", "--seed", "3", "--work", tmp_path / "work")
    call("train", *argv, "--out", asked, "--report", tmp_path / "report.json")
    made, checked = train_hybrid(arm(small / "two.urdf"), episodes=40, seed=3)
    assert made.save(tmp_path / "made.safetensors").read_bytes() == asked.read_bytes()
    assert checked is coverage
    assert made.training == Training("broad", 40, 3, 0.9512)
    report, provenance = json.loads((tmp_path / "report.json").read_text()), HybridModel.load(asked).provenance
    assert {"cells", "ratio", "counts", "times", "parameters", "compared_with", "versions"} <= set(provenance)
    assert {key: report[key] for key in provenance} == provenance


@pytest.mark.full
def test_a_hybrid_is_trained_for_a_urdf_resumed_and_used(call, small):
    """Over a minute on one core: 32 episodes, enough to go all the way and too few to be calibrated."""
    train = ["train", "--robot", small / "two.urdf", "--episodes", "32", "--jobs", "1", "--work", small / "work"]
    first = call(*train, "--out", small / "first.safetensors", "--report", small / "report.json")
    report = json.loads((small / "report.json").read_text())
    assert (report["episodes"], report["resumed"], report["seeds"]) == (32, False, [0])
    assert report["command"].startswith("armload train --method hybrid --robot ")
    assert {"armload", "mujoco", "numpy", "python"} <= set(report["versions"])
    assert report["wall_s"] > 0
    (said,) = re.findall(r"pooled coverage ([\d.]+) % on 32 episodes", first.out)
    assert float(said) == pytest.approx(100 * report["pooled"], abs=0.06)  # both are rounded
    steps = [int(line.split()[1]) for line in first.err.splitlines() if " of 32 episodes" in line]
    assert all(a < b for a, b in pairwise(steps))

    again = call(*train, "--out", small / "again.safetensors", "--json")
    assert json.loads(again.out)["resumed"] is True
    trained, _ = train_hybrid(arm(small / "two.urdf"), episodes=32, folder=small / "work")
    made = trained.save(small / "made.safetensors")
    for path in (small / "again.safetensors", made):
        assert path.read_bytes() == (small / "first.safetensors").read_bytes()

    argv = ("identify", small / "run.csv", "--robot", small / "two.urdf", "--method", small / "first.safetensors")
    found = json.loads(call(*argv, "--tare", small / "tare.csv", "--json").out)
    assert (found["method"], found["interval"]) == ("hybrid", "approximate")
    assert found["mass"] == pytest.approx(BODY.mass, abs=0.3)
    assert HybridModel.load(small / "first.safetensors").provenance["cells"] == report["cells"]

"""The hybrid on the command line: trained for any arm, read by identify and report, refused for another arm."""

import io
import json
from itertools import pairwise

import numpy as np
import pytest
from rich.console import Console

from armload.app.cli import main
from armload.app.cli.train_hybrid import cells_table, said, summary
from armload.arms import arm, kinship
from armload.inertia import InertialParameters
from armload.lab.training import Coverage
from armload.lab.training.hybrid import EPISODES
from armload.lab.training.records import TIMES
from armload.motion import random_motion
from armload.posterior import Calibration, HybridModel, MixturePrior
from armload.posterior.evidence import KINDS
from armload.posterior.model_file import POOLED
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
        known = {POOLED: pooled, "episodes": episodes}
        model = HybridModel(prior, calibration, two.name, kinship(two), str(two.frame), two.n, known)
        model.save(folder / f"{name}.safetensors")
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
    assert f"{name}.safetensors was trained for this arm" in out.err


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


def test_the_name_of_the_method_without_a_model_says_how_to_get_one(call, small):
    argv = ("identify", small / "run.csv", "--robot", small / "two.urdf", "--method", "hybrid")
    assert "armload train --method hybrid" in call(*argv, code=2).err


def test_report_draws_a_hybrid_beside_the_others(call, small):
    argv = ("report", small / "run.csv", "--robot", small / "two.urdf", "--tare", small / "tare.csv")
    call(*argv, "--model", small / "checked.safetensors", "--out", small / "r.html")
    page = (small / "r.html").read_text()
    for name in ("map-gp", "rls-filter", "checked"):
        assert name in page


# ---------------------------------------------------------------------- what training says


def test_the_worst_cells_are_named(coverage):
    pooled, lowest, widest = said(coverage)
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
    assert f"pooled coverage {100 * report['pooled']:.1f} % on 32 episodes" in first.out
    steps = [int(line.split()[1]) for line in first.err.splitlines() if " of 32 episodes" in line]
    assert all(a < b for a, b in pairwise(steps))

    again = call(*train, "--out", small / "again.safetensors", "--json")
    assert json.loads(again.out)["resumed"] is True
    assert (small / "again.safetensors").read_bytes() == (small / "first.safetensors").read_bytes()

    argv = ("identify", small / "run.csv", "--robot", small / "two.urdf", "--method", small / "first.safetensors")
    found = json.loads(call(*argv, "--tare", small / "tare.csv", "--json").out)
    assert (found["method"], found["interval"]) == ("hybrid", "approximate")
    assert found["mass"] == pytest.approx(BODY.mass, abs=0.3)
    assert HybridModel.load(small / "first.safetensors").provenance["cells"] == report["cells"]

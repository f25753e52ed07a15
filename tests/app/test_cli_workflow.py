"""The other commands: demo, dataset → train → identify → report, and motion, each through `main` as a user would."""

import contextlib
import html
import io
import json
import re
import shutil

import numpy as np
import pytest

from armload.app.cli import main
from armload.app.cli import report as report_command
from armload.arms import arm
from armload.lab.dataset import open_dataset
from armload.lab.demo import QUICK, _Clock, _made
from armload.lab.evaluation import Comparison, contest
from armload.motion import load_motion, taie2024
from armload.payloads import container_loadings, franka_hand, write_payload
from armload.payloads import test_payload as unseen_payload
from armload.recording import write_recording
from armload.simulation import simulate


@pytest.fixture
def call(capsys):
    """Run a command that must succeed and return what it printed on stdout and stderr."""

    def run(*argv, code=0):
        assert main([str(a) for a in argv]) == code, capsys.readouterr().err
        return capsys.readouterr()

    return run


# ---------------------------------------------------------------------- demo

# What a demo does one after another (data set, training, identification, report) has quick tests of its own below.


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """What one quick demo wrote into its folder, and what it printed."""
    folder, printed = tmp_path_factory.mktemp("demo") / "out", io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main(["demo", "--quick", "--out", str(folder)]) == 0
    comparison = Comparison.from_dict(json.loads((folder / "comparison.json").read_text()))
    return folder, comparison, printed.getvalue()


@pytest.mark.full
def test_demo_compares_every_kind_on_a_payload_nobody_trained_on(demo):
    _, comparison, printed = demo
    names = [
        "rls",
        "rls-filter",
        "rls-filter, with tare",
        "map",
        "map, with tare",
        "hybrid",
        "hybrid, with tare",
        "trees",
        "trees, two stages",
        "networks",
        "networks, two stages",
        "training mean",
        "same-prior least squares",
    ]
    assert list(comparison.methods) == names
    truth = unseen_payload().parameters
    assert comparison.truth[0] == pytest.approx(truth.phi)
    assert all(np.any(p.parameters.phi != truth.phi) for p in container_loadings())
    assert "by payload" in comparison.split
    assert "seed 2024" in comparison.split
    best = comparison.mae[names.index("hybrid, with tare"), -1, 0]
    assert best < comparison.mae[names.index("map, with tare"), -1, 0]
    assert best < comparison.mae[names.index("training mean"), -1, 0]
    lines = printed.splitlines()
    for name, phi in zip(("truth", *names), (comparison.truth[0], *comparison.phi[:, 0, -1]), strict=True):
        shown = f"{phi[0]:.3f}", ", ".join(f"{1e3 * x:+.1f}" for x in phi[1:4] / phi[0])
        assert any(line.split("  ")[0].strip() == name and all(cell in line for cell in shown) for line in lines), name


@pytest.mark.full
def test_demo_writes_what_it_found(demo):
    folder, _, printed = demo
    found = json.loads((folder / "identified.json").read_text())
    assert (found["method"], found["interval"]) == ("hybrid", "calibrated")
    assert found["relative_to"] == "tare"
    assert found["mass"] == pytest.approx(unseen_payload().parameters.mass, abs=0.05)
    assert str(folder / "report.html") in printed
    page = (folder / "report.html").read_text()
    assert "An unseen payload" in page
    assert page.count("data:image/svg+xml") >= 5
    assert len(list((folder / "models").glob("*.safetensors"))) == 4


@pytest.mark.full
def test_the_same_seed_makes_the_demo_s_logs_and_models_again(demo, tmp_path):
    folder, comparison, _ = demo
    shutil.copytree(folder / "dataset", tmp_path / "dataset")  # used again; everything else is made anew
    made = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "dataset").iterdir()}
    *_, run, _, learned = _made(tmp_path, arm("panda"), QUICK, 2024, False, _Clock(lambda _: None))
    assert {path.name: path.stat().st_mtime_ns for path in (tmp_path / "dataset").iterdir()} == made
    for name in ("run.csv", "tare.csv"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()
    for name, make in learned.items():
        assert make(None).run(run).phi == pytest.approx(comparison.phi[comparison.methods.index(name), 0, -1])


def test_demo_replaces_the_data_set_of_an_older_demo_and_nothing_else(call, tmp_path):
    (tmp_path / "dataset").mkdir()
    (tmp_path / "dataset" / "mine.txt").write_text("keep")
    assert "mine.txt" in call("demo", "--quick", "--out", tmp_path, code=2).err
    assert (tmp_path / "dataset" / "mine.txt").read_text() == "keep"


@pytest.mark.full
def test_demo_s_logs_are_identified_again_as_the_demo_did(demo, call):
    folder = demo[0]
    argv = ("identify", folder / "run.csv", "--robot", "panda", "--tare", folder / "tare.csv", "--json")
    again, first = json.loads(call(*argv).out), json.loads((folder / "identified.json").read_text())
    assert again["phi"] == pytest.approx(first["phi"])
    assert again["phi_high"] == pytest.approx(first["phi_high"])


# ---------------------------------------------------------------------- dataset, train, identify, report


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """A folder with a small data set and a model of each kind, made through the command line."""
    folder = tmp_path_factory.mktemp("work")
    data = folder / "data"
    build = ["--payloads", "random:8", "--rows", "150", "--world", "nominal", "real-like:2", "--seed", "5"]
    assert main(["dataset", "--out", str(data), *build]) == 0
    assert main(["train", "--dataset", str(data), "--seed", "5", "--out", str(folder / "trees.safetensors")]) == 0
    return folder


def test_dataset_holds_what_was_asked_for(work):
    data = open_dataset(work / "data")
    assert (data.runs, len(data)) == (16, 16 * 150)
    assert [world["seed"] for world in data.provenance["worlds"]] == [None, 2]
    assert data.provenance["sensors"] is not None
    assert data.provenance["motions"][0]["name"] == "taie2024"


def test_dataset_built_again_is_the_same_and_another_is_refused(work, call):
    build = ["dataset", "--out", work / "data", "--rows", "150", "--world", "nominal", "real-like:2", "--seed", "5"]
    before = open_dataset(work / "data").hash
    assert before[:12] in call(*build, "--payloads", "random:8").out
    captured = call(*build, "--payloads", "random:9", code=2)
    assert captured.out == ""
    assert "payloads" in captured.err


@pytest.mark.parametrize("robot", ["ur10e", "{of}.urdf"])  # which has no such frame, or has one
def test_a_data_set_of_one_arm_is_not_learned_from_as_of_another(work, call, tmp_path, robot):
    heavier = arm("panda").urdf.replace('<mass value="', '<mass value="1')
    (tmp_path / "own.urdf").write_text(heavier)
    robot = robot.format(of=tmp_path / "own")
    captured = call("train", "--dataset", work / "data", "--out", tmp_path / "m.safetensors", "--robot", robot, code=2)
    assert captured.out == ""
    assert f"{work / 'data'} was made with the arm panda about panda_link8" in captured.err
    assert "--robot" in captured.err
    assert not (tmp_path / "m.safetensors").exists()


def test_dataset_of_ideal_sensors_and_a_named_payload(call, tmp_path):
    write_payload(tmp_path / "hand.json", franka_hand())
    call("dataset", "--out", tmp_path / "d", "--payloads", tmp_path / "hand.json", "--rows", "20", "--no-noise")
    data = open_dataset(tmp_path / "d")
    assert data.provenance["sensors"] is None
    assert data.y[0] == pytest.approx(franka_hand().parameters.phi)


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        (["--world", "mars"], "'mars'"),
        (["--world", "real-like:x"], "'real-like:x'"),
        (["--payloads", "random:"], "'random:'"),
        (["--payloads", "none.json"], "none.json"),
        (["--motion", "none.json"], "none.json"),
        (["--rows", "1"], "'1'"),
        (["--robot", "ur10e"], "7 joints"),  # the paper's motion is a Panda's
    ],
)
def test_a_bad_data_set_is_refused(call, tmp_path, argv, named):
    captured = call("dataset", "--out", tmp_path / "d", *argv, code=2)
    assert captured.out == ""
    assert named in captured.err
    assert captured.err.count("\n") == 1


@pytest.mark.full
def test_train_prints_errors_by_payload_and_by_row_beside_the_mean(work, call):
    argv = ("train", "--dataset", work / "data", "--kind", "network", "--stages", "2", "--members", "2")
    out = call(*argv, "--epochs", "2", "--split", "row", "--out", work / "net.safetensors").out
    for row in ("two-stage network, by payload", "two-stage network, by row"):
        assert row in out
    assert "training mean, by payload" in out
    assert "training mean, by row" in out
    assert (work / "net.safetensors").exists()


@pytest.mark.full
def test_a_training_of_networks_that_was_interrupted_goes_on_and_writes_the_same_model(
    work, call, tmp_path, monkeypatch
):
    argv = (
        "train",
        "--dataset",
        work / "data",
        "--kind",
        "network",
        "--stages",
        "2",
        "--members",
        "2",
        "--epochs",
        "3",
    )
    whole, stopped = tmp_path / "whole.safetensors", tmp_path / "stopped.safetensors"
    told = call(*argv, "--out", whole).err
    assert [line for line in told.splitlines() if "epoch" in line] == [
        "armload: 1 of 3 epochs",
        "armload: 3 epochs",
    ] * 4
    seen = []

    def interrupt(at):
        seen.append(at.done)
        if len(seen) == 5:  # in the second stage of the first split
            raise KeyboardInterrupt

    monkeypatch.setattr("armload.app.cli.train.training_progress", lambda: interrupt)
    call(*argv, "--out", stopped, code=130)
    assert {path.name for path in tmp_path.glob("stopped*")} == {
        "stopped.row.checkpoint.stage1.npz",
        "stopped.row.checkpoint.stage2.npz",
    }
    refused = call(*argv, "--seed", "1", "--out", stopped, code=2)
    assert "stopped.row.checkpoint.stage1.npz belongs to another training" in refused.err
    assert "going on from its checkpoint" in call(*argv, "--out", stopped).err
    assert seen[5:] == [3, 1, 2, 3, 1, 2, 3]
    assert stopped.read_bytes() == whole.read_bytes()
    assert [path.name for path in tmp_path.glob("stopped*")] == ["stopped.safetensors"]


def test_a_build_whose_stderr_is_no_terminal_says_how_far_it_is(call, tmp_path):
    told = call(
        "dataset", "--out", tmp_path / "d", "--payloads", "random:2", "--rows", "20", "--sampler", "inverse"
    ).err
    assert told.splitlines() == ["armload: 0 of 2 runs", "armload: 2 runs"]


def test_train_on_a_motion_of_a_file_needs_the_file(call, tmp_path):
    call("motion", "random", "--robot", "panda", "--seed", "4", "--out", tmp_path / "random.json")
    text = (tmp_path / "random.json").read_text()
    (tmp_path / "mine.json").write_text(text.replace("random-panda-4", "mine"))
    build = ("--motion", tmp_path / "mine.json", "--payloads", "random:4", "--rows", "20")
    call("dataset", "--out", tmp_path / "d", *build)
    train = ("train", "--dataset", tmp_path / "d", "--members", "1", "--out", tmp_path / "m.safetensors")
    captured = call(*train, code=2)
    assert "'mine'" in captured.err.splitlines()[-1]
    assert "--motion" in captured.err.splitlines()[-1]
    call(*train, "--motion", tmp_path / "mine.json")


def test_train_refuses_what_is_no_data_set(call, tmp_path):
    captured = call("train", "--dataset", tmp_path, "--out", tmp_path / "m", code=2)
    assert str(tmp_path) in captured.err
    captured = call("train", "--dataset", tmp_path, "--kind", "mixed", "--stages", "2", "--out", tmp_path / "m", code=2)
    assert "mixed" in captured.err


def test_epochs_of_trees_are_refused_and_not_passed_over(call, tmp_path):
    for kind in ((), ("--kind", "tree")):
        argv = ("train", "--dataset", tmp_path, *kind, "--epochs", "3", "--out", tmp_path / "m.safetensors")
        assert "--epochs is of networks" in call(*argv, code=2).err


def test_a_trained_model_identifies_its_motion_and_refuses_another(work, call, tmp_path):
    panda = arm("panda")
    write_recording(tmp_path / "same.csv", simulate(panda, taie2024(), franka_hand(), rate=100.0))
    other = load_motion(_random(call, tmp_path))
    write_recording(tmp_path / "other.csv", simulate(panda, other, franka_hand(), rate=100.0))
    argv = ("--robot", "panda", "--method", work / "trees.safetensors", "--json")
    found = json.loads(call("identify", tmp_path / "same.csv", *argv).out)
    assert found["method"] == "tree"
    assert found["n_samples"] == 600
    captured = call("identify", tmp_path / "other.csv", *argv, code=2)
    assert captured.out == ""
    assert "taie2024" in captured.err
    assert "other.csv" in captured.err


@pytest.fixture
def few_points(monkeypatch):
    """Reports whose curves have few points: each is an estimate of every method."""
    monkeypatch.setattr(contest, "_POINTS", 3)
    monkeypatch.setattr(report_command, "_POINTS", 3)


@pytest.mark.full
@pytest.mark.usefixtures("few_points")
def test_report_of_a_log_shows_motion_torques_and_every_method(call, work, tmp_path):
    panda = arm("panda")
    write_recording(tmp_path / "log.csv", simulate(panda, taie2024(), franka_hand(), rate=100.0))
    argv = ("report", tmp_path / "log.csv", "--robot", "panda", "--out", tmp_path / "r.html")
    call(*argv, "--model", work / "trees.safetensors")
    page = text_of(tmp_path / "r.html")
    for name in (
        "hybrid",
        "map",
        "rls",
        "rls-filter",
        "trees",
        "Estimates over time",
        "Joint position and velocity",
        "log.csv",
    ):
        assert name in page
    assert "truth" not in page.replace("No truth is known", "")


@pytest.mark.full  # some seconds
@pytest.mark.usefixtures("few_points")
def test_report_with_truth_shows_errors_and_baselines(call, tmp_path):
    panda = arm("panda")
    write_recording(tmp_path / "log.npz", simulate(panda, taie2024(), franka_hand(), rate=100.0, duration=2.0))
    write_recording(tmp_path / "tare.npz", simulate(panda, taie2024(), rate=100.0, duration=2.0))
    argv = ("report", tmp_path / "log.npz", "--robot", "panda", "--out", tmp_path / "r.html")
    printed = call(*argv, "--tare", tmp_path / "tare.npz", "--truth", "franka-hand").out
    page = text_of(tmp_path / "r.html")
    for name in (
        "hybrid",
        "map",
        "rls-filter",
        "training mean",
        "same-prior least squares",
        "What this does not prove",
    ):
        assert name in page
    row = next(line.split() for line in printed.splitlines() if line.strip().startswith("map"))
    assert float(row[1]) < 10.0  # g


@pytest.mark.usefixtures("few_points")
@pytest.mark.full  # some seconds
def test_report_of_a_data_set_takes_held_out_payloads_only(call, work):
    argv = ("report", "--dataset", work / "data", "--seed", "5", "--runs", "2", "--out", work / "r.html")
    call(*argv, "--model", work / "trees.safetensors")
    page = text_of(work / "r.html")
    assert "2 runs" in page
    assert "by payload with seed 5" in page


@pytest.mark.parametrize("split", [("--seed", "6"), ("--seed", "5", "--split", "row")])
def test_a_model_that_learned_from_payloads_held_out_of_a_report_is_refused(work, call, tmp_path, split):
    model = tmp_path / "other.safetensors"
    call("train", "--dataset", work / "data", "--members", "1", *split, "--out", model)
    argv = ("report", "--dataset", work / "data", "--seed", "5", "--out", tmp_path / "r.html")
    captured = call(*argv, "--model", model, code=2)
    assert captured.out == ""
    assert f"the model {model} learned from" in captured.err
    assert not (tmp_path / "r.html").exists()


@pytest.mark.parametrize("name", ["trees", "map"])
def test_two_rows_of_a_report_never_have_one_name(work, call, tmp_path, name):
    shutil.copy(work / "trees.safetensors", tmp_path / f"{name}.safetensors")
    models = (work / "trees.safetensors", tmp_path / f"{name}.safetensors")
    argv = ("report", "--dataset", work / "data", "--seed", "5", "--out", tmp_path / "r.html")
    captured = call(*argv, "--model", *models, code=2)
    assert captured.out == ""
    assert f"another row is called {name!r}" in captured.err


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        (["--out", "r.html"], "LOG"),
        (["log.csv", "--out", "r.html"], "--robot"),
        (["log.csv", "--robot", "panda"], "--out"),
        (["log.csv", "--robot", "panda", "--dataset", "d", "--out", "r.html"], "--dataset"),
        (["none.csv", "--robot", "panda", "--out", "r.html"], "none.csv"),
        (["none.csv", "--robot", "panda", "--truth", "none.json", "--out", "r.html"], "none.json"),
    ],
)
def test_a_bad_report_is_refused(call, argv, named):
    captured = call("report", *argv, code=2)
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert named in captured.err


# ---------------------------------------------------------------------- motion


def test_motion_check_says_yes_and_no_by_exit_code(call, tmp_path):
    assert "may run it" in call("motion", "check", "taie2024", "--robot", "panda").out
    motion = json.loads(_random(call, tmp_path).read_text())
    motion["offset"][3] = 1.0  # the Panda's elbow bends one way only
    (tmp_path / "bad.json").write_text(json.dumps(motion))
    out = call("motion", "check", tmp_path / "bad.json", "--robot", "panda", code=3).out
    assert "must NOT" in out
    assert "panda_joint4" in out


def test_motion_check_takes_the_payload_asked_for(call):
    torque = {}
    for payload in ("none", "franka-hand", "rated"):
        out = call("motion", "check", "taie2024", "--robot", "panda", "--payload", payload).out
        torque[payload] = float(re.search(r"panda_joint2.* ([\d.]+) \(\d+ %\)$", out, re.MULTILINE)[1])
    assert torque["none"] > torque["franka-hand"] > torque["rated"]


def test_motion_exports_and_random_motions_are_files(call, tmp_path):
    path = _random(call, tmp_path)
    assert load_motion(path).n == 7
    call("motion", "export", path, "--format", "ros2", "--out", tmp_path / "m.yaml")
    assert "panda_joint7" in (tmp_path / "m.yaml").read_text()
    call("motion", "export", "random:4", "--format", "csv", "--rate", "50", "--out", tmp_path / "m.csv")
    table = np.loadtxt(tmp_path / "m.csv", delimiter=",", skiprows=1)
    assert table[:, 1:8] == pytest.approx(load_motion(path)(table[:, 0])[0], abs=1e-8)


def test_motion_show_has_a_line_per_joint_with_its_peaks(call):
    out = call("motion", "show", "taie2024").out
    t = np.linspace(0, 6, 1001)
    fastest = np.abs(taie2024()(t)[1]).max(axis=0)
    for joint, speed in enumerate(fastest, start=1):
        assert any(line.split()[:1] == [str(joint)] and f"{speed:.3f}" in line for line in out.splitlines())


def _random(call, folder):
    path = folder / "random.json"
    call("motion", "random", "--robot", "panda", "--seed", "4", "--out", path)
    return path


def text_of(path):
    """The words of an HTML page, without its style sheet."""
    words = re.sub(r"<style>.*?</style>|src=\"data:[^\"]*\"", "", path.read_text(), flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", " ", words))

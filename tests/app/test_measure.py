"""`armload measure` as a user has it: what is printed, exit codes, Ctrl-C and kill −9 in the middle."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from armload.app.cli import main
from armload.arms import arm
from armload.errors import ArmloadError
from armload.identification import identify
from armload.motion import FourierMotion, load_motion, save_motion, taie2024
from armload.payloads import test_payload as held_payload
from armload.payloads import write_payload
from armload.payloads.uncertainty import Uncertainty
from armload.recording import read_recording, write_recording
from armload.simulation import World, simulate

QUICK = ("--robot", "panda", "--speed", "max", "--method", "map", "--world", "nominal")


@pytest.fixture
def motion(tmp_path):
    """A quarter of taie2024 in two thirds of the time."""
    whole = taie2024()
    small = FourierMotion(whole.offset, 0.25 * whole.sine, 0.25 * whole.cosine, 4.0, "small")
    save_motion(tmp_path / "small.json", small)
    return str(tmp_path / "small.json")


@pytest.mark.full  # a design takes some seconds
@pytest.mark.parametrize("robot", ["ur5e", "fr3"])  # whose middle is at the floor, or cannot hold what it is rated for
def test_a_simulated_arm_is_measured_where_a_motion_may_begin(robot, capsys):
    assert main(["measure", "sim", "--robot", robot, "--dry-run", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["movements"]) == 2


def test_a_dry_run_says_what_would_move_and_makes_nothing(motion, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["measure", "sim", *QUICK, "--motion", motion, "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert "panda will move for 8.0 s" in out
    assert "1. without the payload: small, 4.0 s" in out
    assert "panda_joint7" in out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small.json"]
    assert main(["measure", "sim", *QUICK, "--motion", motion, "--dry-run", "--json", "--at", "0,0,0,-2,0,2,0"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [move["purpose"] for move in said["movements"]] == [
        "to the start",
        "without the payload",
        "with the payload",
    ]


def test_the_whole_way_prints_and_writes_the_answer(motion, tmp_path, capsys):
    out = tmp_path / "answer.json"
    arguments = ["--motion", motion, "--move", "--dir", str(tmp_path / "logs"), "--out", str(out), "--json"]
    assert main(["measure", "sim", *QUICK, *arguments, "--mass", "1.48±0.001"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == json.loads(out.read_text())
    assert said["mass"] == pytest.approx(1.48, abs=0.003)
    assert np.allclose(said["com"], held_payload().parameters.com, atol=0.005)
    assert said["relative_to"] == "tare"
    assert [os.path.basename(said["measurement"][log]) for log in ("empty", "loaded")] == ["empty.csv", "loaded.csv"]


def test_an_answer_that_cannot_be_written_any_more_is_printed_all_the_same(motion, tmp_path, capfd):
    out = tmp_path / "answers" / "answer.json"
    out.parent.mkdir()
    arguments = ["--motion", motion, "--move", "--dir", str(tmp_path / "logs"), "--out", str(out), "--json"]
    assert main(["measure", "sim", *QUICK, *arguments, "--grip", f"rmdir '{out.parent}'"]) == 2
    said, notes = capfd.readouterr()
    assert json.loads(said)["relative_to"] == "tare"
    assert f"{out} cannot be written" in notes.splitlines()[-1]
    assert f"{tmp_path}/logs/loaded.csv" in notes.splitlines()[-2]


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (("--method", "commanded"), "cannot follow a live stream"),
        (("--method", "hybird"), "did you mean 'hybrid'"),
        (("--method", "joint", "--com", "0,0,0.05±0.01"), "cannot use what is known of a payload"),
        (("--method", "rls-filter", "--mass", "1.48±0.001"), "cannot use what is known of a payload"),
        (("--method", "map", "--family", "wide"), "has learned of no families"),
        (("--method", "hybrid", "--family", "spoons"), "spoons"),
    ],
)
def test_what_no_answer_could_rest_on_is_said_before_the_arm_moves(said, why, motion, tmp_path, capsys):
    logs = tmp_path / "logs"
    assert main(["measure", "sim", *QUICK, "--motion", motion, "--move", "--dir", str(logs), *said]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert why in printed.err.splitlines()[-1]
    assert not logs.exists()


@pytest.mark.full  # some seconds
def test_a_drawing_tells_the_inertia_that_a_run_of_some_seconds_does_not(motion, tmp_path, capsys):
    held = replace(held_payload(), uncertainty=Uncertainty(mass=0.01, com=0.002, inertia=0.05))
    write_payload(tmp_path / "held.json", held)
    found = {}
    for name, more in {"plain": (), "drawn": ("--body", str(tmp_path / "held.json"))}.items():
        where = ["--dir", str(tmp_path / name), "--json"]
        assert main(["measure", "sim", *QUICK, "--motion", motion, "--move", *where, *more]) == 0
        found[name] = json.loads(capsys.readouterr().out)
    low, high = (np.array(found["drawn"][edge]) for edge in ("phi_low", "phi_high"))
    phi = arm("panda").in_frame(held.parameters).phi
    assert np.sum((low <= phi) & (phi <= high)) >= 9
    assert (high - low)[4:].mean() < 0.5 * np.subtract(found["plain"]["phi_high"], found["plain"]["phi_low"])[4:].mean()
    assert all(found["drawn"]["determined"])


@pytest.mark.full  # some seconds
def test_a_payload_that_is_on_already_is_measured_with_the_log_of_the_empty_arm(motion, tmp_path, capsys):
    panda = arm("panda")
    log = simulate(panda, load_motion(motion), world=World.nominal(panda), rate=200.0)
    write_recording(tmp_path / "before.csv", log)
    arguments = ["--motion", motion, "--move", "--dir", str(tmp_path / "logs"), "--json"]
    assert main(["measure", "sim", *QUICK, *arguments, "--tare", str(tmp_path / "before.csv")]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["mass"] == pytest.approx(1.48, abs=0.05)
    assert said["measurement"]["empty"] is None
    assert not (tmp_path / "logs" / "empty.csv").exists()


@pytest.mark.full
def test_with_a_known_tool_on_in_both_runs_the_answer_is_what_it_carries(motion, tmp_path, capsys):
    arguments = ["--motion", motion, "--move", "--dir", str(tmp_path / "logs"), "--json", "--tool", "franka-hand"]
    assert main(["measure", "sim", *QUICK, *arguments]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["mass"] == pytest.approx(1.48, abs=0.03)
    assert np.allclose(said["com"], held_payload().parameters.com, atol=0.01)
    # the log of the empty run shows the hand: the bare arm's model finds it there
    hand = identify(tmp_path / "logs" / "empty.csv", "panda", method="map")
    assert hand.mass == pytest.approx(0.73, abs=0.1)


def test_without_a_motion_one_about_the_present_pose_is_designed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    pose = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
    at = ["--at", ",".join(map(str, pose)), "--time", "1", "--mass", "1.48±0.01"]
    assert main(["measure", "sim", *QUICK, "--dry-run", "--json", *at]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [move["purpose"] for move in said["movements"]] == ["without the payload", "with the payload"]
    assert [move["motion"] for move in said["movements"]] == ["designed", "designed"]


@pytest.mark.usefixtures("far_east")
def test_a_folder_that_nobody_named_is_called_by_the_time_in_utc(motion, tmp_path, monkeypatch):
    """Local time goes through one hour twice a year, and is another where the logs are read."""
    monkeypatch.chdir(tmp_path)
    folders = []

    def begun(*given, **_):
        folders.append(given[3])
        raise ArmloadError("enough")

    monkeypatch.setattr("armload.measuring.Procedure", begun)
    began = datetime.now(UTC).replace(microsecond=0)
    assert main(["measure", "sim", *QUICK, "--motion", motion, "--dry-run"]) == 2
    when = datetime.strptime(folders[0], "measurement-%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
    assert began <= when <= datetime.now(UTC)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--motion", "MOTION"], "nothing was moved: nobody is at a terminal to agree"),
        (["--motion", "MOTION", "--move", "--floor", "0.6"], "the arm hits the floor"),
        (["--motion", "MOTION", "--move", "--box", "0.5,0,0.6,0.3,0.3,0.3"], "the arm hits a box"),
        (["--at", "0,1,2", "--dry-run"], "--at has 3 joint positions: panda has 7"),
        (["--at", "0,-0.5,0,-2,0,1.6,0.8", "--move", "--box", "0.5,0,0.6,0.3,0.3,0.3"], "is at box 1"),
        (["--at", "0,-0.5,0,-2,0,1.6,0.8", "--move", "--floor", "0.6"], "--box and, of `armload motion`, --held)"),
        (
            ["--at", "0,0.9,0,-0.9,0,1.6,0.8", "--move", "--mass", "4.5±0.01"],
            "`armload motion design` makes, for --motion",
        ),
        (["--motion", "MOTION", "--move", "--tool", "franka-hand", "--tare", "t.csv"], "--tool and --tare together"),
        (["--motion", "MOTION", "--move", "--tool", "franka-hand", "--mounted", "nothing"], "give one of them"),
        (["--motion", "MOTION", "--move", "--until", "weight=10g"], "is no accuracy: expected"),
        (["--motion", "MOTION", "--move", "--apply"], "takes no payload: leave out --apply"),
        (["--motion", "MOTION", "--move", "--tare-age", "1d"], "there is no --tare"),
        (["--motion", "MOTION", "--move", "--grip", "no-such-gripper --close"], "is no command: expected a program"),
        (["--motion", "MOTION", "--move", "--grip", "close 'it"], "is no command: no closing quotation"),
        (["--motion", "MOTION", "--move", "--grip", ""], "is no command: expected a program"),
        (["--motion", "MOTION", "--move", "--at", "0,0,0,-2,0,2,0", "--approach", "0.1"], "more than the 0.1 rad"),
        (
            ["--motion", "MOTION", "--at", "1e300,0,0,-2,0,2,0"],
            "panda_joint1 at 1e+300 rad: expected -2.8973",
        ),
        (["--motion", "MOTION", "--move", "--dir", "logs", "--out", "logs"], "is written by another option, too"),
        (["--motion", "MOTION", "--move", "--dir", ".", "--out", "loaded.csv"], "measurement's own loaded.csv"),
    ],
)
def test_what_cannot_be_is_one_sentence_and_nothing_is_made(arguments, said, motion, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = [motion if word == "MOTION" else word for word in arguments]
    assert main(["measure", "sim", *QUICK, *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err.splitlines()[-1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small.json"]


@pytest.mark.parametrize(
    ("mass", "frame", "said"),
    [(0.4, "panda_link5", "joints lie between the two"), (400.0, "panda_link8", "weighs 400 kg: expected at most")],
)
def test_what_cannot_have_been_mounted_is_refused_before_the_arm_moves(mass, frame, said, motion, tmp_path, capsys):
    content = {"mass": mass, "com": [0, 0, 0.05], "inertia_com": np.diag([1e-3] * 3).tolist(), "frame": frame}
    (tmp_path / "gripper.json").write_text(json.dumps(content))
    mounted = ["--apply", "--mounted", str(tmp_path / "gripper.json")]
    assert main(["measure", "sim", *QUICK, "--motion", motion, "--move", *mounted]) == 2
    assert said in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.full  # some seconds
def test_sigterm_while_the_payload_is_mounted_ends_as_ctrl_c_does(motion, tmp_path):
    logs = tmp_path / "logs"
    command = [sys.executable, "-m", "armload", "measure", "sim", *QUICK, "--motion", motion, "--move"]
    grip = "sh -c 'kill -TERM $PPID; sleep 5'"
    done = subprocess.run([*command, "--dir", logs, "--grip", grip], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.splitlines()[-1] == "armload: interrupted"
    assert f"--tare {logs / 'empty.csv'} goes on from there" in done.stderr.splitlines()[-2]
    assert not (logs / "loaded.csv").exists()


def test_without_standard_input_nobody_agrees_and_no_pipe_takes_its_place(motion, tmp_path):
    program = (
        "import os, sys; from armload.app.cli import main; code = main(sys.argv[1:]); "
        "assert min(os.pipe()) > 2; sys.exit(code)"
    )
    arguments = ["measure", "sim", *QUICK, "--motion", motion, "--dir", str(tmp_path / "logs")]
    command = ["sh", "-c", 'exec "$@" <&-', "sh", sys.executable, "-c", program, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert "nothing was moved: nobody is at a terminal to agree" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.full)])
@pytest.mark.full  # some seconds
def test_what_is_ended_in_the_middle_leaves_a_log_that_can_be_read(number, motion, tmp_path):
    log = tmp_path / "logs" / "empty.csv"
    command = [sys.executable, "-m", "armload", "measure", "sim", "--robot", "panda", "--motion", motion, "--move"]
    process = subprocess.Popen(
        ["env", "--default-signal=INT", *command, "--dir", str(log.parent)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 60.0
    while not (log.exists() and log.stat().st_size > 200_000) and time.monotonic() < until:
        time.sleep(0.05)
    process.send_signal(number)
    out, err = process.communicate(timeout=30.0)
    assert out == ""
    recording = read_recording(log, arm("panda"))
    assert 0.3 < recording.duration < 3.9
    assert np.abs(recording.dq).max() > 0.02
    if number == signal.SIGINT:
        assert process.returncode == 130
        assert err.splitlines()[-1] == "armload: interrupted"
        assert np.abs(recording.dq[-20:].mean(axis=0)).max() < 0.01

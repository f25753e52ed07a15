"""Logs under other names on the command line: --columns, --effort-key, --rate, --episode where logs are read."""

import json

import numpy as np
import pytest

from armload.app.cli import main
from armload.payloads import test_payload
from armload.recording import write_recording

SPEC = "t=clock,q=enc_{i},dq=rate_{i},tau=load_{i}"
ROBOT = ("--robot", "panda", "--method", "rls")


@pytest.fixture(scope="module")
def logs(panda, tmp_path_factory):
    """A folder with one log in two forms, and a tare; the names of the other form tell nothing."""
    folder = tmp_path_factory.mktemp("logs")
    t = np.arange(800) / 200
    angle = t[:, None] * (2.0 + 0.35 * np.arange(7)) + np.arange(7)
    pose, w = np.array([0.2, -0.6, 0.3, -1.8, 0.2, 1.6, 0.4]), 2.0 + 0.35 * np.arange(7)
    q, dq, ddq = pose + 0.4 * np.sin(angle), 0.4 * w * np.cos(angle), -0.4 * w**2 * np.sin(angle)
    from armload.recording import Recording

    for name, arm in (("run", panda.with_payload(test_payload().parameters)), ("tare", panda)):
        log = Recording(t, q, dq, arm.torque(q, dq, ddq))
        write_recording(folder / f"{name}.csv", log)
        text = (folder / f"{name}.csv").read_text()
        header = ["clock", *(f"{n}_{k}" for n in ("enc", "rate", "load") for k in range(7))]
        (folder / f"{name}_odd.csv").write_text(",".join(header) + text[text.index("\n") :])
        np.savez(folder / f"{name}.npz", positions=log.q, velocities=log.dq, drive=log.tau)
    return folder


def run(capsys, *argv):
    code = main([str(word) for word in argv])
    return code, *capsys.readouterr()


def test_identify_says_the_same_of_named_columns(logs, capsys):
    plain = run(capsys, "identify", logs / "run.csv", "--tare", logs / "tare.csv", *ROBOT, "--json")
    odd = run(
        capsys, "identify", logs / "run_odd.csv", "--tare", logs / "tare_odd.csv", *ROBOT, "--columns", SPEC, "--json"
    )
    assert (plain[0], odd[0]) == (0, 0), odd[2]
    expected, found = json.loads(plain[1]), json.loads(odd[1])
    np.testing.assert_allclose(found["phi"], expected["phi"], rtol=0, atol=1e-9)
    assert expected.keys() == found.keys()
    assert "read t from 'clock'" in odd[2]
    assert "read t from" not in plain[2]


def test_a_log_without_times_and_with_a_torque_of_its_own_name_reads(logs, capsys):
    code, out, err = run(
        capsys,
        *("identify", logs / "run.npz", "--tare", logs / "tare.npz", *ROBOT),
        *("--rate", "200", "--effort-key", "drive", "--json"),
    )
    assert code == 0, err
    expected = json.loads(run(capsys, "identify", logs / "run.csv", "--tare", logs / "tare.csv", *ROBOT, "--json")[1])
    np.testing.assert_allclose(json.loads(out)["phi"], expected["phi"], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "command",
    [
        ("identify", "run_odd.csv", "--robot", "panda"),
        ("report", "run_odd.csv", "--robot", "panda", "--out", "report.html"),
        ("live", "run_odd.csv", "--robot", "panda", "--headless", "--speed", "max"),
        ("live", "run_odd.csv", "--robot", "panda", "--headless", "--tare", "tare_odd.csv"),
        ("motion", "check", "run_odd.csv", "--robot", "panda"),
        ("ros2", "node", "--robot", "panda", "--tare", "tare_odd.csv"),
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_every_command_that_reads_logs_takes_columns(logs, capsys, monkeypatch, command):
    monkeypatch.chdir(logs)
    code, out, err = run(capsys, *command)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "has no columns named q1, dq1, tau1" in err
    code, _, err = run(capsys, *command, "--columns", SPEC.replace("load", "lode"))
    assert code == 2
    assert "has no column 'lode_{i}', which --columns names for tau" in err


def test_a_live_replay_reads_named_columns(logs, capsys):
    argv = ("live", logs / "run_odd.csv", "--robot", "panda", "--headless", "--speed", "max", "--method", "rls")
    code, out, err = run(capsys, *argv, "--columns", SPEC, "--every", "1")
    assert code in (0, None), err
    assert out.count("\n") >= 3


def test_motion_check_reads_named_columns(logs, capsys):
    code, out, err = run(
        capsys, "motion", "check", logs / "run_odd.csv", "--robot", "panda", "--columns", SPEC, "--json"
    )
    assert code in (0, 3), err
    assert json.loads(out)["kind"] == "log"


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("--columns", "q:enc"), "is not KEY=VALUE"),
        (("--columns", SPEC, "--effort-key", "other"), "tau is given twice, as 'load_{i}' and as 'other'"),
        (("--columns", SPEC, "--rate", "100"), "has times (column 'clock')"),
        (("--columns", SPEC, "--episode", "1"), "has no column 'episode_index'"),
        (("--rate", "0"), "is not possible"),
    ],
)
def test_columns_that_cannot_be_meant_are_one_sentence(logs, capsys, argv, says):
    code, out, err = run(capsys, "identify", logs / "run_odd.csv", "--robot", "panda", *argv)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err


def test_columns_for_a_robot_without_a_log_are_refused(capsys):
    code, _, err = run(capsys, "live", "sim", "--headless", "--columns", SPEC)
    assert code == 2
    assert "--columns and its companions are for logs" in err


IDENTIFY = ("identify", "run_odd.csv", *ROBOT, "--columns", SPEC, "--json")


@pytest.mark.full  # some seconds
def test_a_tare_from_another_tool_has_columns_of_its_own(logs, capsys, monkeypatch):
    monkeypatch.chdir(logs)
    expected = json.loads(run(capsys, "identify", "run.csv", "--tare", "tare.csv", *ROBOT, "--json")[1])["phi"]
    named = "rate=200,q=positions,dq=velocities,tau=drive"
    for tare, spec in (("tare.csv", "none"), ("tare.csv", "t=t"), ("tare_odd.csv", SPEC), ("tare.npz", named)):
        code, out, err = run(capsys, *IDENTIFY, "--tare", tare, "--tare-columns", spec)
        assert code == 0, err
        np.testing.assert_allclose(json.loads(out)["phi"], expected, rtol=0, atol=1e-9, err_msg=f"{tare} {spec}")


def test_a_tare_that_lacks_the_columns_of_the_log_is_told_how_to_be_read(logs, capsys, monkeypatch):
    monkeypatch.chdir(logs)
    code, out, err = run(capsys, *IDENTIFY, "--tare", "tare.csv")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "tare.csv has no column 'enc_{i}'" in err
    assert err.endswith("if the tare's own header says all, add --tare-columns none\n")
    code, _, err = run(capsys, *IDENTIFY, "--tare", "tare.npz")  # whose header does not say all
    assert code == 2
    assert "--tare-columns" not in err
    for option in (("--tare-columns", "none"), ("--tare-episode", "0")):
        code, _, err = run(capsys, *IDENTIFY, *option)
        assert (code, "but there is no --tare" in err) == (2, True)


def test_log_and_tare_may_be_episodes_of_one_file(logs, capsys, monkeypatch):
    monkeypatch.chdir(logs)
    import pyarrow as pa
    from pyarrow import parquet

    from armload.recording import read_recording
    from armload.recording.columns import column_names

    both = [read_recording(f"{name}.csv") for name in ("tare", "run")]
    table = np.vstack([np.column_stack([log.t, log.q, log.dq, log.tau]) for log in both])
    columns = dict(zip(column_names(7), table.T, strict=True)) | {"episode_index": np.repeat([0, 1], 800)}
    parquet.write_table(pa.table(columns), "both.parquet")
    expected = json.loads(run(capsys, "identify", "run.csv", "--tare", "tare.csv", *ROBOT, "--json")[1])["phi"]
    episodes = ("--episode", "1", "--tare-episode", "0")
    code, out, err = run(capsys, "identify", "both.parquet", "--tare", "both.parquet", *episodes, *ROBOT, "--json")
    assert code == 0, err
    np.testing.assert_allclose(json.loads(out)["phi"], expected, rtol=0, atol=1e-9)
    code, out, err = run(
        capsys, "identify", "both.parquet", "--tare", "tare.csv", "--episode", "1", *ROBOT, "--json"
    )  # a tare without episodes is read whole
    assert code == 0, err
    np.testing.assert_allclose(json.loads(out)["phi"], expected, rtol=0, atol=1e-9)
    code, _, err = run(capsys, "motion", "check", "both.parquet", "--tare", "both.parquet", *episodes, *ROBOT[:2])
    assert code in (0, 3), err


def test_what_was_read_of_log_and_tare_alike_is_said_once(logs, capsys, monkeypatch):
    monkeypatch.chdir(logs)
    _, _, err = run(capsys, *IDENTIFY, "--tare", "tare_odd.csv")
    assert err.count("read t from 'clock'") == 1
    assert "run_odd.csv and tare_odd.csv: read t from 'clock'" in err
    _, out, _ = run(
        capsys, *IDENTIFY, "--tare", "tare.npz", "--tare-columns", "rate=200,q=positions,dq=velocities,tau=drive"
    )
    notes = [note for note in json.loads(out)["notes"] if ": read " in note]
    assert [note.partition(":")[0] for note in notes] == ["run_odd.csv", "tare.npz"]

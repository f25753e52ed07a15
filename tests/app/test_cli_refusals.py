"""Every log that must not be answered is refused in one sentence that names the place, with nothing on stdout."""

import numpy as np
import pytest

from armload.app.cli import main
from armload.app.cli.live import parser as live_parser
from armload.app.cli.live import without_effect
from armload.recording import write_recording

ROBOT = ("--robot", "panda")


@pytest.fixture(scope="module")
def log_text(panda, tmp_path_factory):
    """A sound log of a bare Panda as CSV: header and 240 lines of 4 s."""
    from armload.recording import Recording

    t = np.arange(240) / 60
    pose = np.array([0.2, -0.6, 0.3, -1.8, 0.2, 1.6, 0.4])
    joints = np.arange(7)
    angle = 3.0 * t[:, None] + joints
    q, dq, ddq = pose + 0.4 * np.sin(angle), 1.2 * np.cos(angle), -3.6 * np.sin(angle)
    path = tmp_path_factory.mktemp("log") / "sound.csv"
    write_recording(path, Recording(t, q, dq, panda.torque(q, dq, ddq)))
    return path.read_text()


@pytest.fixture
def refused(capfd):
    """Call identify and return the one line it must say; what C++ libraries print counts too."""

    def call(*argv, json=True):
        code = main(["identify", *map(str, argv), *(["--json"] if json else [])])
        out, err = capfd.readouterr()
        assert (code, out) == (2, ""), err
        assert err.count("\n") == 1, err
        assert "Traceback" not in err
        assert not set(err) & set("│╭╮╰╯─┌┐└┘")
        return err

    return call


def with_cell(text, line, column, value):
    """The CSV text with one cell replaced; the header is line 1."""
    lines = text.splitlines()
    cells = lines[line - 1].split(",")
    cells[lines[0].split(",").index(column)] = value
    lines[line - 1] = ",".join(cells)
    return "\n".join(lines) + "\n"


def scaled(text, prefix, factor):
    """The CSV text with the columns of one quantity multiplied."""
    header, *rows = (line.split(",") for line in text.splitlines())
    concerned = [k for k, name in enumerate(header) if name.rstrip("0123456789") == prefix]
    for row in rows:
        for k in concerned:
            row[k] = repr(float(row[k]) * factor)
    return "\n".join(",".join(row) for row in (header, *rows)) + "\n"


def test_the_sound_log_is_answered(log_text, tmp_path, capsys):
    path = tmp_path / "log.csv"
    path.write_text(log_text)
    assert main(["identify", str(path), *ROBOT, "--json"]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("json", [True, False])
@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda s: with_cell(s, 9, "t", "0.05"), ["line 9", "t"]),
        (lambda s: with_cell(s, 31, "dq4", "NaN"), ["line 31", "dq4"]),
        (lambda s: with_cell(s, 17, "tau6", "inf"), ["line 17", "tau6"]),
        (lambda s: with_cell(s, 12, "q2", "fast"), ["line 12", "q2", "fast"]),
        (lambda s: with_cell(s, 12, "q2", ""), ["line 12", "q2"]),
        (lambda s: s.replace("\n", ",1.0\n").replace(",1.0\n", "\n", 1), ["line 2", "23 cells", "22"]),
        (lambda s: "\n".join(line.rsplit(",", 1)[0] for line in s.splitlines()), ["tau7"]),
        (lambda s: "\n".join([*s.splitlines()[:20], s.splitlines()[20].rsplit(",", 1)[0], ""]), ["line 21"]),
        (lambda s: scaled(scaled(s, "q", 180 / np.pi), "dq", 180 / np.pi), ["degrees", "q"]),
        (lambda s: scaled(s, "dq", 180 / np.pi), ["dq1", "degrees"]),
        (lambda s: scaled(s, "tau", -1.0), ["tau", "sign"]),
        (lambda s: scaled(s, "tau", 0.0), ["tau"]),
        (lambda s: s.splitlines()[0] + "\n", ["no rows"]),
        (lambda s: "\n".join(s.splitlines()[:2]) + "\n", ["1 row"]),
        (lambda _: "", ["empty"]),
        (lambda _: "\n\n  \n", ["empty"]),
        (lambda s: "\n".join(s.splitlines()[1:]), ["line 1", "header"]),
        (lambda s: s.replace(",", ";").replace(";", ",", 21), ["line 2", "1 cells", "22"]),
    ],
)
def test_a_bad_csv_is_refused_by_place(refused, log_text, tmp_path, change, named, json):
    path = tmp_path / "log.csv"
    path.write_text(change(log_text))
    text = refused(path, *ROBOT, json=json)
    assert "log.csv" in text
    for word in named:
        assert word in text


@pytest.mark.parametrize("evil", ["\x1b[2J\x1b[1;1H", "\a\b\x7f", "\u202e", "\x9b31m"])
def test_a_name_from_a_file_gives_the_terminal_no_orders(refused, tmp_path, evil):
    path = tmp_path / "log.csv"
    path.write_text(f"time,{evil}q1\n0,1\n1,2\n", encoding="utf-8")
    for text in (refused(path, *ROBOT), refused(tmp_path / f"{evil}.csv", *ROBOT)):
        assert text.strip().isprintable()
        assert repr(evil)[1:-1].lower() in text.lower()


def test_a_log_of_another_arm_is_refused(refused, log_text, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(log_text)
    text = refused(path, "--robot", "ur10e")
    assert "7 joints" in text
    assert "ur10e" in text


def test_a_log_of_another_arm_with_as_many_joints_is_refused(refused, log_text, tmp_path):
    # The joints of a Panda numbered from the flange: within limits or not, the torque cannot be a Panda's
    header, *rows = (line.split(",") for line in log_text.splitlines())
    turned = ["t", *(f"{kind}{8 - j}" for kind in ("q", "dq", "tau") for j in range(1, 8))]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(",".join(row) for row in (turned, *rows)) + "\n")
    assert "panda" in refused(path, *ROBOT)
    assert header[0] == "t"


def test_an_unknown_robot_or_frame_is_refused_with_the_choices(refused, log_text, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(log_text)
    text = refused(path, "--robot", "pandda")
    assert "'pandda'" in text
    assert "ur10e" in text
    text = refused(path, *ROBOT, "--frame", "tool9")
    assert "'tool9'" in text
    assert "panda_link8" in text


@pytest.mark.parametrize(
    "content",
    [
        b"<robot name='x'>",
        b"<html/>",
        b"\xff\xfe\x00binary",
        b"",
        b"<robot name='x'><link name='a'/></robot>",
        # refused by the URDF parser only, which prints several lines of its own
        b"<robot name='x'><link name='a'/><link name='b'/><joint name='turn' type='revolute'><parent link='a'/>"
        b"<child link='b'/><axis xyz='0 0 1'/></joint></robot>",
    ],
)
def test_a_robot_description_that_is_none_is_refused(refused, log_text, tmp_path, content):
    path, robot = tmp_path / "log.csv", tmp_path / "arm.urdf"
    path.write_text(log_text)
    robot.write_bytes(content)
    assert "arm" in refused(path, "--robot", robot)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz", ".bag", ".db3", ".mcap"])
@pytest.mark.parametrize("content", [b"", b"\x00\x01\x02\xff" * 300], ids=["empty", "binary"])
def test_a_file_that_is_no_log_is_refused(refused, tmp_path, suffix, content):
    path = tmp_path / f"junk{suffix}"
    path.write_bytes(content)
    assert f"junk{suffix}" in refused(path, *ROBOT)


def test_an_empty_name_is_refused(refused):
    assert "LOG" in refused("", *ROBOT)
    for option in ("--tare", "--tool", "--method"):
        assert f"{option}: the name is empty" in refused("log.csv", *ROBOT, option, "")


def test_what_is_not_there_or_not_a_log_is_refused(refused, tmp_path, log_text):
    assert "none.csv" in refused(tmp_path / "none.csv", *ROBOT)
    assert str(tmp_path) in refused(tmp_path, *ROBOT)
    odd = tmp_path / "log.xlsx"
    odd.write_text(log_text)
    assert ".xlsx" in refused(odd, *ROBOT)


@pytest.mark.parametrize("command", ["identify", "live"])
def test_a_log_under_another_name_is_no_tare_for_itself(capsys, panda, analytic_log, tmp_path, command):
    log = analytic_log(panda, duration=1.0, rate=100.0)
    write_recording(tmp_path / "run.csv", log)
    write_recording(tmp_path / "before.npz", log.select(slice(40)))
    argv = [command, str(tmp_path / "run.csv"), "--robot", "panda", "--tare", str(tmp_path / "before.npz")]
    assert main([*argv, *(["--headless"] if command == "live" else [])]) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert "before.npz and the log" in captured.err
    assert "share 40 measured samples" in captured.err


def test_a_bag_cut_off_in_the_middle_is_refused(refused, real_data, tmp_path):
    whole = (real_data / "ur10_ros2_bag.db3").read_bytes()
    path = tmp_path / "cut.db3"
    path.write_bytes(whole[: len(whole) // 3])
    assert "cut.db3" in refused(path, "--robot", "ur10e")


def test_a_bag_of_another_arm_is_refused_by_its_joints(refused, real_data):
    text = refused(real_data / "ur10_ros2_bag.db3", *ROBOT)
    assert "panda_joint1" in text


def test_a_bad_tare_tool_or_method_is_refused_by_name(refused, log_text, tmp_path):
    path, tare, tool = tmp_path / "log.csv", tmp_path / "tare.csv", tmp_path / "tool.json"
    path.write_text(log_text)
    tare.write_text(with_cell(log_text, 5, "q3", "nan"))
    text = refused(path, *ROBOT, "--tare", tare)
    assert "tare.csv, line 5" in text
    assert "q3" in text
    tool.write_text('{"mass": 1.0}')
    assert "tool.json" in refused(path, *ROBOT, "--tool", tool)
    assert "no_tool.json" in refused(path, *ROBOT, "--tool", tmp_path / "no_tool.json")
    tool.write_text('{"phi": [1, 0, 0, 0, 0.01, 0, 0, 0.01, 0, 0.01], "frame": "moon"}')
    assert "'moon'" in refused(path, *ROBOT, "--tool", tool)
    assert "'magic'" in refused(path, *ROBOT, "--method", "magic")
    tool.write_text("no model")
    assert "tool.json" in refused(path, *ROBOT, "--method", tool)


def test_a_log_with_the_wrong_gravity_is_refused(refused, log_text, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(log_text)
    assert "--gravity" in refused(path, *ROBOT, "--gravity", "0,0,9.81")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--headless", "--port", "8081"], "--port is of the page"),
        (["--headless", "--host", "0.0.0.0"], "--host is of the page"),
        (["--headless", "--token-file", "token"], "--token-file is of the page"),
        (["--every", "0.5"], "--every is of --headless"),
        (["--loop"], "--loop replays a log again and again, but sim is none"),
        (["--topic", "/joint_states"], "--topic is of a bag, and sim is none"),
        (["fr3://172.16.0.2", "--speed", "2"], "--speed is of a log or the simulator, but the source is fr3://"),
    ],
)
def test_an_option_of_live_that_changes_nothing_is_said(options, said):
    (line,) = without_effect(live_parser().parse_args(options))
    assert said in line
    assert without_effect(live_parser().parse_args(["run.csv", "--headless", "--every", "1", "--loop"])) == []

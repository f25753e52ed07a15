"""What can never be ends the service as it begins, with the reason; what may come is waited for."""

import os

import pytest

from armload.app.cli import main
from armload.devices import Detached
from armload.devices.reader import columns_of
from armload.errors import SourceError
from armload.service import ArmSettings, Service, ServiceSettings
from armload.service.ready import ready
from armload.service.reconnecting import Reconnecting
from armload.service.spare import Spare


@pytest.fixture
def cell(tmp_path):
    """Writes a service file of one arm with more settings than its name, robot and source."""

    def write(source, *more):
        lines = ["spare = false", "[[arm]]", 'name = "left"', 'robot = "panda"', f'source = "{source}"', *more]
        (tmp_path / "cell.toml").write_text("\n".join(lines))
        return str(tmp_path / "cell.toml")

    return write


def test_a_spare_process_makes_ready_for_the_arm_up_to_its_own_frame():
    (kind,) = Spare([ArmSettings(name="left", source="sim", robot="panda", frame="panda_link4", method="map-gp")]).kinds
    (reader,) = ready([kind])
    assert reader.ring.columns == columns_of(4)
    reader.end(5.0)
    reader.release()


@pytest.mark.parametrize("duration", ["0", "60"])
@pytest.mark.parametrize("key", ["source", "tare", "profile", "tool"])
def test_a_file_that_does_not_exist_is_said_before_a_service_begins_however_short_it_is(cell, capsys, key, duration):
    file = cell("none.csv") if key == "source" else cell("sim", f'{key} = "none.csv"')
    assert main(["serve", file, "--quiet", "--duration", duration]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert f"left: {key}: " in said
    assert "none.csv does not exist: expected the path of a" in said


@pytest.mark.parametrize(
    ("source", "more", "said"),
    [
        ("foo://1", "", "left: foo://1: unknown kind of source 'foo': expected fr3://"),
        ("fr3://", "", "left: fr3:// names no robot: expected fr3://ADDRESS"),
        ("ur://1.2.3.4?torque=3", "", "unknown option 'torque'"),
        ("sim", 'save = "cell.toml"', "left: its state cannot be kept in"),
        ("sim", 'save = "/proc/state"', "name a folder that can be written into"),
        ("sim", 'record = "none/run.csv"', "left: its record cannot be kept in"),
    ],
)
def test_an_address_or_a_folder_that_cannot_be_used_is_said_before_anything_begins(cell, capsys, source, more, said):
    assert main(["serve", cell(source, more), "--quiet", "--duration", "60"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


@pytest.mark.parametrize(
    ("source", "robot", "module", "said"),
    [
        ("ur://127.0.0.1", "ur10e", "rtde_receive", "ur-rtde, which cannot be imported (not here): pip install"),
        ("fr3://127.0.0.1", "fr3", "pylibfranka", "pylibfranka, which cannot be imported (not here): pip install"),
        ("ros2:///joint_states", "panda", "rclpy", "ROS 2 is not there for this Python (not here)"),
        ("fr3://127.0.0.1", "ur10e", "pylibfranka", "ur10e has 6 joints: FR3 robots have 7"),
        ("ur://127.0.0.1", "ur5", "rtde_receive", "no torque constants are known for it"),
    ],
)
@pytest.mark.full  # some seconds
def test_a_robot_that_can_never_be_read_here_is_not_waited_for(
    monkeypatch, tmp_path, capsys, source, robot, module, said
):
    (tmp_path / f"{module}.py").write_text('raise ImportError("not here")')
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    assert main(["serve", source, "--robot", robot, "--quiet", "--duration", "120"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_a_state_s_folder_is_made(cell, tmp_path):
    main(["serve", cell("sim", 'save = "a/b"'), "--quiet", "--duration", "0"])
    assert (tmp_path / "a" / "b").is_dir()


def test_a_log_ends_at_its_first_failure_and_a_robot_is_tried_again(panda, tmp_path):
    missing = str(tmp_path / "none.csv")
    log = Reconnecting(lambda: Detached(missing, panda), name="log", n=7, comes=False)
    with pytest.raises(SourceError, match="does not exist"):
        list(log)
    tried = []

    def off():
        tried.append(1)
        if len(tried) == 3:
            robot.close()
        raise SourceError("it is off")

    robot = Reconnecting(off, name="robot", n=7)
    assert list(robot) == []
    assert len(tried) == 3


def test_a_line_has_the_same_fields_before_the_process_speaks():
    service = Service(ServiceSettings((ArmSettings(name="left", source="sim", robot="panda"),), spare=False))
    answer = service.answer("left")
    fields = [
        "arm",
        "known",
        "unknown",
        "why",
        "age",
        "lag",
        "connection",
        "connections",
        "restarts",
        "lost",
        "saved",
        "arm_changed",
        "alarms",
        "mass",
    ]
    assert set(fields) <= set(answer)
    service.close()

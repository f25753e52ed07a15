"""The ROS 2 packages: a lifecycle node with services and an action, and whom it tells what is held.

The tests marked full run the node beside nodes that offer what franka_ros2, ur_robot_driver and MoveIt do; they need
armload_msgs in the ROS 2 environment (tests/devices/ros/build_messages.py).
"""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from armload.payloads import test_payload as example_payload

ROOT = Path(__file__).resolve().parents[2]
ARMLOAD = ("-m", "armload", "ros2")
NODE = ("-m", "armload_ros.payload_identifier")
PROGRAMS = ROOT / "tests" / "devices" / "ros"


@pytest.fixture(scope="module")
def messages(ros_python):
    """The interfaces that are built, not installed."""
    look = "import armload_msgs.msg, franka_msgs.srv, ur_msgs.srv, moveit_msgs.srv, tf2_msgs.msg"
    done = subprocess.run([ros_python, "-c", look], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"messages are not built: {done.stderr.strip().splitlines()[-1]}")


@pytest.mark.full
def test_the_lifecycle_node_has_states_services_remapping_and_a_namespace(ros, wait_until, messages):
    names = ("__ns:=/left", "joint_states:=/joint_states")
    renamed = [word for name in names for word in ("-r", name)]
    given = [word for name in ("robot:=panda", "tare_duration:=4.0") for word in ("-p", name)]
    held = example_payload().parameters
    with (
        ros(*ARMLOAD, "simulate", "--robot", "panda", "--payload", "test", "--motion", "taie2024") as robot,
        ros(*NODE, "--ros-args", *renamed, *given) as node,
        ros(ROOT / "tests/devices/ros/drive_lifecycle.py", "/left/payload_identifier", 8) as driver,
    ):
        wait_until(lambda: driver.poll() is not None, 120, driver, node, robot)
        said = [json.loads(line) for line in driver.printed_lines()]
    steps = {line["step"]: (line["success"], line["state"]) for line in said if "step" in line}
    assert steps == {
        "configure": (True, "inactive"),
        "activate": (True, "active"),
        "deactivate": (True, "inactive"),
        "cleanup": (True, "unconfigured"),
    }
    assert [line["tare"] for line in said if "tare" in line] == [False, True]  # nobody listens before it is active
    reset = said.index({"reset": True})
    before, after = said[:reset], said[reset:]
    *_, body = (line for line in before if "payload" in line)
    assert body["frame"] == "panda_link8"
    assert abs(body["payload"] - held.mass) < 0.05
    *_, estimate = (line["estimate"] for line in before if "estimate" in line)
    assert estimate["low"] < held.mass < estimate["high"]
    assert any(line.get("level") == 0 and "kg, calibrated" in line["diagnostics"] for line in before)
    assert any("taring" in line.get("diagnostics", "") for line in after)
    *_, tared = (line["estimate"] for line in after if "estimate" in line)
    assert (tared["relative_to"], tared["held"]) == ("tare", False)  # what was mounted at the tare is the arm's


@pytest.mark.full
def test_the_lifecycle_node_stays_unconfigured_with_a_wrong_parameter_and_says_which(ros, wait_until, messages):
    with (
        ros(*NODE, "--ros-args", "-p", "robot:=pandas") as node,
        ros(ROOT / "tests/devices/ros/drive_lifecycle.py", "/payload_identifier", 1) as driver,
    ):
        wait_until(lambda: any("configure" in line for line in driver.printed_lines()), 60, driver, node)
        (line,) = driver.printed_lines()[:1]
        assert json.loads(line) == {"step": "configure", "success": False, "state": "unconfigured"}
        assert "unknown robot 'pandas'" in node.noted()


def test_the_ros_package_names_what_it_imports_and_installs_what_it_needs():
    folder = ROOT / "ros2" / "armload_ros"
    manifest = ElementTree.parse(folder / "package.xml").getroot()
    needs = {element.text for element in manifest.iter("exec_depend")}
    imported = set()
    for path in [*folder.glob("armload_ros/*.py"), *folder.glob("launch/*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module is not None:
                imported.add(node.module.split(".")[0])
            elif isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
    ours = {"armload", "numpy", *sys.stdlib_module_names, "__future__"}
    assert imported - ours == needs
    assert manifest.findtext("name") == "armload_ros"
    setup = (folder / "setup.py").read_text(encoding="utf-8")
    for path in ("launch/payload.launch.py", "config/payload.yaml", "package.xml"):
        assert path in setup
        assert (folder / path).exists()
    parameters = (folder / "config" / "payload.yaml").read_text(encoding="utf-8")
    source = (folder / "armload_ros" / "payload_identifier.py").read_text(encoding="utf-8")
    defaults = re.search(r"DEFAULTS.*?= (\{.*?^\})", source, re.DOTALL | re.MULTILINE)
    assert defaults is not None
    assert yaml.safe_load(parameters)["/**"]["ros__parameters"] == ast.literal_eval(defaults[1])

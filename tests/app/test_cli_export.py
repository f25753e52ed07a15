"""`armload export`: from a result or payload file to a controller's form, notes on stderr, nothing sent anywhere."""

import ast
import json
import os
import re
import subprocess
import sys
import threading
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from armload.app.cli import main
from armload.app.cli.export import _EXAMPLES, write
from armload.app.cli.export import FORMS as NAMED
from armload.arms import arm
from armload.devices import FORMS, Load
from armload.devices.load_remarks import HARDLY_KNOWN
from armload.inertia import NAMES, InertialParameters
from armload.payloads import Payload, franka_hand, write_payload
from armload.recording import write_recording

HELD = InertialParameters.from_com(
    1.2, (0.02, -0.03, 0.08), [[5e-3, 4e-4, 0], [4e-4, 6e-3, -3e-4], [0, -3e-4, 4e-3]], "panda_link8"
)


def result_of(parameters, **changes):
    """What `armload identify --json` prints for these numbers."""
    phi = parameters.phi
    return {
        "method": "hybrid",
        "robot": "panda",
        "frame": parameters.frame,
        "relative_to": "arm",
        "phi": phi.tolist(),
        "phi_low": (phi - 0.01).tolist(),
        "phi_high": (phi + 0.01).tolist(),
        "determined": [True] * 10,
        "mass": parameters.mass,
        "com": parameters.com.tolist(),
        "inertia_com": parameters.inertia_com.tolist(),
        "consistent": True,
    } | changes


@pytest.fixture
def export(tmp_path, capsys):
    """Run the command on a result: export(result, *arguments) -> (stdout, stderr)."""

    def call(result, *arguments, code=0):
        path = tmp_path / "held.json"
        path.write_text(json.dumps(result))
        assert main(["export", str(path), *arguments]) == code
        return capsys.readouterr()

    return call


def mjcf_numbers(text):
    inertial = ET.fromstring(text).find(".//inertial")
    return np.array([float(x) for key in ("mass", "pos", "fullinertia") for x in inertial.get(key).split()])


def test_the_forms_of_the_command_are_those_of_the_room():
    assert tuple(FORMS) == NAMED
    listed = re.search(r"forms:\n(.*?)\n\n", _EXAMPLES, re.DOTALL).group(1)
    assert all(form in listed for form in FORMS)


@pytest.mark.parametrize("form", NAMED)
def test_every_form_is_printed_without_a_word_beside_it(export, form):
    of_maker = {"ur": "ur10e", "ur-payload": "ur10e", "kinova": "gen3", "xarm": "xarm7"}
    of_kuka = of_arm("iiwa14", relative_to="tare")
    result = (
        of_arm(of_maker[form])
        if form in of_maker
        else of_kuka
        if form == "kuka"
        else result_of(HELD, relative_to="tare")
    )
    out, err = export(result, "--to", form)
    assert "1.2" in out
    assert err == ""


def of_arm(name, **changes):
    """The same identified on another arm, about its last link."""
    return result_of(InertialParameters(HELD.phi, str(arm(name).frame)), robot=name, **changes)


@pytest.mark.parametrize(
    ("name", "to"),
    [
        ("panda", "ur"),
        ("ur10e", "franka-desk"),
        ("ur5e", "franka"),
        ("fr3", "ur-payload"),
        ("iiwa14", "ur"),
        ("gen3", "franka"),
        ("xarm7", "kuka"),
        ("panda", "kinova"),
        ("ur5e", "xarm"),
    ],
)
def test_a_load_for_another_maker_s_arm_is_said_to_be_one(export, name, to):
    assert f"identified on {name}: " in export(of_arm(name), "--to", to)[1]
    assert "identified on" not in export(of_arm(name), "--to", "urdf")[1]


def test_a_result_may_come_through_a_pipe(export, tmp_path, capsys):
    filed = export(result_of(HELD), "--to", "ur").out
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    text = json.dumps(result_of(HELD))
    writer = threading.Thread(target=pipe.write_text, args=(text,), daemon=True)  # waits for its reader
    writer.start()
    assert main(["export", str(pipe), "--to", "ur"]) == 0
    assert capsys.readouterr().out == filed


def test_a_result_that_holds_nothing_is_written_and_said_to_hold_nothing(export):
    light = InertialParameters.from_com(4e-3, (0.0, 0.0, 0.05), np.diag([1e-5] * 3), "panda_link8")
    out, err = export(result_of(light, relative_to="tare", held=False), "--to", "urdf")
    assert "0.004" in out
    assert "nothing seems to be held" in err


def test_a_file_is_written_and_stdout_stays_empty(export, tmp_path):
    out, err = export(result_of(HELD), "--to", "urdf", "--out", str(tmp_path / "p.urdf"), "--name", "cup")
    assert out == ""
    assert "p.urdf" in err
    assert ET.parse(tmp_path / "p.urdf").find("./link").get("name") == "cup"


def test_each_caution_is_said_once_whether_the_load_is_written_or_printed(export, tmp_path):
    known = [name not in ("Ixx", "Iyz") for name in NAMES]
    resting = [name == "Iyy" for name in NAMES]
    doubted = result_of(HELD, determined=known, rests_on_prior=resting)
    printed = export(doubted, "--to", "mjcf").err.splitlines()
    written = export(doubted, "--to", "mjcf", "--out", str(tmp_path / "p.xml")).err.splitlines()
    assert written[:-1] == printed
    assert len(printed) == 2
    assert written[-1] == f"armload: {tmp_path / 'p.xml'}: payload of panda about panda_link8, relative to the arm"


def test_minus_the_hand_in_the_hand_s_own_frame_or_the_flange_s(export, tmp_path):
    both = HELD + franka_hand().parameters
    without_hand = mjcf_numbers(export(result_of(HELD), "--to", "mjcf")[0])
    np.testing.assert_allclose(
        mjcf_numbers(export(result_of(both), "--to", "mjcf", "--minus", "franka-hand")[0]), without_hand, atol=1e-12
    )
    hand = franka_hand().parameters
    at_link7 = hand.moved(np.eye(3), [0, 0, 0.107], "panda_link7")
    write_payload(tmp_path / "hand.json", Payload("hand", at_link7))
    text, _ = export(result_of(both), "--to", "mjcf", "--minus", str(tmp_path / "hand.json"))
    np.testing.assert_allclose(mjcf_numbers(text), without_hand, atol=1e-12)
    text, _ = export(result_of(HELD), "--to", "mjcf", "--plus", "franka-hand", "--minus", str(tmp_path / "hand.json"))
    np.testing.assert_allclose(mjcf_numbers(text), without_hand, atol=1e-12)


def test_a_controller_gets_its_flange_and_a_description_the_frame_of_the_result(export):
    at_link7 = HELD.moved(np.eye(3), [0, 0, 0.107], "panda_link7")
    script, _ = export(result_of(at_link7), "--to", "franka")
    com = ast.literal_eval(re.search(r"F_x_Cload = (\[.*?\])", script).group(1))
    np.testing.assert_allclose(com, HELD.com, atol=1e-12)
    joint = ET.fromstring(export(result_of(at_link7), "--to", "urdf")[0]).find("./joint")
    assert joint.find("parent").get("link") == "panda_link7"
    joint = ET.fromstring(export(result_of(at_link7), "--to", "urdf", "--frame", "panda_link8")[0]).find("./joint")
    assert joint.find("parent").get("link") == "panda_link8"


def renamed(path, name, prefix):
    """A file of a built-in arm whose links and joints are called otherwise; its path as text."""
    path.write_text(re.sub(rf'(name|link)="{name}_', rf'\1="{prefix}_', arm(name).urdf))
    return str(path)


@pytest.mark.parametrize(("name", "prefix"), [("fr3", "fr3"), ("panda", "fer"), ("panda", "left_panda")])
def test_the_hand_is_taken_off_and_put_on_any_franka_whatever_its_flange_is_called(export, tmp_path, name, prefix):
    named = ["--robot", renamed(tmp_path / "cell.urdf", name, prefix)] if prefix != name else []
    robot, flange = "cell" if named else name, f"{prefix}_link8"
    without_hand = InertialParameters(HELD.phi, flange)
    with_hand = without_hand + InertialParameters(franka_hand().parameters.phi, flange)
    for measured, wanted, part in ((with_hand, without_hand, "--minus"), (without_hand, with_hand, "--plus")):
        for frame in ("link7", "link8"):
            moved = measured.moved(np.eye(3), [0, 0, 0.107 * (frame == "link7")], f"{prefix}_{frame}")
            text, _ = export(
                result_of(moved, robot=robot), "--to", "mjcf", part, "franka-hand", "--frame", flange, *named
            )
            np.testing.assert_allclose(mjcf_numbers(text)[:4], [wanted.mass, *wanted.com], atol=1e-12)
    alone_again, _ = export(result_of(with_hand, robot=robot), "--to", "franka", "--minus", "franka-hand", *named)
    com = ast.literal_eval(re.search(r"F_x_Cload = (\[.*?\])", alone_again).group(1))
    np.testing.assert_allclose(com, HELD.com, atol=1e-12)


@pytest.mark.parametrize("prefix", ["fr3", "fer"])
def test_the_hand_is_a_tool_on_any_franka(tmp_path, capsys, analytic_log, prefix):
    robot = renamed(tmp_path / "cell.urdf", "fr3", prefix) if prefix != "fr3" else "fr3"
    carried = InertialParameters(HELD.phi + franka_hand().parameters.phi, f"{prefix}_link8")
    write_recording(tmp_path / "log.csv", analytic_log(arm(robot), carried))
    asked = ["--robot", robot, "--tool", "franka-hand", "--method", "map", "--json"]
    assert main(["identify", str(tmp_path / "log.csv"), *asked]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["frame"], found["relative_to"]) == (f"{prefix}_link8", "tool")
    assert found["mass"] == pytest.approx(HELD.mass, abs=0.02)
    np.testing.assert_allclose(found["com"], HELD.com, atol=5e-3)


def test_a_result_of_an_arm_that_is_a_panda_by_another_prefix_needs_no_file(export):
    flange = "left_panda_link8"
    both = InertialParameters((HELD + franka_hand().parameters).phi, flange)
    text, _ = export(result_of(both), "--to", "franka", "--minus", "franka-hand")  # robot: panda, by its links
    com = ast.literal_eval(re.search(r"F_x_Cload = (\[.*?\])", text).group(1))
    np.testing.assert_allclose(com, HELD.com, atol=1e-12)


def test_the_hand_is_exported_about_the_flange_of_the_robot_that_is_named(capsys):
    assert main(["export", "franka-hand", "--to", "urdf", "--robot", "fr3"]) == 0
    out = capsys.readouterr().out
    assert ET.fromstring(out).find("./joint/parent").get("link") == "fr3_link8"


def test_a_tool_file_about_a_frame_the_arm_lacks_and_the_hand_on_another_make_are_refused(export, tmp_path):
    write_payload(tmp_path / "hand.json", franka_hand())
    _, err = export(of_arm("fr3"), "--to", "franka", "--minus", str(tmp_path / "hand.json"), code=2)
    assert "fr3 has no frame 'panda_link8'" in err
    _, err = export(of_arm("ur5e"), "--to", "ur", "--plus", "franka-hand", code=2)
    assert "ur5e has no flange of a Franka" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("to", ["urdf", "franka"])
@pytest.mark.parametrize("frame", ["panda_link5", "panda_link6"])
@pytest.mark.parametrize("robot", [None, "panda", "cell.urdf"])
def test_joints_between_two_frames_are_an_error(export, tmp_path, robot, frame, to):
    (tmp_path / "cell.urdf").write_text(arm("panda").urdf)
    named = [] if robot is None else ["--robot", str(tmp_path / robot) if "." in robot else robot]
    out, err = export(result_of(HELD), "--to", to, "--frame", frame, *named, code=2)
    assert "joints lie between" in err
    assert (out, err.count("\n")) == ("", 1)
    # nor the other way, from a link before the last joint to the flange
    behind = InertialParameters(HELD.phi, frame)
    out, err = export(result_of(behind), "--to", to, "--frame", "panda_link8", *named, code=2)
    assert "joints lie between" in err
    out, err = export(result_of(behind), "--to", to, "--frame", frame, "--minus", "franka-hand", *named, code=2)
    assert "joints lie between" in err


@pytest.mark.parametrize(
    ("relative_to", "says"),
    [
        ("tare", "relative to the tare: what was mounted then is not in it; was franka-hand mounted after it?"),
        ("before", "relative to the empty arm before: what was mounted then is not in it; was franka-hand mounted"),
        ("tool", "relative to the tool: the tool is not in it; is franka-hand mounted beside it?"),
        ("arm", ""),
    ],
)
def test_a_part_that_may_not_be_in_the_answer_is_asked_about(export, relative_to, says):
    both = HELD + franka_hand().parameters
    out, err = export(result_of(both, relative_to=relative_to), "--to", "mjcf", "--minus", "franka-hand")
    np.testing.assert_allclose(mjcf_numbers(out)[0], HELD.mass)
    assert says in err
    assert (err == "") == (says == "")


def test_a_part_that_is_taken_off_twice_is_said_to_be(export):
    both = HELD + franka_hand().parameters + franka_hand().parameters
    _, err = export(result_of(both), "--to", "mjcf", "--minus", "franka-hand", "--minus", "franka-hand")
    assert "franka-hand is taken off 2 times" in err


@pytest.mark.parametrize("relative_to", ["tare", "before", "tool"])
def test_a_part_that_cannot_be_in_the_answer_is_refused(export, relative_to):
    light = InertialParameters(0.5 * HELD.phi, HELD.frame)  # 0.6 kg, less than the hand
    out, err = export(result_of(light, relative_to=relative_to), "--to", "mjcf", "--minus", "franka-hand", code=2)
    assert out == ""
    assert re.search(r"what is left has a mass of -0\.13 kg and is no body: relative to the .* is not in it", err)


def test_a_link_given_as_the_file_stays_a_link(export, tmp_path):
    link = tmp_path / "link.urdf"
    (tmp_path / "robot.urdf").write_text("old")
    link.symlink_to("robot.urdf")
    export(result_of(HELD), "--to", "urdf", "--out", str(link))
    assert link.is_symlink()
    assert ET.parse(tmp_path / "robot.urdf").find("./link").get("name") == "payload"


@pytest.mark.parametrize("into", ["pipe", "file"])
def test_standard_output_can_be_named_as_the_file(export, tmp_path, into):
    filed = export(result_of(HELD), "--to", "ur").out
    link = tmp_path / "stdout"
    link.symlink_to("/proc/self/fd/1")  # what /dev/stdout is
    name = str(link) if into == "pipe" else "/proc/self/fd/1"
    arguments = ["export", str(tmp_path / "held.json"), "--to", "ur", "--out", name]
    code = f"from armload.app.cli import main; main({arguments!r})"
    if into == "pipe":
        text = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=True).stdout.decode()
        assert (text, link.is_symlink()) == (filed, True)
        return
    with (tmp_path / "out.txt").open("wb") as out:
        out.write(b"# before\n")
        out.flush()
        subprocess.run([sys.executable, "-c", code], stdout=out, check=True)
    assert (tmp_path / "out.txt").read_text() == f"# before\n{filed}"


def test_a_folder_that_is_missing_is_named_and_no_temporary_file(export, tmp_path):
    path = str(tmp_path / "no" / "p.urdf")
    _, err = export(result_of(HELD), "--to", "urdf", "--out", path, code=2)
    folder = tmp_path / "no"
    said = f"armload: --out {path} cannot be written: there is no folder {folder}; name a file where you can write\n"
    assert err == said


def test_an_arm_that_is_not_built_in_is_named_by_its_file(export, tmp_path):
    result = result_of(HELD, robot="mine", frame="panda_link7")
    _, err = export(result, "--to", "urdf", "--frame", "panda_link8", code=2)
    assert "about 'panda_link7' and wanted about 'panda_link8': name the robot" in err
    (tmp_path / "mine.urdf").write_text(arm("panda").urdf)
    out, _ = export(result, "--to", "mjcf", "--frame", "panda_link8", "--robot", str(tmp_path / "mine.urdf"))
    np.testing.assert_allclose(mjcf_numbers(out)[1:4], HELD.com - [0, 0, 0.107], atol=1e-12)


def test_what_the_log_did_not_determine_is_said_on_both_streams(export):
    result = result_of(HELD, determined=[True] * 4 + [False] * 6)
    out, err = export(result, "--to", "sdf")
    assert "not determined by the log: Ixx, Ixy, Ixz, Iyy, Iyz, Izz" in out
    assert "not determined by the log: Ixx, Ixy, Ixz, Iyy, Iyz, Izz" in err
    for form in ("ur-payload", "kinova", "xarm"):  # they have no inertia
        out, err = export(result, "--to", form)
        assert "not determined" not in out + err
    out, err = export(result, "--to", "franka-desk")  # JSON has no comments
    json.loads(out)
    assert "not determined" in err


def test_moments_that_are_hardly_known_are_said_beside_the_notes_of_an_identification_and_nothing_twice(capsys):
    leaning, hardly = "rests on what payloads are usually like more than on the log: Ixy", f"{HARDLY_KNOWN}: Ixx, Iyy"
    load = Load(HELD, robot="panda", relative_to="tare", remarks=(leaning, hardly))
    write(load, "franka-desk", earlier=["the intervals of Ixy rest on what payloads are usually like"])
    err = capsys.readouterr().err
    assert (err.count(hardly), err.count(leaning)) == (1, 0)
    write(load, "franka-desk")
    err = capsys.readouterr().err
    assert (err.count(hardly), err.count(leaning)) == (1, 1)


@pytest.mark.parametrize(
    ("to", "relative_to", "says"),
    [
        ("franka", "arm", "--minus"),
        ("franka", "tool", ""),
        ("ur", "tool", "--plus"),
        ("ur-payload", "tare", "at the tare, if any, with --plus"),
        ("ur", "arm", ""),
        ("xarm", "tool", "everything on the flange: add the tool with --plus"),
        ("kinova", "profile", "in the profile's logs, if any, with --plus"),
        ("kinova", "arm", ""),
        ("kuka", "arm", "--minus"),
        ("kuka", "tare", ""),
    ],
)
def test_what_the_controller_counts_itself_is_said(export, to, relative_to, says):
    robot = {"franka": "panda", "kuka": "iiwa7", "kinova": "gen3", "xarm": "xarm7"}.get(to, "ur5e")
    err = export(of_arm(robot, relative_to=relative_to), "--to", to)[1]
    assert says in err
    assert (err == "") == (says == "")


def part_of(tmp_path, mass, name):
    body = InertialParameters.from_com(mass, (0, 0, 0.05), mass * 2e-3 * np.eye(3), "panda_link8")
    write_payload(file := tmp_path / f"{name}.json", Payload(name, body))
    return str(file)


def test_parts_are_added_before_others_are_taken_off(export, tmp_path):
    """What is left at last is a body, what would be left in between has no mass."""
    held = result_of(InertialParameters.from_com(1.0, (0, 0, 0.05), 4e-3 * np.eye(3), "panda_link8"))
    plus, minus = part_of(tmp_path, 0.9, "small"), part_of(tmp_path, 1.3, "large")
    for words in (["--plus", plus, "--minus", minus], ["--minus", minus, "--plus", plus]):
        text, _ = export(held, "--to", "urdf", *words)
        assert float(re.search(r'mass value="([^"]+)"', text)[1]) == pytest.approx(0.6)


def test_what_is_added_to_a_load_since_a_tare_is_not_said_to_contain_what_was_mounted_then(export, tmp_path):
    err = export(of_arm("panda", relative_to="tare"), "--to", "franka", "--plus", part_of(tmp_path, 0.2, "camera"))[1]
    assert "contains any hand" not in err
    assert "see that --plus names all that was mounted at the tare" in err


def test_nothing_mounted_at_a_tare_is_said_once_and_asked_no_more(export, tmp_path):
    held = of_arm("ur10e", relative_to="tare")
    plain, asks = export(held, "--to", "ur")
    told, err = export(held, "--to", "ur", "--plus", "nothing")
    assert "add what was mounted at the tare" in asks
    assert "mounted" not in err
    assert re.findall(r"set_target_payload\(.*", told) == re.findall(r"set_target_payload\(.*", plain) != []
    both = ["--plus", "nothing", "--plus", part_of(tmp_path, 0.2, "b")]
    assert "see that --plus names" in export(of_arm("panda", relative_to="tare"), "--to", "franka", *both)[1]


def test_what_is_taken_off_a_load_since_a_tare_names_no_tool_that_nobody_gave(export, tmp_path):
    part = part_of(tmp_path, 0.2, "camera")
    _, err = export(of_arm("panda", relative_to="tare"), "--to", "urdf", "--minus", part)
    assert "relative to the tare" in err
    assert "relative to the tool" not in err


@pytest.mark.parametrize("option", ["--plus", "--minus"])
def test_a_part_in_grams_is_refused(export, tmp_path, option):
    write_payload(tmp_path / "part.json", Payload("part", InertialParameters(900 * HELD.phi, HELD.frame)))
    out, err = export(result_of(HELD), "--to", "urdf", option, str(tmp_path / "part.json"), code=2)
    assert out == ""
    assert "give kilograms" in err
    assert err.count("\n") == 1


def test_the_rest_of_a_subtraction_is_made_a_body_and_that_is_said(export, tmp_path):
    # a part whose inertia is larger than what was measured of the whole
    part = InertialParameters.from_com(0.5, (0.02, -0.03, 0.08), np.diag([9e-3, 9e-3, 9e-3]), "panda_link8")
    write_payload(tmp_path / "part.json", Payload("part", part))
    out, err = export(result_of(HELD), "--to", "mjcf", "--minus", str(tmp_path / "part.json"))
    assert "the nearest one is written" in err
    mass, *_, xx, yy, zz, xy, xz, yz = mjcf_numbers(out)
    assert 0 < mass < 1.2
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    assert moments[0] > 0
    assert moments[0] + moments[1] >= moments[2]


@pytest.mark.parametrize(
    ("result", "arguments", "says"),
    [
        (result_of(HELD), ["--to", "gazebo"], "'gazebo'"),
        (result_of(HELD), [], "--to"),
        (result_of(HELD), ["--to", "urdf", "--frame", "nowhere"], "unknown frame 'nowhere'"),
        (result_of(HELD), ["--to", "urdf", "--minus", "none.json"], "none.json"),
        (result_of(HELD), ["--to", "urdf", "--minus", "nothing"], "--minus nothing takes nothing off"),
        (
            result_of(HELD),
            ["--to", "urdf", "--plus", "franka-hand", "--minus", "test", "--minus", "test"],
            "mass of -",
        ),
        (result_of(HELD, frame=None, robot=None), ["--to", "urdf"], "does not name its frame"),
        (result_of(HELD, determined="all"), ["--to", "urdf"], "expected 10 times true or false"),
        ({"phi": [None] * 10}, ["--to", "urdf"], "undetermined"),
        (result_of(HELD, robot="cell", frame="tcp"), ["--to", "franka"], "about 'tcp' and a controller counts from"),
        (result_of(HELD), ["--to", "urdf", "--out", "no/such/folder/p.urdf"], "cannot be written"),
    ],
)
def test_refusals_are_one_sentence_and_nothing_is_printed(export, result, arguments, says):
    out, err = export(result, *arguments, code=2)
    assert out == ""
    assert says in err
    assert err.count("\n") == 1


def test_a_name_is_that_of_what_is_described_and_said_to_change_nothing_elsewhere(export):
    out, err = export(result_of(HELD), "--to", "urdf", "--name", "gear")
    assert ET.fromstring(out).find("link").get("name") == "gear"
    assert "--name" not in err
    out, err = export(result_of(HELD), "--to", "franka", "--name", "gear")
    assert "gear" not in out
    assert "--name is of a link, body or model, and franka names none: it changes nothing" in err


def test_the_hand_itself_can_be_exported(capsys):
    assert main(["export", "franka-hand", "--to", "mjcf"]) == 0
    np.testing.assert_allclose(mjcf_numbers(capsys.readouterr().out)[0], 0.73)


def test_a_frame_that_is_no_flange_is_written_for_a_controller_only_where_asked_for_and_said(export):
    _, err = export(result_of(HELD, robot="cell", frame="tcp"), "--to", "franka", "--frame", "tcp")
    assert "these numbers are about tcp" in err
    _, err = export(result_of(HELD, robot="cell", frame="left_panda_link8"), "--to", "franka")
    assert "these numbers" not in err

"""What `armload identify` answers: the contract's JSON, and answers that are right on simulated and on real logs."""

import json
import re
from dataclasses import replace
from datetime import UTC, datetime
from importlib import resources

import numpy as np
import pytest

from armload.app.cli import main
from armload.arms import arm
from armload.identification.notes import COMPUTED
from armload.inertia import NAMES, InertialParameters, com_to_phi
from armload.motion import taie2024
from armload.payloads import Payload, franka_hand, write_payload
from armload.recording import Recording, read_recording, write_recording
from armload.runtime.version import __version__
from armload.simulation import simulate

KEYS = [
    "method",
    "robot",
    "frame",
    "relative_to",
    "n_samples",
    "duration",
    "phi",
    "phi_low",
    "phi_high",
    "interval",
    "determined",
    "mass",
    "com",
    "inertia_com",
    "consistent",
    "held",
    "com_low",
    "com_high",
    "inertia_com_low",
    "inertia_com_high",
    "covariance",
    "rests_on_prior",
    "torque_gain_std",
    "same_arm_assumed",
    "notes",
    "log",
    "date",
    "parameters",
    "version",
    "segments",
]
BODY = InertialParameters(com_to_phi(1.2, [0.02, -0.03, 0.09], np.diag([4e-3, 5e-3, 3e-3])), "panda_link8")
TILTED = (-4.905, 0.0, -9.81 * np.sqrt(0.75))  # base tilted by 30° about y


@pytest.fixture(scope="module")
def logs(panda, tmp_path_factory):
    """Simulated logs (MuJoCo, no noise) of a Panda: bare, with a body, with the hand, with both; and on a slope."""
    folder, motion = tmp_path_factory.mktemp("logs"), taie2024()
    hand = franka_hand().parameters
    carried = {"bare": None, "body": BODY, "hand": hand, "both": BODY + hand}
    for name, payload in carried.items():
        write_recording(folder / f"{name}.csv", simulate(panda, motion, payload, rate=200.0))
    write_recording(folder / "tilted.npz", simulate(arm("panda", gravity=TILTED), motion, BODY, rate=200.0))
    return folder


def numbers(found):
    """An answer without what names the run: the same samples give the same."""
    return {key: value for key, value in found.items() if key not in ("log", "date")}


@pytest.fixture(scope="module")
def said():
    """What was printed, by arguments."""
    return {}


@pytest.fixture
def answer(capsys, said):
    """Call identify --json and return its object; what was asked before has its answer already."""

    def call(*argv):
        argv = tuple(map(str, argv))
        if argv not in said:
            code = main(["identify", *argv, "--json"])
            out, err = capsys.readouterr()
            assert code == 0, err
            assert out.count("\n") == 1
            said[argv] = out

        def reject(constant):
            raise AssertionError(f"{constant} in the JSON")

        return json.loads(said[argv], parse_constant=reject)

    return call


def test_json_has_the_contracts_keys_in_order_and_finite_numbers(answer, logs):
    found = answer(logs / "body.csv", "--robot", "panda")
    assert list(found) == KEYS
    assert [len(found[key]) for key in ("phi", "phi_low", "phi_high", "determined")] == [10] * 4
    assert np.shape(found["com"]) == (3,)
    assert np.shape(found["inertia_com"]) == (3, 3)
    for key in ("com_low", "com_high"):
        assert np.shape(found[key]) == (3,)
    for key in ("inertia_com_low", "inertia_com_high"):
        assert np.shape(found[key]) == (3, 3)
    assert np.shape(found["covariance"]) == (10, 10)
    for key in ("phi", "com", "inertia_com"):
        assert np.all(np.isfinite(found[key]))
        assert np.all(np.array(found[f"{key}_low"]) <= found[key])
        assert np.all(np.array(found[key]) <= found[f"{key}_high"])
    assert np.all(np.isfinite([found["mass"], found["duration"]]))
    assert found["parameters"] == list(NAMES)
    assert (found["version"], found["log"]) == (__version__, "body.csv")
    assert abs((datetime.fromisoformat(found["date"]) - datetime.now(UTC)).total_seconds()) < 600.0
    assert found["method"] == "hybrid"
    assert found["robot"] == "panda"
    assert found["frame"] == "panda_link8"
    assert found["interval"] == "calibrated"
    assert found["n_samples"] == 1200
    assert found["duration"] == pytest.approx(5.995)
    assert found["held"] is True
    assert found["consistent"] is True
    assert com_to_phi(found["mass"], found["com"], found["inertia_com"]) == pytest.approx(found["phi"], abs=1e-9)


@pytest.mark.full  # some seconds
def test_a_hand_in_the_description_is_a_tool_and_nobody_is_told_to_take_it_off_again(answer, logs, tmp_path, capsys):
    with_hand = (
        '<joint name="to_hand" type="fixed"><origin rpy="0 0 -0.7853981633974483"/>'
        '<parent link="panda_link8"/><child link="panda_hand"/></joint>'
        '<link name="panda_hand"><inertial><origin xyz="-0.01 0 0.03"/><mass value="0.73"/>'
        '<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.0025" iyz="0" izz="0.0017"/></inertial></link></robot>'
    )
    (tmp_path / "cell.urdf").write_text(arm("panda").urdf.replace("</robot>", with_hand))
    described = ["--robot", tmp_path / "cell.urdf", "--frame", "panda_link8"]
    found = answer(logs / "both.csv", *described)
    assert found["relative_to"] == "tool"
    assert found["mass"] == pytest.approx(BODY.mass, rel=0.01)
    assert answer(logs / "both.csv", *described, "--tare", logs / "hand.csv")["relative_to"] == "tare"
    for form, said in (("franka", ""), ("ur", "add the tool with --plus")):
        capsys.readouterr()
        assert main(["identify", str(logs / "both.csv"), *map(str, described), "--to", form]) == 0
        err = capsys.readouterr().err
        assert said in err
        assert "--minus" not in err


@pytest.mark.parametrize("method", ["hybrid", "map-gp", "map", "rls", "rls-filter"])
def test_every_method_finds_the_simulated_body(answer, logs, method):
    found = answer(logs / "body.csv", "--robot", "panda", "--method", method)
    assert found["method"] == method
    assert found["mass"] == pytest.approx(BODY.mass, rel=0.03)
    assert found["com"] == pytest.approx(BODY.com, abs=0.01)


def test_the_answer_is_relative_to_the_arm_the_tool_or_the_tare(answer, logs, tmp_path):
    whole = answer(logs / "both.csv", "--robot", "panda")
    assert whole["relative_to"] == "arm"
    assert whole["mass"] == pytest.approx(BODY.mass + 0.73, rel=0.01)

    named = answer(logs / "both.csv", "--robot", "panda", "--tool", "franka-hand")
    write_payload(tmp_path / "hand.json", franka_hand())
    filed = answer(logs / "both.csv", "--robot", "panda", "--tool", tmp_path / "hand.json")
    assert numbers(named) == numbers(filed)
    assert named["relative_to"] == "tool"
    tared = answer(logs / "both.csv", "--robot", "panda", "--tare", logs / "hand.csv")
    assert tared["relative_to"] == "tare"
    for found in (named, tared):
        assert found["mass"] == pytest.approx(BODY.mass, rel=0.01)
        assert found["com"] == pytest.approx(BODY.com, abs=0.002)


def test_a_saved_answer_is_a_tool_for_the_next_one(answer, logs, tmp_path):
    hand = answer(logs / "hand.csv", "--robot", "panda")
    (tmp_path / "hand.json").write_text(json.dumps(hand))
    found = answer(logs / "both.csv", "--robot", "panda", "--tool", tmp_path / "hand.json")
    assert found["mass"] == pytest.approx(BODY.mass, rel=0.02)
    assert found["phi_low"][0] <= BODY.mass <= found["phi_high"][0]


def test_an_empty_arm_holds_nothing(answer, logs):
    found = answer(logs / "bare.csv", "--robot", "panda")
    assert found["held"] is False
    assert found["mass"] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("spelling", [["--gravity={}"], ["--gravity", "{}"]], ids=["equals", "space"])
def test_a_tilted_base_is_told_by_gravity(answer, logs, spelling):
    gravity = [part.format(",".join(map(str, TILTED))) for part in spelling]
    found = answer(logs / "tilted.npz", "--robot", "panda", *gravity)
    assert found["mass"] == pytest.approx(BODY.mass, rel=0.01)
    assert found["com"] == pytest.approx(BODY.com, abs=0.002)


def test_standard_gravity_may_be_said(answer, logs):
    said = answer(logs / "body.csv", "--robot", "panda", "--gravity", "0,0,-9.81")
    assert numbers(said) == numbers(answer(logs / "body.csv", "--robot", "panda"))


@pytest.mark.parametrize(("method", "tolerance"), [("rls-filter", 1e-4), ("map", 1e-3), ("hybrid", 2e-3)])
def test_another_frame_moves_the_answer_rigidly(answer, logs, method, tolerance):
    here = answer(logs / "body.csv", "--robot", "panda", "--method", method)
    there = answer(logs / "body.csv", "--robot", "panda", "--frame", "panda_link7", "--method", method)
    assert there["frame"] == "panda_link7"
    moved = arm("panda", "panda_link7").in_frame(InertialParameters(here["phi"], "panda_link8"))
    # the frames are 0.107 m apart; map's weak prior is drawn about each: equal up to its pull
    assert there["mass"] == pytest.approx(moved.mass, abs=tolerance)
    assert there["com"] == pytest.approx(moved.com, abs=tolerance)
    assert np.array(there["inertia_com"]) == pytest.approx(moved.inertia_com, abs=3 * tolerance)


def test_the_built_in_arm_and_its_urdf_file_give_the_same(answer, logs, tmp_path):
    path = tmp_path / "panda.urdf"
    path.write_text(resources.files("armload.arms").joinpath("descriptions/panda.urdf").read_text())
    built_in = answer(logs / "body.csv", "--robot", "panda", "--method", "rls-filter")
    filed = answer(logs / "body.csv", "--robot", path, "--frame", "panda_link8", "--method", "rls-filter")
    assert numbers(filed) == numbers(built_in)
    # a file with the links of a built-in arm is that arm: what is known of it holds, too
    mine = path.rename(tmp_path / "my_cell.urdf")
    default = answer(logs / "body.csv", "--robot", mine, "--frame", "panda_link8")
    assert numbers(default) == numbers(answer(logs / "body.csv", "--robot", "panda")) | {"robot": "my_cell"}


def test_an_arm_that_never_moves_tells_what_gravity_tells(answer, panda, tmp_path):
    loaded, pose = panda.with_payload(BODY), np.array([0.2, -0.6, 0.3, -1.8, 0.2, 1.6, 0.4])
    t = np.arange(600) / 200.0
    q = np.tile(pose, (len(t), 1))
    tau = np.tile(loaded.torque(pose), (len(t), 1))
    write_recording(tmp_path / "still.parquet", Recording(t, q, 0 * q, tau))
    found = answer(tmp_path / "still.parquet", "--robot", "panda")
    assert found["determined"][4:] == [False] * 6
    assert found["phi_low"][0] <= BODY.mass <= found["phi_high"][0]
    # what gravity tells in this pose: the torque about the joints, which the answer must explain
    explained = panda.with_payload(InertialParameters(found["phi"])).torque(pose) - panda.torque(pose)
    assert explained == pytest.approx(loaded.torque(pose) - panda.torque(pose), abs=0.5)


def test_mass_and_centre_of_mass_come_first_with_their_intervals_then_the_inertia_about_it(capsys, answer, logs):
    found = answer(logs / "body.csv", "--robot", "panda")
    assert main(["identify", str(logs / "body.csv"), "--robot", "panda"]) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    half = {
        name: (np.array(found[f"{name}_high"]) - found[f"{name}_low"]) / 2 for name in ("phi", "com", "inertia_com")
    }
    assert re.fullmatch(rf"mass +{found['mass']:.3f} ± {half['phi'][0]:.3f} +kg", lines[2])
    assert lines[3].startswith("centre of mass")
    for k, axis in enumerate("xyz"):
        value = f"{1e3 * found['com'][k]:+.1f} ± {1e3 * half['com'][k]:.1f}"
        assert lines[3 + k].removeprefix("centre of mass").split() == [axis, *value.split(), "mm"]
    six = np.array(found["inertia_com"])[np.triu_indices(3)]
    for name, value, line in zip(NAMES[4:], six, lines[6:12], strict=True):
        shown = re.search(rf"{name} +([+-][\d.]+) .*kg·m²", line)
        assert float(shown[1]) == pytest.approx(value, abs=5.1e-5)
    assert out.count("95 %") == 1
    assert "m·rx" not in out
    assert "hybrid" not in err


def test_the_ten_parameters_are_printed_on_request(capsys, logs):
    assert main(["identify", str(logs / "body.csv"), "--robot", "panda", "--all"]) == 0
    lines = capsys.readouterr().out.splitlines()
    first = lines.index("about the origin of panda_link8:") + 1
    assert [line.split()[0] for line in lines[first : first + 10]] == list(NAMES)


def test_nothing_has_no_centre_of_mass_and_no_advice(capsys, logs):
    assert main(["identify", str(logs / "bare.csv"), "--robot", "panda"]) == 0
    out, err = capsys.readouterr()
    assert "nothing seems to be held" in out
    assert "centre of mass" not in out
    assert "inertia" not in out
    assert err == f"armload: {COMPUTED}\n"  # this arm is ideal


def test_the_notes_in_the_json_are_those_on_stderr(capsys, answer, logs):
    found = answer(logs / "both.csv", "--robot", "panda", "--tool", "franka-hand", "--tare", logs / "hand.csv")
    main(
        [
            "identify",
            str(logs / "both.csv"),
            "--robot",
            "panda",
            "--tool",
            "franka-hand",
            "--tare",
            str(logs / "hand.csv"),
        ]
    )
    err = capsys.readouterr().err
    assert found["notes"]
    assert [line.removeprefix("armload: ") for line in err.splitlines()] == found["notes"]


def test_out_writes_the_json_whole_or_not_at_all(capsys, answer, logs, tmp_path):
    log, path = str(logs / "body.csv"), tmp_path / "held.json"
    assert main(["identify", log, "--robot", "panda", "--out", str(path)]) == 0
    assert "mass" in capsys.readouterr().out  # the answer is printed as well
    assert numbers(json.loads(path.read_text())) == numbers(answer(log, "--robot", "panda"))
    refused = main(["identify", log, "--robot", "panda", "--out", str(tmp_path / "no" / "such.json")])
    out, err = capsys.readouterr()
    assert (refused, out, err.count("\n")) == (2, "", 1)
    assert "cannot be written" in err
    assert [file.name for file in tmp_path.iterdir()] == ["held.json"]


@pytest.mark.parametrize("where", ["printed", "written"])
def test_to_makes_what_export_makes_of_the_saved_answer(capsys, answer, logs, tmp_path, where):
    log, form = str(logs / "body.csv"), {"printed": "franka", "written": "mjcf"}[where]
    (tmp_path / "held.json").write_text(json.dumps(answer(log, "--robot", "panda")))
    assert main(["export", str(tmp_path / "held.json"), "--to", form]) == 0
    exported = capsys.readouterr().out
    out = ["--out", str(tmp_path / "load")] if where == "written" else []
    assert main(["identify", log, "--robot", "panda", "--to", form, *out]) == 0
    assert capsys.readouterr().out == ("" if out else exported)
    assert not out or (tmp_path / "load").read_text() == exported


def test_an_inertia_that_rests_on_the_prior_is_exported_with_a_note_and_a_comment(capsys, answer, logs, tmp_path):
    found = answer(logs / "body.csv", "--robot", "panda")
    leaning = [
        n
        for n, known, prior in zip(NAMES, found["determined"], found["rests_on_prior"], strict=True)
        if known and prior
    ]
    assert leaning
    (tmp_path / "held.json").write_text(json.dumps(found))
    for form in ("franka", "ur", "urdf", "ros2"):
        assert main(["export", str(tmp_path / "held.json"), "--to", form, "--frame", "panda_link8"]) == 0
        out, err = capsys.readouterr()
        for text in (out, err):
            assert f"rests on what payloads are usually like more than on the log: {', '.join(leaning)}" in text


def test_gravity_that_a_controller_took_out_is_put_back(answer, logs, panda, tmp_path):
    """The controller knows of the hand, and reports what is beyond it and the arm; the answer is the same."""
    log = read_recording(logs / "both.csv", panda)
    known = panda.with_payload(InertialParameters(franka_hand().parameters.phi, panda.frame))
    write_recording(tmp_path / "taken.csv", replace(log, tau=log.tau - known.torque(log.q)))
    found = answer(tmp_path / "taken.csv", "--robot", "panda", "--compensated", "franka-hand")
    np.testing.assert_allclose(found["phi"], answer(logs / "both.csv", "--robot", "panda")["phi"], atol=1e-4)
    assert found["mass"] == pytest.approx(BODY.mass + franka_hand().parameters.mass, abs=0.05)


def test_what_a_controller_was_set_to_carry_is_read_once_for_log_and_tare(logs, panda, tmp_path, capsys):
    hand = franka_hand().parameters
    (tmp_path / "set.json").write_text(json.dumps({"mass": hand.mass, "com": hand.com.tolist(), "frame": hand.frame}))
    known, words = panda.with_payload(InertialParameters(hand.phi, panda.frame)), ["identify"]
    for name, option in (("both", None), ("hand", "--tare")):
        log = read_recording(logs / f"{name}.csv", panda)
        still = np.zeros_like(log.q)
        write_recording(tmp_path / f"{name}.csv", replace(log, tau=log.tau - known.torque(log.q, still, still)))
        words += [*([option] if option else []), str(tmp_path / f"{name}.csv")]
    assert main([*words, "--robot", "panda", "--compensated", str(tmp_path / "set.json"), "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["mass"] == pytest.approx(BODY.mass, rel=0.01)
    assert err.count("the inertia is not given") == 1


def test_a_tool_s_file_of_mass_and_centre_alone_is_taken_with_wider_intervals(answer, logs, tmp_path):
    hand = franka_hand().parameters
    (tmp_path / "hand.json").write_text(json.dumps({"mass": hand.mass, "com": hand.com.tolist(), "frame": hand.frame}))
    partly = answer(logs / "both.csv", "--robot", "panda", "--tool", tmp_path / "hand.json")
    known = answer(logs / "both.csv", "--robot", "panda", "--tool", "franka-hand")
    assert any("inertia is not given" in note for note in partly["notes"])
    assert partly["interval"] == "approximate"
    assert partly["mass"] == pytest.approx(known["mass"], abs=0.01)
    width = [np.array(x["phi_high"]) - x["phi_low"] for x in (partly, known)]
    assert np.all(width[0][4:] > width[1][4:] + 5e-3)
    truth = BODY.phi
    assert np.all((partly["phi_low"] <= truth) & (truth <= partly["phi_high"]))


@pytest.mark.parametrize("form", ["ur", "urdf", "mjcf", "franka"])
def test_a_file_of_mass_and_centre_alone_is_exported_with_the_assumption_said(capsys, tmp_path, form):
    (tmp_path / "part.json").write_text(json.dumps({"mass": 0.5, "com": [0, 0, 0.05], "frame": "panda_link8"}))
    assert main(["export", str(tmp_path / "part.json"), "--to", form]) == 0
    out, err = capsys.readouterr()
    for text in (out, err):
        assert "inertia is not given" in text


def test_notes_of_the_reader_go_to_stderr(capsys, logs, tmp_path):
    lines = (logs / "body.csv").read_text().splitlines()
    (tmp_path / "twice.csv").write_text("\n".join([*lines[:50], lines[49], *lines[50:]]) + "\n")
    assert main(["identify", str(tmp_path / "twice.csv"), "--robot", "panda", "--json"]) == 0
    out, err = capsys.readouterr()
    json.loads(out)
    assert "line 51" in err


@pytest.mark.full  # some seconds
def test_a_minute_at_one_kilohertz_is_answered(answer, analytic_log, panda, tmp_path):
    write_recording(tmp_path / "long.npz", analytic_log(panda, BODY, duration=60.0, rate=1000.0))
    found = answer(tmp_path / "long.npz", "--robot", "panda")
    assert found["n_samples"] == 60000
    assert found["mass"] == pytest.approx(BODY.mass, rel=0.01)


def test_a_tool_must_be_about_a_frame_of_the_arm(capsys, analytic_log, tmp_path):
    write_recording(tmp_path / "ur.csv", analytic_log(arm("ur10e"), rate=50.0))
    assert main(["identify", str(tmp_path / "ur.csv"), "--robot", "ur10e", "--tool", "franka-hand"]) == 2
    assert "ur10e has no flange of a Franka" in capsys.readouterr().err


def test_a_tool_file_without_a_frame_is_about_the_payload_frame(answer, logs, tmp_path):
    tool = Payload("hand", InertialParameters(franka_hand().parameters.phi))
    write_payload(tmp_path / "tool.json", tool)
    found = answer(logs / "both.csv", "--robot", "panda", "--tool", tmp_path / "tool.json")
    assert found["mass"] == pytest.approx(BODY.mass, rel=0.01)


# ---------------------------------------------------------------------- real logs


def test_real_ur10e_pair_gives_the_weighed_mass(answer, real_data):
    found = answer(
        real_data / "ur10e_loaded_2805g.csv",
        *("--robot", real_data / "ur10e.urdf", "--frame", "tool0", "--tare", real_data / "ur10e_unloaded.csv"),
    )
    assert (found["relative_to"], found["method"], found["interval"]) == ("tare", "hybrid", "calibrated")
    assert found["mass"] == pytest.approx(2.805, rel=0.03)
    assert found["phi_low"][0] <= 2.805 <= found["phi_high"][0]
    assert found["phi_high"][0] - found["phi_low"][0] < 2 * 0.06 * 2.805
    assert found["held"] is True


def test_real_empty_ur10e_without_a_tare_holds_nothing(answer, real_data):
    found = answer(real_data / "ur10e_unloaded.csv", "--robot", "ur10e")
    assert found["phi_low"][0] <= 0.0 <= found["phi_high"][0]
    assert found["held"] is False


@pytest.mark.full  # some seconds
def test_real_loaded_ur10e_without_a_tare_is_within_its_interval(answer, real_data):
    found = answer(real_data / "ur10e_loaded_2805g.csv", "--robot", "ur10e")
    assert found["held"] is True
    assert found["phi_low"][0] <= 2.805 <= found["phi_high"][0]


def test_real_unloaded_panda_holds_nothing(answer, real_data):
    found = answer(real_data / "panda_unloaded_1khz.csv", "--robot", "panda")
    assert abs(found["mass"]) < 0.12
    assert found["held"] is False


def test_real_ros2_bag_is_answered(answer, real_data):
    # its payload is not known: only that the answer is a body, with intervals
    found = answer(real_data / "ur10_ros2_bag.db3", "--robot", "ur10e")
    assert found["n_samples"] > 3000
    assert found["consistent"] is True

"""Exports read back by other programs' rules, and the fingerprint that ties a model to its motion."""

import json
import re

import numpy as np
import pytest
from ruamel.yaml import YAML

from armload.arms import arm
from armload.errors import MotionError
from armload.motion import (
    FourierMotion,
    MotionFingerprint,
    PathMotion,
    export_motion,
    load_motion,
    random_motion,
    save_motion,
    taie2024,
)
from armload.motion.motion_file import save_motions
from armload.recording import Recording


@pytest.fixture(scope="module")
def ur_motion():
    return random_motion(arm("ur10e"), 1)


def test_the_csv_holds_the_motion_at_every_sample(tmp_path):
    export_motion(taie2024(), tmp_path / "m.csv", rate=250)
    header, *_ = (tmp_path / "m.csv").read_text().splitlines()
    assert header.split(",")[:3] == ["t", "q1", "q2"]
    assert header.split(",")[8::7] == ["dq1", "ddq1"]
    table = np.loadtxt(tmp_path / "m.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 0], np.arange(1501) / 250, atol=1e-9)
    np.testing.assert_allclose(table[:, 1:], np.hstack(taie2024()(table[:, 0])), atol=1e-8)


def test_a_table_that_begins_with_a_byte_order_mark_is_the_same_table(tmp_path):
    plain, marked = tmp_path / "plain.csv", tmp_path / "marked.csv"
    export_motion(taie2024(), plain, "csv", rate=50)
    marked.write_bytes(b"\xef\xbb\xbf" + plain.read_bytes())
    assert PathMotion.is_table(marked)
    np.testing.assert_array_equal(PathMotion.read(marked).positions, PathMotion.read(plain).positions)


def test_the_ros2_trajectory_has_the_fields_of_the_message_and_the_arms_joints(tmp_path, panda):
    path = tmp_path / "m.yaml"
    export_motion(taie2024(), path, "ros2", joint_names=panda.joint_names)
    message = YAML(typ="safe").load(path.read_text())
    assert set(message) == {"header", "joint_names", "points"}
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert message["joint_names"] == list(panda.joint_names)
    points = message["points"]
    assert len(points) == 601
    assert set(points[0]) == {"positions", "velocities", "accelerations", "time_from_start"}
    t = np.array([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points])
    assert all(0 <= p["time_from_start"]["nanosec"] < 10**9 for p in points)
    np.testing.assert_allclose(t, 5.0 + np.arange(601) / 100, atol=2e-9)  # 5 s to get to the start
    for key, value in zip(("positions", "velocities", "accelerations"), taie2024()(t - 5.0), strict=True):
        np.testing.assert_allclose([p[key] for p in points], value, atol=1e-7)


def test_joint_names_survive_yaml_whatever_they_are(tmp_path):
    motion = FourierMotion(np.zeros(3), np.zeros((3, 2)), np.zeros((3, 2)), 1.0)
    names = ["on", "it's", "a: [b]"]
    export_motion(motion, tmp_path / "m.yaml", "ros2", joint_names=names)
    assert YAML(typ="safe").load((tmp_path / "m.yaml").read_text())["joint_names"] == names


def test_the_ur_program_moves_to_the_start_and_then_through_the_table(tmp_path, ur_motion):
    path = tmp_path / "m.script"
    export_motion(ur_motion, path, "ur", rate=125)
    lines = [line.strip() for line in path.read_text().splitlines()]
    assert lines[0] == "def armload_motion():"
    assert lines[-1] == "armload_motion()"
    assert sum(line.startswith("def ") for line in lines) == lines.count("end")
    go = [line for line in lines if line.startswith("go(")]
    table = np.array([json.loads(re.fullmatch(r"go\((.*)\)", line)[1]) for line in go])
    np.testing.assert_allclose(table, ur_motion(np.arange(751) / 125)[0], atol=1e-8)
    (movej,) = [line for line in lines if line.startswith("movej(")]
    assert json.loads(movej[len("movej(") :].split("]")[0] + "]") == table[0].tolist()
    assert lines.index(movej) < lines.index(go[0])
    assert "servoj(q, t=0.008, " in "\n".join(lines)


def test_a_motions_name_cannot_break_out_of_its_comment(tmp_path, ur_motion):
    evil = FourierMotion(ur_motion.offset, ur_motion.sine, ur_motion.cosine, 6.0, "x\n  set_digital_out(0, True)")
    export_motion(evil, tmp_path / "m.script", "ur")
    lines = (tmp_path / "m.script").read_text().splitlines()
    assert [line for line in lines if "set_digital_out" in line] == [lines[1]]
    assert lines[1].lstrip().startswith("#")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"format": "xml"}, "csv, ros2, ur"),
        ({"rate": 0.0}, "positive"),
        ({"rate": float("nan")}, "positive"),
        ({"rate": 0.2}, "joint .* would be up to .* off the motion 'taie2024' between two of them"),
        ({"rate": 2.0}, "give a higher rate"),
        ({"format": "ros2"}, "joint_names"),
        ({"format": "ros2", "joint_names": ["a"]}, "1 joint names for a motion of 7"),
        ({"format": "ros2", "joint_names": list("abcdefg"), "lead": -1.0}, "lead"),
        ({"format": "ur"}, "a UR robot has 6"),
    ],
)
def test_a_wrong_export_is_one_sentence_and_no_file(tmp_path, arguments, says):
    with pytest.raises(MotionError, match=says):
        export_motion(taie2024(), tmp_path / "out", **arguments)
    assert not list(tmp_path.iterdir())


def log_of(motion, rate=500.0, start=0.0, duration=None, noise=0.0, clock=0.0):
    duration = motion.duration - start if duration is None else duration
    t = np.arange(int(duration * rate) + 1) / rate
    q, dq, _ = motion(t + start)
    q = q + noise * np.random.default_rng(0).normal(size=q.shape)
    return Recording(t + clock, q, dq, np.zeros_like(q))


HUGE = 10**400  # a number of JSON that no float holds
AT_REST = {"offset": [0.0] * 7, "sine": [[0.0]] * 7, "cosine": [[0.0]] * 7}
NUMBERS = {key: [[0.0] * 7] * 2 for key in ("positions", "velocities", "accelerations")}


@pytest.mark.parametrize(
    "content",
    [
        "[" * 100_000,
        json.dumps({"format": "armload-motion-1", "name": "x", "period": HUGE, **AT_REST}),
        json.dumps({"format": "armload-motion-1", "name": "x", "period": 1.0, **AT_REST, "offset": [HUGE] * 7}),
        json.dumps({"format": "armload-motion-1", "name": "x", "kind": "path", "times": [0, HUGE], **NUMBERS}),
    ],
    ids=["too deep", "an endless period", "an endless angle", "an endless time"],
)
def test_a_motion_file_whose_numbers_nobody_can_hold_is_refused_in_a_sentence(tmp_path, content):
    (tmp_path / "m.json").write_text(content)
    with pytest.raises(MotionError, match=r"m\.json( is not a motion)?: "):
        load_motion(tmp_path / "m.json")


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ({"period": "6"}, 'period holds "6"'),
        ({"period": True}, "period holds true"),
        ({"offset": ["0.5"] * 7}, 'offset holds "0.5"'),
        ({"sine": [[0.0]] * 6 + [[None]]}, "sine holds null"),
        ({"kind": "b-spline", "start": [0.0], "control": [[0.1, 0.2, 0.3]], "duration": "2"}, 'duration holds "2"'),
        ({"kind": "path", "times": [0.0, "1"], **NUMBERS}, 'times holds "1"'),
    ],
    ids=["a text", "a truth", "angles as texts", "nothing", "of a spline", "of a path"],
)
def test_what_is_no_number_in_a_motion_file_is_named_and_not_read_as_one(tmp_path, changed, found):
    content = {"format": "armload-motion-1", "name": "x", "period": 6.0, **AT_REST, **changed}
    (tmp_path / "m.json").write_text(json.dumps(content))
    with pytest.raises(MotionError, match=rf"m\.json: {found}: expected nothing but numbers$"):
        load_motion(tmp_path / "m.json")


@pytest.mark.parametrize("form", ["json", "csv"])
def test_a_motion_of_more_than_an_hour_is_refused_by_its_time_and_not_by_the_memory_it_needs(tmp_path, form):
    for seconds, name in ((3600.0, "hour"), (3601.0, "more")):
        motion = PathMotion([0.0, seconds], *[np.zeros((2, 7))] * 3)
        file = tmp_path / f"{name}.{form}"
        if form == "json":
            save_motion(file, motion)
        else:
            header = ",".join(["t", *(f"{kind}{j}" for kind in ("q", "dq", "ddq") for j in range(1, 8))])
            file.write_text("\n".join([header, *(",".join([t, *["0"] * 21]) for t in ("0", str(seconds)))]))
    read = load_motion if form == "json" else PathMotion.read
    assert read(tmp_path / f"hour.{form}").duration == 3600.0
    with pytest.raises(MotionError, match="lasts 3601 s: expected 3600 s at most; are these ms"):
        read(tmp_path / f"more.{form}")


def test_a_table_with_a_cell_that_no_reader_takes_is_refused_in_a_sentence(tmp_path):
    header = ",".join(["t", *(f"{kind}{j}" for kind in ("q", "dq", "ddq") for j in range(1, 8))])
    (tmp_path / "m.csv").write_text(f'{header}\n"{"x" * 200_000}"\n')
    with pytest.raises(MotionError, match=r"m\.csv is not a table of numbers"):
        PathMotion.read(tmp_path / "m.csv")


def test_a_log_of_the_motion_matches_on_any_clock_and_of_any_shorter_length():
    mark = MotionFingerprint.of(taie2024())
    assert mark.distance(log_of(taie2024())) < 2e-3  # linear interpolation at 50 Hz
    assert mark.matches(log_of(taie2024(), clock=1.7e9))
    assert mark.matches(log_of(taie2024(), duration=0.2))
    assert mark.matches(log_of(taie2024(), duration=6.5))  # it waits at the end
    assert mark.matches(log_of(taie2024(), noise=0.02))


def test_the_distance_is_the_rms_of_a_known_deviation():
    mark, log = MotionFingerprint.of(taie2024()), log_of(taie2024())
    moved = Recording(log.t, log.q + np.array([0.3, 0, 0, 0, 0, 0, 0.4]), log.dq, log.tau)
    assert mark.distance(moved) == pytest.approx(np.sqrt((0.09 + 0.16) / 7), abs=1e-3)
    assert not mark.matches(moved)
    assert mark.matches(moved, tolerance=0.2)


def test_other_motions_lengths_starts_and_arms_do_not_match(panda, ur_motion):
    mark = MotionFingerprint.of(taie2024())
    assert not mark.matches(log_of(random_motion(panda, 0)))
    assert not mark.matches(log_of(taie2024(), duration=0.04))
    assert not mark.matches(log_of(taie2024(), duration=6.7))
    assert not mark.matches(log_of(taie2024(), start=2.0))
    assert not mark.matches(log_of(taie2024().scaled(0.5)))
    assert mark.distance(log_of(ur_motion)) == np.inf
    assert not mark.matches(log_of(ur_motion))


def test_the_unloaded_panda_log_is_not_our_excitation(real_data):
    table = np.loadtxt(real_data / "panda_unloaded_1khz.csv", delimiter=",", skiprows=1, max_rows=6000)
    log = Recording(table[:, 0], table[:, 1:8], table[:, 8:15], table[:, 15:22])
    mark = MotionFingerprint.of(taie2024())
    assert 0.1 < mark.distance(log) < np.inf
    assert not mark.matches(log)


def test_the_fingerprint_survives_json_and_notices_damage():
    mark = MotionFingerprint.of(taie2024())
    content = json.loads(json.dumps(mark.to_dict()))
    back = MotionFingerprint.from_dict(content)
    assert back == mark
    assert hash(back) == hash(mark)
    assert (back.name, back.sha256) == (mark.name, mark.sha256)
    content["q"][7][2] += 1e-4
    with pytest.raises(MotionError, match="does not match its SHA-256"):
        MotionFingerprint.from_dict(content)
    for key in ("name", "duration", "sha256", "q"):
        with pytest.raises(MotionError, match=f"'{key}' is missing"):
            MotionFingerprint.from_dict({k: v for k, v in mark.to_dict().items() if k != key})
    for bad in ([[1, 2], [3]], "text", [[None]], [[1.0]]):
        with pytest.raises(MotionError):
            MotionFingerprint.from_dict({**mark.to_dict(), "q": bad})


def test_the_fingerprint_tells_motions_apart_and_ignores_their_names():
    mark = MotionFingerprint.of(taie2024())
    renamed = FourierMotion(taie2024().offset, taie2024().sine, taie2024().cosine, 6.0, "other")
    assert MotionFingerprint.of(renamed) == mark
    assert MotionFingerprint.of(taie2024().scaled(0.999)) != mark
    slower = FourierMotion(taie2024().offset, taie2024().sine, taie2024().cosine, 6.001)
    assert MotionFingerprint.of(slower) != mark


def test_motions_that_belong_together_are_written_all_of_them_or_none(tmp_path, ur_motion):
    pair = tmp_path / "m.json", tmp_path / "m-empty.json"
    save_motions([(path, taie2024()) for path in pair])
    before = [path.read_bytes() for path in pair]
    with pytest.raises(MotionError, match=r"missing/m-empty\.json cannot be written: No such file"):
        save_motions([(pair[0], ur_motion), (tmp_path / "missing" / "m-empty.json", ur_motion)])
    assert [path.read_bytes() for path in pair] == before
    save_motions([(path, ur_motion) for path in pair])
    assert [load_motion(path).name for path in pair] == [ur_motion.name] * 2
    assert sorted(tmp_path.iterdir()) == sorted(pair)

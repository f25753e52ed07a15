"""ROS bags, written by rosbags: ROS 1, ROS 2 sqlite3 and MCAP, with all that a bag may do to its joints and times."""

import json
import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from armload.app.cli import main
from armload.arms import arm
from armload.errors import RecordingError
from armload.recording import read_recording, recording_chunks, write_recording
from armload.recording.ros1_index import CompactReader
from armload.survey.logs import Log
from armload.survey.settings import Settings

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
JOINT_STATE = "sensor_msgs/msg/JointState"
KINDS = ("bag", "db3", "mcap")
PANDA = tuple(f"panda_joint{j}" for j in range(1, 8))
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
EPOCH = 1_700_000_000_000_000_000  # [ns]


def samples(names=PANDA, rows=20, seed=0, stamped=True, start=EPOCH, **changed):
    """(log time, stamp, names, position, velocity, effort) of some messages at 250 Hz."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(rows):
        stamp = start + 4_000_000 * k
        values = dict(zip(("position", "velocity", "effort"), rng.normal(size=(3, len(names))), strict=True))
        out.append((stamp + 123_456, stamp if stamped else 0, names, *{**values, **changed}.values()))
    return out


def message(store, sequence, stamp, names, position, velocity, effort):
    types = store.types
    time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    seq = {"seq": sequence} if store is ROS1 else {}
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="", **seq)
    values = (np.asarray(v, dtype=float) for v in (position, velocity, effort))
    return types[JOINT_STATE](header, list(names), *values)


def write_bag(folder, kind, topics, name="run", compression=None, also=()):
    """A bag with JointState topics {name: messages}; the path to give to a reader."""
    store = ROS1 if kind == "bag" else ROS2
    if kind == "bag":
        path, writer = folder / f"{name}.bag", Writer1(folder / f"{name}.bag")
    else:
        path = folder / name
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        if compression:
            writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        for other in also:
            writer.add_connection(other, "std_msgs/msg/String", typestore=store)
        connections = {topic: writer.add_connection(topic, JOINT_STATE, typestore=store) for topic in topics}
        merged = sorted((m[0], topic, k, m) for topic, ms in topics.items() for k, m in enumerate(ms))
        for log_time, topic, k, m in merged:
            made = message(store, k, *m[1:])
            raw = store.serialize_ros1(made, JOINT_STATE) if kind == "bag" else store.serialize_cdr(made, JOINT_STATE)
            writer.write(connections[topic], log_time, raw)
    return path


def storage(path):
    """The file with the data inside a ROS 2 bag folder, or the ROS 1 bag itself."""
    return path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", ["folder", "file", "folder without metadata"])
def test_a_bag_gives_what_was_published(tmp_path, panda, kind, form):
    path = write_bag(tmp_path, kind, {"/joint_states": (sent := samples())})
    if form == "file":
        path = storage(path)
    elif form == "folder without metadata" and kind != "bag":
        (path / "metadata.yaml").unlink()
    log = read_recording(path, panda)
    np.testing.assert_allclose(log.t, 0.004 * np.arange(20), atol=1e-12)
    for got, k in ((log.q, 3), (log.dq, 4), (log.tau, 5)):
        np.testing.assert_array_equal(got, [m[k] for m in sent])
    assert (log.joint_names, log.channel, log.notes) == (PANDA, "measured", ())
    assert log.epoch == pytest.approx(EPOCH * 1e-9)


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_a_compressed_ros2_bag_reads(tmp_path, panda, mode):
    path = write_bag(tmp_path, "db3", {"/joint_states": (sent := samples())}, compression=mode)
    np.testing.assert_array_equal(read_recording(path, panda).q, [m[3] for m in sent])


@pytest.mark.parametrize("kind", KINDS)
def test_joints_are_taken_by_name_whatever_their_order(tmp_path, panda, kind):
    names = np.array([*PANDA, *FINGERS])
    rng = np.random.default_rng(1)
    orders = [rng.permutation(9) for _ in range(20)]  # even changing from message to message
    sent = [
        (log, stamp, tuple(names[o]), *(v[o] for v in values))
        for o, (log, stamp, _, *values) in zip(orders, samples(tuple(names)), strict=True)
    ]
    log = read_recording(write_bag(tmp_path, kind, {"/joint_states": sent}), panda)
    np.testing.assert_array_equal(log.q, [m[3][:7] for m in samples(tuple(names))])
    np.testing.assert_array_equal(log.tau, [m[5][:7] for m in samples(tuple(names))])


def test_a_ur_bag_with_the_elbow_first_reads_in_the_arms_order(tmp_path):
    ur = arm("ur10e")
    names = ("elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint", *ur.joint_names[3:])
    sent = samples(names)
    path = write_bag(tmp_path, "db3", {"/joint_states": sent})
    np.testing.assert_array_equal(read_recording(path, ur).q, [m[3][[2, 1, 0, 3, 4, 5]] for m in sent])
    assert read_recording(path).joint_names == names  # without an arm: as published, and named


def test_a_bag_that_calls_an_iiwa_s_joints_by_another_driver_s_names_reads_in_the_arm_s_order(tmp_path):
    iiwa = arm("iiwa7")
    for names in (iiwa.joint_names, tuple(f"iiwa_joint_{k}" for k in range(1, 8))):
        sent = samples(names[::-1])
        path = write_bag(tmp_path, "mcap", {"/joint_states": sent, "/gripper": samples(FINGERS)}, name=names[0])
        log = read_recording(path, iiwa)
        np.testing.assert_array_equal(log.q, [m[3][::-1] for m in sent])
        assert log.joint_names == iiwa.joint_names


def test_another_arm_s_joints_are_not_taken_for_the_arm_s_by_their_number(tmp_path):
    names = tuple(f"joint_{k}" for k in range(1, 8))  # a Gen3's; an xArm7's are joint1 to joint7
    path = write_bag(tmp_path, "mcap", {"/joint_states": samples(names)})
    assert read_recording(path, arm("gen3")).joint_names == names
    for other in ("xarm7", "iiwa14", "panda"):
        with pytest.raises(RecordingError, match=f"{other}'s joints .* are not on topic /joint_states: found joint_1"):
            read_recording(path, arm(other))


def test_another_device_on_the_same_topic_is_passed_over(tmp_path, panda):
    gripper = samples(FINGERS, rows=7, start=EPOCH + 1_000_000, effort=[])
    path = write_bag(tmp_path, "mcap", {"/joint_states": sorted([*samples(), *gripper], key=lambda m: m[0])})
    np.testing.assert_array_equal(read_recording(path, panda).q, [m[3] for m in samples()])


@pytest.mark.parametrize("kind", KINDS)
def test_the_only_topic_with_the_arms_joints_is_chosen(tmp_path, panda, kind):
    topics = {"/gripper/joint_states": samples(FINGERS), "/arm/joint_states": samples(seed=1), "/b": samples(("x",))}
    path = write_bag(tmp_path, kind, topics)
    np.testing.assert_array_equal(read_recording(path, panda).q, [m[3] for m in topics["/arm/joint_states"]])


def test_several_topics_with_the_arms_joints_ask_for_one(tmp_path, panda):
    topics = {"/joint_states": samples(seed=1), "/joint_states_desired": samples(seed=2)}
    path = write_bag(tmp_path, "mcap", topics)
    with pytest.raises(RecordingError, match=r"2 JointState topics .*: /joint_states, /joint_states_desired; name one"):
        read_recording(path, panda)
    chosen = read_recording(path, panda, topic="/joint_states_desired")
    np.testing.assert_array_equal(chosen.q, [m[3] for m in topics["/joint_states_desired"]])
    assert chosen.channel == "desired"
    with pytest.raises(RecordingError, match=r"no JointState topic '/nope': expected one of /joint_states, "):
        read_recording(path, panda, topic="/nope")


def test_identify_reads_the_tare_from_its_own_topic(tmp_path, capsys):
    def both(name, mine, seed):
        return write_bag(tmp_path, "mcap", {mine: samples(seed=seed), f"{mine}_desired": samples(seed=9)}, name)

    log, tare = both("run", "/arm/joint_states", 1), both("bare", "/joint_states", 2)
    asked = ["identify", str(log), "--robot", "panda", "--topic", "/arm/joint_states"]
    assert main([*asked, "--tare", str(tare)]) == 2
    assert "bare has no JointState topic '/arm/joint_states'" in capsys.readouterr().err
    assert main([*asked, "--tare-topic", "/joint_states"]) == 2
    assert "there is no --tare" in capsys.readouterr().err
    main([*asked, "--tare", str(tare), "--tare-topic", "/joint_states"])
    assert "topic" not in capsys.readouterr().err  # what else is wrong with noise is another matter


@pytest.mark.parametrize(
    ("topics", "says"),
    [
        ({}, r"no topic of type sensor_msgs/JointState: it has /chatter \(std_msgs/msg/String\)"),
        ({"/joint_states": []}, r"topic /joint_states has no messages"),
        ({"/joint_states": samples(rows=1)}, r"holds only 1 row of data"),
        ({"/joint_states": samples(PANDA[:5])}, r"joints panda_joint6, panda_joint7 are not on topic .*found panda_jo"),
        ({"/a": samples(PANDA[:6]), "/b": samples(("x",))}, r"joint panda_joint7 is not on topics /a, /b: found panda"),
        ({"/joint_states": samples(effort=[])}, r"/joint_states message 1 has no effort for 7 joints"),
        (
            {"/joint_states": [*samples(rows=3), *((m[0] + 10**9, *m[1:]) for m in samples(rows=3, velocity=[]))]},
            r"/joint_states message 4 has no velocity for 7 joints",
        ),
        ({"/joint_states": samples(position=[1.0])}, r"/joint_states message 1 has 1 values of position for 7 joints"),
        ({"/joint_states": samples(effort=[0, 0, np.nan, 0, 0, 0, 0])}, r"/joint_states message 1: tau3 is NaN"),
        (
            {"/joint_states": [*samples(rows=3), *((m[0] + 10**9, *m[1:]) for m in samples(rows=3, seed=1))]},
            r"/joint_states message 4: t = 0\.000000 s goes back in time from /joint_states message 3",
        ),
        (
            {"/joint_states": [(m[0], EPOCH + 4_000_000 * (k // 2), *m[2:]) for k, m in enumerate(samples())]},
            r"/joint_states message 2: t = 0\.000000 s repeats the time of /joint_states message 1",
        ),
    ],
)
@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_that_cannot_serve_is_refused_with_the_reason(tmp_path, panda, kind, topics, says):
    path = write_bag(tmp_path, kind, topics, also=["/chatter"])
    with pytest.raises(RecordingError, match=says):
        read_recording(path, panda)


def test_messages_published_twice_are_dropped_with_a_note(tmp_path, panda):
    sent = [(m[0] + k * 1000, *m[1:]) for m in samples() for k in (0, 1)]
    log = read_recording(write_bag(tmp_path, "db3", {"/joint_states": sent}), panda)
    np.testing.assert_array_equal(log.q, [m[3] for m in samples()])
    assert "dropped 20 row(s)" in log.notes[0]


@pytest.mark.parametrize("kind", KINDS)
def test_without_stamps_the_time_of_logging_counts(tmp_path, panda, kind):
    log = read_recording(write_bag(tmp_path, kind, {"/joint_states": samples(stamped=False)}), panda)
    np.testing.assert_allclose(log.t, 0.004 * np.arange(20), atol=1e-12)
    assert "not stamped" in log.notes[0]


def test_a_split_bag_is_read_in_order(tmp_path, panda):
    whole = tmp_path / "split"
    whole.mkdir()
    sent = samples(rows=30)
    for k in range(3):
        part = write_bag(tmp_path, "mcap", {"/joint_states": sent[10 * k : 10 * k + 10]}, name=f"part{k}")
        shutil.copy(storage(part), whole / f"split_{k}.mcap")
    np.testing.assert_array_equal(read_recording(whole, panda).q, [m[3] for m in sent])


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_split_bag_of_more_than_ten_parts_without_metadata_is_read_in_order(tmp_path, panda, kind):
    whole = tmp_path / "split"
    whole.mkdir()
    sent = samples(rows=24)
    for k in range(12):
        part = write_bag(tmp_path, kind, {"/joint_states": sent[2 * k : 2 * k + 2]}, name=f"part{k}")
        shutil.copy(storage(part), whole / f"split_{k}.{kind}")
    np.testing.assert_array_equal(read_recording(whole, panda).q, [m[3] for m in sent])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.02, 0.3, 0.7])
def test_a_bag_cut_off_is_refused(tmp_path, panda, kind, share):
    path = storage(write_bag(tmp_path, kind, {"/joint_states": samples(rows=400)}))
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(RecordingError, match=r"is not a bag that can be read"):
        read_recording(path, panda)


@pytest.mark.parametrize("kind", ["bag", "db3"])
def test_a_bag_without_its_last_bytes_is_refused(tmp_path, panda, kind):
    path = storage(write_bag(tmp_path, kind, {"/joint_states": samples(rows=400)}))
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(RecordingError, match=r"is not a bag that can be read"):
        read_recording(path, panda)


def test_an_mcap_without_its_index_reads_and_says_so(tmp_path, panda):
    path = storage(write_bag(tmp_path, "mcap", {"/joint_states": (sent := samples(rows=400))}))
    path.write_bytes(path.read_bytes()[:-400])
    log = read_recording(path, panda)
    np.testing.assert_array_equal(log.q, [m[3] for m in sent])
    assert "cut off" in log.notes[0]


def test_a_bag_with_a_name_that_sqlite_would_misread_reads_and_nothing_is_left_beside_it(tmp_path, panda):
    path = storage(write_bag(tmp_path, "db3", {"/joint_states": samples()}))
    odd = tmp_path / "single" / "50% #1?.DB3"
    odd.parent.mkdir()
    shutil.copy(path, odd)
    odd.parent.chmod(0o555)
    try:
        assert len(read_recording(odd, panda)) == 20
    finally:
        odd.parent.chmod(0o755)
    assert [p.name for p in odd.parent.iterdir()] == [odd.name]


def test_the_real_ros2_bag_reads(real_data):
    log = read_recording(real_data / "ur10_ros2_bag.db3", arm("ur10e"))
    assert (len(log), round(log.rate), round(log.duration, 1)) == (3441, 125, 27.5)
    slope = np.gradient(log.q, log.t, axis=0)
    assert np.median(np.abs(slope - log.dq), axis=0).max() < 0.01  # [rad/s]; the numbers are where they belong
    with closing(sqlite3.connect(f"file:{real_data / 'ur10_ros2_bag.db3'}?mode=ro", uri=True)) as database:
        (count,) = database.execute("select count(*) from messages").fetchone()
    assert count == len(log)


@pytest.mark.parametrize("asked", [(0, 1), (1, 0), (1,), ()])
def test_a_compact_index_gives_the_messages_of_rosbags_in_the_same_order(tmp_path, monkeypatch, asked):
    path, store = tmp_path / "two.bag", get_typestore(Stores.ROS1_NOETIC)
    times = np.random.default_rng(3).integers(0, 40, size=200)  # many equal, none in order
    with Writer1(path) as writer:
        writer.chunk_threshold = 500  # many chunks
        topics = [writer.add_connection(name, "std_msgs/msg/Header", typestore=store) for name in ("/a", "/b")]
        for k, time in enumerate(times.tolist()):
            made = store.types["std_msgs/msg/Header"](k, store.types["builtin_interfaces/msg/Time"](1, 2), "x")
            writer.write(topics[k % 3 == 0], time + 10**9, store.serialize_ros1(made, "std_msgs/msg/Header"))
    monkeypatch.setattr("armload.recording.ros1_index._AT_ONCE", 7)
    found = []
    for kind in (Reader1, CompactReader):
        with kind(path) as reader:
            chosen = [reader.connections[k] for k in asked]
            found.append([(c.topic, time, raw) for c, time, raw in reader.messages(chosen)])
    assert found[1] == found[0]
    assert len(found[0]) == {2: 200, 0: 200, 1: 67}[len(asked)]


CONSTANTS = np.array([11.98, 11.976, 9.836, 10.70, 10.70, 10.70])  # [N·m/A] of a UR10e, as its sheet has them


def bag_of_currents(folder, kind, rows=20):
    """As UR's ROS 2 driver publishes them, its joints in an order of its own; and the same log in N·m."""
    names = arm("ur10e").joint_names
    turned = (names[2], names[1], names[0], *names[3:])
    path = write_bag(folder, kind, {"/joint_states": samples(turned, rows=rows)})
    return path, read_recording(path, arm("ur10e"))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("said", "constants"),
    [
        ("tau_unit=A", CONSTANTS),
        ("torque_constants=1 2 3 4 5 6", np.arange(1.0, 7.0)),
        ("tau_unit=A,torque_constants=1 2 3 4 5 6", np.arange(1.0, 7.0)),
    ],
)
def test_efforts_that_are_motor_currents_are_multiplied_joint_by_joint(tmp_path, kind, said, constants):
    path, plain = bag_of_currents(tmp_path, kind)
    log = read_recording(path, arm("ur10e"), columns=said)
    np.testing.assert_allclose(log.tau, plain.tau * constants, rtol=1e-15)
    np.testing.assert_array_equal(log.q, plain.q)
    assert log.notes[-1].endswith("N·m/A, with the gears' friction in it")
    chunks = list(recording_chunks(path, arm("ur10e"), columns=said, size=6))
    np.testing.assert_array_equal(np.concatenate([chunk.tau for chunk in chunks]), log.tau)
    assert len(chunks) > 2


def test_units_of_positions_in_a_bag_may_be_said_and_nothing_else(tmp_path):
    path, plain = bag_of_currents(tmp_path, "mcap")
    log = read_recording(path, arm("ur10e"), columns="q_unit=deg,dq_unit=deg/s")
    np.testing.assert_allclose(log.q, np.radians(plain.q), rtol=1e-14)
    np.testing.assert_allclose(log.dq, np.radians(plain.dq), rtol=1e-14)
    np.testing.assert_array_equal(log.tau, plain.tau)
    for said in ("tau=effort", "t_unit=ms", "rate=100"):
        with pytest.raises(RecordingError, match=r"leave them out .but q_unit, dq_unit, tau_unit, torque"):
            read_recording(path, arm("ur10e"), columns=said)


def test_a_survey_reads_the_units_of_bags_too(tmp_path):
    path, plain = bag_of_currents(tmp_path, "mcap")
    settings = Settings("ur10e", columns=(("tau_unit", "A"), ("rate", 100.0)))  # the rate is of its tables
    np.testing.assert_allclose(settings.recording(Log(str(path), ""), path).tau, plain.tau * CONSTANTS, rtol=1e-15)


def test_currents_without_constants_and_constants_of_another_count_are_refused(tmp_path):
    path, _ = bag_of_currents(tmp_path, "db3")
    with pytest.raises(RecordingError, match="5 torque constants for 6 joints"):
        read_recording(path, arm("ur10e"), columns="torque_constants=1 2 3 4 5")
    for said, why in (
        ("tau_unit=Nm,torque_constants=1 2 3 4 5 6", "leave one out"),
        ("torque_constants=1 nan", "positive"),
    ):
        with pytest.raises(RecordingError, match=why):
            read_recording(path, arm("ur10e"), columns=said)
    other = write_bag(tmp_path, "db3", {"/joint_states": samples()}, name="panda")
    with pytest.raises(
        RecordingError, match=r"efforts are motor currents \[A\], and no torque constants are known for p"
    ):
        read_recording(other, arm("panda"), columns="tau_unit=A")


def test_a_real_log_in_a_bag_of_currents_is_answered_like_the_log_itself(tmp_path, real_data, capsys):
    """The front door: two bags as UR's driver writes them, log and tare, and a table for tare beside a bag."""
    paths, robot = [], arm(real_data / "ur10e.urdf")
    for name in ("ur10e_loaded_2805g.csv", "ur10e_unloaded.csv"):
        log = read_recording(real_data / name, robot)
        log = log.between(log.t[0] + 10.0, log.t[0] + 18.0)
        stamps = EPOCH + np.round(1e9 * log.t).astype(np.int64)
        rows = zip(stamps, log.q, log.dq, log.tau / CONSTANTS, strict=True)
        messages = [(int(t), int(t), robot.joint_names, *values) for t, *values in rows]
        paths.append(write_bag(tmp_path, "mcap", {"/joint_states": messages}, name=name[:-4]))
        write_recording(tmp_path / name, log)
    command = ["identify", "--robot", str(real_data / "ur10e.urdf"), "--json"]
    assert main([*command, str(paths[0]), "--tare", str(paths[1])]) == 2
    assert "--columns tau_unit=A multiplies each" in capsys.readouterr().err
    assert main([*command, str(paths[0]), "--tare", str(paths[1]), "--columns", "tau_unit=A"]) == 0
    mine = json.loads(capsys.readouterr().out)
    tables = [str(tmp_path / "ur10e_loaded_2805g.csv"), "--tare", str(tmp_path / "ur10e_unloaded.csv")]
    assert main([*command, *tables]) == 0
    theirs = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(mine["phi"], theirs["phi"], atol=1e-4)
    mixed = [str(paths[0]), "--columns", "tau_unit=A", "--tare", tables[2]]
    assert main([*command, *mixed]) == 2
    assert "say those of the tare with --tare-columns (none, if" in capsys.readouterr().err
    mixed += ["--tare-columns", "none"]
    assert main([*command, *mixed]) == 0
    np.testing.assert_allclose(json.loads(capsys.readouterr().out)["phi"], theirs["phi"], atol=1e-4)

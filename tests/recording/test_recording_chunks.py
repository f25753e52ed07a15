"""A log in parts says what the whole log says, whatever file it is in and however large the parts are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from armload import arm, identify
from armload.errors import RecordingError
from armload.identification import check_plausible
from armload.motion import random_motion
from armload.payloads import test_payload as make_payload
from armload.recording import Recording, read_long, read_recording, recording_chunks, write_recording
from armload.recording.spooled import OnDisk, spooled
from armload.simulation import Sensors, World, simulate_inverse

KINDS = ("csv", "semicolons", "parquet", "lists", "npz", "hdf5", "bag", "db3", "mcap", "unstamped")
JOINT_STATE = "sensor_msgs/msg/JointState"


@pytest.fixture(scope="module")
def log(panda):
    """Taken up after 5 s, with a sample that was written twice, and a payload."""
    held = [(0.0, None), (5.0, make_payload())]
    motion = random_motion(panda, 4, duration=10.0)
    made = simulate_inverse(panda, motion, held, world=World.real_like(panda, 3), rate=100.0, seed=2)
    return replace(made, t=made.t + 1.79e9)


@pytest.fixture(scope="module")
def files(panda, log, tmp_path_factory):
    """The log in every kind of file."""
    h5py, pa = pytest.importorskip("h5py"), pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    folder = tmp_path_factory.mktemp("kinds")
    paths = {kind: folder / f"{kind}.{kind}" for kind in ("csv", "parquet", "npz", "hdf5")}
    for kind in ("csv", "parquet", "npz"):
        write_recording(paths[kind], log)
    with h5py.File(paths["hdf5"], "w") as file:
        file["stamp"] = log.t
        for name, values in (("position", log.q), ("velocity", log.dq), ("torque", log.tau)):
            file[f"joints/{name}"] = values
    paths["semicolons"] = folder / "semicolons.csv"
    lines = paths["csv"].read_text().replace(",", ";").replace(".", ",").splitlines()
    paths["semicolons"].write_text("# written elsewhere\n" + "\n".join([*lines[:301], lines[300], *lines[301:]]) + "\n")
    paths["lists"] = folder / "lists.parquet"
    arrays = {"time": pa.array((log.t * 1e9).astype("int64"), pa.timestamp("ns"))}
    for name, values in (("position", log.q), ("velocity", log.dq), ("effort", log.tau)):
        arrays[name] = pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), panda.n)
    parquet.write_table(pa.table(arrays), paths["lists"], row_group_size=170)
    for kind in ("bag", "db3", "mcap", "unstamped"):
        paths[kind] = write_bag(folder / kind, kind, panda, log)
    return paths


def write_bag(folder, kind, panda, log):
    """A bag with a gripper on the same topic."""
    one = kind == "bag"
    store = get_typestore(Stores.ROS1_NOETIC if one else Stores.ROS2_HUMBLE)
    path = folder.with_suffix(".bag") if one else folder
    plugin = {"db3": StoragePlugin.SQLITE3}.get(kind, StoragePlugin.MCAP)
    state, header, stamp_of = (store.types[name] for name in (JOINT_STATE, "std_msgs/msg/Header", TIME))
    with Writer1(path) if one else Writer2(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/joint_states", JOINT_STATE, typestore=store)
        for k, sample in enumerate(log):
            now = round(sample.t * 1e9)
            at = stamp_of(0, 0) if kind == "unstamped" else stamp_of(now // 10**9, now % 10**9)
            about = header(*((k,) if one else ()), at, "base")
            for names, values in ((panda.joint_names, sample[1:]), (("finger",), [np.zeros(1)] * 3)):
                message = state(about, list(names), *values)
                raw = (store.serialize_ros1 if one else store.serialize_cdr)(message, JOINT_STATE)
                writer.write(connection, now, raw)
    return path


TIME = "builtin_interfaces/msg/Time"


def joined(chunks):
    """One recording of all chunks."""
    parts = list(chunks)
    arrays = (np.concatenate([getattr(part, name) for part in parts]) for name in ("t", "q", "dq", "tau"))
    return replace(parts[-1], **dict(zip(("t", "q", "dq", "tau"), arrays, strict=True)))


@settings(max_examples=40, deadline=None)
@given(kind=st.sampled_from(KINDS), size=st.integers(2, 1500))
def test_the_chunks_of_a_log_are_the_log(panda, files, kind, size):
    whole, parts = read_recording(files[kind], panda), joined(recording_chunks(files[kind], panda, size=size))
    for name in ("t", "q", "dq", "tau"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
    assert (parts.notes, parts.epoch, parts.channel, parts.joint_names, parts.source) == (
        whole.notes,
        whole.epoch,
        whole.channel,
        whole.joint_names,
        whole.source,
    )


@pytest.mark.parametrize("kind", KINDS)
def test_a_log_comes_in_more_than_one_chunk(panda, files, kind):
    assert len(list(recording_chunks(files[kind], panda, size=50))) > 5


@pytest.mark.full
@pytest.mark.parametrize(("kind", "size"), [("mcap", 700), ("csv", 64)])
def test_a_log_on_disk_is_answered_as_one_in_memory(panda, files, kind, size, monkeypatch):
    monkeypatch.setattr("armload.regression.rows_of_log._KEPT", 0.0)  # rows are made anew, as of a long log
    spooled = identify(read_long(files[kind], panda, long=0.0, size=size), panda, method="map")
    monkeypatch.undo()
    whole = identify(files[kind], panda, method="map")
    assert len(whole.segments) == len(spooled.segments) == 2
    for a, b in zip(whole.segments, spooled.segments, strict=True):
        assert (a.start, a.stop, a.answer.notes) == (b.start, b.stop, b.answer.notes)
        np.testing.assert_allclose(b.answer.phi, a.answer.phi, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(b.answer.phi_low, a.answer.phi_low, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_a_log_on_disk_is_answered_without_having_all_of_it_in_memory(name, monkeypatch):
    """numpy asks for the array behind an operand: whatever is done with a whole q, dq or tau reads all of it."""
    robot = arm(name)
    about = {"world": World.real_like(robot, 3), "sensors": Sensors.of(robot), "rate": 100.0, "seed": 1}
    log = spooled([simulate_inverse(robot, random_motion(robot, 4, duration=10.0), make_payload(), **about)], "log")

    def refused(values, dtype=None, copy=None):
        raise AssertionError(f"all of {values.shape} were asked for, as {dtype} (copy: {copy})")

    monkeypatch.setattr(OnDisk, "__array__", refused)
    assert identify(log, robot).n_samples > 900


@pytest.mark.parametrize("size", [33, 4096])
@pytest.mark.parametrize("spoil", ["late", "nan", "text", "cut"])
def test_a_flaw_is_named_as_in_the_whole_log(files, tmp_path, spoil, size):
    lines = files["csv"].read_text().splitlines()
    at = 555
    if spoil == "late":
        lines[at], lines[at + 1] = lines[at + 1], lines[at]
    elif spoil == "cut":
        lines[-1] = lines[-1][:30]
    else:
        lines[at] = ",".join([*lines[at].split(",")[:-1], {"nan": "nan", "text": "soon"}[spoil]])
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + ("" if spoil == "cut" else "\n"))
    if spoil == "cut":
        assert read_long(path, long=0.0, size=size).notes == read_recording(path).notes
        return
    with pytest.raises(RecordingError) as whole:
        read_recording(path)
    with pytest.raises(RecordingError) as parts:
        read_long(path, long=0.0, size=size)
    assert str(parts.value) == str(whole.value)


@pytest.mark.parametrize("what", ["limits", "jump", "degrees", "fast", "strong", "frozen", "dead", "swapped"])
def test_a_log_on_disk_is_refused_as_one_in_memory(panda, log, tmp_path, what):
    q, dq, tau = log.q.copy(), log.dq.copy(), log.tau.copy()
    if what == "limits":
        q[777, 3] = 1.0
    elif what == "jump":
        q[600:, 2] += 0.4
    elif what == "degrees":
        q, dq = np.degrees(q), np.degrees(dq)
    elif what == "fast":
        dq[901, 1] = 50.0
    elif what == "strong":
        tau[640, 0] = 5000.0
    elif what == "frozen":
        tau[300:700] = tau[300]
    elif what == "dead":
        tau[:, 4] = 0.5
    else:
        dq[:, [0, 1]] = dq[:, [1, 0]]
    path = tmp_path / "log.npz"
    write_recording(path, Recording(log.t, q, dq, tau))
    said = []
    for read in (read_recording(path), read_long(path, long=0.0, size=200)):
        with pytest.raises(RecordingError) as refused:
            check_plausible(read, panda)
        said.append(str(refused.value))
    assert said[0] == said[1]


def test_a_part_of_a_log_on_disk_is_that_part(panda, files):
    whole, on_disk = read_recording(files["npz"], panda), read_long(files["npz"], panda, long=0.0, size=100)
    t = whole.t[0]
    for a, b in ((whole.between(t + 2.0, t + 4.0), on_disk.between(t + 2.0, t + 4.0)),):
        c, d = a.select(slice(10, 90, 7)), b.select(slice(10, 90, 7))
        for one, other in ((a, b), (c, d)):
            for name in ("t", "q", "dq", "tau"):
                np.testing.assert_array_equal(np.asarray(getattr(other, name)), getattr(one, name))

"""Parquet, NPZ and HDF5 as others fill them: lists, groups, episodes, files without times."""

import sys

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from armload.arms import arm
from armload.errors import RecordingError
from armload.recording import Recording, read_recording, write_recording

PANDA, ROWS = arm("panda"), 20


def log(start=0.0, seed=0):
    return Recording(start + np.arange(ROWS) / 50, *np.random.default_rng(seed).normal(size=(3, ROWS, 7)))


def same(found, expected):
    for name in ("t", "q", "dq", "tau"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-9, err_msg=name)


def lerobot(path, logs, effort="observation.effort", kind=None, **more):
    """A file of a LeRobot data set (v3 puts several episodes into one)."""
    kind = kind or pa.list_(pa.float64())
    rows = len(logs) * ROWS
    columns = {
        "observation.state": pa.array([q.tolist() for one in logs for q in one.q], kind),
        "observation.velocity": pa.array([dq.tolist() for one in logs for dq in one.dq], kind),
        effort: pa.array([tau.tolist() for one in logs for tau in one.tau], kind),
        "action": pa.array(np.zeros((rows, 7)).tolist(), kind),
        "timestamp": np.concatenate([one.t for one in logs]),
        "frame_index": np.tile(np.arange(ROWS), len(logs)),
        "episode_index": np.repeat(np.arange(len(logs)), ROWS),
        "index": np.arange(rows),
        **more,
    }
    parquet.write_table(pa.table({name: column for name, column in columns.items() if column is not None}), path)
    return path


@pytest.mark.parametrize("kind", [pa.list_(pa.float64()), pa.list_(pa.float64(), 7), pa.large_list(pa.float64())])
def test_an_episode_of_lerobot_reads(tmp_path, kind):
    path = lerobot(tmp_path / "file-000.parquet", [log()], kind=kind)
    same(read_recording(path, PANDA), log())


def test_one_of_several_episodes_is_asked_for_and_read(tmp_path):
    logs = [log(seed=k) for k in range(3)]
    path = lerobot(tmp_path / "file-000.parquet", logs)
    with pytest.raises(RecordingError, match=r"holds 3 episodes \(0, 1, 2\): expected one; name it with --episode K"):
        read_recording(path, PANDA)
    for k, one in enumerate(logs):
        same(read_recording(path, PANDA, episode=k), one)
    with pytest.raises(RecordingError, match=r"has no episode 3: expected one of 0, 1, 2"):
        read_recording(path, PANDA, episode=3)


def test_effort_under_another_key_is_named(tmp_path):
    path = lerobot(tmp_path / "log.parquet", [log()], effort="observation.sensors.load")
    with pytest.raises(RecordingError, match=r"lacks columns of torque .found .*: if .* say so with --columns tau="):
        read_recording(path, PANDA)
    same(read_recording(path, PANDA, columns="tau=observation.sensors.load"), log())


def test_a_state_with_the_gripper_behind_the_joints_needs_its_range(tmp_path):
    state = pa.array([[*q, 0.04] for q in log().q], pa.list_(pa.float64()))
    path = lerobot(tmp_path / "log.parquet", [log()], **{"observation.state": state})
    with pytest.raises(RecordingError, match=r"8 columns of position: expected 7; .*q=observation.state\[\{0\.\.6\}\]"):
        read_recording(path, PANDA)
    same(read_recording(path, PANDA, columns="q=observation.state[{0..6}]"), log())


@pytest.mark.parametrize("names", ["q_{}", "joint_{}.pos", "position{}"])
def test_parquet_knows_the_names_that_csv_knows(tmp_path, names):
    one = log()
    columns = {"time": one.t} | {names.format(k): one.q[:, k] for k in range(7)}
    columns |= {f"velocity_{k}": one.dq[:, k] for k in range(7)} | {f"effort_{k}": one.tau[:, k] for k in range(7)}
    columns |= {"label": ["a"] * ROWS}
    parquet.write_table(pa.table(columns), tmp_path / "log.parquet")
    same(read_recording(tmp_path / "log.parquet", PANDA), one)


def test_one_array_is_read_by_the_numbers_of_its_columns_or_the_names_of_its_fields(tmp_path):
    one = log()
    np.save(tmp_path / "table.npy", np.column_stack([one.t, one.q, one.dq, one.tau]))
    same(read_recording(tmp_path / "table.npy", PANDA, columns="t=1,q={2..8},dq={9..15},tau={16..22}"), one)
    fields = [("t", float), ("q", float, 7), ("dq", float, 7), ("tau", float, 7)]
    np.save(tmp_path / "fields.npy", np.array([tuple(sample) for sample in one], dtype=fields))
    same(read_recording(tmp_path / "fields.npy", PANDA), one)


@pytest.mark.parametrize(
    ("array", "says"),
    [
        (np.zeros((3, 4, 5)), r"shape \(3, 4, 5\)"),
        (np.zeros((9, 3), complex), "complex128"),
        (np.array([{"q": 1.0}], dtype=object), "Python objects"),
        (np.zeros((50, 22)), "no columns named .*found 1, 2"),
    ],
)
def test_one_array_that_is_no_log_is_refused(tmp_path, array, says):
    np.save(tmp_path / "log.npy", array, allow_pickle=True)
    with pytest.raises(RecordingError, match=says):
        read_recording(tmp_path / "log.npy", PANDA)


def test_npz_knows_the_names_that_csv_knows(tmp_path):
    one = log()
    arrays = {"timestamps": one.t, "joint_positions": one.q, "joint_velocities": one.dq, "joint_torques": one.tau}
    np.savez(tmp_path / "log.npz", **arrays, images=np.zeros((ROWS, 4, 4)))
    same(read_recording(tmp_path / "log.npz", PANDA), one)
    np.savez(tmp_path / "two.npz", **arrays, q=one.q)
    with pytest.raises(RecordingError, match=r"position could be 'joint_positions\[0\]' … .* or 'q\[0\]'"):
        read_recording(tmp_path / "two.npz", PANDA)
    short = arrays | {"joint_torques": one.tau[:-1]}
    np.savez(tmp_path / "short.npz", **short)
    with pytest.raises(RecordingError, match=r"has 20 rows and joint_torques\[6\] 19: expected the same number"):
        read_recording(tmp_path / "short.npz", PANDA)


def test_evenly_spaced_samples_need_their_rate(tmp_path):
    one = log()
    np.savez(tmp_path / "log.npz", q=one.q, dq=one.dq, tau=one.tau)
    with pytest.raises(RecordingError, match=r"lacks a column of time"):
        read_recording(tmp_path / "log.npz", PANDA)
    same(read_recording(tmp_path / "log.npz", PANDA, rate=50.0), one)
    write_recording(tmp_path / "timed.csv", one)
    with pytest.raises(RecordingError, match=r"has times \(column 't'\): expected no --rate"):
        read_recording(tmp_path / "timed.csv", PANDA, rate=50.0)


@pytest.mark.parametrize(("suffix", "missing"), [(".parquet", "pyarrow"), (".hdf5", "h5py")])
def test_a_reader_that_is_not_installed_is_named(tmp_path, monkeypatch, suffix, missing):
    path = tmp_path / f"log{suffix}"
    path.write_bytes(b"PAR1" if suffix == ".parquet" else b"\x89HDF\r\n\x1a\n")
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(RecordingError, match=rf"{missing}, which is missing: pip install '?{missing}"):
        read_recording(path, PANDA)


@pytest.mark.parametrize(
    ("name", "begins"),
    [("run.bag", b"#ROSBAG V2.0\n"), ("run.db3", b"SQLite format 3\0"), ("run.mcap", b"\x89MCAP0\r\n")],
)
def test_a_bag_without_a_reader_is_not_called_damaged(tmp_path, monkeypatch, name, begins):
    (tmp_path / name).write_bytes(begins + bytes(84))
    for module in [module for module in sys.modules if module.startswith("rosbags")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(RecordingError, match=r"through rosbags: this needs rosbags, .* pip install .*'rosbags"):
        read_recording(tmp_path / name, PANDA)


def test_csv_is_read_and_written_without_pyarrow(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    write_recording(tmp_path / "log.csv", log())
    same(read_recording(tmp_path / "log.csv"), log())


@pytest.fixture
def h5py():
    return pytest.importorskip("h5py", reason="h5py is not installed: it comes with the extra hdf5")


def test_an_episode_of_aloha_reads_with_its_rate(tmp_path, h5py):
    one, path = log(), tmp_path / "episode_0.hdf5"
    with h5py.File(path, "w") as file:
        file.attrs["sim"] = False
        observations = file.create_group("observations")
        observations["qpos"], observations["qvel"], observations["effort"] = one.q, one.dq, one.tau
        observations.create_group("images")["cam_high"] = np.zeros((ROWS, 4, 4, 3), np.uint8)
        file["action"] = one.q
    with pytest.raises(RecordingError, match=r"lacks a column of time: .*--rate HZ"):
        read_recording(path, PANDA)
    same(read_recording(path, PANDA, rate=50.0), one)


def test_two_arms_in_one_array_need_a_range(tmp_path, h5py):
    one, path = log(), tmp_path / "episode_0.hdf5"
    with h5py.File(path, "w") as file:
        for name, values in (("qpos", one.q), ("qvel", one.dq), ("effort", one.tau)):
            file[f"observations/{name}"] = np.hstack([np.zeros_like(values), values])
    with pytest.raises(RecordingError, match=r"log has 14 joints"):
        read_recording(path, PANDA, rate=50.0)
    right = {
        "q": "observations/qpos[{7..13}]",
        "dq": "observations/qvel[{7..13}]",
        "tau": "observations/effort[{7..13}]",
    }
    same(read_recording(path, PANDA, rate=50.0, columns=right), one)


def test_droid_has_the_measured_torque_under_polymetis_name(tmp_path, h5py):
    one, path = log(), tmp_path / "trajectory.h5"
    state = {"joint_positions": one.q, "joint_velocities": one.dq, "motor_torques_measured": one.tau}
    state |= {"joint_torques_computed": one.q, "prev_joint_torques_computed": one.q, "cartesian_position": one.q[:, :6]}
    with h5py.File(path, "w") as file:
        for name, values in state.items():
            file[f"observation/robot_state/{name}"] = values
            file[f"action/robot_state/{name}"] = values + 1.0
    same(read_recording(path, PANDA, rate=50.0), one)


def test_damaged_hdf5_is_refused(tmp_path, h5py):
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["q"] = np.zeros((4, 7))
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(RecordingError, match=r"is not an HDF5 file that can be read"):
        read_recording(path, PANDA)

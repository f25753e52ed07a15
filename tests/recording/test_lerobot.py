"""Folders of LeRobot data sets, in the layouts of versions 2 and 3: each episode is found, and its joints by name."""

import json

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from armload.arms import arm
from armload.errors import RecordingError
from armload.recording import Recording, has_topics, read_recording

PANDA, ROWS, COUNT = arm("panda"), 12, 5
JOINTS = list(PANDA.joint_names)
KEYS = {"q": "observation.state", "dq": "observation.velocity", "tau": "observation.effort"}
PATHS = {
    2: "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    3: "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
}


def log(episode):
    return Recording(np.arange(ROWS) / 50, *np.random.default_rng(episode).normal(size=(3, ROWS, 7)))


def same(found, expected):
    for name in ("t", "q", "dq", "tau"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-12, err_msg=name)


def write(folder, version, names=None, vectors=None, **info):
    """A data set of COUNT episodes, two of them in a file of version 3, two in a chunk of version 2.

    names: of the elements of every vector, or of each by its key. vectors: key and values (ROWS, n) of an episode
    (default: q, dq and tau).
    """
    vectors = vectors or (lambda episode: {key: getattr(log(episode), name) for name, key in KEYS.items()})
    features = {
        key: {"dtype": "float64", "shape": [v.shape[1]], "names": names.get(key) if isinstance(names, dict) else names}
        for key, v in vectors(0).items()
    }
    about = {"codebase_version": f"v{version}.0", "total_episodes": COUNT, "chunks_size": 2, "fps": 50}
    about |= {"data_path": PATHS[version], "features": features, **info}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(about))
    tables, index = {}, []
    for episode in range(COUNT):
        columns = {
            "timestamp": log(episode).t,
            "episode_index": np.full(ROWS, episode),
            "index": ROWS * episode + np.arange(ROWS),
            **{key: pa.FixedSizeListArray.from_arrays(v.ravel(), v.shape[1]) for key, v in vectors(episode).items()},
        }
        chunk, number = (episode // 2, episode) if version == 2 else (0, episode // 2)
        places = {"episode_index": episode, "episode_chunk": chunk, "chunk_index": chunk, "file_index": number}
        tables.setdefault(PATHS[version].format(**places), []).append(pa.table(columns))
        index.append({"episode_index": episode, "data/chunk_index": chunk, "data/file_index": number, "length": ROWS})
    for place, parts in tables.items():
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(pa.concat_tables(parts), folder / place)
    if version == 3:
        for k, part in enumerate((index[:3], index[3:])):  # the index has several files, too
            (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True, exist_ok=True)
            parquet.write_table(pa.Table.from_pylist(part), folder / f"meta/episodes/chunk-000/file-{k:03d}.parquet")
    return folder


@pytest.mark.parametrize("version", PATHS)
def test_each_episode_of_a_folder_is_found(tmp_path, version):
    folder = write(tmp_path / "set", version)
    assert not has_topics(folder)
    for episode in range(COUNT):
        found = read_recording(folder, PANDA, episode=episode)
        same(found, log(episode))
        assert found.source.endswith(f"set, episode {episode}")
    with pytest.raises(RecordingError, match=r"holds 5 episodes \(0 … 4\): expected one; name it with --episode K"):
        read_recording(folder, PANDA)
    with pytest.raises(RecordingError, match=r"has no episode 5: expected one of 0 … 4"):
        read_recording(folder, PANDA, episode=5)


def test_a_single_episode_needs_no_name(tmp_path):
    same(read_recording(write(tmp_path / "set", 2, total_episodes=1), PANDA), log(0))


@pytest.mark.parametrize("version", PATHS)
@pytest.mark.parametrize("form", [lambda names: names, lambda names: {"motors": names}], ids=["list", "motors"])
@pytest.mark.parametrize("endings", [("", "", ""), (".pos", ".vel", ".effort"), (".pos", ".pos", ".pos")])
def test_joints_with_names_are_taken_by_them(tmp_path, version, form, endings):
    """The elements stand in another order, with a gripper between them."""
    order = [3, 1, 6, 0, 5, 2, 4]

    def vectors(episode):
        one = log(episode)
        return {key: np.insert(getattr(one, name)[:, order], 2, 9.0, axis=1) for name, key in KEYS.items()}

    names = [JOINTS[j] for j in order]
    names = [*names[:2], "gripper", *names[2:]]
    called = {key: form([f"{name}{e}" for name in names]) for key, e in zip(KEYS.values(), endings, strict=True)}
    folder = write(tmp_path / "set", version, called, vectors)
    same(read_recording(folder, PANDA, episode=3), log(3))
    same(read_recording(folder, PANDA, episode=3, columns={"tau": "observation.effort"}), log(3))


def test_one_vector_may_hold_all_that_its_names_say(tmp_path):
    names = [f"joint_{j}.{what}" for what in ("pos", "vel", "effort") for j in range(1, 8)] + ["gripper.pos"]

    def vectors(episode):
        one = log(episode)
        return {"observation.state": np.hstack([one.q, one.dq, one.tau, np.zeros((ROWS, 1))])}

    same(read_recording(write(tmp_path / "set", 3, names, vectors), PANDA, episode=2), log(2))


def test_names_that_say_nothing_leave_the_order(tmp_path):
    same(read_recording(write(tmp_path / "set", 2, [f"motor_{6 - j}" for j in range(7)]), PANDA, episode=1), log(1))


@pytest.mark.parametrize(
    ("version", "info", "says"),
    [
        (2, {"data_path": "data/all.arrow"}, r"has the data_path 'data/all.arrow': expected that of a LeRobot data"),
        (2, {"data_path": "{episode_index}/{camera}.parquet"}, r"expected only \['episode_chunk', 'episode_index'\]"),
        (2, {"data_path": "elsewhere/{episode_index}.parquet"}, r"episode 1 is in .*, which is not there: download it"),
        (2, {"total_episodes": None}, r"total_episodes is None: expected a whole number of at least 1"),
        (3, {"data_path": "{chunk_index.x}/{file_index}"}, r"expected only \['chunk_index', 'file_index'\]"),
    ],
)
def test_a_folder_that_does_not_say_where_its_episodes_are_is_refused(tmp_path, version, info, says):
    with pytest.raises(RecordingError, match=says):
        read_recording(write(tmp_path / "set", version, **info), PANDA, episode=1)


def test_damaged_descriptions_are_refused(tmp_path):
    folder = write(tmp_path / "set", 3)
    for file in (folder / "meta" / "episodes").rglob("*.parquet"):
        file.write_bytes(b"PAR1")
    with pytest.raises(RecordingError, match=r"file-000.parquet does not say where episodes are"):
        read_recording(folder, PANDA, episode=1)
    for text, says in (("{", "cannot be read"), ("[1]", "holds no table")):
        (folder / "meta" / "info.json").write_text(text)
        with pytest.raises(RecordingError, match=rf"info.json {says}"):
            read_recording(folder, PANDA, episode=1)


def test_a_folder_has_no_topics(tmp_path):
    with pytest.raises(RecordingError, match="only ROS bags have topics"):
        read_recording(write(tmp_path / "set", 2), PANDA, episode=1, topic="/joint_states")


def test_a_part_of_a_data_set_is_no_log(tmp_path):
    folder = write(tmp_path / "set", 2)
    with pytest.raises(RecordingError, match=r"meta/info.json: expected a log file, or the folder of"):
        read_recording(folder / "data", PANDA)

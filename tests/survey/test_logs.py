"""Which logs there are, and whose."""

import json
import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from armload.errors import ArmloadError, UsageError
from armload.recording import read_recording
from armload.survey import find_logs
from armload.survey.logs import Log


@pytest.fixture
def folder(tmp_path):
    for name in ("cell-1/a.csv", "cell-1/deep/b.npz", "cell-2/c.mcap", "cell-2/readme.txt.md", "cell-2/.hidden.csv"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    return tmp_path


def names(logs, folder):
    return [log.name.removeprefix(f"{folder}/") for log in logs]


def test_a_folder_is_searched_to_its_bottom_for_what_can_be_a_log(folder):
    assert names(find_logs([str(folder)]), folder) == ["cell-1/a.csv", "cell-1/deep/b.npz", "cell-2/c.mcap"]


def test_links_among_folders_lead_to_no_log_twice(folder):
    """Through two links that lead to each other's folders there are ever longer ways."""
    (folder / "cell-1" / "deep" / "up").symlink_to("../..")
    (folder / "cell-2" / "loop").symlink_to("../cell-1")
    assert names(find_logs([str(folder)]), folder) == ["cell-1/a.csv", "cell-1/deep/b.npz", "cell-2/c.mcap"]


def test_a_folder_that_a_link_leads_to_is_that_of_its_own_arm(folder):
    """`cell-0` comes first by name, and would be the arm of the logs of cell-2."""
    (folder / "cell-0").symlink_to("cell-2")
    assert [(log.arm, log.name) for log in find_logs([str(folder)])][-1] == ("cell-2", f"{folder}/cell-2/c.mcap")
    far = folder.parent / f"{folder.name}-far"
    far.mkdir()
    (far / "d.csv").write_text("x")
    (folder / "cell-3").symlink_to(far)
    assert names(find_logs([str(folder)]), folder)[-2:] == ["cell-2/c.mcap", "cell-3/d.csv"]


def test_a_packed_log_is_a_log_and_one_that_cannot_be_unpacked_here_says_so(folder):
    (folder / "cell-1" / "old.csv.gz").write_text("x")
    (folder / "cell-1" / "older.csv.zst").write_text("x")
    (folder / "cell-1" / "notes.txt.md.gz").write_text("x")
    found = names(find_logs([str(folder)]), folder)
    assert found == ["cell-1/a.csv", "cell-1/deep/b.npz", "cell-1/old.csv.gz", "cell-1/older.csv.zst", "cell-2/c.mcap"]
    with pytest.raises(ArmloadError, match="unpack it first"):
        read_recording(folder / "cell-1" / "older.csv.zst")


def test_globs_lists_and_names_give_each_log_once(folder):
    (folder / "list.txt").write_text(f"# two\n{folder}/cell-1/a.csv\n{folder}/cell-2/readme.txt.md\n")
    found = find_logs([f"{folder}/*/*.csv", f"@{folder}/list.txt", f"{folder}/cell-1"])
    assert names(found, folder) == ["cell-1/a.csv", "cell-1/deep/b.npz", "cell-2/readme.txt.md"]


def test_a_list_may_have_been_written_on_windows_and_its_comments_stand_anywhere(folder):
    lines = ["\ufeff" + f"{folder}/cell-1/a.csv", "  # a note", "", f"  {folder}/cell-2/c.mcap "]
    (folder / "list.txt").write_bytes("\r\n".join(lines).encode())
    assert names(find_logs([f"@{folder}/list.txt"]), folder) == ["cell-1/a.csv", "cell-2/c.mcap"]


def test_lists_that_name_one_another_are_refused_and_one_that_is_named_twice_is_read(folder, monkeypatch):
    monkeypatch.chdir(folder)
    Path("one.txt").write_text("@two.txt\n@two.txt\n")
    Path("two.txt").write_text("cell-1/a.csv\n")
    assert [log.name for log in find_logs(["@one.txt"])] == ["cell-1/a.csv"]
    Path("two.txt").write_text("@one.txt\n")
    with pytest.raises(UsageError, match=r"the list one\.txt names itself"):
        find_logs(["@one.txt"])


def test_a_link_that_leads_to_itself_is_one_log_and_the_others_are_found(folder):
    (folder / "cell-1" / "loop.csv").symlink_to("loop.csv")
    found = names(find_logs([str(folder)]), folder)
    assert found == ["cell-1/a.csv", "cell-1/deep/b.npz", "cell-1/loop.csv", "cell-2/c.mcap"]


@pytest.mark.parametrize("place", ["cell-1/far.csv", "cell-1/far", "cell-1/metadata.yaml"])
def test_a_path_that_cannot_be_asked_is_not_there_and_the_others_are_found(folder, place):
    """As behind a folder without access, which root may enter: a name that is too long is an error, not an absence."""
    far = "x" * 300 + ".csv"
    (folder / place).symlink_to(far)
    found = {log.name: log for log in find_logs([str(folder), far])}
    assert {str(folder / "cell-1" / "a.csv"), str(folder / "cell-2" / "c.mcap"), far} <= set(found)
    assert not found[far].there
    assert (str(folder / place) in found) == place.endswith(".csv")


def test_a_folder_that_cannot_be_listed_is_one_log_and_the_others_are_found(folder, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, _: Path(path).name != "deep")  # root may read whatever it likes
    assert names(find_logs([str(folder)]), folder) == ["cell-1/a.csv", "cell-1/deep", "cell-2/c.mcap"]


def test_arms_are_told_apart_by_the_folder_or_by_an_expression(folder):
    assert [log.arm for log in find_logs([str(folder)])] == ["cell-1", "deep", "cell-2"]
    assert [log.arm for log in find_logs([str(folder)], r"cell-([0-9])")] == ["1", "1", "2"]


def test_a_log_that_the_expression_does_not_fit_is_nobodys(folder):
    assert [log.arm for log in find_logs([str(folder)], r"(cell-1)")] == ["cell-1", "cell-1", ""]


def test_tables_of_surveys_that_lie_among_the_logs_are_no_logs(folder):
    (folder / "old.parquet").write_text("x")
    (folder / "old.parquet.cells" / "0").mkdir(parents=True)
    (folder / "old.parquet.cells" / "0" / "cell.npz").write_text("x")
    (folder / "run.parquet").write_text("x")
    assert names(find_logs([str(folder)]), folder)[-1] == "run.parquet"
    assert len(find_logs([str(folder)])) == 4
    assert len(find_logs([str(folder / "old.parquet")])) == 1  # what is named itself is asked


def test_a_bag_is_one_log_and_a_data_set_one_for_each_episode(folder):
    (folder / "bag").mkdir()
    for name in ("metadata.yaml", "bag_0.mcap", "bag_1.mcap"):
        (folder / "bag" / name).write_text("x")
    meta = folder / "set" / "meta"
    meta.mkdir(parents=True)
    template = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    (meta / "info.json").write_text(json.dumps({"data_path": template, "total_episodes": 2}))
    bag, *episodes = find_logs([str(folder / "bag"), str(folder / "set")])
    assert len(bag.files) == 3
    assert [log.episode for log in episodes] == [0, 1]
    assert [log.files[0].name for log in episodes] == ["episode_000000.parquet", "episode_000001.parquet"]


@pytest.mark.parametrize("version", [2, 3])
def test_an_episode_keeps_its_content_while_its_data_set_grows(tmp_path, version):
    """LeRobot adds episodes to meta/info.json and, from version 3 on, to the Parquet file of those before."""
    template = f"data/chunk-000/{'episode_{episode_index:06d}' if version == 2 else 'file-{file_index:03d}'}.parquet"
    folder, info = tmp_path / "set", {"data_path": template, "features": {"q": {"names": ["a", "b"]}}}
    for sub in ("meta/episodes", "data/chunk-000"):
        (folder / sub).mkdir(parents=True)

    def written(rows, rows_of_a_group=1000, **more):
        """The contents of a data set of so many episodes; rows (E, 5, 2)."""
        (folder / "meta" / "info.json").write_text(json.dumps(info | {"total_episodes": len(rows)} | more))
        parts = [
            pa.table(
                {
                    "episode_index": np.full(5, k),
                    "q": pa.FixedSizeListArray.from_arrays(part.ravel(), 2),
                    "task": [f"task {k}"] * 5,
                }
            )
            for k, part in enumerate(rows)
        ]
        for k, part in enumerate(parts if version == 2 else [pa.concat_tables(parts)]):
            name = template.format(episode_index=k, file_index=0)
            parquet.write_table(part, folder / name, row_group_size=rows_of_a_group)
        index = [{"episode_index": k, "data/chunk_index": 0, "data/file_index": 0} for k in range(len(rows))]
        parquet.write_table(pa.Table.from_pylist(index), folder / "meta/episodes/0.parquet")
        return [log.content() for log in find_logs([str(folder)])]

    rows = np.random.default_rng(0).normal(size=(4, 5, 2))
    before = written(rows[:3])
    assert len(set(before)) == 3
    assert written(rows)[:3] == before
    assert written(rows, rows_of_a_group=7)[:3] == before
    other = rows.copy()
    other[1, 2, 0] += 1e-9
    assert [a == b for a, b in zip(written(other), before, strict=False)] == [True, False, True]
    renamed = written(rows, features={"q": {"names": ["b", "a"]}})
    assert not set(renamed) & set(before)
    file = folder / template.format(episode_index=0, file_index=0)
    file.write_bytes(file.read_bytes()[:100])
    damaged = find_logs([str(folder)])[0].content()
    assert damaged not in renamed
    file.unlink()
    os.mkfifo(file)  # which nobody reads: to open it would wait for ever
    with pytest.raises(OSError, match="it is a pipe"):
        find_logs([str(folder)])[0].content()


def test_a_bag_without_its_metadata_is_one_log_of_the_arm_that_it_lies_with(folder):
    (folder / "cell-1" / "run").mkdir()
    for name in ("run_0.mcap", "run_1.mcap", "notes.md"):
        (folder / "cell-1" / "run" / name).write_text("x")
    found = find_logs([str(folder)])
    assert names(found, folder) == ["cell-1/a.csv", "cell-1/deep/b.npz", "cell-1/run", "cell-2/c.mcap"]
    assert (found[2].arm, len(found[2].files)) == ("cell-1", 3)
    for glob in ("run/*.mcap", "*/run_0.mcap", "run"):
        assert {log.arm for log in find_logs([f"{folder}/cell-1/{glob}"])} == {"cell-1"}
    (folder / "cell-1" / "run" / "metadata.yaml").write_text("x")
    assert {log.arm for log in find_logs([f"{folder}/cell-1/run/*.mcap"])} == {"cell-1"}


def test_logs_that_are_numbered_in_a_folder_of_another_name_are_logs_of_their_own(folder):
    for name in ("run_0.mcap", "run_1.mcap"):
        (folder / "cell-2" / name).write_text("x")
    found = find_logs([str(folder / "cell-2")])
    assert names(found, folder) == ["cell-2/c.mcap", "cell-2/run_0.mcap", "cell-2/run_1.mcap"]
    assert {log.arm for log in found} == {"cell-2"}
    (folder / "cell-2" / "cell-2_0.mcap").write_text("x")  # among others it is no bag
    assert len(find_logs([str(folder / "cell-2")])) == 4


def test_content_and_stamp_follow_the_bytes(folder):
    (log,) = find_logs([str(folder / "cell-1" / "a.csv")])
    before = log.content(), log.stamp()
    (folder / "cell-1" / "a.csv").write_text("xy")
    assert log.content() != before[0]
    assert log.stamp() != before[1]


def test_objects_are_logs_by_their_url():
    fsspec = pytest.importorskip("fsspec")
    store = fsspec.filesystem("memory")
    store.pipe({"/cell/arm-7/a.csv": b"x", "/cell/arm-7/a.md": b"x"})
    (log,) = find_logs(["memory://cell"])
    assert (log.arm, log.files, log.remote) == ("arm-7", (), True)
    assert log.name.endswith("/cell/arm-7/a.csv")
    before = log.content()
    store.pipe({"/cell/arm-7/a.csv": b"xyz"})
    assert log.content() != before


def test_what_the_package_of_a_store_raises_is_an_error_of_the_store(monkeypatch):
    """As of botocore, where nobody is logged in: its errors are no OSErrors."""
    pytest.importorskip("fsspec")

    class NoCredentialsError(Exception):
        pass

    class Closed:
        protocol = "s3"

        def glob(self, _):
            raise NoCredentialsError("Unable to locate\ncredentials")

        def ukey(self, _):
            raise NoCredentialsError

    monkeypatch.setattr("fsspec.core.url_to_fs", lambda url: (Closed(), url.partition("://")[2]))
    with pytest.raises(OSError, match=r"^s3://cell/\*\.csv: NoCredentialsError: Unable to locate credentials$"):
        find_logs(["s3://cell/*.csv"])
    with pytest.raises(OSError, match=r"^s3://cell/a\.csv: NoCredentialsError"):
        Log("s3://cell/a.csv", "cell").stamp()


@pytest.mark.parametrize(
    ("paths", "arm_of", "said"),
    [
        (["cell-3/*.csv"], None, "no log in"),
        (["@none.txt"], None, "the list none.txt cannot be read"),
        (["@print0.txt"], None, "the list print0.txt holds bytes of zero"),
        (["cell-1"], "(", "no regular expression"),
        (["cell-1"], "cell", "has no group"),
        (["cell-1"], "arm-([0-9])", "names no arm in"),
        (["what://x"], None, "what://x"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(folder, monkeypatch, paths, arm_of, said):
    monkeypatch.chdir(folder)
    Path("print0.txt").write_text("cell-1/a.csv\0cell-2/c.mcap\0")
    with pytest.raises(UsageError, match=said.replace("(", r"\(")):
        find_logs(paths, arm_of)

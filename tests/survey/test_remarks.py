"""What a survey says of its logs as a whole: nothing is passed over, replaced or counted twice in silence."""

import gzip
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from armload.app import main
from armload.errors import UsageError
from armload.motion import random_motion
from armload.recording import write_recording
from armload.simulation import simulate_inverse
from armload.survey import Settings, find_logs, read_rows, survey
from armload.survey.findings import arm_findings
from armload.survey.remarks import copies_among, of_copies
from armload.survey.report import survey_sections

SETTINGS = Settings("panda", method="map")


@pytest.fixture(scope="module")
def made(panda, tmp_path_factory):
    """Two short logs of an empty arm."""
    folder = tmp_path_factory.mktemp("made") / "cell"
    folder.mkdir()
    for k in range(2):
        log = simulate_inverse(panda, random_motion(panda, k, duration=5.0), rate=100.0, seed=k)
        write_recording(folder / f"{k}.csv", log.select(slice(0, 200)))
    return folder


@pytest.fixture
def logs(made, tmp_path):
    return Path(shutil.copytree(made, tmp_path / "cell"))


def said_of(paths, out, settings=SETTINGS):
    said: list[str] = []
    found = survey([str(path) for path in paths], settings, out, jobs=1, say=said.append)
    return found, said


@pytest.mark.parametrize(
    "name", ["run.xlsx", "run.ods", "run.bag.active", "run.csv.part", "run.pkl", "month.tar.gz", "run.npy", "run.zip"]
)
def test_a_file_in_a_folder_that_may_be_a_log_and_is_not_read_is_counted_and_named(logs, name):
    (logs / name).write_bytes(b"x")
    passed: set[str] = set()
    assert len(find_logs([str(logs)], passed=passed)) == 2
    assert passed == {str(logs / name)}


@pytest.mark.parametrize("name", ["notes.md", "photo.jpg", "notes.md.gz", ".hidden.xlsx", "bag.yaml", "a.csv.cells"])
def test_what_no_log_is_kept_in_is_passed_over_without_a_word(logs, name):
    (logs / name).write_bytes(b"x")
    passed: set[str] = set()
    find_logs([str(logs)], passed=passed)
    assert not passed


def test_one_sentence_says_which_files_were_passed_over(logs, tmp_path, capsys):
    for name in ("a.xlsx", "b.XLSX", "c.dat"):
        (logs / name).write_bytes(b"x")
    out = tmp_path / "out.json"
    command = ["survey", str(logs), "--robot", "panda", "--method", "map", "--out", str(out), "--jobs", "1"]
    assert main([*command, "--json"]) == 0
    text, notes = capsys.readouterr()
    (line,) = [line for line in notes.splitlines() if "passed over" in line]
    assert "passed over 3 files that may be logs" in line
    assert f"(1 .dat, 2 .xlsx: {logs}/a.xlsx, {logs}/b.XLSX)" in line
    assert ".dat is read where a path or a glob names the file" in line
    assert json.loads(text)["passed_over"] == 3


def test_files_that_are_read_as_one_bag_for_want_of_its_metadata_are_named(logs, tmp_path):
    bag = logs / "run"
    bag.mkdir()
    for name in ("run_0.mcap", "run_1.mcap"):
        (bag / name).write_bytes(b"x")
    _, said = said_of([logs], tmp_path / "a.json")
    (line,) = [line for line in said if "metadata.yaml" in line]
    assert f"1 folder is read as one log, as a ROS 2 bag that has lost its metadata.yaml ({bag}: 2 files)" in line
    assert not any("lost its" in line for line in said_of([f"{bag}/*.mcap"], tmp_path / "b.json")[1])  # as it advises
    (bag / "metadata.yaml").write_text("x")
    assert not any("lost its" in line for line in said_of([logs], tmp_path / "c.json")[1])


def test_a_file_that_is_named_itself_is_not_passed_over(logs):
    (logs / "a.xlsx").write_bytes(b"x")
    passed: set[str] = set()
    assert len(find_logs([str(logs), str(logs / "a.xlsx")], passed=passed)) == 3
    assert not passed


def test_a_folder_without_a_log_says_what_else_is_in_it(tmp_path):
    (tmp_path / "a.xlsx").write_bytes(b"x")
    with pytest.raises(UsageError, match=r"no log in .*; passed over 1 file that may be a log.*a\.xlsx"):
        find_logs([str(tmp_path)])


def test_files_in_an_object_store_that_may_be_logs_are_named_too():
    fsspec = pytest.importorskip("fsspec")
    store = fsspec.filesystem("memory")
    for name in ("/of-remarks/a.csv", "/of-remarks/b.xlsx"):
        store.pipe(name, b"x")
    passed: set[str] = set()
    find_logs(["memory://of-remarks"], passed=passed)
    assert passed == {"memory:///of-remarks/b.xlsx"}


@pytest.mark.parametrize("form", ["csv", "json", "parquet"])
@pytest.mark.full  # some seconds
def test_logs_that_leave_a_table_are_named_before_it_is_replaced(logs, tmp_path, form):
    out = tmp_path / f"out.{form}"
    assert not any("leaves" in line for line in said_of([logs], out)[1])
    said = said_of([logs / "0.csv"], out)[1]
    assert said[0].startswith(f"{out} holds 1 log that is not among those of this survey ({logs}/1.csv)")
    assert {row["log"] for row in read_rows(out)[0]} == {str(logs / "0.csv")}
    found, said = said_of([logs], out)  # nothing was lost: none is answered again
    assert (found.logs, found.anew) == (2, 0)
    assert not any("leaves" in line for line in said)


def test_a_file_where_the_cells_would_be_kept_is_named_before_a_log_is_read(logs, tmp_path):
    (tmp_path / "out.csv.cells").write_text("")
    with pytest.raises(UsageError, match=r"out\.csv\.cells is there and is no folder: .* give another --out"):
        survey([str(logs / "0.csv")], SETTINGS, tmp_path / "out.csv", jobs=1, say=pytest.fail)


@pytest.mark.parametrize("form", ["csv", "json", "parquet"])
def test_a_table_about_another_arm_of_the_same_logs_is_named_and_its_answers_are_kept(logs, tmp_path, form):
    out, said = tmp_path / f"out.{form}", []
    one, other = SETTINGS, replace(SETTINGS, frame="panda_link7")
    (logs / "0.csv").write_text("this is no log\n")
    survey([str(logs / "0.csv")], one, out, jobs=1, say=said.append)
    first = out.read_bytes()
    survey([str(logs / "0.csv")], one, out, jobs=1, say=said.append)
    assert not any("frame" in line for line in said)
    survey([str(logs / "0.csv")], other, out, jobs=1, say=said.append)
    expected = f"{out} is about the frame panda_link8: the new table, about panda_link7, takes its place; "
    assert [line for line in said if line.startswith(expected)]
    assert survey([str(logs / "0.csv")], one, out, jobs=1).anew == 0
    assert out.read_bytes() == first


def test_a_table_never_takes_the_place_of_a_log(logs):
    before = (logs / "1.csv").read_bytes()
    for out in (logs / "1.csv", logs / "text.json"):
        (logs / "text.json").write_text('{"a": 1}')
        with pytest.raises(UsageError, match=f"{out.name} is there, and is no table of a survey"):
            survey([str(logs / "0.csv")], SETTINGS, out, jobs=1)
    assert (logs / "1.csv").read_bytes() == before
    assert sorted(path.name for path in logs.iterdir()) == ["0.csv", "1.csv", "text.json"]


def test_a_damaged_table_with_its_cells_is_written_anew(logs, tmp_path):
    out = tmp_path / "out.parquet"
    said_of([logs], out)
    whole = out.read_bytes()
    for damaged in (whole[:100], b""):
        out.write_bytes(damaged)
        assert said_of([logs], out)[0].anew == 0
        assert out.read_bytes() == whole


def test_copies_are_counted_as_the_survey_counts_logs_each_episode_for_one():
    a, b = ([(name, k, x) for k, x in enumerate(contents)] for name, contents in (("a", "xyz"), ("b", "x-z")))
    said = of_copies(copies_among([("d", None, "x"), *b, *a, ("c", None, "x")]))
    assert said.startswith("3 logs are copies of others, packed or not (b (2 episodes) of a, d of c): ")
    assert of_copies(copies_among([*a, ("b", 0, ""), ("c", 0, "")])) == ""


@pytest.mark.full  # some seconds
def test_copies_of_a_log_are_said_to_be_there_and_broken_files_are_none(logs, tmp_path):
    shutil.copy(logs / "0.csv", logs / "copy of 0.csv")
    (logs / "link.csv").symlink_to("1.csv")
    (logs / "0.csv.gz").write_bytes(gzip.compress((logs / "0.csv").read_bytes()))
    for name in ("no.csv", "none.csv"):
        (logs / name).write_text("")
    found, said = said_of([logs], out := tmp_path / "out.csv")
    (line,) = [line for line in said if "cop" in line]
    assert line.startswith(
        f"3 logs are copies of others, packed or not ({logs}/0.csv.gz of {logs}/0.csv, "
        f"{logs}/copy of 0.csv of {logs}/0.csv, "
    )
    assert f"{logs}/link.csv of {logs}/1.csv" in line
    assert found.logs == 7
    rows, n = read_rows(out)
    marked = {row["log"]: row["notes"].rpartition(" | ")[2] for row in rows if "a copy" in row["notes"]}
    assert marked == {
        f"{logs}/{copy}": f"a copy, packed or not, of {logs}/{original}"
        for copy, original in (("0.csv.gz", "0.csv"), ("copy of 0.csv", "0.csv"), ("link.csv", "1.csv"))
    }
    sections = survey_sections(rows, arm_findings(rows), n)
    assert "Copies of others among them: 3." in sections[0].text
    assert sections[-1].title == "Copies"
    cells = {("0.csv.gz", "0.csv"), ("copy of 0.csv", "0.csv"), ("link.csv", "1.csv")}
    assert set(sections[-1].tables[0].rows) == cells

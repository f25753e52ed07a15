"""A survey: one row for each payload, one for each log that cannot be answered; nothing done twice, nothing lost."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload.errors import UsageError
from armload.lab.cells import load_cells
from armload.motion import random_motion
from armload.payloads import test_payload as make_payload
from armload.recording import write_recording
from armload.simulation import World, simulate_inverse
from armload.survey import Settings, read_rows, survey
from armload.survey.logs import cells_of
from armload.survey.rows import columns

BEGAN = 1.79e9  # [s since 1970]
SETTINGS = Settings("panda", method="map")


@pytest.fixture(scope="module")
def fleet(panda, tmp_path_factory):
    """Two arms: three sound logs, one of them with a payload from 2.5 s on, and two broken ones."""
    folder = tmp_path_factory.mktemp("fleet")
    for name in ("a", "b"):
        (folder / name).mkdir()
    for k, (name, held) in enumerate(
        [
            ("a/empty.csv", [(0.0, None)]),
            ("a/taken.parquet", [(0.0, None), (2.5, make_payload())]),
            ("b/held.npz", [(0.0, make_payload())]),
        ]
    ):
        motion = random_motion(panda, k, duration=5.0)
        log = simulate_inverse(panda, motion, held, world=World.real_like(panda, 3), rate=100.0, seed=k)
        log = log if "taken" in name else log.select(slice(0, 200))
        write_recording(folder / name, replace(log, t=log.t + BEGAN + 100.0 * k))
    (folder / "b" / "text.csv").write_text("this is no log\n")
    (folder / "b" / "cut.parquet").write_bytes((folder / "a" / "taken.parquet").read_bytes()[:2000])
    (folder / "b" / "notes.md").write_text("nothing to survey\n")
    return folder


@pytest.fixture
def own(fleet, tmp_path):
    """A copy of the fleet that may be changed."""
    return Path(shutil.copytree(fleet, tmp_path / "fleet"))


@pytest.fixture(scope="module")
def surveyed(fleet, tmp_path_factory):
    """The table of the fleet, its cells beside it."""
    out = tmp_path_factory.mktemp("out") / "survey.parquet"
    found = survey([str(fleet)], SETTINGS, out, jobs=1)
    assert (found.logs, found.anew) == (5, 5)
    return out


def rows_of(out, fleet):
    """Rows by the log's place in the fleet."""
    found: dict[str, list] = {}
    for row in read_rows(out)[0]:
        found.setdefault(str(Path(row["log"]).relative_to(fleet)), []).append(row)
    return found


@pytest.mark.full  # some seconds
def test_there_is_a_row_for_each_payload_and_its_mass_is_the_true_one(surveyed, fleet):
    rows = rows_of(surveyed, fleet)
    assert [row["held"] for row in rows["a/taken.parquet"]] == [False, True]
    before, after = rows["a/taken.parquet"]
    assert before["t1"] == pytest.approx(2.5, abs=0.1)
    assert after["date"] == pytest.approx(BEGAN + 102.5, abs=0.1)
    truth = make_payload().parameters.mass
    for row in (after, *rows["b/held.npz"]):
        assert row["mass_low"] < truth < row["mass_high"]
        assert row["mass_high"] - row["mass_low"] < 1.0
        assert row["method"] == "map"
    assert [(row["held"], row["arm"]) for row in rows["a/empty.csv"]] == [(False, "a")]
    assert rows["a/empty.csv"][0]["misfit"] is None  # nothing was said of how the arm should be
    assert {len(row) for of in rows.values() for row in of} == {len(columns(7))}


def test_the_row_of_a_part_says_which_part_it_is(surveyed, fleet):
    before, after = rows_of(surveyed, fleet)["a/taken.parquet"]
    assert "the answer is of part 1 of 2; " in before["notes"]
    assert "held at the end" not in before["notes"]
    assert "the answer is of the last of 2 parts, what is held at the end; " in after["notes"]


def test_arms_without_a_tare_of_their_own_are_named_before_any_log_is_answered(own, tmp_path):
    shutil.copy(own / "a" / "empty.csv", tmp_path / "a.csv")
    (own / "a" / "text.csv").write_text("this is no log\n")
    template = str(tmp_path / "{arm}.csv")
    said: list[str] = []
    logs = [str(own / name / "text.csv") for name in ("a", "b")]
    survey(logs, Settings("panda", tare=template), tmp_path / "out.csv", jobs=1, say=said.append)
    assert said[0] == f"no --tare {template} of 1 of 2 arms (b): answered without"
    assert not any("--profile" in line for line in said)


def test_a_broken_file_is_a_row_with_its_reason(surveyed, fleet):
    rows = rows_of(surveyed, fleet)
    for name, reason in (("b/text.csv", "no columns"), ("b/cut.parquet", "not a Parquet file")):
        (row,) = rows[name]
        assert row["status"] == "unusable"
        assert reason in row["reason"]
        assert row["mass"] is None


def test_the_same_command_again_answers_nothing_and_writes_the_same_bytes(surveyed, fleet):
    before = surveyed.read_bytes()
    (fleet / "a" / "empty.csv").touch()  # another time of change, the same content
    assert survey([str(fleet)], SETTINGS, surveyed, jobs=1).anew == 0
    assert surveyed.read_bytes() == before


def test_the_order_of_the_logs_changes_no_byte(surveyed, fleet, tmp_path):
    shutil.copytree(cells_of(surveyed), tmp_path / "other.parquet.cells")
    one_by_one = sorted((str(path) for path in fleet.rglob("*.*") if path.suffix != ".md"), reverse=True)
    assert survey([*one_by_one, str(fleet)], SETTINGS, tmp_path / "other.parquet", jobs=1).anew == 0
    assert (tmp_path / "other.parquet").read_bytes() == surveyed.read_bytes()


def test_only_what_is_new_or_changed_is_answered(own, tmp_path):
    out = tmp_path / "survey.json"
    for name in ("a/taken.parquet", "b/held.npz"):
        (own / name).unlink()
    assert survey([str(own)], SETTINGS, out, jobs=1).anew == 3
    before = {row["log"]: row["key"] for row in read_rows(out)[0]}
    (own / "b" / "text.csv").write_text("this is another one\n")
    (own / "b" / "new.npz").write_bytes(b"")
    found = survey([str(own)], SETTINGS, out, jobs=1)
    assert found.anew == 2
    now = {row["log"]: row["key"] for row in found.rows}
    assert {Path(log).name for log in now if now[log] != before.get(log)} == {"text.csv", "new.npz"}
    (own / "b" / "new.npz").unlink()
    assert {row["log"] for row in survey([str(own)], SETTINGS, out, jobs=1).rows} == set(before)


def test_another_question_is_another_key(fleet, tmp_path):
    text = [str(fleet / "b" / "text.csv")]
    out = tmp_path / "survey.csv"
    assert survey(text, SETTINGS, out, jobs=1).anew == 1
    assert survey(text, replace(SETTINGS, frame="panda_link7"), out, jobs=1).anew == 1
    assert survey(text, replace(SETTINGS, frame="panda_link7"), out, jobs=1).anew == 0


@pytest.mark.full
def test_a_survey_that_was_killed_goes_on_and_ends_with_the_same_bytes(surveyed, fleet, tmp_path):
    out = tmp_path / "survey.parquet"
    words = [
        "-m",
        "armload",
        "survey",
        str(fleet),
        "--robot",
        "panda",
        "--method",
        "map",
        "--jobs",
        "1",
        "--out",
        str(out),
    ]
    process = subprocess.Popen([sys.executable, *words], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    cells = cells_of(out)
    while process.poll() is None and not list(cells.glob("[!.]*.json")):
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    finished = len(load_cells(cells))
    assert 1 <= finished < 5
    assert not out.exists()
    (cells / ".half.json.x1y2.json").write_text('{"na')  # what a kill leaves of a file that was being written
    found = survey([str(fleet)], SETTINGS, out, jobs=1)
    assert found.anew == 5 - finished
    assert out.read_bytes() == surveyed.read_bytes()


@pytest.mark.full
@pytest.mark.parametrize(("jobs", "cluster"), [(2, None), (2, "local")], ids=["two processes", "two Dask workers"])
def test_engines_change_no_byte(surveyed, fleet, tmp_path, jobs, cluster):
    if cluster is not None:
        pytest.importorskip("distributed")
    out = tmp_path / "survey.parquet"
    words = ["survey", str(fleet), "--robot", "panda", "--method", "map", "--jobs", str(jobs), "--out", str(out)]
    more = [] if cluster is None else ["--cluster", cluster]
    done = subprocess.run([sys.executable, "-m", "armload", *words, *more, "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["answered_anew"] == 5
    assert out.read_bytes() == surveyed.read_bytes()


def test_every_form_of_the_table_holds_the_same_rows(surveyed, tmp_path):
    from armload.survey import write_rows

    rows, n = read_rows(surveyed)
    for suffix in (".csv", ".json"):
        write_rows(tmp_path / f"t{suffix}", rows, n)
        assert read_rows(tmp_path / f"t{suffix}") == (rows, n)


def test_a_table_that_a_spreadsheet_has_saved_says_the_same_and_what_is_no_flag_is_refused(surveyed, tmp_path):
    from armload.survey import write_rows

    (rows, n), path = read_rows(surveyed), tmp_path / "t.csv"
    write_rows(path, rows, n)
    text = path.read_text()
    assert ",true," in text
    path.write_text(text.replace(",true,", ",TRUE,").replace(",false,", ",FALSE,"))
    assert read_rows(path) == (rows, n)
    path.write_text(text.replace(",true,", ",1,"))
    with pytest.raises(UsageError, match=r"t\.csv is no survey that can be read"):
        read_rows(path)


def test_each_episode_of_a_file_is_answered_and_a_bad_one_is_a_row(panda, tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    log = simulate_inverse(panda, random_motion(panda, 5, duration=4.0), rate=50.0)
    named = {"timestamp": log.t % 2.0, "episode_index": (log.t >= 2.0).astype(int)}
    for name, values in (("q", log.q), ("dq", log.dq), ("tau", log.tau.copy())):
        if name == "tau":
            values[120:] = 0.0
        named |= {f"{name}{j + 1}": values[:, j] for j in range(7)}
    parquet.write_table(pa.table(named), tmp_path / "two.parquet")
    rows = survey([str(tmp_path / "two.parquet")], SETTINGS, tmp_path / "out.json", jobs=1).rows
    assert [row["episode"] for row in rows] == [0, 1]
    assert [row["status"] for row in rows] == ["answered", "unusable"]


def test_numbers_that_are_not_finite_never_reach_a_row(surveyed):
    for row in read_rows(surveyed)[0]:
        assert all(np.isfinite(value) for value in row.values() if isinstance(value, float))


def test_a_table_that_cannot_be_written_for_want_of_a_package_is_refused_before_a_log_is_read(
    fleet, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "pyarrow", None)  # as if it were not installed
    said = []
    with pytest.raises(ModuleNotFoundError, match=r"this needs pyarrow, .*: pip install 'pyarrow>="):
        survey([str(fleet)], SETTINGS, tmp_path / "survey.parquet", jobs=1, say=said.append)
    assert not said
    assert not list(tmp_path.iterdir())

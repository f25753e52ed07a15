"""Object stores, a full disk, a share that is gone: a survey loses nothing, and says the same in the end."""

from __future__ import annotations

import errno
import gzip
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from armload.errors import ArmloadError, RecordingError, UsageError
from armload.lab.cells import load_cells, save_cell
from armload.motion import random_motion
from armload.recording import write_recording
from armload.simulation import simulate_inverse
from armload.survey import Settings, find_logs, read_rows, survey
from armload.survey.answering import answer_log, lost_log
from armload.survey.logs import cells_of
from armload.survey.rows import as_copy

SETTINGS = Settings("panda", method="map")


@pytest.fixture(scope="module")
def logs(panda, tmp_path_factory):
    folder = tmp_path_factory.mktemp("share") / "arm"
    folder.mkdir()
    for k in range(3):
        log = simulate_inverse(panda, random_motion(panda, k, duration=3.0), rate=100.0, seed=k)
        write_recording(folder / f"{k}.csv", log)
    return folder


@pytest.fixture
def share(logs, tmp_path):
    """A copy of the logs that may vanish."""
    return Path(shutil.copytree(logs, tmp_path / "arm"))


def answers(rows):
    """What the rows say, but for where the logs lay."""
    return [{k: v for k, v in row.items() if k not in ("log", "key")} for row in rows]


@pytest.fixture(scope="module")
def finished(logs, tmp_path_factory):
    """A survey of the logs that is done: its answer, and where its file and its cells lie."""
    out = tmp_path_factory.mktemp("whole") / "survey.json"
    return survey([str(logs)], SETTINGS, out, jobs=1), out


@pytest.fixture(scope="module")
def whole(finished):
    return finished[0].rows


@pytest.fixture
def done(finished, tmp_path):
    """The file of a copy of that survey, whose cells may be damaged."""
    _, out = finished
    shutil.copytree(cells_of(out), cells_of(tmp_path / out.name))
    return Path(shutil.copy(out, tmp_path / out.name))


@pytest.mark.full  # some seconds
def test_logs_in_an_object_store_are_answered_as_those_on_disk_and_once(logs, whole, tmp_path):
    fsspec = pytest.importorskip("fsspec")
    store = fsspec.filesystem("memory")
    try:
        for path in logs.iterdir():
            store.pipe(f"/cell/arm/{path.name}", path.read_bytes())
        found = survey(["memory://cell/arm"], SETTINGS, tmp_path / "survey.json", jobs=1)
        assert answers(found.rows) == answers(whole)
        store.pipe("/cell/arm/1.csv", (logs / "0.csv").read_bytes())
        again = survey(["memory://cell/arm"], SETTINGS, tmp_path / "survey.json", jobs=1)
        assert (again.logs, again.anew) == (3, 1)
    finally:
        store.rm("/cell", recursive=True)


class Web(SimpleHTTPRequestHandler):
    """Files of a folder; `silent`: says neither when one was changed nor how long it is; `broken`: answers 500."""

    silent = broken = False

    def do_GET(self):
        if self.broken:
            self.send_error(500)
        elif self.silent:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(Path(self.translate_path(self.path)).read_bytes())
        else:
            super().do_GET()

    def do_HEAD(self):
        if self.silent:
            self.send_response(200)
            self.end_headers()
        else:
            super().do_HEAD()

    def log_message(self, *_):
        pass


@pytest.fixture
def web(share):
    """The addresses of the logs behind a web server, and its handler."""
    pytest.importorskip("fsspec")
    pytest.importorskip("aiohttp")
    handler = type("Handler", (Web,), {})
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=str(share.parent)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield [f"http://127.0.0.1:{server.server_port}/arm/{k}.csv" for k in range(3)], handler
    finally:
        server.shutdown()
        server.server_close()
        thread.join(30.0)


@pytest.mark.parametrize("silent", [False, True], ids=["that says what changed", "that says nothing"])
@pytest.mark.full  # some seconds
def test_logs_behind_a_web_server_are_answered_as_those_on_disk_and_once(web, share, whole, tmp_path, silent):
    urls, handler = web
    handler.silent = silent
    out = tmp_path / "survey.json"
    found = survey(urls, SETTINGS, out, jobs=1)
    assert answers(found.rows) == answers(whole)
    assert survey(urls, SETTINGS, out, jobs=1).anew == 0
    shutil.copy(share / "0.csv", share / "1.csv")
    again = survey(urls, SETTINGS, out, jobs=1)
    assert (again.logs, again.anew) == (3, 1)
    # a server that says what changed is asked for no content, by which copies are known
    copied = as_copy(answers(whole)[0], again.rows[0]["log"] if silent else None)
    assert answers(again.rows)[1] == copied | {"date": answers(again.rows)[1]["date"]}


def test_a_web_server_that_was_broken_is_asked_again(web, whole, tmp_path):
    urls, handler = web
    handler.broken = True
    found = survey(urls[:1], SETTINGS, tmp_path / "survey.json", jobs=1)
    assert [row["reason"].count("cannot be fetched (ClientResponseError: 500") for row in found.rows] == [1]
    handler.broken = False
    again = survey(urls[:1], SETTINGS, tmp_path / "survey.json", jobs=1)
    assert answers(again.rows) == answers(whole)[:1]


def test_a_log_whose_process_was_killed_is_asked_again(logs, whole, done):
    cell = load_cells(cells_of(done)).popitem()[1]
    log = next(log for log in find_logs([str(logs)]) if log.name == cell["rows"][0]["log"])
    save_cell(cells_of(done), cell | lost_log(log, cell["key"]))
    again = survey([str(logs)], SETTINGS, done, jobs=1)
    assert again.anew == 1
    assert answers(again.rows) == answers(whole)


def test_a_log_that_vanishes_before_it_is_read_leaves_no_key(share):
    log = find_logs([str(share)])[0]
    stamp, content = log.stamp(), log.content()
    assert answer_log(log, SETTINGS, "key", stamp, content).get("key") is None
    Path(log.name).unlink()
    assert answer_log(log, SETTINGS, "key", stamp, content)["key"] == ""


def test_a_log_that_does_not_fit_in_memory_is_asked_again_and_is_no_bug(share, whole, tmp_path, monkeypatch):
    def full(*_):
        raise MemoryError

    one = [str(share / "0.csv")]
    with monkeypatch.context() as poor:
        poor.setattr(Settings, "recording", full)
        (row,) = survey(one, SETTINGS, tmp_path / "survey.json", jobs=1).rows
        assert "too little memory" in row["reason"]
        assert "bug" not in row["reason"]
    again = survey(one, SETTINGS, tmp_path / "survey.json", jobs=1)
    assert again.anew == 1
    assert answers(again.rows) == answers(whole)[:1]


@contextmanager
def no_room():
    """Within, a file of more than a cell's size cannot be written, as where the disk is full."""
    most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, most[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, most)


def test_a_log_for_which_there_is_no_room_is_asked_again(share, tmp_path):
    (share / "3.csv.gz").write_bytes(gzip.compress((share / "0.csv").read_bytes()))
    paths, out = [str(share / "3.csv.gz")], tmp_path / "survey.json"
    with no_room():
        (row,) = survey(paths, SETTINGS, out, jobs=1).rows
    assert f"3.csv.gz cannot be unpacked into {tempfile.gettempdir()}" in row["reason"]
    assert "TMPDIR" in row["reason"]
    again = survey(paths, SETTINGS, out, jobs=1)
    assert (again.anew, again.unusable) == (1, 0)


@pytest.mark.parametrize(("number", "anew"), [(errno.EIO, 1), (errno.ENOSPC, 1), (None, 0)])
def test_what_the_system_could_not_read_is_asked_again_and_what_is_damaged_is_not(
    share, tmp_path, monkeypatch, number, anew
):
    def fails(*_):
        try:
            raise OSError(number, os.strerror(number)) if number else OSError("damaged, says its decoder")
        except OSError:
            raise RecordingError("cannot be read") from None

    one = [str(share / "0.csv")]
    with monkeypatch.context() as poor:
        poor.setattr(Settings, "recording", fails)
        assert survey(one, SETTINGS, tmp_path / "survey.json", jobs=1).unusable == 1
    again = survey(one, SETTINGS, tmp_path / "survey.json", jobs=1)
    assert (again.anew, again.unusable) == (anew, 1 - anew)


@pytest.mark.full  # some seconds
def test_a_full_disk_is_said_and_the_survey_goes_on_from_there(share, whole, tmp_path):
    out = tmp_path / "survey.json"
    most = 4000  # bytes of a file: cells of a log fit, the table of all three does not
    limited = (
        f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most})); from armload.app import main"
    )
    words = [sys.executable, "-c", f"{limited}; raise SystemExit(main())", "survey", str(share), "--robot", "panda"]
    words += ["--method", "map", "--jobs", "1", "--out", str(out)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert "File too large" in done.stderr
    assert not out.exists()
    kept = {path.name for path in (tmp_path / "survey.json.cells").iterdir()}
    again = survey([str(share)], SETTINGS, out, jobs=1)
    assert answers(again.rows) == answers(whole)
    assert again.anew == 3 - len(kept)
    assert len(kept) == 3


@pytest.mark.parametrize("left", [b"", b'{"name": "0', b"\xff\x00", b"[]"], ids=["no", "half", "noise", "list"])
def test_a_damaged_cell_is_named_and_its_log_alone_is_answered_again(logs, whole, done, left):
    cell = sorted(cells_of(done).glob("*.json"))[0]
    cell.write_bytes(left)
    said: list[str] = []
    again = survey([str(logs)], SETTINGS, done, jobs=1, say=said.append)
    assert again.anew == 1
    assert answers(again.rows) == answers(whole)
    assert [line for line in said if cell.name in line] == [
        f"1 file is no whole cell ({cell}): what is missing is measured again"
    ]
    assert survey([str(logs)], SETTINGS, done, jobs=1).anew == 0


@pytest.mark.full  # some seconds
def test_a_share_that_vanishes_costs_no_row_once_it_is_back(share, whole, tmp_path):
    out = tmp_path / "survey.json"
    away = share.with_name("away")
    survey([str(share)], SETTINGS, out, jobs=1)
    before = out.read_bytes()
    paths = sorted(str(path) for path in share.iterdir())
    share.rename(away)
    gone = survey(paths, SETTINGS, out, jobs=1)
    assert [row["status"] for row in gone.rows] == ["unusable"] * 3
    assert all("does not exist" in row["reason"] or "cannot be read" in row["reason"] for row in gone.rows)
    away.rename(share)
    back = survey(paths, SETTINGS, out, jobs=1)
    assert answers(back.rows) == answers(whole)
    assert out.read_bytes() == before
    assert read_rows(out)[0] == back.rows


@pytest.mark.full  # some seconds
def test_a_name_that_is_no_utf8_has_its_row_in_every_form(share, tmp_path):
    odd = os.fsencode(share) + b"/k\xe4lte.csv"
    try:
        os.rename(share / "1.csv", odd)
    except OSError:
        pytest.skip("this file system takes names of UTF-8 only")
    for suffix in ("csv", "parquet", "json"):
        out = tmp_path / f"survey.{suffix}"
        found = survey([str(share)], SETTINGS, out, jobs=1)
        assert (found.anew, found.unusable) == (3, 0)
        assert {row["log"] for row in read_rows(out)[0]} == {
            f"{share}/0.csv",
            f"{share}/2.csv",
            f"{share}/k\\xe4lte.csv",
        }
        assert survey([str(share)], SETTINGS, out, jobs=1).anew == 0


def test_a_name_that_is_no_utf8_can_be_printed(logs, tmp_path):
    words = [sys.executable, "-m", "armload", "survey", str(logs / "0.csv"), "--robot", "panda", "--method", "map"]
    utf8 = os.environ | {"PYTHONIOENCODING": "utf-8:strict"}
    done = subprocess.run([*words, "--out", b"k\xe4lte.csv"], cwd=tmp_path, capture_output=True, env=utf8)
    assert (done.returncode, b"wrote k\\udce4lte.csv" in done.stdout) == (0, True), done.stderr
    assert b"1 log (1 answered anew): 1 row, " in done.stdout
    assert b"1 log: asking" in done.stderr


def test_a_pipe_is_no_log_and_one_that_is_named_has_a_row(share, tmp_path):
    pipe = share / "pipe.csv"
    os.mkfifo(pipe)
    assert len(find_logs([str(share)])) == 3
    found = survey([str(pipe), str(share / "0.csv")], SETTINGS, tmp_path / "survey.json", jobs=1)
    assert [(row["log"], row["status"]) for row in found.rows if row["status"] == "unusable"] == [
        (str(pipe), "unusable")
    ]
    assert "it is a pipe" in next(row["reason"] for row in found.rows if row["log"] == str(pipe))


@pytest.mark.parametrize(
    ("method", "said"), [("nosuch", "unknown method 'nosuch'"), ("joint", "needs a tare"), ("tree", "name its file")]
)
def test_a_method_that_no_log_can_be_asked_with_is_refused_before_any_is(logs, tmp_path, method, said):
    with pytest.raises(ArmloadError, match=said):
        survey([str(logs)], Settings("panda", method=method), tmp_path / "survey.json", jobs=1)
    assert list(tmp_path.iterdir()) == []


def test_a_method_that_needs_a_tare_is_asked_with_one(logs, tmp_path):
    asked = Settings("panda", method="difference", tare=str(logs / "0.csv"))
    found = survey([str(logs / "1.csv")], asked, tmp_path / "survey.json", jobs=1)
    assert (found.logs, len(found.rows)) == (1, 1)


@pytest.mark.full  # some seconds
def test_each_arms_tare_among_the_logs_is_passed_over_as_one_of_all_arms_is(panda, share, tmp_path):
    arm = share.name
    log = simulate_inverse(panda, random_motion(panda, 9, duration=3.0), rate=100.0, seed=9)
    write_recording(share / "tare.csv", log)
    for tare in (share / "tare.csv", share.with_name("{arm}") / "tare.csv"):
        settings = replace(SETTINGS, tare=str(tare))
        found = survey([str(share)], settings, tmp_path / "survey.json", jobs=1)
        assert {row["arm"] for row in found.rows} == {arm}
        assert str(share / "tare.csv") not in {row["log"] for row in found.rows}
        assert found.logs == 3


def test_paths_of_which_none_is_there_are_refused_and_one_among_others_has_a_row(logs, tmp_path):
    out, typo = tmp_path / "survey.json", str(logs.parent / "amr")
    with pytest.raises(UsageError, match="no such file or folder"):
        survey([typo], SETTINGS, out, jobs=1)
    assert not out.exists()
    found = survey([typo, str(logs / "0.csv")], SETTINGS, out, jobs=1)
    assert [row["status"] for row in found.rows if row["log"] == typo] == ["unusable"]

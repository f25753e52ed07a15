"""A file is there whole or not at all, and a writer that was killed leaves nothing that stays."""

import errno
import os
import signal
import subprocess
import sys
import threading

import pytest

from armload.runtime.atomic import clear_left_over, kept_alone, replacing

WRITER = """
import sys
from armload.runtime.atomic import replacing
with replacing(sys.argv[1]) as part:
    part.write_text("half")
    print("half", flush=True)
    sys.stdin.readline()
    part.write_text("whole")
"""


@pytest.fixture
def writer():
    """Another process that has written half of a file, and waits."""
    started = []

    def begin(path):
        process = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        started.append(process)
        assert process.stdout.readline() == "half\n"
        return process

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_the_next_writer_takes_what_a_killed_one_has_left(writer, tmp_path):
    path = tmp_path / "state.npz"
    process = writer(path)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert len(names(tmp_path)) == 1  # what it has left
    with replacing(path) as part:
        assert part.read_bytes() == b""
        part.write_text("new")
    assert names(tmp_path) == ["state.npz"]
    assert path.read_text() == "new"


def test_what_a_killed_writer_has_left_is_cleared_and_what_one_writes_now_is_not(writer, tmp_path):
    path = tmp_path / "state.npz"
    path.write_text("old")
    killed = writer(path)
    alive = writer(path)
    assert len(names(tmp_path)) == 3
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    clear_left_over(path)
    assert len(names(tmp_path)) == 2
    assert path.read_text() == "old"
    alive.communicate("\n")
    assert alive.returncode == 0
    assert names(tmp_path) == ["state.npz"]
    assert path.read_text() == "whole"


def test_writers_of_one_file_do_not_meet(tmp_path):
    path, texts = tmp_path / "state.npz", {str(k) * 10_000 for k in range(10)}
    wrong = []

    def write(text):
        for _ in range(50):
            with replacing(path) as part:
                part.write_text(text)
            if path.read_text() not in texts:
                wrong.append(path.read_text()[:10])

    threads = [threading.Thread(target=write, args=(text,)) for text in texts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
    assert names(tmp_path) == ["state.npz"]


def test_a_block_that_fails_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "state.npz"
    path.write_text("old")

    def fail():
        with replacing(path) as part:
            part.write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert names(tmp_path) == ["state.npz"]
    assert path.read_text() == "old"


def test_where_nothing_can_be_locked_files_are_written_all_the_same(monkeypatch, tmp_path):
    def refuse(*_):
        raise OSError(38, os.strerror(38))

    monkeypatch.setattr("armload.runtime.atomic.fcntl.flock", refuse)
    with replacing(tmp_path / "state.npz") as part:
        part.write_text("new")
    assert (tmp_path / "state.npz").read_text() == "new"
    assert names(tmp_path) == ["state.npz"]


def test_a_link_in_the_place_of_the_temporary_file_is_not_followed(tmp_path):
    path, other = tmp_path / "state.npz", tmp_path / "other"
    other.write_text("another's")
    with replacing(path) as part:
        part.write_text("new")
    for k in range(8):
        (tmp_path / part.name.replace("part0", f"part{k}")).symlink_to(other)
    with replacing(path) as part:
        part.write_text("newer")
    assert (path.read_text(), other.read_text()) == ("newer", "another's")


@pytest.mark.parametrize("why", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_full_disk_is_an_error_of_the_file_that_was_wanted(tmp_path, why):
    """A write that fails names no file by itself."""
    path = tmp_path / "a.json"
    with pytest.raises(OSError, match=r"space|exceeded|large") as caught, replacing(path):
        raise OSError(why, os.strerror(why))
    assert caught.value.filename == str(path)


KILLED_WHILE_IT_KEPT = """
import os, signal, sys
from armload.runtime.atomic import kept_alone
with kept_alone(sys.argv[1], 0.0):
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_who_keeps_a_file_alone_keeps_others_out_until_it_ends_however_it_does(tmp_path):
    kept, said = tmp_path / "state.npz", r"another process keeps .*state\.npz: is the same one running twice"
    with kept_alone(kept, 0.0):
        with pytest.raises(BlockingIOError, match=said), kept_alone(kept, 0.1):
            pass
        with kept_alone(tmp_path / "other.npz", 0.0):
            pass
    assert subprocess.run([sys.executable, "-c", KILLED_WHILE_IT_KEPT, kept]).returncode == -signal.SIGKILL
    with kept_alone(kept, 0.0):
        assert [path.name for path in tmp_path.iterdir()] == [".state.npz.lock"]
    assert not [*tmp_path.iterdir()]
    with kept_alone(tmp_path / "none" / "state.npz", 0.0):  # no such folder yet: there is nothing to keep
        pass

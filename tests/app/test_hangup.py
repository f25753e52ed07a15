"""A terminal that is closed ends what runs in it as SIGTERM does: with a sentence, and with files that are whole."""

import contextlib
import json
import os
import pty
import signal
import subprocess
import sys
import time

import pytest

from armload.arms import arm
from armload.recording import read_recording

pytestmark = pytest.mark.full  # some seconds each
# The child takes the terminal once it is another program: amid JAX's threads, what was only forked may run nothing.
# Whatever the tests run under may ignore SIGHUP, too.
IN_ITS_TERMINAL = """
import fcntl, os, signal, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
signal.signal(signal.SIGHUP, signal.SIG_IGN if sys.argv[1] == "nohup" else signal.SIG_DFL)
os.execv(sys.executable, [sys.executable, "-m", "armload", *sys.argv[2:]])
"""
MEASURE = ("measure", "sim", "--speed", "max", "--motion", "taie2024", "--method", "map")


@pytest.fixture
def in_a_terminal(tmp_path):
    """Starts `armload …` in a terminal of its own; what it says goes to files. `hang_up` closes the terminal."""
    made = []

    def start(*arguments, nohup=False):
        ours, theirs = pty.openpty()
        out, err = tmp_path / "out", tmp_path / "err"
        with out.open("w") as said, err.open("w") as noted:
            process = subprocess.Popen(
                [sys.executable, "-c", IN_ITS_TERMINAL, "nohup" if nohup else "", *map(str, arguments)],
                stdin=theirs,
                stdout=said,
                stderr=noted,
                start_new_session=True,
            )
        os.close(theirs)
        ends = [ours]

        def hang_up():
            os.close(ends.pop())

        def wait_for(words, where):
            until = time.monotonic() + 120.0
            while words not in where.read_text():
                assert time.monotonic() < until, err.read_text()
                assert process.poll() is None, err.read_text()
                time.sleep(0.05)

        made.append((process, ends))
        return process, hang_up, lambda words: wait_for(words, err), lambda words: wait_for(words, out)

    start.noted = lambda: (tmp_path / "err").read_text().splitlines()
    start.said = lambda: (tmp_path / "out").read_text().splitlines()
    yield start
    for process, ends in made:
        process.kill()
        process.wait()
        for end in ends:
            with contextlib.suppress(OSError):
                os.close(end)


def test_whoever_waits_for_a_yes_or_for_the_payload_ends_with_a_sentence(in_a_terminal, tmp_path):
    process, hang_up, noted, _ = in_a_terminal(*MEASURE, "--dir", tmp_path / "asked")
    noted("type yes")
    hang_up()
    assert process.wait(30.0) == 130
    assert in_a_terminal.noted()[-1].endswith("armload: interrupted")
    assert not (tmp_path / "asked").exists()
    grip = ("--grip", f"{sys.executable} -c 'import time; time.sleep(100)'")
    process, hang_up, noted, _ = in_a_terminal(*MEASURE, "--move", "--dir", tmp_path / "run", *grip)
    noted("mounting: ")
    hang_up()
    assert process.wait(30.0) == 130
    assert "the empty run is whole: once the payload is on, --tare" in in_a_terminal.noted()[-2]
    assert in_a_terminal.noted()[-1] == "armload: interrupted"
    assert read_recording(tmp_path / "run" / "empty.csv", arm("panda")).duration > 5.0


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_live_record_is_whole_whatever_ends_the_stream(in_a_terminal, tmp_path, number):
    pytest.importorskip("mcap")
    record = tmp_path / "run.mcap"
    process, hang_up, _, said = in_a_terminal("live", "sim", "--headless", "--method", "map", "--record", record)
    said("n_samples")
    hang_up() if number == signal.SIGHUP else process.send_signal(number)
    assert process.wait(30.0) == 130
    assert in_a_terminal.noted()[-1] == "armload: interrupted"
    assert record.read_bytes().endswith(b"\x89MCAP0\r\n")  # with the index, which a kill leaves out
    assert len(read_recording(record, arm("panda"))) > 0


def test_a_benchmark_that_is_ended_leaves_nothing_of_its_cluster(in_a_terminal, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setenv("DASK_TEMPORARY_DIRECTORY", str(tmp_path / "scratch"))
    process, _, noted, _ = in_a_terminal("benchmark", "--quick", "--out", tmp_path / "quick", "--cluster", "local")
    noted("part 1 of 4")
    assert list((tmp_path / "scratch").rglob("worker-*"))
    process.send_signal(signal.SIGTERM)
    assert process.wait(60.0) == 130
    assert in_a_terminal.noted()[-1] == "armload: interrupted"
    assert not any(path.is_dir() for path in (tmp_path / "scratch").rglob("worker-*"))


def test_processes_of_a_command_whose_terminal_is_closed_say_nothing(in_a_terminal, tmp_path):
    process, _, noted, _ = in_a_terminal("benchmark", "--quick", "--out", tmp_path / "quick", "--jobs", "2")
    noted("part 2 of 4")
    time.sleep(2.0)  # they are there
    os.killpg(process.pid, signal.SIGHUP)  # as a shell passes it on
    assert process.wait(60.0) == 130
    assert in_a_terminal.noted()[-1] == "armload: interrupted"
    time.sleep(1.0)  # what watches over their resources ends last
    assert all(line.startswith("armload: ") for line in in_a_terminal.noted())


def test_a_service_whose_terminal_is_closed_saves_and_ends(in_a_terminal, tmp_path):
    process, hang_up, _, said = in_a_terminal("serve", "sim", "--method", "map", "--save", tmp_path / "state")
    said('"known": true')
    hang_up()
    assert process.wait(60.0) == 0
    (state,) = (tmp_path / "state").iterdir()
    assert json.loads(in_a_terminal.said()[-1])["arm"] == "arm1"
    assert state.stat().st_size > 0


def test_what_is_to_outlive_its_terminal_does(in_a_terminal, tmp_path):
    process, hang_up, _, said = in_a_terminal(
        "live", "sim", "--headless", "--method", "map", "--record", tmp_path / "run.csv", "--duration", "4", nohup=True
    )
    said("n_samples")
    hang_up()
    assert process.wait(60.0) == 0
    assert read_recording(tmp_path / "run.csv", arm("panda")).duration > 3.5

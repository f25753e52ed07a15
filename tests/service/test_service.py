"""The whole service as its users start it: processes that are killed, two arms, the endpoint, alarms, its state."""

import contextlib
import json
import os
import queue
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from armload.payloads import test_payload
from armload.recording import write_recording
from armload.service import ArmSettings, Service, ServiceSettings

HELD = test_payload().parameters
# for four minutes at most, and never before other processes, whatever priority it was started with
BUSY = """
import os, time
os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
end = time.monotonic() + 240.0
while time.monotonic() < end:
    pass
"""

KILLED = """
import os, signal, sys
from armload.runtime.atomic import replacing
with replacing(sys.argv[1]) as part:
    part.write_text("half")
    os.write(1, b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def cell(panda, analytic_log, tmp_path):
    """A file of arms that replay a log in a circle; the second alternates with it."""
    write_recording(tmp_path / "run.csv", analytic_log(panda, HELD, duration=8.0))

    def make(*names, steady=False, **service):
        # each process is an arm's, or its reader: that one that is ready takes over is in test_spare.py
        lines = [f"{key} = {json.dumps(value)}" for key, value in {"spare": False, **service}.items()]
        for name in names:
            lines += ["[[arm]]", f'name = "{name}"', 'source = "run.csv"', 'robot = "panda"', 'method = "map"']
            lines += ["loop = true", 'save = "state"', "rating = 0.5" if name == "heavy" else ""]
            lines += ["steady = true"] if steady else []
        path = tmp_path / "cell.toml"
        path.write_text("\n".join(lines))
        return path

    return make


class Running:
    """`armload serve`, and what it has said."""

    def __init__(self, *arguments):
        command = [sys.executable, "-m", "armload", "serve", *map(str, arguments)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.lines, self.notes, self.stopped = queue.Queue(), [], []
        self.threads = [
            threading.Thread(target=self.hear, daemon=True),
            threading.Thread(target=self.read, daemon=True),
        ]
        for thread in self.threads:
            thread.start()

    def hear(self):
        for line in self.process.stdout:
            self.lines.put(json.loads(line))

    def read(self):
        for line in self.process.stderr:
            self.notes.append(line)

    def until(self, condition, seconds=120.0):
        """The first line that fulfils a condition."""
        end = time.monotonic() + seconds
        while True:
            left = end - time.monotonic()
            assert left > 0, self.notes
            try:
                line = self.lines.get(timeout=min(left, 1.0))
            except queue.Empty:
                assert self.process.poll() is None, self.notes
                continue
            if condition(line):
                return line

    def stop(self):
        """Let the process of its only arm hang; which that was."""
        (pid,) = [p for p in children(self.process.pid) if b"arm_process" in Path(f"/proc/{p}/cmdline").read_bytes()]
        self.stopped.append(pid)
        os.kill(pid, signal.SIGSTOP)
        return pid

    def url(self):
        end = time.monotonic() + 60.0
        while not any("http://" in note for note in self.notes):
            assert time.monotonic() < end, self.notes
            time.sleep(0.02)
        note = next(note for note in self.notes if "http://" in note)
        return note.split()[-1].removesuffix("/arms")

    def close(self):
        """Kill whatever is left: a process that was stopped would hold the pipes, and whoever reads them, for ever."""
        below = children(self.process.pid) if self.process.poll() is None else []
        self.process.kill()
        self.process.wait()
        for pid in {*below, *self.stopped}:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        for thread in self.threads:
            thread.join(60.0)
        self.process.stdout.close()
        self.process.stderr.close()


@pytest.fixture
def serve():
    started = []

    def start(*arguments):
        started.append(Running(*arguments))
        return started[-1]

    yield start
    for running in started:
        running.close()


def known(name):
    return lambda line: line["arm"] == name and line.get("known")


def children(pid):
    """Processes a process has started, and those that these have."""
    found = []
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it ends while it is looked at
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += [int(child) for child in (task / "children").read_text().split()]
    return found + [deeper for child in found for deeper in children(child)]


def ended(pids):
    """Which of some processes have not ended."""
    return [pid for pid in pids if Path(f"/proc/{pid}").exists() and " Z " not in Path(f"/proc/{pid}/stat").read_text()]


def remaining(pids, seconds=20.0):
    """Which of some processes have not ended after so long: on a busy machine a killed one takes its time."""
    end = time.monotonic() + seconds
    while (left := ended(pids)) and time.monotonic() < end:
        time.sleep(0.05)
    return left


def get(url, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=10) as response:
            return response.status, json.loads(response.read())
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.loads(error.read())


@pytest.mark.full
def test_an_arm_whose_velocities_are_told_by_its_positions_too_is_answered_75_ms_later_and_says_so(serve, cell):
    running = serve(cell("light", steady=True, every=0.1))
    line = running.until(known("light"))
    assert line["mass"] == pytest.approx(HELD.mass, abs=0.05)
    lags = [running.until(known("light"))["lag"] for _ in range(10)]
    assert 0.07 < min(lags) < 0.15  # the others may have waited for a busy machine


def fields_on(page, heading):
    """The names in the first table below a heading of a page of docs/."""
    below = (Path(__file__).resolve().parents[2] / "docs" / page).read_text(encoding="utf-8").split(heading)[1]
    table = re.search(r"(?:^\|.*\n)+", below, re.MULTILINE)[0]
    rows = [row.split("|")[1] for row in table.splitlines()]
    return {name for row in rows for name in re.findall(r"`(\w+)`", row)}


@pytest.mark.full
def test_the_pages_have_a_row_for_every_field_of_a_line(serve, cell):
    line = serve(cell("light")).until(known("light"))
    told = fields_on("service.md", "## Output lines") | fields_on("live.md", "## Lines of JSON") - {"truth"}
    assert set(line) == told


@pytest.mark.full
def test_two_arms_answer_over_http_and_a_kill_of_one_leaves_the_other(serve, cell):
    running = serve(cell("light", "heavy", port=0, every=0.2))
    raised = running.until(lambda line: line.get("alarm") == "over_rating")  # comes once, and before or after the rest
    assert running.until(known("light"))["mass"] == pytest.approx(HELD.mass, abs=0.05)
    running.until(known("heavy"))
    assert (raised["arm"], raised["state"], raised["limit"]) == ("heavy", "raised", 0.5)
    url = running.url()
    status, answers = get(f"{url}/arms")
    assert status == 200
    assert set(answers) == {"light", "heavy"}
    assert get(f"{url}/arms/none")[0] == get(f"{url}/x")[0] == 404
    assert get(f"{url}/arms", Host="evil.example")[0] == 403
    with urllib.request.urlopen(f"{url}/stream/light", timeout=10) as stream:
        assert json.loads(stream.readline())["arm"] == "light"

    arms = [pid for pid in children(running.process.pid) if b"arm_process" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    before = answers["light"]["restarts"], answers["heavy"]["restarts"]
    assert before == (0, 0)
    os.kill(arms[0], signal.SIGKILL)
    gone = running.until(lambda line: line.get("unknown") == "starting")
    running.until(known(gone["arm"]))
    answers = get(f"{url}/arms")[1]
    assert {name: said["restarts"] for name, said in answers.items()} == {
        name: int(name == gone["arm"]) for name in ("light", "heavy")
    }
    running.process.terminate()
    assert running.process.wait(30) == 0
    assert remaining(arms) == []
    assert len(list((cell("light").parent / "state").glob("*.npz"))) == 2


@pytest.mark.full
def test_lines_that_come_seldom_delay_neither_the_endpoint_nor_alarms(serve, cell):
    running = serve(cell("heavy", port=0, every=6.0))
    url = running.url()
    said, end = [], time.monotonic() + 120.0
    while not said or not said[-1]["known"]:
        said.append(get(f"{url}/arms/heavy")[1])
        assert time.monotonic() < end
        time.sleep(0.05)
    began = time.monotonic()
    running.until(lambda line: line.get("alarm") == "over_rating")
    assert time.monotonic() - began < 3.0
    while time.monotonic() - began < 7.0:
        answer = get(f"{url}/arms/heavy")[1]
        assert answer["known"], answer["why"]
        assert answer["age"] < 1.0
        time.sleep(0.2)
    first, second = (running.until(lambda line: "age" in line)["t"] for _ in range(2))
    assert second - first > 5.5


@pytest.mark.full
def test_kill_9_of_the_service_ends_all_its_processes_and_the_next_goes_on_from_their_state(serve, cell):
    path = cell("light")
    first = serve(path)
    seen = first.until(lambda line: line.get("n_samples", 0) > 1000)
    below = children(first.process.pid)
    assert len(below) == 2
    first.process.kill()
    assert remaining(below) == []
    second = serve(path)
    again = second.until(lambda line: line.get("n_samples", 0) > 0)
    assert again["n_samples"] >= seen["n_samples"]  # nothing was forgotten
    assert any("continued from" in note for note in second.notes)


@pytest.mark.full
def test_a_second_service_writes_over_no_state_of_the_first(serve, cell, tmp_path):
    path = cell("light")
    first = serve(path)
    first.until(lambda line: line.get("n_samples", 0) > 100)
    second = serve(path)
    assert second.process.wait(120.0) == 2
    for thread in second.threads:
        thread.join()
    assert re.search(r"another process keeps .*state/light-\w+\.npz: is the same one running twice", second.notes[-1])
    assert {line["unknown"] for line in second.lines.queue} <= {"starting", "compiling"}
    first.until(lambda line: line.get("n_samples", 0) > 100)
    first.process.terminate()
    assert first.process.wait(60.0) == 0
    (state,) = (tmp_path / "state").iterdir()
    assert state.suffix == ".npz"


@pytest.mark.full
def test_kill_9_of_every_process_in_turn_is_survived(serve, cell):
    running = serve(cell("light", "heavy"))
    for name in ("light", "heavy"):
        running.until(known(name))
    for _ in range(2):
        for pid in children(running.process.pid):
            if not ended([pid]):
                continue  # a reader ends with its arm's process
            os.kill(pid, signal.SIGKILL)
            running.until(lambda line: line.get("known") is False)
            for name in ("light", "heavy"):
                running.until(known(name))
    assert running.process.poll() is None


@pytest.mark.full
def test_a_reader_that_hangs_outlives_no_service(serve, cell):
    running = serve(cell("light"))
    running.until(known("light"))
    below = children(running.process.pid)
    (reader,) = [p for p in below if b"reader_process" in Path(f"/proc/{p}/cmdline").read_bytes()]
    running.stopped.append(reader)
    os.kill(reader, signal.SIGSTOP)
    running.process.terminate()
    assert running.process.wait(60.0) == 0
    assert remaining(below, 1.0) == []


@pytest.mark.full
def test_a_process_that_hangs_is_replaced(serve, cell):
    running = serve(cell("light"))
    running.until(known("light"))
    running.stop()
    running.until(lambda line: "has said nothing" in (line["why"] or ""))
    ages = [running.until(lambda line: line.get("age") is not None)["age"] for _ in range(10)]
    assert ages == sorted(ages)
    running.until(known("light"))
    assert any("is ended" in note for note in running.notes)


@pytest.mark.full
def test_on_busy_cores_the_age_is_what_an_outsider_measures(serve, cell):
    """The log's clock is the wall's: whoever reads the lines sees from t how late they are, and age has to say so."""
    busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        running = serve(cell("light"))
        running.until(known("light"))
        late, age, stopped, since = [], [], [], np.inf
        for k in range(110):
            if k == 40:
                stopped, since = [running.stop()], time.monotonic()
            if stopped and time.monotonic() - since > 4.0:  # it counts as hung, and is replaced, after 10 s
                os.kill(stopped.pop(), signal.SIGCONT)
            line = running.until(lambda line: line.get("age") is not None)
            late.append(time.monotonic() - line["t"])
            age.append(line["age"])
        late = np.array(late) - min(late)
        assert late.max() > 2.0
        untold = late - age
        assert untold.max() < 0.25 * late.max()  # the way of a line to its reader, for which processors are busy too
    finally:
        for process in busy:
            process.kill()
        for process in busy:
            process.wait()


@pytest.mark.parametrize(
    ("stopped", "answered", "ends"), [(False, False, True), (False, True, False), (True, False, False)]
)
def test_an_error_ends_a_service_only_if_an_arm_cannot_begin(monkeypatch, stopped, answered, ends):
    settings = ServiceSettings((ArmSettings("panda", name="left", source="sim"),))
    service = Service(settings)
    process = subprocess.Popen([sys.executable, "-c", ""], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    monkeypatch.setattr(service, "_started", lambda _: process)
    monkeypatch.setattr(service, "_listen", lambda *_: "no such thing")
    service._answers["left"]["t"] = 1.0 if answered else None
    if stopped:
        service._gone.set()
    with process:
        how = service._one_life(settings.arms[0])
    service.close()
    assert (service.error is not None) == ends
    assert how == ("ended: no such thing" if answered else None)


def test_a_process_is_told_for_how_long_its_service_has_run(monkeypatch):
    settings = ServiceSettings((ArmSettings("panda", name="left", source="sim"),))
    service = Service(settings)
    service._began -= 3600.0
    echo = subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    monkeypatch.setattr(service._spare, "take", lambda: echo)
    with service._started(settings.arms[0]) as process:
        said = json.loads(process.stdout.readline())
        process.stdin.close()
    service.close()
    assert 3600.0 <= said["since"] < 3700.0


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
@pytest.mark.full  # some seconds
def test_a_full_disk_under_its_output_ends_no_service(cell, stream):
    """The endpoint, and who reads it, need neither."""
    if not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full here")
    other = {"stdout": "stderr", "stderr": "stdout"}[stream]
    command = [sys.executable, "-m", "armload", "serve", str(cell("left", port=free_port())), "--duration", "300"]
    port = int(re.search(r"port = (\d+)", Path(command[4]).read_text()).group(1))
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}  # as users have it
    with open("/dev/full", "w") as full:
        process = subprocess.Popen(command, text=True, env=buffered, **{stream: full, other: subprocess.PIPE})
        reader = threading.Thread(target=process.communicate, daemon=True)  # a pipe that fills would hold it up
        reader.start()
        try:
            known, end = 0, time.monotonic() + 120.0
            while known < 3:  # and it goes on
                assert time.monotonic() < end
                assert process.poll() is None
                time.sleep(0.5)
                with contextlib.suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/arms/left") as said:
                    known += json.load(said)["known"]
            process.send_signal(signal.SIGTERM)
            reader.join(60.0)
            assert not reader.is_alive()
            assert process.returncode in ((0,) if stream == "stdout" else (0, 120))  # 120: of Python, as it ends
        finally:
            process.kill()


@pytest.mark.full  # some seconds
def test_a_service_whose_notes_nobody_reads_goes_on(cell):
    """A terminal that is held (Ctrl-S), or a log that is collected by what hangs."""
    command = [sys.executable, "-m", "armload", "serve", str(cell("left"))]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        answers = map(json.loads, process.stdout)
        next(line for line in answers if line.get("known"))
        full = os.open(f"/proc/{process.pid}/fd/2", os.O_WRONLY | os.O_NONBLOCK)
        for size in (4096, 1):  # to the last byte
            with contextlib.suppress(BlockingIOError):
                while True:
                    os.write(full, b"x" * size)
        os.close(full)
        for pid in children(process.pid):
            os.kill(pid, signal.SIGKILL)
        # an arm is said to be lost, and is answered again all the same
        assert any(line.get("restarts") == 1 and line["known"] for line in answers)
        process.send_signal(signal.SIGTERM)
        for _ in answers:
            pass
        assert process.wait(60.0) == 0
    finally:
        process.kill()
        process.communicate()


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


@pytest.mark.full  # some seconds
def test_what_a_killed_save_has_left_is_gone_once_the_next_service_answers(serve, cell, tmp_path):
    path = cell("left")
    first = serve(path)
    first.until(lambda line: line.get("known"))
    first.process.send_signal(signal.SIGTERM)
    first.process.wait(60.0)
    (state,) = (tmp_path / "state").iterdir()
    left = subprocess.Popen([sys.executable, "-c", KILLED, str(state)], stdout=subprocess.PIPE)
    assert left.communicate()[0] == b"half"
    assert len(list((tmp_path / "state").iterdir())) == 2
    serve(path).until(lambda line: line.get("known"))
    lock = state.with_name(f".{state.name}.lock")  # of the process that keeps it now
    assert {*(tmp_path / "state").iterdir()} == {state, lock}

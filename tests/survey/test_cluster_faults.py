"""A Dask cluster whose worker or scheduler is killed: nothing lost, nothing doubled, the same rows in the end."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from armload.motion import random_motion
from armload.recording import write_recording
from armload.simulation import simulate_inverse

pytestmark = pytest.mark.full
pytest.importorskip("distributed")

LOGS = 6  # and one more, behind a web server that holds it back until it is told
LIMIT = 240.0  # [s] for whatever is waited for: many times what it takes
ARMLOAD = [sys.executable, "-c", "from armload.app import main; raise SystemExit(main())"]


@pytest.fixture(scope="module")
def logs(panda, tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs") / "arm"
    folder.mkdir()
    for k in range(LOGS):
        log = simulate_inverse(panda, random_motion(panda, k, duration=6.0), rate=200.0, seed=k)
        write_recording(folder / f"{k}.csv", log)
    return folder


class Held(SimpleHTTPRequestHandler):
    """Says at once what there is, and gives it when `gate` is open: until then, a survey cannot end."""

    gate = threading.Event()

    def do_GET(self):
        self.gate.wait(LIMIT)
        with contextlib.suppress(ConnectionError):  # whoever asked was killed
            super().do_GET()

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module", autouse=True)
def held(logs):
    """The address of a log that comes when the gate is open."""
    pytest.importorskip("aiohttp")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Held, directory=str(logs)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/0.csv"
    finally:
        Held.gate.set()
        server.shutdown()
        server.server_close()
        thread.join(LIMIT)


def words(logs, held, out, *more):
    return [
        *ARMLOAD,
        "survey",
        str(logs),
        held,
        "--arm-of",
        "(csv)",
        "--robot",
        "panda",
        "--method",
        "map",
        "--out",
        str(out),
        *more,
    ]


@pytest.fixture(scope="module")
def whole(logs, held, tmp_path_factory):
    """The bytes of a survey that nothing happened to."""
    out = tmp_path_factory.mktemp("whole") / "survey.json"
    Held.gate.set()
    subprocess.run(words(logs, held, out, "--jobs", "1"), check=True, capture_output=True, timeout=LIMIT)
    return out.read_bytes()


class Cluster:
    """A scheduler and its workers, each a process; `kept` ends them all."""

    def __init__(self, kept, folder):
        self._kept, self._file, self._log = kept, folder / "scheduler.json", (folder / "cluster.log").open("w")
        kept.callback(self._log.close)
        self.scheduler = self._start("dask_scheduler", "--port", "0", "--no-dashboard", "--no-show")
        address = until(lambda: self._file.exists() and self._file.read_text())
        self.address = json.loads(address)["address"]
        self.workers = [self._start("dask_worker", "--nthreads", "1", "--no-nanny", "--no-dashboard") for _ in range(2)]

    def _start(self, program, *options):
        command = [sys.executable, "-m", f"distributed.cli.{program}", "--scheduler-file", str(self._file), *options]
        process = subprocess.Popen(command, stdout=self._log, stderr=self._log, cwd=self._file.parent)
        self._kept.callback(end, process)
        return process


def end(process):
    process.kill()
    process.wait(LIMIT)


def until(asked):
    """What `asked` says as soon as it says something."""
    last = time.monotonic() + LIMIT
    while time.monotonic() < last:
        if found := asked():
            return found
        time.sleep(0.02)
    raise AssertionError(f"nothing came in {LIMIT} s")


@pytest.fixture
def cluster(tmp_path):
    with contextlib.ExitStack() as kept:
        yield Cluster(kept, tmp_path)


def begun(logs, held, out, cluster):
    """A survey on the cluster that has answered two logs, and cannot answer all."""
    Held.gate.clear()
    process = subprocess.Popen(
        words(logs, held, out, "--cluster", cluster.address), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        until(lambda: process.poll() is not None or len(cells(out)) >= 2)
        assert process.poll() is None, process.stderr.read()
    except BaseException:
        end(process)
        raise
    return process


def cells(out):
    """Of finished logs; what a kill leaves of a file begins with a dot."""
    return list(out.with_name(f"{out.name}.cells").glob("[!.]*.json"))


def finished(process):
    try:
        out, err = process.communicate(timeout=LIMIT)
    finally:
        end(process)
    return process.returncode, out, err


def test_a_worker_that_is_killed_costs_its_task_only(logs, held, whole, cluster, tmp_path):
    out = tmp_path / "survey.json"
    process = begun(logs, held, out, cluster)
    os.kill(cluster.workers[0].pid, signal.SIGKILL)
    Held.gate.set()
    code, _, err = finished(process)
    assert code == 0, err
    assert out.read_bytes() == whole
    assert len(cells(out)) == LOGS + 1


def test_a_survey_whose_scheduler_is_killed_says_so_and_goes_on_from_there(logs, held, whole, cluster, tmp_path):
    out = tmp_path / "survey.json"
    process = begun(logs, held, out, cluster)
    os.kill(cluster.scheduler.pid, signal.SIGKILL)
    code, said, err = finished(process)
    assert (code, said) == (2, "")
    assert "the cluster is gone" in err.splitlines()[-1]
    assert not out.exists()
    for worker in cluster.workers:
        end(worker)
    Held.gate.set()
    kept = {path.name: path.stat().st_mtime_ns for path in cells(out)}
    assert 2 <= len(kept) < LOGS + 1
    subprocess.run(words(logs, held, out, "--jobs", "1"), check=True, capture_output=True, timeout=LIMIT)
    assert out.read_bytes() == whole
    assert {path.name: path.stat().st_mtime_ns for path in cells(out) if path.name in kept} == kept
    assert len(cells(out)) == LOGS + 1

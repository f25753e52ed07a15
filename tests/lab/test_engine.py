"""A cluster that has no workers is waited for, and not for ever; processes leave Ctrl-C to whoever began them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from joblib.externals.loky import get_reusable_executor

from armload.errors import ClusterError
from armload.lab.engine import Engine, engine

distributed = pytest.importorskip("distributed")


@pytest.fixture
def cluster():
    with distributed.LocalCluster(n_workers=0, processes=False, dashboard_address="127.0.0.1:0") as made:
        yield made


def double(x):
    return 2 * x


def test_a_cluster_that_gets_no_worker_is_given_up_with_what_to_do(cluster):
    with (
        distributed.Client(cluster) as client,
        pytest.raises(ClusterError, match=r"no worker for 0\.01 minutes: start one"),
    ):
        list(Engine(1, client, patience=0.6).each(double, lambda: [1, 2]))


def test_a_worker_that_comes_late_does_all_tasks(cluster):
    with distributed.Client(cluster) as client:
        late = threading.Timer(0.5, cluster.scale, [1])
        late.start()
        found = list(Engine(1, client, patience=120.0).each(double, lambda: range(5)))
        late.join()
    assert sorted(found) == [(k, 2 * k) for k in range(5)]


def hears_ctrl_c(_):
    """This process, and whether it hears Ctrl-C."""
    return os.getpid(), signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


@pytest.mark.parametrize("name", [None, pytest.param("local", marks=pytest.mark.full)])
def test_processes_leave_ctrl_c_to_the_one_that_began_them_and_end_before_it(name):
    with engine(2, name) as on:
        found = dict(there for _, there in on.each(hears_ctrl_c, lambda: range(6)))
        assert hears_ctrl_c(0) == (os.getpid(), True)
    assert set(found.values()) == {False}
    for process in found:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_processes_end_without_a_word_where_a_task_was_given_out_just_before(monkeypatch):
    """The thread of joblib's pool looks for it among those that were cancelled meanwhile."""
    said: list[object] = []
    monkeypatch.setattr(threading, "excepthook", said.append)
    for _ in range(8):  # without the mend every third ends so
        with engine(2):
            pool = get_reusable_executor(max_workers=2)
            pool.submit(time.sleep, 60.0)
            time.sleep(0.3)  # until that is taken, and the thread waits
            pool.submit(time.sleep, 60.0)
    assert said == []


SLEEPY = """
import sys, time
from armload.app.cli import entry
from armload.lab.engine import engine

def run(_):
    with engine(2) as on:
        def items():
            print("begun", flush=True)
            yield from [60.0, 60.0]
        list(on.each(time.sleep, items))

entry._run = run
sys.exit(entry.main([]))
"""


@pytest.mark.parametrize("seconds", [0.05, 0.3, 0.6])
def test_ctrl_c_while_processes_begin_is_one_line(seconds):
    words = ["env", "--default-signal=INT", sys.executable, "-c", SLEEPY]  # a background job's children ignore it
    command = subprocess.Popen(words, stdout=-1, stderr=-1, text=True, start_new_session=True)
    assert command.stdout is not None
    command.stdout.readline()
    time.sleep(seconds)
    os.killpg(command.pid, signal.SIGINT)  # as a terminal does
    assert command.communicate(timeout=60.0) == ("", "armload: interrupted\n")
    assert command.returncode == 130

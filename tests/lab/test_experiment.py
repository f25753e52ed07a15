"""The runner of all experiments: nothing is measured twice or lost once finished, and processes change no number."""

import json
import os
import select
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from armload.errors import DatasetError, UsageError
from armload.lab.cells import key_of, load_cells
from armload.lab.experiment import Task, provenance, run_tasks, source_key, write_json


def square(folder, x):
    """Counts its calls in a file: it may run in another process."""
    with (folder / "calls.txt").open("a", encoding="utf-8") as file:
        file.write(f"{x}\n")
    return {"square": x * x}


def powers(names, folder, x):
    """One number for each name; the third power cannot be had."""
    for name in names:
        if name.endswith("-3"):
            raise ArithmeticError(name)
        yield square(folder, x)


def tasks(folder, count, version=0):
    return [Task.of_one(f"of-{x}", key_of(x, version), square, folder, x) for x in range(count)]


def calls(folder):
    file = folder / "calls.txt"
    return file.read_text(encoding="utf-8").split() if file.exists() else []


def test_what_is_finished_is_not_measured_again_and_another_key_is(tmp_path):
    first = run_tasks(tasks(tmp_path, 2), tmp_path / "cells")
    assert run_tasks(tasks(tmp_path, 3), tmp_path / "cells") == first | {
        "of-2": {"name": "of-2", "key": key_of(2, 0), "square": 4}
    }
    assert calls(tmp_path) == ["0", "1", "2"]
    again = run_tasks(tasks(tmp_path, 2, version=1), tmp_path / "cells")
    assert calls(tmp_path) == ["0", "1", "2", "0", "1"]
    assert [cell["key"] for cell in again.values()] == [key_of(0, 1), key_of(1, 1)]


def test_a_cell_of_another_key_is_not_among_the_finished_ones(tmp_path):
    run_tasks(tasks(tmp_path, 2), tmp_path / "cells")
    assert run_tasks(tasks(tmp_path, 2, version=1), tmp_path / "cells", until=-1.0) == {}


def test_a_task_that_fails_keeps_the_cells_it_had_finished(tmp_path):
    task = Task("powers", {"x-2": "a", "x-3": "b", "x-4": "c"}, powers, (tmp_path, 5), "power")
    with pytest.raises(ArithmeticError):
        run_tasks([task], tmp_path / "cells")
    assert list(load_cells(tmp_path / "cells")) == ["x-2"]
    messages = []
    with pytest.raises(ArithmeticError):
        run_tasks([task], tmp_path / "cells", say=messages.append)
    assert messages == ["part 1 of 1: powers, 2 powers"]
    assert calls(tmp_path) == ["5"]


def test_processes_give_the_cells_of_one_process_in_the_order_of_the_tasks(tmp_path):
    one, two = (run_tasks(tasks(tmp_path, 6), tmp_path / f"{jobs}", jobs=jobs) for jobs in (1, 2))
    assert list(one.items()) == list(two.items())
    for file in (tmp_path / "1").iterdir():
        assert file.read_bytes() == (tmp_path / "2" / file.name).read_bytes()


def test_a_run_that_is_out_of_time_says_where_it_stopped(tmp_path):
    run_tasks(tasks(tmp_path, 1), tmp_path / "cells")
    messages = []
    cells = run_tasks(tasks(tmp_path, 3), tmp_path / "cells", until=-1.0, say=messages.append, part="cell")
    assert messages == ["stopped before cell 2 of 3: run it again to go on"]
    assert list(cells) == ["of-0"]
    assert list(run_tasks(tasks(tmp_path, 3), tmp_path / "cells", until=3600.0)) == ["of-0", "of-1", "of-2"]


class Looked(dict):
    """A task's keys, which count how often all of them are looked at."""

    count = 0

    def __iter__(self):
        Looked.count += 1
        return super().__iter__()


def test_progress_counts_the_finished_tasks_and_looks_at_each_as_often_however_many_there_are(tmp_path, monkeypatch):
    looked = []
    for count in (4, 16):
        monkeypatch.setattr(Looked, "count", 0)
        some = [replace(task, keys=Looked(task.keys)) for task in tasks(tmp_path, count)]
        some.insert(1, Task("powers", {"x-2": "a", "x-4": "b"}, powers, (tmp_path, 5)))
        run_tasks(some[:2], tmp_path / f"{count}")
        shown = []
        run_tasks(some, tmp_path / f"{count}", progress=lambda done, total, shown=shown: shown.append((done, total)))
        assert shown == [(done, count + 1) for done in range(3, count + 2)]
        looked.append(Looked.count / count)
    assert looked[1] <= looked[0]


def test_a_result_that_is_no_json_leaves_the_old_file_alone(tmp_path):
    path = write_json(tmp_path / "new" / "r.json", {"a": 1})
    with pytest.raises(ValueError, match="nan"):
        write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text(encoding="utf-8")) == {"a": 1}


def test_the_key_of_source_follows_its_text_and_the_names_of_its_files(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\n")
    keys = [source_key(tmp_path), source_key(tmp_path / "a.py")]
    (tmp_path / "a.py").rename(tmp_path / "b.py")
    keys.append(source_key(tmp_path))
    (tmp_path / "b.py").write_text("x = 2\n")
    keys.append(source_key(tmp_path))
    assert keys[0] == keys[1]
    assert len(set(keys)) == 3


def test_a_result_says_the_command_and_the_versions_it_rests_on():
    content = provenance("python benchmarks/x.py --seeds 3")
    assert content["command"] == "python benchmarks/x.py --seeds 3"
    assert {"python", "numpy", "pin", "mujoco"} <= set(content["versions"])


def killed_at_first(folder, x, always=False):
    """Kills its own process: once, or each time."""
    file = folder / f"killed-{x}"
    if always or not file.exists():
        file.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"square": x * x}


def test_a_process_that_is_killed_costs_its_task_only(tmp_path):
    wanted = [Task.of_one("of-0", "a", killed_at_first, tmp_path, 0), *tasks(tmp_path, 3)[1:]]
    found = run_tasks(wanted, tmp_path / "cells", jobs=2)
    assert [cell["square"] for cell in found.values()] == [0, 1, 4]


@pytest.mark.full
def test_a_task_whose_process_is_killed_each_time_is_said_to_be_lost(tmp_path):
    wanted = [Task.of_one("of-0", "a", killed_at_first, tmp_path, 0, True), *tasks(tmp_path, 3)[1:]]
    found = run_tasks(
        wanted, tmp_path / "cells", jobs=2, lost=lambda task: {name: {"lost": True} for name in task.keys}
    )
    assert found["of-0"] == {"name": "of-0", "key": "a", "lost": True}
    assert [found[f"of-{x}"]["square"] for x in (1, 2)] == [1, 4]
    others = Task.of_one("of-9", "b", killed_at_first, tmp_path, 9, True)
    with pytest.raises(DatasetError, match="was killed 3 times"):
        run_tasks([wanted[0], others], tmp_path / "x", jobs=2)


SPREAD = """
import os, sys, time
from armload.lab.engine import Engine

def work(x):
    print(os.getpid(), flush=True)
    time.sleep(60.0)

list(Engine(2).each(work, lambda: range(2)))
"""


def running(pid):
    """Whether a process is there, and has not ended with nobody asking for it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_processes_end_with_the_one_that_began_them(tmp_path):
    (tmp_path / "spread.py").write_text(SPREAD, encoding="utf-8")
    with subprocess.Popen([sys.executable, "spread.py"], cwd=tmp_path, stdout=subprocess.PIPE, text=True) as begun:
        others = [int(begun.stdout.readline()) for _ in range(2)]
        assert all(map(running, others))
        begun.kill()
        begun.stdout.close()
    until = time.monotonic() + 30.0
    while any(map(running, others)) and time.monotonic() < until:
        time.sleep(0.1)
    assert not any(map(running, others))


def test_nor_does_a_process_stay_that_has_never_had_a_task(tmp_path):
    (tmp_path / "spread.py").write_text(SPREAD.replace("range(2)", "range(1)"), encoding="utf-8")
    with subprocess.Popen([sys.executable, "spread.py"], cwd=tmp_path, stdout=subprocess.PIPE) as begun:
        begun.stdout.readline()
        begun.kill()
        # whoever holds its output is one of its processes
        assert select.select([begun.stdout], [], [], 30.0)[0]
        assert begun.stdout.read() == b""


def test_what_a_kill_leaves_of_a_file_is_no_cell(tmp_path):
    run_tasks(tasks(tmp_path, 1), tmp_path / "cells")
    (tmp_path / "cells" / ".of-1.json.a1b2.json").write_text('{"name": "of-')
    assert list(load_cells(tmp_path / "cells")) == ["of-0"]


def test_a_damaged_cell_is_said_to_be_one_and_measured_again(tmp_path):
    first = run_tasks(tasks(tmp_path, 2), tmp_path / "cells")
    (tmp_path / "cells" / "of-1.json").write_text('{"name": "of-')
    messages = []
    assert run_tasks(tasks(tmp_path, 2), tmp_path / "cells", say=messages.append) == first
    assert messages[0] == (f"1 file is no whole cell ({tmp_path}/cells/of-1.json): what is missing is measured again")
    assert calls(tmp_path) == ["0", "1", "1"]
    assert list(load_cells(tmp_path / "cells")) == ["of-0", "of-1"]


@pytest.mark.full
def test_dask_workers_give_the_cells_of_one_process_and_a_lost_one_costs_its_task_only(tmp_path):
    pytest.importorskip("distributed")
    one = run_tasks(tasks(tmp_path, 6), tmp_path / "1")
    assert list(run_tasks(tasks(tmp_path, 6), tmp_path / "2", jobs=2, cluster="local").items()) == list(one.items())
    for file in (tmp_path / "1").iterdir():
        assert file.read_bytes() == (tmp_path / "2" / file.name).read_bytes()
    wanted = [Task.of_one("of-0", "a", killed_at_first, tmp_path, 0), *tasks(tmp_path, 3)[1:]]
    found = run_tasks(wanted, tmp_path / "3", jobs=2, cluster="local")
    assert [cell["square"] for cell in found.values()] == [0, 1, 4]


@pytest.mark.parametrize("where", ["8786", "http://x", "tcp://x"])
def test_a_cluster_is_local_or_an_address(tmp_path, where):
    with pytest.raises(UsageError, match="expected local, or the address"):
        run_tasks(tasks(tmp_path, 1), tmp_path / "cells", cluster=where)

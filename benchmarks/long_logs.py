"""What a survey of one log takes in memory, against the length of the log.

    python benchmarks/long_logs.py [--kinds mcap,parquet,…] [--seconds 10,60,600,3600] [--rate 1000] [--out FOLDER]

kinds: mcap, db3 (ROS 2 bags), bag (ROS 1), parquet, hdf5, npz, csv. An empty Panda on an endless motion
(`simulate_inverse`, a minute of it again and again, with noise of its own in each), without a tare. The peak is of all
that one process touches (`ru_maxrss`), start-up included; the slope is that of a line through a kind's logs of a minute
and more. What was measured is kept in FOLDER/cells: a later call with the same code and rate goes on, with other kinds
and lengths, too. Printed, and all of it written to benchmarks/results/long_logs.json and a table of docs/survey.md.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from script import ROOT, markdown_table, options, say, write, write_table

from armload import Recording, arm
from armload.lab.cells import key_of, load_cells
from armload.lab.experiment import Task, run_tasks, source_key
from armload.motion import FourierMotion, random_motion
from armload.simulation import Sensors, simulate_inverse

MINUTE = 60.0  # [s] of motion that is repeated
ARRAYS = ("t", "q", "dq", "tau")
# a process's largest memory counts that of whoever began it, too: so a small one begins it
LAUNCHER = """
import os, subprocess, sys
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
_, status, used = os.wait4(process.pid, 0)
print(used.ru_maxrss, used.ru_utime + used.ru_stime)
sys.exit(status != 0)
"""
Parts = Callable[[], Iterable[Recording]]  # a log, a minute or less at a time, from its beginning on


@cache
def one_minute(rate: float) -> Recording:
    """What is repeated."""
    panda = arm("panda")
    motion: FourierMotion = random_motion(panda, 7, duration=MINUTE)
    return simulate_inverse(panda, motion, sensors=Sensors.panda(panda).evenly(), rate=rate, duration=MINUTE, seed=1)


def minutes(rate: float, seconds: float) -> Iterator[Recording]:
    """The log, a minute or less at a time."""
    base = one_minute(rate)
    steps, rng = round(MINUTE * rate), np.random.default_rng(3)
    for k in range(int(np.ceil(seconds / MINUTE))):
        rows = slice(0, min(steps, round((seconds - k * MINUTE) * rate)))
        one = base.select(rows)
        tau = one.tau + 0.01 * rng.normal(size=one.tau.shape)
        yield replace(one, t=(k * steps + np.arange(len(one))) / rate, tau=tau)


def tables(parts: Iterable[Recording]) -> Iterator[Any]:
    """Arrow tables with columns of armload's own names, one for each minute."""
    import pyarrow as pa

    from armload.recording.columns import column_names

    for part in parts:
        columns = np.hstack([part.t[:, None], part.q, part.dq, part.tau]).T
        yield pa.table(dict(zip(column_names(part.n), map(pa.array, columns), strict=True)))


def write_parquet(path: Path, parts: Parts) -> None:
    """A row group for each minute."""
    from pyarrow import parquet

    first = next(tables(parts()))
    with parquet.ParquetWriter(path, first.schema) as writer:
        for table in tables(parts()):
            writer.write_table(table)


def write_csv(path: Path, parts: Parts) -> None:
    """A line for each sample."""
    from pyarrow import csv

    first = next(tables(parts()))
    with csv.CSVWriter(path, first.schema) as writer:
        for table in tables(parts()):
            writer.write_table(table)


def write_hdf5(path: Path, parts: Parts) -> None:
    """Arrays t, q, dq, tau that grow."""
    import h5py

    with h5py.File(path, "w") as file:
        for part in parts():
            for name in ARRAYS:
                values = getattr(part, name)
                data: Any = file.get(name) or file.create_dataset(
                    name, (0, *values.shape[1:]), float, maxshape=(None, *values.shape[1:])
                )
                data.resize(len(data) + len(values), axis=0)
                data[-len(values) :] = values


def write_npz(path: Path, parts: Parts) -> None:
    """Packed arrays t, q, dq, tau, one after the other."""
    rows, n = sum(len(part) for part in parts()), next(iter(parts())).n
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in ARRAYS:
            shape = (rows,) if name == "t" else (rows, n)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                about = {"descr": "<f8", "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(member, about)
                for part in parts():
                    member.write(np.ascontiguousarray(getattr(part, name), "<f8").tobytes())


def write_bag(path: Path, parts: Parts) -> None:
    """A bag of JointState messages: of ROS 1 (.bag), or of ROS 2 (a folder; MCAP or sqlite3 by its suffix)."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    kind, one = "sensor_msgs/msg/JointState", path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if one else Stores.ROS2_HUMBLE)
    state, header, time = (store.types[x] for x in (kind, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
    plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
    names, raw = list(arm("panda").joint_names), store.serialize_ros1 if one else store.serialize_cdr
    with Writer1(path) if one else Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/joint_states", kind, typestore=store)
        for k, sample in enumerate(sample for part in parts() for sample in part):
            now = 1_790_000_000_000_000_000 + round(sample.t * 1e9)
            stamp = time(now // 10**9, now % 10**9)
            about = header(k, stamp, "base") if one else header(stamp, "base")
            writer.write(connection, now, raw(state(about, names, *sample[1:]), kind))


KINDS: dict[str, Callable[[Path, Parts], None]] = {
    **dict.fromkeys(("mcap", "db3", "bag"), write_bag),
    "parquet": write_parquet,
    "hdf5": write_hdf5,
    "npz": write_npz,
    "csv": write_csv,
}


def surveyed(path: Path, folder: Path) -> tuple[float, float]:
    """Peak memory [MB] and CPU time [s] of the survey of one log."""
    table = folder / "table.json"
    shutil.rmtree(table.with_name(f"{table.name}.cells"), ignore_errors=True)
    words = [sys.executable, "-m", "armload", "survey", str(path), "--robot", "panda", "--jobs", "1"]
    began = [sys.executable, "-I", "-S", "-c", LAUNCHER, *words, "--out", str(table)]
    done = subprocess.run(began, capture_output=True, text=True)
    assert done.returncode == 0, f"the survey of {path} failed"
    peak, cpu = map(float, done.stdout.split()[-2:])
    assert '"answered"' in table.read_text(encoding="utf-8"), table.read_text(encoding="utf-8")[:2000]
    return peak / 1e3, cpu


def measured(kind: str, seconds: float, rate: float, folder: Path) -> dict[str, Any]:
    """Write a log, survey it, and remove it."""
    path = folder / f"{seconds:g}.{kind}"
    for old in folder.glob("*.*"):
        if old.suffix.removeprefix(".") in KINDS:  # of a call that was stopped
            shutil.rmtree(old) if old.is_dir() else old.unlink()
    KINDS[kind](path, lambda: minutes(rate, seconds))
    size = sum(f.stat().st_size for f in ([path] if path.is_file() else path.iterdir())) / 1e6
    peak, cpu = surveyed(path, folder)
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    return {"kind": kind, "log [s]": seconds, "file [MB]": size, "peak [MB]": peak, "cpu [s]": cpu}


def main() -> None:
    asked = options(__doc__, kinds="mcap,parquet", seconds="10,60,600,3600", rate=1000.0, out="out/long-logs")
    folder = Path(asked.out)
    folder.mkdir(parents=True, exist_ok=True)
    code = key_of(source_key(), source_key(__file__))

    def key(kind: str, seconds: float) -> str:
        return key_of(code, kind, seconds, asked.rate)

    tasks = [
        Task.of_one(f"{kind}-{seconds:g}", key(kind, seconds), measured, kind, seconds, asked.rate, folder)
        for kind in asked.kinds.split(",")
        for seconds in map(float, asked.seconds.split(","))
    ]
    run_tasks(tasks, folder / "cells", say=say)
    cells = [c for c in load_cells(folder / "cells", []).values() if c["key"] == key(c["kind"], c["log [s]"])]
    found = [{name: x for name, x in cell.items() if name not in ("name", "key")} for cell in cells]
    found.sort(key=lambda one: (list(KINDS).index(one["kind"]), one["log [s]"]))
    slopes = {}
    for kind in dict.fromkeys(one["kind"] for one in found):
        of = [(one["log [s]"], one["peak [MB]"]) for one in found if one["kind"] == kind and one["log [s]"] >= 60.0]
        t, peak = np.array(of).reshape(-1, 2).T
        slopes[kind] = float(np.polyfit(t, peak, 1)[0]) if len(of) > 1 else None
    say(f"slopes [MB/s]: {slopes}")
    heads = ["log", "seconds", "file [MB]", "peak memory [MB]", "CPU [s]"]
    rows = [[str(x) if isinstance(x, str) else f"{x:.0f}" for x in one.values()] for one in found]
    write_table(ROOT / "docs" / "survey.md", "long", markdown_table(heads, "lrrrr", rows))
    write("long_logs", {"rate [Hz]": asked.rate, "logs": found, "slope [MB/s]": slopes})


if __name__ == "__main__":
    main()

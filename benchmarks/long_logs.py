"""What a survey of one log takes in memory, against the length of the log.

    python benchmarks/long_logs.py [--kinds mcap,parquet] [--seconds 10,60,600,3600] [--rate 1000] [--out out/long-logs]

An empty Panda on an endless motion (`simulate_inverse`, a minute of it again and again, with noise of its own in each),
without a tare. The peak is of all that one process touches (`ru_maxrss`), start-up included; the slope is that of a
line through the logs of a minute and more. Printed, and written to benchmarks/results/long_logs.json and a table of
docs/survey.md.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from script import ROOT, markdown_table, options, say, write, write_table

from armload import arm
from armload.motion import FourierMotion, random_motion
from armload.simulation import Sensors, simulate_inverse

MINUTE = 60.0  # [s] of motion that is repeated


def minutes(rate: float, seconds: float) -> Any:
    """The log, a minute or less at a time."""
    panda = arm("panda")
    motion: FourierMotion = random_motion(panda, 7, duration=MINUTE)
    base = simulate_inverse(panda, motion, sensors=Sensors.panda(panda).evenly(), rate=rate, duration=MINUTE, seed=1)
    steps, rng = round(MINUTE * rate), np.random.default_rng(3)
    for k in range(int(np.ceil(seconds / MINUTE))):
        rows = slice(0, min(steps, round((seconds - k * MINUTE) * rate)))
        one = base.select(rows)
        tau = one.tau + 0.01 * rng.normal(size=one.tau.shape)
        yield replace(one, t=(k * steps + np.arange(len(one))) / rate, tau=tau)


def write_parquet(path: Path, parts: Any) -> None:
    """A row group for each minute."""
    import pyarrow as pa
    from pyarrow import parquet

    from armload.recording.columns import column_names

    writer = None
    for part in parts:
        columns = np.hstack([part.t[:, None], part.q, part.dq, part.tau]).T
        table = pa.table(dict(zip(column_names(part.n), map(pa.array, columns), strict=True)))
        writer = writer or parquet.ParquetWriter(path, table.schema)
        writer.write_table(table)
    assert writer is not None
    writer.close()


def write_mcap(path: Path, parts: Any) -> None:
    """A ROS 2 bag of JointState messages."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    kind, store = "sensor_msgs/msg/JointState", get_typestore(Stores.ROS2_HUMBLE)
    state, header, time = (store.types[x] for x in (kind, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
    names = list(arm("panda").joint_names)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/joint_states", kind, typestore=store)
        for part in parts:
            for sample in part:
                now = 1_790_000_000_000_000_000 + round(sample.t * 1e9)
                message = state(header(time(now // 10**9, now % 10**9), "base"), names, *sample[1:])
                writer.write(connection, now, store.serialize_cdr(message, kind))


def surveyed(path: Path, folder: Path) -> tuple[float, float]:
    """Peak memory [MB] and CPU time [s] of the survey of one log."""
    table = folder / "table.json"
    shutil.rmtree(table.with_name(f"{table.name}.cells"), ignore_errors=True)
    words = [sys.executable, "-m", "armload", "survey", str(path), "--robot", "panda", "--jobs", "1"]
    process = subprocess.Popen([*words, "--out", str(table)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    assert status == 0, f"the survey of {path} failed"
    assert '"answered"' in table.read_text(encoding="utf-8"), table.read_text(encoding="utf-8")[:2000]
    return used.ru_maxrss / 1e3, used.ru_utime + used.ru_stime


def main() -> None:
    asked = options(__doc__, kinds="mcap,parquet", seconds="10,60,600,3600", rate=1000.0, out="out/long-logs")
    folder = Path(asked.out)
    folder.mkdir(parents=True, exist_ok=True)
    found: list[dict[str, Any]] = []
    for kind in asked.kinds.split(","):
        for seconds in map(float, asked.seconds.split(",")):
            path = folder / (f"{seconds:g}.parquet" if kind == "parquet" else f"{seconds:g}")
            shutil.rmtree(path, ignore_errors=True)
            parts = minutes(asked.rate, seconds)
            (write_parquet if kind == "parquet" else write_mcap)(path, parts)
            size = sum(f.stat().st_size for f in ([path] if path.is_file() else path.iterdir())) / 1e6
            peak, cpu = surveyed(path, folder)
            found.append({"kind": kind, "log [s]": seconds, "file [MB]": size, "peak [MB]": peak, "cpu [s]": cpu})
            say(str(found[-1]))
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    slopes = {}
    for kind in asked.kinds.split(","):
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

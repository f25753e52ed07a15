"""How soon is an arm's answer there again after its process was killed?

    python benchmarks/recovery.py [--kills 7]

`armload serve` runs with one arm, a log of a Panda replayed at 200 samples per second in a circle, in its default
method; its state was saved before. Its process is killed (SIGKILL) again and again, with a spare process and without.
Counted is, from the kill on: wall time to the first line with an answer of new samples, and to the first that is known;
the processor time that the process that took over and its reader had spent by then, beyond what they had spent
before the kill; and the load of the machine. A machine with other work shows in the wall time alone.
Writes benchmarks/results/recovery.json.
"""

import argparse
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from armload.arms import arm
from armload.devices import Simulator
from armload.payloads import test_payload
from armload.recording import Recording, write_recording
from armload.runtime.atomic import replacing
from armload.simulation import Sensors, World

RESULT = Path(__file__).parent / "results" / "recovery.json"
PATIENCE = 120.0  # [s] for any line
TICKS = os.sysconf("SC_CLK_TCK")


def log(path):
    panda = arm("panda")
    world, sensors = World.real_like(panda, seed=1), Sensors.of(panda)
    held = [(0.0, test_payload())]
    with Simulator(panda, payloads=held, world=world, sensors=sensors, rate=200.0, speed=None, duration=20.0) as source:
        t, q, dq, tau = (np.array(column) for column in zip(*source, strict=True))
    write_recording(path, Recording(t, q, dq, tau))


def below(pid):
    """A process and all it has started."""
    tasks = Path(f"/proc/{pid}/task")
    try:
        children = [int(c) for task in tasks.iterdir() for c in (task / "children").read_text().split()]
    except OSError:
        return []
    return [pid] + [deeper for child in children for deeper in below(child)]


def spent(pids):
    """Processor time of each [s]."""
    times = {}
    for pid in pids:
        try:
            fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        times[pid] = (int(fields[11]) + int(fields[12])) / TICKS
    return times


def memory(pid):
    """[MB], what several processes share counted in parts."""
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return next(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:")) / 1e3


def arm_processes(pid):
    return [p for p in below(pid)[1:] if b"arm_process" in Path(f"/proc/{p}/cmdline").read_bytes()]


class Serving:
    """`armload serve` and its lines."""

    def __init__(self, cell):
        command = [sys.executable, "-m", "armload", "serve", str(cell)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.lines = queue.Queue()
        threading.Thread(target=self._hear, daemon=True).start()

    def _hear(self):
        for line in self.process.stdout:
            said = json.loads(line)
            if "alarm" not in said:
                self.lines.put(said)

    def until(self, condition):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            line = self.lines.get(timeout=PATIENCE)
            if condition(line):
                return line
        raise TimeoutError

    def end(self):
        self.process.terminate()
        try:
            self.process.wait(20.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def _streams_after(restarts):
    return lambda line: line["restarts"] > restarts and line["unknown"] != "starting"


def measure(folder, kills, spare):
    cell = folder / "cell.toml"
    cell.write_text(
        f'spare = {json.dumps(spare)}\n[[arm]]\nname = "arm"\nsource = "run.csv"\nrobot = "panda"\n'
        f'loop = true\nsave = "state-{spare}"\n'
    )
    rows = []
    first = Serving(cell)
    try:
        first.until(lambda line: line["known"])
        time.sleep(5.0)
    finally:
        first.end()  # the state is saved
    serving = Serving(cell)
    try:
        for _ in range(kills):
            serving.until(lambda line: line["known"])
            time.sleep(8.0)  # a spare process gets ready
            earlier = spent(below(serving.process.pid))
            time.sleep(2.0)
            while not serving.lines.empty():
                said = serving.lines.get()
            family = below(serving.process.pid)
            before, processes = spent(family), arm_processes(serving.process.pid)
            working = max(processes, key=lambda p: before.get(p, 0.0) - earlier.get(p, 0.0))
            shares = {pid == working: memory(pid) for pid in processes}
            began = time.monotonic()
            os.kill(working, signal.SIGKILL)
            answered = serving.until(_streams_after(said["restarts"]))
            to_answer = time.monotonic() - began
            known = answered if answered["known"] else serving.until(lambda line: line["known"])
            to_known = time.monotonic() - began
            after = spent(below(serving.process.pid))
            took_over = [p for p in arm_processes(serving.process.pid) if p != working]
            now = next((p for p in took_over if p in before), took_over[0])
            rows.append(
                {
                    "to an answer [s]": round(to_answer, 3),
                    "to a known answer [s]": round(to_known, 3),
                    "processor time until it is known [s]": round(
                        sum(t - before.get(p, 0.0) for p, t in after.items() if p in below(now)), 3
                    ),
                    "mass [kg]": round(known["mass"], 3),
                    "load": round(os.getloadavg()[0], 1),
                    "PSS of arm's and spare process [MB]": [
                        None if key not in shares else round(shares[key]) for key in (True, False)
                    ],
                }
            )
            print(spare, rows[-1], flush=True)
    finally:
        serving.end()
    return rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--kills", type=int, default=7)
    parser.add_argument("--out", type=Path, default=RESULT)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        log(Path(folder) / "run.csv")
        rows = {str(spare): measure(Path(folder), options.kills, spare) for spare in (True, False)}
    result = {"with a spare process": rows["True"], "without": rows["False"]}
    for name, kills in list(result.items()):
        for key in ("to an answer [s]", "to a known answer [s]", "processor time until it is known [s]"):
            result[f"median {key}, {name}"] = float(np.median([row[key] for row in kills]))
    with replacing(options.out) as part:
        part.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

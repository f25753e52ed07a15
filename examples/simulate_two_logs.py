"""Two logs as a user records them: a Panda that is empty, and the same Panda with a payload of 1.480 kg.

python examples/simulate_two_logs.py [FOLDER]
"""

import sys
from pathlib import Path

from armload import arm, write_recording
from armload.motion import random_motion, taie2024
from armload.payloads import test_payload
from armload.simulation import Sensors, World, simulate

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/logs")
folder.mkdir(parents=True, exist_ok=True)

panda = arm("panda")
# the arm differs from its model as real ones do: links, friction, torque offsets; the sensors have a Panda's noise
conditions = {"world": World.real_like(panda, seed=1), "sensors": Sensors.panda(panda)}
empty = simulate(panda, random_motion(panda, 1, duration=20.0, harmonics=10), None, seed=2, **conditions)
loaded = simulate(panda, taie2024(), test_payload(), seed=1, **conditions)
for name, log in (("empty", empty), ("loaded", loaded)):
    write_recording(folder / f"{name}.csv", log)
    print(f"wrote {folder / name}.csv: {len(log)} samples, {log.t[-1] - log.t[0]:.1f} s")

"""What the methods say of real logs, where those are at hand.

    ARMLOAD_REAL_DATA=FOLDER python benchmarks/real_logs.py

Writes benchmarks/results/real_logs.json. The logs are test input: nothing in armload is fitted on them. Three
questions: the UR10e pair (2.805 kg bolted on between two runs of one motion), what an unloaded Panda seems to carry,
and the semi-real Panda: the torque of a known payload added to the unloaded log, its first 10 s as the tare, windows of
the rest as runs.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter
from script import ROOT, write

from armload import Recording, arm, read_recording
from armload.arms import payload_regressor
from armload.estimators import FilteredRecursiveLeastSquares, Tared
from armload.identification import identify
from armload.payloads import test_payload
from armload.posterior import HybridIdentifier, PosteriorLeastSquares, SmoothPosteriorLeastSquares

METHODS = ("hybrid", "map-gp", "map", "rls", "rls-filter")
WINDOWS = np.arange(10.0, 14.75, 0.5)  # [s] since the start of the log: every half second that six follow


def data() -> Path:
    """The folder of real logs."""
    folder = Path(os.environ.get("ARMLOAD_REAL_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        raise SystemExit(f"real logs not found in {folder}: set ARMLOAD_REAL_DATA to their folder")
    return folder


def ur10e(folder: Path) -> dict:
    """The load bolted to a UR10e, relative to the tare and without it; what the empty arm seems to carry."""
    robot = arm(folder / "ur10e.urdf", "tool0")
    loaded, tare = (read_recording(folder / f"ur10e_{x}.csv", robot) for x in ("loaded_2805g", "unloaded"))
    out = {}
    for method in METHODS:
        for name, log, before, truth in (
            (method, loaded, tare, 2.805),
            (f"{method}, no tare", loaded, None, 2.805),
            (f"{method}, empty, no tare", tare, None, 0.0),
        ):
            answer = identify(log, robot, tare=before, method=method)
            half = 0.5 * (answer.phi_high[0] - answer.phi_low[0])
            out[name] = {
                "mass_kg": round(answer.mass, 4),
                "half_width_kg": round(half, 4),
                "truth_kg": truth,
                "held": answer.held,
            }
    return out


def phantom(folder: Path) -> dict:
    """What an unloaded Panda seems to carry, without a tare."""
    robot = arm("panda")
    log = read_recording(folder / "panda_unloaded_1khz.csv", robot)
    out = {}
    for method in METHODS:
        answer = identify(log, robot, method=method)
        out[method] = {"mass_kg": round(answer.mass, 4), "held": answer.held}
    return out


def semi_real(folder: Path) -> dict:
    """Errors of a known payload added to the real unloaded log, mean over the windows."""
    robot, truth = arm("panda"), test_payload().parameters.phi
    log = read_recording(folder / "panda_unloaded_1khz.csv", robot)
    ddq = savgol_filter(log.dq, 101, 3, deriv=1, delta=1 / log.rate, axis=0)
    added = payload_regressor(robot.frame_motion(log.q), log.dq, ddq) @ truth
    loaded = Recording(log.t, log.q, log.dq, log.tau + added, source="semi-real")
    start = log.t[0]
    tare = log.between(start, start + 10.0)
    methods = {
        "hybrid, with tare": HybridIdentifier(robot, tare),
        "hybrid": HybridIdentifier(robot),
        "map-gp, with tare": SmoothPosteriorLeastSquares(robot, tare),
        "map, with tare": PosteriorLeastSquares(robot, tare),
        "rls-filter, with tare": Tared(FilteredRecursiveLeastSquares(robot), tare),
    }
    out = {}
    for name, method in methods.items():
        for seconds in (1.0, 3.0, 6.0):
            windows = [loaded.between(start + w, start + w + seconds) for w in WINDOWS]
            answers = [method.run(w) for w in windows]
            errors = np.abs([answer.phi - truth for answer in answers])
            half = 1.96 * np.array([answer.std for answer in answers])
            error = errors.mean(axis=0)
            out[f"{name}, {seconds:g} s"] = {
                "mass_g": round(1e3 * float(error[0]), 2),
                "first_moment_g_m": np.round(1e3 * error[1:4], 2).tolist(),
                "inertia_g_m2": np.round(1e3 * error[4:], 2).tolist(),
                "mass_half_width_g": round(1e3 * float(half[:, 0].mean()), 1),
                "inside_95": round(float(np.mean(errors <= half)), 3),
                "windows": len(windows),
            }
    return out


def main() -> None:
    folder = data()
    command = "ARMLOAD_REAL_DATA=FOLDER python benchmarks/real_logs.py"
    first = {"command": command, "ur10e_pair": ur10e(folder), "panda_unloaded_phantom": phantom(folder)}
    write("real_logs", first | {"panda_semi_real": semi_real(folder)})


if __name__ == "__main__":
    main()

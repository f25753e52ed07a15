"""What the methods say of real logs, where those are at hand.

    ARMLOAD_REAL_DATA=FOLDER python benchmarks/real_logs.py

Writes benchmarks/results/real_logs.json. The logs are test input: nothing in armload is fitted on them. Four
questions: the UR10e pair (2.805 kg bolted on between two runs of one motion), what its torque difference alone says,
what an unloaded Panda seems to carry, and the semi-real Panda: the torque of a known payload added to the unloaded log,
its first 10 s as the tare, windows of the rest as runs.

The difference is of the same moments of the motion, as least squares without any prior, all joints counting alike or by
their residual: of the payload alone; with a share of the torque that each joint's gear loses as unknowns; with a change
of offsets, Coulomb and viscous friction between the runs; with both; and of one joint alone with both. Standard errors
are of a jackknife over stretches of 2.5 s.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter
from script import ROOT, write

from armload import Recording, arm, read_recording
from armload.arms import payload_regressor, rated_effort
from armload.estimators import FilteredRecursiveLeastSquares, Tared
from armload.identification import identify
from armload.payloads import test_payload
from armload.posterior import HybridIdentifier, PosteriorLeastSquares, SmoothPosteriorLeastSquares
from armload.recording import GAP
from armload.recording.alignment import align
from armload.regression import Correction, FilteredRegression, JointFeatures
from armload.regression.lag import GAIN
from armload.regression.mismatch import PER_JOINT
from armload.regression.rows import REGRESSOR_RATE

METHODS = ("hybrid", "map-gp", "map", "rls", "rls-filter")
WINDOWS = np.arange(10.0, 14.75, 0.5)  # [s] since the start of the log: every half second that six follow

STRETCH = 2.5  # [s] that the jackknife leaves out: longer than the residual's correlation, a tenth of the motion
SETTLED = 0.4  # [s] after a gap: the lag has forgotten what was before
MOVES = 0.05  # [rad/s] of the fastest joint: at rest friction holds the joints by what it likes


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


class Difference:
    """The torque difference of the UR10e pair, (M, n), and what may explain it, each (M, n, columns)."""

    def __init__(self, folder: Path) -> None:
        robot = arm("ur10e")
        loaded, tare = (read_recording(folder / f"ur10e_{x}.csv", robot) for x in ("loaded_2805g", "unloaded"))
        correction, n = Correction(robot, rated_effort(robot)), robot.n
        (t, X, r), (s, X0, r0) = (lagged(log, correction) for log in (loaded, tare))
        at = align(loaded, tare).tare_times(t)
        speed = np.abs([np.interp(t, loaded.t, column) for column in loaded.dq.T]).max(axis=0)
        keep = np.isfinite(at) & (speed > MOVES)
        joint, per = np.arange(n), len(PER_JOINT) * n

        def own(rows: NDArray, first: int) -> NDArray[np.float64]:
            """The unknowns of each joint's own, of one kind (M, n)."""
            return rows[:, joint, 10 + first + joint]

        def then(values: NDArray) -> NDArray[np.float64]:
            return np.stack([np.interp(at, s, column) for column in values.T], axis=1)[keep]

        self.n, self.t = n, t[keep]
        self.y, self.W = r[keep] - then(r0), X[keep][:, :, :10]
        names = list(PER_JOINT)
        changes = [own(X, names.index(name) * n)[keep] for name in ("offset", "coulomb", "viscous")]
        lost = own(X, per)[keep] - then(own(X0, per))
        self.columns = {"loss": [lost], "change": changes}

    def mass(self, explained: list[NDArray], joints: list[int], weighed: bool, keep: NDArray) -> float:
        """Least squares of phi and of one unknown for each joint and kind of `explained`, of the rows kept."""
        rows, right = [], []
        for j in joints:
            beside = np.zeros((keep.sum(), len(explained), self.n))
            for k, column in enumerate(explained):
                beside[:, k, j] = column[keep, j]
            rows.append(np.concatenate([self.W[keep, j], beside.reshape(keep.sum(), -1)], axis=1))
            right.append(self.y[keep, j])
        A, b, scale = np.array(rows), np.array(right), np.ones(len(joints))
        for _ in range(3 if weighed else 1):
            stacked, y = np.concatenate(A / scale[:, None, None]), np.concatenate(b / scale[:, None])
            x = np.linalg.lstsq(stacked, y, rcond=None)[0]
            scale = np.sqrt(np.mean((b - A @ x) ** 2, axis=1))
        return float(x[0])

    def told(self, explained: list[NDArray], joints: list[int], weighed: bool) -> dict:
        """The mass with its standard error, and by how much it is too low."""
        part = ((self.t - self.t[0]) // STRETCH).astype(int)
        mass = self.mass(explained, joints, weighed, part >= 0)
        without = [self.mass(explained, joints, weighed, part != k) for k in np.unique(part)]
        std = np.sqrt((len(without) - 1) * np.var(without))
        low = 100.0 * (1.0 - mass / 2.805)
        return {"mass_kg": round(mass, 4), "std_kg": round(float(std), 4), "low_percent": round(low, 2)}


def lagged(log: Recording, correction: Correction) -> tuple[NDArray, NDArray, NDArray]:
    """Times (M,), X (M, n, ·) and r (M, n) of a log's rows, each stretch between gaps by itself."""
    edges, found = np.flatnonzero(np.diff(log.t) > GAP) + 1, []
    nothing = JointFeatures(correction.arm.n, 0, 0)
    for a, b in zip([0, *edges], [*edges, len(log)], strict=True):
        regression = FilteredRegression(correction.arm, GAIN, correction, nothing, REGRESSOR_RATE)
        rows = regression.rows(log.t[a:b], log.q[a:b], log.dq[a:b], log.tau[a:b])
        keep = rows.t > log.t[a] + SETTLED
        found.append((rows.t[keep], rows.X[keep], rows.r[keep]))
    t, X, r = (np.concatenate(part) for part in zip(*found, strict=True))
    return t, X, r


def difference(folder: Path) -> dict:
    """What the pair's torque difference says of the mass, with more and more of friction as unknowns."""
    pair = Difference(folder)
    loss, change = pair.columns["loss"], pair.columns["change"]
    kinds = {"payload alone": [], "gears lose": loss, "friction changes": change, "both": [*loss, *change]}
    out = {}
    for name, explained in kinds.items():
        for how, weighed in (("alike", False), ("by residual", True)):
            out[f"{name}, joints {how}"] = pair.told(explained, list(range(pair.n)), weighed)
    for j in (1, 2, 3):  # the others bear too little of the payload's weight
        out[f"both, joint {j + 1} alone"] = pair.told(kinds["both"], [j], False)
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
    pair = {"ur10e_pair": ur10e(folder), "ur10e_pair_difference": difference(folder)}
    write(
        "real_logs",
        {"command": command} | pair | {"panda_unloaded_phantom": phantom(folder), "panda_semi_real": semi_real(folder)},
    )


if __name__ == "__main__":
    main()

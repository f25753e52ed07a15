"""Least squares as strong as it gets: RLS and filtered RLS over rate, derivative, noise and calibration, tuned.

Recursive least squares on τ − τ_bare(q, dq, ddq) = Y·phi need an acceleration, and what is public of reference [7] does
not say how it was differentiated, at which rate, nor with which forgetting factor. Each setting here is measured with
its usual values and once more tuned: `tune` takes, from `GRID`, the setting with the smallest geometric mean over the
ten parameters of the mean error on `TUNED_ON` other real-like arms, each with a loading of the training and on the
study's motion. So it knows what the ensembles know, and nothing of the runs on which it is measured.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, savgol_filter, sosfiltfilt

from armload.arms import Arm, payload_regressor
from armload.inertia import InertialParameters
from armload.lab.cells import key_of
from armload.lab.evaluation import EvaluationRun
from armload.lab.experiment import Task, listed
from armload.lab.study.basis import NOISE, WORLDS, Basis, Size, basis_of_process
from armload.lab.study.numbers import EXACT
from armload.lab.study.readings import basis_of_readings
from armload.lab.study.spec import NOMINAL, REAL
from armload.recording import Recording
from armload.regression.lag import GAIN, Lag
from armload.simulation import Run, Sensors, World, simulate_many

RATES = (540, 1000)  # [Hz] of the study's rows, and of the Panda's own interface
SENSORS = ("panda", "none")
DERIVATIVES = ("difference", "savgol", "butterworth")
TUNED_ON = 8  # other arms
GRID = {  # [1/s] observer gain, [s] half the window, [Hz] cut-off; [1] forgetting factor of each sample
    "filter": (5.0, 10.0, 20.0, 50.0, 100.0),
    "difference": (0.0,),
    "savgol": (0.02, 0.05, 0.1, 0.2),
    "butterworth": (2.5, 5.0, 10.0, 20.0),
}
USUAL = {"filter": GAIN, "difference": 0.0, "savgol": 0.05, "butterworth": 10.0}
FORGETTING = (1.0, 0.9995, 0.998)
_START = np.array([10.0] + [1.0] * 3 + [0.3] * 6)  # standard deviations of the recursion's start, as in `estimators`
_POINTS, _DEGREE, _FORMAT = 60, 3, 1
_OTHER_ARMS, _OTHER_NOISE = 700, 70000  # seeds of what the tuning sees


@dataclass(frozen=True)
class Rival:
    """rate: [Hz]. sensors: "panda" or "none". derivative: "difference", "savgol", "butterworth", or "filter" (filtered
    RLS, which takes none). calibrated: minus the empty arm's answer on the same motion, as in [7]. tuned: by `tune`."""

    rate: int
    sensors: str
    derivative: str
    calibrated: bool = False
    tuned: bool = False

    @property
    def name(self) -> str:
        """Unique; the file's stem."""
        marks = ["calibrated"] * self.calibrated + ["tuned"] * self.tuned
        return "-".join(["rival", self.derivative, str(self.rate), self.sensors, *marks])


def rivals(size: Size) -> list[Rival]:
    """Every combination; of a reduced size those of the first rate and noise, and none tuned."""
    whole = size.max_epochs is None
    return [
        Rival(rate, sensors, derivative, calibrated, tuned)
        for rate, sensors in product(RATES[: None if whole else 1], SENSORS[: None if whole else 1])
        for derivative in (*DERIVATIVES, "filter")
        for calibrated, tuned in product((False, True), (False, True)[: None if whole else 1])
    ]


def rival_tasks(basis: Basis) -> list[Task]:
    """One task for each rate and noise, which share their runs."""
    on = basis_of_readings(basis)
    groups: dict[tuple[int, str], list[Rival]] = {}
    for rival in rivals(basis.size):
        groups.setdefault((rival.rate, rival.sensors), []).append(rival)
    return [
        Task(
            f"least squares at {rate} Hz, noise: {sensors}",
            {r.name: key_of(_FORMAT, on.fingerprint, TUNED_ON, GRID, FORGETTING, asdict(r)) for r in group},
            measured_rivals,
            (on.rests_on, rate, sensors),
            unit="row",
        )
        for (rate, sensors), group in groups.items()
    ]


def measured_rivals(
    names: Sequence[str], rests_on: tuple[Any, ...], rate: int, sensors: str
) -> Iterator[dict[str, Any]]:
    """The cells of these names: error of the mean over the second half of each run (R, 10)."""
    basis = basis_of_process(*rests_on)
    runs = simulated(basis, rate, sensors)
    wanted = [r for r in rivals(basis.size) if r.name in names]
    others = tuning_runs(basis, rate, sensors) if any(r.tuned for r in wanted) else []
    for rival in wanted:
        begun = time.perf_counter()
        chosen = tune(basis, rival, others) if rival.tuned else (USUAL[rival.derivative], 1.0)
        errors = {
            protocol: np.abs([answers(basis, rival, run, chosen[0], chosen[1:])[0] - run.truth.phi for run in members])
            for protocol, members in runs.items()
        }
        yield {
            "spec": {"kind": "rival", **asdict(rival)},
            "setting": {"value": chosen[0], "forgetting": chosen[1]},
            "wall_s": round(time.perf_counter() - begun, 1),
            "protocols": {protocol: {"second_half": listed(e)} for protocol, e in errors.items()},
        }


def simulated(basis: Basis, rate: int, sensors: str) -> dict[str, list[EvaluationRun]]:
    """The test payload on the nominal arm and on the real-like arms, the empty arm on the same motion beside each."""
    robot, size = basis.arm, basis.size
    worlds = {
        NOMINAL: [World.nominal(robot)] * 3,
        REAL: [World.real_like(robot, WORLDS + k) for k in range(size.worlds)],
    }
    out = {}
    for protocol, members in worlds.items():
        out[protocol] = _runs(basis, members, [basis.truth] * len(members), rate, sensors, NOISE + 1000 * len(out))
    return out


def tuning_runs(basis: Basis, rate: int, sensors: str) -> list[EvaluationRun]:
    """Other real-like arms, each with a loading of the training."""
    worlds = [World.real_like(basis.arm, _OTHER_ARMS + k) for k in range(TUNED_ON)]
    loadings = basis.loadings[:: max(1, len(basis.loadings) // TUNED_ON)]
    held = [InertialParameters(p.parameters.phi, basis.arm.frame) for p in loadings[:TUNED_ON]]
    return _runs(basis, worlds[: len(held)], held, rate, sensors, _OTHER_NOISE)


def _runs(
    basis: Basis, worlds: Sequence[World], held: Sequence[InertialParameters], rate: int, sensors: str, noise: int
) -> list[EvaluationRun]:
    seen = Sensors.ideal() if sensors == "none" else basis.sensors
    motion = basis.motion
    loaded = [Run(motion, phi, w, seen, noise + k) for k, (phi, w) in enumerate(zip(held, worlds, strict=True))]
    empty = [Run(motion, None, w, seen, noise + 500 + k) for k, w in enumerate(worlds)]
    logs = simulate_many(basis.arm, [*loaded, *empty], rate=float(rate), duration=motion.duration)
    pairs = zip(logs[: len(held)], logs[len(held) :], held, strict=True)
    return [EvaluationRun(log, phi, f"run {k}", tare) for k, (log, tare, phi) in enumerate(pairs)]


def tune(basis: Basis, rival: Rival, runs: Sequence[EvaluationRun]) -> tuple[float, float]:
    """The setting and forgetting factor of `GRID` that err least on these runs."""
    loss = {}
    for setting in GRID[rival.derivative]:
        said = [answers(basis, rival, run, setting, FORGETTING) - run.truth.phi for run in runs]
        error = np.abs(said).mean(axis=0)  # (forgetting factors, 10)
        loss |= dict(zip(product([setting], FORGETTING), np.log(np.maximum(error, EXACT)).mean(axis=1), strict=True))
    return min(loss, key=lambda chosen: loss[chosen])


def answers(
    basis: Basis, rival: Rival, run: EvaluationRun, setting: float, forgetting: Sequence[float]
) -> NDArray[np.float64]:
    """What it says of a run with each forgetting factor (F, 10): the mean of the estimates of its second half, as [7]
    reports it, minus the same of the empty arm if it is calibrated."""

    def said(log: Recording) -> NDArray[np.float64]:
        y, Y = equations(basis.arm, log, rival.derivative, setting)
        every = max(1, len(log) // _POINTS)
        estimates = [recursive(y, Y, factor, every) for factor in forgetting]
        return np.array([e[len(e) // 2 :].mean(axis=0) for e in estimates])

    return said(run.recording) - (said(run.tare) if rival.calibrated and run.tare is not None else 0.0)


def equations(arm: Arm, log: Recording, derivative: str, setting: float) -> tuple[NDArray, NDArray]:
    """y (N, n) and Y (N, n, 10) of a log; "filter": those of `FilteredRecursiveLeastSquares`, which starts at rest."""
    if derivative != "filter":
        ddq = acceleration(log, derivative, setting)
        y = log.tau - arm.torque(log.q, log.dq, ddq)
        Y = payload_regressor(arm.frame_motion(log.q), log.dq, ddq)
        return y[1:], Y[1:]  # the first sample has no difference yet
    p, drift = arm.momentum(log.q, log.dq)
    u = log.tau - drift + setting * p
    y = Lag(setting)(log.t, u, initial=u[0]) - setting * p
    signal = np.stack([log.q, log.dq], axis=1)  # (N, 2, n)
    lagged = Lag(setting)(log.t, signal, initial=signal[0])
    ddq = setting * (log.dq - lagged[:, 1])
    return y, payload_regressor(arm.frame_motion(lagged[:, 0]), lagged[:, 1], ddq)


def acceleration(log: Recording, derivative: str, setting: float) -> NDArray[np.float64]:
    """d/dt of the measured velocity (N, n).

    "difference": to the sample before. "savgol": local cubic over ± `setting` [s] (Savitzky & Golay 1964).
    "butterworth": fourth order, forwards and backwards, cut-off `setting` [Hz], then central differences. The last two
    look ahead and work on an even grid: a log with jitter and lost samples is interpolated onto it and back.
    """
    if derivative == "difference":
        return np.diff(log.dq, axis=0, prepend=log.dq[:1]) / np.diff(log.t, prepend=log.t[0] - 1.0)[:, None]
    step = 1.0 / log.rate
    even = np.arange(log.t[0], log.t[-1] + 0.5 * step, step)
    dq = np.stack([np.interp(even, log.t, column) for column in log.dq.T], axis=1)
    if derivative == "savgol":
        window = 2 * max(_DEGREE, round(setting / step)) + 1
        ddq = savgol_filter(dq, min(window, len(dq) // 2 * 2 - 1), _DEGREE, deriv=1, delta=step, axis=0)
    else:
        smooth = sosfiltfilt(butter(4, setting, fs=1.0 / step, output="sos"), dq, axis=0)
        ddq = np.gradient(smooth, step, axis=0)
    return np.stack([np.interp(log.t, even, column) for column in np.asarray(ddq).T], axis=1)


def recursive(y: NDArray, Y: NDArray, forgetting: float, every: int) -> NDArray[np.float64]:
    """Estimates (E, 10) of recursive least squares after each `every` samples, y (N, n), Y (N, n, 10), in closed form.

    After N samples phi = (Σ μ^(N−k) YₖᵀYₖ + μ^N·P₀⁻¹)⁻¹ · Σ μ^(N−k) Yₖᵀyₖ, which is what the recursion arrives at.
    """
    A, b, out = np.diag(_START**-2), np.zeros(10), []
    for start in range(0, len(y), every):
        part, rows = y[start : start + every], Y[start : start + every]
        weight = forgetting ** np.arange(len(part) - 1, -1, -1.0)
        A = forgetting ** len(part) * A + np.einsum("k,kja,kjb->ab", weight, rows, rows, optimize=True)
        b = forgetting ** len(part) * b + np.einsum("k,kja,kj->a", weight, rows, part, optimize=True)
        out.append(np.linalg.solve(A, b))
    return np.array(out)

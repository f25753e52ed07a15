"""Measuring a cell: the same runs for every method, single samples and whole runs apart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.estimators import Identifier
from armload.lab.evaluation import EvaluationRun
from armload.lab.experiment import listed
from armload.lab.study.spec import NOMINAL, REAL
from armload.recording import Recording

Predict = Callable[[NDArray[np.float64]], NDArray[np.float64]]  # rows of (t, q, dq, tau) → phi (N, 10)
_SHOWN = (NOMINAL, REAL)  # protocols whose Izz over time is kept (Fig. 8)
_POINTS, _STREAM_POINTS = 120, 60  # of a curve; a stream's estimates cost more


def measure_learned(predict: Predict, runs: dict[str, list[EvaluationRun]]) -> dict[str, Any]:
    """What a learned method makes of every run: `protocols` and `izz` of its cell.

    single: mean |K(x) − phi| over samples and runs (10,); first: |K(x) − phi| of each run's first sample (R, 10);
    running: |mean of K(x) − phi over a run|, each run (R, 10).
    """

    def measure(run: EvaluationRun) -> tuple[dict[str, NDArray], dict[str, Any]]:
        X = features(run.recording)
        answers = predict(X)
        error = answers - run.truth.phi
        errors = {"running": error.mean(axis=0), "first": error[0], "single": np.abs(error).mean(axis=0)}
        average = np.cumsum(answers[:, 9]) / np.arange(1, len(answers) + 1)
        return errors, _curve(run, X[:, 0], answers[:, 9], average)

    return _measured(measure, runs)


def measure_stream(
    make: Callable[[EvaluationRun], Identifier], runs: dict[str, list[EvaluationRun]], points: int = _STREAM_POINTS
) -> dict[str, Any]:
    """What a stream identifier makes of every run.

    single: mean |error| over the estimates along the runs; first: |error| of the estimate after one sample; running:
    |error| of the last estimate; second_half: |error| of the mean over the estimates of the second half, as the
    benchmark's authors report.

    Args:
        make: the identifier for a run, already calibrated or with the tare where it uses one.
        points: estimates along a run, about.
    """

    def measure(run: EvaluationRun) -> tuple[dict[str, NDArray], dict[str, Any]]:
        trace = make(run).trace(run.recording, max(1, len(run.recording) // points))
        t, phi = np.array([e.t for e in trace]) - run.recording.t[0], np.array([e.phi for e in trace])
        error = phi - run.truth.phi
        half = error[len(error) // 2 :].mean(axis=0)
        single = np.abs(error).mean(axis=0)
        errors = {"running": error[-1], "first": error[0], "second_half": half, "single": single}
        return errors, _curve(run, t, phi[:, 9], phi[:, 9])

    return _measured(measure, runs)


def _measured(
    measure: Callable[[EvaluationRun], tuple[dict[str, NDArray], dict[str, Any]]], runs: dict[str, list[EvaluationRun]]
) -> dict[str, Any]:
    """Absolute errors of every run by protocol, `single` averaged over the runs, and the first runs' curves of Izz."""
    protocols, izz = {}, {}
    for protocol, members in runs.items():
        found = [measure(run) for run in members]
        errors = {name: np.abs([errors[name] for errors, _ in found]) for name in found[0][0]}
        errors["single"] = errors["single"].mean(axis=0)
        protocols[protocol] = {name: listed(values) for name, values in errors.items()}
        protocols[protocol]["labels"] = [run.label for run in members]
        if protocol in _SHOWN:
            izz[protocol] = found[0][1]
    return {"protocols": protocols, "izz": izz}


def features(recording: Recording) -> NDArray[np.float64]:
    """Rows (t, q, dq, tau) of a recording, time from its first sample."""
    t = recording.t - recording.t[0]
    return np.column_stack([t, recording.q, recording.dq, recording.tau])


def _curve(run: EvaluationRun, t: NDArray, single: NDArray, running: NDArray) -> dict[str, Any]:
    keep = np.unique(np.linspace(0, len(t) - 1, _POINTS).round().astype(int))
    return {
        "t": listed(t[keep]),
        "single": listed(single[keep]),
        "running": listed(running[keep]),
        "truth": float(run.truth.phi[9]),
    }

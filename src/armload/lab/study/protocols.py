"""Measuring a cell: the same runs for every method, single samples and whole runs apart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.estimators import Identifier
from armload.lab.evaluation import EvaluationRun
from armload.lab.experiment import listed
from armload.recording import Recording

Predict = Callable[[NDArray[np.float64]], NDArray[np.float64]]  # rows of (t, q, dq, tau) → phi (N, 10)
_SHOWN = ("test_payload_nominal", "test_payload_real_like")  # protocols whose Izz over time is kept (Fig. 8)
_POINTS, _STREAM_POINTS = 120, 60  # of a curve; a stream's estimates cost more


def measure_learned(predict: Predict, runs: dict[str, list[EvaluationRun]]) -> dict[str, Any]:
    """What a learned method makes of every run: `protocols` and `izz` of its cell.

    single: mean |K(x) − phi| over samples and runs (10,); first: |K(x) − phi| of each run's first sample (R, 10);
    running: |mean of K(x) − phi over a run|, each run (R, 10).
    """
    protocols, izz = {}, {}
    for protocol, members in runs.items():
        single, first, running = [], [], []
        for k, run in enumerate(members):
            answers = predict(features(run.recording))
            error = answers - run.truth.phi
            single.append(np.abs(error).mean(axis=0))
            first.append(np.abs(error[0]))
            running.append(np.abs(error.mean(axis=0)))
            if k == 0 and protocol in _SHOWN:
                average = np.cumsum(answers[:, 9]) / np.arange(1, len(answers) + 1)
                izz[protocol] = _curve(run, answers[:, 9], average)
        protocols[protocol] = {
            "running": listed(running),
            "first": listed(first),
            "single": listed(np.mean(single, axis=0)),
            "labels": [run.label for run in members],
        }
    return {"protocols": protocols, "izz": izz}


def measure_stream(make: Callable[[EvaluationRun], Identifier], runs: dict[str, list[EvaluationRun]]) -> dict[str, Any]:
    """What a stream identifier makes of every run.

    single: mean |error| over the estimates along the runs; first: |error| of the estimate after one sample; running:
    |error| of the last estimate; second_half: |error| of the mean over the estimates of the second half, as the
    benchmark's authors report.

    Args:
        make: the identifier for a run, already calibrated or told the tare where it uses one.
    """
    protocols, izz = {}, {}
    for protocol, members in runs.items():
        single, first, running, half = [], [], [], []
        for k, run in enumerate(members):
            every = max(1, len(run.recording) // _STREAM_POINTS)
            trace = make(run).trace(run.recording, every)
            phi = np.array([e.phi for e in trace])
            error = phi - run.truth.phi
            single.append(np.abs(error).mean(axis=0))
            first.append(np.abs(error[0]))
            running.append(np.abs(error[-1]))
            half.append(np.abs(error[len(error) // 2 :].mean(axis=0)))
            if k == 0 and protocol in _SHOWN:
                curve = _curve(run, phi[:, 9], phi[:, 9], np.array([e.t for e in trace]) - run.recording.t[0])
                izz[protocol] = curve
        protocols[protocol] = {
            "running": listed(running),
            "first": listed(first),
            "second_half": listed(half),
            "single": listed(np.mean(single, axis=0)),
            "labels": [run.label for run in members],
        }
    return {"protocols": protocols, "izz": izz}


def features(recording: Recording) -> NDArray[np.float64]:
    """Rows (t, q, dq, tau) of a recording, time from its first sample."""
    t = recording.t - recording.t[0]
    return np.column_stack([t, recording.q, recording.dq, recording.tau])


def _curve(run: EvaluationRun, single: NDArray, running: NDArray, t: NDArray | None = None) -> dict[str, Any]:
    times = run.recording.t - run.recording.t[0] if t is None else t
    keep = np.unique(np.linspace(0, len(times) - 1, _POINTS).round().astype(int))
    return {
        "t": listed(times[keep]),
        "single": listed(single[keep]),
        "running": listed(running[keep]),
        "truth": float(run.truth.phi[9]),
    }

"""Running the study: every cell of the plan that is not finished yet, each kept as soon as it is done."""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from armload.errors import DatasetError
from armload.estimators import Identifier
from armload.identification import METHODS
from armload.lab.cells import finished_cell, key_of
from armload.lab.evaluation import EvaluationRun, PriorLeastSquares, mean_absolute_error
from armload.lab.experiment import Cells, Task, run_tasks
from armload.lab.study.basis import Basis, basis_of_process
from armload.lab.study.plan import plan
from armload.lab.study.protocols import measure_learned, measure_stream
from armload.lab.study.readings import reading_tasks
from armload.lab.study.rivals import rival_tasks
from armload.lab.study.spec import Spec
from armload.lab.study.trained import SPLITTING, train
from armload.regression import GaussianPrior
from armload.runtime.version import package_versions

# SHA-256 of panda_unloaded_1khz.csv, the real log of the cells in benchmarks/results: their key does not name it
_OWN_LOG = "263eaed9b0853290842bf785ab37c77065dffd1423a304b9b48d49b4f4494559"


def run_study(
    basis: Basis,
    results: str | Path,
    *,
    until: float | None = None,
    jobs: int = 1,
    cluster: str | None = None,
    progress: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> Cells:
    """Measure what is not finished yet and return all finished cells by name.

    Args:
        basis: what it rests on.
        results: folder of the cells' files; those with the right key are not measured again.
        jobs, cluster, until, say: see `run_tasks`.
        progress: bars on stderr, for one job.

    Raises:
        DatasetError: the real log cannot be read or is too short, before anything is measured.
    """
    _ = basis.real_recording
    todo = plan(basis.size)
    if jobs > 1 or cluster is not None:  # or each process would build them
        for sensors in sorted({spec.sensors for spec in todo}):
            basis.dataset(sensors, progress)
    rests_on, key, bars = basis.rests_on, cell_keys(basis, results), progress and jobs == 1 and cluster is None
    tasks = [Task.of_one(spec.name, key(spec), _measured, spec, rests_on, bars) for spec in todo]
    tasks += [*rival_tasks(basis), *reading_tasks(basis)]
    return run_tasks(tasks, results, jobs=jobs, cluster=cluster, until=until, say=say, part="cell", indent=1)


def cell_keys(basis: Basis, results: str | Path) -> Callable[[Spec], str]:
    """The key of a cell: `Spec.key`, and with it the SHA-256 of the real log where that is not the study's own.

    Without a real log what was measured on the study's own is finished, too; what is measured then is measured again
    as soon as there is a log.

    Raises:
        DatasetError: the real log cannot be read.
    """
    fingerprint, log = basis.fingerprint, basis.real_log
    try:
        found = None if log is None else hashlib.sha256(log.read_bytes()).hexdigest()
    except OSError as error:
        raise DatasetError(f"the real log {log} cannot be read ({error.strerror or error}): name another") from None

    def key(spec: Spec) -> str:
        own = spec.key(fingerprint)
        finished = found is None and finished_cell(results, spec.name, own) is not None
        return own if finished or found == _OWN_LOG else key_of(own, found)

    return key


def _measured(spec: Spec, rests_on: tuple[Any, ...], progress: bool) -> dict[str, Any]:
    """The numbers of one cell."""
    basis, begun = basis_of_process(*rests_on), time.perf_counter()
    measured = _benchmark(spec, basis) if spec.kind == "benchmark" else _learned(spec, basis, progress)
    return {
        "spec": asdict(spec),
        "wall_s": round(time.perf_counter() - begun, 1),
        "rows": basis.size.rows * len(basis.loadings),
        "payloads": len(basis.loadings),
        "versions": package_versions("armload", "numpy", "scikit-learn", "jax", "pin", "mujoco"),
        **measured,
    }


def _learned(spec: Spec, basis: Basis, progress: bool) -> dict[str, Any]:
    """Train an ensemble, then measure it on its own test rows and on every run."""
    trained = train(spec, basis, progress)
    measured = measure_learned(trained.predict, basis.runs)
    measured["protocols"]["held_out"] = {"single": trained.held_out.tolist()}
    return {"epochs": trained.epochs, "file_bytes": trained.file_bytes, **measured}


def _benchmark(spec: Spec, basis: Basis) -> dict[str, Any]:
    """Measure least squares or a baseline on every run."""
    robot = basis.arm
    if spec.method == "training-mean":
        dataset = basis.dataset("ideal")
        split = SPLITTING[spec.split](dataset, spec.seed)
        mean = np.asarray(dataset.y[split.train].mean(axis=0))
        measured = measure_learned(lambda X: np.tile(mean, (len(X), 1)), basis.runs)
        error = mean_absolute_error(mean, dataset.y[split.test])
        measured["protocols"]["held_out"] = {"single": error.tolist()}
        return {"epochs": None, "file_bytes": None, **measured}

    prior = GaussianPrior.of([p.parameters for p in basis.loadings], "the training payloads")

    def make(run: EvaluationRun) -> Identifier:
        if spec.method == "same-prior":
            return PriorLeastSquares(robot, prior.mean, prior.covariance)
        name = re.sub("-(tare|calibrated.*)$", "", spec.method)
        return METHODS[name].make(robot, None if name == spec.method else run.tare)

    # the hybrid's estimates along a run cost seconds, and a quick run has no time for any
    points = 4 if spec.method.startswith("hybrid") or basis.size.max_epochs is not None else 60
    runs = basis.runs_with_own_motion_tared if spec.method == "rls-filter-calibrated" else basis.runs
    return {"epochs": None, "file_bytes": None, **measure_stream(make, runs, points)}

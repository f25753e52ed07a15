"""Running the study: every cell of the plan that is not finished yet, each kept as soon as it is done."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armload.estimators import Identifier
from armload.identification import METHODS
from armload.lab.dataset import Split, split_payloads, split_rows
from armload.lab.evaluation import EvaluationRun, PriorLeastSquares, mean_absolute_error
from armload.lab.experiment import Cells, Task, run_tasks
from armload.lab.study.basis import Basis, Size
from armload.lab.study.plan import plan
from armload.lab.study.protocols import measure_learned, measure_stream
from armload.lab.study.spec import Spec
from armload.regression import GaussianPrior
from armload.version import package_versions

if TYPE_CHECKING:
    from armload.ensembles import BaggingEnsemble, MixedEnsemble, TwoStage

_SPLITS: dict[str | None, Callable[..., Split]] = {"row": split_rows, "payload": split_payloads}
_SIGNALS = {"t": slice(0, 1), "q": slice(1, 8), "dq": slice(8, 15), "tau": slice(15, 22)}


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
    """
    todo = plan(basis.size)
    if jobs > 1 or cluster is not None:  # or each process would build them
        for sensors in sorted({spec.sensors for spec in todo}):
            basis.dataset(sensors, progress)
    rests_on, bars, fingerprint = (
        (basis.folder, basis.size, basis.real_log),
        progress and jobs == 1 and cluster is None,
        basis.fingerprint,
    )
    tasks = [Task.of_one(spec.name, spec.key(fingerprint), _measured, spec, rests_on, bars) for spec in todo]
    return run_tasks(tasks, results, jobs=jobs, cluster=cluster, until=until, say=say, part="cell", indent=1)


def _measured(spec: Spec, rests_on: tuple[Path, Size, Path | None], progress: bool) -> dict[str, Any]:
    """The numbers of one cell."""
    basis, begun = _basis_of_process(*rests_on), time.perf_counter()
    measured = _benchmark(spec, basis) if spec.kind == "benchmark" else _learned(spec, basis, progress)
    return {
        "spec": asdict(spec),
        "wall_s": round(time.perf_counter() - begun, 1),
        "rows": basis.size.rows * len(basis.loadings),
        "payloads": len(basis.loadings),
        "versions": package_versions("armload", "numpy", "scikit-learn", "jax", "pin", "mujoco"),
        **measured,
    }


@lru_cache(maxsize=1)
def _basis_of_process(folder: Path, size: Size, real_log: Path | None) -> Basis:
    """One for all cells that a process measures, so that its runs are simulated once."""
    return Basis(folder, size, real_log)


def _learned(spec: Spec, basis: Basis, progress: bool) -> dict[str, Any]:
    """Train an ensemble, then measure it on its own test rows and on every run."""
    from armload.ensembles import save_model

    dataset = basis.dataset(spec.sensors, progress)
    split = _SPLITS[spec.split](dataset, spec.seed)
    hidden = [_SIGNALS[signal] for signal in spec.drop]

    def seen(X: np.ndarray) -> np.ndarray:
        X = X.copy()
        for columns in hidden:
            X[:, columns] = 0.0
        return X

    model = _untrained(spec)
    checkpoint = basis.folder / "checkpoints" / f"{spec.name}.npz"
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    parts = (split.train, split.validation)
    data = [a for rows in parts for a in (seen(dataset.X[rows]), dataset.y[rows])]
    model.fit(*data, progress=progress, checkpoint=checkpoint)
    file = basis.folder / "models" / f"{spec.name}.safetensors"
    save_model(file, model, arm=basis.arm, motion=basis.motion, dataset_hash=dataset.hash, notes=spec.name)
    answers = np.asarray(model.predict(seen(dataset.X[split.test])))
    held_out = mean_absolute_error(answers, dataset.y[split.test])
    measured = measure_learned(lambda X: model.predict(seen(X)), basis.runs)
    measured["protocols"]["held_out"] = {"single": held_out.tolist()}
    for left in checkpoint.parent.glob(f"{spec.name}.*"):
        left.unlink()
    epochs = None if model.epochs_ is None else np.ravel(model.epochs_).tolist()
    return {"epochs": epochs, "file_bytes": file.stat().st_size, **measured}


def _untrained(spec: Spec) -> BaggingEnsemble | TwoStage | MixedEnsemble:
    from armload.ensembles import BaggingEnsemble, MixedEnsemble, NetworkLearner, TreeLearner, TwoStage

    network = NetworkLearner(
        hidden=spec.hidden, batch=spec.batch, max_epochs=spec.max_epochs, learning_rate=spec.learning_rate
    )
    tree = TreeLearner(max_depth=spec.max_depth)
    rest: dict[str, Any] = {"members": spec.members, "seed": spec.seed}
    rest["scale"] = "none" if spec.scale == "raw" else "standard"
    if spec.kind == "mixed":
        return MixedEnsemble((tree, network), **rest)
    return (BaggingEnsemble, TwoStage)[spec.stages - 1](network if spec.kind == "network" else tree, **rest)


def _benchmark(spec: Spec, basis: Basis) -> dict[str, Any]:
    """Measure least squares or a baseline on every run."""
    robot = basis.arm
    if spec.method == "training-mean":
        dataset = basis.dataset("ideal")
        split = _SPLITS[spec.split](dataset, spec.seed)
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

    runs = basis.runs_with_own_motion_tared if spec.method == "rls-filter-calibrated" else basis.runs
    return {"epochs": None, "file_bytes": None, **measure_stream(make, runs)}

"""Readings of the paper: what its text leaves open about the training, each trained and measured on many arms.

The paper does not say how inputs and outputs are scaled, nor when training stops before its 1000 epochs. Its wording of
the trees is that of scikit-learn; scikit-learn's networks stop by default (`tol`, in SI units) after 13 or 14 epochs. A
cell of a reading holds what intervals need: the errors on each held-out payload, and on `ARMS` real-like arms.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

from armload.lab.evaluation import EvaluationRun
from armload.lab.experiment import Task, listed
from armload.lab.study.basis import Basis, Size, basis_of_process
from armload.lab.study.numbers import READING
from armload.lab.study.plan import as_small
from armload.lab.study.protocols import measure_learned
from armload.lab.study.spec import Spec
from armload.lab.study.trained import train

ARMS = 30  # real-like arms of an interval; the first of them are those of the other cells
DEFAULT_STOP = 14  # epochs after which scikit-learn's `MLPRegressor` stops by default on these data in SI units


def reading_specs(size: Size) -> list[Spec]:
    """The trainings, the most telling first: trees, then networks by what they cost."""
    trees, networks = Spec("tree"), Spec("network")
    short = replace(networks, max_epochs=DEFAULT_STOP)
    both, row = ("row", "payload"), ("row",)  # what stops early is measured on the paper's own split
    wanted = [(trees, "raw", both), (trees, "standard", both), (networks, "raw", both), (short, "raw", row)]
    specs = [
        replace(spec, scale=scale, split=split, stages=stages, ablation=READING)
        for spec, scale, splits in wanted
        for split in splits
        for stages in (1, 2)
    ]
    once = list({spec.name: spec for spec in (as_small(spec, size) for spec in specs)}.values())
    return once if size.max_epochs is None else [spec for spec in once if spec.scale == "raw"]


def basis_of_readings(basis: Basis) -> Basis:
    """The same data set and arm, measured on many real-like arms and nothing else."""
    arms = ARMS if basis.size.max_epochs is None else basis.size.worlds + 1
    return replace(basis, size=replace(basis.size, worlds=arms, payloads=0, motions=0), real_log=None)


def reading_tasks(basis: Basis) -> list[Task]:
    """The cells of the readings as tasks for `run_tasks`."""
    on = basis_of_readings(basis)
    return [
        Task.of_one(spec.name, spec.key(on.fingerprint), measured_reading, spec, on.rests_on)
        for spec in reading_specs(basis.size)
    ]


def measured_reading(spec: Spec, rests_on: tuple[Any, ...]) -> dict[str, Any]:
    """The numbers of one cell: as any cell's, on fewer protocols, `held_out` for each payload as well."""
    import time

    basis, begun = basis_of_process(*rests_on), time.perf_counter()
    trained = train(spec, basis)
    runs: dict[str, list[EvaluationRun]] = {name: members for name, members in basis.runs.items() if members}
    measured = measure_learned(trained.predict, runs)
    held_out = {"single": listed(trained.held_out)} | {k: listed(v) for k, v in trained.by_payload().items()}
    measured["protocols"]["held_out"] = held_out
    return {
        "spec": asdict(spec),
        "wall_s": round(time.perf_counter() - begun, 1),
        "epochs": trained.epochs,
        **measured,
    }

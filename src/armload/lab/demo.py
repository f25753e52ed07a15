"""The main job from end to end, in minutes: simulate, train, identify an unknown payload, compare, report.

A nominal Panda runs the excitation with the container's loadings, with sensors as on real Pandas; small ensembles
learn from it, by payload: some loadings are held out to stop the networks. Then another Panda, one that differs from
its model as real ones do (`World.real_like`), runs the same excitation with the test payload, which is outside the
family, and, for the methods that can use it, another motion with nothing (the tare).

This shows the way, not the paper's figures: ten times fewer rows, fewer epochs, one arm, one test payload.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from armload.arms import Arm, arm
from armload.errors import DatasetError
from armload.identification import Identification, default_for, identify
from armload.inertia import InertialParameters
from armload.lab.dataset import Dataset, Split, build_dataset, split_payloads
from armload.lab.evaluation import Comparison, EvaluationRun, Table, catalogued, compare
from armload.lab.evaluation.contest import WITH_TARE
from armload.lab.experiment import write_json
from armload.motion import Motion, random_motion, taie2024
from armload.payloads import container_loadings, test_payload
from armload.recording import Recording, write_recording
from armload.simulation import Sensors, World, simulate

if TYPE_CHECKING:
    from armload.ensembles import BaggingEnsemble, TwoStage
    from armload.lab.evaluation.contest import Method

PHYSICAL = ("rls", "rls-filter", f"rls-filter{WITH_TARE}", "map", f"map{WITH_TARE}")
HELD_OUT = 0.15  # of the loadings, for validation
TARE_DURATION, TARE_HARMONICS = 20.0, 10  # [s]


class Size(NamedTuple):
    """How much is done.

    Every n-th loading, rows per run, members, hidden units, epochs, rate of the logs [Hz], times compared at.
    """

    every: int
    rows: int
    members: int
    hidden: int
    epochs: int
    rate: float
    points: int


FULL = Size(every=1, rows=300, members=5, hidden=500, epochs=60, rate=1000.0, points=49)
QUICK = Size(every=7, rows=100, members=2, hidden=64, epochs=8, rate=200.0, points=9)


@dataclass(frozen=True, eq=False)
class DemoResult:
    """What the demo found; everything is also in `folder`.

    table: the one table: truth, methods, baselines. comparison: the numbers behind it.
    identification: what `armload identify` says of the run (the default method, with the tare).
    report: the HTML file. seconds: what each part took.
    """

    table: Table
    comparison: Comparison
    identification: Identification
    folder: Path
    report: Path
    seconds: dict[str, float]


def run_demo(
    out: str | Path = "out/demo",
    *,
    quick: bool = False,
    seed: int = 2024,
    progress: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> DemoResult:
    """Do the main job from end to end.

    Args:
        out: folder for the data set, the logs, the models, the identified payload (JSON) and the report; files of an
            earlier demo are replaced.
        quick: seconds instead of minutes; the ensembles are then too small to judge.
        seed: of the world, the sensors' noise, the split and the training; the same seed gives the same numbers.
        progress: bars on stderr.
        say: called with what is being done.

    Raises:
        ArmloadError: a file cannot be written.
    """
    size, folder, robot, clock = QUICK if quick else FULL, Path(out), arm("panda"), _Clock(say)
    dataset, split, run, tare, learned = _made(folder, robot, size, seed, progress, clock)
    clock.start("identifying", f"{test_payload().name} ({test_payload().parameters.mass:.3f} kg), outside the loadings")
    answer, default = identify(run, robot, tare=tare), default_for(robot)
    write_json(folder / "identified.json", answer.to_dict())
    truth = InertialParameters(test_payload().parameters.phi, robot.frame)
    runs = [EvaluationRun(run, truth, test_payload().name, tare, seed + 1)]
    training = [dataset.truth(k) for k in np.unique(dataset.run[split.train])]
    validation = len(np.unique(dataset.run[split.validation]))
    comparison = compare(
        catalogued(robot, *PHYSICAL, default, f"{default}{WITH_TARE}") | learned,
        runs,
        np.linspace(0.0, run.duration, size.points),
        training=training,
        split=f"by payload: {len(training)} loadings for training, {validation} for validation, the test payload is in "
        f"neither; trained on the nominal arm, tested on a real-like one (seed {seed}); tare on another motion",
    )

    clock.start("reporting", "tables and figures")
    table = _table(comparison)
    report = _report(folder / "report.html", answer, comparison, runs, robot, table)
    write_json(folder / "comparison.json", comparison.to_dict())
    clock.stop()
    return DemoResult(table, comparison, answer, folder, report, clock.seconds)


def _made(
    folder: Path, robot: Arm, size: Size, seed: int, progress: bool, clock: _Clock
) -> tuple[Dataset, Split, Recording, Recording, dict[str, Method]]:
    """What is compared: the data set and its split, the run, the tare, the trained ensembles; all in the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    motion = taie2024()
    nominal, real, sensors = World.nominal(robot), World.real_like(robot, seed), Sensors.panda(robot)

    def log(name: str, motion: Motion, payload: InertialParameters | None, noise: int) -> Recording:
        found = simulate(robot, motion, payload, world=real, sensors=sensors, rate=size.rate, seed=noise)
        write_recording(folder / name, found)
        return found

    loadings = container_loadings()[:: size.every]
    clock.start("simulating", f"{len(loadings)} loadings on {motion.name} and a nominal {robot.name}")
    given: dict[str, Any] = {"worlds": [nominal], "sensors": sensors, "rows_per_run": size.rows, "seed": seed}
    dataset = _dataset(folder / "dataset", robot, [motion], loadings, progress=progress, **given)
    clock.start("recording", f"a real-like {robot.name} (seed {seed}): a tare on another motion, then the payload")
    run = log("run.csv", motion, test_payload().parameters, seed + 1)
    tare = log("tare.csv", random_motion(robot, seed, duration=TARE_DURATION, harmonics=TARE_HARMONICS), None, seed + 2)

    split = split_payloads(dataset, seed, (1.0 - HELD_OUT, HELD_OUT, 0.0))
    learned = _train(folder / "models", dataset, split, robot, motion, size, seed, progress, clock)
    return dataset, split, run, tare, learned


def _dataset(path: Path, *what: Any, **how: Any) -> Dataset:
    """The data set; one that an earlier demo left is used again if it is the same, and replaced if it is not."""
    try:
        return build_dataset(path, *what, **how)
    except DatasetError:
        if not (path / "provenance.json").exists():
            raise
        shutil.rmtree(path)
        return build_dataset(path, *what, **how)


def _train(
    folder: Path,
    dataset: Dataset,
    split: Split,
    robot: Arm,
    motion: Motion,
    size: Size,
    seed: int,
    progress: bool,
    clock: _Clock,
) -> dict[str, Method]:
    """One ensemble of each kind, single-stage and two-stage, saved and read back as a stream identifier."""
    from armload.ensembles import BaggingEnsemble, LearnedIdentifier, NetworkLearner, TwoStage, save_model
    from armload.lab.evaluation import held_out_error

    network = NetworkLearner(hidden=size.hidden, max_epochs=size.epochs)
    ensembles: dict[str, BaggingEnsemble | TwoStage] = {
        "trees": BaggingEnsemble("tree", size.members, seed),
        "trees, two stages": TwoStage("tree", size.members, seed),
        "networks": BaggingEnsemble(network, size.members, seed),
        "networks, two stages": TwoStage(network, size.members, seed),
    }
    data = [part[rows] for rows in (split.train, split.validation) for part in (dataset.X, dataset.y)]
    out: dict[str, Method] = {}
    for name, ensemble in ensembles.items():
        clock.start(f"training {name}", f"{size.members} members on {len(split.train)} rows")
        ensemble.fit(*data, progress=progress)
        path = folder / f"{name.replace(', ', '-').replace(' ', '-')}.safetensors"
        error = held_out_error(ensemble, dataset, split.validation)
        about = {"dataset_hash": dataset.hash, "payloads": dataset.payload[np.r_[split.train, split.validation]]}
        model = save_model(path, ensemble, arm=robot, motion=motion, error_std=error, **about)
        out[name] = lambda _, model=model: LearnedIdentifier(model, robot)  # another motion's tare is of no use to it
    return out


def _table(c: Comparison) -> Table:
    """Truth, estimates and errors of the one run at its end, a row for each method."""
    truth = InertialParameters(c.truth[0], c.frame)
    rows = [("truth", f"{truth.mass:.3f}", _millimetres(truth.com), "", "", "", "")]
    for m, name in enumerate(c.methods):
        phi = c.phi[m, 0, -1]
        com = phi[1:4] / phi[0]
        error = np.abs(phi - truth.phi)
        rows.append(
            (
                name,
                f"{phi[0]:.3f}",
                _millimetres(com),
                f"{1e3 * error[0]:.1f}",
                f"{1e3 * np.linalg.norm(com - truth.com):.1f}",
                f"{1e3 * error[4:].mean():.2f}",
                f"{1e6 * c.per_sample[m]:.0f}",
            )
        )
    columns = (
        "method",
        "mass [kg]",
        "centre of mass [mm]",
        "mass error [g]",
        "CoM error [mm]",
        "inertia error [10⁻³ kg·m²]",
        "time per sample [µs]",
    )
    note = f"Inertia error: mean of six, about the origin of {c.frame}. {c.conditions}"
    baselines = tuple(1 + c.methods.index(name) for name in c.baselines)
    return Table("An unseen payload, identified after one motion", columns, tuple(rows), note, baselines)


def _millimetres(vector: np.ndarray) -> str:
    return ", ".join(f"{1e3 * x:+.1f}" for x in vector)


def _report(
    path: Path, answer: Identification, comparison: Comparison, runs: list[EvaluationRun], robot: Arm, table: Table
) -> Path:
    from armload.lab.report import answer_section, default_report, write_report

    introduction = (
        f"A simulated {robot.name} that differs from its model as real ones do ran one excitation with a payload that "
        "no ensemble was trained on; the ensembles learned from the nominal arm on that same excitation. Every method "
        "got the same log, and the methods that can use one (the same-prior least squares among them) a tare: an "
        "earlier log of the empty arm on another motion."
    )
    first, *others = default_report(comparison, runs, robot, introduction=introduction)
    found = answer_section(answer, runs[0].truth)
    return write_report(path, [found, replace(first, tables=(table, *first.tables[1:])), *others], "armload demo")


class _Clock:
    """Says what is being done and keeps how long it took."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.seconds: dict[str, float] = {}
        self._say, self._name, self._since = say, "", 0.0

    def start(self, name: str, what: str) -> None:
        self.stop()
        self._name, self._since = name, time.perf_counter()
        self._say(f"{name}: {what}")

    def stop(self) -> None:
        if self._name:
            self.seconds[self._name] = time.perf_counter() - self._since

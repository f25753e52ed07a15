"""`armload train`: an ensemble learnt from a data set, or the hybrid for an arm, and how far to trust it."""

from __future__ import annotations

import argparse
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING

from armload.app.cli.arguments import add_cluster_argument, at_least, output_file, output_folder
from armload.app.cli.named import arm_of_dataset, motion_of
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_note, print_table
from armload.app.cli.progress import training_progress
from armload.errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armload.arms import Arm
    from armload.ensembles import BaggingEnsemble, MixedEnsemble, TwoStage
    from armload.ensembles.bagging import Ensemble
    from armload.lab.dataset import Dataset
    from armload.lab.evaluation import Table
    from armload.motion import Motion

_EXAMPLES = """\
examples:
  armload train --robot my_arm.urdf --frame tool0
  armload train --method hybrid --robot ur10e --episodes 2400 --jobs 4 --out ur10e.safetensors --report ur10e.json
  armload identify run.csv --robot ur10e --method ur10e.safetensors     (any motion, with or without --tare)

  armload train --dataset data/paper --out trees.safetensors
  armload train --dataset data/paper --kind network --stages 2 --epochs 200 --out networks.safetensors
  armload identify run.csv --robot panda --method trees.safetensors     (the log must show the same motion)

A hybrid needs no data set: it is trained on episodes that are simulated here, of arms that differ from the model, about
a second of one core for each. An interrupted training goes on from --work. What is printed is how often its intervals
held on episodes left out.

Errors of an ensemble are printed for two splits: by payload (whole payloads held out: what to expect of a new one) and
by row (as in the paper: neighbours of every test row are in training, so it measures memory). The model written learnt
from the training part of --split. An interrupted training of networks goes on from NAME.SPLIT.checkpoint….npz beside
--out NAME.safetensors, which go when it has ended.
"""

# What each method's own options are when they are not given; the other method refuses them.
_ENSEMBLE = {
    "dataset": None,
    "kind": "tree",
    "stages": 1,
    "members": 5,
    "epochs": 1000,
    "split": "payload",
    "motion": [],
}
_HYBRID = {"frame": None, "episodes": None, "jobs": None, "cluster": None, "work": None, "report": None, "json": False}


def parser() -> Parser:
    """The arguments of `armload train`."""
    parser = Parser(
        prog="armload train",
        description="Train the hybrid for an arm, or a bag of trees or networks on a data set.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add(
        "--method",
        choices=("ensemble", "hybrid"),
        help="what to train (default: ensemble with --dataset, hybrid without)",
    )
    add(
        "--out",
        type=output_file,
        metavar="FILE",
        help="model to write, .safetensors (hybrid, default: out/hybrid-ROBOT.safetensors)",
    )
    add("--seed", type=at_least(0), default=0, metavar="N", help="of everything random (default: 0)")
    add(
        "--robot",
        metavar="NAME|FILE.urdf",
        help="the arm; with --dataset only where the data set's arm is not a built-in one",
    )
    hybrid = parser.add_argument_group("hybrid")
    hybrid.add_argument("--frame", metavar="F", help="link whose frame payloads are drawn about (default: the flange)")
    hybrid.add_argument(
        "--episodes", type=at_least(32), metavar="N", help="to simulate (default: 2400; fewer than a thousand: a trial)"
    )
    hybrid.add_argument(
        "--jobs",
        type=at_least(1),
        metavar="N",
        help="episodes at a time (default: one for each core); no number changes",
    )
    add_cluster_argument(hybrid)
    hybrid.add_argument(
        "--work", type=output_folder, metavar="DIR", help="finished episodes are kept here (default: out/hybrid-ROBOT)"
    )
    hybrid.add_argument(
        "--report", type=output_file, metavar="FILE", help="JSON: the intervals' coverage, cell by cell"
    )
    hybrid.add_argument("--json", action="store_true", default=None, help="print that report and nothing else")
    ensemble = parser.add_argument_group("ensemble")
    ensemble.add_argument("--dataset", metavar="DIR", help="folder written by armload dataset")
    ensemble.add_argument("--kind", choices=("tree", "network", "mixed"), help="(default: tree)")
    ensemble.add_argument(
        "--stages", type=int, choices=(1, 2), help="2: mass and first moments apart from inertia (default: 1)"
    )
    ensemble.add_argument("--members", type=at_least(1), metavar="M", help="(default: 5)")
    ensemble.add_argument("--epochs", type=at_least(1), metavar="N", help="of networks, at most (default: 1000)")
    ensemble.add_argument("--split", choices=("payload", "row"), help="(default: payload)")
    ensemble.add_argument(
        "--motion",
        nargs="+",
        metavar="M",
        help="the data set's motions, where it has others than taie2024 and random:SEED",
    )
    return parser


def run(options: argparse.Namespace) -> None:
    """Train what was asked for."""
    from armload.app.cli import train_hybrid

    settle(options)
    (train_hybrid.run if options.method == "hybrid" else _run_ensemble)(options)


def settle(options: argparse.Namespace) -> None:
    """Which method is meant, and its options' defaults.

    Raises:
        UsageError: options that do not go together, or one that is missing.
    """
    if options.method is None:
        if options.dataset is None and options.robot is None:
            raise UsageError("expected --robot (a hybrid) or --dataset (an ensemble); see 'armload train --help'")
        options.method = "hybrid" if options.dataset is None else "ensemble"
    own, other = (_HYBRID, _ENSEMBLE) if options.method == "hybrid" else (_ENSEMBLE, _HYBRID)
    stray = [f"--{name}" for name in other if getattr(options, name) is not None]
    if stray and options.method == "hybrid":
        raise UsageError(
            f"a hybrid is trained for --robot on episodes simulated here: leave out {', '.join(stray)}, or choose "
            "--method ensemble"
        )
    if stray:
        raise UsageError(
            f"an ensemble is trained on --dataset: leave out {', '.join(stray)}, or choose --method hybrid without it"
        )
    needed = ("robot",) if options.method == "hybrid" else ("dataset", "out")
    missing = [f"--{name}" for name in needed if getattr(options, name) is None]
    if missing:
        raise UsageError(f"the following arguments are required: {', '.join(missing)}; see 'armload train --help'")
    if options.epochs is not None and options.kind in (None, "tree"):
        raise UsageError("--epochs is of networks, trees have none: leave it out, or choose --kind network or mixed")
    for name, value in own.items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    if options.method == "ensemble" and options.kind == "mixed" and options.stages == 2:
        raise UsageError("--kind mixed has one stage: leave out --stages 2, or choose tree or network")
    if options.out is not None and not options.out.endswith(".safetensors"):
        raise UsageError(f"--out is {options.out!r}: expected a name that ends in .safetensors")


def _run_ensemble(options: argparse.Namespace) -> None:
    """Train on both splits, print the errors on what was held out, save the model of the chosen split."""
    import numpy as np

    from armload.ensembles import save_model
    from armload.lab.dataset import open_dataset, split_payloads, split_rows
    from armload.lab.evaluation import held_out_error

    dataset = open_dataset(options.dataset)
    arm = arm_of_dataset(dataset, options.robot)
    motions = _motions(dataset, arm, options.motion)
    splits = {"payload": split_payloads, "row": split_rows}
    rows, error_std = [], None
    for name in sorted(splits, key=lambda name: name == options.split):  # the one to save last
        split = splits[name](dataset, options.seed)
        model = _untrained(options)
        found = any(_checkpoints(options.out, name))
        print_note(f"training on {len(split.train)} rows, split by {name}{', going on from its checkpoint' * found}")
        (X, y), (Xv, yv) = ((dataset.X[part], dataset.y[part]) for part in (split.train, split.validation))
        model.fit(X, y, Xv, yv, progress=training_progress(), checkpoint=_checkpoint(options.out, name))
        if name == "payload":
            error_std = held_out_error(model, dataset, split.test)
        rows += _errors(name, model, y.mean(axis=0), dataset.X[split.test], dataset.y[split.test])
    saved = save_model(
        options.out,
        model,
        arm=arm,
        motion=motions,
        dataset_hash=dataset.hash,
        payloads=dataset.payload[np.concatenate([split.train, split.validation])],
        error_std=error_std,
        notes=f"split by {options.split}",
    )
    for left in [file for name in splits for file in _checkpoints(options.out, name)]:
        left.unlink(missing_ok=True)
    print_table(_table(saved.kind, rows, options))
    print(f"wrote {options.out}: {saved.compiled.n_members} members, split by {options.split}, about {saved.frame}")


def _checkpoint(out: str, split: str) -> Path:
    """Where the training of networks on a split stands, beside the model that is to be written."""
    return Path(out).with_name(f"{Path(out).stem}.{split}.checkpoint.npz")


def _checkpoints(out: str, split: str) -> list[Path]:
    """Those there are: each stage or part of an ensemble has one."""
    named = _checkpoint(out, split)
    return list(named.parent.glob(f"{escape(named.stem)}*{named.suffix}"))


def _untrained(options: argparse.Namespace) -> BaggingEnsemble | TwoStage | MixedEnsemble:
    from armload.ensembles import BaggingEnsemble, MixedEnsemble, NetworkLearner, TwoStage

    network = NetworkLearner(max_epochs=options.epochs)
    if options.kind == "mixed":
        return MixedEnsemble(("tree", network), options.members, options.seed)
    kind = network if options.kind == "network" else options.kind
    return (BaggingEnsemble, TwoStage)[options.stages - 1](kind, options.members, options.seed)


def _motions(dataset: Dataset, arm: Arm, names: list[str]) -> list[Motion]:
    """The motions of the data set, known again by their fingerprints."""
    from armload.motion import MotionFingerprint

    names, known = list(names), {}
    for about in dataset.provenance["motions"]:
        name = about["name"]
        drawn = name.removeprefix(f"random-{arm.name}-")
        if name == "taie2024":
            names.append(name)
        elif drawn != name and drawn.isdecimal():
            names.append(f"random:{drawn}")
    for name in names:
        motion = motion_of(name, arm)
        known[MotionFingerprint.of(motion).sha256] = motion
    missing = [about["name"] for about in dataset.provenance["motions"] if about["fingerprint"] not in known]
    if missing:
        raise UsageError(
            f"the data set has the motion {missing[0]!r}, which is not at hand: name its file with --motion"
        )
    return [known[about["fingerprint"]] for about in dataset.provenance["motions"]]


def _errors(split: str, model: Ensemble, mean: NDArray, X: NDArray, y: NDArray) -> list[tuple[str, ...]]:
    """Rows of the table: the model and the training mean, on rows held out by this split."""
    from armload.lab.evaluation import mean_absolute_error
    from armload.lab.report.shown import SHOWN_SCALE, short

    guesses = {f"{model.kind_name}, by {split}": model.predict(X), f"training mean, by {split}": mean}
    return [
        (name, *(short(SHOWN_SCALE * float(error)) for error in mean_absolute_error(guess, y)))
        for name, guess in guesses.items()
    ]


def _table(kind: str, rows: list[tuple[str, ...]], options: argparse.Namespace) -> Table:
    from armload.lab.evaluation import Table
    from armload.lab.report.shown import parameter_columns

    note = (
        f"Mean absolute error of single samples held out for testing (15 %); seed {options.seed}. By payload is what "
        "to expect of a payload like these that is new; by row measures memory; other families can be far worse."
    )
    rows = sorted(rows, key=lambda row: row[0].startswith("training mean"))
    baselines = tuple(k for k, row in enumerate(rows) if row[0].startswith("training mean"))
    return Table(f"{kind}: errors on held-out data", ("method", *parameter_columns()), tuple(rows), note, baselines)

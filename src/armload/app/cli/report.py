"""`armload report`: one log through every method, as an HTML file."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from armload.app.cli.arguments import (
    COLUMN_OPTIONS,
    add_arm_arguments,
    add_column_arguments,
    at_least,
    file_name,
    output_file,
)
from armload.app.cli.idle import given, refuse_idle
from armload.app.cli.named import arm_of, arm_of_dataset, payload_of
from armload.app.cli.named_logs import read_logs
from armload.app.cli.outputs import check_page
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_note, print_table, working
from armload.errors import UsageError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.ensembles import LearnedModel
    from armload.estimators import Identifier
    from armload.lab.report import Section
    from armload.posterior import HybridModel
    from armload.recording import Recording

_POINTS = 40  # estimates drawn along the log

_EXAMPLES = """\
examples:
  armload report run.csv --robot panda --out run.html
  armload report out/demo/run.csv --robot panda --tare out/demo/tare.csv --truth test --out run.html
  armload report run.csv --robot panda --model trees.safetensors networks.safetensors --out run.html
  armload report --dataset data/paper --model trees.safetensors --out test.html

With --truth the report shows errors too, beside two baselines. With --dataset it shows them for runs with payloads that
`armload train` held out for testing (with the same --seed); a model that learned from one of them is refused. A trained
ensemble answers for all that the arm holds, as in its training: the tare is not subtracted from it.
"""


def parser() -> Parser:
    """The arguments of `armload report`."""
    parser = Parser(
        prog="armload report",
        description="Write an HTML report: motion and torques of a log, and every method's estimate over time.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add("log", nargs="?", type=file_name, metavar="LOG", help="log of a motion with the payload")
    add_arm_arguments(parser, required=False)
    add("--tare", type=file_name, metavar="LOG0", help="an earlier log of the arm; the payload is what was added")
    add("--truth", metavar="FILE", help="the payload, where it is known (JSON, franka-hand or test)")
    add("--dataset", metavar="DIR", help="take runs of a data set instead of LOG")
    add("--runs", type=at_least(1), default=8, metavar="N", help="of the data set (default: 8)")
    add("--seed", type=at_least(0), default=0, metavar="N", help="of the data set's split (default: 0)")
    add("--model", nargs="+", default=[], metavar="FILE", help="trained models to show too")
    add("--topic", metavar="T", help="JointState topic of a bag, where it has several")
    add_column_arguments(parser)
    add("--out", required=True, type=output_file, metavar="FILE.html", help="file to write")
    return parser


def run(options: argparse.Namespace) -> None:
    """Run every method, write the report, print its first tables."""
    from armload.lab.report import write_report

    check_page(options.out)
    if (options.log is None) == (options.dataset is None):
        raise UsageError("expected either a LOG or --dataset DIR; see 'armload report --help'")
    if options.log is not None and options.robot is None:
        raise UsageError("the following arguments are required: --robot; see 'armload report --help'")
    if options.log is not None:
        refuse_idle(given(options, "runs", "seed", parser=parser()), "of --dataset, which is not given")
    else:
        of_log = ("frame", "gravity", "tare", "truth", "topic", *COLUMN_OPTIONS)
        refuse_idle(given(options, *of_log), "of a LOG, and a data set says it itself")
    with working("reading") as say:
        sections, title = (_of_log if options.dataset is None else _of_dataset)(options, say)
        say("drawing and writing")
        write_report(options.out, sections, title)
    first = sections[: 1 if options.log is None else 2]  # of a log, the answer and the table of all methods
    for table in (table for section in first for table in section.tables):
        print_table(table)
    print(f"wrote {options.out}")


def _of_log(options: argparse.Namespace, say: Callable[[str], None]) -> tuple[list[Section], str]:
    from armload.identification import identify
    from armload.lab.evaluation import EvaluationRun, compare
    from armload.lab.report import answer_section, default_report, log_report

    arm = arm_of(options)
    truth = None if options.truth is None else arm.in_frame(payload_of(options.truth, arm))
    log, tare = read_logs(options, arm, options.log, options.tare)
    assert log is not None
    say("identifying")
    found = identify(log, arm, tare=tare)
    for note in found.notes:
        print_note(note)
    answer = answer_section(found, truth)
    models = _models(arm, log, options.model)
    methods, title = _methods(arm, models), f"{Path(options.log).name} on {arm.name}"
    about = f"The log `{options.log}`" + (
        f", relative to what was mounted in the tare `{options.tare}`." if tare else ", without a tare."
    )
    if len(found.segments) > 1:
        about += (
            " Each method takes the whole log as one payload, though the payload changes within it: what was found is "
            "of the last part alone, and may be far from these numbers."
        )
    if truth is None:
        traces = {}
        for k, (name, make) in enumerate(methods.items(), start=1):
            say(f"{name}, method {k} of {len(methods)}")
            traces[name] = make(tare).trace(log, every=max(1, len(log) // _POINTS))
        return [answer, *log_report(log, arm, traces, introduction=about)], title
    runs = [EvaluationRun(log, truth, Path(options.log).name, tare)]
    comparison = compare(methods, runs, split="the log is in nobody's training, as far as known", progress=say)
    return [answer, *default_report(comparison, runs, arm, introduction=about)], title


def _of_dataset(options: argparse.Namespace, say: Callable[[str], None]) -> tuple[list[Section], str]:
    import numpy as np

    from armload.ensembles import LearnedModel
    from armload.lab.dataset import open_dataset, split_payloads
    from armload.lab.evaluation import EvaluationRun, compare
    from armload.lab.report import default_report

    dataset = open_dataset(options.dataset)
    arm, split = arm_of_dataset(dataset, options.robot), split_payloads(dataset, options.seed)
    names = [payload["name"] for payload in dataset.provenance["payloads"]]
    held_out = np.unique(dataset.run[split.test])[: options.runs]
    runs = [
        EvaluationRun(dataset.recording(k), dataset.truth(k), f"{names[dataset.payload[dataset.run == k][0]]}, run {k}")
        for k in held_out
    ]
    models = _models(arm, runs[0].recording, options.model)
    for model in models.values():
        if isinstance(model, LearnedModel):
            model.check_new(dataset.hash, dataset.payload[np.isin(dataset.run, held_out)])
    comparison = compare(
        _methods(arm, models),
        runs,
        training=[dataset.truth(k) for k in np.unique(dataset.run[split.train])],
        split=f"by payload with seed {options.seed}; the first {len(runs)} test runs of {options.dataset}",
        progress=say,
    )
    about = f"Runs of the data set `{options.dataset}` with payloads held out for testing. {dataset}."
    return default_report(comparison, runs, arm, introduction=about), f"{options.dataset} on {arm.name}"


def _models(arm: Arm, log: Recording, paths: list[str]) -> dict[str, LearnedModel | HybridModel]:
    """The trained models by the names of their rows, each of which may answer for the arm and the log."""
    from armload.ensembles import load_model
    from armload.posterior import HybridModel

    models: dict[str, LearnedModel | HybridModel] = {}
    for path in paths:
        name = Path(path).stem
        if name in models or name in _names(arm):
            raise UsageError(f"--model {path}: another row is called {name!r}, too: give the file another name")
        if HybridModel.wrote(path):
            models[name] = HybridModel.load(path)
        else:
            models[name] = learned = load_model(path)
            learned.check(arm, log)
    return models


def _names(arm: Arm) -> tuple[str, ...]:
    """Methods of the catalogue that are shown."""
    from armload.identification import default_for

    return tuple(dict.fromkeys((default_for(arm), "map", "rls", "rls-filter")))


def _methods(
    arm: Arm, models: dict[str, LearnedModel | HybridModel]
) -> dict[str, Callable[[Recording | None], Identifier]]:
    """Every method by name, each a function of the tare."""
    from armload.ensembles import LearnedIdentifier, LearnedModel
    from armload.identification import METHODS
    from armload.posterior import HybridIdentifier

    methods: dict[str, Callable[[Recording | None], Identifier]] = {
        name: partial(METHODS[name].make, arm) for name in _names(arm)
    }
    for name, model in models.items():
        if isinstance(model, LearnedModel):
            methods[name] = lambda _, model=model: LearnedIdentifier(model, arm)
        else:
            methods[name] = partial(HybridIdentifier, arm, model=model)
    return methods

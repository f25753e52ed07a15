"""`armload reproduce taie2024`: the paper's study, measured again, with a verdict on every claim."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from armload.app.cli.arguments import add_cluster_argument, at_least, output_file, output_folder
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_note
from armload.errors import UsageError

_LOG = "panda_unloaded_1khz.csv"
_EXAMPLES = """\
examples:
  armload reproduce taie2024 --quick            (every table at reduced size, in about two minutes)
  armload reproduce taie2024                    (full size: hours; stop it at any time, the same command goes on)
  armload reproduce taie2024 --jobs 2           (two cells at once: about half the hours, the same numbers)
  armload reproduce taie2024 --hours 3

Each method, training and split is a cell with a file of its own in --results; finished cells are not measured again,
but on another --real-log.
The page, its appendix, the summary and the report are written from the cells there are; what is missing is named.
"""


def parser() -> Parser:
    """The arguments of `armload reproduce`."""
    parser = Parser(
        prog="armload reproduce",
        description="Run the study of a paper again and put what it says beside what is measured, claim by claim.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add("study", choices=("taie2024",), help="the study")
    add("--quick", action="store_true", help="reduced size; everything goes to --out")
    add("--out", type=output_folder, metavar="DIR", help="data sets, models, report (default: out/taie2024)")
    add("--results", type=output_folder, metavar="DIR", help="finished cells (default: benchmarks/results/taie2024)")
    add("--page", type=output_file, metavar="FILE", help="the page to write (default: docs/paper.md)")
    add("--jobs", type=at_least(1), default=1, metavar="N", help="cells at once (default: 1); same numbers")
    add_cluster_argument(parser)
    add("--hours", type=at_least(0.0, float), metavar="H", help="begin nothing after so many hours")
    add(
        "--real-log",
        metavar="FILE",
        help=f"unloaded log of a real Panda for the semi-real runs (default: {_LOG} in the folder ARMLOAD_REAL_DATA)",
    )
    return parser


def run(options: argparse.Namespace) -> None:
    """Measure what is missing, then write the page, the summary and the report."""
    from armload.lab.study import FULL, QUICK, Basis, run_study, write_results

    out = Path(options.out or ("out/taie2024-quick" if options.quick else "out/taie2024"))
    results = Path(options.results or (out / "cells" if options.quick else "benchmarks/results/taie2024"))
    page = Path(options.page or (out / "paper.md" if options.quick else "docs/paper.md"))
    basis = Basis(out, QUICK if options.quick else FULL, _real_log(options.real_log))
    if basis.real_log is None:
        print_note("no real log is at hand: the semi-real runs are left out; name one with --real-log")
    cells = run_study(
        basis,
        results,
        until=None if options.hours is None else 3600.0 * options.hours,
        jobs=options.jobs,
        cluster=options.cluster,
        progress=sys.stderr.isatty(),
        say=print_note,
    )
    written = write_results(cells, results.with_suffix(".json"), page, out / "report.html", quick=options.quick)
    for name, path in written.items():
        print(f"{name:<8} {path}")
    if options.quick:
        print_note("this was a quick run: its verdicts mean nothing")


def _real_log(named: str | None) -> Path | None:
    if named is not None:
        if not Path(named).is_file():
            raise UsageError(f"no real log at {named}: expected a recording of an unloaded Panda")
        return Path(named)
    folder = os.environ.get("ARMLOAD_REAL_DATA")
    path = Path(folder) / _LOG if folder else None
    return path if path is not None and path.is_file() else None

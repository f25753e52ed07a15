"""`armload benchmark`: every method on every population, with baselines, intervals and repeatability."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from armload.app.cli.arguments import add_cluster_argument, at_least, output_file, output_folder
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_note, print_table

_EXAMPLES = """\
examples:
  armload benchmark --quick                       (two populations, four episodes each: under a minute)
  armload benchmark --jobs 2                      (all: hours; stop it at any time, the same command goes on)
  armload benchmark --populations reference,tool --methods hybrid,map,rls-filter+tare
  armload benchmark --methods ekf                 (one more row; what is finished is not measured again)

Populations: reference, untared, container, beyond, shapes, odd, everyday, same-motion, same-place, elsewhere, tool,
repeat.
Methods are those of `armload methods`; NAME+tare subtracts what the method says of the tare. The two baselines are
always there.
The page, the summary and the report show all finished cells of the same --episodes and --rate.
"""


def parser() -> Parser:
    """The arguments of `armload benchmark`."""
    parser = Parser(
        prog="armload benchmark",
        description="Measure methods on populations of simulated episodes: errors over time, intervals, repeatability.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add("--quick", action="store_true", help="reduced size; everything goes to --out")
    add("--populations", metavar="A,B", help="populations (default: all)")
    add("--methods", metavar="A,B", help="methods (default: all but the slow and the trained)")
    add("--episodes", type=at_least(1), metavar="N", help="episodes of a population (default: 100)")
    add("--rate", type=at_least(20.0, float), metavar="HZ", help="of the logs (default: 1000)")
    add("--jobs", type=at_least(1), default=1, metavar="N", help="processes (default: 1); same numbers")
    add_cluster_argument(parser)
    add("--hours", type=at_least(0.0, float), metavar="H", help="begin nothing after so many hours")
    add("--out", type=output_folder, metavar="DIR", help="cells and report (default: out/benchmark)")
    add("--summary", type=output_file, metavar="FILE", help="the JSON (default: benchmarks/results/benchmark.json)")
    add("--page", type=output_file, metavar="FILE", help="the page (default: docs/benchmark.md)")
    return parser


def run(options: argparse.Namespace) -> None:
    """Measure what is missing, then write the page, the summary and the report."""
    from armload.lab.benchmark import QUICK, Size, gather, run_benchmark, write_results
    from armload.lab.benchmark.benchmark_tables import losses_table
    from armload.lab.benchmark.targets import targets_table

    asked = {
        "populations": _names(options.populations),
        "methods": _names(options.methods),
        "episodes": options.episodes,
        "rate": options.rate,
    }
    size = replace(QUICK if options.quick else Size(), **{k: v for k, v in asked.items() if v is not None})
    out = Path(options.out or ("out/benchmark-quick" if options.quick else "out/benchmark"))
    summary = Path(
        options.summary or (out / "benchmark.json" if options.quick else "benchmarks/results/benchmark.json")
    )
    page = Path(options.page or (out / "benchmark.md" if options.quick else "docs/benchmark.md"))
    until = None if options.hours is None else 3600.0 * options.hours
    cells = run_benchmark(size, out / "cells", jobs=options.jobs, cluster=options.cluster, until=until, say=print_note)
    written = write_results(cells, size, summary, page, out / "report.html")
    results = gather(cells, size)
    for table in (targets_table(results), losses_table(results)):
        print_table(table)
    for name, path in written.items():
        print(f"{name:<8} {path}")


def _names(text: str | None) -> tuple[str, ...] | None:
    return None if text is None else tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))

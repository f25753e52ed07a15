"""`armload demo`: the main job from end to end."""

from __future__ import annotations

import argparse
import sys

from armload.app.cli.arguments import at_least, output_folder
from armload.app.cli.parser import Parser
from armload.app.cli.printing import print_note, print_table

_EXAMPLES = """\
examples:
  armload demo
  armload demo --out my-demo --quick
  armload identify out/demo/run.csv --robot panda --tare out/demo/tare.csv     (afterwards)
"""


def parser() -> Parser:
    """The arguments of `armload demo`."""
    parser = Parser(
        prog="armload demo",
        description="Simulate a Panda with the container's loadings, train small ensembles of trees and of networks,\n"
        "identify a payload none of them has seen, compare with least squares, write a report.\n"
        "Under three minutes on two cores.",
        epilog=_EXAMPLES,
    )
    parser.add_argument(
        "--out",
        type=output_folder,
        default="out/demo",
        metavar="DIR",
        help="folder to write to (default: out/demo)",
    )
    parser.add_argument(
        "--quick", action="store_true", help="seconds instead of minutes, with ensembles too small to judge"
    )
    parser.add_argument("--seed", type=at_least(0), default=2024, metavar="N", help="(default: 2024)")
    return parser


def run(options: argparse.Namespace) -> None:
    """Run the demo and print its one table."""
    from armload.lab.demo import run_demo

    result = run_demo(options.out, quick=options.quick, seed=options.seed, progress=sys.stderr.isatty(), say=print_note)
    print_table(result.table)
    print(f"\nreport      {result.report}\nidentified  {result.folder / 'identified.json'}")
    print(f"seeds       {options.seed} (world, split, training), {options.seed + 1} (run), {options.seed + 2} (tare)")
    print_note(f"took {sum(result.seconds.values()):.0f} s")

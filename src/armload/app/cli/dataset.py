"""`armload dataset`: the paper's table, built by simulation."""

from __future__ import annotations

import argparse

from armload.app.cli.arguments import add_arm_arguments, add_cluster_argument, at_least, output_folder
from armload.app.cli.named import arm_of, motion_of, payload_named, whole_number, world_of
from armload.app.cli.parser import Parser
from armload.app.cli.progress import progress_shown

_EXAMPLES = """\
examples:
  armload dataset --out data/paper                                    (77 loadings × 3244 rows, as in the paper)
  armload dataset --out data/wide --payloads random:200 --world real-like:3
  armload dataset --out data/ur --robot ur10e --motion random:0 random:1 --payloads random:50 --rows 600

--payloads is loadings (the container's 77), random:COUNT, test, or JSON files. An interrupted build goes on when it is
started again. `armload train` learns from it.
"""


def parser() -> Parser:
    """The arguments of `armload dataset`."""
    parser = Parser(
        prog="armload dataset",
        description="Simulate every payload on every motion in every world; write one table with its provenance.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add("--out", required=True, type=output_folder, metavar="DIR", help="folder of the data set")
    add_arm_arguments(parser, default="panda")
    add(
        "--motion",
        nargs="+",
        default=["taie2024"],
        metavar="M",
        help="taie2024, a JSON file, or random:SEED (default: taie2024)",
    )
    add("--payloads", nargs="+", default=["loadings"], metavar="P", help="see below (default: loadings)")
    add(
        "--world",
        nargs="+",
        default=["nominal"],
        metavar="W",
        help="nominal (the arm as its model says) or real-like:SEED (default: nominal)",
    )
    add("--rows", type=at_least(2), default=3244, metavar="N", help="rows of each run (default: 3244, the paper's)")
    add(
        "--noise",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="sensors as measured on real robots, or ideal ones (default: --noise)",
    )
    add(
        "--sampler",
        choices=("mujoco", "inverse"),
        default="mujoco",
        help="how runs come about: simulated under a controller, or by inverse dynamics with a drawn tracking error, "
        "a hundred times faster (default: mujoco)",
    )
    add_cluster_argument(parser)
    add("--seed", type=at_least(0), default=0, metavar="N", help="of noise and random payloads")
    return parser


def run(options: argparse.Namespace) -> None:
    """Build the data set and say what it holds."""
    from armload.lab.dataset import build_dataset
    from armload.payloads import Payload, container_loadings, random_payloads
    from armload.runtime.extras import require
    from armload.simulation import Sensors

    require("scipy", "pyarrow")  # before there is a folder
    arm = arm_of(options)
    payloads: list[Payload] = []
    for name in options.payloads:
        if name == "loadings":
            payloads += container_loadings()
        elif name.startswith("random:"):
            payloads += random_payloads(whole_number(name, "payloads"), options.seed)
        else:
            payloads.append(payload_named(name, arm))
    with progress_shown("run") as show:
        dataset = build_dataset(
            options.out,
            arm,
            [motion_of(name, arm) for name in options.motion],
            payloads,
            worlds=[world_of(name, arm) for name in options.world],
            sensors=Sensors.of(arm) if options.noise else None,
            rows_per_run=options.rows,
            seed=options.seed,
            progress=lambda at: show(at.done, at.total),
            cluster=options.cluster,
            sampler=options.sampler,
        )
    print(f"{options.out}: {dataset}")

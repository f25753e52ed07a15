"""`armload motion show`: what each joint does, as a table, a picture, or a page on which the arm runs the motion."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from armload.app.cli.arguments import add_arm_arguments, at_least, output_file
from armload.app.cli.motion_arguments import add_obstacle_arguments, held
from armload.app.cli.named import arm_of, motion_of, surroundings_of
from armload.app.cli.printing import console, print_note, table
from armload.errors import UsageError
from armload.runtime.interruption import held_back

if TYPE_CHECKING:
    from armload.app.page.motion_page import MotionPage
    from armload.arms import Arm
    from armload.motion import Motion

_DEFAULT = "panda"


def add_show_arguments(parser: argparse.ArgumentParser) -> None:
    """All of `armload motion show`."""
    add = parser.add_argument
    add("motion", metavar="MOTION", help="taie2024, a JSON, CSV or YAML file, or random:SEED")
    add_arm_arguments(parser, default=_DEFAULT)
    parser.set_defaults(robot=None)  # a table needs no arm: only one that is named must fit
    add("--figure", type=output_file, metavar="F.png", help="draw the joints against their limits")
    add("--page", action="store_true", help="a page in the browser on which the arm runs the motion, until Ctrl-C")
    add = parser.add_argument_group("with --page").add_argument
    add("--host", metavar="H", help="interface of the page (default: 127.0.0.1)")
    add("--port", type=at_least(0, int, 65535), metavar="P", help="of the page (default: 8080, or the next free one)")
    add_obstacle_arguments(add)
    add("--held", type=held, metavar="R|SX,SY,SZ", help="what is held, as of `motion design` (default: 0.15)")


def run_show(options: argparse.Namespace) -> int:
    """Print the table; draw, or serve, what is asked for."""
    import numpy as np

    from armload.arms.units import heading, marked

    if not options.page and (options.box or any(x is not None for x in (options.host, options.port, options.held))):
        raise UsageError("--host, --port, --box and --held are of the page, but there is no --page")
    named, options.robot = options.robot is not None, options.robot or _DEFAULT
    arm = arm_of(options)
    motion = motion_of(options.motion, arm, named or options.page or options.figure is not None)
    page = _page(motion, arm, options) if options.page else None  # what refuses the motion, before anything is printed
    if options.figure is not None:
        from armload.lab.report.motion_figure import write_motion_figure

        write_motion_figure(motion, arm, options.figure)
    known = named or options.page or options.figure is not None or not Path(options.motion).exists()
    slides = arm.limits.slides if known else np.zeros(motion.n, bool)
    units = slides if known else [False, True]  # of a file's joints nobody said which of them slide
    q, dq, ddq = motion(motion.looked_at(1000.0 / motion.duration))
    rows = table(
        f"{motion.name}: {motion.n} joints, {motion.duration:g} s",
        "joint",
        heading("position", units, "from"),
        heading("position", units, "to"),
        heading("velocity", units, "fastest"),
        heading("acceleration", units, "hardest"),
    )
    peaks = zip(q.min(axis=0), q.max(axis=0), abs(dq).max(axis=0), abs(ddq).max(axis=0), strict=True)
    for k, values in enumerate(peaks, start=1):
        rows.add_row(marked(str(k), slides, k - 1), *(f"{value:.3f}" for value in values))
    console().print(rows)
    if note := getattr(motion, "note", ""):
        print(note)
    if options.figure is not None:
        print_note(f"wrote {options.figure}")
    if page is not None:
        print_note(f"{motion.name}: {page.url} (Ctrl-C ends it)")
        try:
            page.serve()
        except KeyboardInterrupt:  # the only way to end it
            pass
        finally:
            page.close()
    return 0


def _page(motion: Motion, arm: Arm, options: argparse.Namespace) -> MotionPage:
    from armload.app.page.motion_page import MotionPage

    around = surroundings_of(options, arm)
    port = 8080 if options.port is None else options.port
    with held_back():  # what the page loads catches every exception: a Ctrl-C would be lost
        return MotionPage(motion, arm, around, options.host or "127.0.0.1", port)

"""`armload survey`: every log of a fleet in one table, and a page on what it says."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import (
    COLUMNS,
    add_arm_arguments,
    add_cluster_argument,
    at_least,
    file_name,
    output_file,
    output_folder,
)
from armload.app.cli.outputs import check_page
from armload.app.cli.parser import Parser
from armload.app.cli.printing import counted, print_json, print_note, working
from armload.app.cli.progress import progress_shown
from armload.errors import UsageError

if TYPE_CHECKING:
    from armload.survey import Survey

_USAGE = """armload survey PATH… --robot R --out survey.parquet …
       armload survey report survey.parquet --out report.html"""
_EXAMPLES = """\
examples:
  armload survey logs/ --robot panda --out survey.parquet
  armload survey 'cells/*/2026-11-*.mcap' --robot ur10e --arm-of 'cells/([^/]+)/' --out survey.parquet
  armload survey @list.txt --robot panda --columns lab.toml --out survey.csv
  armload survey logs/ --robot panda --out survey.parquet --learn-profiles profiles
  armload survey logs/ --robot panda --profile 'profiles/{arm}.profile' --out survey.parquet
  armload survey s3://cell/logs --robot panda --out survey.parquet --cluster tcp://10.0.0.1:8786
  armload survey report survey.parquet --out report.html

A PATH is a log, a folder, a glob, a URL that fsspec knows, or @FILE with one of these on each line. Each log is cut
where the payload changes: a row for each payload, and for each log that cannot be answered a row that says why. The
same command goes on where it was stopped, and answers only logs that are new or changed (docs/survey.md).
"""


def parser() -> Parser:
    """The arguments of `armload survey`."""
    parser = Parser(
        prog="armload survey",
        usage=_USAGE,
        description="Tell of many logs what was held, when, how heavy, and how each arm is: one row for each payload.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add("paths", nargs="+", type=file_name, metavar="PATH", help="logs, folders, globs, URLs, @lists; or: report TABLE")
    add_arm_arguments(parser, required=False)
    add("--out", type=output_file, metavar="FILE", help="the table (.parquet, .csv, .json), or the report (.html)")
    add(
        "--arm-of",
        metavar="REGEX",
        help="its first group, searched in a log's path, names the arm (default: the folder)",
    )
    add("--profile", type=file_name, metavar="P", help="of the arm, or of each: profiles/{arm}.profile")
    add("--tare", type=file_name, metavar="LOG0", help="an empty log of the arm, or of each: empty/{arm}.csv")
    add("--tool", type=file_name, metavar="FILE", help="a mounted tool that is known (JSON, or franka-hand)")
    add("--method", type=file_name, metavar="M", help="as of `armload identify` (default: the most trustworthy)")
    add("--columns", type=file_name, metavar="SPEC", help=f"of logs that are tables, units of bags, too: {COLUMNS}")
    add("--topic", metavar="T", help="JointState topic of bags that have several")
    add("--jobs", type=at_least(1), metavar="N", help="processes (default: all cores); same rows")
    add_cluster_argument(parser)
    add("--learn-profiles", type=output_folder, metavar="DIR", help="then learn each arm from its empty stretches")
    add("--json", action="store_true", help="print one JSON object and nothing else")
    return parser


def run(options: argparse.Namespace) -> None:
    """Answer what is new, write the table, learn profiles; or write the report."""
    if options.paths[0] == "report":
        _report(options)
        return
    if options.out is None:
        raise UsageError(
            "a survey needs --out, its table: --out survey.parquet; or: armload survey report TABLE --out report.html"
        )
    if options.robot is None:
        raise UsageError("a survey needs --robot, the arms' kind; see 'armload survey --help'")
    if options.learn_profiles is not None and options.profile is not None:
        raise UsageError("--learn-profiles learns from answers without a profile: leave --profile out, and use it next")
    from armload.recording import ColumnSpec
    from armload.survey import Settings, survey

    settings = Settings(
        options.robot,
        options.frame,
        options.gravity,
        options.tare,
        options.profile,
        options.tool,
        options.method,
        tuple(ColumnSpec.of(options.columns).given().items()),
        options.topic,
    )
    with progress_shown("log") as progress:
        found = survey(
            options.paths,
            settings,
            options.out,
            arm_of=options.arm_of,
            jobs=options.jobs,
            cluster=options.cluster,
            progress=progress,
            say=print_note,
        )
    learned = _learned(options, settings, found) if options.learn_profiles is not None else {}
    about = {"logs": found.logs, "answered_anew": found.anew, "rows": len(found.rows), "unusable": found.unusable}
    about["passed_over"] = len(found.passed)
    if options.json:
        print_json(about | {"out": options.out, "profiles": learned})
        return
    logs, rows = counted(found.logs, "log"), counted(len(found.rows), "row")
    print(f"{logs} ({found.anew} answered anew): {rows}, {found.unusable} of them of logs that cannot be answered")
    for arm, outcome in learned.items():
        print(f"profile of {arm}: {outcome}")
    print(f"wrote {options.out}; look at it with: armload survey report {options.out} --out report.html")


def _learned(options: argparse.Namespace, settings: Any, found: Survey) -> dict[str, str]:
    from armload.survey.learning import learn_profiles

    return learn_profiles(found.rows, settings, options.learn_profiles, say=print_note)


def _report(options: argparse.Namespace) -> None:
    from armload.survey.report import write_survey_report

    if len(options.paths) != 2 or options.out is None:
        raise UsageError(
            "armload survey report takes one table and --out: armload survey report survey.parquet --out report.html"
        )
    if stray := [name for name, value in vars(options).items() if name not in ("paths", "out") and value]:
        given = ", ".join(f"--{name.replace('_', '-')}" for name in stray)
        raise UsageError(f"armload survey report draws what is in its table: leave out {given}")
    check_page(options.out)
    with working("drawing and writing"):
        findings = write_survey_report(options.paths[1], options.out)
    for line in findings:
        print(line)
    print(f"wrote {options.out}")

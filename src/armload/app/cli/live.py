"""`armload live`: identify while the robot runs, on a page or as lines of JSON."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING

from armload.app.cli.arguments import (
    add_arm_arguments,
    add_column_arguments,
    add_identifier_arguments,
    add_known_arguments,
    add_tare_age_argument,
    add_tool_and_topic_arguments,
    at_least,
    check_tare_age,
    file_name,
    output_file,
    pace,
)
from armload.app.cli.learning import learn_from
from armload.app.cli.named import arm_of, payload_named, robot_of
from armload.app.cli.named_logs import columns_for, columns_of, read_logs
from armload.app.cli.outputs import check_output
from armload.app.cli.parser import Parser
from armload.app.cli.printing import notes_aside, print_note
from armload.errors import ArmloadError, UsageError
from armload.runtime.interruption import held_back

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.devices import Detached
    from armload.service import Reconnecting

_EXAMPLES = """\
examples:
  armload live                                            (a simulated Panda whose payload comes and goes)
  armload live run.csv --robot panda --speed 2 --loop
  armload live fr3://172.16.0.2 --record today.csv
  armload live panda://172.16.0.2 --headless --record today.mcap          (samples, estimates, events: for Foxglove)
  armload live panda://172.16.0.2 --tare empty.csv --headless | tee estimates.jsonl
  armload live panda://172.16.0.2 --profile arm.profile --learn
  armload live panda://172.16.0.2 --tool franka-hand
  armload live panda://172.16.0.2 --mass 1.200±0.002      (taken where something is held that may be it)
  armload live 'ur://192.168.0.10?torque_constants=12,12,10,11,11,11' --robot ur5e    (yours; the UR10e's are built in)
  armload live ros2:///joint_states --robot iiwa14 --steady   (velocities that are differences of positions)
  armload live ros2:///joint_states --robot my_arm.urdf --frame tool0
  armload live "ros2:///joint_states?compensated=nothing" --robot ur5e   (effort has gravity taken out)

The page is for this machine only (http://127.0.0.1:8080) unless --host says otherwise. Its address then has a token,
and nobody gets in without: whoever does can read everything, switch the method and tare. Nothing is written to the
robot.
"""


_UNSAID = object()  # of --speed, for which None is one: as fast as possible


def parser() -> Parser:
    """The arguments of `armload live`."""
    parser = Parser(
        prog="armload live",
        description="Identify what the robot holds while it moves, on a page in the browser or as lines of JSON.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add(
        "source",
        nargs="?",
        default="sim",
        type=file_name,
        metavar="SOURCE",
        help="sim (default), a log, fr3://ADDRESS, panda://ADDRESS, ur://ADDRESS or ros2:///TOPIC",
    )
    add_arm_arguments(parser, required=False)
    add_identifier_arguments(parser)
    add_tare_age_argument(parser)
    add_known_arguments(parser)
    add_tool_and_topic_arguments(parser)
    add_column_arguments(parser)
    add(
        "--steady",
        action="store_true",
        help="tell velocities by the positions, too, 75 ms late: where they are coarse, noisy or seldom sampled",
    )
    add("--headless", action="store_true", help="no page: one JSON object per line on stdout")
    add(
        "--every",
        type=at_least(0.0, float),
        metavar="S",
        help="with --headless: seconds between lines (default: 0.1)",
    )
    add(
        "--learn",
        action="store_true",
        help="add what the stream shows of the empty arm to the file of --profile, when it ends",
    )
    add(
        "--record",
        type=output_file,
        metavar="FILE.csv|.mcap",
        help="keep every sample in a log that does not exist yet; as MCAP with the estimates and events",
    )
    add(
        "--speed",
        type=pace,
        default=_UNSAID,
        metavar="X|max",
        help="of a log or the simulator (default: 1, real time)",
    )
    add("--loop", action="store_true", help="replay a log again and again")
    add(
        "--duration",
        type=at_least(0.0, float),
        metavar="S",
        help="take so many seconds of samples (a page stays open)",
    )
    add("--host", metavar="H", help="interface of the page (default: 127.0.0.1); others ask for a token")
    add(
        "--token-file",
        type=file_name,
        metavar="F",
        help="holds that token, which is then asked for on this machine, too (without it, one is drawn for this run)",
    )
    add(
        "--port",
        type=at_least(0, int, 65535),
        metavar="P",
        help="of the page (default: 8080, or the next free one)",
    )
    return parser


def run(options: argparse.Namespace) -> int | None:
    """Identify until the source ends (--headless) or somebody interrupts; 2 after an error."""
    from armload.app.cli.headless import lines
    from armload.devices import Detached, Recorder, Steadied, open_source
    from armload.identification import known_of, plausible_known
    from armload.identification.tare_age import age_of
    from armload.payloads import read_payload
    from armload.posterior import load_profile
    from armload.recording import ColumnSpec, check_own_measurements
    from armload.runtime.atomic import clear_left_over
    from armload.service.session import Session

    for said in without_effect(options):
        print_note(said)
    options.robot = options.robot or robot_of(options.source)
    check_tare_age(options)
    arm = _arm_of(options)
    drawn = None if options.body is None else read_payload(options.body)
    known = plausible_known(known_of(arm, options.mass, options.com, drawn, options.family, if_held=True), arm)
    if options.steady and options.profile is not None:
        raise UsageError(
            "--steady and --profile: a profile is learned from velocities as they come; leave one of the two out"
        )
    if options.learn:
        if options.profile is None:
            raise UsageError("--learn adds to a profile, but there is no --profile; make one with `armload profile`")
        if options.loop:
            raise UsageError("--loop and --learn: a log would count again each time; leave one of the two out")
        check_output("--profile", options.profile)
        clear_left_over(options.profile)
    profile = None if options.profile is None else load_profile(options.profile)
    of_log, columns = options.source != "sim" and "://" not in options.source, columns_of(options)
    if columns != ColumnSpec() and not of_log and options.tare is None:
        raise UsageError("--columns and its companions are for logs, but neither SOURCE nor --tare is one")
    log, tare = read_logs(options, arm, options.source if of_log and options.tare is not None else None, options.tare)
    if log is not None and tare is not None:
        check_own_measurements(log, tare)
    speed = 1.0 if options.speed is _UNSAID else options.speed
    # the page takes time from its own process: what runs on the clock is read in another one
    detached = True if not options.headless and speed is not None and speed <= 1.0 else None
    written = options.record or ""
    mcap = written if written.lower().endswith(".mcap") else None  # with the answers, too
    source = open_source(
        options.source,
        arm,
        record=None if mcap else options.record,
        detached=detached,
        speed=speed,
        loop=options.loop,
        topic=options.topic,
        columns=columns_for(options, options.source, options.tare, False) if of_log else None,
    )
    if isinstance(source, Detached) and "://" in options.source:
        source = _reopened(source, options, arm, None if mcap else options.record)
    began = time.time() if "://" in options.source else None if log is None else log.date
    age, aged = age_of(tare, began, options.tare_age)
    for note in aged:
        _warn(note)
    with notes_aside(), Steadied(source) if options.steady else source as source:
        recorder = Recorder(mcap, arm.n, arm, source.epoch) if mcap else None
        more = {"known": known, "recorder": recorder, "tare_age": age}
        session = Session(source, arm, tare, options.method, _warn, profile, **more)
        try:
            if not options.headless:
                return _serve(session, options)
            for line in lines(session, 0.1 if options.every is None else options.every, options.duration):
                print(line, flush=True)
            return None
        finally:
            session.close()
            if options.learn and options.profile is not None and session.error is None:
                learn_from(session, options.profile)


def without_effect(options: argparse.Namespace) -> list[str]:
    """What is to be said of options that change nothing: whoever gave one believes that it does."""
    robot, sim, out = "://" in options.source, options.source == "sim", []
    for name in ("host", "port", "token_file") if options.headless else ("every",):
        if getattr(options, name) is not None:
            what = "of the page, which --headless has none of" if options.headless else "of --headless, not of the page"
            out.append(f"--{name.replace('_', '-')} is {what}: it changes nothing")
    if options.loop and (robot or sim):
        out.append(f"--loop replays a log again and again, but {options.source} is none: it changes nothing")
    if options.topic is not None and options.tare is None and (robot or sim):
        out.append(f"--topic is of a bag, and {options.source} is none: it changes nothing")
    if robot and options.speed is not _UNSAID:
        out.append(f"--speed is of a log or the simulator, but the source is {options.source}: it changes nothing")
    return out


def _reopened(first: Detached, options: argparse.Namespace, arm: Arm, kept: str | None) -> Reconnecting:
    """A robot that is opened again when it is lost; each connection has a record of its own."""
    from armload.devices import Detached
    from armload.devices.recorder import next_free
    from armload.service import Reconnecting

    def opens() -> Detached:
        record = None if kept is None else next_free(kept)
        return Detached(options.source, arm, record=record)

    return Reconnecting(opens, first, _warn)


def _arm_of(options: argparse.Namespace) -> Arm:
    """The arm, with the tool that is mounted if one is known."""
    arm = arm_of(options)
    if options.tool is None:
        return arm
    if options.profile is not None:
        raise UsageError(
            "--tool and --profile together are for a log (armload identify), which finds out whether the tool was "
            "mounted in the profile's logs: on a live robot give one of them"
        )
    if options.tare is not None:
        raise UsageError(
            "--tool and --tare together are for a log (armload identify), which finds out whether the tool was mounted "
            "at the tare: on a live robot give one of them; with a tare, the answer is what was added since"
        )
    from armload.identification import with_tool

    return with_tool(arm, payload_named(options.tool, arm))


def _warn(text: str) -> None:
    print_note(f"warning: {text}")


def _serve(session, options: argparse.Namespace) -> int | None:
    from armload.app.page.page import Page
    from armload.service.access import read_token

    token = None if options.token_file is None else read_token(options.token_file)
    page = None
    try:
        with held_back():  # what the page loads catches every exception: a Ctrl-C would be lost
            page = Page(
                session, options.host or "127.0.0.1", 8080 if options.port is None else options.port, token=token
            )
        session.start(options.duration)
        print_note(f"{session.source.name}: {page.url} (Ctrl-C ends it)")
        page.serve()
    except KeyboardInterrupt:  # the only way to end it
        if session.error is not None and not isinstance(session.error, (ArmloadError, OSError)):
            raise session.error from None  # a bug: whoever wants to see where asks for it
        return 0 if session.error is None else 2  # reported when it happened
    finally:
        if page is not None:
            page.close()

"""`armload serve`: identify payloads on robots for months, with a process for each, alarms and an endpoint."""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from armload.app.cli.arguments import (
    add_arm_arguments,
    add_identifier_arguments,
    add_tare_age_argument,
    add_tool_argument,
    at_least,
    check_tare_age,
    file_name,
    output_folder,
)
from armload.app.cli.aside import Aside
from armload.app.cli.named import robot_of
from armload.app.cli.parser import Parser
from armload.app.cli.printing import drop_unwritten, notes_aside, print_note
from armload.errors import UsageError

if TYPE_CHECKING:
    from armload.service import ServiceSettings

_EXAMPLES = """\
examples:
  armload serve cell.toml
  armload serve fr3://172.16.0.2 --save /var/lib/armload --port 8090
  armload serve sim --duration 20

cell.toml names arms as [[arm]] tables; docs/service.md has an example. Options of this line take the place of what the
file says of the service. Lines of JSON come on stdout, what happens on stderr. SIGTERM, or its terminal that is
closed, saves and ends it.
"""


_HERE = "127.0.0.1"  # where an endpoint without a host listens


def parser() -> Parser:
    """The arguments of `armload serve`."""
    parser = Parser(
        prog="armload serve",
        description="Identify payloads on one or several robots for months: reconnects, keeps its state, alarms.",
        epilog=_EXAMPLES,
    )
    add = parser.add_argument
    add(
        "sources",
        nargs="+",
        type=file_name,
        metavar="CONFIG.toml|SOURCE",
        help="a file that names the arms, or sources of one kind of arm: sim, a log, or a robot's address",
    )
    add_arm_arguments(parser, required=False)
    add_identifier_arguments(parser)
    add_tare_age_argument(parser)
    add_tool_argument(parser)
    add("--save", type=output_folder, metavar="DIR", help="keep the state in this folder, every minute")
    add("--loop", action="store_true", help="replay a log again and again")
    add("--every", type=at_least(0.0, float), metavar="S", help="seconds between lines of an arm (default: 0.1)")
    add(
        "--apply",
        choices=("auto",),
        help="tell the robot's controller what is identified, at standstill, in small steps (fr3://, panda://, ur://)",
    )
    add(
        "--mounted",
        type=file_name,
        metavar="FILE|nothing",
        help="what was on the flange at the tare, which the controller must count, too",
    )
    add("--quiet", action="store_true", help="no lines on stdout but alarms")
    add("--host", metavar="H", help="interface of the endpoint (default: 127.0.0.1); others need --token-file")
    add(
        "--port",
        type=at_least(0, int, 65535),
        metavar="P",
        help="of the endpoint (default: there is none; 0: a free one)",
    )
    add("--token-file", type=file_name, metavar="F", help="holds the token that requests must bring")
    add("--webhook", metavar="URL", help="alarms are posted to it")
    add("--mqtt", metavar="URL", help="a broker that alarms are sent to: mqtt://HOST:1883/PREFIX, mqtts://…")
    add("--duration", type=at_least(0.0, float), metavar="S", help="end after so many seconds")
    return parser


def run(options: argparse.Namespace) -> int | None:
    """Serve until all sources end, or until SIGTERM; 2 where an arm cannot be begun with."""
    from armload.service.beginning import checked

    settings = settings_of(options)
    checked(settings)
    with notes_aside():
        _serve(settings, options.quiet)
    return None


def _serve(settings: ServiceSettings, quiet: bool) -> None:
    from armload.service import Endpoint, Service

    service = Service(settings, print_note)
    output, endpoint = _Output(quiet, service.stop), None
    ends = [signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # else it is to outlive its terminal (nohup)
        ends.append(signal.SIGHUP)
    for number in ends:
        signal.signal(number, lambda *_: threading.Thread(target=service.stop, daemon=True).start())
    try:
        with service.heard_by(output.put):
            if settings.port is not None:
                endpoint = Endpoint(service, settings.host or _HERE, settings.port, settings.token)
                count = len(settings.arms)
                print_note(f"{count} arm{'s' if count > 1 else ''}: {endpoint.url}/arms")
            service.run(settings.duration)
    finally:
        if endpoint is not None:
            endpoint.close()
        service.close()
        output.close()
    if output.broken:
        raise BrokenPipeError
    if service.error is not None:
        raise UsageError(service.error)


def settings_of(options: argparse.Namespace) -> ServiceSettings:
    """What a command line asks for."""
    from armload.service import ArmSettings, ServiceSettings, read_settings
    from armload.service.access import read_token

    names = ("every", "host", "port", "webhook", "mqtt", "duration")
    over: dict[str, Any] = {name: value for name in names if (value := getattr(options, name)) is not None}
    if options.token_file is not None:
        over["token"] = read_token(options.token_file)
    of_arms = ("frame", "gravity", "tare", "tare_age", "profile", "tool", "method")
    if options.sources[0].endswith(".toml"):
        given = [name for name in ("robot", *of_arms, "apply", "mounted") if getattr(options, name) is not None]
        if given or len(options.sources) > 1 or options.loop:
            what = f"--{given[0].replace('_', '-')}" if given else "--loop" if options.loop else options.sources[1]
            raise UsageError(f"{options.sources[0]} names the arms, but there is also {what}: write it into the file")
        settings = read_settings(options.sources[0], **over)
        if options.save is None:
            return settings
        return replace(settings, arms=tuple(replace(arm, save=options.save) for arm in settings.arms))
    check_tare_age(options)
    more = {name: getattr(options, name) for name in (*of_arms, "save", "loop", "apply", "mounted")}
    arms = []
    for k, source in enumerate(options.sources):
        robot = options.robot or robot_of(source)
        arms.append(ArmSettings(robot, name=f"arm{k + 1}", source=source, **more))
    return ServiceSettings(tuple(arms), **over)


class _Output:
    """Lines on stdout: while they cannot be written they are lost, and the service goes on.

    Args:
        alarms_only: other lines are left out. stop: called when nobody reads any more.

    Attributes:
        broken: whether that is so.
    """

    def __init__(self, alarms_only: bool, stop: Callable[[], None]) -> None:
        self.broken = False
        self._alarms_only, self._stop = alarms_only, stop
        self._failed: str | None = None  # why the last line could not be written
        self._lines = Aside(self._write)

    def put(self, line: dict[str, Any]) -> None:
        if "alarm" in line or not self._alarms_only:
            self._lines.put(line)

    def close(self) -> None:
        self._lines.close(2.0)
        if self._failed is not None:
            drop_unwritten()  # said already, and no error of the service

    def _write(self, line: dict[str, Any]) -> None:
        if self.broken:
            return
        try:
            sys.stdout.write(json.dumps(line, allow_nan=False) + "\n")
            sys.stdout.flush()
            failed = None
        except BrokenPipeError:
            self.broken = True
            self._stop()
            return
        except OSError as error:  # a full disk: what reads the endpoint, and alarms, go on
            failed = error.strerror or str(error)
        if failed != self._failed:
            print_note("lines are written again" if failed is None else f"lines cannot be written: {failed}")
        self._failed = failed

"""From an argument list to an exit code: which command runs, and how each error is reported.

| exit code | what happened                                             | stdout     | stderr                        |
|-----------|-----------------------------------------------------------|------------|-------------------------------|
| 0         | done                                                      | the answer | notes                         |
| 1         | a bug in armload                                          |            | one line, with a hint         |
| 2         | the input or the usage is wrong                           | empty      | one sentence that names where |
| 3         | `motion check`: the arm may not run it, a limit is passed | the answer | notes                         |
| 130       | interrupted: by Ctrl-C, SIGTERM or a closed terminal      |            | one line                      |
| 141       | nobody reads the output any more (`armload … | head -1`)  |            | nothing                       |

Each command is a module of this package with `parser()` and `run(arguments)`; it is imported when it is asked for, and
imports what it needs when it runs, so that `armload --help` costs nothing.
"""

from __future__ import annotations

import _thread
import argparse
import difflib
import importlib
import logging
import os
import sys
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NoReturn

from armload.app.cli.outputs import check_outputs
from armload.app.cli.parser import Parser, attach_values
from armload.app.cli.printing import drop_unwritten, on_one_line, print_note
from armload.errors import ArmloadError, UsageError
from armload.runtime.extras import missing
from armload.runtime.interruption import ended_by_hangup, ended_by_sigterm
from armload.runtime.version import __version__

COMMANDS = {
    "demo": "the main job from end to end, in under three minutes: simulate, train, identify, compare, report",
    "dataset": "build a data set of simulated runs: the paper's table of position, velocity, torque and payload",
    "train": "train the hybrid for an arm, or an ensemble of trees or networks on a data set",
    "identify": "tell from a log what the robot holds: mass, centre of mass, inertia, with 95 % intervals",
    "profile": "learn an arm from its logs, of many days: a tare that outlives the day; or show what is known of it",
    "survey": "tell of thousands of logs, of many arms, what was held, when, how heavy, and which arm drifts",
    "measure": "move the robot, without and with the payload, and identify it: the whole procedure in one command",
    "live": "identify while the robot runs, or a simulated one, or a log: a page in the browser, or lines of JSON",
    "serve": "identify payloads on robots for months: reconnects, keeps its state, alarms, an endpoint; several arms",
    "export": "write what was identified in a controller's or simulator's form: Franka, UR, URDF, MJCF, SDF, ROS 2",
    "methods": "list the methods of identification: when to use each, its source, and what is left out",
    "report": "write an HTML report: figures of the log and of every method's estimate over time",
    "benchmark": "measure every method on every population: errors over time, intervals, repeatability",
    "reproduce": "run the paper's study again and put a verdict beside each of its claims",
    "ros2": "ROS 2: joint states in and the payload out; or a simulated robot that takes trajectories",
    "motion": "design, draw, show, check or export an excitation motion; enrich a task's own path",
}
_EXAMPLES = """\
examples:
  armload demo
  armload identify run.csv --robot panda
  armload identify run.csv --robot ur10e --tare empty.csv --json
  armload motion check taie2024 --robot panda

`armload COMMAND --help` says more. ARMLOAD_TRACEBACK=1 (or --traceback) shows where an error came from.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return the exit code.

    Args:
        argv: the arguments after the program's name; None: those of this process.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    show_traceback = os.environ.get("ARMLOAD_TRACEBACK", "") not in ("", "0")
    if "--traceback" in arguments:
        arguments.remove("--traceback")
        show_traceback = True
    # closed by the parent process: there is no input, and output is dropped. In this order each takes its own
    # descriptor, and no pipe to another process gets one of them
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if not hasattr(stream, "reconfigure"):
            continue
        if (stream.encoding or "").lower().replace("-", "") != "utf8":
            stream.reconfigure(errors="replace")  # a terminal that cannot show "m²" still gets the answer
        elif stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")  # nor does a file's name that is no UTF-8 stop it
    with warnings.catch_warnings(), _notes_on_stderr(), _no_interruption_lost(), ended_by_hangup(), ended_by_sigterm():
        warnings.showwarning = _show_warning
        code = _guarded(arguments, show_traceback)
    drop_unwritten()  # reported already; the interpreter flushes once more when it ends
    return code


def _guarded(arguments: list[str], show_traceback: bool) -> int:
    """Run the command and report its error, if there is one."""
    try:
        try:
            code = _run(arguments)
        except SystemExit as stop:  # argparse ends `--help` and `--version` so
            code = stop.code if isinstance(stop.code, int) else 0
        except Exception as error:
            if _interrupted(error):
                raise KeyboardInterrupt from error
            raise
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return _fail("interrupted", 130, show_traceback)
    except BrokenPipeError:
        return 141
    except ArmloadError as error:
        return _fail(str(error), 2, show_traceback)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _fail(f"{where}{error.strerror or error}", 2, show_traceback)
    except MemoryError as error:  # what was asked for is too large for this machine, which is no bug
        return _fail(f"too little memory: {str(error) or 'no more can be had'}", 2, show_traceback)
    except ModuleNotFoundError as error:
        needed = missing(error)
        return _bug(error, show_traceback) if needed is None else _fail(needed, 2, show_traceback)
    except Exception as error:
        return _bug(error, show_traceback)


def _bug(error: Exception, show_traceback: bool) -> int:
    hint = "" if show_traceback else "; this is a bug: set ARMLOAD_TRACEBACK=1 (or --traceback) to see where"
    return _fail(f"{type(error).__name__}: {str(error) or 'no message'}{hint}", 1, show_traceback)


def _interrupted(error: BaseException | None) -> bool:
    """Whether an error is what others made of a Ctrl-C: compiled code and compilers answer it with their own."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        if isinstance(error, KeyboardInterrupt):
            return True
        seen.add(id(error))
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return False


class _Notes(logging.Handler):
    """What the library logs, each record as one line on stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        print_note(record.getMessage())


@contextmanager
def _notes_on_stderr() -> Iterator[None]:
    """Show what takes long, as `armload.runtime.kernels` says of compiling."""
    logger, handler = logging.getLogger("armload"), _Notes()
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


@contextmanager
def _no_interruption_lost() -> Iterator[None]:
    """A Ctrl-C that falls into a destructor or a callback of compiled code, as while numba compiles, comes again.

    Python prints such an exception and goes on as if nothing had been.
    """
    before = sys.unraisablehook

    def hook(unraisable: sys.UnraisableHookArgs) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            _thread.start_new_thread(again, ())
        else:
            before(unraisable)

    def again() -> None:
        time.sleep(0.01)  # until the hook has returned: within it the interruption would be lost again
        _thread.interrupt_main()

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


def _run(arguments: list[str]) -> int:
    if not arguments:
        raise UsageError(f"no command: expected one of {', '.join(COMMANDS)}; see 'armload --help'")
    command = arguments[0]
    if command.startswith("-"):
        _overview().parse_args(arguments)
        raise UsageError(f"no command before {command}: expected one of {', '.join(COMMANDS)}; see 'armload --help'")
    if command not in COMMANDS:
        near = difflib.get_close_matches(command, COMMANDS, 1)
        raise UsageError(
            f"unknown command {command!r}: expected one of {', '.join(COMMANDS)}"
            + (f"; did you mean {near[0]!r}?" if near else "; see 'armload --help'")
        )
    module = importlib.import_module(f"armload.app.cli.{command}")
    options = module.parser().parse_args(attach_values(arguments[1:]))
    check_outputs(options)
    return module.run(options) or 0


class _Version(argparse.Action):
    """Print the version and end; argparse's own hides that it cannot be written."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        print(f"armload {__version__}")
        parser.exit()


def _overview() -> Parser:
    width = max(map(len, COMMANDS))
    commands = "\n".join(f"  {name:<{width}}  {text}" for name, text in COMMANDS.items())
    parser = Parser(
        prog="armload",
        usage="armload COMMAND …",
        description="Tell a robot arm what it is holding, from joint position, velocity and torque.\n\n"
        f"commands:\n{commands}",
        epilog=_EXAMPLES,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show armload's version and exit")
    return parser


def _fail(message: str, code: int, show_traceback: bool) -> int:
    if show_traceback:
        traceback.print_exc()
    print_note(message)
    return code


def _show_warning(message, category, filename, lineno, file=None, line=None) -> None:  # noqa: ARG001
    print(f"armload: warning: {on_one_line(str(message))}", file=file or sys.stderr)

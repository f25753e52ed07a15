"""Motions as JSON files, readable by a person and by any program.

A file without a "kind" holds every number of equations (5) and (6); one of the kind "b-spline" start and control points
of a `SplineMotion`, one of the kind "path" the points of a `PathMotion`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armload.errors import MotionError
from armload.motion.as_written import not_too_long, numbers
from armload.motion.fourier import FourierMotion
from armload.motion.motion import Motion
from armload.runtime.atomic import replacing

if TYPE_CHECKING:
    from armload.motion.path import PathMotion
    from armload.motion.spline import SplineMotion

FORMAT = "armload-motion-1"
_TRAJECTORY = "it is a JointTrajectory, for controllers; `motion enrich` reads it, and writes .json and .csv, too"
_SPLINE, _PATH = "b-spline", "path"


def taie2024() -> FourierMotion:
    """The excitation with the form of Taie et al. 2024 for the Panda: 8 harmonics, T = 6 s. Our own re-design.

    The paper adopts the trajectory of its reference [7] (Kurdas et al., ICRA 2022) and gives neither of the two
    numbers, which are those of [7] as far as it is public. Its coefficients are published nowhere; these are ours,
    found by `python -m armload.motion.design`.

    >>> motion = taie2024()
    >>> motion.n, motion.harmonics, motion.duration
    (7, 8, 6.0)
    """
    return shipped_motion("taie2024")


def shipped_motion(name: str) -> FourierMotion:
    """A motion that comes with armload, by name."""
    text = resources.files("armload.motion").joinpath(f"motions/{name}.json").read_text(encoding="utf-8")
    return _fourier(_content(text, f"{name}.json"))


def load_motion(path: str | Path) -> FourierMotion | SplineMotion | PathMotion:
    """The motion in a JSON file written by `save_motion`.

    Raises:
        MotionError: the file is missing, not JSON, not a motion, or one of more than an hour; one sentence that names
            it.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise MotionError(
            f"motion file {path} does not exist: give one that `armload motion design` or `random` wrote"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise MotionError(f"motion file {path} cannot be read: {reason}") from None
    return _made(_content(text, str(path)), str(path))


def save_motion(path: str | Path, motion: Motion) -> None:
    """Write a motion as JSON, complete or not at all; `load_motion` gives exactly the same motion back.

    Raises:
        MotionError: the motion has no coefficients to save, or the file cannot be written.
    """
    save_motions([(path, motion)])


def save_motions(motions: Iterable[tuple[str | Path, Motion]]) -> None:
    """Write motions that belong together, as of `save_motion`: the first takes its place when all are written.

    Args:
        motions: each with its file.

    Raises:
        MotionError: as of `save_motion`; then all files are as they were.
    """
    write_whole([(path, motion_to_json(motion)) for path, motion in motions])


def motion_to_json(motion: Motion) -> str:
    """The JSON text of a Fourier or spline motion, one joint per line, or of a path, one point per line."""
    from armload.motion.path import PathMotion
    from armload.motion.spline import SplineMotion

    if isinstance(motion, FourierMotion):
        head = {"format": FORMAT, "name": motion.name, "note": motion.note, "period": motion.period}
        parts = {"offset": motion.offset, "sine": motion.sine, "cosine": motion.cosine}
    elif isinstance(motion, SplineMotion):
        head = {
            "format": FORMAT,
            "kind": _SPLINE,
            "name": motion.name,
            "note": motion.note,
            "duration": motion.duration,
        }
        parts = {"start": motion.start, "control": motion.control}
    elif isinstance(motion, PathMotion):
        head = {"format": FORMAT, "kind": _PATH, "name": motion.name, "note": motion.note}
        points = {"positions": motion.positions, "velocities": motion.velocities, "accelerations": motion.accelerations}
        parts = {"times": motion.times, **points}
    else:
        raise MotionError(
            f"the motion {motion.name!r} is a {type(motion).__name__}: only a FourierMotion, a SplineMotion or a "
            "PathMotion can be saved as JSON; use export_motion for a table"
        )
    lines = [f"  {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in head.items()]
    for key, values in parts.items():
        rows = ",\n".join(f"    {json.dumps(row)}" for row in values.tolist()) if values.ndim == 2 else ""
        lines.append(f'  "{key}": ' + (f"[\n{rows}\n  ]" if rows else json.dumps(values.tolist())))
    return "{\n" + ",\n".join(lines) + "\n}\n"


def write_whole(texts: Iterable[tuple[str | Path, str]]) -> None:
    """Write text files, complete and all of them, or none; MotionError if one cannot be written."""
    try:
        with ExitStack() as stack:
            for path, text in texts:
                temporary = stack.enter_context(replacing(path))
                temporary.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise MotionError(f"{error.filename} cannot be written: {error.strerror}") from None


def _content(text: str, where: str) -> dict[str, Any]:
    try:
        content: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        what = _TRAJECTORY if "joint_names:" in text else f"it is not JSON ({error})"
        raise MotionError(f"{where} is not a motion: {what}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        trajectory = isinstance(content, dict) and "joint_names" in content
        what = _TRAJECTORY if trajectory else f'expected a JSON object with "format": "{FORMAT}"'
        raise MotionError(f"{where} is not a motion: {what}")
    if "kind" in content and content["kind"] not in (_SPLINE, _PATH):
        raise MotionError(
            f'{where} is a motion of the kind {content["kind"]!r}: expected "{_SPLINE}", "{_PATH}", or no kind'
        )
    return content


def _fourier(content: dict[str, Any]) -> FourierMotion:
    offset, sine, cosine, period = _numbers(content, "offset", "sine", "cosine", "period")
    return FourierMotion(offset, sine, cosine, float(period), *_called(content))


def _spline(content: dict[str, Any]) -> SplineMotion:
    from armload.motion.spline import SplineMotion

    start, control, duration = _numbers(content, "start", "control", "duration")
    return SplineMotion(start, control, float(duration), *_called(content))


def _path(content: dict[str, Any]) -> PathMotion:
    from armload.motion.path import PathMotion

    times, q, dq, ddq = _numbers(content, "times", "positions", "velocities", "accelerations")
    return PathMotion(times, q, dq, ddq, *_called(content))


def _numbers(content: dict[str, Any], *keys: str) -> list[Any]:
    return [numbers(content[key], key) for key in keys]


def _called(content: dict[str, Any]) -> tuple[str, str]:
    return str(content["name"]), str(content.get("note", ""))


# of each kind of motion: what makes it of a file's content, and what that has to be
_KINDS: dict[str | None, tuple[Callable[[dict[str, Any]], Any], str]] = {
    None: (_fourier, "period must be a number of seconds, offset n numbers, sine and cosine n rows of K numbers each"),
    _SPLINE: (_spline, "duration must be a number of seconds, start n numbers, control n rows of K numbers each"),
    _PATH: (_path, "times must be K numbers, positions, velocities and accelerations K rows of n"),
}


def _made(content: dict[str, Any], where: str) -> FourierMotion | SplineMotion | PathMotion:
    make, expected = _KINDS[content.get("kind")]
    try:
        return not_too_long(make(content))
    except KeyError as error:
        raise MotionError(f"{where} is not a complete motion: the key {error} is missing") from None
    except MotionError as error:
        raise MotionError(f"{where}: {error}") from None
    except (TypeError, ValueError, OverflowError):
        raise MotionError(f"{where} is not a motion: {expected}") from None

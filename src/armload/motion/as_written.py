"""What a file says of a motion, as it is written: numbers that are some, and a time that can be looked through."""

from __future__ import annotations

import json
from typing import Any, TypeVar

from armload.errors import MotionError
from armload.motion.motion import Motion

# [s] of a motion that is read from a file or drawn: a check of an hour looks at 720 000 instants, for one and a half
# minutes; of eleven days (1e6 s) it needs 100 GB
LONGEST = 3600.0

_Read = TypeVar("_Read", bound=Motion)


def numbers(value: Any, what: str) -> Any:
    """The value, which is a number or lists of them, however nested: a text that could be read as one is none.

    Args:
        value: as JSON and YAML give it. what: what a sentence calls it.

    Raises:
        MotionError: it holds anything else.
    """
    waiting = [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, list):
            waiting.extend(reversed(one))
        elif type(one) not in (int, float):
            raise MotionError(f"{what} holds {shown(one)}: expected nothing but numbers")
    return value


def shown(value: Any) -> str:
    """A value as its file has it, in short.

    >>> shown("2"), shown(None), shown(True)
    ('"2"', 'null', 'true')
    """
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 40 else f"{text[:37]}…"


def not_too_long(motion: _Read) -> _Read:
    """The motion, which lasts an hour at most.

    Raises:
        MotionError: it lasts longer.
    """
    if motion.duration > LONGEST:
        raise MotionError(
            f"the motion {motion.name!r} lasts {motion.duration:g} s: expected {LONGEST:g} s at most; are these ms?"
        )
    return motion

"""What is known of a payload as options, settings and parameters say it: in texts, and by the path of a file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from armload.errors import IdentificationError

if TYPE_CHECKING:
    from armload.arms import Arm
    from armload.posterior import Known

_BETWEEN = re.compile("±|\\+/?-")  # a value and its standard deviation
# what somebody may know of a payload; the learned prior has parts beside them that are nobody's knowledge
FAMILIES = ("boxes", "shapes", "tools", "container", "wide", "light")


@dataclass(frozen=True, kw_only=True)
class KnownOptions:
    """What is known of what an arm holds, whenever it holds it.

    mass: where it was weighed, such as "1.200±0.002" [kg]. com: its centre, such as "0,0,0.060±0.002" [m].
    body: path of the file of all of it, with how well that is known. family: what kind it is of, or several, by the
    names of the learned prior, such as "wide,boxes".
    """

    mass: str | None = None
    com: str | None = None
    body: str | None = None
    family: str | None = None

    def known_on(self, arm: Arm) -> Known | None:
        """What is known on an arm, of a stream that goes on without it; None: nothing.

        Raises:
            IdentificationError: a text that cannot be understood, or what no log of this arm can bear.
            PayloadError: the file is missing or none.
        """
        from armload.identification.one_payload import known_of, plausible_known  # slow to load, and seldom needed
        from armload.payloads import read_payload

        mass = None if self.mass is None else weighed(self.mass)
        com = None if self.com is None else centre(self.com)
        body = None if self.body is None else read_payload(self.body)
        return plausible_known(known_of(arm, mass, com, body, families(self.family), if_held=True), arm)


def weighed(text: str) -> tuple[float, float]:
    """A mass and its standard deviation [kg].

    >>> weighed("1.2±0.002"), weighed("0.5+-0.01")
    ((1.2, 0.002), (0.5, 0.01))

    Raises:
        IdentificationError: the text is no such thing.
    """
    try:
        mass, std = (float(part) for part in _BETWEEN.split(text))
    except ValueError:
        raise IdentificationError(
            f"{text!r} is not a weighed mass: expected kilograms and their standard deviation, such as 1.200±0.002 "
            "(or 1.200+-0.002)"
        ) from None
    if mass <= 0.0:
        raise IdentificationError(
            f"{text!r} is a mass of {mass:g} kg: expected one above zero; leave it out where nothing was weighed"
        )
    return mass, std


def centre(text: str) -> tuple[tuple[float, ...], float]:
    """A centre of mass and its standard deviation along each axis [m].

    >>> centre("0,-0.012,0.06±0.002"), centre("0,0,0.1+-0.01")
    (((0.0, -0.012, 0.06), 0.002), ((0.0, 0.0, 0.1), 0.01))

    Raises:
        IdentificationError: the text is no such thing.
    """
    try:
        place, spread = _BETWEEN.split(text)
        com, std = tuple(float(part) for part in place.split(",")), float(spread)
    except ValueError:
        com, std = (), 0.0
    if len(com) != 3:
        raise IdentificationError(
            f"{text!r} is not a centre of mass: expected x,y,z in metres and their standard deviation, such as "
            "0,0,0.060±0.002 (or 0,0,0.060+-0.002)"
        )
    return com, std


def families(given: str | Sequence[str] | None) -> tuple[str, ...]:
    """Names of families, as a text or one by one.

    >>> families("wide, boxes"), families(["wide"]), families(None)
    (('wide', 'boxes'), ('wide',), ())

    Raises:
        IdentificationError: no family is called so.
    """
    names = given.split(",") if isinstance(given, str) else () if given is None else given
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise IdentificationError(f"the family is {given!r}: expected some of {', '.join(FAMILIES)}, as texts")
    names = tuple(name.strip() for name in names)
    stray = sorted(set(names) - set(FAMILIES))
    if stray:
        raise IdentificationError(
            f"no family is called {', '.join(stray) if all(stray) else repr(given)}: expected some of "
            f"{', '.join(FAMILIES)}, separated by commas; where none is known, leave it out"
        )
    return names

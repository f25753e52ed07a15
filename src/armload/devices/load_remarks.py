"""What a load's reader should know beside its numbers, a line each, in every form that it is written in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armload.inertia import NAMES, Z95, InertialParameters, inertia_com_std

if TYPE_CHECKING:
    from armload.payloads import Payload

_MOMENTS = (4, 7, 9)  # places of Ixx, Iyy, Izz
_LEANING = "rests on what payloads are usually like more than on the log"
HARDLY_KNOWN = "moments of inertia uncertain by more than half of their value"
_AXES = ", in the axes of "
_APPROXIMATE = "the intervals of what was identified are approximate, not calibrated"
NOTHING_HELD = "nothing seems to be held: the mass is within three standard deviations of zero"


def assumed(payload: Payload) -> tuple[str, ...]:
    """A remark on a payload whose inertia is not known."""
    from armload.payloads import INERTIA_ASSUMED

    return () if payload.inertia_known else (INERTIA_ASSUMED,)


def beside(own: tuple[str, ...], of_part: tuple[str, ...]) -> tuple[str, ...]:
    """The remarks on a load and on a part that is added or taken off, but on the part's own inertia."""
    from armload.payloads import INERTIA_ASSUMED

    more = [each for each in of_part if each != INERTIA_ASSUMED and not each.startswith(HARDLY_KNOWN)]
    return tuple(dict.fromkeys((*own, *more)))


def without_moments(remark: str) -> str:
    """A remark without the moments of inertia that it names; empty: it is of nothing else."""
    from armload.payloads import INERTIA_ASSUMED

    said, _, rest = remark.partition(": ")
    if said not in (_LEANING, HARDLY_KNOWN):
        return "" if remark == INERTIA_ASSUMED else remark
    names, axes, frame = rest.partition(_AXES)
    left = [name for name in names.split(", ") if name[0] != "I"]
    return f"{said}: {', '.join(left)}{axes}{frame}" if left else ""


def of_axes(remark: str, frame: str) -> str:
    """A remark on a load that was turned: the parameters that it names are in the axes of another frame."""
    named = remark.partition(": ")[0] in (_LEANING, HARDLY_KNOWN) and _AXES not in remark
    return f"{remark}{_AXES}{frame}" if named else remark


def doubted(interval: Any) -> tuple[str, ...]:
    """A remark on intervals that are not calibrated."""
    return (_APPROXIMATE,) if interval == "approximate" else ()


def of_a_part(parts: Any) -> tuple[str, ...]:
    """A remark on what was held at the end of a log only. parts: of the log, with a payload each."""
    if not isinstance(parts, list | tuple) or len(parts) < 2:
        return ()
    return (f"the payload changed within the log: this is the last of {len(parts)}, held at the end",)


def leaning(determined: Sequence[bool], rests_on_prior: Sequence[bool]) -> tuple[str, ...]:
    """A remark on parameters that the log determines, though less than what payloads are usually like does."""
    names = [n for n, known, prior in zip(NAMES, determined, rests_on_prior, strict=True) if known and prior]
    return (f"{_LEANING}: {', '.join(names)}",) if names else ()


def loose(value: NDArray, widths: NDArray | None, known: Sequence[bool]) -> tuple[str, ...]:
    """A remark on moments of inertia about the centre of mass (3,) that are hardly known, though determined.

    Hardly: the interval is wider than the value, which a controller takes for exact.
    """
    which = widths is not None and np.shape(value) == np.shape(widths) == (3,) and (widths > value)
    names = [NAMES[k] for k, hardly in zip(_MOMENTS, np.broadcast_to(which, 3), strict=True) if hardly and known[k]]
    return (f"{HARDLY_KNOWN}: {', '.join(names)}",) if names else ()


def loose_of(body: InertialParameters, covariance: NDArray, known: Sequence[bool]) -> tuple[str, ...]:
    """The same of a body whose phi has a covariance (10, 10): to first order, about its own centre of mass."""
    if not body.mass > 0.0:
        return ()
    moments = [0, 3, 5]  # of xx, xy, xz, yy, yz, zz
    return loose(np.diag(body.inertia_com), 2.0 * Z95 * inertia_com_std(body.phi, covariance)[moments], known)

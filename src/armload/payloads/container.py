"""The paper's slotted container (Taie et al., RA-L 2024, Section IV) and the loadings it is trained with.

From the paper: 0.790 kg empty, 2.163 kg with 5 weights, slots at +X, −X, +Y and −Y, a top and a bottom position in
each, 77 loadings with 0 to 5 weights. Our choices, where the paper is silent or disagrees with itself:

- a weight is 0.2746 kg: the paper's 0.275 kg rounds it, and five of them make the stated 2.163 kg exactly;
- two positions a slot, which the paper's rule is written for, not the "3 metal weights" a slot can also hold;
- every length below: a container 20 cm wide and 10.6 cm high, its floor on the flange, slots 7 cm off its axis. "Top"
  is the position far from the flange, so that r_z grows with the number of weights at the top;
- the weights are steel plates, 40 × 40 × 21.9 mm; the container is of one plastic (0.790 kg make it 1 226 kg/m³).

Slots on the axes have a consequence worth knowing: I_xy is 0 for every loading. The container's frame is the arm's
payload frame, whatever its name (`frame` is None).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from importlib import resources

import numpy as np

from armload.errors import PayloadError
from armload.inertia import InertialParameters
from armload.payloads.payload import Box, Payload
from armload.payloads.solids import compose

EMPTY_MASS = 0.790  # [kg] paper
WEIGHT_MASS = 0.2746  # [kg] (2.163 − 0.790)/5, paper
WEIGHT_SIZE = (0.040, 0.040, 0.0219)  # [m] ours
SLOT_OFFSET = 0.070  # [m] ours: from the container's axis to a slot's
BOTTOM, TOP = 0.020, 0.080  # [m] ours: height of a weight's centre above the flange
SLOTS = {"+X": (1, 0), "-X": (-1, 0), "+Y": (0, 1), "-Y": (0, -1)}
# The eight places a weight can take, in the order of the digits of a loading.
POSITIONS = tuple(f"{slot} {level}" for slot in SLOTS for level in ("bottom", "top"))

# The empty container [m], ours: floor, hub in the middle, four square tubes.
_WIDTH, _FLOOR, _HEIGHT = 0.200, 0.006, 0.100
_HUB = 0.048
_TUBE, _WALL = 0.041, 0.0025  # inner width, thickness of the walls


def container(loading: str = "00000000", name: str | None = None) -> Payload:
    """The container with a weight of 0.2746 kg at every position whose digit is 1.

    >>> round(container("11000100").parameters.mass, 4)
    1.6138

    Args:
        loading: eight digits 0 or 1, in the order of `POSITIONS`: +X bottom, +X top, −X bottom, ..., −Y top.
        name: what to call it. Default: the positions taken.

    Raises:
        PayloadError: not eight digits 0 or 1.
    """
    if len(loading) != len(POSITIONS) or set(loading) - {"0", "1"}:
        raise PayloadError(f"loading is {loading!r}: expected {len(POSITIONS)} digits 0 or 1 ({', '.join(POSITIONS)})")
    taken = [position for position, digit in zip(POSITIONS, loading, strict=True) if digit == "1"]
    weights = [Box(WEIGHT_SIZE, position_centre(position), WEIGHT_MASS) for position in taken]
    return _filled(name or _name(taken), weights)


def position_centre(position: str) -> tuple[float, float, float]:
    """Where the centre of a weight at one of the `POSITIONS` is in the payload frame [m]."""
    slot, level = position.split()
    x, y = SLOTS[slot]
    return x * SLOT_OFFSET, y * SLOT_OFFSET, TOP if level == "top" else BOTTOM


def container_loadings() -> list[Payload]:
    """The 77 loadings of the data set, by number of weights; see `loadings` for the rule that chose them.

    >>> len(container_loadings()), round(container_loadings()[-1].parameters.mass, 3)
    (77, 2.163)
    """
    text = resources.files("armload.payloads").joinpath("container_loadings.json").read_text(encoding="utf-8")
    return [container(loading) for loading in json.loads(text)["loadings"]]


def test_payload() -> Payload:
    """A payload outside the 77, in the role of the paper's Table I (whose numbers are not public): ours.

    The container with three odd weights, 0.360 kg, 0.200 kg and 0.130 kg, at heights between bottom and top and pushed
    5 mm sideways. 1.480 kg lies about halfway between two masses of the data set and its centre of mass 5 mm from the
    nearest of the 77; every parameter lies within the range they span, except I_xy, which is 0 in all of them and small
    here.

    >>> test_payload().parameters.com.round(4).tolist()
    [0.0116, -0.0087, 0.0486]
    """
    weights = [
        Box((0.030, 0.030, 0.051), (0.070, 0.005, 0.070), 0.360),
        Box((0.030, 0.030, 0.028), (0.005, -0.070, 0.045), 0.200),
        Box((0.030, 0.030, 0.018), (-0.070, -0.005, 0.070), 0.130),
    ]
    return _filled("test payload", weights)


test_payload.__test__ = False  # type: ignore[attr-defined]  # or pytest would take an imported one for a test


@cache
def _empty() -> tuple[Box, ...]:
    """The boxes of the empty container, of one density that makes EMPTY_MASS together."""
    middle = _FLOOR + _HEIGHT / 2
    parts = [((_WIDTH, _WIDTH, _FLOOR), (0.0, 0.0, _FLOOR / 2)), ((_HUB, _HUB, _HEIGHT), (0.0, 0.0, middle))]
    reach = (_TUBE + _WALL) / 2  # from a tube's axis to the middle of its wall
    for x, y in SLOTS.values():
        x, y = x * SLOT_OFFSET, y * SLOT_OFFSET
        for side in (-1, 1):
            # walls of +x and −x span the outer width, the other two fit between them
            parts.append(((_WALL, _TUBE + 2 * _WALL, _HEIGHT), (x + side * reach, y, middle)))
            parts.append(((_TUBE, _WALL, _HEIGHT), (x, y + side * reach, middle)))
    density = EMPTY_MASS / sum(float(np.prod(size)) for size, _ in parts)
    return tuple(Box.of_density(size, centre, density) for size, centre in parts)


@cache
def _empty_parameters() -> InertialParameters:
    return compose(part.parameters for part in _empty())


def _filled(name: str, weights: Sequence[Box]) -> Payload:
    parameters = compose((_empty_parameters(), *(weight.parameters for weight in weights)))
    return Payload(name, parameters, (*_empty(), *weights))


def _name(taken: list[str]) -> str:
    if not taken:
        return "container, empty"
    return f"container + {len(taken)} ({', '.join(taken)})"

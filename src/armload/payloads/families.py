"""Random payloads by family, all made of solids and so consistent by construction.

| family      | what                                                                                    |
|-------------|-----------------------------------------------------------------------------------------|
| `boxes`     | one to four boxes of any size and weight, 0.2–2.8 kg together: the reference             |
| `shapes`    | blocks, cylinders, balls, dense lumps, thin plates, long rods, brackets, a full gripper  |
| `tools`     | what is bolted to a flange: grippers, brackets, torches                                  |
| `container` | the paper's container with any filling, by its own rules                                 |
| `nothing`   | no payload                                                                               |
| `odd`       | dumbbells, poles, panes, rings far off the flange's axis: unlike all of the others       |
| `light`     | the `shapes` at 0.3–15 % of the weight and of the same density: a screw, a phone, a box   |
| `wide`      | trays, bars, discs and rings across the flange, carried at their centre                  |

No prior is fitted on `odd`: it tests payloads outside the training families. Figures are those
of an arm rated for 3 kg. For another, masses grow with its rating and lengths with the cube root.
"""

from __future__ import annotations

import numpy as np

from armload.errors import PayloadError
from armload.inertia import InertialParameters
from armload.payloads.container import BOTTOM, POSITIONS, TOP, container, position_centre
from armload.payloads.odd import ODD
from armload.payloads.payload import Box, Payload
from armload.payloads.shapes import SHAPES, TOOLS
from armload.payloads.wide import WIDE

MASS = (0.2, 2.8)  # [kg] of all boxes together
CENTRE_LOW, CENTRE_HIGH = (-0.08, -0.08, 0.0), (0.08, 0.08, 0.16)  # [m] of each box
SIDE = (0.02, 0.12)  # [m]
RATED = 3.0  # [kg] of the arm that all figures are for

_SHAPE_MASS, _TOOL_MASS = (0.1, 2.9), (0.2, 1.8)  # [kg]
_ODD_MASS = (0.45, 3.0)  # [kg] 0.15 to 1 of what the arm is rated for
_LIGHT = (0.003, 0.15)  # of the weight of the shapes
_MOST_WEIGHTS, _HEAVIEST_FILLING = 5, 2.163  # [1, kg] paper
_ODD_WEIGHT = (0.05, 0.36)  # [kg]
_SHIFT = 0.005  # [m] how far an odd weight may lie off its slot's axis


def random_payload(seed: int) -> Payload:
    """One to four boxes with uniform total mass, centres and sides, and a uniformly random division of the mass.

    The same seed gives the same payload. Being made of solids, it can always exist.

    >>> 0.2 <= random_payload(3).parameters.mass <= 2.8
    True
    """
    return _draw(np.random.default_rng(_seed(seed)), f"random {seed}")


def random_payloads(count: int, seed: int) -> list[Payload]:
    """`count` independent random payloads; a longer list of the same seed begins with the shorter one."""
    count = _whole(count, "the count of random payloads")
    return [_draw(np.random.default_rng([_seed(seed), k]), f"random {seed}-{k}") for k in range(count)]


def draw_payload(family: str, seed: int, rated: float = RATED) -> Payload:
    """A random payload of a family, for an arm that is rated for so much [kg].

    The same arguments give the same payload; `boxes` for 3 kg is `random_payload`.

    >>> draw_payload("container", 5).parameters.mass < 2.2
    True

    Raises:
        PayloadError: no such family, a seed that is not a whole number of 0 or more, or a rating not above 0.
    """
    if family not in FAMILIES:
        raise PayloadError(f"no family of payloads is called {family!r}: expected one of {', '.join(FAMILIES)}")
    if not (np.isfinite(rated) and rated > 0):
        raise PayloadError(f"the arm's rated payload is {rated} kg: expected a number above 0")
    name, scale = f"{family} {seed}", rated / RATED
    if family == "nothing":
        _seed(seed)
        return Payload("nothing", InertialParameters.zero())
    if family == "boxes":
        return _scaled(_draw(np.random.default_rng(_seed(seed)), f"random {seed}"), scale)
    rng = np.random.default_rng([_seed(seed), FAMILIES.index(family)])
    if family == "light":
        scale *= float(np.exp(rng.uniform(*np.log(_LIGHT))))
        family = "shapes"
    if family == "container":
        # a small arm carries a small container, a large one a container of the usual size
        return _scaled(_filling(rng, name), min(1.0, scale))
    shapes, masses = {
        "shapes": (SHAPES, _SHAPE_MASS),
        "tools": (TOOLS, _TOOL_MASS),
        "odd": (ODD, _ODD_MASS),
        "wide": (WIDE, _SHAPE_MASS),
    }[family]
    mass = rng.uniform(*masses) * scale
    kind = list(shapes)[rng.integers(len(shapes))]
    return Payload(f"{name}, {kind}", shapes[kind](rng, mass, float(np.cbrt(scale))))


# The families that `draw_payload` draws from.
FAMILIES = ("boxes", "shapes", "tools", "container", "nothing", "odd", "light", "wide")


def _filling(rng: np.random.Generator, name: str) -> Payload:
    """The container with up to five weights: the paper's in any of their places, or odd ones anywhere in the slots."""
    taken = rng.choice(len(POSITIONS), size=rng.integers(0, _MOST_WEIGHTS + 1), replace=False)
    if rng.random() < 0.5:
        return container("".join("1" if k in taken else "0" for k in range(len(POSITIONS))), name)
    empty = container()
    boxes, room = [], _HEAVIEST_FILLING - empty.parameters.mass
    for k in taken:
        mass = min(float(rng.uniform(*_ODD_WEIGHT)), room)
        if mass < _ODD_WEIGHT[0]:
            break
        room -= mass
        x, y, _ = position_centre(POSITIONS[k])
        centre = (x + rng.uniform(-_SHIFT, _SHIFT), y + rng.uniform(-_SHIFT, _SHIFT), rng.uniform(BOTTOM, TOP))
        boxes.append(Box((0.03, 0.03, 0.03 * mass / 0.2), centre, mass))
    return Payload.from_boxes(name, [*empty.boxes, *boxes])


def _scaled(payload: Payload, scale: float) -> Payload:
    """The same body with its mass multiplied and its lengths by the cube root: of the same density."""
    if scale == 1.0 or not np.any(payload.parameters.phi):
        return payload
    p, longer = payload.parameters, float(np.cbrt(scale))
    parameters = InertialParameters.from_com(p.mass * scale, p.com * longer, p.inertia_com * scale * longer**2, p.frame)
    boxes = []
    for box in payload.boxes:
        (a, b, c), (x, y, z) = box.size, box.centre
        size, centre = (longer * a, longer * b, longer * c), (longer * x, longer * y, longer * z)
        boxes.append(Box(size, centre, scale * box.mass))
    return Payload(payload.name, parameters, tuple(boxes))


def _draw(rng: np.random.Generator, name: str) -> Payload:
    n = int(rng.integers(1, 5))
    masses = rng.uniform(*MASS) * rng.dirichlet(np.ones(n))
    masses = np.maximum(masses, 1e-6)  # a share of nearly nothing is still a box
    centres = rng.uniform(CENTRE_LOW, CENTRE_HIGH, (n, 3))
    sizes = rng.uniform(*SIDE, (n, 3))
    return Payload.from_boxes(
        name,
        [Box(tuple(s), tuple(c), float(m)) for s, c, m in zip(sizes.tolist(), centres.tolist(), masses, strict=True)],
    )


def _seed(seed: int) -> int:
    return _whole(seed, "seed")


def _whole(value: int, what: str) -> int:
    try:
        number = int(value)
    except (TypeError, ValueError, OverflowError):
        number = -1
    if number != value or number < 0:
        raise PayloadError(f"{what} is {value!r}: expected a whole number of 0 or more")
    return number

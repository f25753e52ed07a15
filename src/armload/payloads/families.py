"""Random payloads off the container's family: a few boxes of any size and weight, consistent by construction."""

from __future__ import annotations

import numpy as np

from armload.errors import PayloadError
from armload.payloads.payload import Box, Payload

MASS = (0.2, 2.8)  # [kg] of all boxes together
CENTRE_LOW, CENTRE_HIGH = (-0.08, -0.08, 0.0), (0.08, 0.08, 0.16)  # [m] of each box
SIDE = (0.02, 0.12)  # [m]


def random_payload(seed: int) -> Payload:
    """One to four boxes with uniform total mass, centres and sides, and a uniformly random division of the mass.

    The same seed gives the same payload. Being made of solids, it can always exist.

    >>> 0.2 <= random_payload(3).parameters.mass <= 2.8
    True
    """
    return _draw(np.random.default_rng(_seed(seed)), f"random {seed}")


def random_payloads(count: int, seed: int) -> list[Payload]:
    """`count` independent random payloads; a longer list of the same seed begins with the shorter one."""
    if count < 0:
        raise PayloadError(f"{count} random payloads asked for: expected a count of 0 or more")
    return [_draw(np.random.default_rng([_seed(seed), k]), f"random {seed}-{k}") for k in range(count)]


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
    if int(seed) != seed or seed < 0:
        raise PayloadError(f"seed is {seed!r}: expected a whole number of 0 or more")
    return int(seed)

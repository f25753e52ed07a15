"""The rule that chooses the 77 loadings of the container; its outcome is committed as `container_loadings.json`.

The paper: loadings "chosen according to the available positions in the four slots that allow the change of one
component of the center of mass while fixing the others for every mass", 77 in all, 0 to 5 weights (Section IV). It does
not list them; of the 219 ways to put up to five weights into eight positions this is our selection, in four steps:

1. Loadings of one mass that share a centre of mass count once. Eight positions then leave 1, 8, 19, 32, 33 and 32
   centres for 0 to 5 weights, 125 together. Which one stands for a centre: the loading that spreads its weights over
   the most slots, then the first in the order of `POSITIONS`.
2. The centres of one mass form shells of equal distance from the container's axis. A shell is taken whole or not at
   all, so that the selection keeps the mirror images and quarter turns of the container.
3. For every mass, shells are taken from the axis outwards until there are at least 16 centres: 1, 8, 19, 16, 17 and 16,
   which makes 77. The 16 is chosen so that it does; it gives every mass from two weights on about the same share.
4. The paper's property then holds and is tested: every chosen loading but the empty one has a chosen partner of the
   same mass whose centre differs in one component only, and every mass has such pairs for r_x, for r_y and for r_z.
"""

from __future__ import annotations

from itertools import combinations

from armload.payloads.container import POSITIONS, SLOTS

ENOUGH = 16  # centres of mass of one mass, after which no further shell is taken
MOST_WEIGHTS = 5


def choose_loadings() -> list[str]:
    """The loadings the rule chooses, as eight digits each; by number of weights, then from the axis outwards.

    >>> len(choose_loadings())
    77
    """
    return [loading for weights in range(MOST_WEIGHTS + 1) for loading in _chosen_of_one_mass(weights)]


def _chosen_of_one_mass(weights: int) -> list[str]:
    best: dict[tuple[int, int, int], tuple[int, ...]] = {}
    for taken in sorted(combinations(range(len(POSITIONS)), weights), key=_spread_first):
        best.setdefault(_centre(taken), taken)
    shells: dict[int, list[tuple[int, ...]]] = {}
    for (x, y, _), taken in best.items():
        shells.setdefault(x * x + y * y, []).append(taken)
    chosen: list[tuple[int, ...]] = []
    for distance in sorted(shells):
        if len(chosen) >= ENOUGH:
            break
        chosen += sorted(shells[distance])
    return ["".join("1" if k in taken else "0" for k in range(len(POSITIONS))) for taken in chosen]


def _centre(taken: tuple[int, ...]) -> tuple[int, int, int]:
    """Sum of the positions in units of slot offset and level: among loadings of one mass it orders the centres of mass
    exactly, without rounding, whatever the container's dimensions."""
    slots = list(SLOTS.values())
    return (sum(slots[k // 2][0] for k in taken), sum(slots[k // 2][1] for k in taken), sum(k % 2 for k in taken))


def _spread_first(taken: tuple[int, ...]) -> tuple[int, tuple[int, ...]]:
    """A sort key: loadings over many slots first, then in the order of `POSITIONS`."""
    return -len({k // 2 for k in taken}), taken

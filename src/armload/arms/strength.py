"""What an arm is built for, where its sheet does not say: the scale of whatever is not known for that arm.

One rule for each figure, here and nowhere else. How near they come, their figure over the maker's:

| arm    | `rated_mass`, effort limits known | `rated_effort` without limits, joints |
|--------|-----------------------------------|---------------------------------------|
| panda  | 1.21                              | 0.45 – 1.26                           |
| fr3    | 1.19                              | 0.46 – 1.29                           |
| ur3e   | 1.33                              | 0.49 – 0.70                           |
| ur5    | 1.85                              | 0.23 – 0.74                           |
| ur5e   | 1.72                              | 0.27 – 0.82                           |
| ur10   | 1.10                              | 0.55 – 0.74                           |
| ur10e  | 0.90                              | 0.49 – 0.75                           |
| ur16e  | 0.97                              | 0.38 – 0.56                           |
| ur20   | 1.09                              | 0.42 – 0.88                           |
| iiwa7  | 1.30                              | 0.18 – 0.74                           |
| iiwa14 | 0.98                              | 0.19 – 0.52                           |
| gen3   | 0.39 (full reach: 1.42)           | 0.36 – 1.20                           |
| xarm7  | 0.56                              | 0.33 – 1.31                           |

Two fifths of the moving links' mass, another rule for the rated mass, is off by 0.65 to 2.14.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from armload.arms.model import Arm
from armload.inertia import InertialParameters

PAYLOAD_REACH = 0.10  # [m] a payload's centre beyond the payload frame along its z axis, where nothing is known of it
# [rad/s] of the smooth Coulomb friction c·tanh(dq/w) of a geared joint: measured on two Pandas, and taken for any arm,
# by the simulated worlds that are like the measured ones and by what identifies
FRICTION_WIDTH = 0.06

_POSES = 200
# of the torque that holding the arm can take: the strength of a joint without a limit, or with one that does not even
# hold the arm, as where springs bear it. By such limits a Baxter would be rated for nothing, a PR2's arm likewise; by
# this 2.8 and 2.7 kg, where their makers say 2.2 and 1.8
_HOLDING = 2.0
_WEAKEST = 0.15  # of the strongest joint: 0.14 of the Panda's, 0.17 of a UR10e's
# times that strength, above which an effort limit stands for none (1e9, or 1000 of an arm on a desk): the most of a
# built-in arm's is 5.6, of small servos 10 (test_an_effort_limit_that_no_arm_has_counts_as_none)
_INCREDIBLE = 50.0
_FULL = 0.7  # of what the joints could hold almost everywhere: makers leave room for dynamics
# of gravity's, an acceleration in any direction that each joint gives a payload, too: joints of an arm in a horizontal
# plane hold nothing. Up to 0.7 it decides of no built-in arm (test_a_horizontal_arm_is_rated_by_what_its_joints_move)
_MOVED = 0.5


def rated_effort(arm: Arm) -> NDArray[np.float64]:
    """Torque (n,) each joint is built for [N·m]: its effort limit; without one, twice what holding the arm can take.

    So is one whose limit is fifty times that. A joint is at least as strong as those it carries, and none is much
    weaker than the rest.
    """
    effort = arm.limits.effort
    if arm.rated_payload is not None and np.all(np.isfinite(effort)):  # the maker's
        return effort
    assumed = _assumed_effort(arm)
    return np.where(effort <= _INCREDIBLE * assumed, effort, assumed)


@lru_cache(maxsize=16)
def _assumed_effort(arm: Arm) -> NDArray[np.float64]:
    """The same (n,) [N·m], if the arm had no limits. Its weight is that of gravity in any direction, as of a SCARA."""
    q, g = poses(arm), float(np.linalg.norm(arm.gravity))
    ways = [np.abs(replace(arm, gravity=tuple(g * way)).torque(q)) for way in np.eye(3)]
    own = np.linalg.norm(ways, axis=0).max(axis=0)
    carried = np.maximum.accumulate(own[::-1])[::-1]
    return np.maximum(_HOLDING * np.maximum(carried, _WEAKEST * carried[0]), 1.0)


def rated_mass(arm: Arm) -> float:
    """What the arm may carry [kg]: the maker's figure, or 0.7 of what its joints hold and move in 95 % of all poses.

    A joint whose effort limit is less than the arm's own weight takes has twice that torque in its place.
    """
    return arm.rated_payload if arm.rated_payload is not None else _assumed_mass(arm)


@lru_cache(maxsize=16)  # a stream asks at every answer
def _assumed_mass(arm: Arm) -> float:
    arm = replace(arm)  # another thread may be computing with this one
    q = poses(arm)
    bare = arm.torque(q)
    kilogram = InertialParameters.from_com(1.0, (0.0, 0.0, PAYLOAD_REACH), 1e-3 * np.eye(3))
    held = np.abs(arm.with_payload(kilogram).torque(q) - bare)
    turn, shift = np.split(arm.frame_motion(q).jacobian, 2, axis=1)
    reach = np.linalg.norm(shift, axis=1) + PAYLOAD_REACH * np.linalg.norm(turn, axis=1)  # at most, wherever it is
    moved = _MOVED * np.linalg.norm(arm.gravity) * reach
    strength, weight = rated_effort(arm), np.abs(bare).max(axis=0)
    room = np.where(weight < strength, strength, _HOLDING * weight) - np.abs(bare)
    return float(max(0.05, _FULL * np.quantile((room / np.maximum(held, moved)).min(axis=1), 0.05)))


def poses(arm: Arm) -> NDArray[np.float64]:
    """A fixed set of poses (200, n) spread over the joint limits, at most one turn each [rad]."""
    low = np.maximum(arm.limits.position_low, -np.pi)
    high = np.minimum(arm.limits.position_high, np.pi)
    return low + (high - low) * np.random.default_rng(0).random((_POSES, arm.n))

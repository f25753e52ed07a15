"""Whether what is held has play: whether it shifts along an axis of the frame when that axis turns over.

A payload that sits loosely between two stops, 2·s apart along an axis u, rests on the lower one: its first moment along
u is larger by 2·m·s where u points down than where it points up. A spring would let it sink along gravity, which no
static torque shows; a stop does not. The rows of a log are parted by the sign of uᵀ·(g − a), g gravity and a the
acceleration of the frame. With those of one side as a tare of the other's (`posterior.solve`), and Λ, h what both say
of the first moments that were gained between them, all that is unknown about the arm integrated out,

    d = uᵀ·h / uᵀ·Λ·u,      std = 1/√(uᵀ·Λ·u)

is what the first moment along u gained, all else being the same. An arm's own mismatch gives d, too, but one that does
not grow with what is held: that is asked of many logs (`survey.looseness`), whose scatter also says how far std is off.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.identification.segments import without_payload
from armload.identification.thresholds import SETTLED
from armload.posterior import Profile, SmoothPosteriorLeastSquares
from armload.posterior.drift import TESTED
from armload.posterior.solve import solve
from armload.recording import Recording
from armload.regression import JointFeatures, solution_prior_std
from armload.regression.information import RegressionData, Session
from armload.regression.noise import SMOOTH
from armload.regression.rows import Rows
from armload.regression.rows_of_log import RowsOfLog

# u (9, 3): across the flange every 22.5°, and along its axis; what slides between the jaws of a gripper is never
# farther than 11.25° from one of these
_ANGLES = np.radians(22.5) * np.arange(8)
AXES = np.vstack([np.stack([np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(8)], axis=1), [[0.0, 0.0, 1.0]]])
_POSE, _VELOCITY = 32, 12  # smooth functions of a joint: for one number, fewer than an answer has
_STEP = 0.03  # [s] over which an acceleration is taken: within the lag of the rows, above the noise of positions
_LEAST = 1.0  # [s] on either side of an axis, at least: two of the shortest parts of a log (`PART_LEAST`)


class Play(NamedTuple):
    """What the first moments along `AXES` gained as these turned down, and their standard deviations.

    moment, std: (9,) [kg·m]; NaN where the axis did not turn over for a second each way.
    """

    moment: NDArray[np.float64]
    std: NDArray[np.float64]


def play_within(
    recording: Recording,
    arm: Arm,
    edges: Sequence[tuple[float, float]],
    tare: Recording | None = None,
    profile: Profile | None = None,
) -> list[Play]:
    """The play within each part of a log throughout which the payload is the same.

    Args:
        edges: from and to of each part, since the log began [s].
        tare, profile: what else is known of the arm.
    """
    few = JointFeatures(arm.n, _POSE, _VELOCITY) if profile is None else None
    physics = SmoothPosteriorLeastSquares(arm, tare, features=few, profile=profile)
    known = [without_payload(data, arm, physics.start) for data in physics.stream.tares]
    rows = RowsOfLog(physics.stream.regression(), recording)
    t, found = rows.t - recording.t[0], []
    for k, (a, b) in enumerate(edges):
        first, last = np.searchsorted(t, [a + SETTLED * (k > 0), b])
        each = np.array([_gained(physics, known, rows.between(int(first), int(last)), axis) for axis in AXES])
        found.append(Play(*each.T))
    return found


def _gained(
    physics: SmoothPosteriorLeastSquares, known: list[RegressionData], rows: Iterable[Rows], axis: NDArray[np.float64]
) -> tuple[float, float]:
    """d along an axis, and its standard deviation."""
    arm = physics.arm
    up, down = sides = physics.empty_data(), physics.empty_data()
    if physics.profile is None and known:
        up.session = down.session = Session(1, TESTED)
    for part in rows:
        points_down = _along(arm, part, axis) > 0.0
        for side, keep in zip(sides, (~points_down, points_down), strict=True):
            if keep.any():
                side.take(Rows(*(value[keep] for value in part)))
    if min(side.blocks.duration for side in sides) < _LEAST:
        return np.nan, np.nan
    said = solve([*known, up, down], solution_prior_std(arm), None, SMOOTH, 1, physics.start)
    own = float(axis @ said.information[1:4, 1:4] @ axis)
    return (float(axis @ said.vector[1:4]) / own, own**-0.5) if own > 0.0 else (np.nan, np.nan)


def _along(arm: Arm, rows: Rows, axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """uᵀ·(g − a) (M,): what pulls something that may slide along the axis [m/s²]."""
    R, p = arm.frame_pose(rows.q)
    at = [np.stack([np.interp(rows.t + dt, rows.t, x) for x in p.T], axis=1) for dt in (-_STEP, 0.0, _STEP)]
    acceleration = (at[0] - 2.0 * at[1] + at[2]) / _STEP**2
    return np.einsum("nij,ni,j->n", R, arm.gravity - acceleration, axis)

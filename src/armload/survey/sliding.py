"""Whether what is held slides in the gripper, as one log tells it; `looseness` asks all logs of an arm together.

A body that is held loosely lies against one stop or against the other, d from the middle of its way, whichever is
lower. With u the direction of the way and g gravity, both in the flange's axes,

    s = d·u·sgn(u·g)        tau = W_mr·(m·s)

where W_mr are the columns of the first moments. So c = m·d is one more unknown of the regression (`regression.rows`):

    r = W·phi + Z·eta + G·g + c·W_mr·u·F[sgn(u·g)] + e

with F the lag of the rows. It is asked of `WAYS` directions across the flange, each alone, all else integrated out
under its stated prior. A few millimetres are a few hundredths of a newton metre, so that a log alone tells little.
What accelerations and the time between the stops do is left out: c is found too small, by a half on quick motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.identification import Identification
from armload.identification.thresholds import SETTLED
from armload.posterior import Profile, SmoothPosteriorLeastSquares
from armload.posterior.drift import TESTED
from armload.posterior.elimination import RunInformation, eliminated
from armload.posterior.problem import Problem
from armload.recording import Recording, blocks
from armload.regression import solution_prior_std
from armload.regression.information import columns_of
from armload.regression.noise import SMOOTH, whole_noise
from armload.regression.rows import Rows

WAYS = 12  # directions across the flange, 15° apart: a way between two of them is a cosine of 7.5° away
# [s] of a part, from its beginning: as many as the noise model takes to be new (`SMOOTH.novelty`)
LONGEST = SMOOTH.novelty
_ANGLES = np.pi * np.arange(WAYS) / WAYS
_DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(WAYS)], axis=1)


class Slide(NamedTuple):
    """c (WAYS,) [kg·m] of each direction, and its standard deviation (WAYS,), infinite where the log tells nothing."""

    moment: NDArray[np.float64]
    std: NDArray[np.float64]


def slides(
    recording: Recording,
    arm: Arm,
    parts: Sequence[tuple[float, float]],
    tare: Recording | None = None,
    profile: Profile | None = None,
) -> list[Slide | None]:
    """What each part of a log (from, to [s] on its clock) tells; None: fewer than two samples, or motor-side torque."""
    if arm.motor_torque:  # friction that grows with the load hides so little
        return [None] * len(parts)
    physics = SmoothPosteriorLeastSquares(arm, tare, profile=profile)
    if profile is None:
        physics.allow_for(TESTED)
    known = _Known.of(physics)
    found: list[Slide | None] = []
    for start, stop in parts:
        rows = (recording.t >= start) & (recording.t <= min(stop, start + LONGEST))
        first, last = int(np.argmax(rows)), int(np.count_nonzero(rows))
        found.append(known.slide(recording.select(slice(first, first + last))) if last > 1 else None)
    return found


def slides_of_parts(
    found: Identification, recording: Recording, arm: Arm, tare: Recording | None, profile: Profile | None
) -> list[Slide | None]:
    """The same of the parts that a log was cut into."""
    begin = float(recording.t[0])
    parts = [(begin + part.start + SETTLED * (k > 0), begin + part.stop) for k, part in enumerate(found.segments)]
    try:
        return slides(recording, arm, parts, tare, profile)
    except np.linalg.LinAlgError:  # the answer stands without
        return [None] * len(parts)


class _Known(NamedTuple):
    """What is known of z = [payloads, eta, drifts, c] apart from a log: by stated priors, and by the tares."""

    physics: SmoothPosteriorLeastSquares
    problem: Problem
    tares: list[RunInformation]
    selection: NDArray[np.float64]  # (10 + p + WAYS, z) of the run
    prior_std: NDArray[np.float64]  # of z, but of c

    @classmethod
    def of(cls, physics: SmoothPosteriorLeastSquares) -> _Known:
        run, tares = physics.empty_data(), physics.stream.tares
        problem = Problem([*tares, run], solution_prior_std(physics.arm), None, SMOOTH)
        selections = [np.hstack([E, np.zeros((len(E), WAYS))]) for E in problem.selections[:-1]]
        known = [RunInformation.of(one, E) for one, E in zip(tares, selections, strict=True)]
        E = problem.selections[-1]
        wide = np.block([[E, np.zeros((len(E), WAYS))], [np.zeros((WAYS, E.shape[1])), np.eye(WAYS)]])
        stated = problem.scales(None)
        std = np.sqrt(np.concatenate([stated.payloads, stated.eta, stated.drifts.ravel()]))
        return cls(physics, problem, known, wide, std)

    def slide(self, part: Recording) -> Slide:
        """What a part of a log tells."""
        run, seconds = self._information(part)
        noise = self.problem.expected.copy()
        noise[-1] = whole_noise(self.physics.stream.correction, SMOOTH) * max(1.0, seconds / SMOOTH.novelty)
        found = eliminated([*self.tares, run], noise, self.problem.feature_variance)
        known, root = len(self.prior_std), self.prior_std
        mixed = root[:, None] * np.c_[found.A[:known, known:], found.b[:known]]
        inner = root[:, None] * found.A[:known, :known] * root + np.eye(known)
        taken = mixed.T @ np.linalg.solve(inner, mixed)
        information = np.diag(found.A)[known:] - np.diag(taken)[:-1]
        vector = found.b[known:] - taken[:-1, -1]
        seen = information > 1e-9 * np.diag(found.A)[known:]
        std = np.full(WAYS, np.inf)
        std[seen] = information[seen] ** -0.5
        return Slide(np.where(seen, vector * np.where(seen, std, 0.0) ** 2, 0.0), std)

    def _information(self, part: Recording) -> tuple[RunInformation, float]:
        """Sums of the part's rows with the columns of c, and their time [s]."""
        arm, stream = self.physics.arm, self.physics.stream
        regression, shared = stream.regression(), 10 + stream.correction.size
        size = shared + WAYS + stream.features.size
        sums, seconds, sides = np.zeros((arm.n, size + 1, size + 1)), 0.0, None
        for samples in blocks(len(part)):
            rows = regression.rows(part.t[samples], part.q[samples], part.dq[samples], part.tau[samples])
            if not len(rows.t):
                continue
            sides = _sides(arm, rows, self.physics.gain, None if sides is None else sides[-1])
            sliding = (rows.X[:, :, 1:4] @ _DIRECTIONS.T) * sides[:, None, :]
            seconds += float(rows.h.sum())
            for j in range(arm.n):
                X = np.c_[rows.X[:, j, :shared], sliding[:, j], rows.X[:, j, shared:], rows.r[:, j]]
                X *= np.sqrt(rows.h * rows.weights[:, j])[:, None]
                sums[j] += X.T @ X
        c, E = shared + WAYS, self.selection
        A = columns_of(columns_of(sums[:, :c, :c], E).swapaxes(1, 2), E)
        A_gz, A_gg = columns_of(sums[:, c:-1, :c], E), sums[:, c:-1, c:-1]
        return RunInformation(A, A_gz, A_gg, columns_of(sums[:, None, -1, :c], E)[:, 0], sums[:, c:-1, -1]), seconds


def _sides(arm: Arm, rows: Rows, gain: float, before: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """sgn(u·g) (M, WAYS) through the rows' own lag; before: of the last row (WAYS,), None at the beginning."""
    sides = np.sign(arm.frame_motion(rows.q).gravity @ _DIRECTIONS.T)
    keep = np.exp(-gain * np.diff(rows.t, prepend=rows.t[0] - rows.h[0])).tolist()
    state = sides[0] if before is None else before
    for k, share in enumerate(keep):
        state = share * state + (1.0 - share) * sides[k]
        sides[k] = state
    return sides

"""What a log shows of friction: whether there is any, and whether it drives a joint that it must brake.

All that is odd in a joint's velocity is friction: Coulomb and viscous, what gears lose, and the odd part of the smooth
functions of the velocity (`regression.mismatch`, `regression.features`). Together they brake: their work over the path,

    f_j = ∫ h_j(dq_j)·dq_j dt / ∫ |dq_j| dt,

is above zero. Coulomb friction alone need not be: the more logs tell of friction's shape, the more of it is in the
smooth functions, and what Coulomb friction of either sign adds makes their sum steeper or flatter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.arms import FRICTION_WIDTH
from armload.identification.last_equations import LastEquations
from armload.identification.thresholds import BACKWARDS, LEAST_SEEN, MOVES
from armload.posterior.calibration import KAPPA_UNKNOWN
from armload.recording import Recording, span
from armload.regression.mismatch import PER_JOINT
from armload.runtime.one_thread import one_thread

_SAMPLES = 200  # of a log's path: friction is a smooth function of the velocity


def driven_joints(last: LastEquations, recording: Recording, kappa: float | None) -> tuple[int, ...]:
    """Joints, from 1, that move, and that friction surely drives.

    last: of the log. kappa: by how much the physics overrates its evidence; None: not known. Of motor currents, which
        are mostly friction, it says nothing of that.
    """
    motor = last.identifier.posterior.torque == "motor"
    sure = BACKWARDS * (1.0 if motor else np.sqrt(kappa or KAPPA_UNKNOWN))
    moves = span(recording.q) > MOVES
    if not moves.any():
        return ()
    friction, std = _friction(last, recording)
    return tuple((np.flatnonzero(moves & (friction < -sure * std)) + 1).tolist())


def is_frictionless(last: LastEquations, recording: Recording) -> bool:
    """Whether half of the joints move at least, and no such joint shows friction."""
    found, moves = last.identifier, span(recording.q) > MOVES
    correction = found.stream.correction
    if 2 * moves.sum() < len(moves):
        return False
    least = LEAST_SEEN * correction.effort
    if (np.abs(correction.coulomb(found.posterior.eta)) > least)[moves].any():
        return False
    return not (np.abs(_friction(last, recording)[0]) > least)[moves].any()


@one_thread()
def _friction(last: LastEquations, recording: Recording) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """f (n,) [N·m] of the joints along a log, and its standard deviation; 0 of one that stands still."""
    stream, arm = last.identifier.stream, last.identifier.arm
    correction, features = stream.correction, stream.features
    known, E = last.known, last.problem.selections[-1]
    rows = np.linspace(0, len(recording) - 1, min(_SAMPLES, len(recording))).astype(int)
    dq, tau = recording.dq[rows], recording.tau[rows]
    path, j = np.maximum(np.abs(dq).sum(axis=0), np.finfo(float).tiny), np.arange(arm.n)
    X = np.zeros((arm.n, len(E) + features.size))
    direction = np.tanh(dq / FRICTION_WIDTH)
    shapes = {"coulomb": direction, "viscous": dq}
    for at, name in enumerate(PER_JOINT):
        if name in shapes:
            X[j, 10 + at * arm.n + j] = (dq * shapes[name]).sum(axis=0) / path
    if correction.loss_std > 0.0:
        transmitted = np.abs(tau - correction.least_friction * direction)
        X[j, 10 + correction.load.start + j] = (dq * transmitted * direction).sum(axis=0) / path
    odd = 0.5 * (features.of_velocity(dq) - features.of_velocity(-dq))
    X[:, len(E) + features.pose :] = np.einsum("tj,tjr->jr", dq, odd) / path[:, None]
    mean = X[:, : len(E)] @ (E @ known.mean) + (X[:, len(E) :] * known.weights).sum(axis=1)
    variance = [known.covariance_of(E, k, X[k : k + 1])[0, 0] for k in range(arm.n)]
    return mean, np.sqrt(variance)

"""One session beside a profile: its rows, whether it fits, and the profile with it.

A session's offsets and friction are its own, delta_s ~ N(0, D), and are integrated out joint by joint
(`without_drift`); what is left is information on what all sessions share, and is added to the profile's
(`profile_learning`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.errors import IdentificationError
from armload.inertia import HELD, Z95
from armload.posterior.another_arm import another_arm
from armload.posterior.calibration import KAPPA_UNKNOWN
from armload.posterior.drift import drift_of
from armload.posterior.foretold import counting_repeats
from armload.posterior.problem import Problem
from armload.posterior.profile import Profile, SessionRecord, remembered
from armload.posterior.scales import Drift, Posterior
from armload.posterior.solve import solve
from armload.recording import Recording, digest_of, marks_of
from armload.regression import Correction, FilteredRegression, JointFeatures, payload_prior_std
from armload.regression.information import RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH, whole_noise

STATED = 3.0  # [sessions] that the stated size of the drift counts for: of so few a variance is known to 60 %
_RATE = 50.0  # [Hz] of a profile's rows: what passes the lag is below 4 Hz, and a profile's logs are long
_POSES = 20  # of each log that are kept, to show where the arm was seen


def log_data(
    correction: Correction, log: Recording, features: JointFeatures, session: Session, tool: NDArray | None = None
) -> RegressionData:
    """The rows of a log, less a known tool (10,)."""
    data = RegressionData(correction, GAIN, features, SMOOTH.block, session)
    rows = FilteredRegression(correction.arm, GAIN, correction, features, _RATE, SMOOTH.block)
    data.take(rows.rows(log.t, log.q, log.dq, log.tau))
    if tool is not None:
        data.less(tool)
    return data


def without_drift(
    A: NDArray[np.float64], b: NDArray[np.float64], drift: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A (n, S, S) and b (n, S) of a session in units of its noise, its own offsets and friction integrated out.

    With u the rows of a joint's drift, A − A_u·(A_uu + D⁻¹)⁻¹·A_uᵀ: they occur in the joint's own rows only.
    """
    A, b, n = A.copy(), b.copy(), len(A)
    for j in range(n):
        own = 10 + j + n * np.arange(len(drift) // n)
        gain = A[j][:, own] @ np.linalg.inv(A[j][np.ix_(own, own)] + np.diag(1.0 / drift[j::n]))
        b[j] -= gain @ b[j, own]
        A[j] -= gain @ A[j][own]
        A[j] = 0.5 * (A[j] + A[j].T)
    return A, b


def with_session(
    known: Profile,
    correction: Correction,
    data: RegressionData,
    logs: Sequence[Recording] = (),
    name: str = "",
    marks: Sequence[str] = (),
) -> Profile:
    """A profile and one more session, whose rows have the profile's features; the scales stay, the drift's size learns.

    By how much noise counts for more learns, too (`counting_repeats`).

    Args:
        data: of the session. logs: it came from, for their names and poses. name: of a session that is no log.
        marks: of its samples (`mark_of`).
    """
    data.session = known.session(correction, len(known.sessions) + 1)
    problem = _beside(known, correction, data)
    scales = problem.scales(known.scales)
    for _ in range(2):
        scales = replace(scales, noise=problem.improved(scales, problem.posterior(scales)).noise)
    before, known = known, counting_repeats(known, correction, data, scales.noise[-1])
    if known.repeated != before.repeated:
        problem = _beside(known, correction, data)
    found = problem.posterior(scales)
    means, P = found.mean[problem.eta.stop :], found.covariance[problem.eta.stop :, problem.eta.stop :]
    S, seen = scales.noise[-1], len(known.sessions) + STATED
    A, b = without_drift(data.A / S[:, None, None], data.b / S[:, None], known.drift)
    drift = (seen * known.drift + means**2 + np.diag(P)) / (seen + 1.0)  # with this session's, as of those before
    about = (data.blocks.duration, logs, name, marks)
    return replace(
        known,
        A=known.A + A / known.repeated,
        b=known.b + b / known.repeated,
        drift=drift,
        sessions=remembered([*known.sessions, record(correction, means, P + np.diag(drift), S, *about)]),
        poses=np.concatenate([known.poses, *(poses(log) for log in logs)]),
    )


def _beside(known: Profile, correction: Correction, data: RegressionData) -> Problem:
    """A session's rows and what the profile says, of the same body."""
    runs = [known.data(correction, GAIN, SMOOTH.block), data]
    return Problem(runs, payload_prior_std(correction.arm), None, replace(SMOOTH, novelty=np.inf), same=True)


def record(
    correction: Correction,
    drift: NDArray[np.float64],
    covariance: NDArray[np.float64],
    S: NDArray[np.float64],
    duration: float,
    logs: Sequence[Recording],
    name: str,
    marks: Sequence[str] = (),
) -> SessionRecord:
    """What is kept of a session: its offsets and friction (d,) and their covariance, its noise, its time [s]."""
    dates = [log.date for log in logs if log.date is not None]
    return SessionRecord(
        name or ", ".join(log.source for log in logs),
        float(duration),
        min(dates) if dates else None,
        tuple(correction.offset(drift).tolist()),
        tuple(correction.coulomb(drift).tolist()),
        float(drift @ np.linalg.solve(covariance, drift)),
        tuple(np.sqrt(S / whole_noise(correction, SMOOTH)).tolist()),
        tuple(digest_of(log) for log in logs),
        (*marks, *(mark for log in logs for mark in marks_of(log))),
    )


def poses(log: Recording) -> NDArray[np.float64]:
    """Some poses (K, n) of a log."""
    return log.q[np.linspace(0, len(log) - 1, _POSES).astype(int)]


def compared(known: Profile, correction: Correction, data: RegressionData) -> tuple[Posterior, Drift, bool]:
    """What a session's rows say beside a profile: the solution, the drift, and whether they are of another arm."""
    arm = correction.arm
    runs = [known.data(correction, GAIN, SMOOTH.block), data]
    found = solve(runs, payload_prior_std(arm), None, SMOOTH, 3, known.scales)
    another = not found.gears and another_arm(runs, payload_prior_std(arm), None, SMOOTH, found).found
    return found, drift_of(found, correction, data.session), another


def check_fits(known: Profile, arm: Arm, log: Recording, tool: NDArray[np.float64] | None = None) -> None:
    """See that a log is of the profile's arm, with the same mounted.

    Raises:
        IdentificationError: it carries something, its offsets or friction are beyond what the other sessions show, or
            it is of another arm.
    """
    known.check(arm)
    correction = Correction(arm, rated_effort(arm))
    data = log_data(correction, log, known.features, known.session(correction), tool)
    found, drift, another = compared(known, correction, data)
    overrated = KAPPA_UNKNOWN if arm.motor_torque else 1.0
    mass, std = float(found.phi[0]), float(np.sqrt(overrated * found.covariance[0, 0]))
    if abs(mass) > HELD * std:
        raise IdentificationError(
            f"{log.source} carries {mass:+.3g} ± {Z95 * std:.2g} kg beside what was mounted in the profile's logs: a "
            "profile learns from the arm without a payload; leave the log out, name what was mounted with --tool, or "
            "learn a new profile if the arm was repaired"
        )
    if drift.changed or another:
        raise IdentificationError(
            f"{log.source} does not fit the profile (T = {drift.statistic:.0f}, at joint {drift.joint + 1} most): it "
            "is of another arm, or of one that was repaired or moved; learn a new profile, and leave this one as it is"
        )

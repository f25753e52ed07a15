"""What many logs of an arm say of the arm: its profile, a tare that outlives the day.

A profile is information on x_j = [phi_0 eta g_j] of every joint j, what its sessions share: whatever is mounted in all
of its logs, the rigid mismatch, the weights of the smooth one. `profile_learning` makes it. In `problem.Problem` it
takes the place of a tare, as a run whose noise is known. Offsets and friction of a session differ from those of the
mean session by delta ~ N(0, D); D is the arm's own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, from_frame, link_fingerprint, prefixed_frame, rated_effort
from armload.errors import ModelError
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.recording import Recording, digest_of, marks_of
from armload.regression import Correction, JointFeatures, payload_prior_std
from armload.regression.information import RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH, whole_noise

# marks of samples that a profile remembers, 0.8 MB of its file: with more, every other one of the session with the most
# is forgotten, the samples themselves decide which
# (test_a_profile_of_many_logs_remembers_a_bounded_number_of_their_samples)
MARKS = 50_000
_SAME_MASS = 1e-3  # [kg] tools whose masses differ by less are one


@dataclass(frozen=True)
class SessionRecord:
    """What a profile keeps of one session, for people: what it is called, how it drifted, how well it fits.

    duration [s]; date: [s since 1970], None where the log does not say. offset, coulomb: (n,) by which they differ from
    the mean session [N·m]. statistic: T of `posterior.drift`, chi-squared of 3·n where the session is like the others.
    noise: (n,) the residual's long-run deviation √S over the one expected. logs: digests of the logs (`digest_of`); of
    a stream, and in a profile of an earlier version, there are none. marks: of the samples
    of its logs or stream (`marks_of`).
    """

    name: str
    duration: float
    date: float | None
    offset: tuple[float, ...]
    coulomb: tuple[float, ...]
    statistic: float
    noise: tuple[float, ...]
    logs: tuple[str, ...] = ()
    marks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Profile:
    """An arm as its logs show it.

    Args:
        arm_name, fingerprint, frame, n: of the arm (`link_fingerprint`); phi_0 is about that frame.
        gravity: (3,) that the logs were recorded with [m/s²].
        attached: mass of what counts as a part of the arm (`Arm.attached`) [kg].
        features: of each joint's smooth part.
        A, b: (n, S, S), (n, S) information on x_j, in units of the noise.
        scales: that the arm's other logs start from.
        drift: (d,) variance of a session's offsets and friction about the mean session.
        repeated: by how much the noise of a log counts for more, as what the features cannot say repeats.
        gain, gain_std: (n,) gamma, by how much the torque sensors are off as a known weight showed it (`torque_gain`),
            and how well the torque as a whole is known then; None: none was hung on.
        sessions: what it was learned from. poses: (P, n) where the arm was seen [rad].
        gain_joint_std: (n,) standard deviation of each joint's gamma: a joint that hardly bears the weight keeps its
            prior. None: no weight, or a profile of an earlier version.
        foretold: (7,) log density of the sessions that were added, as the profile before each foretold them, by each of
            the factors that `repeated` may be (`foretold.REPEATED`). None: none was added, or by an earlier version.
    """

    arm_name: str
    fingerprint: str
    frame: str
    n: int
    gravity: NDArray[np.float64]
    attached: float
    features: JointFeatures
    A: NDArray[np.float64] = field(repr=False)
    b: NDArray[np.float64] = field(repr=False)
    scales: Scales = field(repr=False)
    drift: NDArray[np.float64] = field(repr=False)
    repeated: float
    sessions: tuple[SessionRecord, ...] = field(repr=False)
    poses: NDArray[np.float64] = field(repr=False)
    gain: NDArray[np.float64] | None = None
    gain_std: float | None = None
    gain_joint_std: NDArray[np.float64] | None = None
    foretold: NDArray[np.float64] | None = None

    @property
    def duration(self) -> float:
        """Seconds that it was learned from."""
        return sum(session.duration for session in self.sessions)

    @property
    def digest(self) -> str:
        """The first twelve digits of the SHA-256 of what it knows."""
        from hashlib import sha256

        gain = b"" if self.gain is None else self.gain.tobytes()
        return sha256(np.ascontiguousarray(self.A).tobytes() + self.b.tobytes() + gain).hexdigest()[:12]

    def learned_from(self, log: Recording) -> str | None:
        """The session of the same measurements, or of some of them; None: there is none."""
        digest = digest_of(log)
        same = next((one.name for one in self.sessions if digest in one.logs), None)
        return self.holding(marks_of(log)) if same is None else same

    def holding(self, marks: Iterable[str]) -> str | None:
        """The session of samples with some of these marks (`marks_of`, `mark_of`); None: there is none."""
        found = [self._of_marks[mark] for mark in marks if mark in self._of_marks]
        return self.sessions[min(found)].name if found else None

    @cached_property
    def _of_marks(self) -> dict[str, int]:
        """The first session of each mark: streams ask of sample after sample."""
        return {mark: k for k in reversed(range(len(self.sessions))) for mark in self.sessions[k].marks}

    def check(self, arm: Arm) -> None:
        """See that it is of this arm, on this base.

        Raises:
            ModelError: it is of another one, or something is counted with the arm that a profile does not know of.
        """
        if abs(attached_mass(arm) - self.attached) > _SAME_MASS:
            raise ModelError(
                f"the profile is of {self.arm_name} with a tool of {self.attached:.3g} kg that counts as the arm's, "
                f"asked is for one of {attached_mass(arm):.3g} kg: expected the same; take the tool off the answer"
            )
        flange = prefixed_frame(arm, self.frame)
        if arm.n != self.n or flange is None or _fingerprint(arm, flange) != self.fingerprint:
            raise ModelError(
                f"the profile is of {self.arm_name} to {self.frame}: {arm.name} to {arm.frame} is another arm, stands "
                "elsewhere in its file, or has other links; learn one for it with `armload profile`"
            )
        if not np.allclose(arm.gravity, self.gravity, atol=0.05):
            raise ModelError(
                f"the profile is of an arm with gravity {_text(self.gravity)} m/s² in its base's axes, asked for is "
                f"{_text(arm.gravity)}: expected the same base; learn a profile of the arm as it stands now"
            )

    def correction(self, arm: Arm) -> Correction:
        """The unknowns of the arm, with the gains of its torque sensors."""
        return Correction(arm, rated_effort(arm), None if self.gain is None else 1.0 + self.gain, self.gain_std)

    def data(self, correction: Correction, gain: float, block: float) -> RegressionData:
        """The profile as a run of session 0 whose noise is known, phi_0 about the arm's frame."""
        out = RegressionData(correction, gain, self.features, block)
        T = np.eye(self.A.shape[1])
        arm, flange = correction.arm, prefixed_frame(correction.arm, self.frame)
        if flange is not None and flange != arm.frame:
            T[:10, :10] = np.linalg.inv(from_frame(arm, flange))
        A, b = T.T @ self.A @ T, self.b @ T
        if self.A.shape[1] < out.A.shape[1]:  # it knows nothing of what joints lose
            known = np.delete(np.arange(out.A.shape[1]), 10 + np.r_[correction.load])
            out.A[:, known[:, None], known], out.b[:, known] = A, b
        else:
            out.A, out.b = A, b
        out.noise = np.ones(self.n)
        if self.duration > 0.0:
            ratios = np.array([one.noise for one in self.sessions]) ** 2
            ratio = np.average(ratios, axis=0, weights=[one.duration for one in self.sessions])
            out.usual = self.duration, ratio * whole_noise(correction, SMOOTH)
        return out

    def start(self, correction: Correction) -> Scales:
        """The scales that a log of the arm begins with."""
        eta = self.scales.eta
        if len(eta) < correction.size:
            eta = np.insert(eta, correction.load.start, correction.prior_std[correction.load] ** 2)
        return replace(self.scales, eta=eta)

    def mounted(self, arm: Arm) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi_0 (10,) about the arm's frame, what is mounted in the profile's logs, and its covariance (10, 10)."""
        data = self.data(Correction(arm, rated_effort(arm)), GAIN, SMOOTH.block)
        found = solve([data], payload_prior_std(arm), None, SMOOTH, 1, self.start(data.correction))
        return found.phi, found.covariance

    def uncertainty(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviation (N, n) [N·m] of each joint's smooth torque at poses q (N, n), all else known."""
        f, root = self.features.of_pose(q), np.sqrt(self.scales.features)
        own, pose = self.A.shape[1] - self.features.size, slice(0, self.features.pose)
        out = np.empty((len(f), self.n))
        for j in range(self.n):
            K = root[j][:, None] * self.A[j, own:, own:] * root[j] + np.eye(self.features.size)
            scaled = f * root[j, pose]
            out[:, j] = np.sqrt(np.maximum(((scaled @ np.linalg.inv(K)[pose, pose]) * scaled).sum(axis=1), 0.0))
        return out

    def session(self, correction: Correction, number: int = 1) -> Session:
        """Another session of the arm."""
        return Session(number, 1.0, tuple(np.sqrt(self.drift) / correction.daily_std))


def remembered(sessions: Iterable[SessionRecord], most: int = MARKS) -> tuple[SessionRecord, ...]:
    """The sessions with at most so many marks.

    Of the session with the most marks those of every other, fourth, eighth value are kept, so that long streams do not
    make short logs be forgotten.
    """
    kept = list(sessions)
    while sum(len(one.marks) for one in kept) > most:
        k = max(range(len(kept)), key=lambda i: len(kept[i].marks))
        values = [int(mark, 16) for mark in kept[k].marks]
        every = 2
        while all(value % every == 0 for value in values):
            every *= 2
        marks = tuple(mark for mark, value in zip(kept[k].marks, values, strict=True) if value % every == 0)
        kept[k] = replace(kept[k], marks=marks)
    return tuple(kept)


def attached_mass(arm: Arm) -> float:
    """Mass of what counts as a part of the arm [kg]."""
    return 0.0 if arm.attached is None else arm.attached.mass


def fingerprint(arm: Arm) -> str:
    """Of an arm's links about its frame, whatever is attached (`link_fingerprint`)."""
    return link_fingerprint(replace(arm, attached=None))


def _fingerprint(arm: Arm, frame: str) -> str:
    return fingerprint(replace(arm, frame=frame))


def _text(vector: Iterable[float]) -> str:
    return ", ".join(f"{x:.3g}" for x in vector)

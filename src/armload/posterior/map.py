"""MAP least squares as an identifier, for logs and live robots; `smooth.py` adds the arm's smooth mismatch.

A log is a stream that ends: both go through the same rows and the same posterior (`stream.StreamingPosterior`).
`update` answers from the sequential posterior, in bounded time; `conclude` makes a last solution from all rows, and
`run` takes the samples of a log many at a time and concludes.
"""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_effort
from armload.errors import IdentificationError
from armload.estimators import ArmMismatch, Estimate, Identifier
from armload.posterior.checked_solver import CheckedSolver
from armload.posterior.evidence import Evidence
from armload.posterior.known import Known
from armload.posterior.profile import Profile
from armload.posterior.same_motion import SameMotion
from armload.posterior.scales import Posterior, Scales
from armload.posterior.stream import StreamingPosterior
from armload.posterior.tare import tare_data
from armload.recording import GAP, Recording, Sample
from armload.regression import Correction, GaussianPrior, JointFeatures, payload_prior_std, solution_prior_std
from armload.regression.information import SAME, RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import RIGID, NoiseModel
from armload.regression.pooling import LATE

# [s] a live answer is at most so old, and judged so often: faster than a controller takes up a new payload
# (test_an_answer_is_at_most_ten_milliseconds_old)
PUBLISH = 0.01
# [s] samples that come closer than this share the work of a row and of an answer between them: half of a row's spacing
FAST = 2.5e-3


class PosteriorLeastSquares(Identifier):
    """MAP least squares with the arm's rigid mismatch as an unknown, for any motion of any arm.

    >>> from armload.arms import arm
    >>> PosteriorLeastSquares(arm("panda")).name
    'map'

    Args:
        arm: the bare arm.
        tare: an earlier recording of the same arm, on any motion, with whatever was mounted then; estimates are
            relative to it.
        gain: λ of the lag [1/s].
        prior: what is known about the payload before; None: the weak prior of `solution_prior_std`.
        features: of the arm's smooth mismatch; None: those of the method, or of the profile where it has any.
        same_motion: whether a tare along the run's own motion takes the posterior's place in the `evidence`.
        profile: of this arm, learned from many logs; a tare is then of the run's own session. Estimates are relative
            to what was mounted in the profile's logs.

    Attributes:
        reference: an earlier run of the stream with the same mounted as at the tare; it is a tare, too.
        of_profile: the profile as a run, made of nothing else; None: there is no profile.
        fresh: whether the last update brought a new answer. data_t: time of the newest sample in the answer [s].
    """

    name = "map"
    _noise: NoiseModel = RIGID
    _iterations = 12  # of expectation–maximisation in a last solution; with features it settles in five
    _smooth = False  # whether the arm's smooth mismatch is an unknown, too
    _same_motion: SameMotion | None = None
    test_tare = True  # whether an answer tests that arm and gravity are as stated; episodes of a training do not
    # whether it follows a stream: nobody reads what looks wrong once more, and no row is taken alone of which no answer
    # is asked for
    live = False
    publish = PUBLISH  # [s] between two live answers; a service that speaks ten times a second asks for fewer
    louder = 1.0  # how large the noise is seen to be, in units of what the scales say; whoever watches the rows tells
    known: Known | None = None  # of the payload, apart from the log
    log_only: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None  # then the answer from the log only
    taken = False  # whether the last answer rests on what is known, too
    exchanged = False  # whether the last answer is rather the difference of two bodies, one put on for another
    _traits_frame: NDArray[np.float64] | None = None  # see `Evidence.of`: they are about the estimate's own frame

    def __init__(
        self,
        arm: Arm,
        tare: Recording | None = None,
        gain: float = GAIN,
        prior: GaussianPrior | None = None,
        *,
        features: JointFeatures | None = None,
        same_motion: bool = False,
        profile: Profile | None = None,
    ) -> None:
        self.arm, self.gain, self.prior, self.profile, self.session = arm, gain, prior, profile, SAME
        own = JointFeatures(arm.n) if self._smooth else JointFeatures(arm.n, 0, 0)
        self.features = features or (profile.features if self._smooth and profile is not None else own)
        if same_motion and tare is not None:
            self._same_motion = SameMotion(arm, tare, gain)
        self._weak, self._frame = payload_prior_std(arm), str(arm.frame)
        self._correction = Correction(arm, rated_effort(arm)) if profile is None else profile.correction(arm)
        self.reference: PosteriorLeastSquares | None = None
        self._stream: StreamingPosterior | None = None
        self._tares: list[RegressionData] = []
        self.of_profile: RegressionData | None = None
        self._start: Scales | None = None
        self._tare_time = 0.0 if tare is None else tare.duration
        if profile is not None:
            profile.check(arm)
            self.of_profile = profile.data(self._correction, gain, self._noise.block)
            self._tares.append(self.of_profile)
            self._start = profile.start(self._correction)
            self._tare_time += profile.duration
            self.session = profile.session(self._correction)
        if tare is not None:
            self._check(tare)
            if profile is None:
                data, self._start = tare_data(tare, arm, gain, self.features, self._noise, self._iterations)
                self._correction = data.correction
            else:  # the unknowns, and what begins a solution, are the profile's
                data = self.empty_data()
                data.add(tare.t, tare.q, tare.dq, tare.tau)
            self._tares.append(data)
        self.reset()

    def empty_data(self) -> RegressionData:
        """An empty regression of the kind this method accumulates."""
        return RegressionData(self._correction, self.gain, self.features, self._noise.block, self.session)

    # ------------------------------------------------------------------ samples in, estimates out

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        if self._stream is not None:
            self._stream.reset()
        self._count, self._elapsed, self._due = 0, 0.0, False
        self._now = self._row_t = self.data_t = -np.inf
        self._row_elapsed = 0.0
        self._squares, self._values = 0.0, 0
        self.fresh = False
        self._phi, self._covariance = self._before()

    def update(self, sample: Sample) -> Estimate:
        """Take one sample (t, q, dq, tau) and return the estimate so far, at most `publish` old."""
        if not self.live:  # whoever follows a stream has looked at each sample
            self._check_sample(sample)
        stream, step = self.stream, sample.t - self._now
        self._now, slow = sample.t, step > FAST
        self._elapsed += step if step <= GAP else 0.0
        self._count += 1
        self._squares += float(sample.dq @ sample.dq)
        self._values += len(sample.dq)
        new = stream.take(*sample)
        self.fresh = self._due and (slow or not new)  # of a fast stream, a row and an answer share no sample
        if new:  # it is due if it would be too old by the next row
            self._due = self._due or 2.0 * sample.t - self.data_t - self._row_t > LATE * self.publish
            self._row_t, self._row_elapsed = sample.t, self._elapsed
            self.fresh = self._due and slow
        if self.fresh:
            self._phi, self._covariance = self._answer(self._row_elapsed)
            self.data_t, self._due = self._row_t if stream.difference is None else stream.difference.t, False
        return self.last

    def conclude(self) -> Estimate:
        """The estimate from all samples so far, after a last solution: what `run` returns of the same samples."""
        return self._estimate(self._now)

    @property
    def last(self) -> Estimate:
        """The last answer."""
        return Estimate(self._now, self._phi, self._covariance, self._count, self._frame)

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        steps = np.diff(t, prepend=self._now)
        self._elapsed += float(steps[steps <= GAP].sum())  # an arm that was switched off gave no information meanwhile
        self._now = float(t[-1])
        self._count += len(t)
        self._squares += float(np.vdot(dq, dq))
        self._values += dq.size
        self.stream.take_many(t, q, dq, tau)

    def _estimate(self, t: float) -> Estimate:  # noqa: ARG002
        self.stream.conclude()
        self._phi, self._covariance = self._answer(self._elapsed, concluded=True)
        self.fresh, self._due, self.data_t = True, False, self._now
        return self.last

    def _before(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi and covariance before the first row."""
        if self.prior is not None:
            return self.prior.mean, self.prior.covariance
        return np.zeros(10), np.diag(self._weak**2)

    def _answer(
        self,
        elapsed: float,  # noqa: ARG002
        concluded: bool = False,  # noqa: ARG002
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """phi and covariance from the stream as it stands, `elapsed` seconds after the run began."""
        phi, covariance = self.stream.answer(self.louder)
        if self.known is None:
            return phi, covariance
        self.log_only, given = (phi, covariance), self.known.given(phi, covariance)
        self.taken = given is not None
        return given or self.log_only

    # ------------------------------------------------------------------ what the answer rests on

    @property
    def start(self) -> Scales | None:
        """The scales that the tare or the profile begin a solution with."""
        return self._start

    @property
    def stream(self) -> StreamingPosterior:
        """The posterior of the run."""
        if self._stream is None:
            tares, start = tuple(self._tares), self._start
            if self.reference is not None:
                earlier = self.reference.stream
                tares, start = (*earlier.tares, earlier.finish()), earlier.posterior.scales
            asks, given = self.test_tare, len(self._tares)
            solver = CheckedSolver(
                solution_prior_std(self.arm), self.prior, self._noise, self.session, asks, given, self.live
            )
            together = PUBLISH if self.live else 0.0
            about = (self.gain, self._iterations, self._same_motion, together)
            self._stream = StreamingPosterior(self._correction, self.features, solver, tares, start, *about)
        return self._stream

    @property
    def posterior(self) -> Posterior:
        """The last full solution, with the arm's mismatch and the residual.

        Raises:
            IdentificationError: no sample has been seen.
        """
        if not self._count:
            raise IdentificationError("no sample has been seen: call update or run first")
        return self.stream.posterior

    @property
    def known_arm_std(self) -> NDArray[np.float64] | None:
        """Standard deviation (10,) of the last solution under the weak prior, were the arm known exactly.

        (Σ_j ∫ W_jᵀ·W_j dt / S_j + diag(weak)⁻²)⁻¹: noise alone is left of what the rows do not fit.
        """
        if not self._count:
            return None
        unit = self._weak[:, None] * self.stream.information_of_known_arm * self._weak
        return self._weak * np.sqrt(np.diag(np.linalg.inv(np.eye(10) + unit)))

    @property
    def mismatch(self) -> ArmMismatch | None:
        """The side the torque seems to be measured on, the arm's offsets and its links, by the last solution."""
        if not self._count:
            return None
        found, std = self.posterior, self._correction.prior_std[-10 * self.arm.n :]
        links = float(np.sum((found.eta[-len(std) :][std > 0.0] / std[std > 0.0]) ** 2))
        offsets = (self._correction.offset(found.eta) / self._correction.expected_offset(found.eta)) ** 2
        return ArmMismatch(found.torque, offsets, links)

    def evidence(self, elapsed: float | None = None) -> Evidence:
        """What the logs say as the stream stands, without a prior on the payload, `elapsed` [s] after the run began."""
        stream, now = self.stream, self._elapsed if elapsed is None else elapsed
        evidence = stream if stream.difference is None else stream.difference
        earlier = 0.0 if self.reference is None else self.reference.stream.seconds
        speed, weak = float(np.sqrt(self._squares / max(self._values, 1))), self._weak
        difference = stream.difference is not None
        tare_time = self._tare_time + earlier
        if stream.without_tare:
            tare_time = sum(run.blocks.duration for run in stream.tares[1:])
        log = (evidence.information, evidence.vector, stream.posterior, now, tare_time, speed, weak, difference)
        return Evidence.of(*log, self._traits_frame)

    # ------------------------------------------------------------------ on a running robot

    def allow_for(self, drift: float) -> None:
        """Before the first sample: by how many daily deviations the arm may differ from what it was at its tare."""
        if drift > 0.0 and self._tares:
            # the profile has the size of the arm's own drift: then it is enough that it is another session's
            self.session = Session(1, drift) if self.profile is None else self.profile.session(self._correction, 2)
            self._stream = None

    def another(self, reference: PosteriorLeastSquares | None = None) -> Self:
        """Another run of the same arm, that has seen nothing yet.

        Args:
            reference: an earlier run with the same mounted as at the tare; it is a tare, too, and estimates are of
                what was added since.
        """
        other = copy(self)
        other._stream, other.reference = None, reference
        if self._same_motion is not None:
            other._same_motion = self._same_motion.fresh()
        other.reset()
        return other

    def prepare(self) -> None:
        """Do now what the first sample would have to wait for."""
        self.stream.prepare()

    def close(self) -> None:
        """Stop the thread that finds the scales; the identifier may go on."""
        if self._stream is not None:
            self._stream.close()

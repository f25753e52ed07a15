"""One solution of the MAP problem: unknowns eliminated joint by joint, scales improved step by step.

z = [payloads, eta, drifts] is what all joints share, g_j are the weights of joint j's own features. A drift is what
offsets and friction of a session differ by from those of session 0. Given the scales, all is linear and Gaussian;
`posterior.solve` says what is made of it.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.posterior.elimination import Eliminated, JointGaussian, RunInformation, eliminated
from armload.posterior.joint_gains import moved_by_joint, scale_of_joints, spread
from armload.posterior.scales import Posterior, Scales
from armload.posterior.sequential import SequentialPosterior
from armload.regression import GaussianPrior
from armload.regression.information import RegressionData
from armload.regression.mismatch import LEAST_FRICTION
from armload.regression.noise import NoiseModel, share_of_noise, whole_noise

# [m, m²] standard deviation of first moments and inertia per kilogram of what was mounted at a tare, so that its
# moments follow from its mass: bodies within about 20 cm of the frame's origin, a gripper. A stated prior
_REACH = np.array([0.2] * 3 + [0.2**2] * 6)
_LIGHTEST = 0.02  # [kg] of it: an arm that is said to hold nothing has cables and screws
# [effort limits] Coulomb friction, median over the joints, above which the torque is the motor's and not the link's:
# the prior standard deviation of a link's (`regression.mismatch`), a UR10e's motor currents show five times as much
# (test_gear_friction_in_the_torques_of_an_arm_that_nobody_knows_is_found_from_the_log)
_MOTOR_SIDE = 0.01
# of the torque, standard deviation of its calibration by its side: sensors are calibrated to half a per cent, motor
# constants known to a few per cent. Stated priors (test_the_torques_gain_widens_an_interval_by_its_own_share)
GAIN_STD = {"link": 0.005, "motor": 0.02}
# [effort limits] prior rms of a joint's smooth functions of pose and of velocity: 0.2–0.6 % of two Pandas is left after
# links, offsets and friction (`regression.features`); and the weight of these figures, in observations
_POSE, _VELOCITY, _FEATURE_COUNT = 3e-3, 2e-3, 20.0


def assumed_gain(arm: Arm, torque: str) -> float:
    """Relative standard deviation of the torque's scale, before a known weight tells it (`torque_gain`).

    torque: the side it seems to be measured on, "link" or "motor"; the arm's own figure is of the side of its sensors.
    """
    own = torque == ("motor" if arm.motor_torque else "link")
    return arm.torque_gain_std if own and arm.torque_gain_std is not None else GAIN_STD[torque]


def of_mounted(prior: NDArray[np.float64], mass: float, variance: float) -> NDArray[np.float64]:
    """Prior variance (10,) of what was mounted at a tare, its mass being known to a variance: its moments follow."""
    heaviest = max(abs(mass) + 2.0 * np.sqrt(max(variance, 0.0)), _LIGHTEST)
    return np.r_[prior[:1], np.minimum(prior[1:], (heaviest * _REACH) ** 2)]


class Problem:
    """One solution's fixed part: which unknowns a run sees, the stated priors.

    Arguments as of `solve.solve`; same: the last run has the same mounted as the others.
    """

    def __init__(
        self,
        runs: list[RegressionData],
        prior_std: NDArray,
        prior: GaussianPrior | None,
        noise: NoiseModel,
        same: bool = False,
    ) -> None:
        self.runs, self.noise_model, self.correction = runs, noise, runs[0].correction
        self.features = runs[0].features
        count, p = 1 if same else min(len(runs), 2), self.correction.size
        d = self.correction.drifting
        # the run's own session first: its rows go on
        own, others = runs[-1].session, {run.session for run in runs[:-1]} - {runs[-1].session}
        self.sessions = [s for s in (own, *sorted(others, key=lambda s: s.number)) if s.drift > 0.0]
        self.payloads, self.size = 10 * count, 10 * count + p + d * len(self.sessions)
        self.eta = slice(self.payloads, self.payloads + p)
        self.drift_variance = np.array([s.variance(self.correction) for s in self.sessions])
        self.last = slice(10 * (count - 1), 10 * count)
        self.payload_variance = np.tile(np.asarray(prior_std) ** 2, count)
        self.mean, self.root = np.zeros(self.size), None
        if prior is not None:
            self.mean[self.last], self.root = prior.mean, prior.root
        self.share = np.array([share_of_noise(run.blocks.duration) for run in runs])
        self._repeats = [max(1.0, run.blocks.duration / noise.novelty) for run in runs]  # of each run's noise
        self.expected = np.outer(self.share, whole_noise(self.correction, noise))  # (K, n)
        for k, run in enumerate(runs):
            if run.noise is not None:
                self.expected[k] = run.noise
        # these tell how large the last run's residual will be; a profile's logs, and parts of a log, tell their own
        self._tell = [] if same or noise.white else runs[:-1]
        self.selections = []
        for run in runs:
            E = np.zeros((10 + p, self.size))
            for i in range(count if run is runs[-1] else 1):
                E[:10, 10 * i : 10 * i + 10] = np.eye(10)
            E[10:, self.eta] = np.eye(p)
            if run.session in self.sessions:
                E[10 : 10 + d, self._drift(self.sessions.index(run.session))] = np.eye(d)
            self.selections.append(E)
        self._each = list(zip(runs, self.selections, strict=True))
        self.information = [RunInformation.of(run, E) for run, E in self._each]
        self._eliminated: tuple[Scales, Eliminated] | None = None  # and of which noise and features
        group = np.repeat([_POSE, _VELOCITY], [self.features.pose, self.features.velocity])
        self.feature_variance = (np.outer(self.correction.effort, group)) ** 2

    def _drift(self, k: int) -> slice:
        """Where z has the drift of the k-th session that drifts."""
        d = self.correction.drifting
        return slice(self.eta.stop + k * d, self.eta.stop + (k + 1) * d)

    def scales(self, start: Scales | None) -> Scales:
        """Where expectation–maximisation begins."""
        noise = self.expected.copy()
        if start is None:
            eta = self.correction.prior_std**2
            return Scales(noise, eta, self.feature_variance, self.payload_variance, self.drift_variance)
        noise[: len(start.noise)] = start.noise[: len(noise)]
        if len(start.noise) < len(noise):
            noise[-1] = self._of_the_last(noise[:-1])
        same = start.drifts.shape == self.drift_variance.shape
        drifts = start.drifts if same else self.drift_variance
        return Scales(noise, start.eta, start.features, self.payload_variance, drifts)

    def posterior(self, scales: Scales) -> JointGaussian:
        """z and g given the scales."""
        A, b, own, slope, rest = self._without_features(scales)
        root = np.diag(np.sqrt(scales.shared))
        if self.root is not None:
            root[self.last, self.last] = self.root
        P = root @ np.linalg.inv(root.T @ A @ root + np.eye(self.size)) @ root.T
        P = 0.5 * (P + P.T)
        return JointGaussian(self.mean + P @ (b - A @ self.mean), P, own, slope, rest)

    def sequential(self, scales: Scales) -> SequentialPosterior:
        """The same posterior as a state that takes further rows of the last run: phi last to be integrated out."""
        found = self._without_features(scales)
        first, last = self.last.start, self.last
        shared = np.r_[0:first, last.stop : self.size]
        order = np.r_[last.start : last.stop, shared]
        A, b, root = found.A, found.b, np.sqrt(scales.shared[shared])
        C = np.linalg.inv(root[:, None] * A[np.ix_(shared, shared)] * root + np.eye(len(root)))
        C = root[:, None] * (0.5 * (C + C.T)) * root
        slope, own = C @ A[shared][:, last], C @ b[shared]
        Λ, h = A[last, last] - A[last][:, shared] @ slope, b[last] - A[last][:, shared] @ own
        return SequentialPosterior(
            C=found.rest.copy(),
            own=found.own.copy(),
            slope=np.ascontiguousarray(found.slope[:, :, order]),
            shared_C=C,
            shared_own=own,
            shared_slope=np.ascontiguousarray(slope),
            information=0.5 * (Λ + Λ.T),
            vector=h,
            noise=scales.noise[-1].copy(),
            tares=first // 10,
            drifts=self.correction.drifting if self.runs[-1].session.drift > 0.0 else 0,
        )

    def _without_features(self, scales: Scales) -> Eliminated:
        """The runs with each g_j integrated out; to be read alone: the answer and the state share it."""
        seen = self._eliminated and self._eliminated[0]
        if seen is None or seen.noise is not scales.noise or seen.features is not scales.features:
            self._eliminated = scales, eliminated(self.information, scales.noise, scales.features)
        assert self._eliminated is not None
        return self._eliminated[1]

    def improved(self, scales: Scales, found: JointGaussian) -> Scales:
        """One step of expectation–maximisation, each scale held to its stated value by pseudo-observations."""
        z, P = found.mean, found.covariance
        variance = np.diag(P)
        eta, stated = scales.eta.copy(), self.correction.prior_std**2
        adaptive = self.correction.adaptive
        seen = z[self.eta] ** 2 + variance[self.eta]
        eta[adaptive] = 0.5 * (stated + seen)[adaptive]
        features = scales.features.copy()
        weights = found.weights
        if self.features.size:
            spread = np.einsum("jrr->jr", found.rest) + ((found.slope @ P) * found.slope).sum(axis=2)
            for part in (slice(0, self.features.pose), slice(self.features.pose, None)):
                size = weights[:, part].shape[1]
                total = (weights[:, part] ** 2 + spread[:, part]).sum(axis=1, keepdims=True)
                known = _FEATURE_COUNT * self.feature_variance[:, part]
                features[:, part] = (known + total) / (_FEATURE_COUNT + size)
        drifts = 0.5 * (self.drift_variance + (z**2 + variance)[self.eta.stop :].reshape(self.drift_variance.shape))
        return Scales(self._noise(found), eta, features, self._payloads(z, variance), drifts)

    def _of_the_last(self, noise: NDArray[np.float64]) -> NDArray[np.float64]:
        """S (n,) expected of the last run: no less than the runs before it have shown, whose S is `noise` (K - 1, n).

        The arm is the same, and what is expected of any arm is too little for many whose torque is motor current. As
        what is expected is the least of S (`NoiseModel.floor`), a run is never taken to be quieter than its tares.
        """
        seconds, shown = np.zeros(len(self._tell)), np.zeros((len(self._tell), self.correction.arm.n))
        for k, run in enumerate(self._tell):
            if run.usual is not None:
                seconds[k], shown[k] = run.usual
            elif run.noise is None:
                seconds[k] = run.blocks.duration
                shown[k] = noise[k] / (self.share[k] * self._repeats[k])
        if not seconds.any():
            return self.expected[-1]
        return np.maximum(self.expected[-1], self.share[-1] * np.average(shown, axis=0, weights=seconds))

    def _noise(self, found: JointGaussian) -> NDArray[np.float64]:
        """S of each run."""
        model, out = self.noise_model, []
        squares = found.squares(self.information) if model.white else None
        for k, (run, E) in enumerate(self._each):
            if run.noise is not None:
                out.append(run.noise)
                continue
            expected = self._of_the_last(np.array(out)) if run is self.runs[-1] else self.expected[k]
            spread = partial(found.spread, E) if self.features.size else None
            x = E @ found.mean
            S = run.residual_variance(x, expected, np.inf, found.weights, spread)
            S = np.maximum(S, expected) if model.floor else S
            if squares is not None:
                power = run.residual_power(x, found.weights) + squares[k] / max(run.blocks.duration, 1e-9)
                S = np.maximum(S, expected + 2.0 / run.gain * power)
            out.append(S * self._repeats[k])
        return np.array(out)

    def _payloads(self, z: NDArray, variance: NDArray) -> NDArray:
        """A light body has small moments: what was mounted at a tare seldom weighs much, and its moments follow."""
        now = self.payload_variance.copy()
        if self.last.start > 0:
            now[:10] = of_mounted(now[:10], z[0], variance[0])
        return now

    def answer(self, scales: Scales, found: JointGaussian) -> Posterior:
        """The payload of the last run."""
        phi, covariance = found.mean[self.last], found.covariance[self.last, self.last]
        eta = found.mean[self.eta]
        drift = self._drift(0) if self.runs[-1].session.drift > 0.0 else slice(0, 0)
        friction = float(np.median(np.abs(self.correction.coulomb(eta)) / self.correction.effort))
        torque = "motor" if self.correction.arm.motor_torque or friction > _MOTOR_SIDE else "link"
        gears = self.correction.arm.motor_torque or friction > LEAST_FRICTION
        precision = np.linalg.inv(covariance)
        if self.root is None:
            before, pull = np.diag(1.0 / self.payload_variance[self.last]), np.zeros(10)
        else:
            before = np.linalg.inv(self.root @ self.root.T)
            pull = before @ self.mean[self.last]
        gain = self.correction.gain_std or assumed_gain(self.correction.arm, torque)
        moved = self._moved(scales, found, gain) if self.correction.arm.motor_torque else None
        return Posterior(
            phi=phi,
            covariance=self.noise_model.overrated * covariance + gain**2 * np.outer(phi, phi) + spread(moved, phi),
            information=precision - before,
            vector=precision @ phi - pull,
            eta=eta,
            eta_std=np.sqrt(np.diag(found.covariance[self.eta, self.eta])),
            drift=found.mean[drift],
            drift_covariance=found.covariance[drift, drift],
            tilt=eta[self.correction.tilt],
            tilt_covariance=found.covariance[self.eta, self.eta][self.correction.tilt, self.correction.tilt],
            residual=np.sqrt(scales.noise[-1]),
            power=np.array([run.residual_power(E @ found.mean, found.weights) for run, E in self._each]),
            torque=torque,
            gears=gears,
            borne=self.runs[-1].rms_of(phi),
            gain_std=gain,
            moved=moved,
            scales=scales,
            ratios=self._ratios(scales, eta),
        )

    def _moved(self, scales: Scales, found: JointGaussian, gain: float) -> NDArray[np.float64]:
        """By what a scale of its own of each joint moves phi (n, 10, 10), 1 sigma."""
        run = self.runs[-1], self.selections[-1], scales.noise[-1]
        return moved_by_joint(*run, found.covariance[self.last], found.slope, scale_of_joints(gain))

    def _ratios(self, scales: Scales, eta: NDArray) -> dict[str, NDArray[np.float64]]:
        stated = self.correction.prior_std**2
        out = {
            "noise": scales.noise[-1] / (self._repeats[-1] * self.expected[-1]),
            "friction": self.correction.coulomb(scales.eta) / self.correction.coulomb(stated),
            "offset": self.correction.offset(eta**2) / self.correction.offset(stated),
        }
        for name, k in (("pose", 0), ("velocity", self.features.pose)):
            if self.features.size > k:
                out[name] = scales.features[:, k] / self.feature_variance[:, k]
        return out

"""The Bayesian Cramér–Rao bound of a motion: the smallest error any estimator can have in the mean.

    r = W·phi + Z·eta + G·g + e,    phi ~ N(m, P_phi), eta ~ N(0, P_eta), g ~ N(0, P_g), e of long-run variance S

    E[(phi^ − phi)·(phi^ − phi)ᵀ] ⪰ B = (Λ + P_phi⁻¹)⁻¹

Λ is the Schur complement of the information Σ_j ∫ X_jᵀ·X_j dt / S_j, X = [W Z G], onto phi: what the run (and a tare)
says about the payload once everything unknown about the arm is integrated out. The model is linear and Gaussian, so
that the posterior mean attains the bound, and Λ depends on where the arm was, not on the torque: a motion's bound is
known before it is run. It is the bound of the stated model. Scales that an estimator has to find first, the torque's
calibration and a mismatch outside the model come on top; an arm that is milder than stated may be known better.

Sources: van Trees 1968, ch. 2.4; van Trees & Bell, Bayesian Bounds, 2007.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm, rated_effort
from armload.errors import IdentificationError
from armload.inertia import NAMES, SHRINK, UNITS, Z95
from armload.motion import Motion
from armload.posterior.scales import Scales
from armload.posterior.solve import solve
from armload.recording import Recording
from armload.regression import Correction, GaussianPrior, JointFeatures, payload_prior_std
from armload.regression.information import SAME, RegressionData, Session
from armload.regression.lag import GAIN
from armload.regression.noise import SMOOTH, NoiseModel
from armload.regression.prior import within_reach
from armload.regression.rows import REGRESSOR_RATE

TIMES = (1.0, 3.0)  # [s] and the whole run: those that tables of errors have
_EARLIER = 0.95  # of the whole run: a time that is not worth a column of its own

_CHUNK = 4096  # samples at a time


@dataclass(frozen=True, eq=False)
class Bound:
    """What a motion can tell about a payload, at best.

    name: of the motion or log; tare: of the tare, None: there was none; robot, frame: whose payload, about which frame.
    times: (T,) [s] since the first sample.
    covariance: (T, 10, 10) the bound B at each time.
    prior_covariance: (10, 10) of what was known before.
    condition: (T,) condition number of the payload's own regressor W, each joint's rows divided by its √S and the
        columns scaled by (1, L, L²), L = 0.15 m; infinite where the motion leaves a combination of parameters out.
    scales: the variances that the bound rests on; change some of them (`dataclasses.replace`) and hand them back.
    """

    name: str
    tare: str | None
    robot: str
    frame: str
    times: NDArray[np.float64]
    covariance: NDArray[np.float64]
    prior_covariance: NDArray[np.float64]
    condition: NDArray[np.float64]
    scales: Scales

    @property
    def std(self) -> NDArray[np.float64]:
        """Smallest standard deviation of each parameter (T, 10)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def prior_std(self) -> NDArray[np.float64]:
        """Standard deviation of each parameter before the run (10,)."""
        return np.sqrt(np.diag(self.prior_covariance))

    @property
    def prior_half_width(self) -> NDArray[np.float64]:
        """Of the 95 % intervals before the run (10,), 1.96·prior_std."""
        return Z95 * self.prior_std

    @property
    def half_width(self) -> NDArray[np.float64]:
        """Of the 95 % intervals (T, 10), 1.96·std."""
        return Z95 * self.std

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Which parameters (T, 10) are determined: the half-width is at most a third of the prior's."""
        return self.std <= self.prior_std / SHRINK

    @property
    def combinations(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What the whole run tells about each combination of parameters, relative to what was known, the least first.

        Their standard deviations over those of the prior (10,), from 1 (no information) down, and their directions as
        rows (10, 10), in units of the parameters' prior standard deviations D: eigenvectors of D⁻¹·B·D⁻¹.
        """
        scale = self.prior_std
        values, vectors = np.linalg.eigh(self.covariance[-1] / np.outer(scale, scale))
        return np.sqrt(np.maximum(values[::-1], 0.0)), vectors.T[::-1]

    def __str__(self) -> str:
        after = "without a tare" if self.tare is None else f"after the tare {self.tare}"
        lines = [f"{self.robot}, {self.name}, {after}: smallest 95 % half-width about {self.frame}"]
        lines.append(" " * 14 + f"{'before':>10}" + "".join(f"{f'{t:.3g} s':>10}" for t in self.times))
        for k, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
            values = [self.prior_half_width[k], *self.half_width[:, k]]
            cells = "".join(f"{value:10.5f}" for value in values)
            lines.append(f"{name:>5} {unit:<8}{cells}" + ("" if self.determined[-1, k] else "  undetermined"))
        return "\n".join(lines)


def bound(
    arm: Arm,
    run: Recording | Motion,
    *,
    tare: Recording | Motion | None = None,
    noise: NoiseModel = SMOOTH,
    scales: Scales | None = None,
    features: JointFeatures | None = None,
    prior: GaussianPrior | None = None,
    mounted: ArrayLike | None = None,
    gain: float = GAIN,
    times: Sequence[float] | None = None,
    session: Session = SAME,
) -> Bound:
    """The Bayesian Cramér–Rao bound of the ten parameters along a run.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> found = bound(arm("panda"), taie2024(), tare=taie2024())
    >>> found.times, found.determined[-1].all()
    (array([1., 3., 6.]), np.True_)

    Args:
        arm: the bare arm, with the frame and gravity wanted.
        run: a log, of which q and dq count, or a motion, which counts as followed exactly.
        tare: an earlier run of the same arm, used whole; None: there is none.
        noise: what is expected of the residual.
        scales: the variances to take instead of those expected, where they are known better: of simulated worlds
            (`scales_of`), or as an estimator found them (`Posterior.scales`). `noise` (K, n) has a row for the tare,
            if there is one, and one for the run.
        features: of the smooth part of the arm's mismatch; None: those of `SmoothPosteriorLeastSquares`.
        prior: what is known about the payload before; None: the weak prior of `payload_prior_std`.
        mounted: standard deviation (10,) of what was mounted at the tare; zeros: the arm was bare, and that is known;
            None: anything within the weak prior.
        gain: λ of the lag [1/s].
        times: when to say [s], increasing, within the run; None: after 1 s, 3 s and the whole run.
        session: of the run; the tare's is session 0. By what it drifts, offsets and friction may differ from the
            tare's; its deviations are taken as they are, as if their sizes were known.

    Raises:
        IdentificationError: another number of joints than the arm's, times outside the run, or scales or what was
            mounted of another shape.
    """
    log = followed(arm, run)
    before = None if tare is None else followed(arm, tare)
    stops = _times(log, times)
    prior = GaussianPrior.weak(arm) if prior is None else prior
    correction = Correction(arm, rated_effort(arm))
    features = features or JointFeatures(arm.n)
    at_tare = payload_prior_std(arm) if mounted is None else np.asarray(mounted, dtype=float)
    _check_shapes(at_tare, scales, correction, features)

    def empty(session: Session = SAME) -> RegressionData:
        return RegressionData(correction, gain, features, noise.block, session)

    runs, now = [], empty(session)
    if before is not None:
        runs.append(empty())
        _add(runs[0], before, slice(None))
    runs.append(now)
    noise = replace(noise, overrated=1.0)  # a bound is of the model itself
    nothing = GaussianPrior(np.zeros(10), prior.covariance)  # with b = 0 the answer is phi = 0, whatever was measured
    covariances, conditions, first = [], [], 0
    for stop in stops:
        last = int(np.searchsorted(log.t, log.t[0] + stop + 1e-9, side="right"))
        _add(now, log, slice(first, last))
        first = last
        found = solve(runs, at_tare, nothing, noise, 1, scales)
        used = found.scales
        # a mismatch that repeats with the configuration does not average out beyond `novelty`
        repeats = np.array([max(1.0, data.blocks.duration / noise.novelty) for data in runs])
        if scales is None and np.any(repeats > 1.0):
            used = replace(used, noise=used.noise * repeats[:, None])
            found = solve(runs, at_tare, nothing, noise, 1, used)
        covariances.append(found.covariance)
        conditions.append(_condition(now.A[:, :10, :10], used.noise[-1]))
    return Bound(
        log.source,
        None if before is None else before.source,
        arm.name,
        str(arm.frame),
        stops,
        np.array(covariances),
        np.array(prior.covariance),
        np.array(conditions),
        used,
    )


def efficiency(errors: ArrayLike, bounds: Bound | Sequence[Bound]) -> NDArray[np.float64]:
    """Bound over error: 1 for an estimator that leaves nothing in the data, 0.5 for one with twice the error.

    Above 1, by more than chance, the arms and payloads of the table were milder than the model of the bound says, as
    simulated ones are than what an estimator expects of real ones: `scales_of` has theirs.

    Args:
        errors: root mean square error of each parameter (10,) after the whole runs, or (T, 10) at the bounds' times.
        bounds: of the runs that the errors are of; several are averaged as variances.

    Raises:
        IdentificationError: no bounds, shapes that do not match, or an error that is not a positive number.
    """
    several = [bounds] if isinstance(bounds, Bound) else list(bounds)
    rms = np.asarray(errors, dtype=float)
    if not several:
        raise IdentificationError("efficiency needs at least one bound: give those of the runs the errors are of")
    if not np.all(np.isfinite(rms)) or np.any(rms <= 0.0):
        raise IdentificationError("errors must be positive numbers: give root mean squares over many cases")
    if len({len(b.times) for b in several}) > 1:
        raise IdentificationError("the bounds are of different numbers of times: expected the same of all")
    best = np.sqrt(np.mean([b.std**2 for b in several], axis=0))
    if rms.shape not in ((10,), best.shape):
        raise IdentificationError(f"the errors have shape {rms.shape}: expected (10,) or {best.shape}")
    return best[-1] / rms if rms.ndim == 1 else best / rms


def followed(arm: Arm, run: Recording | Motion, rate: float = REGRESSOR_RATE) -> Recording:
    """A log as it is; a motion as the log of an arm that follows it exactly and carries nothing.

    Raises:
        IdentificationError: another number of joints than the arm's.
    """
    if run.n != arm.n:
        what = f"the motion {run.name!r}" if isinstance(run, Motion) else run.source
        raise IdentificationError(f"{what} moves {run.n} joints: {arm.name} has {arm.n}")
    if isinstance(run, Recording):
        return run
    t = run.instants(rate)
    q, dq, ddq = run(t)
    return Recording(t, q, dq, arm.torque(q, dq, ddq), source=run.name)


def _times(log: Recording, times: Sequence[float] | None) -> NDArray[np.float64]:
    if times is None:
        return np.array([*(t for t in TIMES if t < _EARLIER * log.duration), log.duration])
    stops = np.asarray(times, dtype=float)
    inside = stops.ndim == 1 and len(stops) and np.all(stops > 0.0) and np.all(stops <= log.duration + 1e-9)
    if not inside or np.any(np.diff(stops) <= 0.0):
        raise IdentificationError(
            f"the times {np.round(stops, 6).tolist()} are not possible: expected increasing seconds after the start of "
            f"{log.source}, up to its end at {log.duration:.6g} s"
        )
    return stops


def _check_shapes(
    mounted: NDArray[np.float64], scales: Scales | None, correction: Correction, features: JointFeatures
) -> None:
    if mounted.shape != (10,) or not np.all(np.isfinite(mounted)) or np.any(mounted < 0.0):
        raise IdentificationError(
            f"what was mounted at the tare has shape {mounted.shape}: expected the standard deviations (10,) of its "
            "parameters, finite and not negative"
        )
    if scales is None:
        return
    found, expected = (scales.eta.shape, scales.features.shape), ((correction.size,), (features.n, features.size))
    if found != expected:
        raise IdentificationError(
            f"the scales of eta and of the features have shapes {found}: expected {expected}; take them from a "
            "solution of the same arm with the same features"
        )


def _add(data: RegressionData, log: Recording, rows: slice) -> None:
    """Take rows of a log; b is forgotten: where the arm was counts, not what was measured."""
    start, stop, _ = rows.indices(len(log))
    for k in range(start, stop, _CHUNK):
        part = slice(k, min(k + _CHUNK, stop))
        data.add(log.t[part], log.q[part], log.dq[part], log.tau[part])
    data.b[:] = 0.0


def _condition(A: NDArray[np.float64], S: NDArray[np.float64]) -> float:
    """Condition number of the payload's regressor, from its information (n, 10, 10) and the noise (n,)."""
    scale = within_reach(1.0)
    values = np.linalg.eigvalsh(np.einsum("jab,j->ab", A, 1.0 / S) * np.outer(scale, scale))
    least = len(scale) * np.finfo(float).eps * values[-1]
    return float(np.sqrt(values[-1] / values[0])) if values[0] > least else np.inf

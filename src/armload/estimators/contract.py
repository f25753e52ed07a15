"""The stream contract: every way of identifying a payload, learned or not, is an `Identifier`.

    identifier.reset()
    for sample in recording:
        estimate = identifier.update(sample)
    estimate = identifier.conclude()

A log is a stream that ends: `run` takes its samples many at a time and concludes. `Tared` is for what was added since a
tare.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.inertia import NAMES, UNITS, Z95, InertialParameters
from armload.recording import BLOCK, Recording, Sample


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """What is known about the payload after the samples up to time t.

    t: time of the last sample used [s].
    phi: the ten parameters (10,) about the origin of `frame`.
    covariance: (10, 10), what the method itself believes; infinite diagonal where it knows nothing.
    n_samples: samples used.
    frame: the payload frame.
    """

    t: float
    phi: NDArray[np.float64]
    covariance: NDArray[np.float64]
    n_samples: int
    frame: str

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviation of each parameter (10,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def parameters(self) -> InertialParameters:
        """phi with its frame, ready to move, add, subtract or reorder."""
        return InertialParameters(self.phi, self.frame)

    def __str__(self) -> str:
        half = Z95 * self.std
        rows = [f"{n:>5} = {v:+.5f} ± {h:.5f} {u}" for n, v, h, u in zip(NAMES, self.phi, half, UNITS, strict=True)]
        return f"payload about {self.frame} after {self.n_samples} samples, ± 95 %:\n" + "\n".join(rows)

    def __repr__(self) -> str:
        mass = f"{self.phi[0]:.3f} ± {Z95 * self.std[0]:.3f} kg"
        return f"<{type(self).__name__}: {mass} about {self.frame}, {self.n_samples} samples>"


class ArmMismatch(NamedTuple):
    """What a method found of the arm beside the payload.

    torque: "link" or "motor", the side the torque seems to be measured on.
    offset_ratios: squared torque offsets (n,) over their expected variance.
    links: by how much the links differ from the model's: squared errors over their expected variance, summed.
    """

    torque: str
    offset_ratios: NDArray[np.float64]
    links: float = 0.0


class Identifier(ABC):
    """A payload identifier: samples one at a time or many, constant memory, no acceleration needed from the caller.

    Subclasses implement `reset`, `_take` (the next N samples) and `_estimate` (what follows from all samples so far); a
    method with an answer of its own for a running stream overrides `update`.

    Attributes:
        name: how tables and the command line call the method.
        calibrated: whether ±1.96 standard deviations were checked to hold on episodes held out.
        payload_prior: what the method knew of the payload beforehand, mean and standard deviation (10,), if that is its
            own knowledge; None: nothing, or the weak prior.
    """

    name: str
    arm: Arm
    calibrated: bool = False
    payload_prior: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    _now: float = np.nan  # time of the last sample

    @property
    def weak_std(self) -> NDArray[np.float64] | None:
        """Standard deviation (10,) of the last estimate under a weak payload prior instead; None: it is that one."""
        return None

    @property
    def unprojected(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Mean (10,) and covariance (10, 10) of what the data say, of a method whose phi was made a body since.

        None: phi and its covariance are that themselves.
        """
        return None

    @property
    def known_arm_std(self) -> NDArray[np.float64] | None:
        """Standard deviation (10,) of the last solution under a weak payload prior, were the arm known exactly.

        What even then is not determined a tare does not tell either. None: the method does not say.
        """
        return None

    @property
    def mismatch(self) -> ArmMismatch | None:
        """What was found of the arm with the last solution; None: the method asks nothing of it."""
        return None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name} for {self.arm.name} about {self.arm.frame}>"

    @abstractmethod
    def reset(self) -> None:
        """Forget everything; the next sample is the first."""

    @abstractmethod
    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        """Take the next N samples: (N,) and three times (N, n)."""

    @abstractmethod
    def _estimate(self, t: float) -> Estimate:
        """The estimate from all samples so far, the last of them at t."""

    def update(self, sample: Sample) -> Estimate:
        """Take one sample (t, q, dq, tau) and return the estimate so far.

        Times must rise from sample to sample: they are not checked here. `OnlineIdentifier` leaves out what does not.

        Raises:
            IdentificationError: it is no `Sample` of arrays, of another number of joints, or holds a number that is not
                finite.
        """
        self._check_sample(sample)
        self._now = float(sample.t)
        self._take(np.array([sample.t]), sample.q[None], sample.dq[None], sample.tau[None])
        return self._estimate(self._now)

    def conclude(self) -> Estimate:
        """The estimate from all samples so far, with a last solution where `update` saves one: what `run` returns."""
        return self._estimate(self._now)

    def trace(self, recording: Recording, every: int = 1) -> list[Estimate]:
        """The estimates along a recording, from `reset` on: one per `every` samples, and always the last."""
        self._check(recording)
        return self._along(recording, [*range(1, len(recording), every), len(recording)])

    def at(self, recording: Recording, times: ArrayLike) -> list[Estimate]:
        """The estimates `times` [s] after a recording's first sample, from `reset` on; nothing is solved in between.

        Each rests on all samples up to then, the first at least; a time beyond the end means the end.

        Raises:
            IdentificationError: times that are not a rising sequence of numbers from 0 on.
        """
        self._check(recording)
        stops = samples_until(recording, times)
        found = dict(zip(distinct := np.unique(stops).tolist(), self._along(recording, distinct), strict=True))
        return [found[k] for k in stops.tolist()]

    def run(self, recording: Recording) -> Estimate:
        """The estimate after the whole recording."""
        self._check(recording)
        return self._along(recording, [len(recording)])[-1]

    def _along(self, recording: Recording, stops: list[int]) -> list[Estimate]:
        """The estimates after so many samples each, from `reset` on; `stops` rise."""
        self.reset()
        out = []
        for start, stop in zip([0, *stops], stops, strict=False):
            for k in range(start, stop, BLOCK):
                part = slice(k, min(k + BLOCK, stop))
                self._take(recording.t[part], recording.q[part], recording.dq[part], recording.tau[part])
            self._now = float(recording.t[stop - 1])
            out.append(self._estimate(self._now))
        return out

    def _check(self, recording: Recording) -> None:
        if recording.n != self.arm.n:
            raise IdentificationError(
                f"{recording.source} has {recording.n} joints: {self.arm.name} has {self.arm.n}; name the right robot"
            )

    def _check_sample(self, sample: Sample) -> None:
        """What `update` asks of a sample, whoever overrides it."""
        self._check_size(sample)
        t, q, dq, tau = sample
        if not math.isfinite(t + q @ q + dq @ dq + tau @ tau):
            raise IdentificationError(
                f"the sample at {t:.6g} s holds a number that is not finite: leave it out, as OnlineIdentifier does"
            )

    def _check_size(self, sample: Sample) -> None:
        """Compiled code reads as many numbers as the arm has joints."""
        if not isinstance(sample, Sample):
            raise IdentificationError(f"a {type(sample).__name__} was given: expected a Sample(t, q, dq, tau)")
        _, q, dq, tau = sample
        if not (isinstance(q, np.ndarray) and isinstance(dq, np.ndarray) and isinstance(tau, np.ndarray)):
            kinds = ", ".join(type(x).__name__ for x in (q, dq, tau))
            raise IdentificationError(f"q, dq and tau of a sample are {kinds}: expected arrays of NumPy")
        if not q.shape == dq.shape == tau.shape == (self.arm.n,):
            raise IdentificationError(
                f"a sample has q, dq and tau of shapes {q.shape}, {dq.shape} and {tau.shape}: expected {self.arm.n} "
                f"numbers each, one for each joint of {self.arm.name}; name the right robot"
            )


class Tared(Identifier):
    """Any method relative to what it says of a tare, its virtual calibration object: phi(run) − phi(tare).

    The tare counts as the mean of the estimates along its second half, as in Kurdas et al., ICRA 2022; the covariances
    add. A method that uses the tare's log itself does better (`PosteriorLeastSquares`).

    Args:
        identifier: the method; it identifies the tare at once.
        tare: an earlier log of the same arm, on any motion, with whatever was mounted then.

    Attributes:
        before: the virtual calibration object.
    """

    def __init__(self, identifier: Identifier, tare: Recording) -> None:
        self.name, self.arm = identifier.name, identifier.arm
        estimates = identifier.trace(tare, every=max(1, len(tare) // 100))
        second_half = [estimate.phi for estimate in estimates[len(estimates) // 2 :]]
        self.before = replace(estimates[-1], phi=np.mean(second_half, axis=0))
        self._identifier = identifier
        self.reset()

    def reset(self) -> None:
        """Forget the run (not the tare); the next sample is the first."""
        self._identifier.reset()

    def _check(self, recording: Recording) -> None:
        self._identifier._check(recording)

    def _take(self, t: NDArray, q: NDArray, dq: NDArray, tau: NDArray) -> None:
        self._identifier._take(t, q, dq, tau)

    def _estimate(self, t: float) -> Estimate:
        estimate, before = self._identifier._estimate(t), self.before
        return replace(estimate, phi=estimate.phi - before.phi, covariance=estimate.covariance + before.covariance)


def samples_until(recording: Recording, times: ArrayLike) -> NDArray[np.int_]:
    """How many samples (T,) a recording has `times` (T,) [s] after its first, that one included.

    Raises:
        IdentificationError: times that are not a rising sequence of numbers from 0 on.
    """
    wanted = np.asarray(times, dtype=float)
    if wanted.ndim != 1 or not wanted.size or not wanted[0] >= 0.0 or not np.all(np.diff(wanted) > 0.0):
        raise IdentificationError(
            f"the times asked for are {np.round(wanted, 6).tolist()}: expected rising seconds from 0 on, counted from "
            "the recording's first sample"
        )
    # a nanosecond's slack: a sample that rounding puts behind its own time counts
    return np.searchsorted(recording.t, recording.t[0] + wanted + 1e-9, side="right")

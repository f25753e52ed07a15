"""Sensors: from the true joint signals to those of a log.

Each effect is one field of `Sensors`; `dataclasses.replace(sensors, vibration=None)` switches one off. In order: lag
behind the command, skew between channels, vibration, white noise, quantisation, jitter of the stamps, lost samples.

An arm's sheet holds its figures where they were measured, as on a Panda's log at 1 kHz. There, the velocity channel is
aligned with the position channel to 0.3 ms, so no skew is modelled between them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import ARMS, Arm, ArmFacts, facts_of, rated_effort
from armload.errors import ArmError
from armload.recording import Recording

_BAND = (15.0, 120.0)  # [Hz] of the vibration
_VIBRATION_RATE = 1000.0  # [Hz] at least; slower logs see the vibration aliased, as they do in reality
_MOVING = 0.05  # [rad/s] norm of dq at which the vibration reaches tanh(1) = 76 % of its size
_BURST = 0.5  # probability that a gap goes on for another sample


@dataclass(frozen=True, eq=False)
class Sensors:
    """What the sensors add; None or 0 switches an effect off.

    >>> from dataclasses import replace
    >>> from armload.arms import arm
    >>> quiet = replace(Sensors.panda(arm("panda")), vibration=None, lost=0.0)
    >>> quiet.lost
    0.0

    Args:
        torque_noise, velocity_noise, position_noise: white, standard deviation (n,) [N·m, rad/s, rad].
        vibration: torque coloured 15–120 Hz, rms (n,) while the arm moves [N·m].
        torque_quantum: step (n,) of the torque values [N·m].
        command_lag: all channels late behind the motion's clock [s].
        velocity_skew, torque_skew: these channels late behind the position channel [s].
        jitter: standard deviation of the time stamps [s], at most ± 0.4 sample times each.
        lost: fraction of the samples that never arrive, in bursts of 2 on average.
    """

    torque_noise: NDArray[np.float64] | None = None
    velocity_noise: NDArray[np.float64] | None = None
    position_noise: NDArray[np.float64] | None = None
    vibration: NDArray[np.float64] | None = None
    torque_quantum: NDArray[np.float64] | None = None
    command_lag: float = 0.0
    velocity_skew: float = 0.0
    torque_skew: float = 0.0
    jitter: float = 0.0
    lost: float = 0.0

    @classmethod
    def ideal(cls) -> Sensors:
        """Every effect off."""
        return cls()

    @classmethod
    def panda(cls, arm: Arm) -> Sensors:
        """As measured on a Franka Emika Panda, for any arm of as many joints.

        Raises:
            ArmError: the arm does not have 7 joints.
        """
        panda = ARMS["panda"]
        if arm.n != panda.joints:
            raise ArmError(
                f"{arm.name} has {arm.n} joints: the Panda's sensors have {panda.joints}; use Sensors.generic(arm)"
            )
        return cls.measured(panda)

    @classmethod
    def measured(cls, facts: ArmFacts) -> Sensors:
        """As an arm's sheet says; ideal in what it leaves out."""
        figures: dict[str, Any] = facts.sensors or {}
        arrays: dict[str, Any] = {name: np.array(x) if isinstance(x, tuple) else x for name, x in figures.items()}
        return cls(**arrays)

    @classmethod
    def generic(cls, arm: Arm) -> Sensors:
        """The Panda's figures in proportion to the joints' rated torque, for an arm that was not measured."""
        effort, like = rated_effort(arm), ARMS["panda"]
        return replace(
            cls.measured(like),
            torque_noise=5e-4 * effort,
            velocity_noise=np.full(arm.n, max(like.velocity_noise or (0.0,))),
            position_noise=np.full(arm.n, max(like.position_noise or (0.0,))),
            vibration=4e-3 * effort,
            torque_quantum=4e-4 * effort,
        )

    @classmethod
    def of(cls, arm: Arm) -> Sensors:
        """As the arm's sheet says, or the like for an arm that was not measured."""
        facts = facts_of(arm)
        return cls.generic(arm) if facts is None or facts.sensors is None else cls.measured(facts)

    def evenly(self) -> Sensors:
        """The same sensors with a log that is evenly spaced and complete."""
        return replace(self, jitter=0.0, lost=0.0)

    def observe(self, truth: Recording, seed: int = 0) -> Recording:
        """What these sensors make of a noise-free recording (the same for the same seed)."""
        names = [f.name for f in fields(self)]
        if all(getattr(self, name) is None or np.all(getattr(self, name) == 0.0) for name in names):
            return truth
        for name in ("torque_noise", "velocity_noise", "position_noise", "vibration", "torque_quantum"):
            value = getattr(self, name)
            if value is not None and np.shape(value) not in ((), (truth.n,)):
                raise ArmError(
                    f"{name} of the sensors has shape {np.shape(value)}: expected ({truth.n},), one per joint"
                )
        # one stream per effect: switching one off leaves the others' noise as it was
        streams = dict(zip(names, np.random.SeedSequence([seed, 2]).spawn(len(names)), strict=True))
        rng = {name: np.random.default_rng(stream) for name, stream in streams.items()}
        t = truth.t
        q = _late(t, truth.q, self.command_lag)
        dq = _late(t, truth.dq, self.command_lag + self.velocity_skew)
        tau = _late(t, truth.tau, self.command_lag + self.torque_skew)
        if self.vibration is not None:
            moving = np.tanh(np.linalg.norm(dq, axis=1, keepdims=True) / _MOVING)
            tau = tau + self.vibration * moving * _coloured(t, truth.n, rng["vibration"])
        tau = tau + _white(self.torque_noise, tau, rng["torque_noise"])
        dq = dq + _white(self.velocity_noise, dq, rng["velocity_noise"])
        q = q + _white(self.position_noise, q, rng["position_noise"])
        if self.torque_quantum is not None:
            quantum = np.broadcast_to(self.torque_quantum, (truth.n,))
            tau = np.where(quantum > 0, np.round(tau / np.where(quantum > 0, quantum, 1.0)) * quantum, tau)
        if self.jitter > 0:
            bound = 0.4 * np.min(np.diff(t))
            t = t + np.clip(self.jitter * rng["jitter"].normal(size=len(t)), -bound, bound)
        seen = replace(truth, t=t, q=q, dq=dq, tau=tau)
        if self.lost > 0:
            seen = seen.select(_arrives(len(t), self.lost, rng["lost"]))
        return seen


def _late(t: NDArray, signal: NDArray, delay: float) -> NDArray[np.float64]:
    """The signal `delay` seconds ago; before the log it stood as at its start."""
    from scipy.interpolate import CubicSpline

    return signal if delay == 0 else CubicSpline(t, signal)(np.maximum(t - delay, t[0]))


def _white(sigma: NDArray | None, like: NDArray, rng: np.random.Generator) -> NDArray[np.float64] | float:
    return 0.0 if sigma is None else sigma * rng.normal(size=like.shape)


def _coloured(t: NDArray, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Gaussian noise (N, n) of unit rms and a flat spectrum in the vibration's band, at even times t."""
    h = (t[-1] - t[0]) / (len(t) - 1)
    finer = max(1, int(np.ceil(_VIBRATION_RATE * h - 1e-9)))
    length = finer * len(t)
    frequency = np.fft.rfftfreq(length, h / finer)
    in_band = (frequency >= _BAND[0]) & (frequency <= _BAND[1])
    count = int(in_band.sum())
    if count == 0:  # a log too short for the band
        return np.zeros((len(t), n))
    spectrum = np.zeros((len(frequency), n), dtype=complex)
    spectrum[in_band] = (rng.normal(size=(2, count, n)) * [[[1.0]], [[1j]]]).sum(axis=0)
    return np.fft.irfft(spectrum, length, axis=0)[::finer] * length / np.sqrt(4.0 * count)


def _arrives(length: int, lost: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Which samples arrive: a two-state chain; gaps last 1/(1 − _BURST) samples on average."""
    if not 0 <= lost < 0.9:
        raise ArmError(f"the sensors lose a fraction of {lost} of the samples: expected 0 ≤ lost < 0.9")
    begin = (1.0 - _BURST) * lost / (1.0 - lost)  # stationary share of the lost state: begin/(begin + 1 − _BURST)
    u = rng.random(length)
    arrives = np.empty(length, dtype=bool)
    gone = False
    for k in range(length):
        gone = u[k] < (_BURST if gone else begin)
        arrives[k] = not gone
    arrives[[0, -1]] = True
    return arrives

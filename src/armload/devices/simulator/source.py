"""The simulator as a source: an arm that goes on moving while its payload comes, goes and changes.

The physics is `simulate.ContinuedRun`: pieces of a quarter of a second, rolled out natively when they are due, so that
it can go on for days. What the sensors add is made piece by piece too; a piece is observed together with the end of the
one before it, from which its lags reach back.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.devices.pace import Pace
from armload.devices.source import Source
from armload.errors import PayloadError
from armload.inertia import InertialParameters
from armload.motion import EndlessMotion, Motion, excitation
from armload.recording import Recording, Sample
from armload.simulation import ContinuedRun, Sensors, World

_PIECE = 0.25  # [s]
_BEFORE = 0.05  # [s] of the piece before that the sensors still see: more than their lags


class Simulator(Source):
    """A simulated arm, for ever or for a time.

    >>> from armload.arms import arm
    >>> from armload.payloads import test_payload
    >>> panda = arm("panda")
    >>> with Simulator(panda, payloads=[(1.0, test_payload())], speed=None, duration=1.5, rate=100.0) as simulator:
    ...     samples = list(simulator)
    >>> len(samples), simulator.truth(0.5).mass, round(simulator.truth(1.2).mass, 3) > 0
    (150, 0.0, True)

    Args:
        arm: as its controller and the identification know it.
        motion: repeated endlessly; None: the one designed for the arm, a random one elsewhere.
        payloads: (time [s], payload) pairs in the order of time: from that time on the arm holds this payload, None
            nothing. Before the first it holds nothing.
        world: the arm as it really is; None: nominal.
        sensors: None: ideal.
        rate: [Hz].
        speed: 1: real time; 2: twice as fast; None: as fast as possible.
        duration: [s]; None: for ever.
        seed: of the sensors' noise and of a random motion.
        ahead: how much is computed at once [s]. comes_to_rest: see `ContinuedRun`.

    Raises:
        PayloadError: times out of order, or a payload that is none.
        MotionError: the motion cannot be repeated, or is of another arm.
        SourceError: the speed is not a positive number.
    """

    def __init__(
        self,
        arm: Arm,
        motion: Motion | None = None,
        payloads: Sequence[tuple[float, Any]] = (),
        *,
        world: World | None = None,
        sensors: Sensors | None = None,
        rate: float = 1000.0,
        speed: float | None = 1.0,
        duration: float | None = None,
        seed: int = 0,
        ahead: float = _PIECE,
        comes_to_rest: bool = False,
    ) -> None:
        if motion is None:
            motion = excitation(arm, seed)
        self.arm = arm
        self.motion = EndlessMotion(motion)
        self.name = f"simulated {arm.name}"
        self.n = arm.n
        self.rate = rate
        self._scheduling = threading.Lock()
        self._times, self._payloads = _schedule(payloads, arm)
        self._world, self._sensors, self._seed = world, sensors, seed
        self._end = None if duration is None else round(duration * rate)
        self._pace = Pace(speed)
        self._piece, self._comes_to_rest = max(2, round(ahead * rate)), comes_to_rest
        self._row = 0  # the first that is not computed yet
        self.speed = speed or 1.0

    def __iter__(self) -> Iterator[Sample]:
        for t, q, dq, tau in self._pieces():
            for row in zip(t.tolist(), q, dq, tau, strict=True):
                if not self._pace.wait(row[0]):
                    return
                yield Sample(*row)

    def close(self) -> None:
        """End the simulation; an iteration that waits ends at once."""
        self._pace.stop()

    def arrived(self) -> float | None:
        """When the sample handed on last was due; None without a clock."""
        return self._pace.due

    @property
    def simulated(self) -> bool:
        """It is."""
        return True

    def hold(self, payload: Any | None, t: float | None = None) -> float:
        """Another payload from t [s] on, or from the next sample that is not computed yet; None: nothing is held.

        Returns:
            From when on [s].

        Raises:
            PayloadError: it is none.
        """
        with self._scheduling:
            times, held = _schedule([(self._row / self.rate if t is None else t, payload)], self.arm)
            before = self._times < times[1]
            self._payloads = [*(p for p, kept in zip(self._payloads, before, strict=True) if kept), held[1]]
            self._times = np.append(self._times[before], times[1])
        return float(times[1])

    def truth(self, t: float) -> InertialParameters:
        """What the arm holds at time t; ten zeros where it holds nothing."""
        with self._scheduling:
            return self._payloads[int(np.searchsorted(self._times, t, side="right")) - 1]

    def _pieces(self) -> Iterator[tuple[NDArray, NDArray, NDArray, NDArray]]:
        """The run, as the sensors show it, in pieces that end where the payload changes."""
        start = int(np.searchsorted(self._changes(), 0, side="right")) - 1
        about: Any = {"world": self._world, "rate": self.rate, "seed": self._seed, "comes_to_rest": self._comes_to_rest}
        run = ContinuedRun(self.arm, self.motion, self._payloads[start], **about)
        before = None
        while self._end is None or self._row < self._end:
            with self._scheduling:
                row, changes = self._row, self._changes()
                k = int(np.searchsorted(changes, row, side="right"))
                held = self._payloads[k - 1] if row and changes[k - 1] == row else None
                stops = [row + self._piece, *changes[k : k + 1].tolist(), *([] if self._end is None else [self._end])]
                self._row = min(stops)
            if held is not None:
                run.hold(held)
            exact = run.advance(self._row - row)
            seen, before = (exact, None) if self._sensors is None else self._observed(exact, before, row)
            yield seen

    def _changes(self) -> NDArray:
        """Rows from which on another payload is held; of what changes in one, the last wins."""
        return np.ceil(np.maximum(self._times, 0.0) * self.rate - 1e-9).astype(int)

    def _observed(self, exact: tuple, before: tuple | None, row: int) -> tuple[tuple, tuple]:
        """What the sensors make of a piece that follows another, and what the next one has to see of both."""
        assert self._sensors is not None
        t, q, dq, tau = exact if before is None else map(np.concatenate, zip(before, exact, strict=True))
        behind = tuple(x[-max(2, round(_BEFORE * self.rate)) :] for x in (t, q, dq, tau))
        if len(t) < 2:  # a single sample has no lag and no spectrum
            return exact, behind
        seed = int(np.random.SeedSequence([self._seed, row]).generate_state(1)[0])
        log = self._sensors.observe(Recording(t, q, dq, tau), seed)
        new = log.t > (exact[0][0] - 0.5 / self.rate)  # stamps jitter by less than half a sample
        return (log.t[new], log.q[new], log.dq[new], log.tau[new]), behind


def _schedule(payloads: Sequence[tuple[float, Any]], arm: Arm) -> tuple[NDArray, list[InertialParameters]]:
    """Times, the first before all others, and what is held from each on."""
    times, held = [-np.inf], [InertialParameters(np.zeros(10), arm.frame)]
    for t, payload in payloads:
        parameters = getattr(payload, "parameters", payload)
        if parameters is None:
            parameters = held[0]
        if not isinstance(parameters, InertialParameters):
            raise PayloadError(
                f"the payload at {t} s is a {type(payload).__name__}: expected InertialParameters, a Payload or None"
            )
        if not (np.isfinite(t) and t > times[-1]):
            raise PayloadError(f"a payload comes at {t} s after one at {times[-1]} s: expected increasing times")
        times.append(float(t))
        held.append(arm.as_payload(parameters))
    return np.array(times), held

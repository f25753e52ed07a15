"""What a live identifier says at one instant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from armload.estimators import Estimate
from armload.identification.intervals import Before, phi_interval
from armload.inertia import is_consistent, phi_to_com
from armload.online.event import Event
from armload.online.gate import Health
from armload.runtime.finite import finite

# what a line of JSON has as it is, before phi and after it
_FIRST = ("t", "method", "frame", "relative_to", "n_samples", "age", "lag", "since")
_LAST = ("torque_gain_std", "same_arm_assumed", "p_held", "p_change", "p_contact", "p_drift", "moving", "settling")


@dataclass(frozen=True, eq=False, repr=False)
class OnlineEstimate(Estimate):
    """An `Estimate` with what a controller has to know of it.

    t: time of the last sample, on the stream's clock [s], also of one that could not be used, if its time could.
    n_samples: samples of this payload so far.
    age: how much older the newest sample that counted in phi is than t [s]; it grows while samples cannot be used or do
        not fit, and while the arm stands, whose samples tell nothing new; `notes` then says so. Together with `lag`.
    lag: how long ago the last sample had arrived when it was answered, as far as that is known (`behind`) [s]: what
        waits for an identifier that is too slow gets old.
    since: when this payload was taken up, on the stream's clock [s].
    relative_to: "arm", "tool" (which the arm was given with), "tare", "profile", or "before": the run of the empty arm
        before the last change was taken for a tare. method: its name.
    determined: which parameters (10,) the data determine. held: whether anything is there at all: from three
        standard deviations on, until `p_held` is below one quarter.
    rests_on_prior, torque_gain_std, same_arm_assumed: as of an `Identification`; the arm is taken for the tare's until
        there was enough to ask.
    around: (10,) the posterior's mean, about which the intervals are; phi is the nearest body, on a concluded stream.
    before: what was known of the payload before the data.
    calibrated: whether ±1.96 std were checked to be 95 % intervals, and nothing speaks against it.
    p_held: probability that anything is there, if that is as likely beforehand as that nothing is.
    p_change: probability that the payload is not what it was since `since`, or is being handed over at present.
    p_contact: that something else touches the arm. p_drift: that the arm itself changes, slowly. None: not looked for.
    moving: whether the arm was seen to move in the last half second: a standing arm cannot tell an inertia.
    settling: whether the payload is changing, or has so shortly ago that its run has not begun: phi follows it.
    event: the last change of payload noticed, if any.
    health: counts of the stream; the same object as long as the stream lives.
    notes: what else there is to say, a few words each.
    """

    age: float
    lag: float
    since: float
    relative_to: str
    method: str
    determined: NDArray[np.bool_]
    held: bool
    rests_on_prior: NDArray[np.bool_]
    torque_gain_std: float | None
    same_arm_assumed: bool
    around: NDArray[np.float64]
    before: Before
    calibrated: bool
    p_held: float
    p_change: float | None
    p_contact: float | None
    p_drift: float | None
    moving: bool
    settling: bool
    event: Event | None
    health: Health
    notes: tuple[str, ...]

    @classmethod
    def of(cls, fields: dict[str, Any]) -> Self:
        """The same as the constructor, from all fields by name; `fields` becomes the estimate's own.

        The constructor sets frozen fields one by one: 2 µs that a stream would pay for each sample.
        """
        made = object.__new__(cls)
        object.__setattr__(made, "__dict__", fields)
        return made

    def behind(self, lag: float) -> Self:
        """The same answer, given `lag` seconds after its last sample arrived (`Source.lag`): so much older is it."""
        if lag == self.lag:
            return self
        return type(self).of({**vars(self), "age": self.age - self.lag + lag, "lag": lag})

    @property
    def changing(self) -> bool:
        """Whether the payload is changing, or has so shortly ago, more likely than not."""
        return self.settling or (self.p_change or 0.0) > 0.5

    @property
    def touched(self) -> bool:
        """Whether something else touches the arm, more likely than not."""
        return (self.p_contact or 0.0) > 0.5

    @property
    def low(self) -> NDArray[np.float64]:
        """Lower ends (10,) of the 95 % intervals; of what is not determined, of what was known before."""
        return self._ends[0]

    @property
    def high(self) -> NDArray[np.float64]:
        """Upper ends (10,) of the 95 % intervals; of what is not determined, of what was known before."""
        return self._ends[1]

    @property
    def _ends(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return phi_interval(self.phi, self.around, self.std, self.determined, self.before)

    @property
    def interval(self) -> str:
        """ "calibrated" or "approximate"; of what no body can be it is never calibrated."""
        return self._interval(is_consistent(self.phi))

    def _interval(self, consistent: bool) -> str:
        return "calibrated" if self.calibrated and consistent else "approximate"

    def to_dict(self) -> dict[str, Any]:
        """One JSON object, its names those of `armload identify --json` where they mean the same.

        Numbers are finite: the end of an interval of which the method knows nothing is null, and so are the centre of
        mass and the inertia about it where there is no mass.
        """
        mass = float(self.phi[0])
        com, inertia_com = (None, None) if mass == 0.0 else (x.tolist() for x in phi_to_com(self.phi)[1:])
        (low, high), own, consistent = self._ends, vars(self), is_consistent(self.phi)
        return {
            **{name: own[name] for name in _FIRST},
            "phi": self.phi.tolist(),
            "phi_low": finite(low.tolist()),
            "phi_high": finite(high.tolist()),
            "interval": self._interval(consistent),
            "determined": self.determined.tolist(),
            "mass": mass,
            "com": com,
            "inertia_com": inertia_com,
            "consistent": consistent,
            "held": self.held,
            "rests_on_prior": self.rests_on_prior.tolist(),
            **{name: own[name] for name in _LAST},
            "event": None if self.event is None else self.event.to_dict(),
            "left_out": self.health.bad,
            "left_out_why": {reason: count for reason, count in self.health.left_out.items() if count},
            "pauses": self.health.pauses,
            "clock_jumps": self.health.clock_jumps,
            "notes": list(self.notes),
        }

"""Whether a live stream is plausible: the checks of a log, repeated on the latest samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armload.arms import Arm
from armload.errors import ArmloadError
from armload.identification import check_plausible
from armload.identification.torque_scale import TorqueScale, torque_scale
from armload.online import Health, OnlineEstimate
from armload.recording import Recording, Sample, Turns, steadied
from armload.service.recent import Recent

_IMPLAUSIBLE = "the samples are not plausible, the answer is not to be trusted"
# [s] of motion to the first check, and at most between two; meanwhile each comes after twice the motion, as the checks
# get surer the more was seen
_SOONEST, _LATEST = 3.0, 24.0
_SINCE = 2.0  # [s] of these since the last interruption or change of payload, at least
_LOOKED_AT = 15.0  # [s] at most
# [rad²/s] noise of a velocity, per Hz, from which on it is advised to steady them. Of a Panda at 1 kHz it is 0.9e-7,
# of a KUKA's positions differenced at 100 Hz 500e-7; the simulator draws 0.05e-7 at 1 kHz to 0.7e-7 at 50 Hz, and
# differences of positions of 17 bits at 100 Hz have 2e-7 and more
# (test_a_stream_of_coarse_velocities_is_told_how_they_can_be_steadied_and_then_not_doubted)
_ROUGH = 1.5e-7
_ROUGH_SECONDS = 1.0  # [s] of samples that tell it
_STEP, _MOVED = 0.25, 0.01  # [s] between two looks at the joints; [rad] that one has to move meanwhile


class Plausibility:
    """Checks the samples a session has kept once the arm has moved for 3 s, after 6, 12 and 24 s, and then every 24 s.

    A doubt stays, whatever is held, until evidence takes it back: no check has failed for as much motion as the doubt
    rested on, and if the torque's scale was wrong it is surely another one now. A log in which nothing is to be
    seen takes nothing back. While there is a doubt the checks come every 3 s; once it is taken back, as at first.

    Args:
        arm: the arm. name: what the stream is called in messages. steadied: whether its velocities are told by
            positions, too, so that nobody need be advised to (`devices.Steadied`).
        profiled: whether the stream has a profile, beside which no velocities are steadied.

    Attributes:
        doubt: the message of the last check that failed, one sentence; None: nothing is in doubt.
    """

    def __init__(self, arm: Arm, name: str, steadied: bool = False, profiled: bool = False) -> None:
        # what is attached is a payload to the checks
        self._arm, self._name = replace(arm, attached=None), name
        self._advises, self._profiled = not (steadied or arm.motor_torque), profiled
        self.reset()

    def reset(self) -> None:
        """Forget the stream."""
        self.doubt: str | None = None
        self._advice: str | None = None
        self._advised = False
        self._wrong: TorqueScale | None = None  # the torque's scale when it was in doubt, if that was wrong
        self._doubted, self._rests_on = 0.0, 0.0  # [s] of motion: at the last check that doubted; that it rested on
        self._moved, self._checked = 0.0, False
        self._began, self._due = 0.0, _SOONEST  # [s] of motion when frequent checks began; of the next check
        self._breaks = 0  # pauses and jumps so far
        self.forget()

    def forget(self) -> None:
        """The payload has changed, or the stream was interrupted: what was seen before does not belong to the rest."""
        self._since = 0.0  # [s] of motion since
        self._first: float | None = None  # time of the first sample looked at since [s]
        self._looked: Sample | None = None

    def look(self, sample: Sample, health: Health, recent: Recent) -> bool:
        """Take notice of a sample that could be used; whether `doubt` came or went."""
        breaks = health.pauses + health.clock_jumps + health.left_out["jump"]
        if breaks != self._breaks:
            self._breaks = breaks
            self.forget()
        last = self._looked
        if last is not None and 0.0 <= sample.t - last.t < _STEP:
            return False
        self._looked = sample
        self._first = sample.t if self._first is None else self._first
        if last is None or not 0.0 < sample.t - last.t < 2.0 * _STEP:
            return False
        if np.abs(np.subtract(sample.q, last.q)).max() > _MOVED:  # dq may be what is wrong
            self._moved += sample.t - last.t
            self._since += sample.t - last.t
        if self._moved < self._due or self._since < _SINCE:
            return False
        changed = self._check(recent)
        if changed or self.doubt is not None:
            self._began = self._moved
        self._due = self._moved + min(max(self._moved - self._began, _SOONEST), _LATEST)
        return changed

    def look_at_last(self, recent: Recent) -> bool:
        """The stream has ended: check what there is of one that never was; whether `doubt` came or went."""
        return not self._checked and self._since > 0.0 and self._check(recent)

    def advice(self) -> str | None:
        """What would make answers better, once; None: there is nothing, or it was told."""
        if self._advised or self._advice is None:
            return None
        self._advised = True
        return self._advice

    def qualified(self, estimate: OnlineEstimate) -> OnlineEstimate:
        """The estimate with the doubt among its notes: its intervals do not hold then."""
        if self.doubt is None:
            return estimate
        return OnlineEstimate.of({**vars(estimate), "calibrated": False, "notes": (*estimate.notes, self.doubt)})

    def _check(self, recent: Recent) -> bool:
        assert self._looked is not None
        assert self._first is not None
        log, before = recent.recording(min(_LOOKED_AT, self._looked.t - self._first)), self.doubt
        self._checked = True
        if log is None:
            return False
        try:
            # a source puts its joints in order, and to look for another order would keep the stream waiting
            log = Turns(self._arm).of(replace(log, source=self._name, joint_names=self._arm.joint_names))
            check_plausible(log, self._arm)
        except ArmloadError as error:
            self.doubt = f"{_IMPLAUSIBLE}: {error}"
            self._doubted, self._rests_on = self._moved, min(self._since, _LOOKED_AT)
            scale = torque_scale(log, self._arm)
            self._wrong = scale if scale is not None and scale.is_wrong else self._wrong
        else:
            if self._advises and not self._advised:
                self._advice = _advice(log, self._profiled)
            if before is not None and self._speaks_against_the_doubt(log):
                self.doubt = self._wrong = None
        return (self.doubt is None) != (before is None)

    def _speaks_against_the_doubt(self, log: Recording) -> bool:
        """Whether a log that passed the checks tells more than that it might be sound."""
        if self._moved - self._doubted < self._rests_on:
            return False
        if self._wrong is None:
            return True
        scale = torque_scale(log, self._arm)
        return scale is not None and scale.contradicts(self._wrong)


def _advice(log: Recording, profiled: bool) -> str | None:
    """To steady the velocities, if those of the last seconds are noisier than those of most robots.

    profiled: there is a profile, which is learned from velocities as they come.
    """
    last = log.between(log.t[-1] - _ROUGH_SECONDS, log.t[-1])
    if len(last) < 3:
        return None
    noise = float(np.mean((steadied(last).dq - last.dq) ** 2, axis=0).max())
    if noise / last.rate <= _ROUGH:
        return None
    how = "give a tare in place of the profile, and steady them" if profiled else "steady them"
    return (
        f"velocities are off by {1e3 * np.sqrt(noise):.0f} mrad/s from what the positions around tell, too: a sound "
        f"stream may be doubted; {how} (--steady of armload live, steady of a service or node)"
    )

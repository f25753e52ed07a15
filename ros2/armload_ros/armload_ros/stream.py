"""One arm's stream: its identifier, and whether the samples can come from that arm at all."""

from __future__ import annotations

import time

from armload.arms import Arm
from armload.errors import UsageError
from armload.online import OnlineEstimate, OnlineIdentifier
from armload.posterior import Known, Profile
from armload.recording import Sample, Steadying, steadied
from armload.service.plausible import Plausibility
from armload.service.recent import Recent
from armload.service.reconnecting import STALLED
from armload.service.settings import TOOL_OR_TARE
from armload.service.tare import Tare
from armload.service.unknown import Link, why_unknown


class Stream:
    """What `armload serve` knows of an arm, fed sample by sample.

    Args:
        arm: with its tool. tare: what answers are relative to. method, profile, known: see `OnlineIdentifier`.
        steady: whether velocities are told by the positions, too, 75 ms late (`armload.devices.Steadied`).

    Raises:
        UsageError: things that cannot be given together.
    """

    def __init__(
        self,
        arm: Arm,
        tare: Tare | None = None,
        method: str | None = None,
        profile: Profile | None = None,
        known: Known | None = None,
        steady: bool = False,
    ) -> None:
        if steady and profile is not None:
            raise UsageError("steady and profile: a profile is learned from velocities as they come; leave one out")
        if arm.attached is not None and (profile is not None or (tare is not None and not tare.taken)):
            raise UsageError(TOOL_OR_TARE)
        self.arm, self.tare, self.known, self._steady = arm, tare, known, steady
        log, age = (None, 0.0) if tare is None else (tare.recording, tare.age_now)
        told = steadied(log) if steady and log is not None else log
        self._identifier = OnlineIdentifier(arm, told, method, profile, known, tare_age=age)
        self._steadying = Steadying(arm.n)
        self._recent, self._plausibility = Recent(arm.n), Plausibility(arm, "joint_states", steady)
        self.estimate: OnlineEstimate | None = None
        self.sample: Sample | None = None
        self._left_out = 0
        self._link = Link("streaming", None, 1, None, None)  # to those who publish joint states

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against the answer."""
        return self._identifier.doubts

    def update(self, sample: Sample, arrived: float | None = None) -> OnlineEstimate | None:
        """The answer after one more sample; None where the first ones are held back.

        arrived: when it had come, if it waited since [s, monotonic].
        """
        now, link = time.monotonic(), self._link
        arrived = now if arrived is None else arrived
        if link.heard is not None and now - link.heard > STALLED:  # since then the payload may have been exchanged
            link = link._replace(connections=link.connections + 1, resumed=now)
        self._link = link._replace(heard=now)
        if self._steady:
            self._take_late(self._steadying.take(sample, (sample, arrived)))
        else:
            self._take(sample, sample)
            assert self.estimate is not None
            self.estimate = self.estimate.behind(now - arrived)
        return self.estimate

    def flush(self) -> None:
        """Take what is held back: no sample has come for a while."""
        self._take_late(self._steadying.flush())

    def _take_late(self, ready: list[tuple[Sample, tuple[Sample, float]]]) -> None:
        for sample, (came, arrived) in ready:
            self._take(sample, came)
            assert self.estimate is not None
            self.estimate = self.estimate.behind(time.monotonic() - arrived)

    def advice(self) -> str | None:
        """What would make answers better, once; None: nothing, or it was told."""
        return self._plausibility.advice()

    def _take(self, sample: Sample, came: Sample) -> None:
        """A sample, and the same as it came."""
        estimate = self._identifier.update(*sample)
        if estimate.health.bad == self._left_out:  # it could be used
            self._recent.append(came)
            self._plausibility.look(came, estimate.health, self._recent)
        self._left_out = estimate.health.bad
        self.sample, self.estimate = sample, self._plausibility.qualified(estimate)

    def why_unknown(self) -> str | None:
        """Why the answer cannot be used; None: it can."""
        now, trouble, doubt = time.monotonic(), self._identifier.trouble, self._plausibility.doubt
        why = why_unknown(self.estimate, self._link, now, trouble, doubt)
        return None if why is None else why.text

    def reset(self) -> None:
        """Forget the samples, not the tare."""
        self._identifier.reset()
        self._recent.clear()
        self._plausibility.reset()
        self._steadying = Steadying(self.arm.n)
        self.estimate, self.sample, self._left_out = None, None, 0
        self._link = self._link._replace(connections=1, resumed=None)

    def close(self) -> None:
        """End its threads."""
        self._identifier.close()

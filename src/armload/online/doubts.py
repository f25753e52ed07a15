"""What speaks against a stream's error bars: as of a log, but for what only its end shows."""

from __future__ import annotations

import numpy as np

from armload.arms import Arm
from armload.identification.arm_notes import arm_changed, held_against, leaning
from armload.identification.reporting import doubt_of
from armload.posterior import PosteriorLeastSquares
from armload.posterior.restless import PERIOD, SHOWN
from armload.posterior.scales import AnotherArm, Drift, Tilt


class Doubts:
    """What the runs of a stream have found of arm, gravity and load; of arm and gravity it holds until a run says else.

    Args:
        arm: whose stream it is.

    Attributes:
        another: that the arm is not the one of its tare or profile, once a run has found so; None: none has.
        asked_whose: whether any run could be asked if its arm is that one.
        arm_changed: that it is another one, or not as it was then, in words; None: it is as it was.
        sentences: all that speaks against the error bars, in words.
    """

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        self.reset()

    def reset(self) -> None:
        """Nothing is found."""
        self.another: AnotherArm | None = None
        self.asked_whose = False
        self._drift: Drift | None = None
        self._tilt: Tilt | None = None
        self._torque = "link"  # when gravity was asked
        self._than = "tare"  # what the arm is not as, as of `arm_changed`
        self._looked: tuple[int, int, bool, str] | None = None
        self._run: PosteriorLeastSquares | None = None
        self._restless = np.inf  # of the run, the least so far once it is long
        self.arm_changed: str | None = None
        self.sentences: tuple[str, ...] = ()

    def look(self, run: PosteriorLeastSquares, relative_to: str) -> None:
        """Take what a run's last solution was asked, if that is new; `relative_to`: as of `OnlineEstimate`."""
        stream = run.stream
        now = id(stream), stream.solutions, stream.seconds >= PERIOD, relative_to
        if now == self._looked:
            return
        if run is not self._run:
            self._run, self._restless = run, np.inf
        self._looked, torque = now, stream.posterior.torque
        if stream.another is not None:
            self.asked_whose = True
            self.another = stream.another if stream.another.found else self.another
        if stream.drift is not None or stream.posterior.gears:
            self._drift = stream.drift
        if stream.tilt is not None or torque != self._torque:  # what gears lose had looked like a base that leans
            self._tilt, self._torque = stream.tilt, torque
        if self.arm_changed is None:
            self._than = held_against(run.profile is not None, relative_to == "tare")
        self.arm_changed = arm_changed(self._arm, self._drift, self.another, self._than)
        moves = doubt_of(False, True, self.arm_changed, self._restlessness(run))
        doubts = moves, leaning(self._arm, self._tilt, torque)
        self.sentences = tuple(doubt for doubt in doubts if doubt is not None)

    def _restlessness(self, run: PosteriorLeastSquares) -> float:
        """Of a run, as far as it says that what is held moves; a long one that was not restless does not become so."""
        stream = run.stream
        now = stream.restlessness if stream.seconds >= PERIOD else 0.0
        self._restless = min(self._restless, now) if stream.seconds > SHOWN else now
        return self._restless

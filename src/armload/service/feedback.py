"""Feedback: what was identified is told to the robot's controller, in steps too small to move the arm.

A controller that counts a wrong payload holds the arm a little too low or too high. Told all at once, it would correct
that with a jerk. So the load goes from what the controller counts to what was identified along a straight line in phi,
which has a body at each point if both ends are bodies, and each step changes the gravity torque of no joint by more
than `STEP` of its effort limit:

    phi_k = phi_counted + s·Δ,   Δ = phi_found − phi_counted,   s = min(1, STEP / max_j |g_j(q, Δ)| / u_j)

Nothing is written while the answer is unknown or undetermined or the arm moves, and each step is read back. What a
controller did not take is told again after 1, 2, 4, … 60 s; one of another mass at once.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, payload_regressor
from armload.devices import Controller, Load, is_moving
from armload.devices.counted import read_back
from armload.errors import SentError, SinkError, SourceError, one_line
from armload.inertia import InertialParameters
from armload.online import OnlineEstimate
from armload.service.backoff import Backoff

# of a joint's effort limit: 0.4 N·m of 87. A joint held with 600 N·m/rad (libfranka's example) moves 0.7 mrad, at no
# more than 6 mrad/s, which still counts as a standstill (`devices.guard.STANDSTILL`)
STEP = 5e-3
PAUSE = 0.2  # [s] between two steps: such a joint has come to rest by then
_SILENT = 5.0  # [s] a client may take for a look, a step included; of a robot that is gone some try for minutes
_ENOUGH = 0.1  # of STEP: what is left is not worth a step
LIGHT = 0.05  # [kg] what differs by more is told, too, where it does not show in the joints of this pose
_OLDEST = 10.0  # [s] an answer may be: an arm that has stood for longer moves first
FRESH = 0.5  # [s] since the answer was made
_FIRST, _MOST = 1.0, 60.0  # [s] until what was refused is told again: on a UR each time a script ends its program


class _Answer(NamedTuple):
    estimate: OnlineEstimate
    q: NDArray[np.float64]
    known: bool
    at: float
    doubts: tuple[str, ...]


class Feedback:
    """Keeps a controller's load what was identified, from a thread of its own.

    Args:
        arm: the arm that is identified. controller: of it. mounted: the tool, or what was on at the tare or profile,
            which the load lacks; None: nobody says, so that such a load is refused where the controller counts nothing
            else.
        note: called with a sentence whenever a load has been told whole, or was refused.

    Attributes:
        mass: of the load the controller counts [kg]; None: it has not been asked yet, or does not say.
        waits: why nothing is written just now; None: the controller counts what was identified.
    """

    def __init__(
        self, arm: Arm, controller: Controller, mounted: InertialParameters | None, note: Callable[[str], None]
    ) -> None:
        self._arm, self._bare = arm, replace(arm, attached=None)
        self._controller, self._mounted, self._note = controller, mounted, note
        self.mass: float | None = None
        self.waits: str | None = "nothing is known yet"
        self._answer: _Answer | None = None
        self._under_way, self._refused = False, ""
        self._backoff = Backoff(_FIRST, _MOST)
        self._not_taken: tuple[InertialParameters, float, str] | None = None  # what, until when it waits [s], and why
        self._asking: float | None = None  # since when the controller is being asked or told [s]
        self._gone = threading.Event()
        self._thread: threading.Thread | None = None

    def offer(
        self, estimate: OnlineEstimate, q: NDArray[np.float64], known: bool, doubts: tuple[str, ...] = ()
    ) -> None:
        """The newest answer, where the arm is, whether the answer can be used, and what speaks against it.

        Returns at once.
        """
        self._answer = _Answer(estimate, q, known, time.monotonic(), doubts)

    def start(self) -> None:
        """Begin."""

        def keep() -> None:
            while not self._gone.wait(PAUSE):
                self.step()

        self._thread = threading.Thread(target=keep, name="armload-feedback", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End; a step under way is finished."""
        self._gone.set()
        if self._thread is not None:
            self._thread.join(2.0)
            if self._thread.is_alive():  # the client waits for a robot that is gone, and ends with this process
                return
        try:
            self._controller.close()
        except Exception as error:
            self._note(one_line(error))

    def finish(self) -> str | None:
        """Steps until the controller counts what was identified (None), or no more can be told now: why.

        Whoever asks for it has what was refused told again at once.
        """
        self._not_taken = None
        while True:
            self.step()
            if not self._under_way or self._gone.wait(PAUSE):
                return self.waits

    def applied(self) -> dict[str, float | str | None]:
        """`mass` and `waits`, also while a client waits for a robot that is gone; from any thread."""
        asking = self._asking
        silent = 0.0 if asking is None else time.monotonic() - asking
        if silent <= _SILENT:
            return {"mass": self.mass, "waits": self.waits}
        why = f"the controller has not answered for {silent:.0f} s: see that the robot is switched on and connected"
        return {"mass": None, "waits": why}

    def step(self) -> None:
        """One look, and one step if it is time for one; what it fails with is said once."""
        self._asking = time.monotonic()
        try:
            try:
                self.waits = self._waits()
            finally:
                if not self._under_way:
                    self._controller.done()
            if self._not_taken is None:
                self._refused = ""
        except Exception as error:  # of whatever kind: the thread goes on, and the next look may succeed
            self.waits = one_line(error)
            if isinstance(error, SentError | SourceError):
                self.mass = None  # until it says so again
            if self.waits != self._refused:
                begun = "" if isinstance(error, SentError) else "no load is told to the controller: "
                self._note(f"{begun}{self.waits}")
            self._refused = self.waits
        finally:
            self._asking = None

    def _waits(self) -> str | None:
        answer, under_way = self._answer, self._under_way
        self._under_way = False
        if answer is None or not answer.known or time.monotonic() - answer.at > FRESH:
            return "the answer is unknown"
        if answer.estimate.age > _OLDEST:
            return "the arm has stood for long: it moves first"
        if answer.estimate.held and not all(answer.estimate.determined[:4]):
            return "the centre of mass is undetermined"
        if answer.estimate.held and answer.doubts:  # what was put down is told all the same
            return f"the answer is in doubt: {answer.doubts[0]}"
        counted = self._controller.counted()
        self.mass = counted.load.mass
        if is_moving(counted.dq):
            return "the arm moves"
        found = self._found(answer.estimate, counted.end_effector)
        own = replace(self._bare, frame=counted.load.frame or self._bare.frame)
        wanted = own.in_frame(found.parameters)
        difference = wanted - counted.load
        most = float((np.abs(_gravity(own, answer.q, difference)) / own.limits.effort).max())
        if most <= (_ENOUGH if under_way else 1.0) * STEP and abs(difference.mass) < LIGHT:
            if under_way:
                self._note(f"the controller counts {self.mass:.3f} kg")
            self._forget_refusal()
            return None
        if (why := self._held_off(wanted)) is not None:
            return why
        share = min(1.0, STEP / max(most, 1e-12))
        told = wanted if share == 1.0 else InertialParameters(counted.load.phi + share * difference.phi, wanted.frame)
        try:
            self._controller.put(replace(found, parameters=told, std=None, covariance=None))
            self.mass, self._under_way = read_back(told, lambda: self._controller.counted().load).mass, True
        except Exception as error:
            self._not_taken = (wanted, time.monotonic() + self._backoff.failed(0.0), one_line(error))
            if not under_way or isinstance(error, SentError):
                raise
            raise SinkError(f"{one_line(error)}; it counts {self.mass:.3f} of {wanted.mass:.3f} kg") from None
        self._forget_refusal()
        return f"told in steps: {self.mass:.3f} of {wanted.mass:.3f} kg"

    def _held_off(self, wanted: InertialParameters) -> str | None:
        """Why a load is not told just now that was not taken before; None: it is another one, or its time has come."""
        if self._not_taken is None:
            return None
        before, until, why = self._not_taken
        if abs(wanted.mass - before.mass) > LIGHT:
            self._forget_refusal()
            return None
        left = until - time.monotonic()
        return None if left <= 0.0 else f"{why} (told again in {left:.0f} s)"

    def _forget_refusal(self) -> None:
        self._not_taken, self._backoff = None, Backoff(_FIRST, _MOST)

    def _found(self, estimate: OnlineEstimate, end_effector: float) -> Load:
        """The load to count beside the end effector [kg]; zero where nothing is held and nothing is mounted."""
        found = Load.of(estimate, self._arm)
        if estimate.held:
            found = found.as_body()
        else:
            nothing = InertialParameters.zero(self._arm.frame)
            found = replace(found, parameters=nothing, determined=(True,) * 10, std=None, covariance=None)
        if self._mounted is not None and end_effector == 0.0 and found.relative_to not in (None, "arm"):
            found = found + self._bare.in_frame(self._mounted)
        return found


def _gravity(arm: Arm, q: NDArray[np.float64], body: InertialParameters) -> NDArray[np.float64]:
    """Gravity torque (n,) [N·m] of a body about the arm's frame; linear in phi."""
    still = np.zeros((1, arm.n))
    return payload_regressor(arm.frame_motion(np.atleast_2d(q)), still, still)[0] @ body.phi

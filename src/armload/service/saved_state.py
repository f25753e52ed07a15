"""The state of an arm's stream in its file: what a process goes on from, and what it saves."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from armload.arms import Arm
from armload.errors import ArmloadError, IdentificationError
from armload.identification.tare_age import in_words
from armload.online import OnlineIdentifier
from armload.online.state import saved_at
from armload.posterior import Known, Profile
from armload.posterior.drift import SESSION
from armload.recording import Sample
from armload.runtime.atomic import clear_left_over
from armload.service.old_states import OldStates, not_saved
from armload.service.session import Session

CHANGED = "and offsets and friction change within hours"


class SavedState:
    """The file, and what is known of it.

    Args:
        path: of the file; None: nothing is saved. note: called with each sentence for a log.

    Attributes:
        path: as given.
        continued: whether the stream goes on from it.
    """

    def __init__(self, path: Path | None, note: Callable[[str], None]) -> None:
        self.path, self.continued, self._note = path, False, note
        self._others = OldStates(path, SESSION, note)
        self._kept: float | None = None  # when the state that is there was saved [s, monotonic]
        self._failed: str | None = None  # why it could not be saved
        self._newest: Sample | None = None  # that the state saved last is of

    def age(self, now: float) -> float | None:
        """How old it is at `now` [s, monotonic]; None: there is none."""
        return None if self._kept is None else now - self._kept

    def restored(
        self, arm: Arm, method: str | None, profile: Profile | None, *, known: Known | None, every: float
    ) -> OnlineIdentifier | None:
        """What goes on from it, unless it is of a time when the arm may have been another; see `OnlineIdentifier`."""
        path = self.path
        if path is not None:
            clear_left_over(path)
            self._others.clear(time.monotonic())
        if path is None or not path.exists():
            return None
        try:
            ago = time.time() - saved_at(path)
            if ago < -SESSION:
                self._note(f"{path} was saved at a time that is still to come, nobody knows how old it is: begun anew")
                return None
            if ago > SESSION:
                self._note(f"{path} was saved {in_words(ago)} ago, {CHANGED}: begun anew")
                return None
            identifier = OnlineIdentifier.restore(path, arm, method, profile, known=known, every=every)
        except (IdentificationError, OSError) as error:
            self._note(f"{str(error).removesuffix(': begin without it')}: begun anew")
            return None
        self._kept, self.continued = time.monotonic() - max(ago, 0.0), True
        self._note(f"continued from {path}, saved {max(ago, 0.0):.0f} s ago")
        return identifier

    def save(self, session: Session) -> None:
        """Save what a session knows by now, if it has seen anything since; a failure is said once."""
        path = self.path
        self._others.clear(time.monotonic())
        if path is None or session.sample is self._newest:  # what was not seen since is not of now
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            session.identifier.save(path)
            if self._failed is not None:
                self._note("the state is saved again")
            self._kept, self._failed, self._newest = time.monotonic(), None, session.sample
        except (ArmloadError, OSError) as error:
            if (why := not_saved(path, error)) != self._failed:
                self._note(why)
            self._failed = why

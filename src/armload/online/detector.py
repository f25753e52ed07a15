"""Whether the payload has surely changed, by the probabilities of what the last rows are."""

from __future__ import annotations

import numpy as np

from armload.online.modes import Modes
from armload.online.runs import Gaussian
from armload.online.thresholds import AFTER_CONTACT, CONTACT_LONGEST, HOLDS, LIGHT, LIKELY, PATIENCE, SURE


class ChangeDetector:
    """A change is detected once it has been sure for `HOLDS`; after a contact, once the new payload also stays.

    Args:
        unit: standard deviation of a payload's mass beforehand [kg].

    Attributes:
        steady_t: time of the last row of a steady arm with the same payload [s].
    """

    def __init__(self, unit: float) -> None:
        self._unit = unit
        self.steady_t = -np.inf
        self._touched = False  # whether something has touched the arm since it was steady
        self.begin_run()

    def begin_run(self) -> None:
        """The rows that come are of another run."""
        self._since = np.inf  # when the payload was first surely another one

    def steady(self, modes: Modes) -> float:
        """Probability that the last rows are of the arm as it was and the same payload.

        A drift may be the arm's own, but not one that a contact has turned into: a constant push looks like one as soon
        as its size is known, while an arm does not jump.
        """
        return modes.steady - modes.drift if self._touched else modes.steady

    def believed(self, lasted: float) -> bool:
        """Whether what has not fitted for so long [s] is believed: then a drift is the arm's."""
        if lasted <= (CONTACT_LONGEST if self._touched else PATIENCE):
            return False
        self._touched = False
        return True

    def take(self, modes: Modes, t: float, before: Gaussian) -> bool:
        """Whether a row at t [s] shows a change; `before`: phi and covariance before the row."""
        if self.steady(modes) > LIKELY:
            self.steady_t, self._touched = t, False
        self._touched = self._touched or modes.contact > 0.5
        changed = modes.other if self._touched else modes.other + modes.handing
        lasting = not self._touched or modes.stays >= AFTER_CONTACT
        sure = changed > SURE and lasting and self._possible(modes, before)
        self._since = min(self._since, t) if sure else np.inf
        return t - self._since >= HOLDS

    def _possible(self, modes: Modes, before: Gaussian) -> bool:
        """Whether what would be held now has a mass that can be."""
        (mean, covariance), (shift, spread) = before, modes.shift()
        std = float(np.sqrt(covariance[0, 0] + spread[0, 0]))
        return float(mean[0] + shift[0]) > -LIGHT * self._unit - std

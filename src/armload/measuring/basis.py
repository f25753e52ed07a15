"""What the answer of a measurement rests on beside its runs: a tare, a profile, what is known of the payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from armload.arms import Arm
from armload.identification import METHODS, choose, known_of, plausible_known
from armload.identification.known_options import families
from armload.identification.known_payload import know, of_no_use_to
from armload.payloads import Payload
from armload.posterior import Known, KnownCentre, KnownMass, Profile
from armload.recording import Recording


@dataclass(frozen=True, eq=False)
class Basis:
    """What the answer rests on beside the runs, as of `identify`.

    Args:
        tare: a log of the empty arm: there is no empty run, and the payload is on already.
        tare_age: how old that is [s]; None: by the logs' clocks.
        profile: what was learned of this arm from many logs.
        mass: of the payload, where it was weighed. com: its centre of mass, where that is known.
        body: all of it, as of a drawing, with how well. family: what kind it is of, as `--family` names them.
        method: of the identification.
    """

    tare: Recording | None = None
    tare_age: float | None = None
    profile: Profile | None = None
    mass: KnownMass | None = None
    com: KnownCentre | None = None
    body: Payload | None = None
    family: str | Sequence[str] = ()
    method: str | Path | None = None

    @property
    def heaviest(self) -> float | None:
        """What the payload may weigh, as what is known says: 3 sigma more [kg]; None: nothing is said."""
        body = None if self.body is None else self.body.parameters.mass + 3.0 * self.body.uncertainty.mass
        weighed = None if self.mass is None else self.mass.mass + 3.0 * self.mass.std
        return body if weighed is None else weighed

    def known(self, arm: Arm) -> Known | None:
        """What is known of the payload apart from the runs; None: nothing.

        That the method can follow a run and use all this is found here, before an arm has moved for it.

        Raises:
            IdentificationError: it cannot, the arm cannot hold so much, or what is known cannot be weighed against a
                log. ModelError: no such family was learned, or the method is a model of another arm.
        """
        known = plausible_known(known_of(arm, self.mass, self.com, self.body, families(self.family)), arm)
        method = METHODS.get(str(self.method))
        if self.tare is None and method is not None and method.needs == "tare":  # of which the empty run will be one
            if known is not None:
                raise of_no_use_to(method.name)
        else:
            know(choose(arm, self.tare, self.method, live=True).identifier, known)
        return known

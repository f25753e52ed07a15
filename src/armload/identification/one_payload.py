"""The answer for a log throughout which the payload is the same, with or without a tool whose parameters are known.

Whether such a tool was mounted at the tare, or in a profile's logs, they tell themselves: it is in the difference of
the two logs, or it is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.identification.answer import Identification
from armload.identification.choice import choose
from armload.identification.found import Asked, found_in
from armload.identification.mounted_tool import in_frame, mounted_on, plausible_mass
from armload.identification.reporting import answered
from armload.identification.thresholds import DECISIVE
from armload.inertia import HELD, InertialParameters
from armload.payloads import Payload
from armload.posterior import Known, KnownBody, KnownCentre, KnownMass, Profile
from armload.recording import Recording


@dataclass(frozen=True)
class Question:
    """What is asked of a log, apart from the log and the arm.

    tare: an earlier log of the arm. mounted: a tool whose parameters are known. asked: how it is to be identified.
    notes: what is known before, a sentence each.
    """

    tare: Recording | None
    mounted: InertialParameters | Payload | None
    asked: Asked
    notes: tuple[str, ...]

    @property
    def tared(self) -> bool:
        """Whether the arm is known from elsewhere, with whatever was mounted there."""
        return self.tare is not None or self.asked.profile is not None


def answer_of_one_payload(recording: Recording, arm: Arm, question: Question) -> Identification:
    """The answer for a log, or the part of one, throughout which the payload is the same."""
    tare, mounted, asked = question.tare, question.mounted, question.asked
    if mounted is None:
        return _beyond_what_is_on(recording, arm, question)
    known, error = mounted_on(arm, mounted)
    unsure = known if isinstance(mounted, Payload) and not mounted.inertia_known else None
    if not question.tared:
        return _beyond_what_is_on(recording, arm.with_payload(known, error), question, unsure)
    notes = (*question.notes, *error.notes)
    carried, sure = _carries(arm, known, tare, asked.profile)
    before = "at the tare" if tare is not None else "in the profile's logs"
    since = "after the tare" if tare is not None else "after the profile's logs"
    if carried:  # what it weighs is in both logs, and its error in neither's difference
        if asked.profile is None:
            arm = arm.with_payload(known)  # a profile holds what was mounted already
        found, relative_to = found_in(recording, arm, tare, asked), "profile" if tare is None else "tare"
        note, otherwise = f"the tool was mounted {before} already", -known.phi
    else:
        both = asked.known and asked.known.with_tool(known.phi)  # what was added since the tare
        found, relative_to = found_in(recording, arm, tare, replace(asked, known=both)).less(known.phi), "tool"
        found = found.with_error(error)
        note, otherwise = f"the tool was mounted {since}: the answer is what was added since, less the tool", known.phi
        if found.estimate.phi[0] < -HELD * found.estimate.std[0]:
            note = (
                f"the tool seems to be mounted neither {before} nor in the log: the answer, less the tool, is too "
                "small; leave the tool out"
            )
    if sure:
        return answered(found, arm, recording, True, relative_to, (*notes, note), unsure=unsure)
    who = "tare" if tare is not None else "profile"
    note = f"it seems that {note}; the {who} does not tell for sure, the intervals hold the other case, too"
    return answered(found, arm, recording, True, relative_to, (*notes, note), otherwise, unsure)


def _beyond_what_is_on(
    recording: Recording, arm: Arm, question: Question, unsure: InertialParameters | None = None
) -> Identification:
    """What is held beyond the arm as it is given. unsure: a tool that is part of it, whose own inertia is not known."""
    tare, asked, notes = question.tare, question.asked, question.notes
    found = found_in(recording, arm, tare, asked)
    if arm.attached_error is not None and not question.tared:  # else it is in both logs, or in the profile's
        found, notes = found.with_error(arm.attached_error), (*notes, *arm.attached_error.notes)
    bare = "arm" if arm.attached is None else "tool"  # that of a description with a hand, say
    relative_to = "tare" if tare is not None else "profile" if asked.profile is not None else bare
    return answered(found, arm, recording, question.tared, relative_to, notes, unsure=unsure)


def known_of(
    arm: Arm,
    mass: KnownMass | tuple[float, float] | None,
    com: KnownCentre | tuple[ArrayLike, float] | None,
    body: Payload | None = None,
    families: Sequence[str] = (),
    if_held: bool = False,
) -> Known | None:
    """What is known of a payload; None: nothing. See `Known`; body: with how well it is known.

    Raises:
        IdentificationError: it is not said how well a body is known, or it has no inertia; and as `Known.of`.
    """
    drawn = None
    if body is not None:
        std = body.uncertainty
        if not body.parameters.mass > 0.0:
            raise IdentificationError(f"the body {body.name} has no mass: expected one above 0 kg")
        drawn_inertia = body.inertia_known and np.trace(body.parameters.inertia_com) > 0.0  # its error is a share of it
        if not drawn_inertia or min(std.mass, std.com, std.inertia) <= 0.0:
            raise IdentificationError(
                f"the body {body.name} is to be weighed against the log: expected its inertia, and how well it is "
                'known, such as "std": {"mass": 0.01, "com": 0.002, "inertia": 0.1}'
            )
        covariance = in_frame(arm, std.covariance(body.parameters), body.parameters.frame)
        drawn = KnownBody(arm.in_frame(body.parameters).phi, covariance)
    return Known.of(mass, com, if_held, drawn, families)


def plausible_known(known: Known | None, arm: Arm) -> Known | None:
    """What is known of a payload, if an arm can hold so much.

    Raises:
        IdentificationError: it weighs more than three times the rated payload: in grams, say.
    """
    if known is not None and known.mass is not None:
        plausible_mass(known.mass.mass, "the known mass is", arm)
    if known is not None and known.body is not None:
        plausible_mass(float(known.body.phi[0]), "the known body weighs", arm)
    return known


def _carries(arm: Arm, tool: InertialParameters, tare: Recording | None, profile: Profile | None) -> tuple[bool, bool]:
    """Whether a tare, or a profile's logs, fit the arm with the tool better than without, and whether beyond doubt.

    The metric is what a tare tells by the method that knows best how far it can be trusted.
    """
    if tare is not None:
        seen = choose(arm).identifier.run(tare)
        phi, covariance = seen.phi, seen.covariance
    else:
        assert profile is not None
        phi, covariance = profile.mounted(arm)
    information = np.linalg.inv(covariance)
    with_tool = phi - tool.phi
    ahead = float(phi @ information @ phi - with_tool @ information @ with_tool)
    return ahead > 0.0, abs(ahead) > DECISIVE

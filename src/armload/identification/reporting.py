"""What is reported of what a method found: a body, its intervals, what the log does not tell, and every doubt."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.identification.answer import Identification, body_of, is_removal
from armload.identification.arm_notes import (
    another_model,
    arm_changed,
    carries_more,
    driven_by_friction,
    gravity_turned,
    leaning,
    scaled_torques,
)
from armload.identification.found import Found
from armload.identification.intervals import about_com, intervals, phi_interval
from armload.identification.known_payload import denied_by, determined_with, rests_on_prior
from armload.identification.mounted_tool import any_inertia
from armload.identification.notes import COMPUTED, lacking, leaning_on_prior, less_than_nothing, not_rigid, without_mass
from armload.inertia import HELD, Z95, InertialParameters, held, is_consistent
from armload.inertia import determined as determined_by
from armload.posterior.restless import RESTLESS
from armload.recording import Recording
from armload.regression import payload_prior_std

_CHECK = "check the robot, the base (--gravity), what is mounted, the torques' signs, and that gravity is in them"
NO_BODY = f"no body fits within the error bars: {_CHECK}"


def answered(
    found: Found,
    arm: Arm,
    recording: Recording,
    tared: bool,
    relative_to: str,
    notes: tuple[str, ...] = (),
    otherwise: NDArray[np.float64] | None = None,
    unsure: InertialParameters | None = None,
) -> Identification:
    """What is said of an estimate.

    tared: whether there was a tare or a profile. otherwise: how far off the truth may be beyond the error bars
    (10,). unsure: a tool whose own inertia is not known.
    """
    estimate, before, weak = found.estimate, found.before, payload_prior_std(arm)
    determined = determined_by(estimate.std, before.std, found.weak_std, weak)
    log_only = found.log_only or (estimate.phi, estimate.covariance)  # whether anything is held, only the log tells
    is_held = held(float(log_only[0][0]), float(np.sqrt(log_only[1][0, 0])), bool(determined[0]))
    given = found.known if found.known is None or found.log_only is None else found.known.believed(*found.log_only)
    leans = rests_on_prior(determined, given, estimate.std, found.weak_std)
    determined = determined_with(determined, given, estimate.std, before)
    phi = body_of(estimate, determined[0], found.exchanged)
    low, high = phi_interval(phi, estimate.phi, estimate.std, determined, before, otherwise)
    if unsure is not None:
        below, above = any_inertia(unsure)
        low, high = low - np.r_[np.zeros(4), below], high + np.r_[np.zeros(4), above]
    found_of = intervals(phi, low, high, estimate.covariance, otherwise)
    doubts = _doubts(found, arm, determined[0], relative_to)
    every_note = [*doubts, *(carries_more(arm) if doubts else []), *notes, *([] if tared else without_mass(arm))]
    mass_std = float(estimate.std[0])
    if determined[0] and -HELD * mass_std <= estimate.phi[0] < -Z95 * mass_std:
        every_note.append(less_than_nothing(float(estimate.phi[0]), mass_std, relative_to))
    if found.frictionless and COMPUTED not in doubts:
        every_note.append(COMPUTED)
    if found.friction_found:
        every_note.append(
            "the torque holds the gears' friction, as that of motor currents does: the intervals allow for it"
        )
    if is_held or not determined[0]:  # an empty hand has no inertia to be determined
        every_note += lacking(arm, tared, determined, found.known_arm_std, weak)
        families = () if found.known is None or found.denies_family else found.known.families
        every_note += leaning_on_prior(leans, families)
    rigid = found.explained or is_removal(estimate, determined[0])  # what was taken off is no body, and need not swing
    consistent = is_consistent(phi)
    trusted = found.calibrated and not doubts and consistent and otherwise is None and unsure is None
    mass, com, inertia_com = about_com(phi)
    return Identification(
        method=found.method,
        robot=arm.name,
        frame=str(arm.frame),
        relative_to=relative_to,
        n_samples=estimate.n_samples,
        duration=recording.duration,
        phi=phi,
        interval="calibrated" if trusted else "approximate",
        determined=determined,
        mass=mass,
        com=com,
        inertia_com=inertia_com,
        consistent=consistent,
        held=is_held,
        **found_of._asdict(),
        rests_on_prior=~determined | leans,
        torque_gain_std=found.gain_std,
        gain_known=found.gain_known,
        notes=tuple(every_note),
        log=Path(recording.source).name,
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        why=found.why,
        kappa=found.kappa,
        moves=found.restlessness > RESTLESS or not rigid,
        another=found.another is not None and found.another.found,
        health=found.health,
        same_arm_assumed=tared and found.another is None,
        gravity=found.gravity,
        doubts=len(doubts),
    )


def _doubts(found: Found, arm: Arm, mass_determined: bool, relative_to: str) -> list[str]:
    """What keeps an answer from being believed, a sentence each."""
    leans = None
    if found.gravity is not None:
        leans = gravity_turned(arm.gravity, found.gravity, True)
    else:
        leans = leaning(arm, found.tilt, "motor" if arm.motor_torque or found.friction_found else "link")
    driven = driven_by_friction(found.backwards) if found.backwards else None
    computed = COMPUTED if found.frictionless and arm.motor_torque else None  # gears rub in every motor's current
    scaled = scaled_torques(arm.name, *found.own_scale) if found.own_scale and found.own_scale.is_another else None
    doubts = driven, computed, leans, scaled, _doubt(found, arm, mass_determined, relative_to)
    return [doubt for doubt in doubts if doubt is not None]


def _doubt(found: Found, arm: Arm, mass_determined: bool, relative_to: str) -> str | None:
    """What the answer itself shows, most telling first."""
    if is_removal(found.estimate, mass_determined):
        return removal(relative_to)
    changed = arm_changed(arm, found.drift, found.another, found.arm_known)
    sound = found.exchanged or found.explained
    doubt = doubt_of(found.exchanged, sound, changed, found.restlessness, found.restless_joint, relative_to)
    if doubt is not None:
        return doubt
    if (denied := denied_by(found.known, found.log_only, found.denies_family)) is not None:
        return denied
    if found.strange_links and relative_to in ("arm", "tool"):  # a tare tells what the links are
        return another_model(arm.name, found.strange_links)
    if found.offset_ratio:
        return f"the torques are {found.offset_ratio:.0f} times as far off as those of an arm should be: {_CHECK}"
    return None


def removal(relative_to: str) -> str:
    """What a mass below nothing says; `relative_to`: as of `Identification`, or of `OnlineEstimate`."""
    if relative_to in ("tare", "profile"):
        off = f"something was taken off since the {relative_to}"
        return f"{off}: the added mass is negative, so no body has these parameters"
    if relative_to == "before":
        return "something was taken off that was on the arm from the start: no body has these parameters"
    less = "less is mounted than the model of the arm and its tool assume"
    return f"the mass is negative: {less}, the torque's sign is turned, or the joints are in another order"


def exchanged_since(relative_to: str) -> str:
    """That the answer is the difference of two bodies, one put on for another since then; as of `removal`."""
    since = "profile" if relative_to == "profile" else "tare"
    instead = "" if since == "tare" else f" and give it in place of the {since}"
    return (
        f"something seems to have been taken off since the {since}, and something else put on: the answer is the "
        f"difference of the two, which need be no body; record a tare with what is mounted now{instead}, or believe "
        "--method map-gp if nothing was taken off"
    )


def doubt_of(
    exchanged: bool,
    explained: bool,
    changed: str | None,
    restlessness: float,
    joint: int = 0,
    relative_to: str = "tare",
) -> str | None:
    """What the answer of a log, or of a stream that has ended, shows against itself, most telling first.

    Args:
        exchanged: see `PosteriorLeastSquares`. explained: whether a body explains it. changed: that the arm has.
        restlessness: of the torques (`posterior.restless`). joint: that has most of it, from 1; 0: not known.
        relative_to: as of `removal`.
    """
    if exchanged:
        return exchanged_since(relative_to)
    if not explained:
        return NO_BODY
    if changed is not None:
        return changed
    return not_rigid(restlessness, joint) if restlessness > RESTLESS else None

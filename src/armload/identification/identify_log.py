"""One log in, one answer out: which method, relative to what, with which error bars, and what the log cannot tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_mass
from armload.arms import arm as arm_named
from armload.errors import IdentificationError
from armload.estimators import ArmMismatch, Estimate
from armload.identification.answer import Identification, body_of, is_removal
from armload.identification.choice import Choice, choose
from armload.identification.intervals import Before, about_com, intervals, phi_interval
from armload.identification.notes import lacking, leaning_on_prior
from armload.identification.plausibility import check_plausible
from armload.identification.thresholds import DECISIVE, HEAVIEST, LARGEST_OFFSETS, LEANS, LOWEST_RATE, MISFIT, MOVES
from armload.inertia import InertialParameters, distance_to_body, held, is_consistent, vech
from armload.inertia import determined as determined_by
from armload.payloads import INERTIA_ASSUMED, Payload, read_payload
from armload.recording import Recording, check_own_measurements, read_recording
from armload.regression import payload_prior_std
from armload.regression.prior import REACH

_CHECK = "check the robot, the base (--gravity), what is mounted and the torques' signs"
NO_BODY = f"no body fits within the error bars: {_CHECK}"  # also what a concluded stream says


def identify(
    recording: Recording | str | Path,
    arm: Arm | str | Path,
    *,
    tare: Recording | str | Path | None = None,
    tool: InertialParameters | Payload | str | Path | None = None,
    method: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify the payload of a log.

    Args:
        recording: measured joint torque (rigid body + friction, gravity included), position and velocity; or the path
            of such a log.
        arm: the bare arm, with the frame and gravity wanted; or the name of a built-in one, or the path of a URDF.
        tare: an earlier log of the same arm, on any motion, with whatever was mounted then; the answer is what was
            added since. It shares no samples with the recording.
        tool: a tool mounted in the recording whose parameters are known, or the path of its file; the answer is what it
            carries. Whether it was mounted at the tare too is found from the tare.
        method: a name in `armload.METHODS`, or the path of a trained model; None: the most trustworthy for the arm,
            "hybrid" where one is shipped, "map-gp" elsewhere.
        progress: told in a few words what is being done.

    Raises:
        ArmloadError: a file cannot be read, the log is not plausible for this arm, or the method cannot be used on it.
    """
    say = progress or (lambda _: None)
    arm = arm if isinstance(arm, Arm) else arm_named(arm)
    recording = recording if isinstance(recording, Recording) else read_recording(recording, arm)
    tare = tare if tare is None or isinstance(tare, Recording) else read_recording(tare, arm)
    notes = (*recording.notes, *(() if tare is None else tare.notes))
    for log in (recording, tare):
        if log is not None:
            _check(log, arm)
    if tare is not None:
        check_own_measurements(recording, tare)
    say("identifying")
    if tool is None:
        return _answer(
            _run(recording, arm, tare, method), arm, recording, tare, "arm" if tare is None else "tare", notes
        )
    mounted = read_payload(tool) if isinstance(tool, str | Path) else tool
    known = plausible_tool(arm.in_frame(mounted.parameters if isinstance(mounted, Payload) else mounted), arm)
    unsure = None
    if isinstance(mounted, Payload) and not mounted.inertia_known:
        notes = (*notes, f"tool {mounted.name}: {INERTIA_ASSUMED}; the intervals allow for any other")
        unsure = known
    if tare is None:
        arm = arm.with_payload(known)
        return _answer(_run(recording, arm, None, method), arm, recording, None, "tool", notes, unsure=unsure)
    carried, sure = _carries(tare, arm, known)
    if carried:
        arm = arm.with_payload(known)
        found, relative_to = _run(recording, arm, tare, method), "tare"
        note, otherwise = "the tool was mounted at the tare already", -known.phi
    else:
        found, relative_to = _run(recording, arm, tare, method).less(known.phi), "tool"
        note, otherwise = (
            "the tool was mounted after the tare: the answer is what was added since, less the tool",
            known.phi,
        )
    if sure:
        return _answer(found, arm, recording, tare, relative_to, (*notes, note), unsure=unsure)
    note = f"it seems that {note}; the tare does not tell for sure, the intervals hold the other case, too"
    return _answer(found, arm, recording, tare, relative_to, (*notes, note), otherwise, unsure)


def plausible_tool(tool: InertialParameters, arm: Arm) -> InertialParameters:
    """The tool, if an arm can carry so much.

    Raises:
        IdentificationError: it weighs more than three times the rated payload: in grams, say.
    """
    most = HEAVIEST * rated_mass(arm)
    if not abs(tool.mass) <= most:
        raise IdentificationError(
            f"the tool weighs {tool.mass:.4g} kg: expected at most {most:.3g} kg, {HEAVIEST:g} times what "
            f"{arm.name} is rated for; give kilograms and metres"
        )
    return tool


def _carries(log: Recording, arm: Arm, tool: InertialParameters) -> tuple[bool, bool]:
    """Whether a log fits the arm with the tool better than the bare arm, and whether it does so beyond doubt.

    The metric is what the log tells by the method that knows best how far it can be trusted.
    """
    seen = choose(arm).identifier.run(log)
    information = np.linalg.inv(seen.covariance)
    with_tool = seen.phi - tool.phi
    ahead = float(seen.phi @ information @ seen.phi - with_tool @ information @ with_tool)
    return ahead > 0.0, abs(ahead) > DECISIVE


class _Found(NamedTuple):
    """What a method found, and what was known before.

    calibrated: whether its error bars were checked on held-out episodes.
    weak_std: standard deviation (10,) without a learned prior, of a method that has one.
    unprojected: mean (10,) and covariance (10, 10) of what the log says, before a body was made of it; None: the
        estimate's.
    offset_ratio: how many times the arm's torque offsets are what is expected of them, where that is too often.
    unknown_friction: whether the torques hold gear friction that nobody knew of; `friction_found`: that they did.
    known_arm_std: standard deviation (10,) of a method that says what it would be, were the arm known exactly.
    """

    estimate: Estimate
    before: Before
    method: str
    why: str
    calibrated: bool = False
    weak_std: NDArray[np.float64] | None = None
    unprojected: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    offset_ratio: float = 0.0
    unknown_friction: bool = False
    friction_found: bool = False
    known_arm_std: NDArray[np.float64] | None = None

    @property
    def misfit(self) -> float:
        """Standard deviations between what the log says and the nearest body."""
        return distance_to_body(*(self.unprojected or (self.estimate.phi, self.estimate.covariance)))

    def less(self, tool: NDArray[np.float64]) -> _Found:
        """The same without a tool (10,)."""
        said = None if self.unprojected is None else (self.unprojected[0] - tool, self.unprojected[1])
        return self._replace(estimate=replace(self.estimate, phi=self.estimate.phi - tool), unprojected=said)


def _check(log: Recording, arm: Arm) -> None:
    check_plausible(log, arm)
    if log.channel != "measured":
        raise IdentificationError(
            f"{log.source} holds {log.channel} torque: expected measured joint torque with gravity in it"
        )
    if log.rate < LOWEST_RATE:
        raise IdentificationError(
            f"{log.source} is sampled at {log.rate:.3g} Hz: expected at least {LOWEST_RATE:g} Hz; record faster"
        )


def _run(recording: Recording, arm: Arm, tare: Recording | None, method: str | Path | None) -> _Found:
    found = _found(choose(arm, tare, method), arm, recording)
    if found.unknown_friction:
        motor_side = replace(arm, motor_torque=True)
        found = _found(choose(motor_side, tare, method), motor_side, recording)
        found = found._replace(friction_found=True)
    return found


def _found(choice: Choice, arm: Arm, recording: Recording) -> _Found:
    identifier = choice.identifier
    estimate = identifier.run(recording)
    mean, std = identifier.payload_prior or (np.zeros(10), payload_prior_std(arm))
    if not choice.error_known:
        estimate = replace(estimate, covariance=np.diag(std**2))
    mismatch = identifier.mismatch
    # where the payload prior is learned, so are error bars that allow for friction
    unknown = identifier.payload_prior is None and not arm.motor_torque
    return _Found(
        estimate=estimate,
        before=Before(mean, std, choice.prior),
        method=choice.name,
        why=choice.why,
        calibrated=identifier.calibrated,
        weak_std=identifier.weak_std,
        unprojected=identifier.unprojected,
        offset_ratio=0.0 if mismatch is None else _offset_ratio(mismatch, recording),
        unknown_friction=unknown and mismatch is not None and mismatch.torque == "motor",
        known_arm_std=identifier.known_arm_std,
    )


def _offset_ratio(mismatch: ArmMismatch, recording: Recording) -> float:
    """How many times the torque offsets are what is expected of an arm; 0 where that is not too often."""
    ratios = mismatch.offset_ratios
    if mismatch.torque == "motor":  # there a joint at rest is held by any friction below stiction
        ratios = ratios[np.ptp(recording.q, axis=0) > MOVES]
    times = float(np.sqrt(ratios.mean())) if ratios.size else 0.0
    return times if times > LARGEST_OFFSETS[mismatch.torque] else 0.0


def _answer(
    found: _Found,
    arm: Arm,
    recording: Recording,
    tare: Recording | None,
    relative_to: str,
    notes: tuple[str, ...] = (),
    otherwise: NDArray[np.float64] | None = None,
    unsure: InertialParameters | None = None,
) -> Identification:
    """What is said of an estimate.

    otherwise: how far off the truth may be beyond the error bars (10,). unsure: a tool whose own inertia is not known.
    """
    estimate, before, weak = found.estimate, found.before, payload_prior_std(arm)
    determined = determined_by(estimate.std, before.std if before.used else None, found.weak_std, weak)
    is_held = held(estimate.phi[0], estimate.std[0], determined[0])
    leaning = np.zeros(10, dtype=bool)
    if found.weak_std is not None:
        leaning = determined & (found.weak_std > LEANS * estimate.std)
    phi = body_of(estimate, determined[0])
    low, high = phi_interval(phi, estimate.phi, estimate.std, determined, before, otherwise)
    if unsure is not None:
        low, high = _with_any_inertia(low, high, unsure)
    found_of = intervals(phi, low, high, estimate.covariance, otherwise)
    doubt = _doubt(found, determined[0], relative_to)
    said = [*notes] if doubt is None else [doubt, *notes]
    if found.friction_found:
        said.append("the torque holds the gears' friction, as that of motor currents does: the intervals allow for it")
    if is_held or not determined[0]:  # an empty hand has no inertia to be determined
        said += lacking(arm, tare is not None, determined, found.known_arm_std, weak)
        said += leaning_on_prior(leaning)
    consistent = is_consistent(phi)
    trusted = found.calibrated and doubt is None and consistent and otherwise is None and unsure is None
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
        rests_on_prior=~determined | leaning,
        notes=tuple(said),
        log=Path(recording.source).name,
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        why=found.why,
    )


def _doubt(found: _Found, mass_determined: bool, relative_to: str) -> str | None:
    """What keeps an answer from being believed, in a sentence."""
    if is_removal(found.estimate, mass_determined):
        if relative_to == "tare":
            return "something was taken off since the tare: the added mass is negative, so no body has these parameters"
        return (
            "the mass is negative: less is mounted than the model of the arm and its tool assume, or the torque's "
            "sign is turned"
        )
    if found.misfit > MISFIT:
        return NO_BODY
    if found.offset_ratio:
        return f"the torques are {found.offset_ratio:.0f} times as far off as those of an arm should be: {_CHECK}"
    return None


def _with_any_inertia(
    low: NDArray[np.float64], high: NDArray[np.float64], tool: InertialParameters
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Intervals (10,) of what a tool carries, were the tool's inertia that of any body within `REACH` of its centre.

    0 to mass·REACH² about each axis, products half of that either way, in place of what was assumed.
    """
    most, own = tool.mass * REACH**2, vech(tool.inertia_com)
    diagonal = np.array([True, False, False, True, False, True])
    less, more = np.where(diagonal, most - own, most / 2.0), np.where(diagonal, own, most / 2.0)
    return low - np.r_[np.zeros(4), less], high + np.r_[np.zeros(4), more]

"""One log in, one answer out: which method, relative to what, with which error bars, and what the log cannot tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, rated_mass
from armload.errors import IdentificationError
from armload.estimators import ArmMismatch, Estimate
from armload.identification.answer import Identification, body_of, is_removal
from armload.identification.choice import Choice, choose
from armload.identification.plausibility import check_plausible
from armload.identification.thresholds import DECISIVE, HEAVIEST, LARGEST_OFFSETS, LEANS, LOWEST_RATE, MISFIT, MOVES
from armload.inertia import NAMES, Z95, InertialParameters, distance_to_body, held, is_consistent, phi_to_com
from armload.inertia import determined as determined_by
from armload.recording import Recording, check_own_measurements
from armload.regression import payload_prior_std

_CHECK = "check the robot, the base (--gravity), what is mounted and the torques' signs"


def identify(
    recording: Recording,
    arm: Arm,
    *,
    tare: Recording | None = None,
    tool: InertialParameters | None = None,
    method: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify the payload of a log.

    Args:
        recording: measured joint torque (rigid body + friction, gravity included), position and velocity.
        arm: the bare arm, with the frame and gravity wanted.
        tare: an earlier log of the same arm, on any motion, with whatever was mounted then; the answer is what was
            added since. It shares no samples with the recording.
        tool: a tool mounted in the recording whose parameters are known; the answer is what it carries. Whether it was
            mounted at the tare too is found from the tare.
        method: a name in `armload.METHODS`, or the path of a trained model; None: the most trustworthy for the arm,
            "hybrid" where one is shipped, "map-gp" elsewhere.
        progress: told in a few words what is being done.

    Raises:
        ArmloadError: the log is not plausible for this arm, or the method cannot be used on it.
    """
    say = progress or (lambda _: None)
    for log in (recording, tare):
        if log is not None:
            _check(log, arm)
    if tare is not None:
        check_own_measurements(recording, tare)
    say("identifying")
    if tool is None:
        return _answer(_run(recording, arm, tare, method), arm, recording, "arm" if tare is None else "tare")
    tool = plausible_tool(arm.in_frame(tool), arm)
    if tare is None:
        arm = arm.with_payload(tool)
        return _answer(_run(recording, arm, None, method), arm, recording, "tool")
    carried, sure = _carries(tare, arm, tool)
    if carried:
        arm = arm.with_payload(tool)
        found, relative_to = _run(recording, arm, tare, method), "tare"
        note, otherwise = "the tool was mounted at the tare already", -tool.phi
    else:
        found, relative_to = _run(recording, arm, tare, method).less(tool.phi), "tool"
        note, otherwise = (
            "the tool was mounted after the tare: the answer is what was added since, less the tool",
            tool.phi,
        )
    if sure:
        return _answer(found, arm, recording, relative_to, (note,))
    note = f"it seems that {note}; the tare does not tell for sure, the intervals hold the other case, too"
    return _answer(found, arm, recording, relative_to, (note,), otherwise)


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
    """What a method found, and what was known before: mean and standard deviation (10,), used as a prior or not.

    calibrated: whether its error bars were checked on held-out episodes.
    weak_std: standard deviation (10,) without a learned prior, of a method that has one.
    unprojected: mean (10,) and covariance (10, 10) of what the log says, before a body was made of it; None: the
        estimate's.
    offset_ratio: how many times the arm's torque offsets are what is expected of them, where that is too often.
    unknown_friction: whether the torques hold gear friction that nobody knew of.
    """

    estimate: Estimate
    before: NDArray[np.float64]
    before_std: NDArray[np.float64]
    prior: bool
    method: str
    why: str
    calibrated: bool = False
    weak_std: NDArray[np.float64] | None = None
    unprojected: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    offset_ratio: float = 0.0
    unknown_friction: bool = False

    @property
    def explained(self) -> bool:
        """Whether a body lies within `MISFIT` standard deviations of what the log says: most often the answer does."""
        mean, covariance = self.unprojected or (self.estimate.phi, self.estimate.covariance)
        away = self.estimate.phi - mean
        if is_consistent(self.estimate.phi) and (
            not away.any() or away @ np.linalg.solve(covariance, away) <= MISFIT**2
        ):
            return True  # the nearest body is nearer still, and need not be found
        return distance_to_body(mean, covariance) <= MISFIT

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
        found = found._replace(why=f"{found.why}; the torque holds the gears' friction, as that of motor currents does")
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
        before=mean,
        before_std=std,
        prior=choice.prior,
        method=choice.name,
        why=choice.why,
        calibrated=identifier.calibrated,
        weak_std=identifier.weak_std,
        unprojected=identifier.unprojected,
        offset_ratio=0.0 if mismatch is None else _offset_ratio(mismatch, recording),
        unknown_friction=unknown and mismatch is not None and mismatch.torque == "motor",
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
    relative_to: str,
    notes: tuple[str, ...] = (),
    otherwise: NDArray[np.float64] | None = None,
) -> Identification:
    """What is said of an estimate; `otherwise` (10,): how far off the truth may be beyond the error bars."""
    estimate, before = found.estimate, found.before
    phi, half, half_before = estimate.phi.copy(), Z95 * estimate.std, Z95 * found.before_std
    determined = determined_by(
        estimate.std, found.before_std if found.prior else None, found.weak_std, payload_prior_std(arm)
    )
    is_held = held(phi[0], estimate.std[0], determined[0])
    # what the log does not tell keeps the interval of what was known before, stretched to an estimate that lies beyond
    reach = np.minimum(half, half_before) if found.prior else half
    low = np.where(determined, phi - half, np.minimum(before - half_before, phi - reach))
    high = np.where(determined, phi + half, np.maximum(before + half_before, phi + reach))
    if otherwise is not None:
        low, high = np.minimum(low, low + otherwise), np.maximum(high, high + otherwise)
    phi = body_of(estimate, determined[0])
    said, trusted = list(notes), found.calibrated and otherwise is None
    if is_removal(estimate, determined[0]):
        said.append(
            "something was taken off since the tare: the added mass is negative, so no body has these parameters"
            if relative_to == "tare"
            else "the mass is negative: less is mounted than the model of the arm and its tool assume, or the torque's "
            "sign is turned"
        )
    elif not found.explained:
        said.append(f"no body fits within the error bars: {_CHECK}")
        trusted = False
    elif found.offset_ratio:
        said.append(f"the torques are {found.offset_ratio:.0f} times as far off as those of an arm should be: {_CHECK}")
        trusted = False
    low, high = np.minimum(low, phi), np.maximum(high, phi)
    if not determined.all():
        missing = ", ".join(n for n, known in zip(NAMES, determined, strict=True) if not known)
        said.append(f"this motion does not determine {missing}: what was known before is reported for them")
    if found.weak_std is not None and np.any(leaning := determined & (found.weak_std > LEANS * estimate.std)):
        names = ", ".join(n for n, one in zip(NAMES, leaning, strict=True) if one)
        said.append(
            f"the error bars of {names} rest on what payloads are usually like more than on this log: of something "
            "wide and thin (a tray, a frame) believe --method map-gp instead"
        )
    mass, com, inertia_com = phi_to_com(phi)
    return Identification(
        method=found.method,
        robot=arm.name,
        frame=str(arm.frame),
        relative_to=relative_to,
        n_samples=estimate.n_samples,
        duration=recording.duration,
        phi=phi.tolist(),
        phi_low=low.tolist(),
        phi_high=high.tolist(),
        interval="calibrated" if trusted else "approximate",
        determined=[bool(x) for x in determined],
        mass=mass,
        com=com.tolist(),
        inertia_com=inertia_com.tolist(),
        consistent=is_consistent(phi),
        held=is_held,
        why=found.why,
        notes=tuple(said),
    )

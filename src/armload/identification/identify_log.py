"""One log in, one answer out: which method, relative to what, with which error bars, and what the log cannot tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import IdentificationError
from armload.estimators import Estimate, Identifier
from armload.identification.answer import Identification
from armload.identification.methods import METHODS, default_for
from armload.identification.plausibility import check_plausible
from armload.inertia import (
    HELD,
    NAMES,
    SMALL,
    Z95,
    InertialParameters,
    held,
    is_consistent,
    nearest_body,
    phi_to_com,
)
from armload.inertia import determined as told
from armload.posterior import Posterior, PosteriorLeastSquares
from armload.recording import Recording
from armload.regression import payload_prior_std

LOWEST_RATE = 20.0  # [Hz]
_MISFIT = 3.0  # standard deviations between the estimate and the nearest body, beyond which something is wrong
# rms of torque offsets over what is expected, from which on something is wrong: about 1 of most simulated arms, more
# where friction holds the joints (motor currents)
_STRANGE = {"link": 5.0, "motor": 8.0}
_MOVES = 0.05  # [rad] a joint that stays within so much stands
_LEANS = 3.0  # a log that alone tells a parameter so many times worse leaves it to the learned prior
_DECISIVE = 9.0  # between two squared distances: 90 to 1
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
            added since.
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
    most = 6.0 * float(payload_prior_std(arm)[0])  # three times the rated payload
    if not abs(tool.mass) <= most:
        raise IdentificationError(
            f"the tool weighs {tool.mass:.4g} kg: expected at most {most:.3g} kg, three times what {arm.name} is rated "
            "for; give kilograms and metres"
        )
    return tool


def _carries(log: Recording, arm: Arm, tool: InertialParameters) -> tuple[bool, bool]:
    """Whether a log fits the arm with the tool better than the bare arm, and whether it does so beyond doubt.

    The metric is what the log tells by the method that knows best how far it can be trusted.
    """
    identifier = METHODS[default_for(arm)].make(arm, None)
    seen = identifier.run(log)
    information = np.linalg.inv(seen.covariance)
    with_tool = seen.phi - tool.phi
    ahead = float(seen.phi @ information @ seen.phi - with_tool @ information @ with_tool)
    return ahead > 0.0, abs(ahead) > _DECISIVE


class _Found(NamedTuple):
    """What a method found, and what was known before: mean and standard deviation (10,), used as a prior or not.

    calibrated: whether its error bars were checked on held-out episodes.
    alone: standard deviation (10,) without a learned prior, of a method that has one.
    strange: how many times the arm's torque offsets are what is expected of them, where that is too often.
    """

    estimate: Estimate
    before: NDArray[np.float64]
    before_std: NDArray[np.float64]
    prior: bool
    method: str
    why: str
    calibrated: bool = False
    alone: NDArray[np.float64] | None = None
    strange: float = 0.0

    def less(self, tool: NDArray[np.float64]) -> _Found:
        """The same without a tool (10,)."""
        return self._replace(estimate=replace(self.estimate, phi=self.estimate.phi - tool))


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
    weak = payload_prior_std(arm)
    entry = METHODS.get(default_for(arm) if method is None else str(method))
    if entry is not None and not (entry.needs == "training" and Path(entry.name).is_file()):
        why = (
            f"{entry.name} holds for any motion and payload; an ensemble of the paper is taken only when named"
            if method is None
            else "asked for"
        )
        if method is None and tare is None:
            why += "; without a tare the error bars allow for the model's errors"
        identifier = entry.make(arm, tare)
        found = _found(identifier, recording, weak, entry.prior, why)
        if _holds_friction(identifier, arm):
            arm = replace(arm, motor_torque=True)
            why += "; the torque holds the gears' friction, as that of motor currents does"
            found = _found(entry.make(arm, tare), recording, weak, entry.prior, why)
        return found
    assert method is not None
    if not Path(method).is_file():
        near = get_close_matches(str(method), METHODS, 1)
        raise IdentificationError(
            f"unknown method {str(method)!r}: expected one of {', '.join(METHODS)}, or the path of a trained model"
            + (f"; did you mean {near[0]!r}?" if near else "")
        )
    from armload.ensembles import LearnedIdentifier, load_model
    from armload.posterior import HybridIdentifier, HybridModel

    if HybridModel.wrote(method):
        trained = HybridIdentifier(arm, tare, HybridModel.load(method))
        return _found(trained, recording, weak, True, f"asked for; {method} was trained for this arm")
    model = load_model(method)
    if tare is not None:
        raise IdentificationError(
            f"the trained model {method} cannot use a tare (an empty arm lies outside its training): leave the tare "
            "out, or use the method map"
        )
    model.check(arm, recording)
    estimate = LearnedIdentifier(model, arm).run(recording)
    family = np.maximum(model.phi_std, SMALL / Z95)  # what did not vary in training is not known exactly for that
    if model.error_std is None:  # how far the members disagree is no error bar
        estimate = replace(estimate, covariance=np.diag(family**2))
    why = f"asked for; {method} was trained on this arm and motion"
    return _Found(estimate, model.phi_mean, family, True, model.kind, why)


def _found(identifier: Identifier, recording: Recording, weak: NDArray, prior: bool, why: str) -> _Found:
    known, std = (np.zeros(10), weak) if identifier.known is None else identifier.known
    estimate = identifier.run(recording)
    asks = isinstance(identifier, PosteriorLeastSquares)
    strange = _strangeness(identifier.posterior, recording) if asks else 0.0
    return _Found(estimate, known, std, prior, identifier.name, why, identifier.calibrated, identifier.alone, strange)


def _strangeness(posterior: Posterior, recording: Recording) -> float:
    """How many times the torque offsets are what is expected of an arm; 0 where that is not too often."""
    ratios = posterior.ratios["offset"]
    if posterior.torque == "motor":  # there a joint at rest is held by any friction below stiction
        ratios = ratios[np.ptp(recording.q, axis=0) > _MOVES]
    times = float(np.sqrt(ratios.mean())) if ratios.size else 0.0
    return times if times > _STRANGE[posterior.torque] else 0.0


def _holds_friction(identifier: Identifier, arm: Arm) -> bool:
    """Whether a log showed gear friction in its torques that nobody knew of: of what is learned, it is part already."""
    physics = isinstance(identifier, PosteriorLeastSquares) and identifier.known is None
    return physics and not arm.motor_torque and identifier.posterior.torque == "motor"


def _misfit(estimate: Estimate) -> float:
    """Standard deviations between an estimate and the nearest body."""
    away = nearest_body(estimate.phi, estimate.covariance) - estimate.phi
    return float(np.sqrt(away @ np.linalg.inv(estimate.covariance) @ away)) if away.any() else 0.0


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
    determined = told(estimate.std, found.before_std if found.prior else None, found.alone, payload_prior_std(arm))
    is_held = held(phi[0], estimate.std[0], determined[0])
    # what the log does not tell keeps the interval of what was known before, stretched to an estimate that lies beyond
    reach = np.minimum(half, half_before) if found.prior else half
    low = np.where(determined, phi - half, np.minimum(before - half_before, phi - reach))
    high = np.where(determined, phi + half, np.maximum(before + half_before, phi + reach))
    if otherwise is not None:
        low, high = np.minimum(low, low + otherwise), np.maximum(high, high + otherwise)
    removed = determined[0] and phi[0] < -HELD * estimate.std[0]
    said, trusted = list(notes), found.calibrated and otherwise is None
    if removed:
        said.append(
            "something was taken off since the tare: the added mass is negative, so no body has these parameters"
            if relative_to == "tare"
            else "the mass is negative: less is mounted than the model of the arm and its tool assume, or the torque's "
            "sign is turned"
        )
    else:
        phi = nearest_body(estimate.phi, estimate.covariance)
        if _misfit(estimate) > _MISFIT:
            said.append(f"no body fits within the error bars: {_CHECK}")
            trusted = False
        elif found.strange:
            said.append(f"the torques are {found.strange:.0f} times as far off as those of an arm should be: {_CHECK}")
            trusted = False
    low, high = np.minimum(low, phi), np.maximum(high, phi)
    if not determined.all():
        missing = ", ".join(n for n, known in zip(NAMES, determined, strict=True) if not known)
        said.append(f"this motion does not determine {missing}: what was known before is reported for them")
    if found.alone is not None and np.any(leaning := determined & (found.alone > _LEANS * estimate.std)):
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

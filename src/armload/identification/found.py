"""What a method finds in a log: the estimate, and all that decides how far it may be believed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.estimators import ArmMismatch, Estimate
from armload.identification.arm_health import ArmHealth
from armload.identification.arm_notes import held_against
from armload.identification.choice import Choice, choose
from armload.identification.intervals import Before
from armload.identification.known_payload import know
from armload.identification.last_equations import LastEquations
from armload.identification.own_scale import OwnScale, own_scale
from armload.identification.shown_friction import driven_joints, is_frictionless
from armload.identification.thresholds import LARGEST_OFFSET, MISFIT, MOVES
from armload.inertia import distance_to_body, is_consistent
from armload.posterior import HybridIdentifier, Known, PosteriorLeastSquares, Profile
from armload.posterior.restless import most_restless
from armload.posterior.scales import AnotherArm, Drift, Tilt
from armload.posterior.tilt import TURNED, TURNS
from armload.recording import Recording, span
from armload.regression import JointFeatures, payload_prior_std

# [squared expected deviations, summed over links] that no sound arm with joint torque sensors shows: the 99 % point of
# chi-squared for a Panda's 70 link parameters, of which a log tells a part. Simulated ones as measured reach 13 (60
# logs of 12 arms on other seeds, too), those beyond 36, the real Panda 55. A KUKA LWR taken for an iiwa has 180 to 200,
# but with the noise of its log's velocities taken out 17 to 26: then it is not told
STRANGE_LINKS = 100.0


@dataclass(frozen=True)
class Asked:
    """How a log is to be identified.

    method: as of `identify`. drift: by how many daily deviations the arm may differ from what it was at its tare.
    known: what is known of the payload apart from the log. profile: what was learned of the arm from many logs.
    features: of the arm's smooth mismatch, without a profile; None: the usual ones.
    """

    method: str | Path | None = None
    drift: float = 0.0
    known: Known | None = None
    profile: Profile | None = None
    features: JointFeatures | None = None

    def method_for(self, arm: Arm, tare: Recording | None) -> Choice:
        """The method, made ready for an arm and a tare."""
        return choose(arm, tare, self.method, profile=self.profile, features=self.features)


class Found(NamedTuple):
    """What a method found, and what was known before.

    calibrated: whether its error bars were checked on held-out episodes.
    weak_std: standard deviation (10,) without a learned prior, of a method that has one.
    unprojected: mean (10,) and covariance (10, 10) of what the log says, before a body was made of it; None: the
        estimate's.
    offset_ratio: how many times the arm's torque offsets are what is expected of them, where that is too often.
    backwards: joints, from 1, that friction surely drives where it must brake them, of such a method.
    own_scale: of the torques, of what the arm's own links need, of a method that knows the arm's; None where a known
        weight has told it.
    frictionless: whether no joint that moves shows friction, of a method that knows the arm's.
    strange_links: by how much the arm's links differ from the model's (`ArmMismatch.links`), where that is too much.
    unknown_friction: whether the torques hold unknown gear friction; `friction_found`: that they did.
    known_arm_std: standard deviation (10,) of a method that says what it would be, were the arm known exactly.
    drift: by how much the arm differs from what it was at the tare, of a method that asks.
    another: whether it is another one than at its tare, of a method that asks.
    tilt: by how much gravity is turned from that of the arm, of a method that asks. gravity: (3,) [m/s²] with which all
        this was found, where it is not what was given.
    restlessness: how restless the torques are, of what they were at the tare (`posterior.restless`).
    restless_joint: the joint, from 1, that has most of it; 0 where it was not asked.
    exchanged: whether the estimate is rather the difference of two bodies, one put on for another.
    kappa: by how much the physics overrates the log's evidence, of a method that knows.
    gain_std: relative standard deviation of the torque's scale, of a method that allows for one. gain_known: whether a
        known weight fixed it.
    known: of the payload apart from the log. taken: whether the estimate rests on that, too. log_only: mean (10,) and
        covariance (10, 10) without that. denies_family: whether the log denies the families that were given.
    health: the arm itself, of a method that asks.
    arm_known: what it is held against by `drift` and `another`: "tare", "profile", or "both".
    """

    estimate: Estimate
    before: Before
    method: str
    why: str
    calibrated: bool = False
    weak_std: NDArray[np.float64] | None = None
    unprojected: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    offset_ratio: float = 0.0
    backwards: tuple[int, ...] = ()
    own_scale: OwnScale | None = None
    frictionless: bool = False
    strange_links: float = 0.0
    unknown_friction: bool = False
    friction_found: bool = False
    known_arm_std: NDArray[np.float64] | None = None
    drift: Drift | None = None
    another: AnotherArm | None = None
    tilt: Tilt | None = None
    gravity: tuple[float, float, float] | None = None
    restlessness: float = 0.0
    restless_joint: int = 0
    exchanged: bool = False
    known: Known | None = None
    taken: bool = False
    log_only: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    denies_family: bool = False
    kappa: float | None = None
    gain_std: float | None = None
    gain_known: bool = False
    health: ArmHealth | None = None
    arm_known: str = "tare"

    @property
    def explained(self) -> bool:
        """Whether a body explains what the log says."""
        return explained(self.estimate, self.unprojected)

    def with_error(self, covariance: NDArray[np.float64], calibrated: bool = True) -> Found:
        """The same with one more error of phi, of that covariance (10, 10): of a tool that is not known exactly.

        calibrated: whether that covariance is.
        """
        unprojected, log_only = (x and (x[0], x[1] + covariance) for x in (self.unprojected, self.log_only))
        estimate, known = self.estimate, self.known and self.known.with_error(None)
        if not self.taken:  # else it was in already: what is known tells of it, too
            estimate = replace(estimate, covariance=estimate.covariance + covariance)
        found = self._replace(estimate=estimate, unprojected=unprojected, log_only=log_only, known=known)
        return found._replace(calibrated=calibrated and self.calibrated)

    def less(self, tool: NDArray[np.float64]) -> Found:
        """The same without a tool (10,)."""
        unprojected, log_only = (x and (x[0] - tool, x[1]) for x in (self.unprojected, self.log_only))
        known = self.known and self.known.with_tool(np.zeros(10))
        estimate = replace(self.estimate, phi=self.estimate.phi - tool)
        return self._replace(estimate=estimate, unprojected=unprojected, known=known, log_only=log_only)


def explained(estimate: Estimate, unprojected: tuple[NDArray[np.float64], NDArray[np.float64]] | None) -> bool:
    """Whether a body lies within `MISFIT` standard deviations of what a log says: most often the answer does."""
    mean, covariance = unprojected or (estimate.phi, estimate.covariance)
    away = estimate.phi - mean
    if is_consistent(estimate.phi) and (not away.any() or away @ np.linalg.solve(covariance, away) <= MISFIT**2):
        return True  # the nearest body is nearer still, and need not be found
    return distance_to_body(mean, covariance) <= MISFIT


def found_in(recording: Recording, arm: Arm, tare: Recording | None, asked: Asked) -> Found:
    """What a method finds in a log of an arm, with gravity as it was given, unless it surely is another."""
    found = _found_on_side(recording, arm, tare, asked)
    if found.tilt is None or not found.tilt.found or asked.profile is not None:
        return found  # a profile's logs are of the gravity that it was learned with
    for _ in range(TURNS):  # the payload's torque turns with gravity, which the test leaves out
        arm = arm.leaning(found.tilt.angles)
        found = _found_on_side(recording, arm, tare, asked)
        if found.tilt is None or np.linalg.norm(found.tilt.angles) < TURNED:
            break
    return found._replace(gravity=arm.gravity)


def _found_on_side(recording: Recording, arm: Arm, tare: Recording | None, asked: Asked) -> Found:
    """The same, whichever side of the gears the torque is measured on."""
    found = _found(asked.method_for(arm, tare), arm, recording, asked)
    if found.unknown_friction:
        motor_side = replace(arm, motor_torque=True)
        found = _found(asked.method_for(motor_side, tare), motor_side, recording, asked)
        found = found._replace(friction_found=True)
    return found._replace(arm_known=held_against(asked.profile is not None, tare is not None))


def _found(choice: Choice, arm: Arm, recording: Recording, asked: Asked) -> Found:
    identifier = choice.identifier
    posterior = identifier if isinstance(identifier, PosteriorLeastSquares) else None
    know(identifier, asked.known)
    if posterior is not None:
        posterior.allow_for(asked.drift)
    estimate = identifier.run(recording)
    mean, std = identifier.payload_prior or (np.zeros(10), payload_prior_std(arm))
    if not choice.error_known:
        estimate = replace(estimate, covariance=np.diag(std**2))
    mismatch = identifier.mismatch
    kappa = identifier.kappa if isinstance(identifier, HybridIdentifier) else None
    gain_known = asked.profile is not None and asked.profile.gain_std is not None
    last = None if posterior is None else LastEquations.of(posterior)
    # where the payload prior is learned, so are error bars that allow for friction
    unknown = identifier.payload_prior is None and not arm.motor_torque
    return Found(
        estimate=estimate,
        before=Before(mean, std),
        method=choice.name,
        why=choice.why,
        calibrated=identifier.calibrated,
        weak_std=identifier.weak_std,
        unprojected=identifier.unprojected,
        offset_ratio=0.0 if mismatch is None else _offset_ratio(mismatch, recording),
        backwards=() if last is None else driven_joints(last, recording, kappa),
        own_scale=None if last is None or gain_known else own_scale(last),
        frictionless=last is not None and is_frictionless(last, recording),
        strange_links=0.0 if mismatch is None or mismatch.torque == "motor" else _strange(mismatch.links),
        unknown_friction=unknown and mismatch is not None and mismatch.torque == "motor",
        known_arm_std=identifier.known_arm_std,
        drift=None if posterior is None else posterior.stream.drift,
        another=None if posterior is None else posterior.stream.another,
        tilt=None if posterior is None else posterior.stream.tilt,
        restlessness=0.0 if posterior is None else posterior.stream.restlessness,
        restless_joint=0 if posterior is None else _restless_joint(posterior),
        exchanged=posterior is not None and posterior.exchanged,
        kappa=kappa,
        gain_std=None if posterior is None else posterior.posterior.gain_std,
        gain_known=gain_known,
        known=asked.known,
        taken=posterior is not None and posterior.taken,
        log_only=None if posterior is None else posterior.log_only,
        denies_family=isinstance(identifier, HybridIdentifier) and identifier.denies_family,
        health=None if posterior is None else ArmHealth.of(posterior),
    )


def _restless_joint(found: PosteriorLeastSquares) -> int:
    """The joint, from 1, whose torque is the most restless; 0 where none is known."""
    stream = found.stream
    if not stream.restlessness:
        return 0
    return most_restless(found.posterior.power, stream.noise.residual * stream.correction.effort)


def _strange(links: float) -> float:
    """By how much the links differ from the model's, where no sound arm's do: motor currents tell too little."""
    return links if links > STRANGE_LINKS else 0.0


def _offset_ratio(mismatch: ArmMismatch, recording: Recording) -> float:
    """How many times the torque offsets are what is expected of an arm; 0 where that is not too often."""
    ratios = mismatch.offset_ratios
    if mismatch.torque == "motor":  # there a joint at rest is held by any friction below stiction
        ratios = ratios[span(recording.q) > MOVES]
    times = float(np.sqrt(ratios.mean())) if ratios.size else 0.0
    return times if times > LARGEST_OFFSET else 0.0

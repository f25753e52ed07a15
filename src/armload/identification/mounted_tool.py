"""A tool that is mounted on an arm, as something that counts as known: its parameters, and how far they may be off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, from_frame, rated_mass
from armload.errors import IdentificationError
from armload.estimators import Estimate
from armload.identification.thresholds import HEAVIEST
from armload.inertia import Z95, InertialParameters, Inexact, near_consistent, nearest_body, vech
from armload.payloads import INERTIA_ASSUMED, Payload
from armload.posterior import Known
from armload.posterior.known import Gaussian
from armload.regression.prior import REACH


def plausible_tool(tool: InertialParameters, arm: Arm) -> InertialParameters:
    """The tool, if an arm can carry so much.

    Raises:
        IdentificationError: it weighs more than three times the rated payload: in grams, say.
    """
    plausible_mass(tool.mass, "the tool weighs", arm)
    return tool


def plausible_mass(mass: float, said: str, arm: Arm) -> None:
    """See that an arm can hold a mass [kg]. said: what it is, as the message begins.

    Raises:
        IdentificationError: it is more than three times the rated payload.
    """
    most = HEAVIEST * rated_mass(arm)
    if not abs(mass) <= most:
        raise IdentificationError(
            f"{said} {mass:.4g} kg: expected at most {most:.3g} kg, {HEAVIEST:g} times what {arm.name} is rated for; "
            "give kilograms and metres"
        )


def mounted_on(arm: Arm, tool: InertialParameters | Payload) -> tuple[InertialParameters, Inexact]:
    """A tool about an arm's payload frame, and what its file says of its error; of parameters alone, that it has none.

    Raises:
        ArmError: joints lie between its frame and the arm's. IdentificationError: as `plausible_tool`.
    """
    if not isinstance(tool, Payload):
        return plausible_tool(arm.in_frame(tool), arm), Inexact(np.zeros((10, 10)))
    notes = () if tool.inertia_known else (f"tool {tool.name}: {INERTIA_ASSUMED}; the intervals allow for any other",)
    covariance = in_frame(arm, tool.covariance, tool.parameters.frame)
    trusted = tool.inertia_known and (tool.measured is None or tool.measured.calibrated)
    return plausible_tool(arm.in_frame(tool.parameters), arm), Inexact(covariance, trusted, notes)


def with_tool(arm: Arm, tool: InertialParameters | Payload) -> Arm:
    """An arm with a tool that counts as part of it, and as known as its file says.

    Where only mass and centre are given, each moment and product of inertia has the error whose 95 % interval holds all
    that `any_inertia` allows.

    Raises:
        ArmError, IdentificationError: as `mounted_on`.
    """
    known, error = mounted_on(arm, tool)
    if isinstance(tool, Payload) and not tool.inertia_known:
        std = np.maximum(*any_inertia(known)) / Z95
        error += Inexact(np.diag(np.r_[np.zeros(4), std**2]))
    return arm.with_payload(known, None if error.is_none else error)


def allowing_for(
    error: Inexact, estimate: Estimate, known: Known | None, log_only: Gaussian | None, quick: bool = False
) -> Estimate:
    """An answer that allows for the error of a tool, which has nothing to do with the log.

    What is known of the payload is held against the log with that error: a weighed payload leaves what the tool weighs
    in doubt, and not the other way round.

    Args:
        known: of the payload, apart from the log. log_only: what the log says without it. quick: the nearest body is
            found in bounded time.
    """
    if not np.any(error.covariance):
        return estimate
    if known is None or log_only is None or not known.which.any():
        return replace(estimate, covariance=estimate.covariance + error.covariance)
    alone = log_only[0], log_only[1] + error.covariance
    given = known.given(*alone)
    if given is None and known.given(*log_only) is None:  # nor does the answer rest on it
        return replace(estimate, covariance=estimate.covariance + error.covariance)
    mean, covariance = given or alone
    body = near_consistent(mean, np.linalg.inv(covariance)) if quick else nearest_body(mean, covariance)
    return replace(estimate, phi=body, covariance=covariance)


def any_inertia(tool: InertialParameters) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far (6,) below and above the truth what a tool carries is, were the tool's inertia that of any body [kg·m²].

    Any body within `REACH` of its centre: 0 to mass·REACH² about each axis, products half of that either way, in place
    of what was assumed.
    """
    most, own = tool.mass * REACH**2, vech(tool.inertia_com)
    diagonal = np.array([True, False, False, True, False, True])
    return np.where(diagonal, most - own, most / 2.0), np.where(diagonal, own, most / 2.0)


def in_frame(arm: Arm, covariance: NDArray[np.float64], frame: str | None) -> NDArray[np.float64]:
    """A covariance (10, 10) of phi about the arm's payload frame, from another."""
    T = from_frame(arm, frame)
    return T @ covariance @ T.T

"""What is known of a payload apart from the log, and what that makes of an answer; for logs and streams."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armload.errors import IdentificationError
from armload.estimators import Identifier
from armload.identification.intervals import Before
from armload.identification.thresholds import LEANS
from armload.inertia import NAMES, UNITS, Z95, inertia_matrix
from armload.inertia import determined as determined_by
from armload.posterior import HybridIdentifier, Known, KnownBody, KnownCentre, KnownMass, PosteriorLeastSquares


def know(identifier: Identifier, known: Known | None) -> None:
    """Tell an identifier what is known of the payload.

    Raises:
        IdentificationError: its method can use nothing of the kind. ModelError: it has not learned such a family.
    """
    if isinstance(identifier, HybridIdentifier):
        identifier.expect(known)
    elif known is not None and known.families:
        raise IdentificationError(
            f"the method {identifier.name} has learned of no families of payloads: leave --family out, or use hybrid"
        )
    elif isinstance(identifier, PosteriorLeastSquares):
        identifier.known = known
    elif known is not None:
        raise of_no_use_to(identifier.name)


def of_no_use_to(method: str) -> IdentificationError:
    """That a method can use nothing of what is known."""
    return IdentificationError(
        f"the method {method} cannot use what is known of a payload: leave --mass, --com and --body out, "
        "or use hybrid, map-gp or map"
    )


def denied_by(
    known: Known | None,
    log_only: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
    denies_family: bool = False,
) -> str | None:
    """That what a log says, mean (10,) and covariance (10, 10), is not what is known; None: it may be it.

    denies_family: whether it is of none of the families that are known.
    """
    if known is None or log_only is None:
        return None
    said = [_other_than_given(one, *log_only) for one in known.denied(*log_only)]
    if not said and denies_family:
        said = [_of_none_of(known.families)]
    return "; ".join(said) or None


def _of_none_of(families: Sequence[str]) -> str:
    """That the log does not bear the families that were given."""
    return (
        f"the log says that the payload is none of {', '.join(families)}, which is left out: check what is held, and "
        "what was mounted at the tare"
    )


def _other_than_given(
    given: KnownMass | KnownCentre | KnownBody, mean: NDArray[np.float64], covariance: NDArray[np.float64]
) -> str:
    """That the log, which says phi ~ N(mean, covariance), does not bear the mass, centre or body that was given."""
    if isinstance(given, KnownBody):
        off = np.abs(given.phi - mean) / np.sqrt(np.diag(covariance + given.covariance))
        k = int(np.argmax(off))
        ours, theirs = Z95 * np.sqrt([covariance[k, k], given.covariance[k, k]])
        return (
            f"the body given is not what the log says, and is left out: its {NAMES[k]} is {given.phi[k]:.3g} ± "
            f"{theirs:.2g} {UNITS[k]} (95 %), the log's {mean[k]:.3g} ± {ours:.2g}; check its frame and units, what is "
            "held, and what was mounted at the tare"
        )
    if isinstance(given, KnownMass):
        return (
            f"the mass given, {given.mass:.4g} ± {Z95 * given.std:.2g} kg (95 %), is not what the log says, "
            f"{mean[0]:.4g} ± {Z95 * np.sqrt(covariance[0, 0]):.2g} kg, and is left out: check its unit, what was "
            "weighed and what was mounted at the tare"
        )
    r = np.array([given.com, mean[1:4] / mean[0]])
    (x, y, z), (a, b, c) = (1e3 * r).tolist()
    return (
        f"the centre of mass given, ({x:.0f}, {y:.0f}, {z:.0f}) ± {1e3 * Z95 * given.std:.2g} mm (95 %), is not what "
        f"the log says, ({a:.0f}, {b:.0f}, {c:.0f}) mm, and is left out: check the frame that it is given in, what is "
        "held, and what was mounted at the tare"
    )


def determined_with(
    determined: NDArray[np.bool_], known: Known | None, std: NDArray[np.float64], before: Before
) -> NDArray[np.bool_]:
    """Which parameters (10,) the log or what is known determines.

    Args:
        determined: by the log alone (10,). known: what an answer rests on, too. std: of the answer (10,). before: what
            was known of any payload.
    """
    if known is None:
        return determined
    if known.body is not None:
        return determined | determined_by(std, np.maximum(before.std, _sizes(known.body.phi)))
    given = determined_by(std, before.std) & known.which
    given[1:4] &= given[0] | determined[0]
    return determined | given


def _sizes(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """How large each of the ten is of such a body: the least spread that says nothing of it, however large a body is.

    Of a moment or a product of inertia that is zero by symmetry it is the size of its like.
    """
    moments = np.full(3, np.linalg.norm(phi[1:4]))
    return np.r_[abs(phi[0]), moments, np.full(6, np.abs(inertia_matrix(phi[4:]).diagonal()).max())]


def rests_on_prior(
    determined: NDArray[np.bool_], known: Known | None, std: NDArray[np.float64], weak_std: NDArray[np.float64] | None
) -> NDArray[np.bool_]:
    """Which parameters (10,) are determined, though what is learned of payloads says more of them than the log does.

    Args:
        determined, known, std: of the answer. weak_std: (10,) without what was learned; None: nothing was.
    """
    if weak_std is None:
        return np.zeros(10, dtype=bool)
    leans = determined & (weak_std > LEANS * std)
    return leans if known is None else leans & ~known.which  # what is known does not rest on the prior

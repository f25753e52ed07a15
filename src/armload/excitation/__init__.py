"""Motions designed to tell a payload: what is wanted, what is allowed, the design, and its check by other code."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.excitation.accuracy import Accuracy
    from armload.excitation.constraints import Constraints
    from armload.excitation.criterion import Criterion
    from armload.excitation.enrichment import Enriched, enrich, touched_by
    from armload.excitation.optimisation import Design, design_motion
    from armload.excitation.payload_range import PayloadRange
    from armload.excitation.surroundings import Obstacle, Surroundings
    from armload.excitation.until import design_until
    from armload.excitation.verification import problems, used

__all__ = [
    "Accuracy",
    "Constraints",
    "Criterion",
    "Design",
    "Enriched",
    "Obstacle",
    "PayloadRange",
    "Surroundings",
    "design_motion",
    "design_until",
    "enrich",
    "problems",
    "touched_by",
    "used",
]

__getattr__, __dir__ = on_first_use(__name__)

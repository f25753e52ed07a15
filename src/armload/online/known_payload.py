"""What a run makes of what is known of payloads apart from the stream: taken where something is held that may be it."""

from __future__ import annotations

from armload.estimators import Identifier
from armload.identification.notes import other_than_given
from armload.posterior import Known, PosteriorLeastSquares


def taken_by(run: Identifier) -> Known | None:
    """What the last answer of a run rests on beside the samples."""
    return run.known if isinstance(run, PosteriorLeastSquares) and run.taken else None


def denied_by(run: Identifier) -> str | None:
    """That what a run holds is not what is known; None: it may be it, or nothing is known."""
    if not isinstance(run, PosteriorLeastSquares) or run.known is None or run.log_only is None or run.taken:
        return None
    denied = run.known.denied(*run.log_only)
    return None if denied is None else other_than_given(denied, *run.log_only)

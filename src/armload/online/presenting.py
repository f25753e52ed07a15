"""The answer to a sample, put together from the judgement, the watch over changes and the state of the stream."""

from __future__ import annotations

from typing import Any

from armload.online.estimate import OnlineEstimate
from armload.online.judgement import Judgement
from armload.online.watch import PayloadWatch


def presented(
    judged: Judgement, watch: PayloadWatch | None, trouble: str | None, fields: dict[str, Any]
) -> OnlineEstimate:
    """An `OnlineEstimate` of the last judgement, with probabilities where there is a watch.

    Args:
        trouble: what keeps samples from being used, one more note. fields: what only the identifier knows, by name.
    """
    change, contact, drift = (None, None, None) if watch is None else watch.likely
    return OnlineEstimate.of(
        {
            **vars(judged.estimate),
            **fields,
            "lag": 0.0,
            "determined": judged.determined,
            "held": judged.held,
            "around": judged.around,
            "before": judged.before,
            "p_held": judged.p_held,
            "p_change": change,
            "p_contact": contact,
            "p_drift": drift,
            "settling": watch is not None and watch.settling,
            "notes": judged.notes if trouble is None else (*judged.notes, trouble),
        }
    )

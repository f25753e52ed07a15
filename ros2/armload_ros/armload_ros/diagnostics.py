"""What `/diagnostics` says of the node, once a second."""

from __future__ import annotations

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from armload.online import OnlineEstimate


def status_of(trouble: tuple[bytes, str] | None, estimate: OnlineEstimate | None, why: str | None) -> DiagnosticStatus:
    """What is held, or what is wrong.

    Args:
        trouble: a level and a sentence that come before anything else. estimate: the newest answer. why: it is unknown.
    """
    level, text = DiagnosticStatus.OK, "nothing held"
    if trouble is not None:
        level, text = trouble
    elif estimate is None:
        level, text = DiagnosticStatus.WARN, "nothing heard yet"
    elif why is not None or estimate.notes:
        said = dict.fromkeys([*([] if why is None else [why]), *estimate.notes])  # each once
        level, text = DiagnosticStatus.WARN, "; ".join(said)
    elif estimate.held:
        text = f"{estimate.phi[0]:.3f} kg, {estimate.interval}"
    return DiagnosticStatus(level=level, message=text)


def values_of(estimate: OnlineEstimate | None, **more: str) -> list[Any]:
    """The rows below it."""
    if estimate is not None:
        more |= {
            "mass [kg]": f"{estimate.phi[0]:.4f}",
            "mass, 95 % [kg]": f"{estimate.low[0]:.4f} … {estimate.high[0]:.4f}",
            "interval": estimate.interval,
            "age [s]": f"{estimate.age:.3f}",
            "event": str(estimate.event or ""),
            "samples left out": str(estimate.health.bad),
        }
    return [KeyValue(key=key.replace("_", " "), value=value) for key, value in more.items()]

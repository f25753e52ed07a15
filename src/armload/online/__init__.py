"""Payload identification on a running robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.online.estimate import OnlineEstimate
    from armload.online.event import Event
    from armload.online.gate import Gate, Health
    from armload.online.online_identifier import OnlineIdentifier

__all__ = [
    "Event",
    "Gate",
    "Health",
    "OnlineEstimate",
    "OnlineIdentifier",
]

__getattr__, __dir__ = on_first_use(__name__)

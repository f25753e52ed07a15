"""Payload identification beside a running robot."""

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

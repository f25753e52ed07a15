"""Streams that go on for months: sources that are opened again, one process for each arm, alarms, an endpoint."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use

if TYPE_CHECKING:
    from armload.service.alarms import Alarm, Alarms
    from armload.service.endpoint import Endpoint
    from armload.service.feedback import Feedback
    from armload.service.history import History
    from armload.service.mqtt import Mqtt
    from armload.service.reconnecting import Reconnecting
    from armload.service.service import Service
    from armload.service.session import Session
    from armload.service.session_log import Entry
    from armload.service.settings import ArmSettings, ServiceSettings, read_settings
    from armload.service.unknown import Unknown
    from armload.service.webhook import Webhook

__all__ = [
    "Alarm",
    "Alarms",
    "ArmSettings",
    "Endpoint",
    "Entry",
    "Feedback",
    "History",
    "Mqtt",
    "Reconnecting",
    "Service",
    "ServiceSettings",
    "Session",
    "Unknown",
    "Webhook",
    "read_settings",
]

__getattr__, __dir__ = on_first_use(__name__)

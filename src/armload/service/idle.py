"""Settings that would change nothing: each says one thing, and what it says it of is not there.

Whoever wrote one believes that it does something. So it is refused, as an unknown setting is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.errors import UsageError

if TYPE_CHECKING:
    from armload.service.settings import ArmSettings, ServiceSettings


def check_arm(arm: ArmSettings) -> None:
    """Refuse a setting of an arm that would change nothing.

    Raises:
        UsageError: there is one.
    """
    if arm.mounted is not None and arm.apply is None:
        _refuse(
            arm.name,
            "mounted",
            'says what the controller must count, too, but nothing is told to it: give apply = "auto"',
        )
    if arm.loop and not arm.replays:
        _refuse(arm.name, "loop", f"replays a log again and again, but the source is {arm.source}: name a log")
    if arm.rate is not None and arm.source != "sim":
        _refuse(arm.name, "rate", f"is of the simulator, but the source is {arm.source}: name sim")


def check_service(service: ServiceSettings) -> None:
    """Refuse a setting of the service that would change nothing.

    Raises:
        UsageError: there is one.
    """
    if service.headers and service.webhook is None:
        _refuse(None, "headers", "are sent to the webhook, but there is none: give webhook")
    for key, given in (("host", service.host), ("token_file", service.token)):
        if given is not None and service.port is None:
            _refuse(None, key, "is of the endpoint, but there is none: give a port")


def _refuse(name: str | None, key: str, why: str) -> None:
    raise UsageError(f"{'' if name is None else f'{name}: '}{key} {why}, or leave {key} out")

"""Alarms to an MQTT broker, through paho-mqtt: it connects again, and keeps what waits meanwhile."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote, urlsplit

from armload.errors import UsageError
from armload.runtime.extras import install
from armload.service.receiver import KEPT, Health, is_host, unreachable, without_user

_LONGEST = 60  # [s] between two trials to connect
_NO_ROOM = 15  # MQTT_ERR_QUEUE_SIZE
_PORTS = {"mqtt": 1883, "mqtts": 8883}


class Mqtt:
    """Publishes messages at least once (quality of service 1); nobody waits for it.

    | topic | what |
    |---|---|
    | `PREFIX/ARM/alarm` | each alarm as one JSON object |
    | `PREFIX/online` | `true` while the service is connected, else `false`, kept by the broker (its will) |

    Args:
        url: mqtt://[USER:PASSWORD@]HOST[:PORT][/PREFIX], or mqtts:// with TLS. The prefix is "armload" without one.

    Attributes:
        health: whether the broker takes messages.

    Raises:
        UsageError: the address is not one, or paho-mqtt is not installed.
    """

    def __init__(self, url: str) -> None:
        parts = checked(url)
        try:
            from paho.mqtt.client import Client
            from paho.mqtt.enums import CallbackAPIVersion
        except ImportError:
            raise UsageError(f"MQTT needs paho-mqtt, which is not installed: {install('paho')}") from None
        self._prefix, self.health = parts.path.strip("/") or "armload", Health("the MQTT broker")
        self._client = client = Client(CallbackAPIVersion.VERSION2)
        client.max_queued_messages_set(KEPT)
        client.reconnect_delay_set(1, _LONGEST)
        client.will_set(f"{self._prefix}/online", "false", qos=1, retain=True)
        if parts.username is not None:
            client.username_pw_set(unquote(parts.username), unquote(parts.password or ""))
        if parts.scheme == "mqtts":
            client.tls_set()
        client.on_connect, client.on_connect_fail, client.on_disconnect = self._connected, self._absent, self._lost
        client.connect_async(str(parts.hostname), parts.port or _PORTS[parts.scheme])
        client.loop_start()

    def post(self, message: Mapping[str, Any]) -> None:
        """Take a message to be sent; returns at once."""
        text = json.dumps(message, allow_nan=False)
        sent = self._client.publish(f"{self._prefix}/{message['arm']}/alarm", text, qos=1)
        if sent.rc == _NO_ROOM:  # without a connection it waits
            self.health.drop(f"{KEPT} wait, new ones are dropped")

    @property
    def dropped(self) -> int:
        """Messages there was no room for."""
        return self.health.dropped

    def close(self) -> None:
        """Say that the service is gone, give what waits two more seconds, and end."""
        last = self._say_online("false", 1)  # behind the alarms
        if last.rc == _NO_ROOM:
            last = self._say_online("false", 0)
        if self._client.is_connected():
            with contextlib.suppress(RuntimeError, ValueError):
                last.wait_for_publish(2.0)
        self._client.disconnect()
        self._client.loop_stop()

    def _connected(self, _client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:  # what a broker refuses comes here, too
            self.health.tell(f"refuses the connection: {reason}")
            return
        self.health.tell(None)
        self._say_online("true", 0)  # which needs no room: with 1000 alarms that wait there would be none

    def _say_online(self, so: str, qos: int) -> Any:
        return self._client.publish(f"{self._prefix}/online", so, qos=qos, retain=True)

    def _absent(self, *_: Any) -> None:
        error = sys.exc_info()[1]  # paho calls while it handles it
        why = f": {unreachable(error)}" if isinstance(error, Exception) else ""
        self.health.tell(f"cannot be reached{why}; it is tried again")

    def _lost(self, _client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure and self.health.failed is None:  # what was refused has been said
            self.health.tell(f"was lost: {reason}")


def checked(url: str) -> Any:
    """The parts of a broker's address.

    Raises:
        UsageError: it is none.
    """
    said = "expected an address such as mqtt://HOST:1883/PREFIX"
    try:
        parts = urlsplit(url)
        parts.port  # noqa: B018 - raises where it is no number
    except ValueError:
        raise UsageError(f"the MQTT broker is {without_user(url)!r}: {said}") from None
    wrong = parts.scheme not in _PORTS or not parts.hostname or parts.port == 0 or parts.query
    if wrong or any(x in url for x in "+# ") or not url.isprintable() or not is_host(parts.hostname or ""):
        raise UsageError(f"the MQTT broker is {without_user(url)!r}: {said}")
    return parts

"""Alarms over MQTT, against a broker of another maker.

That is amqtt, which wants other versions of packages than armload's own environment has: it runs in the Python that
ARMLOAD_BROKER_PYTHON names, else in that of `make .venv-broker/.stamp`.
"""

import contextlib
import json
import os
import queue
import re
import socket
import subprocess
import threading
import time
from pathlib import Path

import pytest

from armload.errors import UsageError
from armload.service.mqtt import Mqtt, checked

PATIENCE = 60.0
ROOT = Path(__file__).resolve().parents[2]
BROKER = os.environ.get("ARMLOAD_BROKER_PYTHON", str(ROOT / ".venv-broker" / "bin" / "python"))


@contextlib.contextmanager
def broker(port):
    """amqtt in a process of its own, killed whatever happens."""
    program = f"""
import asyncio, logging
from amqtt.broker import Broker
logging.disable()
plugins = {{"amqtt.plugins.authentication.AnonymousAuthPlugin": {{"allow_anonymous": True}}}}
async def run():
    listeners = {{"default": {{"type": "tcp", "bind": "127.0.0.1:{port}"}}}}
    one = Broker({{"listeners": listeners, "plugins": plugins}})
    await one.start()
    print("ready", flush=True)
    await asyncio.sleep(300)
asyncio.run(run())
"""
    with subprocess.Popen([BROKER, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            yield
        finally:
            process.kill()


@contextlib.contextmanager
def subscriber(port):
    """All that the broker hands on, as (topic, text), from a client that has subscribed."""
    paho = pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
    heard, there = queue.Queue(), threading.Event()
    client = paho.Client(paho.CallbackAPIVersion.VERSION2)
    client.on_message = lambda _client, _data, message: heard.put((message.topic, message.payload.decode()))
    client.on_connect = lambda client, *_: client.subscribe("cell/#", qos=1)
    client.on_subscribe = lambda *_: there.set()
    client.connect("127.0.0.1", port)
    client.loop_start()
    try:
        assert there.wait(PATIENCE)
        yield heard
    finally:
        client.disconnect()
        client.loop_stop()


@pytest.fixture
def port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def of_topic(heard, topic, count):
    """So many messages of a topic, in their order."""
    end, found = time.monotonic() + PATIENCE, []
    while len(found) < count:
        name, text = heard.get(timeout=max(0.01, end - time.monotonic()))
        if name == topic:
            found.append(text)
    return found


@pytest.mark.skipif(
    not Path(BROKER).exists(),
    reason=f"no broker: {BROKER} does not exist; make .venv-broker/.stamp, or ARMLOAD_BROKER_PYTHON",
)
@pytest.mark.full
def test_alarms_arrive_in_order_though_the_broker_comes_later(port):
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
    mqtt = Mqtt(f"mqtt://127.0.0.1:{port}/cell")
    try:
        for number in range(3):
            mqtt.post({"arm": "left", "alarm": "over_rating", "number": number})
        with broker(port), subscriber(port) as heard:
            early = of_topic(heard, "cell/online", 1)
            mqtt.post({"arm": "left", "alarm": "over_rating", "number": 3})
            said = [json.loads(text)["number"] for text in of_topic(heard, "cell/left/alarm", 1)]
            while said[-1] != 3:  # what was sent before anybody had subscribed is not kept by the broker
                said += [json.loads(text)["number"] for text in of_topic(heard, "cell/left/alarm", 1)]
            mqtt.close()
            assert of_topic(heard, "cell/online", 1) == ["false"]
        assert early == ["true"]
        assert said == list(range(said[0], 4))
        assert mqtt.dropped == 0
    finally:
        mqtt.close()


def test_a_broker_that_refuses_or_is_not_there_is_said_once(caplog):
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        mqtt = Mqtt(f"mqtt://me:secret@127.0.0.1:{port}/cell")
        try:
            for _ in range(2):  # it is tried again
                connection, _ = server.accept()
                with connection:
                    connection.recv(1024)
                    connection.sendall(bytes([0x20, 2, 0, 5]))  # CONNACK of MQTT 3.1.1: not authorized
                    connection.recv(1024)
        finally:
            mqtt.close()
    assert len(caplog.messages) == 1
    assert re.match("the MQTT broker refuses the connection: Not authori[sz]ed", caplog.messages[0])
    caplog.clear()
    mqtt, end = Mqtt(f"mqtt://127.0.0.1:{port}/cell"), time.monotonic() + PATIENCE
    while not caplog.messages and time.monotonic() < end:
        time.sleep(0.02)
    mqtt.close()
    assert caplog.messages == ["the MQTT broker cannot be reached: Connection refused; it is tried again"]


def test_a_password_is_in_no_message():
    with pytest.raises(UsageError, match=r"'mqtt://…@host/a/#'") as said:
        checked("mqtt://me:secret@host/a/#")
    assert "secret" not in str(said.value)


@pytest.mark.parametrize("within", "#/?@ ")
def test_a_password_with_any_character_in_it_is_not_shown(within):
    with pytest.raises(UsageError) as said:
        checked(f"mqtt://me:sec{within}ret@host:/a b")
    assert "ret" not in str(said.value)
    assert "host" in str(said.value)


@pytest.mark.parametrize(
    "url",
    ["http://host/x", "mqtt://", "mqtt://host:port", "mqtt://host/a/#", "mqtt://cell..host/x", f"mqtt://{'x' * 64}/x"],
)
def test_an_address_that_is_none_is_refused(url):
    with pytest.raises(UsageError, match="expected an address such as mqtt://HOST:1883/PREFIX"):
        checked(url)


def test_what_waits_for_a_broker_that_is_not_there_is_bounded_and_what_is_dropped_is_said(port, caplog):
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
    mqtt = Mqtt(f"mqtt://127.0.0.1:{port}/cell")
    try:
        for number in range(1100):
            mqtt.post({"arm": "left", "number": number})
        assert mqtt.dropped >= 100
        said = "the MQTT broker does not get all alarms: 1000 wait, new ones are dropped"
        assert caplog.messages.count(said) == 1
    finally:
        mqtt.close()


def test_a_broker_that_comes_back_to_a_thousand_alarms_is_told_that_the_service_is_there(port):
    """Else it keeps the "false" of the last will as long as the connection lasts: for months."""
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
    mqtt, heard = Mqtt(f"mqtt://127.0.0.1:{port}/cell"), b""
    try:
        for number in range(1100):
            mqtt.post({"arm": "left", "number": number})
        with socket.create_server(("127.0.0.1", port)) as server:
            connection, _ = server.accept()
            with connection:
                connection.settimeout(10.0)
                connection.recv(1024)
                connection.sendall(bytes([0x20, 2, 0, 0]))  # CONNACK of MQTT 3.1.1: accepted
                while b"cell/onlinetrue" not in heard:
                    heard += connection.recv(1 << 16)
    finally:
        mqtt.close()


def test_a_broker_that_refuses_at_first_is_told_once_that_the_service_is_there():
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(10.0)
        mqtt = Mqtt(f"mqtt://127.0.0.1:{server.getsockname()[1]}/cell")
        try:
            for refused in (5, 0):  # not authorized, accepted
                connection, _ = server.accept()
                connection.settimeout(10.0)
                with connection:
                    connection.recv(4096)
                    connection.sendall(bytes([0x20, 2, 0, refused]))
                    heard = b""
                    while not refused and b"true" not in heard:
                        heard += connection.recv(4096)
                    if not refused:
                        mqtt.close()
                        while more := connection.recv(4096):
                            heard += more
        finally:
            mqtt.close()
    assert len(re.findall(rb"cell/online(?:..)?true", heard, re.DOTALL)) == 1

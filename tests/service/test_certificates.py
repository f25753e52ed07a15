"""A receiver of alarms whose certificate nobody vouches for is not told anything, and the log says why."""

import contextlib
import shutil
import socket
import ssl
import subprocess
import threading
import time

import pytest

from armload.service import Webhook
from armload.service.mqtt import Mqtt

PATIENCE = 30.0  # [s]


@pytest.fixture(scope="module")
def signed_by_itself(tmp_path_factory):
    """A certificate for localhost and its key."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl, which makes certificates, is not there")
    folder = tmp_path_factory.mktemp("tls")
    name, *files = "localhost", folder / "certificate.pem", folder / "key.pem"
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-out", files[0], "-keyout", files[1]]
    subprocess.run(
        [*made, "-subj", f"/CN={name}", "-addext", f"subjectAltName=DNS:{name}"], check=True, capture_output=True
    )
    return files


@pytest.fixture
def server(signed_by_itself):
    """The port of a server that shakes hands, and what was heard of each who came: an error, or bytes."""
    context, heard = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER), []
    context.load_cert_chain(*signed_by_itself)

    def answer(listener):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listener.accept()
                try:
                    with context.wrap_socket(connection, server_side=True) as safe:
                        heard.append(safe.recv(1024))
                except OSError as error:
                    heard.append(error)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=answer, args=(listener,), daemon=True).start()
        yield listener.getsockname()[1], heard
        listener.shutdown(socket.SHUT_RDWR)


# paho leaves the socket of a failed handshake to the garbage
@pytest.mark.filterwarnings("ignore:.*SSLSocket:pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("scheme", ["https", "mqtts"])
def test_a_certificate_that_is_refused_is_named_with_what_would_help(server, scheme, caplog):
    port, heard = server
    if scheme == "mqtts":
        pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
        receiver = Mqtt(f"mqtts://localhost:{port}/cell")
    else:
        receiver = Webhook(f"https://localhost:{port}/alarms")
        receiver.post({"arm": "left"})
    end = time.monotonic() + PATIENCE
    while not caplog.messages and time.monotonic() < end:
        time.sleep(0.02)
    receiver.close()
    assert not any(isinstance(each, bytes) for each in heard)
    assert len(caplog.messages) == 1
    assert "its certificate is refused (self-signed certificate)" in caplog.messages[0].replace(
        "self signed", "self-signed"
    )
    assert "SSL_CERT_FILE" in caplog.messages[0]


def test_an_issuer_that_ssl_cert_file_names_is_trusted(server, signed_by_itself, monkeypatch):
    port, heard = server
    monkeypatch.setenv("SSL_CERT_FILE", str(signed_by_itself[0]))
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
    receiver, end = Mqtt(f"mqtts://localhost:{port}/cell"), time.monotonic() + PATIENCE
    while not heard and time.monotonic() < end:
        time.sleep(0.02)
    receiver.close()
    assert b"MQTT" in heard[0]

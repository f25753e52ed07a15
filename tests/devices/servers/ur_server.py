"""A UR e-series arm that is not there: enough of the public RTDE protocol (TCP 30004) for ur-rtde's receive interface.

Big-endian: u16 size (header included), u8 type. Doubles, six-vectors and integers of the fields that a client asks for;
what the log does not have is zero. It prints one JSON line per event: ready, connected, fields, done.
"""

import argparse
import contextlib
import json
import socket
import struct
import sys
import time

import numpy as np

PORT, RATE = 30004, 500.0
VERSION, CONTROLLER, OUTPUTS, INPUTS, START, PAUSE, DATA = 86, 118, 79, 73, 83, 80, 85
INTEGERS = {"robot_status_bits": "UINT32", "safety_status_bits": "UINT32", "runtime_state": "UINT32"}
INTEGERS |= {"robot_mode": "INT32", "safety_mode": "INT32", "safety_status": "INT32"}
INTEGERS |= {name: "UINT64" for name in ("actual_digital_input_bits", "actual_digital_output_bits")}
FORMS = {"DOUBLE": "d", "VECTOR3D": "3d", "VECTOR6D": "6d", "UINT32": "I", "INT32": "i", "UINT64": "Q"}


def say(event, **facts):
    print(json.dumps({"event": event, **facts}), flush=True)


def kind(name):
    if name in INTEGERS:
        return INTEGERS[name]
    if name == "payload_cog":
        return "VECTOR3D"
    if name == "target_speed_fraction":
        return "DOUBLE"
    six = ("actual_q", "actual_current", "target_", "payload_inertia")
    return "VECTOR6D" if name.startswith(six) else "DOUBLE"


def receive(connection, size):
    data = b""
    while len(data) < size:
        more = connection.recv(size - len(data))
        if not more:
            raise ConnectionError
        data += more
    return data


def command(connection):
    size, which = struct.unpack(">HB", receive(connection, 3))
    return which, receive(connection, size - 3)


def answer(connection, which, body):
    connection.sendall(struct.pack(">HB", 3 + len(body), which) + body)


def values(names, log, row):
    numbers = []
    for name in names:
        size = struct.calcsize(FORMS[kind(name)][-1:]) and int(FORMS[kind(name)][:-1] or 1)
        value = log[name][row] if name in log else np.zeros(size)
        cast = float if kind(name) in ("DOUBLE", "VECTOR6D") else int
        numbers += [cast(x) for x in np.atleast_1d(value)]
    return numbers


def serve(connection, log):
    """One client, until it goes or the log ends."""
    names = []
    while True:
        which, body = command(connection)
        if which == VERSION:
            answer(connection, which, b"\1")
        elif which == CONTROLLER:
            answer(connection, which, struct.pack(">4I", 5, 21, 0, 0))
        elif which == OUTPUTS:
            rate = struct.unpack(">d", body[:8])[0]
            names = [name for name in body[8:].decode().split(",") if name]
            say("fields", names=names, rate=rate)
            answer(connection, which, b"\1" + ",".join(map(kind, names)).encode())
        elif which == PAUSE:
            answer(connection, which, b"\1")
        elif which == START:
            answer(connection, which, b"\1")
            break
    form = ">B" + "".join(FORMS[kind(name)] for name in names)
    start = time.monotonic()
    for row in range(len(log["timestamp"])):
        time.sleep(max(0.0, start + row / RATE - time.monotonic()))
        start = max(start, time.monotonic() - row / RATE)  # what is late stays late: a robot sends no bursts
        answer(connection, DATA, struct.pack(form, 1, *values(names, log, row)))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "log", help="npz with timestamp (N,), actual_q, actual_qd, actual_current (N, 6): 500 per second"
    )
    parser.add_argument("--address", default="127.0.0.1")
    options = parser.parse_args()
    with np.load(options.log) as file:
        log = {name: file[name] for name in file.files}
    with socket.create_server((options.address, PORT)) as server:
        say("ready")
        while True:
            connection, _ = server.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            say("connected")
            with connection, contextlib.suppress(ConnectionError):
                serve(connection, log)
            say("done")


if __name__ == "__main__":
    sys.exit(main())

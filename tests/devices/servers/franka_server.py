"""A robot that is not there: speaks enough of the public Franka Control Interface for the makers' own clients.

Packed little-endian structs, as in libfranka-common's research_interface headers (Apache-2.0). Version 5 is the Panda's
(float64 states), version 10 the FR3's (float32 states, and a URDF on request). TCP port 1337 is fixed by the clients;
servers side by side take different loopback addresses. Run as a program: it must not share an interpreter with the
client. It prints one JSON line per event: ready, connected, load, done.
"""

import argparse
import contextlib
import json
import os
import select
import socket
import struct
import sys
import time
from pathlib import Path

import numpy as np

PORT = 1337
IDENTITY = np.eye(4).ravel(order="F")
# name, count: the state's numbers in their order on the wire
FIELDS = [
    *[(name, 16) for name in ("O_T_EE", "O_T_EE_d", "F_T_EE", "EE_T_K", "F_T_NE", "NE_T_EE")],
    *[("m_ee", 1), ("I_ee", 9), ("F_x_Cee", 3), ("m_load", 1), ("I_load", 9), ("F_x_Cload", 3)],
    *[("elbow", 2), ("elbow_d", 2), ("tau_J", 7), ("tau_J_d", 7), ("dtau_J", 7), ("q", 7), ("q_d", 7), ("dq", 7)],
    *[("dq_d", 7), ("ddq_d", 7), ("joint_contact", 7), ("cartesian_contact", 6), ("joint_collision", 7)],
    *[("cartesian_collision", 6), ("tau_ext_hat_filtered", 7), ("O_F_ext_hat_K", 6), ("K_F_ext_hat_K", 6)],
    *[("O_dP_EE_d", 6), ("O_ddP_O", 3), ("elbow_c", 2), ("delbow_c", 2), ("ddelbow_c", 2), ("O_T_EE_c", 16)],
    *[("O_dP_EE_c", 6), ("O_ddP_EE_c", 6), ("theta", 7), ("dtheta", 7)],
]
ACCELEROMETERS = [("accelerometer_top", 18), ("accelerometer_bottom", 18)]  # version 10
CONNECT, GET_MODEL = 0, 11
LATE = 20  # [ms] of packets that are lost, where the robot's time is the real one
SET_LOAD = {5: 10, 10: 9}
# idle, other controller, no errors of 41 + 41, robot mode idle; the share of commands that arrived comes last
END = struct.pack("<2B82?B", 0, 3, *[False] * 82, 1)


class State:
    """The floats of one state message, and where each field is."""

    def __init__(self, version):
        fields = FIELDS + (ACCELEROMETERS if version == 10 else [])
        ends = np.cumsum([count for _, count in fields])
        self.one = struct.pack("<f" if version == 10 else "<d", 1.0)
        self.at = {name: slice(end - count, end) for (name, count), end in zip(fields, ends, strict=True)}
        self.numbers = np.zeros(ends[-1], dtype="<f4" if version == 10 else "<f8")
        for name, _ in FIELDS:
            if "_T_" in name:
                self.numbers[self.at[name]] = IDENTITY
        self.numbers[self.at["O_ddP_O"]] = (0.0, 0.0, -9.81)

    def message(self, number, q, dq, tau):
        """The packet of one instant, with whatever load was set."""
        for name, value in (
            ("q", q),
            ("q_d", q),
            ("theta", q),
            ("dq", dq),
            ("dq_d", dq),
            ("dtheta", dq),
            ("tau_J", tau),
        ):
            self.numbers[self.at[name]] = value
        return struct.pack("<Q", number) + self.numbers.tobytes() + END + self.one


def say(event, **facts):
    print(json.dumps({"event": event, **facts}), flush=True)


def receive(connection, size):
    data = b""
    while len(data) < size:
        more = connection.recv(size - len(data))
        if not more:
            raise ConnectionError
        data += more
    return data


def serve(connection, client, options, log, urdf):
    """One client, until it goes or the log ends."""
    state = State(options.version)
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind((options.address, 0))
    port, tick, row, start = None, 0, 0, None  # milliseconds so far; of them in motion
    moves, heard = not options.stand, [connection, *([sys.stdin] if options.stand else [])]
    lost = set(options.lose)
    while True:
        due = None if start is None else max(0.0, start + tick * 1e-3 - time.monotonic())
        readable, _, _ = select.select(heard, [], [], due)
        if sys.stdin in readable:
            order = os.read(sys.stdin.fileno(), 100).split()
            if not order:
                heard.remove(sys.stdin)
            else:
                moves = order[-1] == b"go"
                say("moves" if moves else "stands", tick=tick)
        if connection in readable:
            command, number, size = struct.unpack("<3I", receive(connection, 12))
            body = receive(connection, size - 12)
            answer = b"\0"
            if command == CONNECT:
                version, port = struct.unpack("<2H", body)
                say("connected", version=version)
                answer = struct.pack("<BH", 0 if version == options.version else 1, options.version)
                start = time.monotonic() + 0.01
            elif command == SET_LOAD[options.version]:
                load = struct.unpack("<13d", body)
                say("load", numbers=load)
                state.numbers[state.at["m_load"]] = load[0]
                state.numbers[state.at["F_x_Cload"]] = load[1:4]
                state.numbers[state.at["I_load"]] = load[4:]
            elif command == GET_MODEL and options.version == 10:
                answer += urdf.encode()
            connection.sendall(struct.pack("<3I", command, number, 12 + len(answer)) + answer)
        if start is not None and time.monotonic() >= start + tick * 1e-3:
            if options.real_time and (late := int(1e3 * (time.monotonic() - start)) - tick) > LATE:
                tick, row = tick + late, row + late * moves
            if row >= len(log["t"]):
                return
            if not (moves and row in lost):
                # the message's number is its time in milliseconds
                number = round(1000 * float(log["t"][0])) + tick
                if not options.real_time:  # what is late stays late: a robot sends no bursts
                    start = max(start, time.monotonic() - tick * 1e-3)
                q, dq, tau = (log[name][row] for name in ("q", "dq", "tau"))
                udp.sendto(state.message(number, q, dq if moves else 0.0 * dq, tau), (client[0], port))
            tick += 1
            row += moves


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("log", help="npz with t (N,), q, dq, tau (N, 7): one row per millisecond")
    parser.add_argument("--address", default="127.0.0.1")
    parser.add_argument("--version", type=int, choices=(5, 10), default=5)
    parser.add_argument("--urdf", help="file with the robot's description, for version 10")
    parser.add_argument(
        "--stand", action="store_true", help="stand still until a line on standard input says go, and again at stop"
    )
    parser.add_argument(
        "--real-time", action="store_true", help="lose the packets that this machine is too busy to send"
    )
    parser.add_argument("--lose", type=int, nargs="*", default=[], help="rows that never arrive")
    options = parser.parse_args()
    with np.load(options.log) as file:
        log = {name: file[name] for name in ("t", "q", "dq", "tau")}
    urdf = Path(options.urdf).read_text(encoding="utf-8") if options.urdf else ""
    with socket.create_server((options.address, PORT)) as server:
        say("ready")
        while True:
            connection, client = server.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with connection, contextlib.suppress(ConnectionError):
                serve(connection, client, options, log, urdf)
            say("done")


if __name__ == "__main__":
    sys.exit(main())

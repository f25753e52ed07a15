"""A Franka robot that is not there and moves: the Franka Control Interface, as far as joint positions need it.

Beside what `franka_server` has: Move (TCP command 1) is answered with "motion started", from then on a packet with the
joint positions is expected for every state, and Move is answered once more, with success, when one says that the motion
has finished. Commands that stay away end the motion, and the arm brakes by itself.

It prints one JSON line per event: ready, moving, rest (with q), lost, payload, mounted. A line on standard input says
mount, or names a fault, which is printed, too: refuse (no load is taken), forget (a load is taken and not counted), die
(the robot loses its power at a load).
"""

import argparse
import contextlib
import os
import re
import select
import socket
import struct
import sys
import time

import numpy as np
from franka_server import CONNECT, END, GET_MODEL, PORT, SET_LOAD, State, receive, say
from simulated_arm import SimulatedArm

CYCLE = 1e-3
VERSIONS = {"panda": 5, "fr3": 10}
FILTER = 0.01  # [s] by which it smooths commands: on a busy machine some are left out
MOVE, STOP_MOVE = 1, 2
STARTED, SUCCESS, ABORTED = 1, 0, 2
REFUSED = 2  # of a setter: not possible in the present mode
PATIENCE = 300  # cycles without a command: a robot bears 20, the machines of tests are busier
# number; q, dq, pose, twist, elbow; elbow valid, finished; torques, and of version 10 whether they are finished
COMMANDS = {5: struct.Struct("<Q38d2?7d"), 10: struct.Struct("<Q38d2?7d?")}
FINISHED = 40
MOVING = struct.pack("<2B82?B", 1, 0, *[False] * 82, 2)  # joint positions, joint impedance, no errors, robot mode move


def urdf_of(robot):
    """The arm's description as an FR3 would send it: plain joint names, and limits that shrink towards the ends."""
    text = robot.urdf.replace(f"{robot.name}_", "")
    limits = r'\1<position_based_velocity_limits velocity_offset="0.2" deceleration_limit="5.0" />'
    return re.sub(r"(<limit [^>]*/>)", limits, text)


def serve(connection, client, address, body, version):
    urdf = urdf_of(body.robot)
    state, udp = State(version), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind((address, 0))
    udp.setblocking(False)
    port, start, tick, move, silent, moved, told = None, None, 0, None, 0, False, False
    fault = ""

    def reply(command, number, answer):
        connection.sendall(struct.pack("<3I", command, number, 12 + len(answer)) + answer)

    try:
        while True:
            due = None if start is None else max(0.0, start + tick * CYCLE - time.monotonic())
            readable, _, _ = select.select([connection, sys.stdin], [], [], due)
            word = sys.stdin.readline().strip() if sys.stdin in readable else ""
            if word == "mount":
                body.mount()
                say("mounted")
            elif word:
                fault = word
                say(word)
            if connection in readable:
                command, number, size = struct.unpack("<3I", receive(connection, 12))
                asked = receive(connection, size - 12)
                if command == CONNECT:
                    theirs, port = struct.unpack("<2H", asked)
                    reply(command, number, struct.pack("<BH", 0 if theirs == version else 1, version))
                    start = time.monotonic() + 0.01
                elif command == MOVE:
                    move, silent, told = number, 0, False
                    reply(command, number, bytes([STARTED]))
                elif command == STOP_MOVE:
                    if move is not None:
                        reply(MOVE, move, bytes([ABORTED]))
                    move = None
                    body.halt()
                    reply(command, number, b"\0")
                elif command == SET_LOAD[version]:
                    load = struct.unpack("<13d", asked)
                    say("payload", numbers=load)
                    if fault == "die":
                        os._exit(0)
                    if not fault:
                        state.numbers[state.at["m_load"]] = load[0]
                        state.numbers[state.at["F_x_Cload"]] = load[1:4]
                        state.numbers[state.at["I_load"]] = load[4:]
                    reply(command, number, bytes([REFUSED if fault == "refuse" else SUCCESS]))
                elif command == GET_MODEL and version == 10:
                    reply(command, number, b"\0" + urdf.encode())
                else:
                    reply(command, number, b"\0")
            if start is None or time.monotonic() < start + tick * CYCLE:
                continue
            start = max(start, time.monotonic() - tick * CYCLE)  # what is late stays late: a robot sends no bursts
            newest = None
            with contextlib.suppress(BlockingIOError):
                while True:
                    newest = COMMANDS[version].unpack(udp.recv(1 << 12))
            told = told or newest is not None  # one that has not begun to command is starting, not silent
            silent = silent + 1 if newest is None and told else 0
            if move is not None and newest is not None:
                body.command(body.target + (np.array(newest[1:8]) - body.target) * CYCLE / FILTER)
                if newest[FINISHED]:
                    reply(MOVE, move, bytes([SUCCESS]))
                    move = None
            elif move is not None and silent > PATIENCE and moved:
                say("lost")
                reply(MOVE, move, bytes([ABORTED]))
                move = None
                body.halt()
            elif move is not None:
                body.coast()
            else:
                body.stay()
            q, dq, tau = body.step()
            if not body.rests if not moved else body.rests and move is None:
                moved = not moved
                say("moving" if moved else "rest", q=body.target.tolist())
            message = state.message(1000 + tick, q, dq, tau)
            place = state.at["q_d"]
            numbers = np.frombuffer(message, state.numbers.dtype, len(state.numbers), 8).copy()
            numbers[place] = body.target
            end = MOVING if move is not None else END
            udp.sendto(message[:8] + numbers.tobytes() + end + state.one, (client[0], port))
            tick += 1
    finally:
        udp.close()
        body.halt()
        while not body.rests:
            body.step()
        if moved:
            say("rest", q=body.target.tolist())


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("at", help="where it stands, q1,…,q7 [rad]")
    parser.add_argument("--robot", default="fr3")
    parser.add_argument("--address", default="127.0.0.1")
    options = parser.parse_args()
    body = SimulatedArm(options.robot, [float(x) for x in options.at.split(",")], CYCLE)
    with socket.create_server((options.address, PORT)) as server:
        say("ready")
        while True:
            connection, client = server.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with connection, contextlib.suppress(OSError):
                serve(connection, client, options.address, body, VERSIONS[options.robot])


if __name__ == "__main__":
    sys.exit(main())

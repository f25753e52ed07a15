"""A UR e-series arm that is not there and moves: what ur-rtde's control and receive interfaces want to find.

RTDE (TCP 30004, both ways), the dashboard (29999) and the script port (30003). The control script that the client sends
is not interpreted but answered as it would: commands come in integer register 0 (11 servoj, 16 stop of servoj, 34
stopj, 35 watchdog, 65 set_target_payload, 255 end of the script, 0 none), and output register 0 says 1 for ready and 2
for done. A client that is gone, or silent for longer than the watchdog allows, ends the script, and the arm brakes by
itself.

It prints one JSON line per event: ready, script, moving, stopped, ended, mounted, payload, lost, rest. A line on
standard input says mount, or `work FILE`: from then on a program of its own follows the motion in that file and rests
for a while, in turns. A client's script takes that program's place; after it, the program begins anew. Or it names a
fault, which is printed, too: local (no remote control), refuse (its script ends at a payload), forget (a payload is
taken and not counted), die (the arm loses its power at a payload), slider (at 50 %), protective (stop).
"""

import argparse
import contextlib
import json
import os
import socket
import struct
import sys
import threading
import time

import numpy as np
from simulated_arm import SimulatedArm
from ur_server import CONTROLLER, DATA, FORMS, INPUTS, OUTPUTS, PAUSE, START, VERSION, answer, command
from ur_server import kind as kind_of_output

from armload.arms import ARMS
from armload.motion import load_motion

CYCLE = 2e-3
BREAK = 20.0  # [s] its own program rests after each motion
FILTER = 0.08  # [s] servoj follows its targets so much later: it looks 0.1 s ahead
ANSWERS = {
    "PolyscopeVersion": "URSoftware 5.12.0.1101534 (Nov 01 2023)",
    "get serial number": "20225500001",
    "is in remote control": "true",
}
SERVOJ, SERVO_STOP, STOPJ, WATCHDOG, SET_TARGET_PAYLOAD, END, NONE = 11, 16, 34, 35, 65, 255, 0
KINDS = {"int": "INT32", "double": "DOUBLE"}


def say(event, **facts):
    os.write(1, (json.dumps({"event": event, **facts}) + "\n").encode())


def kind(name):
    return KINDS[name.split("_")[1]] if "_register_" in name else kind_of_output(name)


class Robot:
    """The arm, the script and the registers."""

    def __init__(self, name, at):
        self.lock = threading.Lock()
        self.body = SimulatedArm(name, at, CYCLE)
        self.constants = np.array(ARMS[name].torque_constants)
        self.running, self.ready = False, 1
        self.target, self.heard, self.patience = None, time.monotonic(), np.inf
        self.state = {}
        self.payload = [0.0] * 10
        self.tick = 0
        self.work, self.worked = None, 0.0
        self.fault = ""

    def run(self):
        begun = time.monotonic()
        while True:
            with self.lock:
                self.step()
            self.tick += 1
            time.sleep(max(0.0, begun + self.tick * CYCLE - time.monotonic()))

    def step(self):
        if self.running and time.monotonic() - self.heard > self.patience:
            self.end("lost")
        body = self.body
        if self.target is not None:
            body.command(body.target + (self.target - body.target) * CYCLE / FILTER)
        elif self.work is not None and not self.running:
            self.worked = (self.worked + CYCLE) % (self.work.duration + BREAK)
            body.command(self.work.position([min(self.worked, self.work.duration)])[0])
        else:
            body.stay()
        before = body.rests
        q, dq, tau = body.step()
        if body.rests and not before:
            say("rest", q=body.target.tolist())
        self.state = {
            "timestamp": 100.0 + self.tick * CYCLE,
            "actual_q": q,
            "actual_qd": dq,
            "target_q": body.target,
            "actual_current": tau / self.constants,
            "robot_mode": 7,
            "safety_mode": 3 if self.fault == "protective" else 1,
            "target_speed_fraction": 0.5 if self.fault == "slider" else 1.0,
            "robot_status_bits": 3 if self.running else 1,
            "runtime_state": 2 if self.running else 1,
            "output_int_register_0": self.ready,
            "payload": self.payload[0],
            "payload_cog": self.payload[1:4],
            "payload_inertia": self.payload[4:],
        }

    def end(self, event):
        """The script ends; an arm on its way brakes."""
        if self.running:
            say(event)
        self.running, self.target, self.ready, self.patience = False, None, 1, np.inf
        self.body.halt()

    def obey(self, values):
        number, numbers = values["input_int_register_0"], list(values.values())[1:]
        self.heard = time.monotonic()
        self.ready = 1 if number in (NONE, SERVOJ) else 2
        if number == SERVOJ and self.running:
            if self.target is None:
                say("moving")
            self.target = np.array(numbers[:6])
        elif number in (SERVO_STOP, STOPJ):
            self.target = None
            self.body.halt()
            say("stopped")
        elif number == WATCHDOG:
            self.patience = 1.0 / numbers[0]
        elif number == SET_TARGET_PAYLOAD:
            say("payload", numbers=numbers)
            if self.fault == "refuse":
                self.end("ended")
            elif self.fault == "die":
                os._exit(0)
            elif self.fault != "forget":
                self.payload = numbers[:10]
        elif number == END:
            self.end("ended")


def rtde(connection, robot):
    names, inputs, started, controls = [], [], threading.Event(), False

    def stream():
        started.wait()
        form, last = ">B" + "".join(FORMS[kind(name)] for name in names), -1
        try:
            while True:
                with robot.lock:
                    tick, state = robot.tick, dict(robot.state)
                if tick == last or not state:
                    time.sleep(2e-4)
                    continue
                last, numbers = tick, []
                for name in names:
                    value = state.get(name, np.zeros(int(FORMS[kind(name)][:-1] or 1)))
                    numbers += [float(x) if "d" in FORMS[kind(name)] else int(x) for x in np.atleast_1d(value)]
                answer(connection, DATA, struct.pack(form, 1, *numbers))
        except OSError:
            pass

    threading.Thread(target=stream, daemon=True).start()
    try:
        while True:
            which, body = command(connection)
            if which == CONTROLLER:
                answer(connection, which, struct.pack(">4I", 5, 12, 0, 0))
            elif which == OUTPUTS:
                names = [name for name in body[8:].decode().split(",") if name]
                answer(connection, which, b"\1" + ",".join(map(kind, names)).encode())
            elif which == INPUTS:
                inputs.append([name for name in body.decode().split(",") if "_register_" in name])
                controls = True
                answer(connection, which, bytes([len(inputs)]) + ",".join(map(kind, inputs[-1])).encode())
            elif which in (VERSION, START, PAUSE):
                answer(connection, which, b"\1")
                if which == START:
                    started.set()
            elif which == DATA:
                names_in = inputs[body[0] - 1]
                values = struct.unpack(">" + "".join(FORMS[kind(name)] for name in names_in), body[1:])
                with robot.lock:
                    robot.obey(dict(zip(names_in, values, strict=True)))
    except OSError:
        if controls:
            with robot.lock:
                robot.end("lost")


def dashboard(connection, robot):
    connection.sendall(b"Connected: Universal Robots Dashboard Server\n")
    for line in connection.makefile():
        word = line.strip()
        said = f"Program running: {str(robot.running).lower()}" if word == "running" else ANSWERS.get(word, "ok")
        said = "false" if word == "is in remote control" and robot.fault == "local" else said
        connection.sendall((said + "\n").encode())


def script(connection, robot):
    received = b""
    while more := connection.recv(1 << 16):
        received += more
        if received.endswith(b"end\n"):
            with robot.lock:
                robot.running, robot.ready, robot.heard, robot.worked = True, 1, time.monotonic(), 0.0
                speed = float(np.abs(robot.body.speed).max())
                robot.body.halt()
            say("script", size=len(received), speed=speed)


def serve(address, port, how, robot):
    server = socket.create_server((address, port))

    def accept():
        while True:
            connection, _ = server.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=quietly, args=(connection,), daemon=True).start()

    def quietly(connection):
        with connection, contextlib.suppress(OSError):
            how(connection, robot)

    threading.Thread(target=accept, daemon=True).start()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("at", help="where it stands, q1,…,q6 [rad]")
    parser.add_argument("--robot", default="ur10e")
    parser.add_argument("--address", default="127.0.0.1")
    options = parser.parse_args()
    robot = Robot(options.robot, [float(x) for x in options.at.split(",")])
    threading.Thread(target=robot.run, daemon=True).start()
    for port, how in ((30004, rtde), (29999, dashboard), (30003, script)):
        serve(options.address, port, how, robot)
    say("ready")
    for line in sys.stdin:
        word, _, file = line.strip().partition(" ")
        with robot.lock:
            if word == "mount":
                robot.body.mount()
                say("mounted")
            elif word == "work":
                robot.work = load_motion(file)
            else:
                robot.fault = word
                say(word)


if __name__ == "__main__":
    sys.exit(main())

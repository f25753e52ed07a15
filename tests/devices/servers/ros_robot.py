"""armload's simulated robot on ROS 2, whose payload, faults and orders come as lines on standard input.

mount        it gets its payload
silent       no joint states any more
jump S       its clock, that of the controller and of the joint states, goes on by S seconds at once
deaf         the controller takes no trajectory any more
nan, short   joint states with positions and velocities that are no numbers, or without the last joint
well         none of these any more

It prints one JSON line per event: ready, moving, rest (with q, where it is commanded to be), mounted, and each fault.
"""

import argparse
import json
import sys
import threading

import numpy as np

from armload.arms import arm
from armload.devices import Ros2Connection
from armload.devices.ros2 import RobotNode
from armload.payloads import test_payload


def say(event, **facts):
    print(json.dumps({"event": event, **facts}), flush=True)


class Observed(RobotNode):
    """Says when its orders set it in motion, and when they end."""

    moving, fault, jumped = False, "well", 0

    def obey(self, line):
        """What a line on standard input asks for."""
        word, _, seconds = line.strip().partition(" ")
        if word == "mount":
            self.hold(test_payload().parameters)
            say("mounted")
        elif word == "jump":
            nanoseconds = round(1e9 * float(seconds))
            self.jumped, self._began = self.jumped + nanoseconds, self._began + nanoseconds
            say(word)
        else:
            self.fault = word
            say(word)

    def _take(self, message, received):
        if self.fault != "deaf":
            super()._take(message, received)

    def _message(self, sample, stamp):
        now = bool(np.abs(self._commanded.velocity([sample.t])).max() > 1e-9)
        if now != self.moving:
            say("moving" if now else "rest", q=self._commanded.position([sample.t])[0].tolist())
        self.moving = now
        message = super()._message(sample, stamp + self.jumped)
        if self.fault == "nan":
            message.position = message.velocity = [float("nan")] * len(message.name)
        elif self.fault == "short":
            for values in (message.name, message.position, message.velocity, message.effort):
                values.pop()
        return message


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("at", help="where it stands, q1,…,qn [rad]")
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--address", help="of no use here")
    options = parser.parse_args()
    robot, connection = arm(options.robot), Ros2Connection("robot")
    at = np.array([float(x) for x in options.at.split(",")])
    node = Observed(robot, connection, at, rate=200.0, say=lambda text: print(text, file=sys.stderr, flush=True))

    publish = node._publish
    node._publish = lambda message: None if node.fault == "silent" else publish(message)

    def listen():
        for line in sys.stdin:
            node.obey(line)

    threading.Thread(target=listen, daemon=True).start()
    say("ready")
    node.run()


if __name__ == "__main__":
    sys.exit(main())

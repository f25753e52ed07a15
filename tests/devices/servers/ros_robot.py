"""armload's simulated robot on ROS 2, which gets its payload when a line on standard input says mount.

It prints one JSON line per event: ready, moving, rest (with q, where it is commanded to be), mounted.
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

    moving = False

    def _message(self, sample, stamp):
        now = bool(np.abs(self._commanded.velocity([sample.t])).max() > 1e-9)
        if now != self.moving:
            say("moving" if now else "rest", q=self._commanded.position([sample.t])[0].tolist())
        self.moving = now
        return super()._message(sample, stamp)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("at", help="where it stands, q1,…,qn [rad]")
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--address", help="of no use here")
    options = parser.parse_args()
    robot, connection = arm(options.robot), Ros2Connection("robot")
    at = np.array([float(x) for x in options.at.split(",")])
    node = Observed(robot, connection, at, rate=200.0, say=lambda text: print(text, file=sys.stderr, flush=True))

    def listen():
        for line in sys.stdin:
            if line.strip() == "mount":
                node.hold(test_payload().parameters)
                say("mounted")

    threading.Thread(target=listen, daemon=True).start()
    say("ready")
    node.run()


if __name__ == "__main__":
    sys.exit(main())

"""franka-sim's FR3 on an address of its own, which its command line does not offer; it aborts what breaks FCI limits.

Run by a Python that has franka-sim (1.1.7 was tried): python franka_sim_robot.py ADDRESS
"""

import logging
import sys

from franka_sim.franka_sim_server import FrankaSimServer

logging.basicConfig(level=logging.INFO)
FrankaSimServer(host=sys.argv[1], enable_gripper=False, enforce_motion_limits=True).start()

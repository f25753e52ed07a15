"""An arm for servers to move, one control cycle at a time: armload's plant in MuJoCo under its position controller.

What is commanded is where the controller holds the arm; the payload is unknown to it. When nobody commands any more,
the arm's own brake (`halt`) takes every joint to rest at a constant deceleration, as controllers do that lost their
client.
"""

import mujoco
import numpy as np

from armload.arms import arm
from armload.payloads import test_payload
from armload.simulation import Gains, build_model, settled_start

STEP = 5e-4  # [s]
DECELERATION = 5.0  # [rad/s²] of an arm whose client is lost


class SimulatedArm:
    """At rest at q (n,) [rad], holding nothing; `cycle` [s] is a multiple of `STEP`."""

    def __init__(self, name, q, cycle):
        self.robot, self.cycle = arm(name), cycle
        self.gains = Gains.of(self.robot)
        self.target, self.speed = np.array(q, dtype=float), np.zeros(self.robot.n)
        self.halting, self.loaded = False, False
        loaded = self.robot.with_payload(test_payload().parameters)
        self.model = build_model(self.robot, self.gains, STEP)
        self.model_loaded = build_model(
            loaded, self.gains, STEP
        )  # now, as a client gives up one that is silent for 1 s
        self.data = mujoco.MjData(self.model)
        rest = (self.target, self.speed, self.speed)
        self.data.qpos[:] = settled_start(self.model, self.gains, rest, self.robot.torque(self.target))

    def mount(self):
        """From now on it holds the test payload."""
        self.loaded, self.model = True, self.model_loaded

    def command(self, target):
        """Hold this from now on."""
        self.halting = False
        target = np.asarray(target, dtype=float)
        self.speed, self.target = (target - self.target) / self.cycle, target

    def stay(self):
        """No new command: the target stays where it is."""
        if not self.halting:
            self.speed = np.zeros(self.robot.n)

    def coast(self):
        """No new command: the target goes on as it did, as a Franka robot bears with a lost packet."""
        self.target = self.target + self.speed * self.cycle

    def halt(self):
        """Come to rest by itself."""
        self.halting = True

    @property
    def rests(self):
        return not self.speed.any()

    def step(self):
        """One control cycle: q and dq (n,) at its end, and tau (n,), which is its mean, as sensors show them.

        What is commanded is held for the cycle, so that the torque falls within it as the arm goes on.
        """
        if self.halting:
            lost = DECELERATION * self.cycle
            self.speed = np.sign(self.speed) * np.maximum(np.abs(self.speed) - lost, 0.0)
            self.target = self.target + self.speed * self.cycle
        forward = self.robot.torque(self.target)
        control = forward + self.gains.stiffness * self.target + self.gains.damping * self.speed
        self.data.ctrl[:] = control
        springs = dampers = np.zeros(self.robot.n)
        steps = round(self.cycle / STEP)
        for _ in range(steps):
            springs = springs + self.gains.stiffness * self.data.qpos  # act where a step begins
            mujoco.mj_step(self.model, self.data)
            dampers = dampers + self.gains.damping * self.data.qvel  # act where it ends
        return self.data.qpos.copy(), self.data.qvel.copy(), control - (springs + dampers) / steps

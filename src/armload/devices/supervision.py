"""What stops a moving arm by itself: it is not where it should be, or something pushes that is no payload.

Both are looked at for every sample, on the machine that sends the commands:

- tracking: the largest |q_j − f_j(s)| over the joints, the smallest over the path's last `LAG` seconds s, as arms
  follow their command late; more than `tracking` [rad] is outside the path that was checked.
- external torque: |tau − tau_arm(q, q̇, q̈_d)|_j less what a payload up to the rated one can cause at that instant,
  sum_k |Y_jk|·phi_k; more than `external`·(the joint's rated torque) for `HOLD` seconds. tau_arm is the model of the
  arm without a payload, Y the payload's regressor along the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, payload_regressor, rated_effort, rated_mass
from armload.arms.units import unit_of
from armload.errors import SafetyError
from armload.motion import Course, Motion
from armload.recording import Sample

LAG = 0.25  # [s] an arm may be behind: servoj looks 0.1 s ahead, drives and filters add as much; at most so much counts
HOLD = 0.02  # [s] a torque must last: spikes of a current or a lost encoder step are shorter, a contact is longer
SILENCE = 0.1  # [s] without a usable sample after which a moving arm is stopped: it moves a few centimetres meanwhile
# of the rated torque, of sensors in the joints and of motor currents, which have the gear's friction in them: twice and
# 1.4 times what simulated arms like the measured ones show (test_arms_like_the_measured_ones_are_not_stopped)
EXTERNAL, EXTERNAL_OF_MOTORS = 0.15, 0.5
_GRID = 5e-3  # [s] of path between the instants that are tabulated
_REACH = 0.2  # [m] from the payload frame to a rated payload's centre, at most: makers' load charts end there
_SPREAD = 0.1  # [m] radius of gyration of a rated payload, at most


@dataclass(frozen=True)
class Thresholds:
    """Where a movement is stopped.

    Args:
        tracking: [rad] off the path. 0.05 is twice and a half what the softest simulated joint bends under its full
            rated torque, and 5 cm at a metre's reach.
        external: share of a joint's rated torque, beside what a rated payload causes; None: `EXTERNAL` of the arm's
            kind.

    Raises:
        SafetyError: not above zero.
    """

    tracking: float = 0.05
    external: float | None = None

    def __post_init__(self) -> None:
        for name, value in (("tracking error", self.tracking), ("external torque", self.external)):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise SafetyError(f"the threshold of the {name} is {value}: expected a positive number")


class Supervision:
    """One movement, sample by sample.

    Args:
        arm: bare, or with what is known to be mounted.
        motion: the movement.
        thresholds: where it is stopped.

    Attributes:
        off: what to look at where the arm is off the path; "": nothing in particular.
    """

    off = ""

    def __init__(self, arm: Arm, motion: Motion, thresholds: Thresholds) -> None:
        self._arm, self._thresholds = arm, thresholds
        self._t = motion.instants(1.0 / _GRID)
        self._q, dq, ddq = motion(self._t)
        mass = rated_mass(arm)
        most = mass * np.array([1.0, *[_REACH] * 3, *[_REACH**2 + _SPREAD**2] * 6])
        self._allowed = np.abs(payload_regressor(arm.frame_motion(self._q), dq, ddq)) @ most
        self._effort = rated_effort(arm)
        given = EXTERNAL_OF_MOTORS if arm.motor_torque else EXTERNAL
        self._external = self._effort * (given if thresholds.external is None else thresholds.external)
        self._since: float | None = None  # when the torque became too large
        self._good: float | None = None  # when the last usable sample was

    def problem(self, t: float, sample: Sample, course: Course) -> str | None:
        """Why the arm must stop, if it must: at t [s] on the course's clock it was as the sample says."""
        if self._good is None:
            self._good = t
        if not np.all(np.isfinite(np.concatenate(sample[1:]))):
            silent = t - self._good
            return f"no usable sample for {silent:.2f} s" if silent > SILENCE else None
        self._good = t
        last, first = course.progress(np.array([t, t - LAG]))
        rows = slice(*np.searchsorted(self._t, [first - _GRID, last + _GRID]))
        window = self._q[rows] if rows.stop > rows.start else self._q[-1:]
        away = np.abs(window - sample.q)
        k = int(np.argmin(away.max(axis=1)))
        j = int(np.argmax(away[k]))
        if away[k, j] > self._thresholds.tracking:
            see, unit = f"; {self.off}" if self.off else "", unit_of("position", self._arm.limits.slides[j])
            return (
                f"{self._arm.joint_names[j]} is {away[k, j]:.3f} {unit} off the path (more than "
                f"{self._thresholds.tracking:g} {unit}{see})"
            )
        return self._pushed(t, sample, course, float(last))

    def _pushed(self, t: float, sample: Sample, course: Course, s: float) -> str | None:
        beyond = self.beyond(sample, course._at(t, 2)[0], s)
        j = int(np.argmax(beyond / self._external))
        limit = self._external[j]
        if beyond[j] <= limit:
            self._since = None
            return None
        self._since = t if self._since is None else self._since
        if t - self._since < HOLD:
            return None
        unit = unit_of("torque", self._arm.limits.slides[j])
        return (
            f"{self._arm.joint_names[j]} feels {beyond[j]:.1f} {unit} beside what a payload of "
            f"{rated_mass(self._arm):.3g} kg can cause (more than {limit:.1f} {unit})"
        )

    def beyond(self, sample: Sample, ddq: NDArray[np.float64], s: float) -> NDArray[np.float64]:
        """Torque (n,) beside what a rated payload can cause at path time s [s], where the arm is to have ddq [N·m]."""
        row = min(int(np.searchsorted(self._t, s)), len(self._t) - 1)
        return np.abs(sample.tau - self._arm.torque(sample.q, sample.dq, ddq)) - self._allowed[row]

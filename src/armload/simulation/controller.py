"""The controller: joint impedance about the desired motion, with the bare nominal arm fed forward.

    tau = tau_ff(q_d, dq_d, ddq_d) + kp·(q_d − q) + kd·(dq_d − dq)

It knows neither the payload nor how the world's arm differs from the model, so that position, velocity and torque all
carry the payload's trace (Taie et al., RA-L 2024, Section III-B).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, facts_of, poses, rated_effort
from armload.motion import Motion

# Where an arm's sheet gives no stiffness, the full rated torque bends a joint by this much [rad]; a payload takes about
# a third of it. (With libfranka's stiffness and 2 kg at arm's length the Panda sags 4 mrad in joint 2.)
_FULL_LOAD_SAG = 0.02
# Critical damping of the bare links would leave the smallest wrists too loose against friction, as their motors'
# inertia is not modelled: a displaced joint needs at least this long to come back. (franka_ros' joint impedance example
# is slower still: its kd/kp is 0.03 s and more.)
_SHORTEST_RETURN = 0.01  # [s]


@dataclass(frozen=True, eq=False)
class Gains:
    """Joint stiffness kp (n,) [N·m/rad] and damping kd (n,) [N·m·s/rad]."""

    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]

    @classmethod
    def of(cls, arm: Arm) -> Gains:
        """The gains an arm is simulated with: its sheet's stiffness, or one by rated torque.

        Arms without bend by 20 mrad under their rated torque. The damping is our choice, as no maker publishes any:
        critical for the bare arm's mean joint inertia and at least 10 ms·kp, kd = max(2·sqrt(kp·M_ii), 0.01·kp).

        >>> from armload.arms import arm
        >>> Gains.of(arm("panda")).stiffness[0]
        np.float64(3000.0)
        """
        inertia = np.mean([np.diag(arm.mass_matrix(q)) for q in poses(arm)], axis=0)
        facts = facts_of(arm)
        given = None if facts is None else facts.position_stiffness
        stiffness = rated_effort(arm) / _FULL_LOAD_SAG if given is None else np.array(given)
        return cls(stiffness, np.maximum(2.0 * np.sqrt(stiffness * inertia), _SHORTEST_RETURN * stiffness))

    def stiffer(self, factor: float) -> Gains:
        """The stiffness multiplied, the damping ratio kept; softer below 1.

        As in `of`, a displaced joint needs at least 10 ms to come back, which is what keeps the integration stable.
        """
        stiffness = factor * self.stiffness
        return Gains(stiffness, np.maximum(np.sqrt(factor) * self.damping, _SHORTEST_RETURN * stiffness))


@dataclass(frozen=True, eq=False)
class Command:
    """The controller's command along a motion, at steps j = 0 … N−1 of h seconds, each (N, n).

    position: q_d(j·h) [rad].
    velocity: dq_d at (j + ½)·h, the instant at which the integrator's damping acts [rad/s].
    feed_forward: tau_ff(j·h) [N·m].
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    feed_forward: NDArray[np.float64]

    @classmethod
    def along(cls, arm: Arm, motion: Motion, step: float, steps: int, apart: float = 2e-3) -> Command:
        """The command for `steps` steps of a motion, with the inverse dynamics of `arm`, the controller's model.

        The feed-forward is computed at instants `apart` [s] and interpolated by a cubic spline.
        """
        from scipy.interpolate import CubicSpline

        t = step * np.arange(steps)
        knots = np.linspace(0.0, max(t[-1], step), max(4, int(np.ceil(t[-1] / apart)) + 1))
        feed_forward = CubicSpline(knots, arm.torque(*motion(knots)))(t)
        return cls(motion.position(t), motion.velocity(t + 0.5 * step), feed_forward)

    def control(self, gains: Gains) -> NDArray[np.float64]:
        """The actuators' input ctrl (N, n) = tau_ff + kp·q_d + kd·dq_d [N·m]."""
        return self.feed_forward + gains.stiffness * self.position + gains.damping * self.velocity

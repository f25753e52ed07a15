"""Laws of joint torque: what a controller commands, by what it believes of the arm and of the payload.

Joint impedance with the model's inverse dynamics at the measured state,

    tau = M̂(q)·ddq_d + ĉ(q, dq) + ĝ(q) + K·(q_d − q) + D(q)·(dq_d − dq),

is computed torque with the acceleration ddq_d + M̂⁻¹·(K·e + D·ė). K is in N·m/rad, as controllers are set: a stiffness
per inertia would leave the light wrist joints to their friction. The damping is critical in every mode of the arm,

    D(q) = 2·K^(1/2)·(K^(−1/2)·M̂(q)·K^(−1/2))^(1/2)·K^(1/2).

Sources: Siciliano, Sciavicco, Villani, Oriolo, Robotics, 2009, section 8.5; the damping: Albu-Schäffer, Ott, Frese,
Hirzinger, ICRA 2003.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, facts_of, rated_effort
from armload.errors import MotionError
from armload.motion import Motion

# (t [s], q (n,) [rad], dq (n,) [rad/s]) → joint torque (n,) [N·m]
Law = Callable[[float, NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]

_FULL_LOAD_SAG = 0.1  # [rad] what the full rated torque bends a joint by, where an arm's sheet gives no stiffness
_YIELDING = 0.025  # [s] of rated torque per rad/s, against which a taught arm moves: our choice


def moderate_stiffness(arm: Arm) -> NDArray[np.float64]:
    """Stiffness (n,) for `JointImpedance` [N·m/rad]: its sheet's, or one by rated torque.

    >>> from armload.arms import arm
    >>> moderate_stiffness(arm("panda")).tolist()
    [600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0]
    """
    facts = facts_of(arm)
    given = None if facts is None else facts.impedance_stiffness
    return rated_effort(arm) / _FULL_LOAD_SAG if given is None else np.array(given)


@dataclass(frozen=True, eq=False)
class JointImpedance:
    """Follow a motion by joint impedance and the model's inverse dynamics (see the module).

    The reference at t_j: q_d(t_j), and dq_d and ddq_d by the differences the loop itself knows of the arm. It waits at
    the motion's first and last position before and after it.

    Args:
        model: the arm as the controller believes it, `arm.with_payload(what was declared)`.
        motion: with the arm's number of joints.
        stiffness: K (n,) [N·m/rad]; None: `moderate_stiffness(model)`.
        step: the loop's period [s].

    Raises:
        MotionError: the motion has another number of joints.
    """

    model: Arm
    motion: Motion
    stiffness: NDArray[np.float64] | None = None
    step: float = 1e-3

    def __post_init__(self) -> None:
        if self.motion.n != self.model.n:
            raise MotionError(f"the motion moves {self.motion.n} joints: {self.model.name} has {self.model.n}")
        if self.stiffness is None:
            object.__setattr__(self, "stiffness", moderate_stiffness(self.model))

    def __call__(self, t: float, q: NDArray[np.float64], dq: NDArray[np.float64]) -> NDArray[np.float64]:
        """The commanded torque (n,) [N·m]."""
        assert self.stiffness is not None
        q_d, dq_d, ddq_d = self.reference(t)
        return self.model.torque(q, dq, ddq_d) + self.stiffness * (q_d - q) + self.damping(q) @ (dq_d - dq)

    def damping(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """D(q) (n, n) [N·m·s/rad]."""
        assert self.stiffness is not None
        root = np.sqrt(self.stiffness)
        values, modes = np.linalg.eigh(self.model.mass_matrix(q) / np.outer(root, root))
        spread = root[:, None] * modes
        return 2.0 * (spread * np.sqrt(values)) @ spread.T

    def reference(self, t: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """q_d, dq_d and ddq_d (n,) at t [s]."""
        k = int(np.clip(round(t / self.step), -1, len(self._desired) - 4))
        before, now, after = self._desired[k + 1 : k + 4]
        return now, (now - before) / self.step, (after - 2.0 * now + before) / self.step**2

    @cached_property
    def _desired(self) -> NDArray[np.float64]:
        """q_d at −2 … steps + 2 (steps + 5, n)."""
        steps = int(np.ceil(self.motion.duration / self.step))
        return self.motion.position(self.step * np.arange(-2, steps + 3))


@dataclass(frozen=True, eq=False)
class GravityCompensation:
    """Carry what the model weighs and follow the hand: tau = ĝ(q) − damping·dq, the mode in which a robot is taught.

    Args:
        model: the arm as the controller believes it, `arm.with_payload(what was declared)`.
        damping: (n,) [N·m·s/rad]; None: 2.5 % of the rated torque per rad/s.
    """

    model: Arm
    damping: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if self.damping is None:
            object.__setattr__(self, "damping", _YIELDING * rated_effort(self.model))

    def __call__(self, _: float, q: NDArray[np.float64], dq: NDArray[np.float64]) -> NDArray[np.float64]:
        """The commanded torque (n,) [N·m]."""
        assert self.damping is not None
        return self.model.torque(q) - self.damping * dq

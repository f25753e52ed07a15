"""The arm's own mismatch as linear unknowns: what the bare model leaves out of the measured torque.

    tau_J = tau_bare + tau_L + Z·eta

Each block of eta is written in the momentum form (Y_p, Y_g − Y_c), so that it passes the same lag as the payload and
needs no acceleration either:

| block    | per joint j                                   | momentum   | drift                 |
|----------|-----------------------------------------------|------------|-----------------------|
| offset   | constant torque                               | 0          | 1                     |
| coulomb  | smooth Coulomb friction                       | 0          | tanh(dq_j / width)    |
| viscous  | viscous friction                              | 0          | dq_j                  |
| rotor    | motor inertia, where torque is motor-side     | dq_j       | 0                     |
| load     | what gears lose of the torque they transmit   | 0          | |tau_t|·tanh(dq_j/w)  |
| tilt     | (all) gravity is turned about the horizontal  | 0          | dg_j/dtheta           |
| links    | errors of the links' inertial parameters      | Y_p(links) | Y_g(links) − Y_c(links) |

`load` is there only of arms that are known to measure motor current (Bittencourt & Gunnarsson, ASME J. Dyn. Sys. Meas.
Control 134, 2012). The torque transmitted is tau_t = tau − c·tanh(dq_j/w), the measured torque, lagged as the rows are,
less a friction c that is surely in it; what else it holds of Coulomb friction is that block's. Without `load`, what the
gears lose of the payload's torque looks like another payload: two in five windows of a second of a real UR10e with a
tare missed the mass (`benchmarks/motor_side.py`).

Prior standard deviations are fractions of the joint's effort limit, the same for every arm (two Pandas and a UR10e lie
within a factor of 3 of each other so, but for friction, which is five times as large where torque is motor current);
`posterior.problem` rescales all blocks but `load`, `tilt` and `links` from the data. Gravity is believed: the prior of
`tilt` is zero, unless somebody asks (`armload.posterior.tilt`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import FRICTION_WIDTH, LINK_SPREAD, Arm, MomentumRegressor, full_arm_regressor, leaning_torque
from armload.inertia import InertialParameters

# [effort limits, per rad/s, per rad/s²] prior standard deviations: two Pandas and a UR10e lie within a factor of 3 of
# each other so; the data rescale them
PER_JOINT = {"offset": 4e-3, "coulomb": 1e-2, "viscous": 5e-3, "rotor": 3e-4}
# times these where torque is motor current: the gear's friction is in it (the UR10e's logs)
_MOTOR_FRICTION = {"coulomb": 5.0, "viscous": 5.0}
# [1] prior standard deviation of the share of the torque that a joint's gear loses: 0.04 to 0.07 of a UR10e's in five
# of its joints (`benchmarks/real_residuals.py`)
_LOSS = 0.08
# [1] the same where torque is measured behind the gears, for arms of which it is asked (`Arm.gear_loss`), and of what
# was added since a tare, before a stream's arm is called changed (`posterior.drift`): 0.3 % of a Panda's and 0.9 % of a
# KUKA's joints that bear most, neither told from nothing (`benchmarks/real_residuals.py`)
LINK_LOSS = 0.01
# [1] standard deviation of the share of its Coulomb friction by which a joint rubs more one way than the other: what
# moves one way mostly has it as an offset. A stated prior, as of the simulated arms (`simulation/model_error.py`)
_ONE_WAY = 0.2
# [effort limits] friction surely in a motor current's torque: 0.03 to 0.06 of a UR10e's joints. With it, |torque| of a
# joint that mostly rubs would be its friction, and a loss all that it transmits
LEAST_FRICTION = 0.02
# times that the variance of a joint's residual is larger at rest than in motion, link and motor side: friction is
# anything below stiction there. √10 and √250 of a residual of 1e-3 effort limits are a third of the friction expected
_PRESLIDING, _MOTOR_PRESLIDING = 10.0, 250.0
# [effort limits, per rad/s] by how much offsets and friction of an arm differ from one day to the next, 1 sigma:
# warmth, wear, a controller calibrated again. A stated prior, in the order of `PER_JOINT`: 0.13 N·m of a Panda's large
# joints, 0.02 of its wrist, 15 % of the friction
DAILY = {"offset": 1.5e-3, "coulomb": 1.5e-3, "viscous": 7.5e-4}
TILTS = 2  # axes about which gravity may be turned
_UNMODELLED_INERTIA = 5e-3  # [kg·m²] of every link at least: cables, covers, elastic joints. A stated prior


@dataclass(frozen=True, eq=False)
class Correction:
    """The unknowns eta of one arm, with their prior.

    Args:
        arm: the arm.
        effort: torque scale of each joint (n,) [N·m], usually `rated_effort(arm)`.
        gain: (n,) of each joint's torque sensor, as a payload's torque shows it; None: 1.
        gain_std: relative standard deviation of those gains; None: what is expected of the sensor's kind.
    """

    arm: Arm
    effort: NDArray[np.float64]
    gain: NDArray[np.float64] | None = None
    gain_std: float | None = None

    @property
    def size(self) -> int:
        """Number of unknowns p."""
        return self.own + TILTS + 10 * self.arm.n

    @property
    def own(self) -> int:
        """How many unknowns, the first ones, are the joints' own: all but the tilt and the links'."""
        return (len(PER_JOINT) + (self.loss_std > 0.0)) * self.arm.n

    @property
    def loss_std(self) -> float:
        """Prior standard deviation of the share of the torque that a joint loses; 0: it loses nothing."""
        return _LOSS if self.arm.motor_torque else self.arm.gear_loss

    @property
    def load(self) -> slice:
        """Where eta has what the joints lose of the torque; empty where they lose nothing."""
        return slice(len(PER_JOINT) * self.arm.n, self.own)

    @cached_property
    def prior_std(self) -> NDArray[np.float64]:
        """Prior standard deviation of eta (p,), its mean being zero."""
        larger = _MOTOR_FRICTION if self.arm.motor_torque else {}
        per_joint = [fraction * larger.get(name, 1.0) * self.effort for name, fraction in PER_JOINT.items()]
        loss = np.full(self.own - len(PER_JOINT) * self.arm.n, self.loss_std)
        return np.concatenate([*per_joint, loss, np.zeros(TILTS), _link_std(self.arm)])

    @property
    def drifting(self) -> int:
        """How many unknowns, the first ones, differ from session to session: offsets and friction."""
        return len(DAILY) * self.arm.n

    @cached_property
    def daily_std(self) -> NDArray[np.float64]:
        """Standard deviation of their difference after a day."""
        larger = _MOTOR_FRICTION if self.arm.motor_torque else {}
        return np.concatenate([fraction * larger.get(name, 1.0) * self.effort for name, fraction in DAILY.items()])

    @property
    def presliding(self) -> NDArray[np.float64]:
        """By how much a joint's residual varies more at rest (n,): friction is anything below stiction."""
        return np.full(self.arm.n, _MOTOR_PRESLIDING if self.arm.motor_torque else _PRESLIDING)

    @property
    def adaptive(self) -> NDArray[np.bool_]:
        """Which unknowns have a prior whose scale the data may set (p,): not tilt, links and what gears lose.

        Where friction is most of a joint's torque, a loss of all of it would fit as well.
        """
        return np.arange(self.size) < len(PER_JOINT) * self.arm.n

    @property
    def tilt(self) -> slice:
        """Where eta has the angles [rad] by which gravity is turned about `Arm.horizontal`."""
        return slice(self.own, self.own + TILTS)

    def expected_offset(self, eta: ArrayLike) -> NDArray[np.float64]:
        """Standard deviation of the joints' offsets (n,) [N·m], whose friction may differ from one way to the other."""
        return np.hypot(PER_JOINT["offset"] * self.effort, _ONE_WAY * self.coulomb(eta))

    def coulomb(self, eta: ArrayLike) -> NDArray[np.float64]:
        """The Coulomb friction (n,) [N·m] among the unknowns."""
        return self._of_joints("coulomb", eta)

    def offset(self, eta: ArrayLike) -> NDArray[np.float64]:
        """The torque offsets (n,) [N·m] among the unknowns."""
        return self._of_joints("offset", eta)

    def _of_joints(self, what: str, eta: ArrayLike) -> NDArray[np.float64]:
        n, block = self.arm.n, list(PER_JOINT).index(what)
        return np.asarray(eta)[block * n : (block + 1) * n]

    @property
    def least_friction(self) -> NDArray[np.float64]:
        """c (n,) [N·m], friction that is surely in the measured torque; 0 where gears are not."""
        return self.arm.motor_torque * LEAST_FRICTION * self.effort

    def regressor(self, q: ArrayLike, dq: ArrayLike, torque: ArrayLike) -> MomentumRegressor:
        """Momentum form of Z for samples (N, n), torque being measured: two arrays (N, n, p)."""
        dq, torque = np.atleast_2d(dq), np.atleast_2d(torque)
        n, eye = self.arm.n, np.eye(self.arm.n)
        nothing, level = np.zeros((len(dq), n, n)), np.zeros((len(dq), n, TILTS))
        direction = np.tanh(dq / FRICTION_WIDTH)
        momentum = [nothing, nothing, nothing, dq[:, :, None] * eye]
        drift = [nothing + eye, direction[:, :, None] * eye, dq[:, :, None] * eye, nothing]
        if self.loss_std > 0.0:
            momentum.append(nothing)
            drift.append((np.abs(torque - self.least_friction * direction) * direction)[:, :, None] * eye)
        momentum.append(level)
        drift.append(leaning_torque(self.arm, q))
        links = full_arm_regressor(self.arm, q, dq)
        return MomentumRegressor(
            np.concatenate([*momentum, links.momentum], axis=2), np.concatenate([*drift, links.drift], axis=2)
        )


def _link_std(arm: Arm) -> NDArray[np.float64]:
    """First-order spread of each link's ten parameters about its joint frame for the stated spread of m, r and I."""
    mass_std, com_std, inertia_std = (arm.link_spread * x for x in LINK_SPREAD)
    out = []
    for phi in arm.link_parameters:
        link = InertialParameters(phi)
        m = max(link.mass, 1e-3)
        r = link.first_moment / m
        inertia = np.abs(np.diag(link.inertia))
        moment = np.sqrt((mass_std * m * r) ** 2 + (m * com_std) ** 2)
        scale = _UNMODELLED_INERTIA + inertia_std * np.mean(inertia) + 2 * m * com_std * np.linalg.norm(r)
        out.append(np.concatenate([[mass_std * m], moment, np.full(6, scale)]))
    return np.concatenate(out)

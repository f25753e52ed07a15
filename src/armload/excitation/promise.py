"""What a bound comes to on an arm that differs from its model: the half-width that most such arms stay within.

    h_i² = min(f_i·b_i, p_i)² + (1.96·γ·max(|phi_i|, m·l_i))²,      γ² = gain² + s²,   l = (1, L, L²)

b is the bound's half-width, p that of what was known before, phi the heaviest payload of the range, parameter by
parameter, m its mass. The bound is of the stated model, and the estimator gives wider intervals for reasons that no
motion changes, none of which the bound knows:

- the residual: a simulated UR10e's motor currents leave 1 to 7 times what is expected of it, mostly 2 to 4, so that the
  bound doubles where the empty run is at the place
- trust: the calibrated method widens by what it learned of arms unlike their models, 1.5 to 2.2 times on motor currents
- the load: torque is calibrated to so many per cent, and the payload is known no better; of what it adds gears lose a
  share that an empty run does not show, so that on motor currents each joint has a scale of its own, s² = gain² + loss²
  (`posterior.joint_gains`; behind the gears s is 0). It reaches the moments by a lever L, the one of the wrist's
  joints, and the inertias by its square, wherever the payload's centre is

The first two are the factors f, stated priors: 90 % quantiles over simulated worlds of the estimator's half-width over
the bound's, without the load's share, the largest of several designs (`benchmarks/designed_motions.py`). loss and L are
from the same worlds: where the empty run is at the place, half-widths of UR10e payloads of 1.2, 2.3 and 4.8 kg grow as
132, 203 and 250 g, 44, 57 and 75 g·m, 12, 14 and 21 g·m² (median). The link side's f were set again when a first draw
of other poses, worlds and designs kept 84 %: an empty run of its own leaves more than the loaded run's own motion does,
whose errors repeat. The motor side's f of the mass at the place, once 7 and 8, kept 83 %, and are set by eight designs
of another draw (`benchmarks/kept_promises.py --arms ur10e --designs 11 --seed 990000`: 7.3 and 8.8 at most). All are
checked on a draw of their own (`benchmarks/kept_promises.py`). An f below 1 is what a learned
prior gains.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload.excitation.criterion import Criterion
from armload.excitation.payload_range import PayloadRange
from armload.inertia import Z95
from armload.posterior.joint_gains import LOAD_LOSS, scale_of_joints
from armload.posterior.problem import assumed_gain

# [1] f of mass, moments and inertias, by the side of the torque and by the empty run: the loaded run's own motion, a
# motion designed with it about the same pose, another log (or there is none). Stated priors, see above
_FACTORS = {
    ("link", "same"): (1.3, 1.6, 1.2),
    ("link", "own"): (2.3, 2.0, 1.7),
    ("link", None): (1.5, 1.6, 0.9),
    ("motor", "same"): (7.5, 6.5, 4.0),
    ("motor", "own"): (9.0, 6.5, 4.0),
    ("motor", None): (7.0, 6.5, 1.2),
}
_LEVER = {"link": 0.13, "motor": 0.27}  # [m] L. Stated, see above


def promised(criterion: Criterion, bound: NDArray[np.float64], payload: PayloadRange) -> NDArray[np.float64]:
    """The half-widths (10,) of the 95 % intervals that most arms stay within, from those of the bound (10,)."""
    factors = _FACTORS[_side(criterion), criterion.designed_tare]
    physics = np.minimum(np.repeat(factors, [1, 3, 6]) * bound, criterion.prior_half_width)
    return np.hypot(physics, of_gain(criterion, payload))


def of_gain(criterion: Criterion, payload: PayloadRange) -> NDArray[np.float64]:
    """The share (10,) of it that calibration and gears leave of the heaviest payload, whatever the motion."""
    side, gain = _side(criterion), gain_std(criterion)
    lever = payload.mass * np.repeat([1.0, _LEVER[side], _LEVER[side] ** 2], [1, 3, 6])
    heaviest = np.maximum(np.abs(payload.corners()).max(axis=0), lever)
    return Z95 * float(np.hypot(gain, scale_of_joints(gain) if side == "motor" else 0.0)) * heaviest


def gain_std(criterion: Criterion) -> float:
    """Relative standard deviation of the torque's calibration: a profile's, or what is expected of the sensor."""
    return criterion.correction.gain_std or assumed_gain(criterion.arm, _side(criterion))


def of_gain_in_words(criterion: Criterion) -> str:
    """What that share comes from."""
    motor = _side(criterion) == "motor"
    gears = f" in all and by joint, and gears keep {100 * LOAD_LOSS:.2g} % of a load to themselves" if motor else ""
    return f"the torque is calibrated to {100 * gain_std(criterion):.2g} %{gears} (1 sigma)"


def _side(criterion: Criterion) -> str:
    """Where the arm's torque is measured: at the link, or as its motors' current."""
    return "motor" if criterion.arm.motor_torque else "link"

"""Logs by inverse dynamics: an arm that follows its motion but for a drawn tracking error, a hundred times faster.

    tau_J = gain·[M(q)·ddq + C(q, dq)·dq + g(q) + friction(dq, tau) + residual(q)] + offset + drift(t)

q = q_desired + e(t), where e is a sum of drawn sine waves, so that dq and ddq are its exact derivatives. What MuJoCo
adds, that friction and payload disturb the motion, is left out: identification sees only q, dq and tau, which satisfy
the same equation (`tests/simulation/test_simulate_inverse.py`). The payload may change at any time, at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import MotionError
from armload.motion import Motion
from armload.recording import Recording
from armload.simulation.runs import payload_parameters
from armload.simulation.sensors import Sensors
from armload.simulation.worlds import World

# [rad] rms of the tracking error, an order of magnitude as `simulate`'s Panda shows it without its lag
TRACKING = 1e-4
_WAVES, _BAND = 8, (0.2, 3.0)  # of each joint's error [Hz]: above, a stiff controller lets nothing through


def simulate_inverse(
    arm: Arm,
    motion: Motion,
    held: Sequence[tuple[float, Any | None]] | Any | None = None,
    *,
    world: World | None = None,
    sensors: Sensors | None = None,
    rate: float = 100.0,
    duration: float | None = None,
    tracking: float = TRACKING,
    seed: int = 0,
    start: float = 0.0,
) -> Recording:
    """A log of an arm that runs a motion, with payloads that come and go.

    >>> from armload.arms import arm
    >>> from armload.motion import taie2024
    >>> log = simulate_inverse(arm("panda"), taie2024())
    >>> len(log), log.n
    (600, 7)

    Args:
        arm: the nominal arm (with whatever is attached).
        motion: with the arm's number of joints.
        held: a payload, anything that `simulate` takes, None is nothing; or (time [s], payload) in order, the first at
            0: what is held from then on.
        world: the arm as it really is; None: nominal.
        sensors: None: ideal.
        rate: of the log [Hz]. duration: of the log [s]; None: the motion's.
        tracking: rms of each joint's tracking error [rad].
        seed: of the tracking error and of the sensors' noise.
        start: when the log begins, on the clock of the world's drift [s].

    Raises:
        MotionError: the motion has another number of joints, or lasts no time.
        PayloadError: a payload is not made of ten inertial parameters.
    """
    if motion.n != arm.n:
        raise MotionError(f"the motion moves {motion.n} joints: {arm.name} has {arm.n}")
    held = held if isinstance(held, Sequence) else [(0.0, held)]
    samples = round((motion.duration if duration is None else duration) * rate)
    if samples < 2:
        raise MotionError(f"a log of {samples} sample(s): expected at least 2; give a longer duration or a higher rate")
    world = world or World.nominal(arm)
    actual, t = world.arm(arm), np.arange(samples) / rate
    rng = np.random.default_rng([seed, 3])
    q, dq, ddq = (x + e for x, e in zip(motion(t), _tracking_error(t, arm.n, tracking, rng), strict=True))
    body = np.empty_like(q)
    for (since, payload), (until, _) in pairwise([*held, (np.inf, None)]):
        rows, parameters = (t >= since) & (t < until), payload_parameters(payload, arm)
        carrying = actual if parameters is None else actual.with_payload(parameters)
        body[rows] = carrying.torque(q[rows], dq[rows], ddq[rows])
    if world.rotor_inertia is not None:
        body = body + world.rotor_inertia * ddq
    tau = world.measured(body + world.disturbance(q, dq, body), start + t) + world.sticking(seed)(dq)
    log = Recording(t, q, dq, tau, joint_names=arm.joint_names, source=f"inverse dynamics of {arm.name}")
    return log if sensors is None else sensors.observe(log, seed)


def _tracking_error(t: NDArray, n: int, size: float, rng: np.random.Generator) -> tuple[NDArray, NDArray, NDArray]:
    """e, its velocity and acceleration (N, n): waves of one amplitude, frequencies uniform in their logarithm."""
    omega = 2.0 * np.pi * np.exp(rng.uniform(*np.log(_BAND), size=(_WAVES, n)))
    angle = t[:, None, None] * omega + rng.uniform(0.0, 2.0 * np.pi, size=(_WAVES, n))
    a = size * np.sqrt(2.0 / _WAVES)
    sine, cosine = np.sin(angle), np.cos(angle)
    return a * sine.sum(axis=1), a * (omega * cosine).sum(axis=1), -a * (omega**2 * sine).sum(axis=1)

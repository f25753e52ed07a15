"""How the shipped excitation was found: `python -m armload.motion.design` writes motions/taie2024.json again.

A seeded random search (one parent, one mutated child, the better one stays) over offsets and coefficients of equations
(5) and (6). It maximises the D-criterion of the payload's ten parameters,

    log det (1/N)·sum_t (S·Y_tᵀ·Sigma⁻²·Y_t·S),   S = diag(1, L (3 times), L² (6 times)),   L = 0.1 m,

which makes the volume of their confidence ellipsoid small in scaled units: without S, kilograms and kg·m² would be
compared. Sigma weighs the joints by the torque that a calibrated Panda model leaves unexplained. Motions that use more
than a share of a limit, touch something or move the payload too fast are never accepted.

Sources: Swevers, Ganseman, Tükel, De Schutter, Van Brussel, T-RO 1997 (Fourier excitation, D-criterion); Taie et al.,
RA-L 2024, equations (5)–(6), for the form; its reference [7] (Kurdas et al., ICRA 2022), as far as it is public, for
the 8 harmonics and the 6 s. The coefficients are ours.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, arm, payload_regressor
from armload.motion.check import check_motion, rated_load
from armload.motion.collision import capsule_arm
from armload.motion.fourier import FourierMotion
from armload.motion.motion_file import save_motion

SEED, STEPS = 2024, 60_000
HARMONICS, PERIOD = 8, 6.0  # [1], [s] those of the paper's reference [7]; the paper gives neither
READY = (0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8)  # [rad] flange in front of the arm, facing down
LENGTH = 0.1  # L [m], the size of the payloads of interest
SIGMA = (0.20, 0.29, 0.19, 0.20, 0.08, 0.05, 0.05)  # [N·m] unexplained torque, joints 1–7, of a calibrated Panda
SHARE = 0.80  # of each limit of velocity, acceleration, jerk and torque
TRAVEL = 1.0  # [rad] the farthest any joint goes from its offset
KEEP_OFF = 0.15  # [rad] from the position limits
TOOL_SPEED = 1.5  # [m/s] of the payload frame; Franka's Cartesian limit is 1.7 m/s
FLOOR, SELF = 0.10, 0.03  # [m] clearances with the payload's ball
NOTE = (
    "Our own re-design with the form of Taie et al., RA-L 2024 (equations 5-6, 8 harmonics, T = 6 s) for the Panda: "
    "the paper takes its coefficients from its reference [7], which publishes them nowhere. Made by "
    f"python -m armload.motion.design (seed {SEED}, {STEPS} steps)."
)


def scaled_regressor(arm: Arm, motion: FourierMotion, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Y·S weighted by 1/Sigma at times t (N,), stacked (N·n, 10): the regression least squares would solve."""
    q, dq, ddq = motion(t)
    Y = payload_regressor(arm.frame_motion(q), dq, ddq)
    scale = np.repeat([1.0, LENGTH, LENGTH**2], [1, 3, 6])
    return (Y * scale / np.array(SIGMA)[:, None]).reshape(-1, 10)


def information(arm: Arm, motion: FourierMotion, samples: int = 60) -> float:
    """The D-criterion of the payload over the motion (greater is better), from evenly spaced samples."""
    A = scaled_regressor(arm, motion, np.arange(samples) * motion.duration / samples)
    sign, log_det = np.linalg.slogdet(A.T @ A / samples)
    return float(log_det) if sign > 0 else -np.inf


def condition(arm: Arm, motion: FourierMotion, samples: int = 600) -> float:
    """Condition number of the scaled, weighted regressor of the payload (smaller is better, 1 is perfect)."""
    return float(np.linalg.cond(scaled_regressor(arm, motion, np.arange(samples) * motion.duration / samples)))


def allowed(arm: Arm, samples: int = 90) -> Callable[[FourierMotion], bool]:
    """A test of a motion against this design's margins, cheapest questions first."""
    limits, model, load = arm.limits, capsule_arm(arm), rated_load(arm)
    loaded = arm if load is None else arm.with_payload(load)

    def test(motion: FourierMotion) -> bool:
        t = np.arange(samples) * motion.duration / samples
        q, dq, ddq = motion(t)
        if (
            np.any(np.abs(q - motion.offset) > TRAVEL)
            or np.any(np.minimum(q - limits.position_low, limits.position_high - q) < KEEP_OFF)
            or np.any(np.abs(dq) > SHARE * limits.velocity_at(q, dq))
            or np.any(np.abs(ddq) > SHARE * limits.acceleration)
            or np.any(np.abs(motion.jerk(t)) > SHARE * limits.jerk)
        ):
            return False
        speed = np.einsum("tij,tj->ti", arm.frame_motion(q).jacobian[:, 3:], dq)
        if np.linalg.norm(speed, axis=1).max() > TOOL_SPEED:
            return False
        clear = model.clearance(q)
        if clear.floor.min() < FLOOR or clear.self.min() < SELF:
            return False
        return not np.any(np.abs(loaded.torque(q, dq, ddq)) > SHARE * limits.effort)

    return test


def design(arm: Arm, seed: int = SEED, steps: int = STEPS) -> FourierMotion:
    """The best motion of a random search of so many steps; the same seed gives the same motion.

    The step size follows the success: longer after an improvement, shorter after a failure, so that about one child in
    five is better (Rechenberg's rule).
    """
    rng = np.random.default_rng(seed)
    k = np.arange(1, HARMONICS + 1)
    ready, shape = np.array(READY), (arm.n, HARMONICS)
    test = allowed(arm)
    best = FourierMotion(ready, rng.normal(size=shape) / k**2, rng.normal(size=shape) / k**2, PERIOD, "taie2024", NOTE)
    best = tidy(best.smooth())
    while not test(best):
        best = tidy(best.scaled(0.8))
    score, step = information(arm, best), 0.05
    for _ in range(steps):
        joints = rng.random(arm.n) < 0.4  # a few joints at a time: changing all of them rarely helps
        change = rng.normal(size=(arm.n, 2 * HARMONICS + 1)) * step * joints[:, None]
        child = replace(
            best,
            offset=np.clip(best.offset + 0.5 * change[:, 0], ready - 0.3, ready + 0.3),
            sine=best.sine + change[:, 1 : HARMONICS + 1] / k**1.5,
            cosine=best.cosine + change[:, HARMONICS + 1 :] / k**1.5,
        )
        child = tidy(child.smooth())
        if test(child) and (value := information(arm, child)) > score:
            best, score, step = child, value, step * 1.5
        else:
            step = max(step * 0.9, 2e-3)
    return best


def tidy(motion: FourierMotion) -> FourierMotion:
    """The motion in steps of 10 µrad, still exactly at rest at both ends: the first harmonic takes up the rounding."""
    k = np.arange(1, motion.harmonics + 1)
    sine, cosine = np.round(motion.sine * 1e5), np.round(motion.cosine * 1e5)
    sine[:, 0], cosine[:, 0] = -sine[:, 1:] @ k[1:], -cosine[:, 1:] @ k[1:] ** 2
    return replace(motion, offset=np.round(motion.offset, 3), sine=sine / 1e5, cosine=cosine / 1e5)


def main() -> None:
    """Design the motion again, write it, and show what it leaves of each limit."""
    parser = argparse.ArgumentParser(
        prog="python -m armload.motion.design", description="Design the shipped excitation again."
    )
    parser.add_argument("path", nargs="?", type=Path, default=Path(__file__).parent / "motions" / "taie2024.json")
    arguments = parser.parse_args()
    panda = arm("panda")
    motion = design(panda)
    save_motion(arguments.path, motion)
    print(check_motion(panda, motion, rated_load(panda)))
    print(f"D-criterion {information(panda, motion):.2f}, condition number {condition(panda, motion):.1f}")


if __name__ == "__main__":
    main()

"""Whether what is held moves on its own: how restless the torques are with it.

The rigid model and the arm's smooth mismatch leave noise, of a size that hardly depends on what is held. A part that
swings, sloshes or slips adds torques of one to five hertz, which no block mean of a quarter of a second shows, and the
mean square of the residual does:

    restlessness = sqrt(mean_j P_j / max(P0_j, expected_j²)),        P_j = ∫ e_j² dt / T

P of the run, P0 of the tare. Motor currents cannot be asked: friction that grows with the load is restless, too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# times that the torques are as restless as they should be: sound simulated logs of Pandas stay below 1.9, a real one
# below 1.7; what swings or sloshes is above in half of the logs (`benchmarks/wrong_logs.py`)
RESTLESS = 2.0
PERIOD = 1.0  # [s] of a live run before it is asked: what swings or sloshes does so once a second at least
# [s] of a live run after which a doubt can only end: an arm that goes to ever new poses has been in more of them by
# then than its smooth mismatch has features, and what those leave grows. Of sound runs everywhere in the joints' range
# it is at most 1.14 in the first 100 s, and 1.5 to 2.4 after ten minutes; in one place it stays below 1.05
# (`benchmarks/ever_new_poses.py`; test_a_run_of_many_minutes_is_not_said_to_swing_as_it_gets_more_restless)
SHOWN = 100.0


def restlessness(power: NDArray[np.float64], expected: NDArray[np.float64]) -> float:
    """Root mean square over the joints of the last run's residual over that of the runs before.

    Args:
        power: (K, n) mean square of each run's residual [N²·m²], the tares' first.
        expected: (n,) of it at least [N·m]: a tare may be of an arm that hardly moves.
    """
    return float(np.sqrt(np.mean(_ratios(power, expected))))


def most_restless(power: NDArray[np.float64], expected: NDArray[np.float64]) -> int:
    """The joint, from 1, that has most of it."""
    return int(np.argmax(_ratios(power, expected))) + 1


def _ratios(power: NDArray[np.float64], expected: NDArray[np.float64]) -> NDArray[np.float64]:
    return power[-1] / np.maximum(power[:-1].max(axis=0), expected**2)

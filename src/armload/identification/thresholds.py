"""The numbers that decide what is said of a log, each with its unit, its reason and where the evidence is."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

LOWEST_RATE = 20.0  # [Hz] of a log: below, a lag of 50 ms passes between two samples
# standard deviations between what the log says and the nearest body: the truth of one sound log in a thousand lies
# farther from what is found (`inertia.distance_to_body`)
MISFIT = float(np.sqrt(chi2.ppf(0.999, 10)))
# rms of torque offsets over what is expected of an arm, by the side the torque is measured on: about 1 of most
# simulated arms, more where friction holds the joints (motor currents). A base tilted by 30° is seen in 26 of 28
# simulated logs, none of 138 sound ones (tests/identification/test_identify.py has one of each)
LARGEST_OFFSETS = {"link": 5.0, "motor": 8.0}
MOVES = 0.05  # [rad] a joint that stays within so much stands: friction below stiction holds it
# a log that tells a parameter so many times worse under the weak prior leaves it to the learned one: the same factor by
# which a parameter's interval must shrink to count as determined (`inertia.SHRINK`)
LEANS = 3.0
# between two squared distances, whether a tool was mounted at a tare: odds of 90 to 1, exp(9 / 2)
DECISIVE = 9.0

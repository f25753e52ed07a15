"""The mass alone of what is added at a cut of a log: of something light it shows first."""

from __future__ import annotations

import numpy as np

# [kg·m, kg·m²] standard deviations of moments and inertia of something light, 0.2 kg within 8 cm of the frame: a stated
# prior. What is heavier shows in all ten
_LIGHT = 0.2 * np.array([0.08] * 3 + [0.08**2] * 6)
# chi-squared of the mass alone where the payload may change: the 99 % quantile for one degree of freedom, as
# `PAYLOAD_MAY_CHANGE` is for ten. Of 27 sound simulated logs the largest is 2.5, of three windows of a real Panda's 1.0
MASS_MAY_CHANGE = 6.634896601021213


def of_mass(information: np.ndarray, vector: np.ndarray) -> float:
    """h_m²/Λ_m, chi-squared of one where nothing was added; Λ_m, h_m are of the mass, something light's moments out."""
    rest = np.linalg.solve(information[1:, 1:] + np.diag(_LIGHT**-2.0), np.c_[information[1:, 0], vector[1:]])
    own = information[0, 0] - information[0, 1:] @ rest[:, 0]
    if own <= 0.0:  # neither part moves: they tell nothing
        return 0.0
    return float((vector[0] - information[0, 1:] @ rest[:, 1]) ** 2 / own)

"""How well a motion can tell a payload: the Bayesian Cramér–Rao bound, what it determines, and what would help."""

from armload.bound.advice import Advice, advise
from armload.bound.cramer_rao import TIMES, Bound, bound, efficiency
from armload.bound.worlds import scales_of

__all__ = ["TIMES", "Advice", "Bound", "advise", "bound", "efficiency", "scales_of"]

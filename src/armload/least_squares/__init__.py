"""Least squares on the torque a payload adds: recursive, behind an observer, and MAP with the arm's own mismatch."""

from armload.least_squares.autocorrelation import BlockMeans
from armload.least_squares.correction import Correction, effort_scale
from armload.least_squares.posterior import Posterior, PosteriorLeastSquares
from armload.least_squares.prior import GaussianPrior, payload_prior_std
from armload.least_squares.recursive import FilteredRecursiveLeastSquares, RecursiveLeastSquares

__all__ = [
    "BlockMeans",
    "Correction",
    "FilteredRecursiveLeastSquares",
    "GaussianPrior",
    "Posterior",
    "PosteriorLeastSquares",
    "RecursiveLeastSquares",
    "effort_scale",
    "payload_prior_std",
]

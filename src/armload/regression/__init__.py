"""Samples to rows of the acceleration-free filtered regression; the arm's mismatch, features, noise and priors."""

from armload.regression.block_means import BlockMeans
from armload.regression.features import JointFeatures
from armload.regression.lag import first_order_lag
from armload.regression.mismatch import Correction
from armload.regression.prior import GaussianPrior, payload_prior_std, solution_prior_std
from armload.regression.rows import FilteredRegression

__all__ = [
    "BlockMeans",
    "Correction",
    "FilteredRegression",
    "GaussianPrior",
    "JointFeatures",
    "first_order_lag",
    "payload_prior_std",
    "solution_prior_std",
]

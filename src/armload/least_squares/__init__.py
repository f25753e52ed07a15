"""Least squares on the torque a payload adds: ordinary, weighted, total, recursive, MAP with the arm's own mismatch."""

from armload.least_squares.acceleration import CommandedLeastSquares, PolynomialLeastSquares
from armload.least_squares.autocorrelation import BlockMeans
from armload.least_squares.consistent import ConsistentLeastSquares, LogCholeskyLeastSquares
from armload.least_squares.correction import Correction
from armload.least_squares.difference import DifferenceLeastSquares
from armload.least_squares.features import JointFeatures
from armload.least_squares.joint import JointLeastSquares
from armload.least_squares.kalman import ExtendedKalmanFilter
from armload.least_squares.live import StreamingIdentifier
from armload.least_squares.map import PosteriorLeastSquares, SmoothPosteriorLeastSquares
from armload.least_squares.momentum import MomentumLeastSquares
from armload.least_squares.normal import OrdinaryLeastSquares, WeightedLeastSquares
from armload.least_squares.prior import GaussianPrior, payload_prior_std, solution_prior_std
from armload.least_squares.problem import Posterior
from armload.least_squares.recursive import FilteredRecursiveLeastSquares, RecursiveLeastSquares
from armload.least_squares.total import RecursiveTotalLeastSquares

__all__ = [
    "BlockMeans",
    "CommandedLeastSquares",
    "ConsistentLeastSquares",
    "Correction",
    "DifferenceLeastSquares",
    "ExtendedKalmanFilter",
    "FilteredRecursiveLeastSquares",
    "GaussianPrior",
    "JointFeatures",
    "JointLeastSquares",
    "LogCholeskyLeastSquares",
    "MomentumLeastSquares",
    "OrdinaryLeastSquares",
    "PolynomialLeastSquares",
    "Posterior",
    "PosteriorLeastSquares",
    "RecursiveLeastSquares",
    "RecursiveTotalLeastSquares",
    "SmoothPosteriorLeastSquares",
    "StreamingIdentifier",
    "WeightedLeastSquares",
    "payload_prior_std",
    "solution_prior_std",
]

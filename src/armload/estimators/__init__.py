"""The contract of every identifier, and the classic methods, one file each."""

from armload.estimators.acceleration import CommandedLeastSquares, PolynomialLeastSquares
from armload.estimators.constrained import ConsistentLeastSquares, LogCholeskyLeastSquares
from armload.estimators.contract import ArmMismatch, Estimate, Identifier, Tared, samples_until
from armload.estimators.difference import DifferenceLeastSquares
from armload.estimators.joint import JointLeastSquares
from armload.estimators.kalman import ExtendedKalmanFilter
from armload.estimators.momentum import MomentumLeastSquares
from armload.estimators.normal import OrdinaryLeastSquares, WeightedLeastSquares
from armload.estimators.recursive import FilteredRecursiveLeastSquares, RecursiveLeastSquares
from armload.estimators.total import RecursiveTotalLeastSquares

__all__ = [
    "ArmMismatch",
    "CommandedLeastSquares",
    "ConsistentLeastSquares",
    "DifferenceLeastSquares",
    "Estimate",
    "ExtendedKalmanFilter",
    "FilteredRecursiveLeastSquares",
    "Identifier",
    "JointLeastSquares",
    "LogCholeskyLeastSquares",
    "MomentumLeastSquares",
    "OrdinaryLeastSquares",
    "PolynomialLeastSquares",
    "RecursiveLeastSquares",
    "RecursiveTotalLeastSquares",
    "Tared",
    "WeightedLeastSquares",
    "samples_until",
]

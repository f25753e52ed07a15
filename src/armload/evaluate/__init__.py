"""Evaluation: the same runs through every method, errors over time and at the end, honest baselines in every table."""

from armload.evaluate.baselines import PriorLeastSquares, TrainingMean
from armload.evaluate.compare import EvaluationRun, compare
from armload.evaluate.comparison import Comparison
from armload.evaluate.metrics import absolute_error, coverage, half_width, mean_absolute_error, settling_time, spread
from armload.evaluate.table import Table
from armload.least_squares import GaussianPrior

__all__ = [
    "Comparison",
    "EvaluationRun",
    "GaussianPrior",
    "PriorLeastSquares",
    "Table",
    "TrainingMean",
    "absolute_error",
    "compare",
    "coverage",
    "half_width",
    "mean_absolute_error",
    "settling_time",
    "spread",
]

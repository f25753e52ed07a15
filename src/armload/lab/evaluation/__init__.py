"""Evaluation: the same runs through every method, errors over time and at the end, honest baselines in every table."""

from armload.lab.evaluation.baselines import PriorLeastSquares, TrainingMean
from armload.lab.evaluation.comparison import Comparison
from armload.lab.evaluation.contest import EvaluationRun, catalogued, compare
from armload.lab.evaluation.held_out import held_out_error
from armload.lab.evaluation.metrics import (
    absolute_error,
    coverage,
    half_width,
    mean_absolute_error,
    settling_time,
    spread,
)
from armload.lab.report.shown import Table

__all__ = [
    "Comparison",
    "EvaluationRun",
    "PriorLeastSquares",
    "Table",
    "TrainingMean",
    "absolute_error",
    "catalogued",
    "compare",
    "coverage",
    "half_width",
    "held_out_error",
    "mean_absolute_error",
    "settling_time",
    "spread",
]

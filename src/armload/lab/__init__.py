"""Experiments: episodes, data sets, training, evaluation, reports, benchmarks, the paper's study, the demo."""

from armload.lab.cells import load_cells, save_cell
from armload.lab.experiment import Task, run_tasks

__all__ = ["Task", "load_cells", "run_tasks", "save_cell"]

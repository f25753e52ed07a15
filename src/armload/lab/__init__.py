"""Experiments: episodes, data sets, training, evaluation, reports, benchmarks, the paper's study, the demo."""

from armload.lab.cells import load_cells, save_cell

__all__ = [
    "load_cells",
    "save_cell",
]

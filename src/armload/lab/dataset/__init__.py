"""Data sets: many simulated runs in one table with the paper's columns, their provenance, and fair ways to split."""

from armload.lab.dataset.build import build_dataset
from armload.lab.dataset.parquet_table import IDENTITIES, PARAMETERS, Dataset, open_dataset, table_columns
from armload.lab.dataset.splits import Split, split_motions, split_payloads, split_rows, split_worlds

__all__ = [
    "IDENTITIES",
    "PARAMETERS",
    "Dataset",
    "Split",
    "build_dataset",
    "open_dataset",
    "split_motions",
    "split_payloads",
    "split_rows",
    "split_worlds",
    "table_columns",
]

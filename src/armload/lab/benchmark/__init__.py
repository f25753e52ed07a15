"""The benchmark: every method of the catalogue on every population, with baselines, intervals and repeatability."""

from armload.lab.benchmark.benchmark_results import write_results
from armload.lab.benchmark.benchmark_run import QUICK, Size, run_benchmark
from armload.lab.benchmark.measured import Measured, gather
from armload.lab.benchmark.populations import ALL, Population
from armload.lab.benchmark.rows import default_names, left_out

__all__ = [
    "ALL",
    "QUICK",
    "Measured",
    "Population",
    "Size",
    "default_names",
    "gather",
    "left_out",
    "run_benchmark",
    "write_results",
]

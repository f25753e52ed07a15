"""The study of Taie et al., RA-L 2024, measured again: cells, protocols, claims, and the page made of them."""

from armload.cells import load_cells, save_cell
from armload.study.basis import FULL, QUICK, Basis, Size
from armload.study.cells import Spec
from armload.study.plan import plan
from armload.study.results import write_results
from armload.study.run import run_study

__all__ = ["FULL", "QUICK", "Basis", "Size", "Spec", "load_cells", "plan", "run_study", "save_cell", "write_results"]

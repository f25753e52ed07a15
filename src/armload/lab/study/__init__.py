"""The study of Taie et al., RA-L 2024, measured again: cells, protocols, claims, and the page made of them."""

from armload.lab.study.basis import FULL, QUICK, Basis, Size
from armload.lab.study.plan import plan
from armload.lab.study.spec import Spec
from armload.lab.study.study_results import write_results
from armload.lab.study.study_run import run_study

__all__ = ["FULL", "QUICK", "Basis", "Size", "Spec", "plan", "run_study", "write_results"]

"""Training of the default estimator's learned parts."""

from armload.lab.training.coverage import Coverage, cross_validated
from armload.lab.training.hybrid import payload_mixture, train_hybrid
from armload.lab.training.records import Records, measure_episodes

__all__ = ["Coverage", "Records", "cross_validated", "measure_episodes", "payload_mixture", "train_hybrid"]

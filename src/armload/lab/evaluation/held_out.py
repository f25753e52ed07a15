"""How far a trained ensemble is from the truth on payloads it has not seen: the basis of its error bars."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.errors import ModelError
from armload.lab.dataset import Dataset

if TYPE_CHECKING:
    from armload.ensembles.bagging import Ensemble


def held_out_error(model: Ensemble, dataset: Dataset, rows: ArrayLike) -> NDArray[np.float64]:
    """Root-mean-square error (10,) of the average prediction over a run, over the runs that `rows` belong to.

    e² = mean over runs of (mean over the run's rows of K(x) − phi)². A bag's spread is sampling variance, not this.

    Args:
        model: a fitted ensemble.
        dataset: the data set it was trained on.
        rows: indices of rows of payloads that were held out (`split_payloads(...).test`).

    Raises:
        ModelError: no rows.
    """
    rows = np.asarray(rows, dtype=int)
    if rows.size == 0:
        raise ModelError("no rows are held out: split by payload, with a part left for testing")
    error = model.predict(dataset.X[rows]) - dataset.y[rows]
    run = dataset.run[rows]
    means = np.array([error[run == k].mean(axis=0) for k in np.unique(run)])
    return np.sqrt(np.mean(means**2, axis=0))

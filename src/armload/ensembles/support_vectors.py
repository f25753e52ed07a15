"""Support-vector regression as a weak learner: Gaussian kernel, one machine per output, by scikit-learn (libsvm)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.ensembles.bag import Bag, Fitted, Learner
from armload.ensembles.kernel import CompiledSupportVectors
from armload.ensembles.progress import Progress, Report
from armload.errors import ModelError

_SUBSET = 6  # purpose of this learner's random draw, beside those of `bag`


class SupportVectorLearner(Learner):
    """ε-support-vector regression on standardised rows, one machine for each output.

    Its training time grows with the square of the rows, so that each member sees at most `cap` of the rows its bag
    holds, drawn without replacement: a few thousand of a data set's hundred thousands. Validation rows play no part.
    Sources: Vapnik 1995; Smola & Schölkopf, Statistics and Computing 2004.

    Args:
        cap: most rows per member.
        C: weight of an error beyond ε.
        epsilon: errors below it cost nothing, in units of each output's standard deviation.
        gamma: of the kernel exp(−γ·|z − z'|²), z scaled to standard deviation 1; None: 1/(number of features).
        jobs: machines trained at once, as joblib counts (−1: all cores). The result does not depend on it.
    """

    kind = "svr"
    validates = False

    def __init__(
        self, cap: int = 2000, C: float = 10.0, epsilon: float = 0.05, gamma: float | None = None, jobs: int = -1
    ) -> None:
        self.cap = cap
        self.C = C
        self.epsilon = epsilon
        self.gamma = gamma
        self.jobs = jobs

    def fit_bag(self, bag: Bag, report: Report, checkpoint: Path | None = None) -> Fitted:  # noqa: ARG002 - minutes
        """Train k machines per member.

        Raises:
            ModelError: a setting out of range.
        """
        from joblib import Parallel, delayed
        from sklearn.svm import SVR

        if self.cap < 2 or not self.C > 0 or not self.epsilon >= 0 or (self.gamma is not None and not self.gamma > 0):
            raise ModelError(
                f"support vectors with cap={self.cap}, C={self.C}, epsilon={self.epsilon}, gamma={self.gamma}: "
                "expected at least 2 rows, positive C and gamma, and epsilon of at least 0"
            )
        Z, y = bag.scaling.features(bag.X), bag.scaling.outputs(bag.y)
        gamma = 1.0 / Z.shape[1] if self.gamma is None else self.gamma
        subsets = [self._subset(bag, m) for m in range(len(bag.rows))]

        def train(m: int, output: int) -> tuple[NDArray, NDArray, float]:
            machine: Any = SVR(kernel="rbf", C=self.C, epsilon=self.epsilon, gamma=gamma)  # pyright: ignore[reportArgumentType]
            machine.fit(Z[subsets[m]], y[subsets[m], output])
            return machine.support_, machine.dual_coef_[0], float(machine.intercept_[0])

        k, total = y.shape[1], len(bag.rows) * y.shape[1]
        trained: Any = Parallel(n_jobs=self.jobs, prefer="threads", return_as="generator")(
            delayed(train)(m, output) for m in range(len(bag.rows)) for output in range(k)
        )
        machines = []
        for machine in trained:
            machines.append(machine)
            report(Progress("machines", len(machines), total, f"{len(machine[0])} support vectors"))
        members = [machines[m * k : (m + 1) * k] for m in range(len(bag.rows))]
        return Fitted(compile_machines(members, Z, subsets, gamma, bag))

    def _subset(self, bag: Bag, m: int) -> NDArray[np.int64]:
        rows = bag.rows[m]
        if len(rows) <= self.cap:
            return rows
        chosen = np.random.default_rng([bag.seed, m, _SUBSET]).choice(len(rows), self.cap, replace=False)
        return rows[np.sort(chosen)]


def compile_machines(
    members: list[list[tuple[NDArray, NDArray, float]]], Z: NDArray, subsets: list[NDArray], gamma: float, bag: Bag
) -> CompiledSupportVectors:
    """The machines of each member on one set of rows: those that support any output.

    members: for each member and output (support indices into its subset, dual coefficients, intercept).
    """
    scaling, k = bag.scaling, bag.y.shape[1]
    used = [np.unique(np.concatenate([support for support, _, _ in machines])) for machines in members]
    most = max(1, *(len(support) for support in used))
    rows, weights = np.zeros((len(members), most, Z.shape[1])), np.zeros((len(members), most, k))
    bias = np.zeros((len(members), k))
    for m, machines in enumerate(members):
        rows[m, : len(used[m])] = Z[subsets[m][used[m]]]
        for output, (support, dual, intercept) in enumerate(machines):
            weights[m, np.searchsorted(used[m], support), output] = dual
            bias[m, output] = intercept
    return CompiledSupportVectors(
        rows,
        weights * scaling.y_scale,
        scaling.y_mean + scaling.y_scale * bias,
        np.full(len(members), gamma),
        scaling.x_mean,
        scaling.per_x,
    )

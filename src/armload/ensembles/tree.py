"""Decision trees as weak learners, with the paper's settings, grown by scikit-learn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.ensembles.compiled import CompiledTrees
from armload.ensembles.progress import Progress, Report
from armload.ensembles.weak_learner import TIES, Bag, Fitted, Learner


class TreeLearner(Learner):
    """A regression tree of any depth; defaults as Taie et al. 2024, Section IV.

    Splits minimise the squared error summed over the outputs; a leaf answers with the mean of its training rows. Trees
    learn from training rows only; validation rows play no part.

    Args:
        max_depth: None: as deep as the rows allow.
        min_samples_split: rows an inner node needs.
        min_samples_leaf: rows a leaf needs.
        max_features: features tried per split; None: all.
        jobs: trees grown at once, as joblib counts (−1: all cores). The trees do not depend on it.
    """

    kind = "tree"
    validates = False

    def __init__(
        self,
        max_depth: int | None = None,
        min_samples_split: int = 2,
        min_samples_leaf: int = 1,
        max_features: float | int | str | None = None,
        jobs: int = -1,
    ) -> None:
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.max_features = max_features
        self.jobs = jobs

    def fit_bag(self, bag: Bag, report: Report, checkpoint: Path | None = None) -> Fitted:  # noqa: ARG002 - seconds, not hours
        """Grow one tree per member; the outputs are scaled for the splits and scaled back in the leaves."""
        from joblib import Parallel, delayed
        from sklearn.tree import DecisionTreeRegressor

        X = np.ascontiguousarray(bag.X, dtype=np.float32)  # what the tree would convert to, once instead of M times
        y = bag.scaling.outputs(bag.y)

        def grow(m: int) -> Any:
            tree = DecisionTreeRegressor(
                max_depth=self.max_depth,
                min_samples_split=self.min_samples_split,
                min_samples_leaf=self.min_samples_leaf,
                max_features=self.max_features,
                random_state=int(np.random.default_rng([bag.seed, m, TIES]).integers(2**31)),
            )
            # A row drawn twice counts twice: the same tree as from the repeated rows, on two thirds of the memory.
            counts = np.bincount(bag.rows[m], minlength=len(X)).astype(float)
            return tree.fit(X, y, sample_weight=counts)

        members, total = [], len(bag.rows)
        # Threads: scikit-learn releases the lock while it grows a tree.
        grown: Any = Parallel(n_jobs=self.jobs, prefer="threads", return_as="generator")(
            delayed(grow)(m) for m in range(total)
        )
        for tree in grown:
            members.append(tree)
            report(Progress("trees", len(members), total, f"{tree.tree_.node_count} nodes"))
        return Fitted(compile_trees(members, bag.scaling.y_mean, bag.scaling.y_scale))


def compile_trees(
    trees: list[Any], y_mean: NDArray[np.float64] | float = 0.0, y_scale: NDArray[np.float64] | float = 1.0
) -> CompiledTrees:
    """Flatten fitted `DecisionTreeRegressor`s; leaf outputs become y_mean + y_scale·value.

    A float32 x is at most the double threshold exactly if it is at most that threshold rounded down to float32, so the
    thresholds are stored rounded down and no decision changes.
    """
    roots, feature, threshold, left, right, values, start = [], [], [], [], [], [], 0
    for member in trees:
        tree = member.tree_
        leaf = tree.children_left < 0
        roots.append(start)
        feature.append(np.where(leaf, -1, tree.feature))
        threshold.append(np.where(leaf, 0.0, tree.threshold))
        left.append(np.where(leaf, -1, tree.children_left + start))
        right.append(np.where(leaf, -1, tree.children_right + start))
        values.append(tree.value[:, :, 0][leaf])
        start += tree.node_count
    features, lefts, exact = np.concatenate(feature), np.concatenate(left), np.concatenate(threshold)
    rounded = exact.astype(np.float32)
    above = rounded > exact
    rounded[above] = np.nextafter(rounded[above], np.float32(-np.inf))
    table, row = np.unique(y_mean + y_scale * np.concatenate(values), axis=0, return_inverse=True)
    lefts[features < 0] = row.ravel()
    return CompiledTrees(
        np.array(roots, dtype=np.int32),
        features.astype(np.int32),
        rounded,
        lefts.astype(np.int32),
        np.concatenate(right).astype(np.int32),
        np.ascontiguousarray(table),
        int(trees[0].n_features_in_),
    )

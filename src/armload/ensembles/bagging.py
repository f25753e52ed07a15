"""Bagging: several weak learners, each on its own random sample of the rows; their mean is the answer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from armload.ensembles.network import NetworkLearner
from armload.ensembles.progress import Report, reporter
from armload.ensembles.tree import TreeLearner
from armload.ensembles.weak_learner import Learner, draw_bag
from armload.errors import ModelError

KINDS: dict[str, type[Learner]] = {"tree": TreeLearner, "network": NetworkLearner}


Rows = tuple[NDArray[np.float64], NDArray[np.float64]]  # X (N, d) and y (N, k)


class Ensemble(RegressorMixin, BaseEstimator, ABC):
    """What every ensemble shares: checked input, prediction through its compiled members.

    Subclasses implement `_train`, which sets `compiled_`: a `Compiled`, the members without the libraries that trained
    them.
    """

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        X_val: ArrayLike | None = None,
        y_val: ArrayLike | None = None,
        *,
        progress: bool | Report | None = None,
        checkpoint: str | PathLike[str] | None = None,
    ) -> Self:
        """Train the members.

        Args:
            X: (N, d) features; for a payload model, rows of (t, q, dq, tau).
            y: (N, k) or (N,) outputs; for a payload model, phi.
            X_val, y_val: validation rows; they stop the networks' training. Trees do not use them.
            progress: True for a bar, or a function called with a `Progress`.
            checkpoint: a file (.npz) to which network training is saved every few seconds and when interrupted, and
                from which the same call goes on exactly. It stays when training ends; trees do not use it. An ensemble
                made of several writes one for each: training.npz → training.stage1.npz, …

        Raises:
            ModelError: unknown kind or scale, fewer than one member, a share to hold out that is none, a checkpoint of
                another training, or for two-stage training a y that does not have the ten columns of phi.
        """
        rows, validation = self._checked(X, y, X_val, y_val)
        self._train(rows, validation, progress, Path(checkpoint) if checkpoint else None)
        return self

    @abstractmethod
    def _train(
        self, rows: Rows, validation: Rows | None, progress: bool | Report | None, checkpoint: Path | None
    ) -> None:
        """Train on rows that are checked."""

    @overload
    def predict(self, X: ArrayLike, return_std: Literal[False] = False) -> NDArray[np.float64]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: Literal[True]) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def predict(self, X, return_std=False):
        """Mean of the members (Taie et al. 2024, eq. 8) and, if asked, their sample standard deviation.

        Args:
            X: (N, d).
            return_std: also return how far the members disagree. It is not the error to expect: calibrate it on
                payloads held out before showing an interval.

        Returns:
            (N, k), or (N,) if y was (N,); with return_std, a pair of these.
        """
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        out = self.compiled_.predict(X, return_std=True) if return_std else (self.compiled_.predict(X),)
        out = tuple(a[:, 0] if self.flat_ else a for a in out)
        return out if return_std else out[0]

    def _checked(
        self, X: ArrayLike, y: ArrayLike, X_val: ArrayLike | None, y_val: ArrayLike | None
    ) -> tuple[Rows, Rows | None]:
        """Training and validation rows as float arrays; notes the features and what y is like."""
        checks: dict[str, Any] = {"dtype": np.float64, "multi_output": True, "y_numeric": True}
        check: Any = validate_data  # its stubs know strings only
        rows, outputs = check(self, X, y, **checks)
        self.flat_ = np.ndim(outputs) == 1
        outputs = np.asarray(outputs, dtype=float).reshape(len(rows), -1)
        self.y_mean_, self.y_std_ = outputs.mean(axis=0), outputs.std(axis=0)
        if (X_val is None) != (y_val is None):
            raise ModelError("X_val and y_val go together: give both or neither")
        if X_val is None:
            return (rows, outputs), None
        rows_val, outputs_val = check(self, X_val, y_val, reset=False, **checks)
        outputs_val = np.asarray(outputs_val, dtype=float).reshape(len(rows_val), -1)
        if outputs_val.shape[1] != outputs.shape[1]:
            raise ModelError(f"y_val has {outputs_val.shape[1]} columns: expected {outputs.shape[1]}, as y")
        return (rows, outputs), (rows_val, outputs_val)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags


class OneKind(Ensemble):
    """The settings of an ensemble whose learners are all of one kind; see `BaggingEnsemble`."""

    def __init__(
        self,
        kind: str | Learner = "tree",
        members: int = 5,
        seed: int = 0,
        bootstrap: bool = True,
        scale: str = "standard",
        hold_out: float = 0.15,
    ) -> None:
        self.kind = kind
        self.members = members
        self.seed = seed
        self.bootstrap = bootstrap
        self.scale = scale
        self.hold_out = hold_out


class BaggingEnsemble(OneKind):
    """A bag of trees or networks, as Fig. 3 of Taie et al., RA-L 2024.

    Every member sees its own N of the N training rows, drawn with replacement, and likewise of the validation rows.

    >>> X = np.random.default_rng(0).normal(size=(200, 3))
    >>> ensemble = BaggingEnsemble("tree", members=3, seed=1).fit(X, X @ [[1.0], [2.0], [0.0]])
    >>> mean, spread = ensemble.predict(X[:1], return_std=True)
    >>> mean.shape, bool(abs(mean[0, 0] - X[0] @ [1.0, 2.0, 0.0]) < 1.0)
    ((1, 1), True)

    Args:
        kind: "tree" or "network", or a `TreeLearner` or `NetworkLearner` with other settings (the paper's are the
            defaults).
        members: M; 5 in the paper.
        seed: of every random draw; the same seed and data give the same ensemble.
        bootstrap: False: every member sees every row once (then trees differ only in ties).
        scale: "standard" brings every feature and output to mean 0 and standard deviation 1 for training; "none" trains
            on SI units. Standard is the default because the squared error of kg and of kg·m² cannot be added: in SI
            units the mass is nearly the whole loss, of networks and of the trees' splits alike, and a network's inertia
            ends up further off than the training mean. The paper does not say what it did; that training the inertia
            apart (two stages) gained it up to 99 % suggests "none".
        hold_out: share of the training rows taken for validation where none are given (networks only).

    Attributes:
        compiled_: the fitted members, a `Compiled`.
        epochs_: (M,) epochs each network took; None for trees.
        y_mean_, y_std_: (k,) mean and standard deviation of the training outputs: what is known before any sample.
        losses_: (epochs, M) validation losses in scaled units, NaN once a member stopped; None for trees.
    """

    def _train(
        self, rows: Rows, validation: Rows | None, progress: bool | Report | None, checkpoint: Path | None
    ) -> None:
        learner = as_learner(self.kind)
        for name, least in (("members", 1), ("seed", 0)):
            given = getattr(self, name)
            if not isinstance(given, Integral) or given < least:
                raise ModelError(f"{name} is {given!r}: expected a whole number of at least {least}")
        if not isinstance(self.hold_out, Real) or not 0.0 <= self.hold_out < 1.0:
            raise ModelError(f"hold_out is {self.hold_out!r}: expected a share of the rows, from 0 to less than 1")
        X, y = rows
        bag = draw_bag(
            X,
            y,
            validation if learner.validates else (X[:1], y[:1]),
            members=self.members,
            seed=self.seed,
            bootstrap=self.bootstrap,
            scale=self.scale,
            hold_out=self.hold_out,
        )
        with reporter(progress) as report:
            self.compiled_, self.epochs_, self.losses_ = learner.fit_bag(bag, report, checkpoint)

    @property
    def kind_name(self) -> str:
        """ "tree" or "network"."""
        return as_learner(self.kind).kind


def as_learner(kind: str | Learner) -> Learner:
    """The learner a `kind` names."""
    if isinstance(kind, Learner):
        return kind
    if not isinstance(kind, str) or kind not in KINDS:
        raise ModelError(f"unknown kind of learner {kind!r}: expected one of {', '.join(KINDS)}, or a Learner")
    return KINDS[kind]()

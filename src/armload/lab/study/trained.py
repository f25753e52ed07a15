"""Training an ensemble of the study, and its errors on the rows that were held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armload.lab.dataset import Dataset, Split, split_payloads, split_rows
from armload.lab.study.basis import Basis
from armload.lab.study.spec import Spec

if TYPE_CHECKING:
    from armload.ensembles import BaggingEnsemble, MixedEnsemble, TwoStage

SPLITTING: dict[str | None, Callable[..., Split]] = {"row": split_rows, "payload": split_payloads}
_SIGNALS = ("q", "dq", "tau")  # columns of n joints each, after the time's one


@dataclass(frozen=True)
class Trained:
    """A trained ensemble.

    predict: rows of (t, q, dq, tau) → phi (N, 10), signals that are hidden from it blanked. epochs: of each network;
    None for trees. file_bytes: of its artefact. error: K(x) − phi on the held-out rows (N, 10), payload: of which each
    of them is (N,).
    """

    predict: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    epochs: list[int] | None
    file_bytes: int
    error: NDArray[np.float64]
    payload: NDArray[np.integer]

    @property
    def held_out(self) -> NDArray[np.float64]:
        """Mean absolute error of single samples (10,)."""
        return np.abs(self.error).mean(axis=0)

    def by_payload(self) -> dict[str, NDArray[np.float64]]:
        """For each held-out payload (P, 10): `payloads` mean |K(x) − phi|, `averaged` |mean of K(x) − phi|.

        `averaged` is the error of an answer that is averaged over time; it means something where the payload's whole
        run was held out.
        """
        parts = [self.error[self.payload == k] for k in np.unique(self.payload)]
        return {
            "payloads": np.array([np.abs(part).mean(axis=0) for part in parts]),
            "averaged": np.array([np.abs(part.mean(axis=0)) for part in parts]),
        }


def train(spec: Spec, basis: Basis, progress: bool = False) -> Trained:
    """Train what a cell names on the study's data set; a training that was interrupted goes on from its checkpoint."""
    from armload.ensembles import save_model

    dataset = basis.dataset(spec.sensors, progress)
    split = SPLITTING[spec.split](dataset, spec.seed)
    hidden = [_columns(signal, basis.arm.n) for signal in spec.drop]

    def seen(X: NDArray) -> NDArray:
        X = X.copy()
        for columns in hidden:
            X[:, columns] = 0.0
        return X

    model = _untrained(spec)
    checkpoint = basis.folder / "checkpoints" / f"{spec.name}.npz"
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    data = [a for rows in (split.train, split.validation) for a in (seen(dataset.X[rows]), dataset.y[rows])]
    model.fit(*data, progress=progress, checkpoint=checkpoint)
    file = basis.folder / "models" / f"{spec.name}.safetensors"
    about = {"dataset_hash": dataset.hash, "payloads": dataset.payload[np.r_[split.train, split.validation]]}
    save_model(file, model, arm=basis.arm, motion=basis.motion, notes=spec.name, **about)
    for left in checkpoint.parent.glob(f"{spec.name}.*"):
        left.unlink(missing_ok=True)  # another run of the study may have trained the same
    epochs = None if model.epochs_ is None else np.ravel(model.epochs_).tolist()
    return Trained(lambda X: model.predict(seen(X)), epochs, file.stat().st_size, *_errors(model, seen, dataset, split))


def _columns(signal: str, joints: int) -> slice:
    """Where a signal stands in rows of (t, q, dq, tau)."""
    first = 0 if signal == "t" else 1 + joints * _SIGNALS.index(signal)
    return slice(first, first + (1 if signal == "t" else joints))


def _errors(model: Any, seen: Callable, dataset: Dataset, split: Split) -> tuple[NDArray, NDArray]:
    answers = np.asarray(model.predict(seen(dataset.X[split.test])))
    return answers - dataset.y[split.test], dataset.payload[split.test]


def _untrained(spec: Spec) -> BaggingEnsemble | TwoStage | MixedEnsemble:
    from armload.ensembles import BaggingEnsemble, MixedEnsemble, NetworkLearner, TreeLearner, TwoStage

    network = NetworkLearner(
        hidden=spec.hidden, batch=spec.batch, max_epochs=spec.max_epochs, learning_rate=spec.learning_rate
    )
    tree = TreeLearner(max_depth=spec.max_depth)
    rest: dict[str, Any] = {"members": spec.members, "seed": spec.seed}
    rest["scale"] = "none" if spec.scale == "raw" else "standard"
    if spec.kind == "mixed":
        return MixedEnsemble((tree, network), **rest)
    return (BaggingEnsemble, TwoStage)[spec.stages - 1](network if spec.kind == "network" else tree, **rest)

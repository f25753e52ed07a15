"""The state of a network training between two epochs, and the file from which it goes on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.errors import ModelError, one_line
from armload.runtime.atomic import replacing


class Weights(NamedTuple):
    """y = relu(x·W1 + b1)·W2 + b2 of M members: W1 (M, d, h), b1 (M, h), W2 (M, h, k), b2 (M, k)."""

    W1: Any
    b1: Any
    W2: Any
    b2: Any


Training = tuple[Weights, Weights, Weights, Any]  # weights, Adam's two moments, step count


@dataclass(frozen=True, eq=False)
class TrainingState:
    """A training between two epochs: all that is needed to go on exactly as if never interrupted."""

    epoch: int
    active: NDArray[np.int64]  # members still training
    training: Training  # of the active members
    best: Weights  # of all members
    best_loss: NDArray[np.float64]
    epochs: NDArray[np.int64]
    losses: list[NDArray[np.float64]]

    def save(self, path: Path, key: str) -> None:
        """Write the state, whole or not at all; `key` says which training it is of."""
        weights, first, second, count = self.training
        groups = {"weights": weights, "first": first, "second": second, "best": self.best}
        arrays = {f"{g}_{name}": np.asarray(a) for g, w in groups.items() for name, a in w._asdict().items()}
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(
                file,
                key=np.array(key),
                epoch=np.array(self.epoch),
                active=self.active,
                count=np.asarray(count),
                best_loss=self.best_loss,
                epochs=self.epochs,
                losses=np.array(self.losses).reshape(-1, len(self.epochs)),
                **arrays,  # type: ignore[arg-type]
            )

    @classmethod
    def load(cls, path: Path, key: str) -> TrainingState:
        """The state that `save` wrote.

        Raises:
            ModelError: not a checkpoint, a damaged one, or one of another training.
        """
        try:
            with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
                a = dict(file)
            same = str(a["key"]) == key
            w, first, second, best = (
                Weights(*(a[f"{group}_{name}"] for name in Weights._fields))
                for group in ("weights", "first", "second", "best")
            )
            training = (w, first, second, np.float32(a["count"]))
            losses = list(a["losses"])
            state = cls(int(a["epoch"]), a["active"], training, best, a["best_loss"], a["epochs"], losses)
        except Exception as error:  # a damaged archive can fail anywhere between zip, zlib and the array header
            why = one_line(error)
            raise ModelError(f"{path} is not a training checkpoint ({why}): delete it to start anew") from None
        if not same:
            raise ModelError(
                f"the checkpoint {path} belongs to another training: expected the same data, settings and seed; "
                "delete it or name another file"
            )
        return state

"""Ensembles made of ensembles: two-stage training, and trees and networks together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from armload.ensembles.bagging import BaggingEnsemble, Ensemble, OneKind, Rows, as_learner
from armload.ensembles.compiled import AveragedMembers, StackedOutputs
from armload.ensembles.progress import Report
from armload.ensembles.weak_learner import Learner
from armload.errors import ModelError

STAGES = (slice(0, 4), slice(4, 10))  # (m, m·r) and the inertia


class TwoStage(OneKind):
    """Two ensembles, one for (m, m·r) and one for the inertia: "two-stage training" of Taie et al. 2024, Section IV.

    Both stages draw the same rows: the model equals a `BaggingEnsemble` with the same seed on each group of columns.

    Args:
        kind, members, seed, bootstrap, scale, hold_out: of both ensembles; see `BaggingEnsemble`.

    Attributes:
        stages_: the two fitted ensembles.
        compiled_: their members with the outputs of both stages side by side.
    """

    def _train(
        self, rows: Rows, validation: Rows | None, progress: bool | Report | None, checkpoint: Path | None
    ) -> None:
        X, y = rows
        if y.shape[1] != 10:
            raise ModelError(f"y has {y.shape[1]} column(s): two-stage training expects the ten of phi")
        X_val, y_val = validation or (None, None)
        self.stages_ = [
            BaggingEnsemble(self.kind, self.members, self.seed, self.bootstrap, self.scale, self.hold_out).fit(
                X,
                y[:, columns],
                X_val,
                None if y_val is None else y_val[:, columns],
                progress=progress,
                checkpoint=_part_checkpoint(checkpoint, f"stage{k}"),
            )
            for k, columns in enumerate(STAGES, start=1)
        ]
        self.compiled_ = StackedOutputs([stage.compiled_ for stage in self.stages_])

    @property
    def epochs_(self) -> np.ndarray | None:
        """(2·M,) epochs of the networks, stage by stage; None for trees."""
        return _epochs(self.stages_)

    @property
    def kind_name(self) -> str:
        """Kind and stages, such as "two-stage tree"."""
        return f"two-stage {as_learner(self.kind).kind}"


class MixedEnsemble(Ensemble):
    """Trees and networks in one ensemble, all members averaged alike: the hybrid the paper's Section VI proposes.

    Args:
        kinds: the kinds of learners; `members` of each.
        members, seed, bootstrap, scale, hold_out: see `BaggingEnsemble`.

    Attributes:
        parts_: the fitted ensemble of each kind.
        compiled_: all their members.
    """

    def __init__(
        self,
        kinds: Sequence[str | Learner] = ("tree", "network"),
        members: int = 5,
        seed: int = 0,
        bootstrap: bool = True,
        scale: str = "standard",
        hold_out: float = 0.15,
    ) -> None:
        self.kinds = kinds
        self.members = members
        self.seed = seed
        self.bootstrap = bootstrap
        self.scale = scale
        self.hold_out = hold_out

    def _train(
        self, rows: Rows, validation: Rows | None, progress: bool | Report | None, checkpoint: Path | None
    ) -> None:
        if not self.kinds:
            raise ModelError("the kinds of a mixed ensemble are none: expected at least one, such as 'tree'")
        self.parts_ = [
            BaggingEnsemble(kind, self.members, self.seed, self.bootstrap, self.scale, self.hold_out).fit(
                *rows, *(validation or ()), progress=progress, checkpoint=_part_checkpoint(checkpoint, f"part{k}")
            )
            for k, kind in enumerate(self.kinds, start=1)
        ]
        self.compiled_ = AveragedMembers([part.compiled_ for part in self.parts_])

    @property
    def epochs_(self) -> np.ndarray | None:
        """Epochs of the networks among the members; None without networks."""
        return _epochs(self.parts_)

    @property
    def kind_name(self) -> str:
        """The kinds, such as "tree + network"."""
        return " + ".join(as_learner(kind).kind for kind in self.kinds)


def _epochs(parts: Sequence[BaggingEnsemble]) -> np.ndarray | None:
    found = [part.epochs_ for part in parts if part.epochs_ is not None]
    return np.concatenate(found) if found else None


def _part_checkpoint(checkpoint: Path | None, part: str) -> Path | None:
    """The checkpoint of one part: training.npz → training.stage1.npz."""
    return None if checkpoint is None else checkpoint.with_name(f"{checkpoint.stem}.{part}{checkpoint.suffix}")

"""A cell of the study: one method, trained and measured in one way, with its result in one JSON file.

A finished cell is never computed again: its file carries a key made of everything it depends on. So a study that takes
hours may stop at any time, on any machine, and go on.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from armload.atomic import replacing
from armload.errors import DatasetError

FORMAT = 2  # of a cell's file; a change makes every cell unfinished


@dataclass(frozen=True)
class Spec:
    """What a cell is.

    kind: "tree", "network", "mixed" or "benchmark" (a least-squares method or a baseline, named by `method`).
    stages: 1 or 2. scale: "raw" (SI units, as the paper seems to) or "standard". split: "row" or "payload"; None where
    nothing is trained. sensors: of the training data, "ideal" or "panda". members, max_epochs, max_depth, hidden,
    batch, learning_rate: the learner's. drop: signals hidden from it ("t", "tau"). ablation: the table it belongs to;
    None: the main one.
    """

    kind: str
    method: str = ""
    stages: int = 1
    scale: str = "raw"
    split: str | None = None
    sensors: str = "ideal"
    seed: int = 0
    members: int = 5
    max_epochs: int = 1000
    max_depth: int | None = None
    hidden: int = 500
    batch: int = 200
    learning_rate: float = 1e-3
    drop: tuple[str, ...] = field(default=())
    ablation: str | None = None

    @property
    def name(self) -> str:
        """Unique and readable; the file's stem."""
        if self.kind == "benchmark":
            split = f"-{self.split}" if self.split else ""
            return f"benchmark-{self.method}{split}-s{self.seed}"
        parts = [self.kind, f"{self.stages}stage", self.scale, str(self.split), self.sensors, f"s{self.seed}"]
        usual = Spec(self.kind)
        if self.kind != "tree":
            parts += [f"cap{self.max_epochs}"] if self.max_epochs != usual.max_epochs else []
            for short, name in (("h", "hidden"), ("b", "batch"), ("lr", "learning_rate")):
                parts += [f"{short}{getattr(self, name):g}"] if getattr(self, name) != getattr(usual, name) else []
        parts += [f"depth{self.max_depth}"] if self.max_depth is not None else []
        parts += [f"m{self.members}"] if self.members != usual.members else []
        parts += [f"without-{signal}" for signal in self.drop]
        return "-".join(parts)

    def key(self, basis: str) -> str:
        """SHA-256 of the specification and of what it is measured on (`Basis.fingerprint`).

        Which table a cell stands in changes nothing about its numbers.
        """
        text = json.dumps([FORMAT, basis, asdict(replace(self, ablation=None))], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def load_cells(folder: str | Path) -> dict[str, dict[str, Any]]:
    """The finished cells in a folder, by name.

    Raises:
        DatasetError: a file that is not a cell.
    """
    cells = {}
    for path in sorted(Path(folder).glob("*.json")):
        try:
            cell = json.loads(path.read_text(encoding="utf-8"))
            cells[cell["name"]] = cell
        except (OSError, ValueError, KeyError, TypeError):
            raise DatasetError(f"{path} is not a cell of the study: delete it, and it will be measured again") from None
    return cells


def save_cell(folder: str | Path, cell: dict[str, Any]) -> Path:
    """Write a finished cell; the file appears whole or not at all."""
    path = Path(folder) / f"{cell['name']}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(cell, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path

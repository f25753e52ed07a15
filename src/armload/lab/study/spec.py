"""A cell of the study: one method, trained and measured in one way, its result in one file (`armload.lab.cells`)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace

from armload.lab.cells import key_of

SPLITS = ("row", "payload")  # the paper's, and the one that keeps whole payloads from the training
# protocols of the test payload: on the nominal arm, on arms that differ from it as real ones do, on a real log
NOMINAL, REAL, SEMI_REAL = "test_payload_nominal", "test_payload_real_like", "test_payload_semi_real"
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
        return "-".join(["reading"] * (self.ablation == "reading") + parts)

    def key(self, basis: str) -> str:
        """SHA-256 of the specification and of what it is measured on (`Basis.fingerprint`).

        Which table a cell stands in changes nothing about its numbers.
        """
        return key_of(FORMAT, basis, asdict(replace(self, ablation=None)))

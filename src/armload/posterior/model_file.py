"""A trained hybrid in one file: what payloads are like, and how far a log's evidence can be trusted.

safetensors with JSON in its header, nothing in it is executed when it is read.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm, from_frame, link_fingerprint, prefixed_frame
from armload.ensembles.artefact import from_structure, to_structure
from armload.errors import ModelError
from armload.posterior.calibration import COVERAGE, Calibration
from armload.posterior.evidence import KINDS, TRAITS
from armload.posterior.payload_prior import MixturePrior
from armload.runtime.tensor_file import TensorFile

# format 1: the widths scaled the torque's gain too; 2: whether they were checked stood in the provenance
_FILE = TensorFile("armload-hybrid", 3, "hybrid model", "train", "armload train --method hybrid", unsigned=True)
# arms of the catalogue whose model is part of the package
SHIPPED = ("panda", "fr3", "ur3e", "ur5", "ur5e", "ur10", "ur10e", "ur16e", "ur20", "iiwa7", "iiwa14", "gen3", "xarm7")
ENOUGH = 1000  # episodes: the share of a parameter's intervals that hold is then within 1.5 points of what is said


@dataclass(frozen=True)
class Training:
    """What a model was trained on, and how well the intervals of its kind held.

    population, episodes, seed: of the simulated episodes, see `train_hybrid`.
    pooled_coverage: share of the held-out truths, of all parameters, times and episodes, inside their 95 % interval.
    """

    population: str
    episodes: int
    seed: int
    pooled_coverage: float

    @property
    def calibrated(self) -> bool:
        """Whether 93–97 % of what was held out lay inside the intervals, and episodes enough set their widths.

        Of few episodes the share held out lies near 95 %, too: their folds are judged by each other.
        """
        return abs(self.pooled_coverage - COVERAGE) <= 0.02 and self.episodes >= ENOUGH


@dataclass(frozen=True, eq=False)
class HybridModel:
    """The learned parts of the hybrid.

    Args:
        prior: over the payloads.
        calibration: of the evidence and of the widths.
        arm_name, arm_fingerprint, frame: of its arm (`link_fingerprint`); the prior is about that frame.
        provenance: what else is known of its training, for people.
        training: what it was trained on and how well it held; None: not checked.
    """

    prior: MixturePrior
    calibration: Calibration
    arm_name: str
    arm_fingerprint: str
    frame: str
    n: int
    provenance: dict[str, Any]
    training: Training | None = None

    @property
    def calibrated(self) -> bool:
        """Whether the training has shown that the intervals hold (`Training.calibrated`)."""
        return self.training is not None and self.training.calibrated

    def into_frame(self, arm: Arm) -> NDArray[np.float64] | None:
        """T (10, 10): parameters about the arm's frame from those about the model's; None where they are the same.

        Raises:
            ModelError: the model was trained for another arm, whatever the arm's frame, base and hand.
        """
        flange = prefixed_frame(arm, self.frame)
        if arm.n != self.n or flange is None:
            raise ModelError(f"the hybrid was trained for {self.arm_name}: {arm.name} is another arm; train one for it")
        if link_fingerprint(replace(arm, frame=flange, attached=None)) != self.arm_fingerprint:
            raise ModelError(
                f"the hybrid was trained for {self.arm_name}: {arm.name} has other links; train one for it with "
                "`armload train --method hybrid`"
            )
        if arm.frame == flange:
            return None
        return from_frame(arm, flange)

    def prior_for(self, arm: Arm) -> MixturePrior:
        """The payload prior about the frame of an arm. Raises as `into_frame`."""
        T = self.into_frame(arm)
        return self.prior if T is None else self.prior.moved(T)

    def save(self, path: str | PathLike[str]) -> Path:
        """Write one .safetensors file; it appears whole or not at all.

        Raises:
            ModelError: the file cannot be written.
        """
        prior, calibration = self.prior, self.calibration
        tensors = {
            "weights": prior.weights,
            "means": prior.means,
            "covariances": prior.covariances,
            "times": calibration.times,
            "widths": calibration.widths,
        }
        header = {
            "arm": {"name": self.arm_name, "fingerprint": self.arm_fingerprint, "frame": self.frame, "joints": self.n},
            "families": list(prior.families),
            "traits": list(TRAITS),
            "level": calibration.level,
            "light": calibration.light,
            "bag": None if calibration.bag is None else to_structure(calibration.bag, "bag.", tensors),
            "training": None if self.training is None else asdict(self.training),
            "provenance": self.provenance,
        }
        path = Path(path)
        _FILE.write(path, tensors, header)
        return path

    @classmethod
    def load(cls, path: str | PathLike[str]) -> HybridModel:
        """Read what `save` wrote.

        Raises:
            ModelError: missing, damaged or foreign file, or one of another armload.
        """
        return _FILE.read(Path(path), partial(_model, path))

    @staticmethod
    def wrote(path: str | PathLike[str]) -> bool:
        """Whether a file is a hybrid, by its header."""
        return _FILE.wrote(Path(path))

    @staticmethod
    def shipped(arm: Arm) -> Path | None:
        """The file of the model that is part of armload for an arm (`SHIPPED`), there or not; None: there is none."""
        return Path(__file__).parent / "models" / f"{arm.known_as}.safetensors" if arm.known_as in SHIPPED else None


def _model(path: str | PathLike[str], tensors: dict[str, NDArray], header: dict[str, Any]) -> HybridModel:
    if header["traits"] != list(TRAITS):
        raise ModelError(f"{path} belongs to another version of armload: train it again")
    arm = header["arm"]
    bag = None if header["bag"] is None else from_structure(header["bag"], "bag.", tensors)
    prior = MixturePrior(tensors["weights"], tensors["means"], tensors["covariances"], tuple(header["families"]))
    times, widths = tensors["times"], tensors["widths"]
    if widths.shape != (len(KINDS), len(times), 10) or not np.all((widths > 0) & np.isfinite(widths)):
        raise ValueError(f"widths of shape {widths.shape}, expected {len(KINDS)} × {len(times)} × 10 positive ones")
    if not all(np.all(np.isfinite(array)) for array in tensors.values()):
        raise ValueError("numbers that are not finite")
    training, provenance = header["training"], header["provenance"]
    if not isinstance(provenance, dict):
        raise ValueError(f"a provenance that is {provenance!r}")
    light = float(header.get("light", 0.0))  # models before it have one c for all masses
    if not (np.isfinite(light) and light >= 0.0):
        raise ValueError(f"a light mass of {light:g} kg")
    return HybridModel(
        prior,
        Calibration(bag, float(header["level"]), times, widths, light),
        arm["name"],
        arm["fingerprint"],
        arm["frame"],
        int(arm["joints"]),
        provenance,
        None if training is None else _training(training),
    )


def _training(found: dict[str, Any]) -> Training:
    """The training of a header; anything else than its four facts is an error."""
    made = Training(**found)
    if not all(type(value) is kind for value, kind in zip(asdict(made).values(), (str, int, int, float), strict=True)):
        raise ValueError(f"a training of {found}")
    return made

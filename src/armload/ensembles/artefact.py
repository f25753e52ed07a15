"""Saved models: one safetensors file with the members' arrays and, as JSON in its header, where they belong.

Nothing in the file is executed when it is read. The header names the arm, the frame and the motions the model was
trained on, because a learned payload model is valid for these only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.ensembles.compiled import (
    AveragedMembers,
    CombinedEnsembles,
    Compiled,
    CompiledNetworks,
    CompiledTrees,
    StackedOutputs,
)
from armload.ensembles.trained_model import LearnedModel
from armload.errors import ModelError
from armload.inertia import NAMES
from armload.motion import Motion, MotionFingerprint
from armload.recording.columns import column_names
from armload.runtime.tensor_file import TensorFile
from armload.runtime.version import package_versions

if TYPE_CHECKING:
    from armload.ensembles.bagging import Ensemble

_FILE = TensorFile("armload", 1, "model", "train", "armload train")
_LEAVES: dict[str, type[Compiled]] = {"trees": CompiledTrees, "networks": CompiledNetworks}
# as stored in files: not the names of the classes
_BRANCHES: dict[str, type[CombinedEnsembles]] = {"beside": StackedOutputs, "together": AveragedMembers}


def save_model(
    path: str | PathLike[str],
    model: Ensemble,
    *,
    arm: Arm,
    motion: Motion | MotionFingerprint | Sequence[Motion | MotionFingerprint] | None,
    dataset_hash: str,
    payloads: ArrayLike | None = None,
    frame: str | None = None,
    error_std: ArrayLike | None = None,
    notes: str = "",
) -> LearnedModel:
    """Write a fitted ensemble to one .safetensors file and return it as loaded from there.

    Args:
        path: the file; replaced as a whole, or not at all.
        model: a fitted `BaggingEnsemble`, `TwoStage` or `MixedEnsemble` with features (t, q, dq, tau) and ten outputs.
        arm: the arm of the training data.
        motion: the motion, or motions, of the training data, or their fingerprints. None: the model is meant for any
            motion, and no recording is refused for its motion.
        dataset_hash: `Dataset.hash` of the training data.
        payloads: which payloads of that data set any training or validation row is of (`Dataset.payload` of these
            rows). None: unknown; the model is then shown on none of its runs (`LearnedModel.check_new`).
        frame: the payload frame; must be the arm's. Default: the arm's.
        error_std: (10,) root-mean-square error on payloads held out from training (`held_out_error`). None: unknown;
            the model then gives no interval but that of its training payloads.
        notes: anything worth remembering.

    Raises:
        ModelError: the model is not fitted, has other columns, or its errors are none; the frame is not the arm's; the
            file cannot be written.
    """
    compiled: Compiled | None = getattr(model, "compiled_", None)
    if compiled is None:
        raise ModelError(f"{type(model).__name__} is not fitted: call fit before saving it")
    if compiled.n_features != 1 + 3 * arm.n or compiled.n_outputs != 10:
        raise ModelError(
            f"the model maps {compiled.n_features} features to {compiled.n_outputs} outputs: a payload model of "
            f"{arm.name} has {1 + 3 * arm.n} (t, q, dq, tau) and 10"
        )
    if frame not in (None, arm.frame):
        raise ModelError(f"frame is {frame!r}: the arm's payload frame is {arm.frame!r}; set the arm to that frame")
    errors = None if error_std is None else np.asarray(error_std, dtype=float)
    if errors is not None and (errors.shape != (10,) or not np.all(np.isfinite(errors) & (errors >= 0.0))):
        raise ModelError(f"error_std is {errors.tolist()}: expected 10 finite numbers, none below 0")
    motions = motion if isinstance(motion, Sequence) else () if motion is None else (motion,)
    prints = [m if isinstance(m, MotionFingerprint) else MotionFingerprint.of(m) for m in motions]
    tensors: dict[str, NDArray] = {}
    header = {
        "kind": model.kind_name,
        "arm": {"name": arm.name, "fingerprint": arm.fingerprint, "joints": list(arm.joint_names)},
        "frame": arm.frame,
        "motions": [m.to_dict() for m in prints],
        "dataset_hash": dataset_hash,
        "payloads": None if payloads is None else np.unique(np.asarray(payloads, dtype=int)).tolist(),
        "features": column_names(arm.n),
        "phi_mean": model.y_mean_.tolist(),
        "phi_std": model.y_std_.tolist(),
        "error_std": None if errors is None else errors.tolist(),
        "settings": {k: v for k, v in model.get_params().items() if isinstance(v, str | int | float | bool | None)}
        | {"members": compiled.n_members},
        "epochs": None if model.epochs_ is None else model.epochs_.tolist(),
        "versions": package_versions("armload", "numpy", "scikit-learn", "jax"),
        "notes": notes,
        "structure": to_structure(compiled, "", tensors),
    }
    path = Path(path)
    _FILE.write(path, tensors, header)
    return load_model(path)


def load_model(path: str | PathLike[str]) -> LearnedModel:
    """Read a model written by `save_model`.

    Raises:
        ModelError: missing, truncated, altered or foreign file, or one of another armload.
    """
    return _FILE.read(Path(path), partial(_model, Path(path)))


def _model(path: Path, tensors: dict[str, NDArray], header: dict[str, Any]) -> LearnedModel:
    unknown = [kind for kind in _kinds(header["structure"]) if kind not in _LEAVES and kind not in _BRANCHES]
    if unknown:
        raise ModelError(
            f"{path} belongs to another version of armload, its members are {unknown[0]!r}: expected "
            f"{' or '.join(_LEAVES)}; train it again"
        )
    compiled = from_structure(header["structure"], "", tensors)
    arm = header["arm"]
    model = LearnedModel(
        compiled=compiled,
        kind=header["kind"],
        arm_name=arm["name"],
        arm_fingerprint=arm["fingerprint"],
        joint_names=tuple(arm["joints"]),
        frame=header["frame"],
        motions=tuple(MotionFingerprint.from_dict(m) for m in header["motions"]),
        dataset_hash=header["dataset_hash"],
        payloads=None if header.get("payloads") is None else tuple(map(int, header["payloads"])),
        phi_mean=np.array(header["phi_mean"], dtype=float),
        phi_std=np.array(header["phi_std"], dtype=float),
        error_std=None if header["error_std"] is None else np.array(header["error_std"], dtype=float),
        settings=header["settings"],
        epochs=header["epochs"],
        versions=header["versions"],
        notes=header["notes"],
        source=str(path),
    )
    if header["features"] != model.features or compiled.n_features != len(model.features):
        raise ValueError(f"{compiled.n_features} features, named {', '.join(map(str, header['features']))}")
    sizes = {len(x) for x in (model.phi_mean, model.phi_std, model.error_std) if x is not None}
    if sizes | {compiled.n_outputs} != {len(NAMES)}:
        raise ValueError(f"{compiled.n_outputs} outputs")
    return model


def to_structure(compiled: Compiled, prefix: str, tensors: dict[str, NDArray]) -> dict[str, Any]:
    """The tree of parts as plain data; its arrays go to `tensors`, named by their place in the tree."""
    for kind, branch in _BRANCHES.items():
        if isinstance(compiled, branch):
            parts = [to_structure(part, f"{prefix}{k}.", tensors) for k, part in enumerate(compiled.parts)]
            return {"type": kind, "parts": parts}
    kind = next(kind for kind, leaf in _LEAVES.items() if isinstance(compiled, leaf))
    out: dict[str, Any] = {"type": kind}
    for field in fields(compiled):  # type: ignore[arg-type]
        value = getattr(compiled, field.name)
        if isinstance(value, np.ndarray):
            tensors[prefix + field.name] = np.ascontiguousarray(value)
        else:
            out[field.name] = value
    return out


def from_structure(structure: dict[str, Any], prefix: str, tensors: dict[str, NDArray]) -> Compiled:
    """The inverse of `to_structure`."""
    kind = structure["type"]
    if kind in _BRANCHES:
        parts = [from_structure(part, f"{prefix}{k}.", tensors) for k, part in enumerate(structure["parts"])]
        return _BRANCHES[kind](parts)
    leaf = _LEAVES[kind]
    values = {f.name: tensors.get(prefix + f.name, structure.get(f.name)) for f in fields(leaf)}  # type: ignore[arg-type]
    compiled = leaf(**values)
    compiled.validate()
    return compiled


def _kinds(structure: dict[str, Any]) -> list[str]:
    """The types of a tree of parts, its leaves' and its branches'."""
    return [str(structure["type"]), *(kind for part in structure.get("parts", ()) for kind in _kinds(part))]

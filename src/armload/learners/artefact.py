"""Saved models: one safetensors file with the members' arrays and, as JSON in its header, where they belong.

Nothing in the file is executed when it is read. The header names the arm, the frame and the motions the model was
trained on, because a learned payload model answers for these alone.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib.metadata import PackageNotFoundError, version
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload.arms import Arm
from armload.errors import ArmloadError, ModelError
from armload.inertia import NAMES, UNITS
from armload.learners.compiled import Beside, Compiled, CompiledNetworks, CompiledTrees, Together
from armload.motion import Motion, MotionFingerprint
from armload.recording import Recording

if TYPE_CHECKING:
    from armload.learners.bagging import Ensemble

FORMAT = 1
_HEADER = "armload"
_LEAVES: dict[str, type[Compiled]] = {"trees": CompiledTrees, "networks": CompiledNetworks}
_BRANCHES: dict[str, type[Beside] | type[Together]] = {"beside": Beside, "together": Together}


def feature_names(n: int) -> list[str]:
    """The columns of X for n joints: t, q1 … qn, dq1 … dqn, tau1 … taun; t is 0 at the first sample."""
    return ["t", *(f"{signal}{j}" for signal in ("q", "dq", "tau") for j in range(1, n + 1))]


@dataclass(frozen=True, eq=False)
class LearnedModel:
    """A trained ensemble with everything that says for which arm, frame and motions its answers hold.

    compiled: the members. kind: such as "tree" or "two-stage network".
    arm_name, arm_fingerprint, joint_names, frame: the arm it was trained on, and what phi is about.
    motions: fingerprints of the motions it was trained on; empty if it is not tied to any.
    dataset_hash: of the training data. phi_mean, phi_std: (10,) of the training payloads, by rows.
    settings, epochs, versions, notes: how it was trained. source: the file.
    """

    compiled: Compiled
    kind: str
    arm_name: str
    arm_fingerprint: str
    joint_names: tuple[str, ...]
    frame: str
    motions: tuple[MotionFingerprint, ...]
    dataset_hash: str
    phi_mean: NDArray[np.float64]
    phi_std: NDArray[np.float64]
    settings: dict[str, Any]
    epochs: list[int] | None
    versions: dict[str, str]
    notes: str
    source: str

    @property
    def features(self) -> list[str]:
        """Names of the columns of X."""
        return feature_names(len(self.joint_names))

    def predict(self, X: ArrayLike, return_std: bool = False) -> Any:
        """phi (N, 10), and with return_std its spread (N, 10), for rows X (N, 1 + 3n) of (t, q, dq, tau).

        Raises:
            ModelError: X does not have the model's columns.
        """
        X = np.asarray(X, dtype=float)
        if X.ndim != 2 or X.shape[1] != self.compiled.n_features:
            raise ModelError(
                f"X has shape {X.shape}: the model {self.source} expects {self.compiled.n_features} columns "
                f"({self.features[0]}, {self.features[1]} … {self.features[-1]})"
            )
        return self.compiled.predict(X, return_std=True) if return_std else self.compiled.predict(X)

    def check(self, arm: Arm, recording: Recording | None = None) -> None:
        """Whether the model may answer for this arm and, if given, this recording.

        Raises:
            ModelError: another arm, frame, torque channel or motion; the message names what differs.
        """
        model = f"the model {self.source}"
        if arm.name != self.arm_name or arm.n != len(self.joint_names):
            raise ModelError(
                f"{model} was trained on {self.arm_name} ({len(self.joint_names)} joints): it cannot answer for "
                f"{arm.name} ({arm.n} joints); name the right robot or train a model for it"
            )
        if arm.frame != self.frame:
            raise ModelError(
                f"{model} gives parameters about {self.frame!r}: {arm.name} is set to {arm.frame!r}; "
                "use that frame and move the result"
            )
        if arm.fingerprint != self.arm_fingerprint:
            raise ModelError(
                f"{model} was trained on another {self.arm_name}: masses, geometry, gravity or attached tool differ; "
                "use the arm as it was in training or train again"
            )
        if recording is None:
            return
        if recording.n != arm.n:
            raise ModelError(f"{recording.source} has {recording.n} joints: {model} expects {arm.n}")
        if recording.channel != "measured":
            raise ModelError(
                f"{recording.source} holds {recording.channel} torque: {model} was trained on measured torque"
            )
        if self.motions and not any(motion.matches(recording) for motion in self.motions):
            away = min(motion.distance(recording) for motion in self.motions)
            known = ", ".join(f"{motion.name}, {motion.duration:.2f} s" for motion in self.motions[:3])
            raise ModelError(
                f"{recording.source} ({recording.duration:.2f} s) does not follow a motion {model} was trained on "
                f"({known}; rms distance {away:.3g} rad): run "
                "such a motion from its start, or use least squares, which takes any"
            )

    def __str__(self) -> str:
        rows = [
            f"{n:>5} = {m:+.5f} ± {s:.5f} {u}"
            for n, m, s, u in zip(NAMES, self.phi_mean, self.phi_std, UNITS, strict=True)
        ]
        tied = f"{len(self.motions)} motion(s)" if self.motions else "any motion"
        return (
            f"{self.kind} ensemble of {self.compiled.n_members} for {self.arm_name}, {tied}, payload about "
            f"{self.frame}; training payloads:\n" + "\n".join(rows)
        )


def save_model(
    path: str | PathLike[str],
    model: Ensemble,
    *,
    arm: Arm,
    motion: Motion | MotionFingerprint | Sequence[Motion | MotionFingerprint] | None,
    dataset_hash: str,
    frame: str | None = None,
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
        frame: the payload frame; must be the arm's. Default: the arm's.
        notes: anything worth remembering.

    Raises:
        ModelError: the model is not fitted, has other columns, or the frame is not the arm's.
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
    motions = motion if isinstance(motion, Sequence) else () if motion is None else (motion,)
    prints = [m if isinstance(m, MotionFingerprint) else MotionFingerprint.of(m) for m in motions]
    tensors: dict[str, NDArray] = {}
    header = {
        "format": FORMAT,
        "kind": model.kind_name,
        "arm": {"name": arm.name, "fingerprint": arm.fingerprint, "joints": list(arm.joint_names)},
        "frame": arm.frame,
        "motions": [m.to_dict() for m in prints],
        "dataset_hash": dataset_hash,
        "features": feature_names(arm.n),
        "phi_mean": model.y_mean_.tolist(),
        "phi_std": model.y_std_.tolist(),
        "settings": {k: v for k, v in model.get_params().items() if isinstance(v, str | int | float | bool | None)}
        | {"members": compiled.n_members},
        "epochs": None if model.epochs_ is None else model.epochs_.tolist(),
        "versions": _versions(),
        "notes": notes,
        "structure": _take_apart(compiled, "", tensors),
    }
    from safetensors.numpy import save

    header["sha256"] = _digest(header, tensors)
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(save(tensors, {_HEADER: json.dumps(header)}))
        os.replace(part, path)
    except OSError as error:
        raise ModelError(f"the model cannot be written to {path}: {error.strerror}") from None
    return load_model(path)


def load_model(path: str | PathLike[str]) -> LearnedModel:
    """Read a model written by `save_model`.

    Raises:
        ModelError: missing, truncated, altered or foreign file, or one of a newer armload.
    """
    from safetensors import SafetensorError, safe_open

    path = Path(path)
    try:
        with safe_open(path, framework="np") as file:
            text = (file.metadata() or {}).get(_HEADER)
            tensors = {name: np.ascontiguousarray(file.get_tensor(name)) for name in file.keys()}  # noqa: SIM118
    except FileNotFoundError:
        raise ModelError(f"no model at {path}: expected a .safetensors file written by armload") from None
    except (SafetensorError, OSError, ValueError, TypeError) as error:
        raise ModelError(
            f"{path} is not a readable model ({' '.join(str(error).split())}): expected a .safetensors file written by "
            "armload; copy it again"
        ) from None
    if text is None:
        raise ModelError(f"{path} is a safetensors file without armload's header: expected a model armload saved")
    try:
        header = json.loads(text)
        found = header["format"]
        if found != FORMAT:
            raise ModelError(f"{path} has model format {found}: this armload reads {FORMAT}; update armload")
        digest = header.pop("sha256")
        if digest != _digest(header, tensors):
            raise ModelError(f"{path} was altered after it was saved (its SHA-256 differs): copy it again")
        compiled = _put_together(header["structure"], "", tensors)
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
            phi_mean=np.array(header["phi_mean"], dtype=float),
            phi_std=np.array(header["phi_std"], dtype=float),
            settings=header["settings"],
            epochs=header["epochs"],
            versions=header["versions"],
            notes=header["notes"],
            source=str(path),
        )
        if header["features"] != model.features or compiled.n_features != len(model.features):
            raise ValueError(f"{compiled.n_features} features, named {', '.join(map(str, header['features']))}")
        if not compiled.n_outputs == len(model.phi_mean) == len(model.phi_std) == len(NAMES):
            raise ValueError(f"{compiled.n_outputs} outputs")
    except ModelError:
        raise
    except (ArmloadError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ModelError(f"{path} holds a model armload cannot use ({error}): save or copy it again") from None
    return model


def _take_apart(compiled: Compiled, prefix: str, tensors: dict[str, NDArray]) -> dict[str, Any]:
    """The tree of parts as plain data; their arrays go to `tensors`, named by their place."""
    for kind, branch in _BRANCHES.items():
        if isinstance(compiled, branch):
            parts = [_take_apart(part, f"{prefix}{k}.", tensors) for k, part in enumerate(compiled.parts)]
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


def _put_together(structure: dict[str, Any], prefix: str, tensors: dict[str, NDArray]) -> Compiled:
    kind = structure["type"]
    if kind in _BRANCHES:
        parts = [_put_together(part, f"{prefix}{k}.", tensors) for k, part in enumerate(structure["parts"])]
        return _BRANCHES[kind](parts)
    leaf = _LEAVES[kind]
    values = {f.name: tensors.get(prefix + f.name, structure.get(f.name)) for f in fields(leaf)}  # type: ignore[arg-type]
    compiled = leaf(**values)
    compiled.validate()
    return compiled


def _digest(header: dict[str, Any], tensors: dict[str, NDArray]) -> str:
    digest = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for name in sorted(tensors):
        digest.update(f"{name} {tensors[name].dtype} {tensors[name].shape}".encode() + tensors[name].tobytes())
    return digest.hexdigest()


def _versions() -> dict[str, str]:
    out = {}
    for package in ("armload", "numpy", "scikit-learn", "jax"):
        try:
            out[package] = version(package)
        except PackageNotFoundError:
            continue
    return out

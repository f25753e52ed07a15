"""A profile in one file of a few megabytes: safetensors with JSON in its header, nothing in it is executed.

The information is kept as a factor, in units of the prior: with A of the joints' own weights, Ã = √P·A·√P,

    L_j·L_jᵀ = Ã_gg,j + 1,    V_j = L_j⁻¹·Ã_gz,j,    Z = A_zz − Σ_j V_jᵀ·V_j

L and V in single precision, Z in double. A rounded factor is still a factor, so that the information that is read is
one that can be; its rounding is 1e-7 of a square root, where that of A would be 1e-7 of numbers a million times the
prior.
"""

from __future__ import annotations

from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.posterior.profile import Profile, SessionRecord
from armload.posterior.scales import Scales
from armload.regression import JointFeatures
from armload.runtime.one_thread import one_thread
from armload.runtime.tensor_file import TensorFile

_FILE = TensorFile("armload-profile", 1, "profile", "learn", "armload profile", unsigned=True)


def save_profile(profile: Profile, path: str | PathLike[str]) -> Path:
    """Write one file; it appears whole or not at all.

    Raises:
        ModelError: the file cannot be written.
    """
    scales = profile.scales
    tensors = {
        **_factors(profile.A, profile.b, profile.features.size, scales.features),
        "eta": scales.eta,
        "features": scales.features,
        "payloads": scales.payloads,
        "drift": profile.drift,
        "gravity": profile.gravity,
        "poses": profile.poses.astype(np.float32),
    }
    if profile.gain is not None:
        tensors["gain"] = profile.gain
    if profile.gain_joint_std is not None:
        tensors["gain_joint_std"] = profile.gain_joint_std
    if profile.foretold is not None:
        tensors["foretold"] = profile.foretold
    header = {
        "arm": {
            "name": profile.arm_name,
            "fingerprint": profile.fingerprint,
            "frame": profile.frame,
            "joints": profile.n,
        },
        "pose_features": profile.features.pose,
        "velocity_features": profile.features.velocity,
        "repeated": profile.repeated,
        "gain_std": profile.gain_std,
        "attached": profile.attached,
        "sessions": [asdict(session) for session in profile.sessions],
    }
    path = Path(path)
    _FILE.write(path, tensors, header)
    return path


def load_profile(path: str | PathLike[str]) -> Profile:
    """Read what `save_profile` wrote.

    Raises:
        ModelError: missing, damaged or foreign file, or one of another armload.
    """
    return _FILE.read(Path(path), _profile)


def _profile(tensors: dict[str, NDArray], header: dict[str, Any]) -> Profile:
    arm, n = header["arm"], int(header["arm"]["joints"])
    features = JointFeatures(n, int(header["pose_features"]), int(header["velocity_features"]))
    scales = Scales(np.ones((1, n)), tensors["eta"], tensors["features"], tensors["payloads"])
    A, b = _information(tensors, features.size)
    if not all(np.all(np.isfinite(x)) for x in (A, b, *tensors.values())):
        raise ValueError("numbers that are not finite")
    return Profile(
        arm["name"],
        arm["fingerprint"],
        arm["frame"],
        n,
        tensors["gravity"],
        float(header["attached"]),
        features,
        A,
        b,
        scales,
        tensors["drift"],
        float(header["repeated"]),
        tuple(_session(one) for one in header["sessions"]),
        tensors["poses"].astype(float),
        tensors.get("gain"),
        header["gain_std"],
        tensors.get("gain_joint_std"),
        tensors.get("foretold"),
    )


def _session(found: dict[str, Any]) -> SessionRecord:
    made: dict[str, Any] = {name: tuple(x) if isinstance(x, list) else x for name, x in found.items()}
    return SessionRecord(**made)


@one_thread()
def _factors(A: NDArray, b: NDArray, R: int, variance: NDArray) -> dict[str, NDArray]:
    n, c = len(A), A.shape[1] - R
    lower = np.tril_indices(R)
    L32, V32 = np.empty((n, len(lower[0])), np.float32), np.empty((n, R, c), np.float32)
    own = np.empty((n, R))
    Z, z = A[:, :c, :c].sum(axis=0), b[:, :c].sum(axis=0)
    for j in range(n):
        root = np.sqrt(variance[j])
        L = np.linalg.cholesky(root[:, None] * A[j, c:, c:] * root + np.eye(R))
        V = np.linalg.solve(L, root[:, None] * A[j, c:, :c])
        own[j] = np.linalg.solve(L, root * b[j, c:])
        L32[j], V32[j] = L[lower], V
        Z, z = Z - V.T @ V, z - V.T @ own[j]
    return {"factor": L32, "crossed": V32, "own": own, "shared": 0.5 * (Z + Z.T), "vector": z}


@one_thread()
def _information(tensors: dict[str, NDArray], R: int) -> tuple[NDArray, NDArray]:
    """A (n, S, S), b (n, S); what the joints share is put into the first joint's."""
    variance, own = tensors["features"], tensors["own"]
    n, c = len(own), len(tensors["vector"])
    A, b = np.zeros((n, c + R, c + R)), np.zeros((n, c + R))
    A[0, :c, :c], b[0, :c] = tensors["shared"], tensors["vector"]
    for j in range(n):
        L = np.zeros((R, R))
        L[np.tril_indices(R)] = tensors["factor"][j]
        V, root = tensors["crossed"][j].astype(float), np.sqrt(variance[j])
        crossed = L @ V / root[:, None]
        A[j, c:, c:] = (L @ L.T - np.eye(R)) / np.outer(root, root)
        A[j, c:, :c], A[j, :c, c:] = crossed, crossed.T
        b[j, c:] = L @ own[j] / root
        A[0, :c, :c] += V.T @ V
        b[0, :c] += V.T @ own[j]
    return A, b

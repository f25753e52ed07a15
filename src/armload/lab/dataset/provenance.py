"""Where a data set comes from: everything that decides its numbers, as JSON in its folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.errors import DatasetError
from armload.motion import Motion, MotionFingerprint
from armload.payloads import Payload
from armload.runtime.atomic import replacing
from armload.runtime.version import package_versions
from armload.simulation import Sensors, World
from armload.simulation.inverse import TRACKING

FORMAT = "armload data set 1"
SAMPLERS = ("mujoco", "inverse")  # how runs come about: `simulate`, `simulate_inverse`
PROVENANCE_FILE = "provenance.json"
TABLE_FILE = "table.parquet"
RESTORE = "restore it, or remove the folder and build the data set again"  # what is damaged is never written over
_PACKAGES = ("armload", "mujoco", "numpy", "pin", "scipy")  # whose versions can change a simulated number


def provenance_of(
    arm: Arm,
    motions: Sequence[Motion],
    payloads: Sequence[Payload],
    worlds: Sequence[World],
    sensors: Sensors | None,
    rows_per_run: int,
    seed: int,
    sampler: str = SAMPLERS[0],
) -> dict[str, Any]:
    """The provenance of a data set to be built; `sha256` is None until it is finished."""
    how = {} if sampler == SAMPLERS[0] else {"sampler": sampler, "tracking": TRACKING}  # those of before say nothing
    return {
        "format": FORMAT,
        "arm": {
            "name": arm.name,
            "frame": arm.frame,
            "gravity": [float(x) for x in arm.gravity],
            "fingerprint": arm.fingerprint,
        },
        "motions": [
            {
                "name": motion.name,
                "duration": float(motion.duration),
                "rate": rows_per_run / float(motion.duration),
                "fingerprint": MotionFingerprint.of(motion).sha256,
            }
            for motion in motions
        ],
        "payloads": [{"name": payload.name, "phi": [float(x) for x in payload.parameters.phi]} for payload in payloads],
        "worlds": [{"name": world.name, "seed": world.seed, "fingerprint": world.fingerprint} for world in worlds],
        "sensors": None if sensors is None else {f.name: _plain(getattr(sensors, f.name)) for f in fields(sensors)},
        "rows_per_run": rows_per_run,
        **how,
        "seed": seed,
        "versions": package_versions(*_PACKAGES),
        "sha256": None,
    }


def differences(one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """The entries in which two provenances differ, the hash apart."""
    keys = [*one, *(key for key in other if key not in one)]
    return [k for k in keys if k != "sha256" and canonical(one.get(k)) != canonical(other.get(k))]


def canonical(value: Any) -> bytes:
    """One way to write a JSON value."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode()


def read_provenance(folder: Path) -> dict[str, Any]:
    """The provenance of a data set's folder.

    Raises:
        DatasetError: no folder, no data set in it, or its provenance cannot be read.
    """
    path = folder / PROVENANCE_FILE
    try:
        provenance = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        raise DatasetError(f"{folder} is not a data set: expected a folder with {PROVENANCE_FILE}") from None
    except (OSError, ValueError, RecursionError) as error:
        raise DatasetError(f"{path} cannot be read ({error}): {RESTORE}") from None
    if not isinstance(provenance, dict) or provenance.get("format") != FORMAT:
        raise DatasetError(f"{path} is not the provenance of a data set of this version: expected format {FORMAT!r}")
    return provenance


def write_provenance(folder: Path, provenance: dict[str, Any]) -> None:
    """Write the provenance, whole or not at all."""
    with replacing(folder / PROVENANCE_FILE) as temporary:
        temporary.write_text(json.dumps(provenance, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value

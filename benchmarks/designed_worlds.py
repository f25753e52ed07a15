"""The worlds of `designed_motions.py` that are measured, in a file that is committed, so that later runs add to them.

A world costs ten seconds of a processor, most of them the estimator's. Of each candidate in each world the file keeps
what the tables need, to three digits; with which code it was measured (the simulator's, the rows' and the posterior's),
and a hash of the motions, to a milliradian: a candidate whose motions have changed is measured anew, one whose code has
is not, unless that is asked for.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from script import RESULTS

from armload.motion import Motion
from armload.runtime.atomic import replacing

FILE = RESULTS / "designed_motions_worlds.json"
_RATE = 50.0  # [Hz] at which motions are compared
_ROUND = 1e-3  # [rad]
Worlds = dict[str, dict[str, Any]]  # "ARM CANDIDATE SEED"


def in_three(off: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean magnitudes of mass, moments and inertias (..., 3) of (..., 10)."""
    off = np.abs(off)
    return np.stack([off[..., 0], off[..., 1:4].mean(axis=-1), off[..., 4:].mean(axis=-1)], axis=-1)


def motion_hash(*motions: tuple[Motion | None, float]) -> str:
    """Of motions and how long they are run [s]; None: another in each world."""
    digest = hashlib.sha256()
    for motion, lasting in motions:
        t = np.arange(round(lasting * _RATE)) / _RATE
        q = np.zeros(0) if motion is None else motion(t)[0]
        digest.update(np.round(q / _ROUND).astype(np.int64).tobytes())
    return digest.hexdigest()[:12]


def compact(cell: dict[str, Any], code: str, motions: str) -> dict[str, Any]:
    """What the tables need of one candidate in one world: errors (T, 3), and at the end how far the centre is off, the
    bound over the half-width given (10,), and how many of ten errors are within the bound."""
    error, width, bound = (np.array(cell[name]) for name in ("errors", "half_width", "bound"))
    return {
        "three": _short(in_three(error)),
        "centre": _short(cell["centre"][-1]),
        "predicted": _short(bound[-1] / width[-1]),
        "within": int((np.abs(error[-1]) <= bound[-1]).sum()),
        "code": code[:12],
        "motions": motions,
    }


def read() -> Worlds:
    """All that was kept."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}


def write(worlds: Worlds) -> None:
    """A line for each candidate in each world."""
    lines = (f"{json.dumps(name)}:{json.dumps(worlds[name], separators=(',', ':'))}" for name in sorted(worlds))
    with replacing(FILE) as temporary:
        temporary.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def of_now(worlds: Worlds, hashes: dict[str, str], good: Callable[[dict[str, Any]], bool]) -> Worlds:
    """Those whose motions are the ones of now, by the hash of each "ARM CANDIDATE"; and which are good."""
    return {
        name: world
        for name, world in worlds.items()
        if world["motions"] == hashes.get(name.rsplit(" ", 1)[0]) and good(world)
    }


def _short(x: Any) -> Any:
    each = [float(f"{value:.3g}") for value in np.ravel(x)]
    return each[0] if np.ndim(x) == 0 else np.reshape(each, np.shape(x)).tolist()

"""Payloads as JSON files, one payload a file.

    {"format": "armload-payload/1", "name": "hand", "frame": "panda_link8",
     "phi": [m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz],
     "mass": 0.73, "com": [x, y, z], "inertia_com": [[...], [...], [...]],
     "boxes": [{"size": [x, y, z], "centre": [x, y, z], "mass": 0.73}],
     "std": {"mass": 0.01, "com": 0.002, "inertia": 0.1}}

    {"mesh": "gear.stl", "scale": 0.001, "mass": 0.4, "translation": [x, y, z], "rotation": [[...], [...], [...]],
     "frame": "tool0", "std": {...}}

phi or the three (mass, com, inertia_com) are enough, SI units; phi is about the frame's origin, inertia_com about the
centre of mass. std says how well they are known (`Uncertainty`): a drawing is never quite what was built. Of what only
mass and com are known, the inertia is assumed (`Payload.without_inertia`), and users of it say so. Everything else is
optional, and other keys are ignored but for those that are nearly one of these. A mesh is a closed surface in a file
beside this one, of one density: its mass or density and where it is are as of `from_mesh`. The JSON result of an
identification reads as the payload it found, as well known as its `covariance` says (`Measured`), unless std says it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.errors import ArmloadError, PayloadError
from armload.inertia import NAMES, InertialParameters
from armload.payloads.mesh import from_mesh, require_no_drawing
from armload.payloads.payload import Box, Payload, require_consistent
from armload.payloads.uncertainty import Measured, Uncertainty
from armload.payloads.units import require_kilogram_square_metres, require_metres
from armload.runtime.atomic import replacing

FORMAT = "armload-payload/1"
NOTHING = "nothing"  # what options and settings call no payload, in the place of a file
_TRIPLE = ("mass", "com", "inertia_com")
_OF_MESH = ("mesh", "scale", "density", "translation", "rotation")
_KEYS = ("format", "name", "frame", "phi", *_TRIPLE, "boxes", "std", *_OF_MESH)
_ALIKE = 0.7  # of two words (difflib): "inertia" is meant as "inertia_com", a comment is not
# Where a file gives phi and (mass, com, inertia_com) they may differ by printed digits, not by an edit.
_AGREE = {"mass": 1e-3, "com": 1e-3, "inertia_com": 1e-4}  # [kg, m, kg·m²]


def read_payload(path: str | Path) -> Payload:
    """The payload in a JSON file: one of `write_payload`, written by hand, or a saved result of `armload identify`.

    Raises:
        PayloadError: the file is missing or no JSON, lacks parameters, contradicts itself, or is of no possible body.
    """
    return payload_from(read_content(path), path)


def payload_from(content: dict[str, Any], path: str | Path) -> Payload:
    """The payload in the content of a file (`read_content`), for those who read more of it; path: for the errors."""
    path = Path(path)
    _require_known(content, path)
    try:
        if content.get("mesh") is not None:
            return _of_mesh(content, path)
        if alone := [key for key in _OF_MESH if content.get(key) is not None]:
            raise PayloadError(f"payload file {path} has {alone[0]}, but no mesh: name the mesh, or leave it out")
        given = {key for key in ("phi", *_TRIPLE) if content.get(key) is not None}
        if given == {"mass", "com"}:
            return _without_inertia(content, path)
        parameters = _parameters(content, path)
        require_consistent(parameters, f"the payload in {path}")
        require_kilogram_square_metres(parameters, f"payload file {path}")
        name, std = _text(content, "name", path) or path.stem, _uncertainty(content, path)
        return Payload(name, parameters, _boxes(content, path), uncertainty=std, measured=_measured(content, path))
    except PayloadError:
        raise
    except ArmloadError as error:  # a matrix that is not symmetric, say: name the file
        raise PayloadError(f"payload file {path}: {error}") from None


def _require_known(content: dict[str, Any], path: Path) -> None:
    """Refuse a key that is nearly one of a payload's: what it says would be left out without a word."""
    if "interval" in content:  # an identification has more
        return
    for key in content:
        near = [] if key in _KEYS else get_close_matches(key.lower(), _KEYS, 1, _ALIKE)
        if near:
            raise PayloadError(f"payload file {path} has a key {key!r}: expected {near[0]!r}; rename or remove it")


def _of_mesh(content: dict[str, Any], path: Path) -> Payload:
    twice = [key for key in ("phi", "com", "inertia_com") if content.get(key) is not None]
    if twice:
        raise PayloadError(
            f"payload file {path} has a mesh and {twice[0]}: a mesh says the latter; leave one of both out"
        )

    def number(key: str) -> float | None:
        return None if content.get(key) is None else float(_numbers(content[key], (), key, path))

    def numbers(key: str, *shape: int) -> NDArray[np.float64] | None:
        return None if content.get(key) is None else _numbers(content[key], shape, key, path)

    scale = number("scale")
    drawn = from_mesh(
        path.parent / (_text(content, "mesh", path) or ""),
        density=number("density"),
        mass=number("mass"),
        scale=1.0 if scale is None else scale,
        rotation=numbers("rotation", 3, 3),
        translation=numbers("translation", 3),
    )
    require_metres(drawn.parameters.com, f"payload file {path}")
    placed = InertialParameters(drawn.parameters.phi, _text(content, "frame", path))
    name = _text(content, "name", path) or path.stem
    return replace(drawn, name=name, parameters=placed, uncertainty=_uncertainty(content, path))


def _without_inertia(content: dict[str, Any], path: Path) -> Payload:
    mass, com = _numbers(content["mass"], (), "mass", path), _numbers(content["com"], (3,), "com", path)
    require_metres(com, f"payload file {path}")
    if not mass > 0:
        raise PayloadError(f"the payload in {path} has a mass of {float(mass):g} kg: expected a mass above 0")
    made = Payload.without_inertia(
        _text(content, "name", path) or path.stem, float(mass), com, _text(content, "frame", path)
    )
    return replace(made, boxes=_boxes(content, path), uncertainty=_uncertainty(content, path))


def write_payload(path: str | Path, payload: Payload) -> None:
    """Write a payload as JSON, complete or not at all; `read_payload` gives back the same phi to the last bit.

    Of one whose inertia is not known only mass and centre of mass are written: an assumption is no knowledge.

    Raises:
        PayloadError: the file cannot be written.
    """
    p = payload.parameters
    content: dict[str, Any] = {
        "format": FORMAT,
        "name": payload.name,
        "frame": p.frame,
        "phi": p.phi.tolist(),
        "mass": p.mass,
    }
    if p.mass > 0:  # nothing at all has no centre of mass
        content |= {"com": p.com.tolist(), "inertia_com": p.inertia_com.tolist()}
    if not payload.inertia_known:
        del content["phi"], content["inertia_com"]
    if payload.uncertainty != Uncertainty():
        content["std"] = asdict(payload.uncertainty)
    if (found := payload.measured) is not None:
        interval = "calibrated" if found.calibrated else "approximate"
        content |= {"covariance": found.covariance.tolist(), "interval": interval}
    if payload.boxes:
        content["boxes"] = [{"size": b.size, "centre": b.centre, "mass": b.mass} for b in payload.boxes]
    try:
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise PayloadError(f"payload file {path} cannot be written: {error.strerror or error}") from None


def read_content(path: str | Path) -> dict[str, Any]:
    """The JSON object in a payload file, which is read once: it may be a pipe.

    Raises:
        PayloadError: the file is missing, or holds no JSON object.
    """
    path = Path(path)
    require_no_drawing(path)
    if path.is_dir():
        raise PayloadError(f"payload file {path} is a folder: expected a JSON file")
    try:
        text = path.read_text(encoding="utf-8-sig")  # some editors begin a text with a mark
    except FileNotFoundError:
        raise PayloadError(f"payload file {path} does not exist: expected a JSON file with a payload") from None
    except UnicodeDecodeError:
        raise PayloadError(f"payload file {path} is not text: expected JSON in UTF-8") from None
    except (OSError, ValueError) as error:  # ValueError: a name with a zero in it
        raise PayloadError(f"payload file {path} cannot be read: {getattr(error, 'strerror', error)}") from None
    if not text.strip():
        raise PayloadError(f"payload file {path} is empty: expected JSON with phi, or mass, com and inertia_com")
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise PayloadError(
            f"payload file {path} is not JSON: {error.msg} at line {error.lineno}; of a log, first make one with "
            "`armload identify LOG --robot NAME --out payload.json`"
        ) from None
    except (ValueError, RecursionError) as error:
        raise PayloadError(f"payload file {path} cannot be read as JSON: {error}") from None
    if not isinstance(content, dict):
        raise PayloadError(f"payload file {path} holds a JSON {type(content).__name__}: expected an object with keys")
    return content


def _parameters(content: dict[str, Any], path: Path) -> InertialParameters:
    frame = _text(content, "frame", path)
    missing = [key for key in _TRIPLE if content.get(key) is None]
    from_triple = None
    if not missing:
        mass, com, inertia = (
            _numbers(content[k], s, k, path) for k, s in zip(_TRIPLE, ((), (3,), (3, 3)), strict=True)
        )
        from_triple = InertialParameters.from_com(float(mass), com, inertia, frame)
    if content.get("phi") is None:
        if from_triple is None:
            found = ", ".join(map(str, content)) or "no keys at all"
            raise PayloadError(
                f"payload file {path} lacks {' and '.join(missing)} (found: {found}): expected phi, or mass and "
                "com, with inertia_com where it is known"
            )
        parameters = from_triple
    else:
        parameters = InertialParameters(_numbers(content["phi"], (10,), "phi", path), frame)
        if from_triple is not None and parameters.mass > 0:
            _require_agreement(parameters, from_triple, path)
    if parameters.mass > 0:
        require_metres(parameters.com, f"payload file {path}")
    return parameters


def _require_agreement(phi: InertialParameters, triple: InertialParameters, path: Path) -> None:
    for key, tolerance in _AGREE.items():
        if triple.mass <= 0 or np.any(np.abs(getattr(phi, key) - getattr(triple, key)) > tolerance):
            raise PayloadError(
                f"payload file {path} contradicts itself: its {key} differs from that of its phi; correct one of "
                "them, or remove phi"
            )


def _numbers(value: Any, shape: tuple[int, ...], key: str, path: Path) -> NDArray[np.float64]:
    kinds = {(): "a number", (3,): "3 numbers", (10,): "10 numbers", (3, 3): "3 rows of 3 numbers"}
    expected = kinds.get(shape, "10 rows of 10 numbers")
    leaves = _leaves(value)
    if any(leaf is None for leaf in leaves) and len(leaves) == 10 and shape == (10,):
        names = ", ".join(n for n, leaf in zip(NAMES, leaves, strict=True) if leaf is None)
        raise PayloadError(f"payload file {path} leaves {names} undetermined: a payload needs all ten parameters")
    try:
        if any(isinstance(leaf, bool) or not isinstance(leaf, int | float) for leaf in leaves):
            raise ValueError
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        numbers = np.full(1, np.nan)
    if numbers.shape != shape or not np.all(np.isfinite(numbers)):
        shown = json.dumps(value)
        shown = shown if len(shown) <= 80 else shown[:77] + "..."
        raise PayloadError(f"payload file {path}: {key} is {shown}, expected {expected}, finite, in SI units")
    return numbers


def _leaves(value: Any) -> list[Any]:
    if not isinstance(value, list):
        return [value]
    return [leaf for item in value for leaf in (item if isinstance(item, list) else [item])]


def _text(content: dict[str, Any], key: str, path: Path) -> str | None:
    value = content.get(key)
    if value is not None and not isinstance(value, str):
        raise PayloadError(f"payload file {path}: {key} is {json.dumps(value)[:80]}, expected text")
    return value


def _uncertainty(content: dict[str, Any], path: Path) -> Uncertainty:
    std = content.get("std")
    if std is None:
        return Uncertainty()
    if not isinstance(std, dict) or not set(std) <= {"mass", "com", "inertia"}:
        raise PayloadError(
            f"payload file {path}: std is {json.dumps(std)[:80]}, expected an object with some of mass [kg], com [m] "
            "and inertia (a share)"
        )
    numbers = {key: float(_numbers(value, (), f"std of {key}", path)) for key, value in std.items()}
    try:
        return Uncertainty(**numbers)
    except PayloadError as error:
        raise PayloadError(f"payload file {path}: {error}") from None


def _measured(content: dict[str, Any], path: Path) -> Measured | None:
    """How well the payload of an answer is known; None: the file is of no answer, or says it otherwise."""
    if content.get("covariance") is None or content.get("std") is not None:
        return None
    covariance = _numbers(content["covariance"], (10, 10), "covariance", path)
    try:
        return Measured(covariance, content.get("interval") != "approximate")
    except PayloadError as error:
        raise PayloadError(f"payload file {path}: {error}") from None


def _boxes(content: dict[str, Any], path: Path) -> tuple[Box, ...]:
    boxes = content.get("boxes") or []
    try:
        return tuple(Box(tuple(b["size"]), tuple(b["centre"]), b["mass"]) for b in boxes)
    except (TypeError, KeyError, PayloadError):
        raise PayloadError(
            f"payload file {path}: boxes are not a list of objects with size, centre and mass (3, 3 and 1 numbers)"
        ) from None

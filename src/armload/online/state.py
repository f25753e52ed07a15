"""The state of a live identifier in one file: saved, and taken up again by another process as if nothing had been.

An object becomes the name of its class and what it holds, arrays go to an npz; nothing in the file is executed when it
is read: only classes of armload are made again, without calling anything of theirs.
"""

from __future__ import annotations

import hashlib
import importlib
import io
import json
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from armload.errors import IdentificationError
from armload.runtime.atomic import replacing

FORMAT = 13
_PACKAGE = "armload."
_NOT_SAVED = ("_worker", "_data", "_model")  # threads, and what Pinocchio makes anew
_MADE_ANEW = (
    "armload.arms.momentum_row.MomentumRow",
    "armload.arms.forward.ForwardDynamics",
)  # of the arm alone


def save_state(state: Any, known: Mapping[str, Any], path: str | PathLike[str], origin: Mapping[str, Any]) -> Path:
    """Write an object to a file; it appears whole or not at all.

    Args:
        state: lists, dicts, numbers, arrays and objects of armload, shared or in circles.
        known: objects that whoever loads the state has already, by name; they are not written.
        origin: JSON that tells whether these are the same.
    """
    packed = _Packer(known)
    tree = packed.node(state)
    arrays = {f"a{k}": array for k, array in enumerate(packed.arrays)}
    text = json.dumps({"format": FORMAT, "origin": origin, "tree": tree, "objects": packed.objects})
    path = Path(path)
    with replacing(path) as part:
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, tree=np.frombuffer(text.encode(), dtype=np.uint8), **arrays)
        part.write_bytes(buffer.getvalue())
    return path


def load_state(path: str | PathLike[str], known: Mapping[str, Any], check: Callable[[Mapping[str, Any]], None]) -> Any:
    """Read what `save_state` wrote.

    Args:
        path: the file.
        known: as it was saved with.
        check: raises if the origin it is given does not fit; nothing has been made yet then.

    Raises:
        IdentificationError: missing, damaged or foreign file, or one of another armload.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as data:
            text = json.loads(data["tree"].tobytes().decode())
            if text["format"] != FORMAT:
                raise IdentificationError(f"{path} belongs to another version of armload: begin anew")
            check(text["origin"])
            arrays = [data[f"a{k}"] for k in range(len(data.files) - 1)]
        return _Unpacker(text["objects"], arrays, known).node(text["tree"])
    except FileNotFoundError:
        raise IdentificationError(f"no saved state at {path}: begin without it") from None
    except IdentificationError:
        raise
    except Exception as error:
        raise IdentificationError(f"{path} is no state of a live identifier ({error}): begin without it") from None


def model_fingerprint(model: Any) -> str:
    """SHA-256 of a trained model: of all arrays and numbers in its fields, whatever its file and its provenance say."""
    digest = hashlib.sha256()

    def take(name: str, value: Any) -> None:
        if is_dataclass(value):  # its fields alone: what it has worked out since is no part of it
            for field in fields(value):
                take(f"{name}.{field.name}", getattr(value, field.name))
        elif isinstance(value, tuple):
            for k, part in enumerate(value):
                take(f"{name}.{k}", part)
        elif isinstance(value, np.ndarray | int | float):
            array = np.asarray(value)
            digest.update(f"{name} {array.dtype.str} {array.shape} ".encode() + array.tobytes())

    take(type(model).__name__, model)
    return digest.hexdigest()


class _Packer:
    def __init__(self, known: Mapping[str, Any]) -> None:
        self.known = {id(value): name for name, value in known.items()}
        self.arrays: list[np.ndarray] = []
        self.objects: list[Any] = []
        self._seen: dict[int, int] = {}
        self._keep: list[Any] = []  # an id is only an id while its object lives

    def node(self, value: Any) -> Any:
        if value is None or isinstance(value, bool | str):
            return value
        if isinstance(value, int | float):
            return {"n": value}
        if isinstance(value, np.generic):
            return {"s": [value.dtype.str, value.item()]}
        if id(value) in self.known:
            return {"k": self.known[id(value)]}
        if id(value) in self._seen:
            return {"o": self._seen[id(value)]}
        index = len(self.objects)
        self.objects.append(None)
        self._seen[id(value)] = index
        self._keep.append(value)
        self.objects[index] = self._described(value)
        return {"o": index}

    def _described(self, value: Any) -> dict[str, Any]:
        if isinstance(value, np.ndarray):
            self.arrays.append(value)
            return {"array": len(self.arrays) - 1, "fixed": not value.flags.writeable}
        kind = type(value)
        name = f"{kind.__module__}.{kind.__qualname__}"
        if name in _MADE_ANEW:
            return {"anew": name, "arm": self.node(value.arm)}
        if isinstance(value, tuple):
            return {"tuple": None if kind is tuple else name, "items": [self.node(item) for item in value]}
        if isinstance(value, list | deque | set):
            return {"list": kind.__name__, "items": [self.node(item) for item in value]}
        if isinstance(value, dict):
            return {"dict": [[self.node(k), self.node(v)] for k, v in value.items()]}
        if not kind.__module__.startswith(_PACKAGE):
            raise IdentificationError(f"a live identifier of this kind cannot be saved: it holds a {name}")
        held = {k: self.node(v) for k, v in vars(value).items() if k not in _NOT_SAVED}
        return {"class": name, "held": held}


class _Unpacker:
    def __init__(self, objects: list[Any], arrays: list[np.ndarray], known: Mapping[str, Any]) -> None:
        self.objects, self.arrays, self.known = objects, arrays, known
        self._made: dict[int, Any] = {}

    def node(self, node: Any) -> Any:
        if not isinstance(node, dict):
            return node
        ((key, value),) = node.items()
        if key == "n":
            return value
        if key == "s":
            return np.dtype(value[0]).type(value[1])
        if key == "k":
            return self.known[value]
        if value not in self._made:
            self._made[value] = self._make(value, self.objects[value])
        return self._made[value]

    def _make(self, index: int, described: dict[str, Any]) -> Any:
        if "array" in described:
            array = self.arrays[described["array"]]
            array.setflags(write=not described["fixed"])
            return array
        if "anew" in described and described["anew"] in _MADE_ANEW:
            return _class(described["anew"])(self.node(described["arm"]))
        if "tuple" in described:
            items = [self.node(item) for item in described["items"]]
            return tuple(items) if described["tuple"] is None else _class(described["tuple"])(*items)
        if "list" in described:
            made: Any = {"list": list, "deque": deque, "set": set}[described["list"]]()
            self._made[index] = made
            add = made.add if isinstance(made, set) else made.append
            for item in described["items"]:
                add(self.node(item))
            return made
        if "dict" in described:
            made = self._made[index] = {}
            made.update((self.node(k), self.node(v)) for k, v in described["dict"])
            return made
        kind = _class(described["class"])
        made = object.__new__(kind)
        self._made[index] = made
        made.__dict__["_worker"] = None
        made.__dict__.update((k, self.node(v)) for k, v in described["held"].items())
        return made


def _class(name: str) -> type:
    if not name.startswith(_PACKAGE):
        raise ValueError(f"it holds a {name}")
    module, _, kind = name.rpartition(".")
    found = getattr(importlib.import_module(module), kind)
    if not isinstance(found, type):
        raise ValueError(f"it holds a {name}")
    return found

"""Objects as JSON and arrays, and the same objects again: nothing that was packed is executed when it is unpacked.

An object becomes the name of its class and what it holds. Only classes of armload are made again, without calling
anything of theirs.
"""

from __future__ import annotations

import importlib
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.runtime.sparing import spared, whole

_PACKAGE = "armload."
_NOT_PACKED = ("_tasks", "_data", "_model")  # threads, and what Pinocchio makes anew
_GROUPS = {kind.__name__: kind for kind in (list, deque, tuple)}


class Packer:
    """Makes JSON and arrays of objects.

    Args:
        known: objects that whoever unpacks has already, by name; they are not packed.

    Attributes:
        objects: what was packed so far, each once. arrays: those that `objects` refers to.
    """

    def __init__(self, known: Mapping[str, Any]) -> None:
        self.objects: list[Any] = []
        self.arrays: list[NDArray] = []
        self._seen: dict[int, dict[str, Any]] = {id(value): {"known": name} for name, value in known.items()}
        self._keep: list[Any] = [known]  # an id is only an id while its object lives

    def node(self, value: Any) -> Any:
        """What stands for a value: lists, dicts, numbers, arrays and objects of armload, shared or in circles.

        Raises:
            TypeError: it holds something else.
        """
        if value is None or isinstance(value, bool | str | int | float):
            return value
        if id(value) not in self._seen:
            self._seen[id(value)] = {"object": len(self.objects)}
            self._keep.append(value)
            self.objects.append(None)
            self.objects[self._seen[id(value)]["object"]] = self._described(value)
        return self._seen[id(value)]

    def _described(self, value: Any) -> list[Any]:
        kind = type(value)
        name = f"{kind.__module__}.{kind.__qualname__}"
        if isinstance(value, np.ndarray | np.generic):
            about = isinstance(value, np.generic), not value.flags.writeable
            data, how = spared(array := np.asarray(value)) or (array, None)
            self.arrays.append(data)
            return ["array", len(self.arrays) - 1, *about, how]
        if isinstance(value, dict):
            return ["dict", [[self.node(k), self.node(v)] for k, v in value.items()]]
        if kind.__name__ in _GROUPS or (isinstance(value, tuple) and name.startswith(_PACKAGE)):
            return ["group", kind.__name__ if kind.__name__ in _GROUPS else name, [self.node(one) for one in value]]
        if not name.startswith(_PACKAGE):
            raise TypeError(f"it holds a {name}")
        return ["class", name, {k: self.node(v) for k, v in vars(value).items() if k not in _NOT_PACKED}]


class Unpacker:
    """Makes the objects again.

    Args:
        objects, arrays, known: as of `Packer`.
    """

    def __init__(self, objects: list[Any], arrays: list[NDArray], known: Mapping[str, Any]) -> None:
        self._objects, self._arrays, self._known = objects, arrays, known
        self._made: dict[int, Any] = {}

    def value(self, node: Any) -> Any:
        """What a node stands for.

        Raises:
            ValueError: an object of another package, or a class that is no named tuple where one stands.
        """
        if not isinstance(node, dict):
            return node
        if "known" in node:
            return self._known[node["known"]]
        index = node["object"]
        if index not in self._made:
            self._made[index] = self._make(index, *self._objects[index])
        return self._made[index]

    def _make(self, index: int, what: str, name: Any, *held: Any) -> Any:
        if what == "array":
            array, (scalar, fixed, how) = self._arrays[name], held
            array = array if how is None else whole(array, how)
            array.setflags(write=not fixed)
            return array[()] if scalar else array
        if what == "group" and name not in ("list", "deque"):
            items = [self.value(node) for node in held[0]]
            return tuple(items) if name == "tuple" else _named(name, items)
        made: Any = _GROUPS[name]() if what == "group" else {} if what == "dict" else object.__new__(_class(name))
        self._made[index] = made  # what it holds may hold it
        if what == "group":
            made.extend(self.value(node) for node in held[0])
        elif what == "dict":
            made.update((self.value(k), self.value(v)) for k, v in name)
        else:
            made.__dict__.update((k, self.value(v)) for k, v in held[0].items())
        return made


def _class(name: str) -> type:
    """A class of armload by its name: what a module has from elsewhere, or calls otherwise, is none of its own."""
    module, _, kind = name.rpartition(".")
    found = getattr(importlib.import_module(module), kind, None) if name.startswith(_PACKAGE) else None
    if not isinstance(found, type) or found.__module__ != module:
        raise ValueError(f"it holds a {name}")
    return found


def _named(name: str, items: list[Any]) -> tuple[Any, ...]:
    """A named tuple, made without its constructor: another class's would do what a file says, connect or write."""
    kind = _class(name)
    if not issubclass(kind, tuple) or len(items) != len(getattr(kind, "_fields", ())):
        raise ValueError(f"it holds a {name} of {len(items)}")
    return tuple.__new__(kind, items)

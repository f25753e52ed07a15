"""What a file of tensors with a JSON header holds, or an object, as one number: it tells if a byte is another."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


def content_digest(header: Mapping[str, Any], tensors: Mapping[str, NDArray]) -> str:
    """SHA-256 of a header and of all tensors, by their names."""
    found = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for name in sorted(tensors):
        array = np.ascontiguousarray(tensors[name])
        found.update(f"{name} {array.dtype} {tensors[name].shape}".encode() + array.tobytes())
    return found.hexdigest()


def digest_of_numbers(value: Any) -> str:
    """SHA-256 of all arrays and numbers in a dataclass's fields, and in theirs, whatever else they say."""
    digest = hashlib.sha256()
    for array in _numbers(value):
        digest.update(f"{array.dtype.str} {array.shape} ".encode() + array.tobytes())
    return digest.hexdigest()


def _numbers(value: Any) -> Iterator[NDArray]:
    if is_dataclass(value):  # its fields alone: what it has worked out since is no part of it
        value = tuple(getattr(value, field.name) for field in fields(value))
    if isinstance(value, tuple):
        for part in value:
            yield from _numbers(part)
    elif isinstance(value, np.ndarray | int | float):
        yield np.asarray(value)

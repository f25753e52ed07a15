"""What a file of tensors with a JSON header holds, as one number: whoever reads it knows if a byte is another."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
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

"""A safetensors file with JSON in its header: written whole or not at all; nothing in it is executed."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from armload.errors import ArmloadError, ModelError, one_line
from armload.runtime.atomic import replacing
from armload.runtime.content import content_digest
from armload.runtime.regular import check_regular

_DIGEST = "sha256"
Made = TypeVar("Made")


@dataclass(frozen=True)
class TensorFile:
    """One kind of file of tensors: how it is told from others, and what is said where one cannot be used.

    Args:
        header: the name of its JSON in the file's metadata.
        format: of what is written, a number in the JSON; files of another format are refused.
        what: it holds, in words.
        make, command: what to do for a new one, "train", and with what, "armload train".
        unsigned: whether files without a SHA-256 are read, too: those that earlier versions wrote.
    """

    header: str
    format: int
    what: str
    make: str
    command: str
    unsigned: bool = False

    def write(self, path: Path, tensors: Mapping[str, NDArray], content: Mapping[str, Any]) -> None:
        """Write tensors, and `content` as the header, with the format and the SHA-256 of both.

        Raises:
            ModelError: the file cannot be written.
        """
        from safetensors.numpy import save

        arrays = {key: np.ascontiguousarray(array) for key, array in tensors.items()}
        header = {"format": self.format, **content}
        header[_DIGEST] = content_digest(header, arrays)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path) as part:
                part.write_bytes(save(arrays, {self.header: json.dumps(header)}))
        except OSError as error:
            raise ModelError(
                f"the {self.what} cannot be written to {path}: {error.strerror}; name a file elsewhere"
            ) from None

    def read(self, path: Path, made: Callable[[dict[str, NDArray], dict[str, Any]], Made]) -> Made:
        """What `made` makes of the tensors and the header of a file.

        Raises:
            ModelError: missing, damaged, altered or foreign file, one of another format, or one that `made` raises
                an error on.
        """
        tensors, header = self._contents(path)
        try:
            found = header["format"]
            if found != self.format:
                raise ModelError(
                    f"{path} belongs to another version of armload: {self.make} it again (its format is {found}, this "
                    f"armload's {self.format})"
                )
            signed = header.pop(_DIGEST, None)
            if signed != content_digest(header, tensors) and not (self.unsigned and signed is None):
                raise ModelError(f"{path} was altered after it was written (its SHA-256 differs): copy it again")
            return made(tensors, header)
        except ModelError:
            raise
        except (ArmloadError, ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError) as error:
            raise ModelError(
                f"{path} holds a {self.what} armload cannot use ({one_line(error)}): copy it or {self.make} it again"
            ) from None

    def wrote(self, path: Path) -> bool:
        """Whether a file is of this kind, by its header."""
        from safetensors import SafetensorError, safe_open

        try:
            check_regular(path)
            with safe_open(path, framework="np") as file:
                return self.header in (file.metadata() or {})
        except (SafetensorError, OSError, ValueError, TypeError):
            return False

    def _contents(self, path: Path) -> tuple[dict[str, NDArray], dict[str, Any]]:
        from safetensors import SafetensorError, safe_open

        try:
            check_regular(path)  # the library waits for a pipe's writer, and no signal ends it
            with path.open("rb"):  # the library calls what it may not read missing
                pass
            with safe_open(path, framework="np") as file:
                text = (file.metadata() or {}).get(self.header)
                tensors = {key: np.ascontiguousarray(file.get_tensor(key)) for key in file.keys()}  # noqa: SIM118
            header = None if text is None else json.loads(text)
        except FileNotFoundError:
            raise ModelError(f"no {self.what} at {path}: {self.make} one with `{self.command}`") from None
        except PermissionError as error:
            raise ModelError(
                f"the {self.what} {path} cannot be read: {error.strerror}; let whoever runs armload read it"
            ) from None
        except (SafetensorError, OSError, ValueError, TypeError, RecursionError) as error:
            raise ModelError(
                f"{path} is not a readable {self.what} ({one_line(error)}): expected a file that `{self.command}` "
                "wrote; copy it again"
            ) from None
        if not isinstance(header, dict):
            raise ModelError(f"{path} is no {self.what}: expected a file that `{self.command}` wrote")
        return tensors, header

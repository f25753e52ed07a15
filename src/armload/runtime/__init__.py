"""What armload needs of Python and the machine: version, optional packages, lazy imports, kernels, whole files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload.runtime.lazy import on_first_use
from armload.runtime.version import __version__

if TYPE_CHECKING:
    from armload.runtime.atomic import replacing
    from armload.runtime.extras import install, missing
    from armload.runtime.kernels import kernel

__all__ = ["__version__", "install", "kernel", "missing", "on_first_use", "replacing"]

__getattr__, __dir__ = on_first_use(__name__)

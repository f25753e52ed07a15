"""Packages whose names are imported when they are first used, so that a command pays for what it needs.

if TYPE_CHECKING:
    from armload.inertia.projection import nearest_body

__all__ = ["nearest_body"]
__getattr__, __dir__ = on_first_use(__name__)
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any


def on_first_use(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package (PEP 562): the names its `__init__.py` imports under `TYPE_CHECKING`.

    Type checkers, people and the running program so read one list. A name must not be that of one of its modules.

    >>> get, names = on_first_use("armload.inertia")
    >>> get("nearest_body").__module__
    'armload.inertia.projection'
    """
    module = sys.modules[package]

    @cache
    def homes() -> dict[str, str]:
        import ast  # costs as much as all of `import armload` else

        tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
        blocks = (node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
        imports = (node for block in blocks for node in block.body if isinstance(node, ast.ImportFrom))
        return {alias.name: str(node.module) for node in imports for alias in node.names}

    def get(name: str) -> Any:
        if name.startswith("__") or name not in homes():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            value = getattr(importlib.import_module(homes()[name]), name)
        except ModuleNotFoundError as error:
            from armload.runtime.extras import missing

            sentence = missing(error)
            raise (error if sentence is None else ModuleNotFoundError(sentence, name=error.name)) from None
        setattr(module, name, value)
        return value

    return get, lambda: sorted({*vars(module), *homes()})

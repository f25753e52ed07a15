"""Regular files: a pipe keeps whoever opens it until somebody writes into it, and a folder has no bytes."""

from __future__ import annotations

import os
import stat
from os import PathLike


def check_regular(path: str | PathLike[str]) -> None:
    """See that what is to be opened is a regular file, or a link to one.

    Raises:
        FileNotFoundError: there is none. OSError: it is something else (its text says so), or cannot be looked at.
    """
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise OSError("it is no regular file")

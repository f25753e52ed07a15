"""What the C++ URDF parser says: caught, so that it reaches the user in our sentence or not at all."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def caught_complaints() -> Iterator[list[str]]:
    """Complaints of the parser, which writes them straight to file descriptor 2; filled when the block ends.

    >>> with caught_complaints() as said:
    ...     _ = os.write(2, b"Error:   Joint [j] has no limits\\n         at line 607 in joint.cpp\\n")
    >>> said
    ['Joint [j] has no limits']
    """
    said: list[str] = []
    try:
        terminal = os.dup(2)
    except OSError:  # a process without stderr
        yield said
        return
    with suppress(AttributeError, OSError, ValueError):
        sys.stderr.flush()
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield said
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)
            file.seek(0)
            text = file.read().decode(errors="replace")
            said += [" ".join(line.split()) for line in re.findall(r"^Error:(.*)$", text, re.MULTILINE)]

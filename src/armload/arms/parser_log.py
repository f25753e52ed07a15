"""Error messages of the C++ URDF parser, caught so that armload can put them into its own."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def caught_parser_errors() -> Iterator[list[str]]:
    """Error messages of the parser, which writes them to file descriptor 2; filled when the block ends.

    >>> with caught_parser_errors() as messages:
    ...     _ = os.write(2, b"Error:   Joint [j] has no limits\\n         at line 607 in joint.cpp\\n")
    >>> messages
    ['Joint [j] has no limits']
    """
    messages: list[str] = []
    try:
        terminal = os.dup(2)
    except OSError:  # a process without stderr
        yield messages
        return
    with suppress(AttributeError, OSError, ValueError):
        sys.stderr.flush()
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield messages
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)
            file.seek(0)
            text = file.read().decode(errors="replace")
            messages += [" ".join(line.split()) for line in re.findall(r"^Error:(.*)$", text, re.MULTILINE)]

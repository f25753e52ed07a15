"""Who may ask the endpoint or a page: a token from a file, and whether an address is of this machine alone."""

from __future__ import annotations

import ipaddress
from pathlib import Path

from armload.errors import UsageError


def is_loopback(host: str) -> bool:
    """Whether an address is of this machine alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def read_token(path: str | Path) -> str:
    """The token in a file.

    Raises:
        UsageError: the file cannot be read, or holds fewer than 16 characters.
    """
    try:
        token = Path(path).read_text(encoding="utf-8-sig").strip()  # some editors begin a text with a mark
    except OSError as error:
        raise UsageError(f"the token's file {path} cannot be read: {error.strerror}") from None
    except ValueError:  # bytes that are no UTF-8, or a name with a zero in it
        raise UsageError(
            f"the token's file {str(path)!r} is no text: expected 16 characters of ASCII or more"
        ) from None
    if len(token) < 16 or not token.isascii():
        raise UsageError(f"the token in {path} has {len(token)} characters: expected 16 or more, all of ASCII")
    return token

"""Options that would change nothing are refused, as are such settings of a service (`service/idle.py`)."""

from __future__ import annotations

import argparse

from armload.errors import UsageError


def given(options: argparse.Namespace, *names: str, parser: argparse.ArgumentParser | None = None) -> list[str]:
    """Those of some options that say something, as they are written; `parser` knows what they are where left out."""
    defaults = {name: None if parser is None else parser.get_default(name) for name in names}
    said = [name for name, default in defaults.items() if getattr(options, name, default) != default]
    return [f"--{'rate' if name == 'log_rate' else name.replace('_', '-')}" for name in said]


def refuse_idle(said: list[str], why: str) -> None:
    """Refuse options that would change nothing: whoever gave one believes that it does something.

    Raises:
        UsageError: there is one.
    """
    if said:
        one = len(said) == 1
        raise UsageError(f"{' and '.join(said)} {'is' if one else 'are'} {why}: leave {'it' if one else 'them'} out")

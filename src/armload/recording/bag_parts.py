"""The files of a ROS 2 bag by their names, NAME/NAME_0.mcap, NAME/NAME_1.mcap, …, where its metadata.yaml is lost."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path, PurePath

PART_SUFFIXES = (".db3", ".mcap")
_NUMBERED = re.compile(r"(.*)_([0-9]+)")


def is_part_of_bag(path: PurePath) -> bool:
    """Whether a file is named as `ros2 bag` names the parts of a bag, after the folder that it lies in.

    >>> [is_part_of_bag(PurePath(name)) for name in ("cell/run/run_0.mcap", "cell/run_0.mcap", "run/run_0.csv")]
    [True, False, False]
    """
    named = _NUMBERED.fullmatch(path.stem)
    return path.suffix.lower() in PART_SUFFIXES and named is not None and named[1] == path.parent.name != ""


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Parts of bags in the order in which they were recorded: run_10.mcap is after run_9.mcap.

    >>> [path.name for path in in_order([Path("run_10.db3"), Path("run_9.db3"), Path("run.db3")])]
    ['run.db3', 'run_9.db3', 'run_10.db3']
    """

    def place(path: Path) -> tuple[str, int, str]:
        named = _NUMBERED.fullmatch(path.stem)
        return (path.stem, -1, path.name) if named is None else (named[1], int(named[2]), path.name)

    return sorted(paths, key=place)

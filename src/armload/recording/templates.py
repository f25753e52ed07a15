"""Columns that the user names: `joint_pos_{i}`, `/joint_states/{joint}/position`, `observation.state[{0..6}]`."""

from __future__ import annotations

import re
from collections.abc import Sequence

from armload.arms import Arm
from armload.errors import RecordingError

_PLACEHOLDER = re.compile(r"\{(i|joint|([0-9]{1,3})\.\.([0-9]{1,3}))\}")


def named_columns(
    template: str | Sequence[str], key: str, names: Sequence[str], where: str, arm: Arm | None
) -> list[int]:
    """The places in a header of the columns a template names, in the order of the joints.

    Raises:
        RecordingError: a column is not there, is there twice, or `{i}` fits another number of columns than the arm has
            joints.
    """
    if not isinstance(template, str):
        return [place_of(name, key, names, where) for name in template]
    holder = _PLACEHOLDER.search(template)
    if holder is None:
        elements = [name for name in (f"{template}[{k}]" for k in range(len(names))) if name in names]
        if not elements and template not in names and arm is not None:  # elements that have names
            elements = [name for name in (f"{template}/{joint}" for joint in arm.joint_names) if name in names]
        return [place_of(name, key, names, where) for name in elements or [template]]
    before, after = template[: holder.start()], template[holder.end() :]
    if holder[1] == "joint":
        if arm is None:
            raise RecordingError(f"{where}: --columns {key}={template} needs the arm's joint names: name the arm")
        return [place_of(f"{before}{joint}{after}", key, names, where) for joint in arm.joint_names]
    if holder[2] is not None:
        keys = range(int(holder[2]), int(holder[3]) + 1)
    else:
        pattern = re.compile(re.escape(before) + "([0-9]{1,3})" + re.escape(after))
        there = sorted({int(m[1]) for m in map(pattern.fullmatch, names) if m})
        if not there:
            place_of(template, key, names, where)
        base = 0 if 0 in there else 1
        keys = range(base, base + len(there))
        if there != list(keys) or (arm is not None and len(there) != arm.n):
            expected = "0 … n−1 or 1 … n" if arm is None else f"0 … {arm.n - 1} or 1 … {arm.n}"
            last = base + (len(there) if arm is None else arm.n) - 1
            raise RecordingError(
                f"{where}: --columns {key}={template} fits columns with the indices {', '.join(map(str, there[:12]))}: "
                f"expected {expected}; name a range, such as {before}{{{base}..{last}}}{after}"
            )
    return [place_of(f"{before}{number}{after}", key, names, where) for number in keys]


def place_of(name: str, key: str, names: Sequence[str], where: str) -> int:
    """The place of the one column with this name.

    Raises:
        RecordingError: there is none, or more than one.
    """
    places = [k for k, there in enumerate(names) if there == name]
    if len(places) == 1:
        return places[0]
    numbered = [there for there in names if re.fullmatch(re.escape(name) + "[0-9]{1,3}", there)]
    instead = f"; did you mean {name}{{i}}?" if numbered and not places else ""
    has = f"has the column {name!r} more than once" if places else f"has no column {name!r}"
    raise RecordingError(f"{where} {has}, which --columns names for {key}: found {abridged(names)}{instead}")


def abridged(names: Sequence[str]) -> str:
    """The names of a header, the first and the last ones.

    >>> abridged([f"a{k}" for k in range(22)])
    'a0, a1, a2, a3, …, a19, a20, a21'
    """
    return ", ".join(names if len(names) < 10 else [*names[:4], "…", *names[-3:]])

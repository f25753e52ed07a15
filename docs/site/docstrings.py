"""Docstrings as the pages of names show them: doctests as code, fields as lists; a constant's is its comment."""

import re

import griffe

DOCTEST = re.compile(r"^>>> .*?(?=\n\s*\n|\Z)", re.MULTILINE | re.DOTALL)
FIELDS = re.compile(r"(?:^[a-z]\w*(?:, \w+)*: .*\n?(?:^ {4,}\S.*\n?)*){2,}", re.MULTILINE)
FIELD = re.compile(r"^([a-z]\w*(?:, \w+)*): ", re.MULTILINE)


class Shown(griffe.Extension):
    """Changes what is shown, after griffe has read it."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        if obj.docstring is not None:
            text = FIELDS.sub(_listed, obj.docstring.value)
            obj.docstring.value = DOCTEST.sub(lambda match: f"```pycon\n{match[0]}\n```", text)
        elif obj.is_attribute and obj.parent is not None and obj.parent.is_module:
            obj.docstring = griffe.Docstring(_comment(obj), parent=obj)


def _listed(match: re.Match[str]) -> str:
    names = FIELD.sub(lambda field: "- " + ", ".join(f"`{name}`" for name in field[1].split(", ")) + ": ", match[0])
    return f"\n{names}"


def _comment(constant: griffe.Object) -> str:
    """The comment behind a constant, or the lines of comment above it."""
    lines, at = constant.lines_collection[constant.filepath], constant.lineno - 1
    if "  # " in lines[at]:
        return lines[at].split("  # ", 1)[1]
    above = at
    while lines[above - 1].startswith("# "):
        above -= 1
    return " ".join(line[2:] for line in lines[above:at])

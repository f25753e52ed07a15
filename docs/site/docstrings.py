"""Docstrings as the pages of names show them: doctests as code, lists of fields as lists."""

import re

import griffe

DOCTEST = re.compile(r"^>>> .*?(?=\n\s*\n|\Z)", re.MULTILINE | re.DOTALL)
FIELDS = re.compile(r"(?:^[a-z]\w*(?:, \w+)*: .*\n?(?:^ {4,}\S.*\n?)*){2,}", re.MULTILINE)
FIELD = re.compile(r"^([a-z]\w*(?:, \w+)*): ", re.MULTILINE)


class Shown(griffe.Extension):
    """Changes what is shown, after griffe has read it."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        if obj.docstring is None:
            return
        text = FIELDS.sub(_listed, obj.docstring.value)
        obj.docstring.value = DOCTEST.sub(lambda match: f"```pycon\n{match[0]}\n```", text)


def _listed(match: re.Match[str]) -> str:
    names = FIELD.sub(lambda field: "- " + ", ".join(f"`{name}`" for name in field[1].split(", ")) + ": ", match[0])
    return f"\n{names}"

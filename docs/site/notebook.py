"""A notebook's cells, run in order in one namespace, and what each shows: no kernel is needed for that."""

import ast
import contextlib
import io
import json
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("agg")


@dataclass(frozen=True)
class Cell:
    """kind: "markdown" or "code". printed: its text output. html: of its last value. pictures: SVG, one a figure."""

    kind: str
    source: str
    printed: str = ""
    html: str = ""
    pictures: tuple[str, ...] = ()


def run(path: Path) -> list[Cell]:
    """The cells of a notebook with what they show; an error in a cell is raised."""
    namespace: dict[str, object] = {"__name__": "__main__"}
    out = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        out.append(_shown(source, namespace) if cell["cell_type"] == "code" else Cell(cell["cell_type"], source))
    return out


def _shown(source: str, namespace: dict[str, object]) -> Cell:
    from matplotlib import pyplot

    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    value, printed, html = None, io.StringIO(), ""
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "<cell>", "exec"), namespace)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), namespace)
            value = None if source.rstrip().endswith(";") else value
        if hasattr(value, "_repr_html_"):
            html = value._repr_html_()
        elif value is not None:
            print(repr(value))
    pictures = []
    for number in pyplot.get_fignums():
        content = io.StringIO()
        pyplot.figure(number).savefig(content, format="svg", bbox_inches="tight")
        pictures.append(content.getvalue())
        pyplot.close(number)
    return Cell("code", source, printed.getvalue(), html, tuple(pictures))

"""The list of these scripts in docs/reruns.md: what each asks, and the pages that name it.

python benchmarks/list_of_scripts.py
"""

from __future__ import annotations

import ast
import re

from script import ROOT, markdown_table, write_table

PAGE = ROOT / "docs" / "reruns.md"
HERE = ROOT / "benchmarks"


def asks(source: str) -> str:
    """The first paragraph of a script's docstring."""
    about = ast.get_docstring(ast.parse(source)) or ""
    return " ".join(about.split("\n\n")[0].split())


def listed() -> str:
    """The table: a row for each script that can be run, in the order of the pages, then of the names."""
    pages = [ROOT / "README.md", *sorted(p for p in (ROOT / "docs").glob("*.md") if p != PAGE)]
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    rows = []
    for path in sorted(HERE.glob("*.py")):
        source, named = path.read_text(encoding="utf-8"), re.compile(rf"\b{path.stem}\.py")
        if 'if __name__ == "__main__"' not in source or path.stem == "before_after_worker":
            continue  # imported, or run, by others
        where = [page for page in pages if named.search(texts[page])]
        where = [page for page in where if page.stem != "constants"] or where  # that one names most of them
        links = ", ".join(f"[{p.stem}]({p.name})" if p.parent == PAGE.parent else p.stem for p in where)
        first = pages.index(where[0]) if where else len(pages)
        rows.append((first, path.stem, [f"`{path.name}`", asks(source), links or "–"]))
    return markdown_table(("script", "what it asks", "on the pages"), "lll", [row for *_, row in sorted(rows)])


if __name__ == "__main__":
    write_table(PAGE, "scripts", listed())
    print(f"wrote {PAGE.relative_to(ROOT)}")

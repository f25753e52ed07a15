"""The structure of the package in numbers: rooms, modules, imports, what it costs to load and to install.

    python benchmarks/structure.py [--source src] [--before REV] [--test-seconds BEFORE AFTER]

--before checks that revision out into a temporary worktree and measures it beside --source (a folder that holds
`armload`). --test-seconds: of `make test` on a fresh clone, as `suite.py` measures it. Nothing of the package is run,
its text is read:

rooms             folders and modules directly below the package, `__init__` and `__main__` left out
longest module    lines of the longest file
arrows            pairs (a, b) of rooms where a module of a imports one of b, anywhere in its text
inheritance       classes of the package on the longest path from a class up its bases, the class itself counted
circles           groups of more than one module that reach each other by imports that run when a module is loaded:
                  not those inside a function or under TYPE_CHECKING; `from a import b` counts for a.b where that is a
                  module, for a otherwise, and a package's own parts count only where they are named
constants         names in capitals, with or without a leading underscore, that a module assigns at its top level to a
                  number or to a tuple of numbers (signs and arithmetic of numbers included), in all modules that an
                  entry point may come to load, by imports inside functions, too: the room `identification` for
                  identify, `online` for the stream

Measured in fresh processes: import time, the median of five, over that of numpy in turns with it. Installed: megabytes
of all distributions that armload's dependencies lead to, without extras, from their metadata. Written to
benchmarks/results/structure.json.
"""

from __future__ import annotations

import ast
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import Any

from script import ROOT, markdown_table, options, write

PACKAGE = "armload"
REPEATS = 5
ENTRIES = {"identify": ("identification", "identify"), "stream": ("online",)}  # the room; where it was before
NAMED = re.compile(r"_?[A-Z][A-Z0-9_]*$")


class Package:
    """The modules of a package as text.

    Args:
        source: the folder that holds it.
    """

    def __init__(self, source: Path) -> None:
        self.source, folder = source, source / PACKAGE
        paths = sorted(folder.rglob("*.py"))
        self.paths = {".".join(p.relative_to(source).with_suffix("").parts).removesuffix(".__init__"): p for p in paths}
        self.text = {name: path.read_text(encoding="utf-8") for name, path in self.paths.items()}
        self.tree = {name: ast.parse(text) for name, text in self.text.items()}

    @cached_property
    def rooms(self) -> set[str]:
        return {name.split(".")[1] for name in self.paths if "." in name and not name.endswith("__main__")}

    def imported(self, name: str, node: ast.stmt) -> Iterator[str]:
        """Modules of the package that an import statement names."""
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name in self.paths)
        if isinstance(node, ast.ImportFrom):
            package = name if self.paths[name].name == "__init__.py" else name.rpartition(".")[0]
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            if base in self.paths:
                yield from (f"{base}.{a.name}" if f"{base}.{a.name}" in self.paths else base for a in node.names)

    def imports(self, name: str, lazy: bool = False) -> set[str]:
        """Modules of the package that one imports by name: when it is loaded, or with those of its functions, too."""
        found, todo = set(), list(self.tree[name].body)
        while todo:
            node = todo.pop()
            later = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not lazy
            # what a package names there it imports when it is first asked for (`armload.runtime.lazy`)
            on_use = lazy and self.paths[name].name == "__init__.py"
            if later or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test) and not on_use):
                continue
            found |= set(self.imported(name, node))
            todo += [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.stmt | ast.ExceptHandler)]
        return found - {name}

    @cached_property
    def arrows(self) -> set[tuple[str, str]]:
        pairs = set()
        for name, tree in self.tree.items():
            for node in (n for n in ast.walk(tree) if isinstance(n, ast.stmt)):
                pairs |= {(name, other) for other in self.imported(name, node)}
        named = {tuple(x.split(".")[1] if "." in x else "" for x in pair) for pair in pairs}
        return {(a, b) for a, b in named if a != b and {a, b} <= self.rooms}

    @cached_property
    def inheritance(self) -> int:
        """By the names of classes: of two with the same name the deeper one counts."""
        bases: dict[str, set[str]] = {}
        for tree in self.tree.values():
            for node in (n for n in ast.walk(tree) if isinstance(n, ast.ClassDef)):
                names = {re.split(r"[.\[]", ast.unparse(base).split("[")[0])[-1] for base in node.bases}
                bases.setdefault(node.name, set()).update(names - {node.name})

        def depth(name: str) -> int:
            return 1 + max((depth(base) for base in bases[name] if base in bases), default=0)

        return max(map(depth, bases))

    @cached_property
    def circles(self) -> list[list[str]]:
        """Strongly connected components of more than one module (Tarjan 1972)."""
        index: dict[str, int] = {}
        low: dict[str, int] = {}
        stack: list[str] = []
        out: list[list[str]] = []

        def visit(name: str) -> None:
            index[name] = low[name] = len(index)
            stack.append(name)
            for other in sorted(self.imports(name)):
                if other not in index:
                    visit(other)
                    low[name] = min(low[name], low[other])
                elif other in stack:
                    low[name] = min(low[name], index[other])
            if low[name] == index[name]:
                at = stack.index(name)
                out.append(sorted(stack[at:]))
                del stack[at:]

        for name in self.paths:
            if name not in index:
                visit(name)
        return sorted(group for group in out if len(group) > 1)

    def reached_from(self, entry: str) -> set[str]:
        """Every module that one may come to load, by the imports inside functions, too."""
        found, todo = set(), [entry]
        while todo:
            name = todo.pop()
            if name not in found:
                found.add(name)
                todo += self.imports(name, lazy=True)
        return found

    def constants(self, entries: tuple[str, ...]) -> int:
        """Named numbers in all modules that the first of these entry points there is may come to load."""
        entry = next(name for room in entries if (name := f"{PACKAGE}.{room}") in self.paths)
        return sum(len(list(_numbers(self.tree[name]))) for name in self.reached_from(entry))

    def measured(self) -> dict[str, Any]:
        """What the text says."""
        lines = {name: text.count("\n") for name, text in self.text.items()}
        longest = max(lines, key=lambda name: lines[name])
        return {
            "rooms": len(self.rooms),
            "modules": len(self.paths),
            "lines": sum(lines.values()),
            "longest module": {"lines": lines[longest], "module": longest},
            "arrows": len(self.arrows),
            "inheritance": self.inheritance,
            "circles": {"count": len(self.circles), "modules": self.circles},
            **{f"constants, {name}": self.constants(rooms) for name, rooms in ENTRIES.items()},
        }


def _numbers(tree: ast.Module) -> Iterator[str]:
    """Names in capitals that are assigned numbers at a module's top level."""
    for node in tree.body:
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(target.elts, node.value.elts, strict=True))
            for name, value in pairs:
                if isinstance(name, ast.Name) and NAMED.match(name.id) and value is not None and _is_number(value):
                    yield name.id


def _is_number(value: ast.expr) -> bool:
    if isinstance(value, ast.Tuple):
        return bool(value.elts) and all(map(_is_number, value.elts))
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return _is_number(value.left) and _is_number(value.right)
    return isinstance(value, ast.Constant) and type(value.value) in (int, float)


def import_times(source: Path) -> dict[str, float]:
    """Median wall time of a process that imports the package, or the command line, over one that imports numpy."""
    there = (source / PACKAGE / "app").is_dir()
    wanted = {"numpy": "numpy", PACKAGE: PACKAGE, f"{PACKAGE}.app": f"{PACKAGE}.app" if there else f"{PACKAGE}.cli"}
    times: dict[str, list[float]] = {name: [] for name in wanted}
    environment = os.environ | {"PYTHONPATH": str(source)}
    for turn in range(REPEATS + 1):  # the first one fills the cache of compiled files
        for name, module in wanted.items():
            began = time.perf_counter()
            subprocess.run([sys.executable, "-c", f"import {module}"], env=environment, check=True)
            if turn:
                times[name].append(time.perf_counter() - began)
    median = {name: statistics.median(values) for name, values in times.items()}
    return {name: round(median[name] / median["numpy"], 2) for name in wanted if name != "numpy"}


def installed(project: Path) -> dict[str, Any]:
    """Distributions that a project's dependencies lead to, and their size [MB]; what is not installed is named."""
    requirements = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    todo, sizes, missing = list(requirements), {}, set()
    while todo:
        name = _name(todo.pop())
        if name in sizes or name in missing:
            continue
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            missing.add(name)
            continue
        files = {Path(str(file.locate())).resolve() for file in distribution.files or ()}
        sizes[name] = sum(file.stat().st_size for file in files if file.is_file())
        todo += [r for r in distribution.requires or () if "extra ==" not in r]
    largest = dict(sorted(((n, round(s / 1e6, 1)) for n, s in sizes.items()), key=lambda x: -x[1])[:10])
    return {
        "MB": round(sum(sizes.values()) / 1e6, 1),
        "distributions": len(sizes),
        "largest": largest,
        "not installed": sorted(missing),
    }


def _name(requirement: str) -> str:
    return re.split(r"[^A-Za-z0-9._-]", requirement.strip(), maxsplit=1)[0].lower().replace("_", "-")


def measure(project: Path, source: Path) -> dict[str, Any]:
    """All numbers of one checkout."""
    return Package(source).measured() | {"import over numpy": import_times(source), "installed": installed(project)}


def measure_revision(revision: str) -> dict[str, Any]:
    """The same of a revision, in a worktree that is removed again."""
    with tempfile.TemporaryDirectory() as folder:
        git, there = ("git", "-C", str(ROOT), "worktree"), str(Path(folder) / "before")
        subprocess.run([*git, "add", "--quiet", "--detach", there, revision], check=True)
        try:
            return measure(Path(there), Path(there) / "src")
        finally:
            subprocess.run([*git, "remove", "--force", there], check=True)


def rows_of(measured: dict[str, Any]) -> dict[str, str]:
    """The numbers as a table shows them."""
    longest, circles, cost = (measured[name] for name in ("longest module", "circles", "installed"))
    shown = {
        "rooms": measured["rooms"],
        "modules": measured["modules"],
        "lines": measured["lines"],
        "longest module [lines]": longest["lines"],
        "arrows between rooms": measured["arrows"],
        "deepest inheritance [classes]": measured["inheritance"],
        "import circles": circles["count"],
        **{f"named numbers on the way of {name}": measured[f"constants, {name}"] for name in ENTRIES},
        **{f"`import {name}` over `import numpy`": ratio for name, ratio in measured["import over numpy"].items()},
        "installed dependencies [MB]": cost["MB"],
    }
    return {name: str(value) for name, value in shown.items()}


def main() -> None:
    asked = options(__doc__, source=ROOT / "src", before="", test_seconds=(0.0, 0.0))
    after = measure(asked.source.resolve().parent, asked.source.resolve())
    result = {"before": measure_revision(asked.before), "after": after} if asked.before else {"after": after}
    tables = {name: rows_of(measured) for name, measured in result.items()}
    if asked.before and any(asked.test_seconds):
        for measured, table, seconds in zip(result.values(), tables.values(), asked.test_seconds, strict=True):
            measured["make test, seconds"] = seconds
            table["`make test` [s]"] = f"{seconds:g}"
    rows = [(name, *(table[name] for table in tables.values())) for name in tables["after"]]
    write("structure", result | ({"revision": asked.before} if asked.before else {}), indent=1)
    print(markdown_table(("", *tables), "l" + "r" * len(tables), rows))


if __name__ == "__main__":
    main()

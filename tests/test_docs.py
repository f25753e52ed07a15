"""The pages cannot rot: their Python runs, their commands exist, their links lead somewhere."""

import ast
import contextlib
import doctest
import importlib
import inspect
import io
import pkgutil
import re
import shlex
from pathlib import Path

import pytest

import armload

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
MODULES = ["armload", *sorted(m.name for m in pkgutil.walk_packages(armload.__path__, "armload."))]
MODULES = [name for name in MODULES if not name.endswith("__main__") and "._kernels_" not in name]
PACKAGES = [name for name in MODULES if hasattr(importlib.import_module(name), "__path__")]
BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)|(?:href|src)=\"([^\"]+)\"")


def blocks(page, *languages):
    """(info string, text) of the fenced blocks of a page in the given languages."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(info.strip(), text) for info, text in found if info.split()[:1] and info.split()[0] in languages]


def page_id(page):
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_python_on_the_page_runs(page, tmp_path, monkeypatch, capsys):
    """Blocks fenced ```python run in order, in one namespace; ```python no-run must at least be Python."""
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "__page__"}
    ran = 0
    for info, text in blocks(page, "python"):
        code = compile(text, f"{page.name} block {ran}", "exec")
        if "no-run" not in info:
            exec(code, namespace)
            ran += 1
    capsys.readouterr()
    if page.name == "README.md" and page.stat().st_size:
        assert ran > 0, "the README shows no Python that runs"


def help_of(*command):
    from armload.app.cli import main

    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out), contextlib.suppress(SystemExit):
        main([*command, "--help"])
    return out.getvalue()


def commands(page):
    """Every `armload …` line of the shell blocks of a page, continued lines joined, as words."""
    for _, text in blocks(page, "sh", "bash", "shell", "console"):
        for line in text.replace("\\\n", " ").splitlines():
            line = re.sub(r"^\$ ", "", line.strip())
            if re.match(r"(\.venv/bin/)?armload\b", line):
                yield shlex.split(line, comments=True)[1:]


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_commands_on_the_page_exist(page):
    for words in commands(page):
        if not words or words[0].startswith("-"):
            continue
        names = [words[0]]
        text = help_of(*names)
        while (
            len(names) < len(words)
            and words[len(names)][0] != "-"
            and re.search(rf"^[│\s]*{re.escape(words[len(names)])}\s", text, re.MULTILINE)
        ):
            deeper = help_of(*names, words[len(names)])
            if deeper == text:
                break
            names.append(words[len(names)])
            text = deeper
        assert "usage" in text.lower(), f"{page.name}: armload {' '.join(words)}: no such command"
        flags = [word.split("=")[0] for word in words if word.startswith("--")]
        unknown = [flag for flag in flags if not re.search(rf"{re.escape(flag)}(?![\w-])", text)]
        assert not unknown, f"{page.name}: armload {' '.join(words)}: no option {unknown}"


def options_of(script):
    """The options that a script of the benchmarks declares, by name."""
    found, tree = set(), ast.parse(script.read_text(encoding="utf-8"))
    for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
        name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
        if name == "options":
            found |= {f"--{given.arg.replace('_', '-')}" for given in call.keywords}
        elif name == "add_argument":
            found |= {arg.value for arg in call.args if isinstance(arg, ast.Constant)}
    return found


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_scripts_on_the_page_exist_with_their_options(page):
    for name, words in re.findall(r"benchmarks/(\w+)\.py([^`\n;]*)", page.read_text(encoding="utf-8")):
        script = ROOT / "benchmarks" / f"{name}.py"
        assert script.exists(), f"{page.name}: there is no {script.name}"
        flags = re.findall(r"(?<=\s)--[a-z][\w-]*", words)
        unknown = [flag for flag in flags if flag not in options_of(script)]
        assert not unknown, f"{page.name}: {script.name} has no option {unknown}"


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_links_on_the_page_lead_somewhere(page):
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    for match in LINK.finditer(text):
        target = next(group for group in match.groups() if group)
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{page.name} links to {target}, which is not there"
        if anchor and file.suffix == ".md":
            titles = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
            anchors = [re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles]
            assert anchor in anchors, f"{page.name} links to {target}: no such heading"


def test_the_theory_page_names_functions_and_tests_that_exist():
    text = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
    functions = set(re.findall(r"`(armload\.[a-z_.]+\.[A-Za-z_.]+)`", text))
    tests = set(re.findall(r"`(test_[a-z_]+)::(test_[a-z0-9_]+)`", text))
    assert len(functions) > 10
    assert len(tests) > 10
    for name in functions:
        parts = name.split(".")
        depth = next(k for k in range(len(parts), 0, -1) if ".".join(parts[:k]) in MODULES)
        value = importlib.import_module(".".join(parts[:depth]))
        for attribute in parts[depth:]:
            assert hasattr(value, attribute), f"docs/theory.md names {name}, which does not exist"
            value = getattr(value, attribute)
    paths = {path.stem: path for path in (ROOT / "tests").rglob("test_*.py")}
    for file, test in tests:
        names = re.findall(r"^def (\w+)\(", paths[file].read_text(encoding="utf-8"), re.MULTILINE)
        assert test in names, f"docs/theory.md names {file}::{test}, which does not exist"


# ---------------------------------------------------------------------- docstrings and public names


def test_examples_in_docstrings_are_right(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flags, results = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE, {}
    for module in map(importlib.import_module, MODULES):
        if ">>>" in inspect.getsource(module):  # to look through each object of the others takes seconds
            results[module.__name__] = doctest.testmod(module, optionflags=flags)  # prints what differs
    assert [name for name, result in results.items() if result.failed] == []
    assert sum(result.attempted for result in results.values()) > 100


def test_every_module_says_what_it_is():
    for name in MODULES:
        doc = importlib.import_module(name).__doc__
        assert doc, name
        first, *more = doc.strip().splitlines()
        assert more or first.rstrip().endswith((".", ":", ",", ";")), f"{name}: {first}"


def test_a_test_that_the_code_cites_is_there():
    there = set(re.findall(r"def (test_\w+)", "\n".join(p.read_text("utf-8") for p in ROOT.glob("tests/**/*.py"))))
    cited = {  # sentences, which is what tests are called by: five words or more
        (found[0], file.name)
        for file in ROOT.glob("src/**/*.py")
        for found in re.finditer(r"\btest(_[a-z0-9]+){4,}\b", file.read_text(encoding="utf-8"))
    }
    assert len(cited) > 10
    assert sorted((test, file) for test, file in cited if test not in there) == []


@pytest.mark.parametrize("name", PACKAGES)
def test_all_is_importable_and_complete(name):
    package = importlib.import_module(name)
    public_names = getattr(package, "__all__", [])
    assert len(set(public_names)) == len(public_names)
    for public in public_names:
        assert getattr(package, public) is not None
    tree = ast.parse(Path(str(package.__file__)).read_text(encoding="utf-8"))
    imported = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("armload")
        if node.module != "armload.runtime.lazy"
        for alias in node.names
    }
    forgotten = {n for n in imported if not n.startswith("_")} - set(public_names)
    assert not forgotten, f"{name} imports {sorted(forgotten)} and does not list them in __all__"


@pytest.mark.parametrize("name", PACKAGES)
def test_public_names_are_explained(name):
    package = importlib.import_module(name)
    for public in getattr(package, "__all__", []):
        value = getattr(package, public)
        if callable(value) and getattr(value, "__module__", "").startswith("armload"):
            assert (value.__doc__ or "").strip(), f"{name}.{public} has no docstring"

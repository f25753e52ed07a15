"""What the site has beyond docs/*.md: the README as its start page, a page of names for each room, the tutorial, run.

Links that work in the repository work in the site: a page that is named is linked, any other file is copied.
"""

import html
import posixpath
import re
from pathlib import Path

import griffe
from docstrings import Shown
from latex2mathml.converter import convert
from mkdocs.structure.files import File
from notebook import run

ROOT = Path(__file__).resolve().parents[2]
PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
NOTEBOOK = "docs/tutorial.ipynb"
FENCE = re.compile(r"^(```.*?^```|    .*?$)", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(\]\()([^)\s#:]+)((?:#[^)\s]*)?\))")
FORMULA = re.compile(r"<(div|span) class=\"arithmatex\">\\[\[(](.*?)\\[\])]</\1>", re.DOTALL)

_home: dict[str, str] = {}  # where in the repository each made page comes from


def on_files(files, config):
    """Adds what is made: pages from the repository's root, the tutorial, a page for each room."""
    _home.clear()
    for source, page in PAGES.items():
        _add(files, config, page, (ROOT / source).read_text(encoding="utf-8"), home=source)
    page, pictures = _tutorial()
    _add(files, config, "tutorial.md", page, home=NOTEBOOK)
    for name, content in pictures.items():
        _add(files, config, name, content)
    for room, text in _rooms():
        _add(files, config, f"api/{room}.md", text)
    return files


def on_page_markdown(markdown, page, config, files):
    """Links as the site needs them, and fences without the marks of the tests."""
    source = _home.get(page.file.src_uri, f"docs/{page.file.src_uri}")
    home = posixpath.dirname(source)
    pages = PAGES if source == NOTEBOOK else PAGES | {NOTEBOOK: "tutorial.md"}

    def target(match):
        path = posixpath.normpath(posixpath.join(home, match[2]))
        there = pages.get(path) or path.removeprefix("docs/")
        if there == path and (ROOT / path).is_file():  # a file of the repository that is no page
            there = f"files/{path}"
            if files.get_file_from_path(there) is None:
                files.append(File.generated(config, there, abs_src_path=str(ROOT / path)))
        return match[1] + posixpath.relpath(there, posixpath.dirname(page.file.src_uri) or ".") + match[3]

    parts = FENCE.split(markdown)  # text and code in turns
    parts[::2] = [LINK.sub(target, part) for part in parts[::2]]
    return re.sub(r"^```python no-run$", "```python", "".join(parts), flags=re.MULTILINE)


def on_page_content(content, **_):
    """Formulas as MathML, which browsers show by themselves."""

    def formula(match):
        block = match[1] == "div"
        mathml = convert(html.unescape(match[2]), display="block" if block else "inline")
        return f'<div class="formula">{mathml}</div>' if block else mathml

    return FORMULA.sub(formula, content)


def _add(files, config, uri, content, home=None):
    if home is not None:
        _home[uri] = home
    files.append(File.generated(config, uri, content=content))


def _tutorial():
    """The notebook as a page, run, and its pictures by name."""
    lines, pictures = [], {}
    for cell in run(ROOT / NOTEBOOK):
        if cell.kind == "markdown":
            lines.append(cell.source)
            continue
        lines.append(f"```python\n{cell.source}\n```")
        if cell.printed:
            lines.append(f"```text\n{cell.printed.rstrip()}\n```")
        if cell.html:
            lines.append(f'<div class="answer">{cell.html}</div>')
        for picture in cell.pictures:
            name = f"pictures/tutorial_{len(pictures) + 1}.svg"
            pictures[name] = picture
            lines.append(f"![](pictures/{Path(name).name})")
    return "\n\n".join(lines) + "\n", pictures


def _rooms():
    """(name, text) of the pages of names: the front door's table, then what each room has."""
    package = griffe.load("armload", search_paths=[str(ROOT / "src")], extensions=griffe.load_extensions(Shown))
    rows = ["| name | what it is |", "|---|---|"]
    for name in sorted(package.exports, key=str.lower):
        thing = package.members[name].final_target
        room = thing.path.split(".")[1]
        there = f"armload.{room}.{name}"
        about = thing.docstring.value.splitlines()[0] if thing.docstring else ""
        label = f"`{name}`" if room == "version" else f"[`{name}`][{there}]"
        rows.append(f'| <a id="armload.{name}"></a>{label} | {about} |')
    yield "armload", "\n".join(["# armload", "", package.docstring.value, "", *rows, ""])
    for room, module in sorted(package.modules.items()):
        if room == "errors" or (module.exports and room != "app"):
            yield room, f"# armload.{room}\n\n::: armload.{room}\n" + "".join(_shadowed(module))


def _shadowed(room):
    """Entries of the names that a module of the room has, too: griffe shows a room's modules by these."""
    for name in room.exports or []:
        if room.members[name].is_module:
            options = "{ show_root_heading: true, show_root_full_path: false, show_root_toc_entry: true }"
            yield f'\n<a id="{room.path}.{name}"></a>\n\n::: {room.path}.{name}.{name}\n    options: {options}\n'

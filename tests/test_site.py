"""The site is built strictly, so no link in it is broken; it has every page and public name, and the tutorial runs."""

import importlib
import json
import os
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import armload

pytestmark = pytest.mark.full

ROOT = Path(__file__).resolve().parents[1]
TUTORIAL = ROOT / "docs" / "tutorial.ipynb"
ROOMS = [m.name for m in pkgutil.iter_modules(armload.__path__) if m.ispkg and m.name != "app"]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stderr
    return folder


def anchors(page):
    return set(re.findall(r'\bid="([^"]+)"', page.read_text(encoding="utf-8")))


def test_every_page_is_in_the_site_and_in_its_navigation(site):
    start = (site / "index.html").read_text(encoding="utf-8")
    pages = ["index", "tutorial", "contributing", "changelog", *(page.stem for page in (ROOT / "docs").glob("*.md"))]
    for page in pages:
        assert (site / f"{page}.html").is_file()
        assert f'href="{page}.html"' in start or page == "index"


def test_every_public_name_is_explained(site):
    for room in ROOMS:
        names = {f"armload.{room}.{name}" for name in importlib.import_module(f"armload.{room}").__all__}
        missing = names - anchors(site / "api" / f"{room}.html")
        assert not missing, f"give them a docstring, or a constant a comment: {sorted(missing)}"
    assert {f"armload.{name}" for name in armload.__all__} <= anchors(site / "api" / "armload.html")


def test_no_page_needs_the_network(site):
    """Scripts, styles and pictures are the site's own, and formulas need no script."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|img|link)\b[^>]*(?:src|href)="(?:https?:)?//[^"]*"', text), page.name
        assert "arithmatex" not in text, f"{page.name} shows a formula as its source"
    assert (site / "index.html").read_text(encoding="utf-8").count("<math") == 2


def test_the_tutorial_shows_its_answers(site):
    """Its cells have run in order; the ten true parameters lie inside the intervals; the notebook stores no output."""
    page = (site / "tutorial.html").read_text(encoding="utf-8")
    assert page.count('<div class="answer"><table>') == 2
    assert re.search(r"inside: \[( ?True){10}\]", re.sub(r" +", " ", page))
    assert (site / "pictures" / "tutorial_1.svg").read_text(encoding="utf-8").count("<svg") == 1
    for cell in json.loads(TUTORIAL.read_text(encoding="utf-8"))["cells"]:
        assert not cell.get("outputs")

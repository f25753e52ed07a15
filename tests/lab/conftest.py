"""What the tests of the studies' pages share."""

import importlib
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def written(monkeypatch):
    """A script that writes a page, the committed results that it writes from, and the page's text."""

    def load(script, page, *results):
        monkeypatch.syspath_prepend(ROOT / "benchmarks")
        found = [
            json.loads((ROOT / "benchmarks" / "results" / f"{name}.json").read_text(encoding="utf-8"))
            for name in results
        ]
        return importlib.import_module(script), (ROOT / "docs" / page).read_text(encoding="utf-8"), *found

    return load

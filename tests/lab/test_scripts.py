"""The scripts beside the package go with it: each one's imports and names are those of the code as it stands."""

import importlib
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.py")))
def test_a_script_finds_what_it_imports(name, monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    script = importlib.import_module(name)
    assert script.__doc__

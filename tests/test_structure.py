"""What benchmarks/structure.py counts, on a package small enough to count by hand."""

import sys
from pathlib import Path

import pytest

SCRIPTS = str(Path(__file__).resolve().parents[1] / "benchmarks")
FILES = {
    "__init__.py": "",
    "low/__init__.py": "from armload.low.first import One\n",
    "low/first.py": "LIMIT, _SPAN = 3, (0.5, 2 * -1.5)  # two numbers\nNAMES = ('a', 'b')\nclass One: ...\n",
    "low/second.py": "from armload.low.first import One\nclass Two(One): ...\nSTEP: float = 1e-3\nstep, ON = 4, True\n",
    "high/__init__.py": "",
    "high/left.py": "import armload.high.right\nfrom armload.low import second\n\nclass Three(second.Two): ...\n",
    "high/right.py": "from armload.high import left\n",
    "identification.py": "def late():\n    from armload.low import second\n    return second\n",
    "online.py": (
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from armload.high import left\n"
        "try:\n    from .low import first\nexcept ImportError:\n    from . import identification\n"
    ),
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(SCRIPTS)
    import structure

    for name, text in FILES.items():
        path = tmp_path / "armload" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    yield structure.Package(tmp_path)
    sys.modules.pop("structure", None)


def test_rooms_modules_and_lines_are_those_of_the_files(package):
    found = package.measured()
    assert (found["rooms"], found["modules"]) == (4, len(FILES))
    assert found["lines"] == sum(text.count("\n") for text in FILES.values())
    assert found["longest module"] == {"lines": 7, "module": "armload.online"}


def test_arrows_lead_from_room_to_room_wherever_the_import_stands(package):
    assert package.arrows == {
        ("high", "low"),
        ("identification", "low"),
        ("online", "high"),
        ("online", "low"),
        ("online", "identification"),
    }


def test_a_circle_is_of_imports_that_run_on_loading(package):
    assert package.circles == [["armload.high.left", "armload.high.right"]]


def test_inheritance_is_counted_over_modules(package):
    assert package.inheritance == 3


def test_named_numbers_are_those_of_all_modules_an_entry_point_may_come_to_load(package):
    found = package.measured()
    assert found["constants, identify"] == 3  # LIMIT, _SPAN and STEP, neither NAMES nor ON
    assert found["constants, stream"] == 3  # by way of identification

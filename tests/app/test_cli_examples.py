"""The examples run, and say what they promise."""

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("*.py"))
PROMISED = {
    "identify_a_log": "rls-filter: 1.4",
    "design_and_export_a_motion": "excitation.script",
    "learn_and_refuse": "does not follow a motion",
    "simulate_two_logs": "loaded.csv: 5481 samples, 6.0 s",
}


SLOW = {"learn_and_refuse"}  # trains


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[pytest.mark.full] if path.stem in SLOW else [], id=path.stem) for path in EXAMPLES],
)
def test_an_example_runs_and_keeps_its_promise(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(path)])
    runpy.run_path(str(path), run_name="__main__")
    assert PROMISED[path.stem] in capsys.readouterr().out


def test_every_example_has_a_promise():
    assert {path.stem for path in EXAMPLES} == set(PROMISED)

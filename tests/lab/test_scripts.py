"""The scripts beside the package go with it: each one's imports and names are those of the code as it stands."""

import importlib
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.py")))
def test_a_script_finds_what_it_imports(name, monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    script = importlib.import_module(name)
    assert script.__doc__


def test_each_script_that_can_be_run_is_on_the_page_of_reruns_as_it_says_of_itself(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    script = importlib.import_module("list_of_scripts")
    assert script.listed() in script.PAGE.read_text(encoding="utf-8")


def test_a_survey_of_a_long_log_is_measured_again_at_another_rate_and_kept_beside_others(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(FOLDER)
    script, results = importlib.import_module("long_logs"), []

    def measured(kind, seconds, rate, _):
        return {"kind": kind, "log [s]": seconds, "file [MB]": rate, "peak [MB]": 1.0, "cpu [s]": 1.0}

    monkeypatch.setattr(script, "measured", measured)
    monkeypatch.setattr(script, "write", lambda _, result: results.append(result["logs"]))
    monkeypatch.setattr(script, "write_table", lambda *_: None)
    for seconds, rate in (("60", "100"), ("60", "200"), ("90", "200")):
        words = ["long_logs.py", "--kinds", "csv", "--seconds", seconds, "--rate", rate, "--out", str(tmp_path)]
        monkeypatch.setattr(sys, "argv", words)
        script.main()
    assert [[(one["log [s]"], one["file [MB]"]) for one in logs] for logs in results] == [
        [(60.0, 100.0)],
        [(60.0, 200.0)],
        [(60.0, 200.0), (90.0, 200.0)],
    ]


def test_an_arm_of_loose_grippers_is_measured_again_by_another_code_and_where_its_file_is_damaged(
    monkeypatch, tmp_path
):
    monkeypatch.syspath_prepend(FOLDER)
    script, calls = importlib.import_module("loose_grippers"), []

    def of_arm(_, k, seed, __):
        calls.append(k)
        gaps = {f"{gap:g}": {"z": gap, "gap [mm]": gap} for gap in script.GAPS}
        return {"seed": seed, "arm": k, "role": "sound", "of gaps": gaps}

    for name, put in (("of_arm", of_arm), ("write", lambda *_: None), ("write_table", lambda *_: None)):
        monkeypatch.setattr(script, name, put)
    monkeypatch.setattr(sys, "argv", ["loose_grippers.py", "--seeds", "61", "--out", str(tmp_path)])
    script.main()
    (tmp_path / "61-2-30.json").write_text('{"seed": 61, "ar')
    script.main()
    assert calls == [0, 1, 2, 3, 2]
    monkeypatch.setattr(script, "source_key", lambda *_: "another")
    script.main()
    assert calls == [0, 1, 2, 3, 2, 0, 1, 2, 3]

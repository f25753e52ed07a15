"""The questions of docs/survey.md, asked of a table in SQL, have the answers that the report gives."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from test_findings import row

from armload.survey import write_rows
from armload.survey.findings import arm_findings, doubtful
from armload.survey.shift import shifts

PAGE = Path(__file__).resolve().parents[2] / "docs" / "survey.md"


@pytest.fixture(scope="module")
def rows():
    made, rng = [], np.random.default_rng(5)
    for day in range(20):
        made.append(row("sound", day, changed=day == 15))
        made.append(row("exchanged", day, changed=day >= 12, reason=""))
        made.append(row("held nothing", day, held=False, consistent=day != 3, misfit=None))
    for one in made:
        one |= {f"{name}_{j}": float(0.05 * rng.normal()) for name in ("offset", "coulomb") for j in range(1, 8)}
        one["coulomb_4"] += 0.4 * (one["arm"] == "held nothing" and one["date"] > made[30]["date"])
    made.append(row("sound", 30) | {"status": "unusable", "reason": "cut off", "held": None, "misfit": None})
    return made


@pytest.fixture(scope="module")
def answers(rows, tmp_path_factory):
    """What DuckDB answers to each block of SQL on the page."""
    duckdb = pytest.importorskip("duckdb")
    table = tmp_path_factory.mktemp("questions") / "survey.parquet"
    write_rows(table, rows, 7)
    blocks = re.findall(r"```sql\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    with duckdb.connect() as connection:
        return [connection.execute(block.replace("survey.parquet", str(table))).fetchall() for block in blocks]


def test_what_was_held(rows, answers):
    held = [one for one in rows if one["held"]]
    assert [(arm, mass) for arm, _, _, mass, _, _ in answers[0]] == [
        (one["arm"], one["mass"]) for one in sorted(held, key=lambda one: (one["arm"], one["date"]))
    ]


def test_what_is_in_doubt(rows, answers):
    assert {log for log, *_ in answers[1]} == {one["log"] for one in doubtful(rows)}
    assert ("sound/30.csv", None, 0.0, "cut off") in answers[1]


def test_which_arms_to_tare(rows, answers):
    assert answers[2] == [("exchanged", 0.8)]
    assert [f.arm for f in arm_findings(rows) if f.changed is not None and f.changed >= 0.5] == ["exchanged"]


def test_which_arms_are_others_than_before(rows, answers):
    found = shifts([one for one in rows if one["status"] == "answered"], 7)
    assert [arm for arm, _ in answers[3]] == [arm for arm, shift in found.items() if shift.found] == ["held nothing"]
    assert answers[3][0][1] == pytest.approx(found["held nothing"].z)

"""How much an arm may have changed since its tare: by what is said, by the logs' clocks; files' dates only warn."""

import os
from dataclasses import replace

import pytest

from armload.identification.tare_age import ALLOWED, DAY, SESSION, drift_after, drift_since
from armload.recording import Recording

LONG_AGO = 1.7e9  # [s since 1970]


@pytest.fixture
def log():
    return Recording(t=[0.0, 10.0], q=[[0.0], [1.0]], dq=[[0.0], [0.0]], tau=[[0.0], [0.0]], source="stream")


def written(folder, name, log, when):
    """A log whose file was last written then; None: it has none."""
    file = folder / name
    if when is not None:
        file.write_text("")
        os.utime(file, (when, when))
    return replace(log, source=str(file))


@pytest.mark.parametrize(
    ("tare", "run", "said"),
    [
        (LONG_AGO, LONG_AGO + 3.0 * DAY, True),
        (LONG_AGO + 3.0 * DAY, LONG_AGO, True),
        (LONG_AGO, LONG_AGO + 0.9 * DAY, False),
        (LONG_AGO, None, False),
        (None, LONG_AGO, False),
        (None, None, False),
    ],
)
def test_files_whose_dates_are_days_apart_are_said_and_change_no_interval(tare, run, said, log, tmp_path):
    drift, notes = drift_since(written(tmp_path, "tare", log, tare), written(tmp_path, "run", log, run), None)
    assert drift == 0.0
    assert len(notes) == said
    assert all(note.endswith("dates are 3d apart: if the tare is that old, say --tare-age 3d") for note in notes)


def test_clocks_and_what_is_said_count_from_the_tare_s_end_and_no_file_s_date_does(log, tmp_path):
    tare = written(tmp_path, "tare", replace(log, t=log.t + LONG_AGO), LONG_AGO)
    run = written(tmp_path, "run", replace(log, t=log.t + LONG_AGO + 10.0 + 4.0 * DAY), LONG_AGO + 90.0 * DAY)
    drift, (note,) = drift_since(tare, run, None)
    assert drift == pytest.approx(2.0)  # deviations of a day, of a random walk: √4
    assert "4d old" in note
    assert drift_since(tare, run, 0.25 * DAY) == (pytest.approx(0.5), ())
    assert drift_since(tare, run, SESSION) == (0.0, ())
    assert drift_after(1e9) == ALLOWED

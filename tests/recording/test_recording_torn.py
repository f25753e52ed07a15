"""A log whose writer was killed, or whose machine lost its power, can be read up to its last whole row."""

import numpy as np
import pytest

from armload.errors import RecordingError
from armload.recording import read_recording

HEADER = "t,q1,dq1,tau1\n"
ROWS = [[0.0, 1.5, -2.25e-3, 3.0], [0.1, 1.25, -2.0, 3.5], [0.2, -1.125, 2.5e-05, -13.5]]
WHOLE = HEADER + "".join(",".join(map(repr, row)) + "\n" for row in ROWS)
LAST = WHOLE[:-1].rindex("\n") + 1


@pytest.mark.parametrize("end", range(LAST, len(WHOLE) + 1))
@pytest.mark.parametrize("zeros", [0, 7])
def test_a_last_line_cut_anywhere_leaves_the_rows_before_it_as_they_were(tmp_path, end, zeros):
    path = tmp_path / "log.csv"
    path.write_bytes(WHOLE[:end].encode() + bytes(zeros))
    log = read_recording(path)
    np.testing.assert_array_equal(np.column_stack([log.t, log.q, log.dq, log.tau])[:2], ROWS[:2])
    whole_row = WHOLE[LAST:end].count(",") == 3 and WHOLE[end - 1] not in ",-"
    assert len(log) == (3 if end == len(WHOLE) or (whole_row and not zeros) else 2)
    assert bool(log.notes) == ((len(log) == 2 and end > LAST) or zeros > 0)
    assert all("the last line" in note for note in log.notes)


@pytest.mark.parametrize("line", ["0.3,1,2\n", "0.3,1,fast", "0.3,fast,2", "0.3,1,2,3,4", "0.3,nan,1", "a note"])
def test_a_last_line_that_is_wrong_but_not_cut_off_is_refused(tmp_path, line):
    path = tmp_path / "log.csv"
    path.write_text(WHOLE + line)
    with pytest.raises(RecordingError, match="line 5"):
        read_recording(path)


def test_zero_bytes_inside_a_log_are_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(WHOLE[:LAST].encode() + bytes(5) + WHOLE[LAST:].encode())
    with pytest.raises(RecordingError, match="zero bytes"):
        read_recording(path)

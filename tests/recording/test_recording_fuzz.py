"""Whatever bytes a log file holds, reading it gives a Recording or one RecordingError of one line."""

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from test_recording import log
from test_recording_bags import samples, storage, write_bag

from armload.errors import RecordingError
from armload.recording import Recording, read_recording, write_recording

SUFFIXES = (".csv", ".parquet", ".npz", ".bag", ".db3", ".mcap")
SIGNATURES = [
    b"",
    b"t,q1,dq1,tau1\n",
    b"PAR1",
    b"PK\x03\x04",
    b"#ROSBAG V2.0\n",
    b"SQLite format 3\x00",
    b"\x89MCAP0\r\n",
]
fuzz = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))


@pytest.fixture(scope="module", params=SUFFIXES)
def sound(request, tmp_path_factory):
    """A sound file of each kind, to be overwritten, and beside it the same bytes to start from."""
    folder = tmp_path_factory.mktemp("sound")
    if request.param in (".bag", ".db3", ".mcap"):
        path = storage(write_bag(folder, request.param[1:], {"/joint_states": samples(rows=8)}))
    else:
        path = folder / f"log{request.param}"
        write_recording(path, log(n=7, rows=8))
    whole = folder / "whole"
    whole.write_bytes(path.read_bytes())
    return path, whole


def read_or_refuse(path, arm=None):
    """The Recording, or None if it is refused in the one right way."""
    try:
        recording = read_recording(path, arm)
    except RecordingError as error:
        text = str(error)
    else:
        assert isinstance(recording, Recording)
        assert np.isfinite(recording.q).all()
        return recording
    assert "\n" not in text
    assert str(path) in text
    return None


@fuzz
@given(signature=st.sampled_from(SIGNATURES), rest=st.binary(max_size=200))
@example(signature=b"", rest=b"\x1c")  # a line of nothing that Python's strip removes
def test_any_bytes_are_read_or_refused(sound, signature, rest):
    path, _ = sound
    path.write_bytes(signature + rest)
    read_or_refuse(path)


@fuzz
@given(data=st.data())
def test_a_sound_file_with_damage_is_read_or_refused(sound, data):
    path, whole = sound
    damaged = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(damaged) - 1))
        piece = data.draw(st.one_of(st.binary(min_size=1, max_size=8), st.sampled_from([b"\xff" * 8, b"\0" * 8])))
        if data.draw(st.booleans()):
            damaged[place : place + len(piece)] = piece
        else:
            damaged[place:place] = piece
    path.write_bytes(damaged)
    read_or_refuse(path)


@fuzz
@given(share=st.floats(0, 1, exclude_max=True))
def test_a_file_cut_off_is_read_or_refused(sound, share, panda):
    path, whole = sound
    data = whole.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    recording = read_or_refuse(path, panda)
    assert recording is None or (path.suffix in (".csv", ".mcap") and len(recording) <= 8)


@fuzz
@given(text=st.text(st.sampled_from('0123456789.,-+eE \n\r"tqdau12;\t\0nanif'), max_size=120))
def test_any_text_after_a_header_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("text") / "log.csv"
    path.write_text("t,q1,dq1,tau1\n" + text, newline="")
    read_or_refuse(path)

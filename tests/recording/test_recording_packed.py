"""Packed logs are read as what is in them, and a damaged or ambiguous one is refused in one sentence."""

import bz2
import gzip
import io
import lzma
import shutil
import tempfile
import zipfile

import numpy as np
import pytest

from armload import arm
from armload.errors import RecordingError
from armload.recording import has_topics, is_log, read_long, read_recording, recording_chunks, write_recording

PACKERS = {".gz": gzip.compress, ".bz2": bz2.compress, ".xz": lzma.compress}


@pytest.fixture(scope="module")
def panda():
    return arm("panda")


@pytest.fixture
def log(analytic_log, panda):
    return analytic_log(panda, duration=1.0)


def zipped(members):
    kept = io.BytesIO()
    with zipfile.ZipFile(kept, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return kept.getvalue()


def same(a, b):
    return all(np.array_equal(getattr(a, x), getattr(b, x)) for x in ("t", "q", "dq", "tau"))


@pytest.mark.parametrize("packed", PACKERS)
@pytest.mark.parametrize("form", [".csv", ".npz", ".parquet"])
def test_a_packed_log_is_read_as_what_is_in_it_and_keeps_its_name(tmp_path, panda, log, form, packed):
    write_recording(tmp_path / f"run{form}", log)
    path = tmp_path / f"run{form}{packed}"
    path.write_bytes(PACKERS[packed]((tmp_path / f"run{form}").read_bytes()))
    read = read_recording(path, panda)
    assert same(read, log)
    assert read.source == str(path)
    assert is_log(path)


@pytest.mark.parametrize("name", ["run.zip", "run.csv.zip", "run.CSV.ZIP"])
def test_a_zip_of_one_log_is_that_log_whatever_else_it_holds(tmp_path, panda, log, name):
    write_recording(tmp_path / "run.csv", log)
    members = {
        "cell/Run 1.CSV": (tmp_path / "run.csv").read_bytes(),
        "cell/readme.md": b"x",
        "__MACOSX/._run.csv": b"x",
    }
    (tmp_path / name).write_bytes(zipped(members))
    assert same(read_recording(tmp_path / name, panda), log)


def test_a_zip_of_several_logs_or_of_none_is_refused_by_their_names(tmp_path):
    (tmp_path / "two.zip").write_bytes(zipped({"a.csv": b"x", "b.csv": b"x"}))
    (tmp_path / "none.zip").write_bytes(zipped({"a.md": b"x"}))
    with pytest.raises(RecordingError, match=r"two.zip holds 2 logs \(a.csv, b.csv\): expected one log; unpack it"):
        read_recording(tmp_path / "two.zip")
    with pytest.raises(RecordingError, match=r"none.zip holds no log: expected one log"):
        read_recording(tmp_path / "none.zip")


@pytest.mark.parametrize("packed", [*PACKERS, ".zip"])
@pytest.mark.parametrize("flaw", ["cut", "junk"])
def test_a_damaged_packed_log_is_refused_in_one_sentence(tmp_path, log, packed, flaw):
    write_recording(tmp_path / "run.csv", log)
    content = (tmp_path / "run.csv").read_bytes()
    whole = PACKERS[packed](content) if packed in PACKERS else zipped({"run.csv": content})
    path = tmp_path / f"run.csv{packed}"
    path.write_bytes(whole[: len(whole) // 2] if flaw == "cut" else b"nothing of the kind" * 100)
    with pytest.raises(RecordingError, match=rf"run.csv\{packed} cannot be unpacked: .+; unpack by hand") as found:
        read_recording(path)
    assert "\n" not in str(found.value)


def test_a_zip_with_a_password_is_refused_in_one_sentence(tmp_path):
    path = tmp_path / "secret.zip"
    whole = bytearray(zipped({"run.csv": b"t,q1\n" * 100}))
    whole[6] |= 1  # encrypted, says the local header
    at = whole.index(b"PK\x01\x02")
    whole[at + 8] |= 1  # and the archive's directory
    path.write_bytes(bytes(whole))
    with pytest.raises(RecordingError, match=r"secret.zip cannot be unpacked: .*encrypted"):
        read_recording(path)


def test_a_flaw_within_a_packed_log_is_told_by_the_packed_file_and_the_line(tmp_path, panda):
    (tmp_path / "run.csv.gz").write_bytes(gzip.compress(b"t,q1\n0,x\n"))
    with pytest.raises(RecordingError, match=r"run\.csv\.gz"):
        read_recording(tmp_path / "run.csv.gz", panda)


def test_a_long_packed_log_is_spooled_and_its_copy_is_gone_afterwards(tmp_path, monkeypatch, panda, log):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    write_recording(tmp_path / "run.csv", log)
    (tmp_path / "run.csv.gz").write_bytes(gzip.compress((tmp_path / "run.csv").read_bytes()))
    chunks = list(recording_chunks(tmp_path / "run.csv.gz", panda, size=50))
    assert len(chunks) > 1
    assert np.array_equal(np.concatenate([chunk.tau for chunk in chunks]), log.tau)
    assert same(read_long(tmp_path / "run.csv.gz", panda, long=100, size=50), log)
    assert not [path for path in temporary.iterdir() if path.is_dir()]


def test_a_real_bag_that_is_packed_is_still_a_bag(tmp_path, real_data):
    bag = real_data / "ur10_ros2_bag.db3"
    with bag.open("rb") as file, gzip.open(tmp_path / "run.db3.gz", "wb", compresslevel=1) as packed:
        shutil.copyfileobj(file, packed)
    assert has_topics(tmp_path / "run.db3.gz")
    assert same(read_recording(tmp_path / "run.db3.gz", arm("ur10")), read_recording(bag, arm("ur10")))

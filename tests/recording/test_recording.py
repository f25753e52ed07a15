"""CSV, Parquet and NPZ logs: what is written is read back to the bit, and every fault is named by its place."""

import bz2
import gzip
import io
import lzma
import os
import re
import zipfile

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pyarrow import parquet

from armload.errors import RecordingError
from armload.recording import Recording, read_recording, write_recording
from armload.recording.columns import column_names

SUFFIXES = (".csv", ".parquet", ".npz")


def log(n=2, rows=5, seed=0, **about):
    rng = np.random.default_rng(seed)
    return Recording(np.arange(rows) * 0.004, *rng.normal(size=(3, rows, n)), **about)


def text(recording):
    """The log as CSV text, written by numpy rather than by armload."""
    out = io.StringIO()
    table = np.hstack([recording.t[:, None], recording.q, recording.dq, recording.tau])
    np.savetxt(out, table, delimiter=",", header=",".join(column_names(recording.n)), comments="", fmt="%.17g")
    return out.getvalue()


def same(a, b):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("t", "q", "dq", "tau"))


finite = st.floats(allow_nan=False, allow_infinity=False, width=64)


@st.composite
def recordings(draw):
    n, rows = draw(st.integers(1, 8)), draw(st.integers(2, 12))
    t = sorted(draw(st.sets(finite, min_size=rows, max_size=rows)))
    q, dq, tau = (draw(arrays(np.float64, (rows, n), elements=finite)) for _ in range(3))
    return Recording(np.array(t), q, dq, tau)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_double_survives_writing_and_reading(tmp_path_factory, suffix):
    folder = tmp_path_factory.mktemp("round")

    @settings(max_examples=40, deadline=None)
    @given(recordings())
    def survives(recording):
        path = folder / f"log{suffix}"
        write_recording(path, recording)
        assert same(read_recording(path), recording)

    survives()


@pytest.mark.parametrize("suffix", [".parquet", ".npz"])
def test_channel_and_joint_names_survive_where_the_file_can_hold_them(tmp_path, suffix):
    path = tmp_path / f"log{suffix}"
    write_recording(path, log(channel="external", joint_names=("hip", "knee")))
    back = read_recording(path)
    assert (back.channel, back.joint_names) == ("external", ("hip", "knee"))


def test_csv_refuses_a_channel_it_cannot_hold(tmp_path):
    with pytest.raises(RecordingError, match=r"CSV cannot say that tau is the desired torque"):
        write_recording(tmp_path / "log.csv", log(channel="desired"))
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path, suffix, monkeypatch):
    path = tmp_path / f"log{suffix}"
    write_recording(path, log(seed=1))
    before = path.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RecordingError, match="No space left on device"):
        write_recording(path, log(seed=2))
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_writing_needs_a_known_suffix_and_a_folder(tmp_path):
    with pytest.raises(RecordingError, match=r"unsupported suffix '\.txt': expected \.csv"):
        write_recording(tmp_path / "log.txt", log())
    with pytest.raises(RecordingError, match=r"cannot be written: No such file or directory"):
        write_recording(tmp_path / "nowhere" / "log.csv", log())


def test_columns_are_taken_by_name(tmp_path):
    recording = log(n=3, rows=6)
    header, *rows = text(recording).splitlines()
    order = np.random.default_rng(0).permutation(len(column_names(3)))
    turned = [",".join(np.array(line.split(","))[order]) for line in (header, *rows)]
    (tmp_path / "log.csv").write_text("\n".join(turned))
    assert same(read_recording(tmp_path / "log.csv"), recording)


@pytest.mark.parametrize(
    "change",
    [
        lambda s: s.replace("\n", "\r\n"),
        lambda s: s.replace("\n", "\r"),
        lambda s: "\ufeff" + s,
        lambda s: s + "\n\n",
        lambda s: s.replace("\n", "\n\n"),
        lambda s: s.replace(",", " , "),
        lambda s: '"' + s.replace(",", '","').replace("\n", '"\n"').removesuffix('"'),
        lambda s: s.replace(",0", ",+0").replace(",1", ",+1"),
        lambda s: s.rstrip("\n"),
        lambda s: s.replace("e-", "E-"),
        lambda s: "\n" + s,
        lambda s: s.replace(",", ";"),
        lambda s: s.replace(",", "\t"),
        lambda s: s.replace(",", " "),
        lambda s: s.replace(",", "  ").replace("\n", "\n  "),
        lambda s: s.replace(",", ";").replace(".", ","),
        lambda s: s.replace(",", "\t").replace(".", ","),
        lambda s: s.replace(",", " ").replace(".", ","),
        lambda s: "# made on Monday\n% at 4 kHz\n" + s,
        lambda s: "# " + s,
        lambda s: "# made on Monday\n# " + s,
        lambda s: "\ufeff# made on Monday\n" + s.replace(",", ";").replace(".", ","),
        lambda s: "\ufeffsep=;\r\n" + s.replace(",", ";").replace(".", ",").replace("\n", "\r\n"),
        lambda s: "sep=,\n# made on Monday\n" + s,
    ],
    ids=[
        *("crlf", "cr", "bom", "blank end", "blank lines", "spaces", "quotes", "plus", "no last newline", "capital e"),
        *("blank start", "semicolons", "tabs", "parted by spaces", "aligned", "decimal commas; semicolons"),
        *("decimal commas, tabs", "decimal commas, spaces", "comments", "commented header", "both", "excel"),
        *("separator told to excel", "and a comment"),
    ],
)
def test_harmless_variants_of_csv_read_the_same(tmp_path, change):
    recording = log(n=2, rows=8)
    (tmp_path / "log.csv").write_bytes(change(text(recording)).encode())
    assert same(read_recording(tmp_path / "log.csv"), recording)


DATES = np.datetime64("2026-03-02T10:00:00") + np.arange(5) * np.timedelta64(4, "ms")


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("t", DATES, "t is datetime64"),
        ("t", DATES - DATES[0], "t is timedelta64"),
        ("q", np.full((5, 2), 1j), "q is complex128"),
        ("q", [[0.0, 1.0]] * 4 + [[0.0]], "q is a list"),
        ("tau", "run.csv", "tau is a str"),
    ],
)
def test_arrays_of_no_real_numbers_are_refused_and_not_cast(field, value, said):
    """Nanoseconds would pass for seconds, and an imaginary part would be lost."""
    whole = log()
    arrays = {name: getattr(whole, name) for name in ("t", "q", "dq", "tau")}
    with pytest.raises(RecordingError, match=f"{said}.*expected real numbers"):
        Recording(**arrays | {field: value})
    advised = (DATES - DATES[0]) / np.timedelta64(1, "s")
    np.testing.assert_allclose(Recording(**arrays | {"t": advised}).t, whole.t, atol=1e-12)


@pytest.mark.parametrize("names", [("a",), ("a", "b", "c"), "ab"])
def test_joint_names_are_as_many_as_joints(names):
    with pytest.raises(RecordingError, match="expected one for each of 2 joints"):
        log(joint_names=names)
    assert log(joint_names=["a", "b"]).joint_names == ("a", "b")


def test_an_arm_that_is_only_named_is_refused_in_a_sentence(tmp_path):
    write_recording(tmp_path / "log.csv", log(n=2, rows=8))
    with pytest.raises(RecordingError, match=r"is given as 'panda': expected an Arm, such as armload.arm\('panda'\)"):
        read_recording(tmp_path / "log.csv", "panda")


def cell(line, column, value):
    """A change of one cell of a CSV text; the header is line 1."""

    def change(s):
        lines = s.splitlines()
        cells = lines[line - 1].split(",")
        cells[lines[0].split(",").index(column)] = value
        lines[line - 1] = ",".join(cells)
        return "\n".join(lines) + "\n"

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda _: "", r"is empty"),
        (lambda _: " \n\n", r"is empty"),
        (lambda s: s.splitlines()[0], r"holds no rows of data: expected at least 2"),
        (lambda s: "\n".join(s.splitlines()[:2]), r"holds only 1 row of data: expected at least 2"),
        (
            lambda s: "\n".join([*s.splitlines()[:2], s.splitlines()[1]]) + "\n",
            r"only 1 row of data, 2 times: expected",
        ),
        (cell(4, "q2", "fast"), r", line 4: q2 is 'fast': expected a number"),
        (cell(4, "q2", "1_0"), r", line 4: q2 is '1_0'"),
        (cell(4, "q2", "0x10"), r", line 4: q2 is '0x10'"),
        (cell(5, "tau1", ""), r", line 5: tau1 is empty"),
        (cell(3, "dq1", "NaN"), r", line 3: dq1 is NaN"),
        (cell(3, "dq1", "-inf"), r", line 3: dq1 is infinite"),
        (cell(3, "dq1", "1e999"), r", line 3: dq1 is infinite"),
        (cell(5, "t", "0.001"), r", line 5: t = 0\.001000 s goes back in time from line 4"),
        (cell(5, "t", "0.008"), r", line 5: t = 0\.008000 s repeats the time of line 4"),
        (lambda s: cell(7, "t", "0.001")(s.replace("\n", "\n\n")), r", line 7: t = 0\.001000 s goes back .* line 5"),
        (lambda s: s + "0.5,1,2\n", r", line 7 has 3 cells \(the last line: the file may be cut off\): expected 7"),
        (lambda s: s.replace("\n", ",9\n").replace(",9", "", 1), r", line 2 has 8 cells: expected 7"),
        (lambda s: s.replace("tau2", "torque2"), r"lacks column 'tau2' \(it has column 'torque2' instead\)"),
        (lambda s: s.replace("tau2", "temperature"), r"lacks column 'tau2' \(it has column 'temperature' instead\)"),
        (lambda s: s.replace("dq2", "dq1"), r"has the column 'dq1' more than once"),
        (lambda s: s[s.index("\n") + 1 :], r", line 1 holds numbers: expected the header"),
        (lambda s: s.replace("q1", "a").replace("q2", "b"), r"lacks columns"),
        (lambda _: "a,b\n1,2\n3,4\n", r"has no columns named q1, dq1, tau1, …: found a, b"),
        (cell(4, "q2", '"1'), r"cannot be read as CSV"),
        (cell(4, "q2", "1\0"), r", line 4: the file holds zero bytes"),
    ],
)
def test_a_bad_csv_is_refused_by_line_and_column(tmp_path, change, says):
    path = tmp_path / "log.csv"
    path.write_text(change(text(log())))
    with pytest.raises(RecordingError, match=says) as refusal:
        read_recording(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_bytes_that_are_no_text_are_refused_by_line(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(text(log()).encode() + b"\xff\xfe\x00")
    with pytest.raises(RecordingError, match=r", line 7: byte 0xff is not text"):
        read_recording(path)
    path.write_text(text(log()), encoding="utf-16")
    with pytest.raises(RecordingError, match=r"is UTF-16: expected a CSV file in UTF-8"):
        read_recording(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_log_of_another_number_of_joints_is_refused(tmp_path, panda, suffix):
    path = tmp_path / f"log{suffix}"
    write_recording(path, log(n=6))
    with pytest.raises(
        RecordingError, match=r"log has 6 joints \(q1\.\.q6\), panda has 7 up to its frame 'panda_link8'"
    ):
        read_recording(path, panda)
    write_recording(path, log(n=7))
    assert read_recording(path, panda).n == 7


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_rows_repeated_exactly_are_dropped_with_a_note(tmp_path, suffix):
    recording, path = log(rows=6), tmp_path / f"log{suffix}"
    table = np.hstack([recording.t[:, None], recording.q, recording.dq, recording.tau])[[0, 1, 1, 1, 2, 3, 4, 5, 5]]
    if suffix == ".csv":
        np.savetxt(path, table, delimiter=",", header=",".join(column_names(2)), comments="", fmt="%.17g")
    elif suffix == ".parquet":
        parquet.write_table(pa.table(dict(zip(column_names(2), table.T, strict=True))), path)
    else:
        np.savez(path, t=table[:, 0], q=table[:, 1:3], dq=table[:, 3:5], tau=table[:, 5:])
    back = read_recording(path)
    assert same(back, recording)
    (note,) = back.notes
    assert "dropped 3 row(s)" in note
    assert ("line 4" if suffix == ".csv" else "row 2") in note


def columns(**changed):
    recording = log()
    names = column_names(2)
    table = np.hstack([recording.t[:, None], recording.q, recording.dq, recording.tau])
    return {**dict(zip(names, table.T, strict=True)), **changed}


@pytest.mark.parametrize(
    ("table", "says"),
    [
        (columns(q2=["a"] * 5), r"column q2 holds text: expected numbers"),
        (columns(q2=pa.array([1.0, None, 2.0, 3.0, 4.0])), r", row 1: q2 is empty"),
        (columns(q2=[1.0, np.nan, 2.0, 3.0, 4.0]), r", row 1: q2 is NaN"),
        (columns(t=[0.0, 2.0, 1.0, 3.0, 4.0]), r", row 2: t = 1\.000000 s goes back in time from row 1"),
        ({k: v for k, v in columns().items() if k != "dq1"}, r"lacks column 'dq1'"),
        ({k: v[:1] for k, v in columns().items()}, r"holds only 1 row of data"),
    ],
)
def test_a_bad_parquet_is_refused_by_row_and_column(tmp_path, table, says):
    parquet.write_table(pa.table(table), tmp_path / "log.parquet")
    with pytest.raises(RecordingError, match=says):
        read_recording(tmp_path / "log.parquet")


def stacks(**changed):
    recording = log()
    return {"t": recording.t, "q": recording.q, "dq": recording.dq, "tau": recording.tau, **changed}


@pytest.mark.parametrize(
    ("stack", "says"),
    [
        (stacks(q=log().q.T), r"q has shape|dq has shape"),
        (stacks(tau=log().tau.T), r"tau has shape \(2, 5\): expected \(5, 2\).*transpose"),
        (stacks(t=log().t[:, None]), r"t has shape \(5, 1\)"),
        (stacks(tau=np.array([["a", "b"]] * 5)), r"array tau holds <U1: expected real numbers"),
        (stacks(tau=log().tau * 1j), r"array tau holds complex128"),
        (stacks(tau=np.array([[None, {}]] * 5)), r"not a NumPy archive that can be read: it holds Python objects"),
        (stacks(channel="guessed"), r"channel is 'guessed': expected one of measured, desired, external"),
        ({"t": log().t, "q": log().q}, r"lacks columns of torque"),
    ],
)
def test_a_bad_npz_is_refused_by_array(tmp_path, stack, says):
    np.savez(tmp_path / "log.npz", **stack)
    with pytest.raises(RecordingError, match=says):
        read_recording(tmp_path / "log.npz")


def test_what_is_no_log_file_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r"none\.csv does not exist"):
        read_recording(tmp_path / "none.csv")
    with pytest.raises(RecordingError, match=r"is a folder without metadata\.yaml, \.db3, \.mcap or meta/info\.json"):
        read_recording(tmp_path)
    (tmp_path / "log.dta").write_text(text(log()))
    with pytest.raises(RecordingError, match=r"unsupported suffix '\.dta': expected \.csv, .*\.npz, .*\.bag"):
        read_recording(tmp_path / "log.dta")
    for suffix in (*SUFFIXES, ".bag", ".db3", ".mcap"):
        (tmp_path / f"nothing{suffix}").touch()
        with pytest.raises(RecordingError, match=r"is empty"):
            read_recording(tmp_path / f"nothing{suffix}")
    write_recording(tmp_path / "a.parquet", log())
    (tmp_path / "a.parquet").rename(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match=r"is not a \.csv file: it starts like a \.parquet file; rename it"):
        read_recording(tmp_path / "a.csv")
    write_recording(tmp_path / "b.csv", log())
    with pytest.raises(RecordingError, match=r"only ROS bags have topics"):
        read_recording(tmp_path / "b.csv", topic="/joint_states")


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".h5", ".bag", ".db3", ".mcap"])
def test_text_under_the_name_of_another_form_is_called_text(tmp_path, suffix):
    (tmp_path / f"a{suffix}").write_text("\ufeff" + text(log()))
    with pytest.raises(RecordingError, match=rf"is not a \{suffix} file: it is text; .* its name should end in \.csv"):
        read_recording(tmp_path / f"a{suffix}")


def _zipped(table):
    kept = io.BytesIO()
    with zipfile.ZipFile(kept, "w") as archive:
        archive.writestr("run.csv", table)
    return kept.getvalue()


def _sheet(table):
    kept = io.BytesIO()
    with zipfile.ZipFile(kept, "w") as archive:
        archive.writestr("xl/workbook.xml", table)
    return kept.getvalue()


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
@pytest.mark.parametrize(
    ("pack", "says"),
    [
        (gzip.compress, "it is packed with gzip; let its name end in {suffix}.gz"),
        (bz2.compress, "it is packed with bzip2; let its name end in {suffix}.bz2"),
        (lzma.compress, "it is packed with xz; let its name end in {suffix}.xz"),
        (_zipped, "it is packed with zip; let its name end in .zip"),
        (_sheet, "it is a spreadsheet; save it as CSV"),
    ],
)
def test_a_packed_log_is_called_packed_whatever_its_name(tmp_path, suffix, pack, says):
    (tmp_path / f"a{suffix}").write_bytes(pack(text(log()).encode()))
    with pytest.raises(RecordingError, match=re.escape(f"is not a {suffix} file: {says.format(suffix=suffix)}")):
        read_recording(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
@pytest.mark.parametrize("make", ["cut", "junk", "objects"])
def test_a_damaged_log_is_told_in_own_words(tmp_path, suffix, make):
    path = tmp_path / f"a{suffix}"
    write_recording(path, log())
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if make == "cut" else b"\x00\x01\x02\xff" * 300)
    if make == "objects" and suffix == ".npz":
        np.savez(path, t=np.array([{}], dtype=object))
    with pytest.raises(RecordingError, match=r"damaged or was cut off; copy it|Python objects, or is none") as refused:
        read_recording(path)
    assert not any(word in str(refused.value) for word in ("pickle", "corrupted", "footer", "File is not a zip"))


def test_an_hdf5_log_behind_a_block_of_text_is_no_text(tmp_path):
    h5py = pytest.importorskip("h5py")
    one = log()
    with h5py.File(tmp_path / "a.h5", "w", userblock_size=512) as file:
        for name in ("t", "q", "dq", "tau"):
            file[name] = getattr(one, name)
    with (tmp_path / "a.h5").open("rb+") as file:
        file.write(b"made by hand\n" + b" " * 499)
    np.testing.assert_array_equal(read_recording(tmp_path / "a.h5").q, one.q)


def test_a_file_without_permission_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    write_recording(path, log())

    def denied(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(path), "read_bytes", denied)
    with pytest.raises(RecordingError, match=r"log\.csv cannot be read: Permission denied"):
        read_recording(path)


def test_the_real_logs_read(real_data):
    panda = read_recording(real_data / "panda_unloaded_1khz.csv")
    assert (len(panda), panda.n, round(panda.rate)) == (20784, 7, 1000)
    table = np.loadtxt(real_data / "ur10e_loaded_2805g.csv", delimiter=",", skiprows=1)
    ur = read_recording(real_data / "ur10e_loaded_2805g.csv")
    np.testing.assert_array_equal(np.hstack([ur.t[:, None], ur.q, ur.dq, ur.tau]), table)

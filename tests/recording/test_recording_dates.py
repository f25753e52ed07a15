"""Logs whose times are dates: the same samples, and the day they were recorded."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from armload.errors import RecordingError
from armload.identification.tare_age import DAY, age_of, drift_since
from armload.recording import Recording, read_recording

START = 1_772_456_709_123_456_789  # [ns] since 1970: 2026-03-02 13:05:09.123456789 UTC
STEPS = np.cumsum(np.random.default_rng(1).integers(900_000, 1_100_000, size=30))  # [ns]
VALUES = np.random.default_rng(2).normal(size=(30, 6))
NAMES = ["q1", "q2", "dq1", "dq2", "tau1", "tau2"]


def iso(stamps, zone="", hours=0, between="T", digits=9):
    moved = np.asarray(stamps) + int(hours * 3600) * 1_000_000_000
    texts = (str(np.datetime64(int(stamp), "ns")) for stamp in moved)
    return [text.replace("T", between)[: len(text) - 9 + digits] + zone for text in texts]


def csv(path, cells, name="time", separator=","):
    rows = [separator.join([cell, *map(repr, row)]) for cell, row in zip(cells, VALUES.tolist(), strict=True)]
    path.write_text("\n".join([separator.join([name, *NAMES]), *rows, ""]))
    return path


def table(path, name="time", kind="ns", zone=None):
    stamps = pa.array(START + STEPS, pa.int64()).cast(pa.timestamp("ns", zone))
    columns = {name: stamps.cast(pa.timestamp(kind, zone), safe=False)}
    parquet.write_table(pa.table(columns | dict(zip(NAMES, VALUES.T, strict=True))), path)
    return path


def check(log: Recording, resolution=1e-9):
    """Times between samples are exact to the resolution, the values are untouched, the day is that of START."""
    np.testing.assert_allclose(log.t, (STEPS - STEPS[0]) * 1e-9, rtol=0, atol=1.01 * resolution)
    np.testing.assert_array_equal(np.hstack([log.q, log.dq, log.tau]), VALUES)
    assert log.epoch == pytest.approx((START + STEPS[0]) * 1e-9, abs=1e-5)


@pytest.mark.parametrize(
    ("cells", "resolution"),
    [
        (iso(START + STEPS), 1e-9),
        (iso(START + STEPS, between=" ", digits=6), 1e-6),
        (iso(START + STEPS, zone="Z"), 1e-9),
        (iso(START + STEPS, zone="+05:00", hours=5), 1e-9),
        (iso(START + STEPS, zone="-0330", hours=-3.5), 1e-9),
    ],
    ids=["T", "pandas", "Z", "east", "west"],
)
def test_dates_in_text_are_times_to_their_last_digit(tmp_path, cells, resolution):
    check(read_recording(csv(tmp_path / "log.csv", cells)), resolution)
    check(read_recording(csv(tmp_path / "semicolons.csv", cells, separator=";")), resolution)
    quoted = csv(tmp_path / "quoted.csv", [f'"{cell}"' for cell in cells])
    check(read_recording(quoted), resolution)


@pytest.mark.parametrize(("kind", "resolution"), [("ns", 1e-9), ("us", 1e-6)])
@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_columns_of_timestamps_are_times(tmp_path, kind, resolution, zone):
    check(read_recording(table(tmp_path / "log.parquet", kind=kind, zone=zone)), resolution)


def test_an_archive_may_hold_dates(tmp_path):
    q, dq, tau = np.split(VALUES, 3, axis=1)
    np.savez(tmp_path / "log.npz", t=(START + STEPS).astype("datetime64[ns]"), q=q, dq=dq, tau=tau)
    check(read_recording(tmp_path / "log.npz", columns="t=t"))
    check(read_recording(tmp_path / "log.npz"))


def test_the_index_of_a_data_frame_is_time_if_it_holds_dates(tmp_path):
    check(read_recording(table(tmp_path / "log.parquet", name="__index_level_0__")))
    check(read_recording(csv(tmp_path / "log.csv", iso(START + STEPS), name="")))


def test_a_column_of_dates_does_not_displace_a_column_of_time(tmp_path):
    path = csv(tmp_path / "log.csv", [f"{cell},{k / 10!r}" for k, cell in enumerate(iso(START + STEPS))], "day,t")
    log = read_recording(path)
    np.testing.assert_array_equal(log.t, np.arange(30) / 10)
    assert log.epoch == 0.0


@pytest.mark.parametrize(
    ("cells", "columns", "says"),
    [
        (iso(START + STEPS), "t_unit=ms", r"column 'time' holds dates: expected no t_unit then; leave it out"),
        ([*iso(START + STEPS[:-1]), "later"], None, r"line 31: time is 'later': expected a date, as in the first row"),
        ([*iso(START + STEPS[:-1]), "7.5"], None, r"time' holds dates in some rows only: expected one in every row"),
        (iso(START + STEPS[::-1]), None, r"line 3: t = -.* goes back in time"),
        (["2026-13-02 13:05:09"] * 30, None, r"line 2: time is '2026-13-02 13:05:09': expected a number"),
        (
            iso(START + STEPS[::-1]),
            None,
            r"; sort rows out of order, or cut the log where its clock was set$",
        ),
        (iso(START + STEPS, digits=2), None, r"line 3: t = .* repeats the time of line 2 .*; write them with more dig"),
        (["13:05:09.5"] * 30, None, r"time is '13:05:09.5': expected a number, or a date of the years 1678 to 2261"),
        (["20260302T130509Z"] * 30, None, r"expected a number, or a date .* such as 2026-03-02T14:05:09.123Z$"),
        (
            [f"2262{cell[4:]}" for cell in iso(START + STEPS)],
            None,
            r"'2262-03-02T.*': .* of the years 1678 to 2261",
        ),
        (
            [f"1677{cell[4:]}" for cell in iso(START + STEPS)],
            None,
            r"'1677-03-02T.*': .* of the years 1678 to 2261",
        ),
    ],
    ids=["unit", "text", "number", "backwards", "month 13", "set", "digits", "hours", "basic", "2262", "1677"],
)
def test_dates_that_make_no_sense_are_refused_by_their_place(tmp_path, cells, columns, says):
    with pytest.raises(RecordingError, match=says):
        read_recording(csv(tmp_path / "log.csv", cells), columns=columns)


@pytest.mark.parametrize("year", ["1677", "2262", "9026"])
def test_dates_that_nanoseconds_in_64_bits_do_not_hold_are_refused_and_not_wrapped(tmp_path, year):
    times = np.array([f"{year}{cell[4:]}" for cell in iso(START + STEPS, digits=6)], dtype="datetime64[us]")
    q, dq, tau = np.split(VALUES, 3, axis=1)
    np.savez(tmp_path / "log.npz", time=times, q=q, dq=dq, tau=tau)
    with pytest.raises(RecordingError, match=rf"column time, row 0, is {year}-03-02T.*: expected a date of"):
        read_recording(tmp_path / "log.npz")


@pytest.mark.parametrize(("year", "seconds"), [("1678", -9209328890.9), ("2261", 9188341509.1)])
def test_dates_of_the_first_and_the_last_year_are_times(tmp_path, year, seconds):
    log = read_recording(csv(tmp_path / "log.csv", [f"{year}{cell[4:]}" for cell in iso(START + STEPS)]))
    np.testing.assert_allclose(log.t, (STEPS - STEPS[0]) * 1e-9, rtol=0, atol=1e-9)
    assert log.epoch == pytest.approx(seconds, abs=0.1)


@pytest.mark.parametrize(("began", "dated"), [(0.0, False), (1.79e9, True), (2.53e11, True), (2.54e11, False)])
def test_a_clock_says_a_date_only_where_there_is_one_of_four_digits(began, dated):
    """`datetime` knows no other: a log whose clock is wrong has none, like one whose clock counts from its start."""
    log = Recording(began + 0.01 * np.arange(5), np.zeros((5, 2)), np.zeros((5, 2)), np.zeros((5, 2)))
    assert (log.date is not None) == dated
    if log.date is not None:
        assert 2001 <= datetime.fromtimestamp(log.date, UTC).year <= 9999


def test_dates_tell_the_age_of_a_tare(tmp_path):
    day = int(DAY * 1e9)
    log = read_recording(csv(tmp_path / "log.csv", iso(START + STEPS + 4 * day)))
    tare = read_recording(table(tmp_path / "tare.parquet"))
    drift, said = drift_since(tare, log, None)
    assert drift == pytest.approx(2.0, abs=1e-3)
    assert said == ("by the logs' clocks the tare is 4d old: offsets and friction may have changed since",)
    assert drift_since(tare, read_recording(csv(tmp_path / "same.csv", iso(START + STEPS))), None) == (0.0, ())
    seconds, told = age_of(tare, log.date, None)  # of a stream that begins when the log did
    assert seconds == pytest.approx(4 * DAY - tare.duration, abs=1.0)
    assert told == said
    assert age_of(tare, log.date, DAY) == (DAY, ())
    before, (told,) = age_of(replace(tare, epoch=tare.epoch + 8 * DAY), log.date, None)
    assert before == pytest.approx(4 * DAY, abs=1.0)  # by a clock that is wrong, or of a log that came before its tare
    assert told.startswith("by the logs' clocks the tare was recorded 4d after what it is the tare of:")
    assert age_of(tare, None, None) == age_of(None, log.date, None) == (0.0, ())

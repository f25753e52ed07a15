"""A record as MCAP: other readers open it, it reads back as CSV does, and a kill costs a chunk at most."""

import json
import re
import resource
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from armload.app.cli import main
from armload.devices import Recorded, Recorder, Replay, Steadied, open_source
from armload.devices.mcap_part import DIAGNOSTICS, JOINT_STATES, LOG, PARAMETERS, PAYLOAD, TOPICS
from armload.errors import RecordingError
from armload.inertia import phi_to_com
from armload.recording import Recording, Sample, read_long, read_recording, write_recording
from armload.recording.mcap_file import CHUNK_BYTES

LIMIT = 120.0  # [s] for a process of a test


def decoded(path):
    """Messages by topic, as (log time [ns], message), by the format's own reader and definitions found in the file."""
    found = {}
    with path.open("rb") as file:
        for _, channel, raw, message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            found.setdefault(channel.topic, []).append((raw.log_time, message))
    return found


def table(log):
    return np.column_stack([log.q, log.dq, log.tau])


def dated(log, began):
    """The arrays of a log that began then [s since 1970]."""
    return {"t": log.t - log.t[0] + began, "q": log.q, "dq": log.dq, "tau": log.tau}


def samples(count, n=7, seed=0):
    values = np.random.default_rng(seed).normal(size=(count, 3, n))
    return [Sample(5.0 + 1e-3 * k, *values[k]) for k in range(count)]


@pytest.fixture(scope="module")
def live(panda, tmp_path_factory):
    """What `armload live` said of a log in which a payload is taken up, and its record as MCAP; and the log as CSV."""
    folder = tmp_path_factory.mktemp("live")
    kept, log = folder / "run.mcap", folder / "log.csv"
    lines = folder / "lines"
    words = ["sim", "--headless", "--speed", "max", "--duration", "7", "--method", "map", "--every", "0.1"]
    command = [sys.executable, "-c", "from armload.app import main; raise SystemExit(main())", "live", *words]
    with lines.open("w") as out:
        subprocess.run([*command, "--record", str(kept)], stdout=out, check=True, timeout=LIMIT)
    write_recording(log, read_recording(kept, panda))
    return [json.loads(line) for line in lines.read_text().splitlines()], kept, log


@pytest.mark.full  # some seconds
def test_every_topic_has_its_standard_type_and_two_other_readers_open_it(live):
    _, path, _ = live
    with Reader(path) as bag:
        assert {c.topic: c.msgtype for c in bag.connections} == TOPICS
        counts = {c.topic: c.msgcount for c in bag.connections}
    assert counts == {topic: len(messages) for topic, messages in decoded(path).items()}
    assert counts[JOINT_STATES] > 5000
    assert counts[PARAMETERS] == counts[DIAGNOSTICS] == pytest.approx(71, abs=2)  # every 0.1 s, and the last


def test_the_estimates_are_those_that_were_printed(live):
    lines, path, _ = live
    found = decoded(path)
    first = found[JOINT_STATES][0][0]
    told = {round((t - first) * 1e-9 + lines[0]["t"], 6): np.reshape(m.data, (3, 10)) for t, m in found[PARAMETERS]}
    checked = 0
    for line in lines:
        if (kept := told.get(round(line["t"], 6))) is None:
            continue
        ends = [np.array(line[name], dtype=float) for name in ("phi_low", "phi_high")]  # null: nothing is known
        np.testing.assert_array_equal(kept[0], line["phi"])
        np.testing.assert_array_equal(np.where(np.isinf(kept[1:]), np.nan, kept[1:]), ends)
        checked += 1
    assert checked > 50
    values = {v.key: v.value for v in found[DIAGNOSTICS][-1][1].status[0].values}
    last = lines[-1]
    assert values["method"] == "map"
    assert values["relative_to"] == last["relative_to"]
    assert (float(values["age"]), int(values["n_samples"])) == (last["age"], last["n_samples"])
    assert values["determined"].split() == [name for name, d in zip(names(found), last["determined"], strict=True) if d]


def names(found):
    return found[PARAMETERS][0][1].layout.dim[1].label.split()


def test_the_body_is_about_its_centre_of_mass_in_the_frame_that_was_said(live):
    lines, path, _ = live
    body, last = decoded(path)[PAYLOAD][-1][1], lines[-1]
    mass, com, inertia = phi_to_com(np.array(last["phi"]))
    assert last["consistent"]
    assert body.header.frame_id == last["frame"]
    assert body.inertia.m == pytest.approx(mass, rel=1e-12)
    assert [body.inertia.com.x, body.inertia.com.y, body.inertia.com.z] == pytest.approx(com.tolist(), rel=1e-9)
    assert body.inertia.ixz == pytest.approx(inertia[0, 2], rel=1e-9)


def test_changes_of_payload_are_in_the_log(live):
    lines, path, _ = live
    event = lines[-1]["event"]
    texts = [m.msg for _, m in decoded(path)[LOG]]
    assert any(text.startswith(f"{event['kind']} at {event['t']:.2f} s") for text in texts)
    assert texts[-1] == "the source has ended"


@pytest.mark.full  # some seconds
def test_identify_says_of_the_record_what_it_says_of_the_same_samples_as_csv(live, capsys):
    _, path, log = live
    answers = []
    for one in (path, log):
        assert main(["identify", str(one), "--robot", "panda", "--method", "map", "--json"]) == 0
        answers.append(json.loads(capsys.readouterr().out))
    of_mcap, of_csv = answers
    assert of_mcap["n_samples"] == of_csv["n_samples"]
    np.testing.assert_allclose(of_mcap["phi"], of_csv["phi"], rtol=1e-9, atol=1e-12)


def test_a_record_keeps_every_sample_as_csv_does(tmp_path, panda):
    sent = samples(1000)
    logs = []
    for name in ("run.csv", "run.mcap"):
        with Recorder(tmp_path / name, 7, panda) as recorder:
            for sample in sent:
                recorder.append(sample)
        logs.append(read_recording(tmp_path / name, panda))
    np.testing.assert_array_equal(table(logs[1]), table(logs[0]))
    np.testing.assert_allclose(logs[1].t, logs[0].t - logs[0].t[0], rtol=0, atol=1e-9)
    assert logs[1].notes == ()


@pytest.mark.parametrize(
    ("t", "epoch", "date"),
    [(1.7e9, 0.0, 1.7e9), (0.0, 1.7e9, 1.7e9), (-3.0, 1.7e9, 1.7e9 - 3.0), (5000.0, 0.0, None), (-3.0, 0.0, None)],
    ids=["since 1970", "counted", "before", "since boot", "negative"],
)
def test_the_record_of_a_replay_has_the_log_s_own_date_and_not_that_of_the_replay(tmp_path, panda, t, epoch, date):
    """Else an old tare that was replayed would be one of today, and four days' logs one session of a profile."""
    rows = samples(2000)
    q, dq, tau = (np.array([sample[k] for sample in rows]) for k in (1, 2, 3))
    log = Recording(t + np.arange(2000) / 100.0, q, dq, tau, epoch=epoch)
    with Replay(log, speed=None) as source, Recorder(tmp_path / "a.mcap", 7, panda, source.epoch) as kept:
        kept.say("before any sample")
        for sample in source:
            kept.append(sample)
    with Recorded(Replay(log, speed=None), tmp_path / "b.mcap", panda) as source:
        assert source.epoch == Steadied(Replay(log)).epoch
        for _ in source:
            pass
    for name in ("a.mcap", "b.mcap"):
        read = read_recording(tmp_path / name, panda)
        assert read.date == (None if date is None else pytest.approx(date, abs=1e-6))
        np.testing.assert_allclose(read.t, log.t - log.t[0], rtol=0, atol=1e-6)
        assert read.epoch == pytest.approx(date or 0.0, abs=1e-6)
    ((stamp, said),) = decoded(tmp_path / "a.mcap")[LOG]
    assert said.msg == "before any sample"
    assert stamp * 1e-9 == pytest.approx(date or 0.0, abs=1e-6)


def test_a_log_that_is_replayed_in_a_process_of_its_own_keeps_its_date(tmp_path, panda, analytic_log):
    np.savez(tmp_path / "run.npz", **dated(analytic_log(panda, duration=1.0), 1.7e9))
    with open_source(str(tmp_path / "run.npz"), panda, detached=True) as source:
        assert source.epoch == 0.0
        first = next(iter(source))
    assert first.t == 1.7e9
    with open_source("sim", panda, speed=None, duration=0.1) as source:
        assert source.epoch is None


def test_a_clock_that_starts_anew_starts_a_new_part(tmp_path, panda):
    with Recorder(tmp_path / "run.mcap", 7, panda) as recorder:
        for sample in [*samples(3), *samples(4)]:
            recorder.append(sample)
    assert [path.name for path in recorder.paths] == ["run.mcap", "run.2.mcap"]
    assert [len(read_recording(path, panda)) for path in recorder.paths] == [
        3,
        3,
    ]  # one is doubted


@pytest.mark.parametrize("kind", ["mcap", "csv"])
def test_a_record_of_many_hours_is_in_files_of_six_of_which_each_is_whole(tmp_path, panda, kind):
    made = [sample._replace(t=1800.0 * k) for k, sample in enumerate(samples(30))]
    with Recorder(tmp_path / f"run.{kind}", 7, panda) as recorder:
        for sample in made:
            recorder.append(sample)
    assert [path.name for path in recorder.paths] == [f"run{part}.{kind}" for part in ("", ".2", ".3")]
    assert recorder.kept == 30
    if kind == "mcap":
        kept = [len(decoded(path)[JOINT_STATES]) for path in recorder.paths]
    else:
        kept = [len(path.read_text().splitlines()) - 1 for path in recorder.paths]
    assert kept == [12, 12, 6]


def test_a_record_cut_anywhere_is_read_up_to_a_whole_chunk_and_says_so(tmp_path, panda):
    sent = samples(3000)
    whole = tmp_path / "whole.mcap"
    with Recorder(whole, 7, panda) as recorder:
        for sample in sent:
            recorder.append(sample)
    data = whole.read_bytes()
    with whole.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    ends = [chunk.chunk_start_offset + chunk.chunk_length for chunk in chunks]
    assert len(ends) > 2
    cuts = [8, ends[0] - 1, ends[0], ends[0] + 5, ends[1] - 1, (ends[0] + ends[1]) // 2, ends[-1], len(data) - 1]
    rows = np.array([np.concatenate(s[1:]) for s in sent])
    for cut in cuts:
        path = tmp_path / f"{cut}.mcap"
        path.write_bytes(data[:cut])
        if cut < ends[0]:
            with pytest.raises(RecordingError, match="is not a bag that can be read"):
                read_recording(path, panda)
            continue
        before = sum(end <= cut for end in ends)
        log, longer = read_recording(path, panda), read_long(path, panda, long=0, size=500)
        np.testing.assert_array_equal(table(log), rows[: len(log)])
        np.testing.assert_array_equal(table(longer), table(log))
        assert (len(log) == len(sent)) == (before == len(ends))
        assert re.search(r"is cut off: it was read up to the end of its last whole chunk, \d+ messages", log.notes[0])


@pytest.mark.full  # some seconds
def test_kill_9_of_live_loses_what_came_after_the_last_chunk_only(tmp_path, panda):
    path = tmp_path / "run.mcap"
    command = [sys.executable, "-c", "from armload.app import main; raise SystemExit(main())", "live", "sim"]
    words = ["--headless", "--speed", "max", "--method", "map", "--every", "0.5", "--record", str(path)]
    with subprocess.Popen([*command, *words], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        patience = threading.Timer(LIMIT, process.kill)
        patience.start()
        try:
            lines = [json.loads(process.stdout.readline()) for _ in range(8)]
        finally:
            patience.cancel()
            process.send_signal(signal.SIGKILL)
            process.wait(LIMIT)
    log = read_recording(path, panda)
    assert "cut off" in log.notes[0]
    longest = CHUNK_BYTES / 300.0 * 1.2e-3  # [s] of messages of more than 300 bytes, as lossy a simulator as it is
    assert log.t[-1] >= lines[-1]["t"] - longest
    assert np.all(np.diff(log.t) > 0)
    assert main(["identify", str(path), "--robot", "panda", "--method", "map", "--json"]) == 0


def test_a_full_disk_is_said_and_leaves_whole_chunks(tmp_path, panda):
    """The file may not grow beyond 300 kB: the operating system's own limit, in a process of its own."""
    code = """
import resource, signal, sys
import numpy as np
from armload.arms import arm
from armload.devices import Recorder
from armload.errors import RecordingError
from armload.recording import Sample
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
recorder = Recorder(sys.argv[1], 7, arm("panda"))
try:
    for k in range(20000):
        recorder.append(Sample(k * 1e-3, *np.random.default_rng(k).normal(size=(3, 7))))
except RecordingError as error:
    print(error)
recorder.close()
"""
    path = tmp_path / "run.mcap"
    words = [sys.executable, "-c", code, str(path)]
    said = subprocess.run(words, capture_output=True, text=True, check=True, timeout=LIMIT).stdout
    assert "full" in said or "cannot be written" in said
    log = read_recording(path, panda)
    assert len(log) > 500
    assert "cut off" in log.notes[0]


def test_what_cannot_be_recorded_is_refused_before_the_first_sample(tmp_path, panda):
    (tmp_path / "run.mcap").write_text("mine")
    with pytest.raises(RecordingError, match="exists: a record is never written over"):
        Recorder(tmp_path / "run.mcap", 7, panda)
    assert (tmp_path / "run.mcap").read_text() == "mine"
    with pytest.raises(RecordingError, match="knows joints by name: expected 7, found 0"):
        Recorder(tmp_path / "other.mcap", 7)
    with pytest.raises(RecordingError, match=r"ends in \.csv or \.mcap"):
        Recorder(tmp_path / "run.npz", 7)


@pytest.mark.parametrize("suffix", ["csv", "mcap"])
def test_a_record_that_cannot_be_begun_leaves_no_file(tmp_path, panda, suffix):
    """A service that tries again every five seconds would leave one empty file after the other."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))  # as a full disk: no file can grow
    try:
        with pytest.raises(RecordingError):
            Recorder(tmp_path / f"run.{suffix}", 7, panda)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []

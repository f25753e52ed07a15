"""Sources: what comes out is what went in, whatever happens to the processes in between."""

import itertools
import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from armload.arms import arm
from armload.devices import Detached, Recorded, Recorder, Replay, Ring, RingReader, Simulator, open_mover, open_source
from armload.devices.as_json import (
    arm_from_json,
    arm_to_json,
    parameters_from_json,
    parameters_to_json,
    payloads_from_json,
    payloads_to_json,
)
from armload.devices.pace import Pace
from armload.devices.recorder import next_free
from armload.errors import ArmloadError, MotionError, PayloadError, RecordingError, SourceError
from armload.inertia import InertialParameters
from armload.motion import EndlessMotion, FourierMotion, Motion, taie2024
from armload.motion.point_to_point import PointToPoint
from armload.payloads import franka_hand
from armload.payloads import test_payload as heavy_payload
from armload.recording import Recording, Sample, read_recording, write_recording
from armload.simulation import Sensors, World, simulate


def table(samples):
    """All numbers of an iterable of samples, (N, 1 + 3n)."""
    return np.array([np.concatenate([[s.t], s.q, s.dq, s.tau]) for s in samples])


def numbers(recording):
    return np.column_stack([recording.t, recording.q, recording.dq, recording.tau])


def strict_json_lines(path):
    """One object per line, read as any other program would: only Python takes bare NaN and Infinity."""

    def refuse(token):
        raise ValueError(f"{token} is no JSON")

    return [json.loads(line, parse_constant=refuse) for line in path.read_text().splitlines()]


@pytest.fixture(scope="module")
def log():
    rng = np.random.default_rng(0)
    t = 5.0 + np.cumsum(rng.uniform(0.5e-3, 1.5e-3, size=60))
    return Recording(t, *rng.normal(size=(3, 60, 7)))


# ---------------------------------------------------------------- replay


def test_replay_is_the_recording(log):
    with Replay(log, speed=None) as source:
        np.testing.assert_array_equal(table(source), numbers(log))
        assert (source.n, source.rate) == (7, log.rate)


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_replay_reads_any_file_in_its_own_time(tmp_path, panda, log, suffix):
    write_recording(tmp_path / f"log{suffix}", log)
    with open_source(tmp_path / f"log{suffix}", panda, speed=20.0) as source:
        np.testing.assert_array_equal(table(source), numbers(log))


def test_a_looped_replay_goes_on_in_time(log):
    with Replay(log, speed=None, loop=True) as source:
        samples = table(itertools.islice(source, 3 * len(log)))
    assert np.all(np.diff(samples[:, 0]) > 0)
    gap = np.median(np.diff(log.t))
    np.testing.assert_allclose(samples[len(log), 0] - samples[len(log) - 1, 0], gap)
    for turn in range(3):
        part = samples[turn * len(log) : (turn + 1) * len(log)]
        np.testing.assert_array_equal(part[:, 1:], numbers(log)[:, 1:])
        np.testing.assert_allclose(np.diff(part[:, 0]), np.diff(log.t), atol=1e-12)


def test_closing_ends_a_replay_that_waits():
    slow = Recording(np.array([0.0, 3600.0]), *np.zeros((3, 2, 1)))
    source = Replay(slow)
    threading.Timer(0.1, source.close).start()
    assert len(list(source)) == 1


@pytest.mark.parametrize("speed", [0.0, -1.0, float("inf"), float("nan")])
def test_a_speed_that_is_none_is_refused(log, speed):
    with pytest.raises(SourceError, match="positive number"):
        Replay(log, speed=speed)


def test_torque_that_was_not_measured_is_refused(log):
    with pytest.raises(SourceError, match="desired"):
        Replay(Recording(log.t, log.q, log.dq, log.tau, "desired"))


# ---------------------------------------------------------------- simulator


def test_without_changes_the_simulator_is_simulate(panda):
    world, payload = World.real_like(panda, 4), heavy_payload()
    whole = simulate(panda, taie2024(), payload, world=world, rate=500.0, duration=1.2)
    with Simulator(panda, payloads=[(0.0, payload)], world=world, rate=500.0, speed=None, duration=1.2) as source:
        pieces = table(source)
    np.testing.assert_allclose(pieces[:, 0], whole.t, atol=1e-12)
    np.testing.assert_allclose(pieces[:, 1:15], numbers(whole)[:, 1:15], atol=1e-3)
    # the two search for friction along the motion in other pieces: see simulate.rollout
    np.testing.assert_allclose(pieces[:, 15:], whole.tau, atol=5e-3)


def test_the_torque_is_that_of_whatever_is_held_at_the_time(panda):
    """Pinocchio, with the payload of each instant and the simulated motion, finds the simulated torque."""
    schedule = [(0.4, heavy_payload()), (0.81, franka_hand()), (1.2, None)]
    source = Simulator(panda, payloads=schedule, rate=1000.0, speed=None, duration=1.6)
    samples = table(source)
    t, q, dq, tau = samples[:, 0], samples[:, 1:8], samples[:, 8:15], samples[:, 15:]
    ddq = np.gradient(dq, t, axis=0)
    edges = [0.0, 0.4, 0.81, 1.2, 1.6]
    masses = [0.0, heavy_payload().parameters.mass, 0.73, 0.0]
    for start, stop, mass in zip(edges, edges[1:], masses, strict=False):
        inside = (t > start + 0.15) & (t < stop - 0.005)  # the arm has come to its new balance
        held = source.truth((start + stop) / 2)
        assert held.mass == pytest.approx(mass)
        expected = panda.with_payload(held).torque(q[inside], dq[inside], ddq[inside])
        np.testing.assert_allclose(tau[inside], expected, atol=0.03)
        if mass:
            bare = panda.torque(q[inside], dq[inside], ddq[inside])
            assert np.abs(tau[inside] - bare).max() > 2.0


def test_position_and_velocity_go_on_where_the_payload_changes(panda):
    with Simulator(panda, payloads=[(0.3, heavy_payload())], speed=None, duration=0.4) as source:
        samples = table(source)
    q, dq = samples[:, 1:8], samples[:, 8:15]
    assert np.abs(np.diff(q, axis=0)).max() < 3e-3
    # nothing but gravity's pull on the payload: some rad/s², so some mrad/s in a millisecond
    assert np.abs(np.diff(dq, axis=0)).max() < 0.1


def test_the_same_seed_gives_the_same_samples_and_another_other_noise(panda):
    def run(seed):
        with Simulator(panda, sensors=Sensors.panda(panda), speed=None, duration=0.9, seed=seed) as source:
            return table(source)

    first, again, other = run(1), run(1), run(2)
    np.testing.assert_array_equal(first, again)
    assert len(first) < 900  # samples are lost
    assert np.all(np.diff(first[:, 0]) > 0)
    assert len(other) != len(first) or not np.array_equal(other, first)


def test_sensors_see_the_same_in_pieces_as_in_one(panda):
    late = Sensors(command_lag=5.5e-3, torque_skew=1e-3)
    whole = simulate(panda, taie2024(), sensors=late, duration=0.8)
    with Simulator(panda, sensors=late, speed=None, duration=0.8) as source:
        pieces = table(source)
    np.testing.assert_allclose(pieces, numbers(whole), atol=1e-4)


def test_a_motion_that_does_not_close_goes_there_and_back():
    there = PointToPoint(np.array([[0.0, 1.0], [1.0, -1.0]]), np.array([0.2]), np.array([1.2]))
    motion, whole = EndlessMotion(there), there.duration
    t = np.linspace(0.0, whole, 50)
    np.testing.assert_allclose(motion.position(2 * whole + t), there.position(t), atol=1e-9)
    np.testing.assert_allclose(motion.position(2 * whole - t), there.position(t), atol=1e-9)
    fine = np.linspace(0.0, 4 * whole, 20001)
    np.testing.assert_allclose(np.gradient(motion.position(fine)[:, 0], fine), motion.velocity(fine)[:, 0], atol=1e-2)
    np.testing.assert_allclose(np.gradient(motion.velocity(fine)[:, 0], fine), motion(fine)[2][:, 0], atol=5e-2)


@pytest.mark.parametrize(
    "payloads", [[(1.0, None), (1.0, None)], [(2.0, None), (1.0, None)], [(float("nan"), None)], [(0.0, "a cup")]]
)
def test_a_schedule_that_makes_no_sense_is_refused(panda, payloads):
    with pytest.raises(PayloadError, match="payload"):
        Simulator(panda, payloads=payloads)


def test_a_motion_that_cannot_be_repeated_is_refused():
    class Rushing(Motion):
        name, n, duration = "rushing", 1, 2.0

        def derivative(self, t, order):
            return np.stack([t**2, 2 * t, np.full_like(t, 2.0), np.zeros_like(t)][order : order + 1], axis=1)

    with pytest.raises(MotionError, match="repeated"):
        EndlessMotion(Rushing())
    EndlessMotion(FourierMotion(np.zeros(1), np.array([[0.3]]), np.zeros((1, 1)), 6.0))  # moves, but closes


# ---------------------------------------------------------------- recorder


def test_a_record_reads_back_exactly_at_any_moment(tmp_path, log):
    with Recorder(tmp_path / "run.csv", 7) as recorder:
        for k, sample in enumerate(log):
            recorder.append(sample)
            if k in (1, 30):  # while it is being written
                np.testing.assert_array_equal(numbers(read_recording(tmp_path / "run.csv")), numbers(log)[: k + 1])
    np.testing.assert_array_equal(numbers(read_recording(tmp_path / "run.csv")), numbers(log))
    assert (recorder.kept, recorder.bad) == (len(log), 0)
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]


def test_bad_samples_go_beside_the_record_with_the_reason(tmp_path):
    def sample(t, q=0.0, n=2):
        return Sample(t, np.full(n, q), np.zeros(n), np.ones(n))

    good = [sample(0.1), sample(0.2), sample(0.3)]
    bad = [sample(0.15, np.nan), sample(float("inf")), sample(0.2, n=3), sample(0.2), sample(0.05)]
    with Recorder(tmp_path / "run.csv", 2) as recorder:
        for s in [*good[:2], *bad, good[2]]:
            recorder.append(s)
    np.testing.assert_array_equal(numbers(read_recording(tmp_path / "run.csv")), table(good))
    lines = strict_json_lines(tmp_path / "run.bad.jsonl")
    assert [line["why"].split()[0:2] for line in lines] == [
        ["not", "finite"],
        ["not", "finite"],
        ["not", "2"],
        ["not", "after"],
        ["not", "after"],
    ]
    assert lines[0]["q"] == ["NaN", "NaN"]
    assert lines[3]["t"] == 0.2
    assert recorder.bad == 5
    assert recorder.kept == 3


@pytest.mark.parametrize("n", [2, 3])
def test_a_bad_sample_is_strict_json_that_loses_nothing(tmp_path, n):
    """Every double, the odd ones too, whether the sample is bad for its numbers or for how many there are."""
    odd = [np.nan, np.inf, -np.inf, -0.0, 0.1 + 0.2, 5e-324, 1.7976931348623157e308, -1.0, 1.0]
    sample = Sample(-np.inf, *np.array(odd[: 3 * n]).reshape(3, n))
    with Recorder(tmp_path / "run.csv", 2) as recorder:
        recorder.append(sample)
    (line,) = strict_json_lines(tmp_path / "run.bad.jsonl")
    for name, value in sample._asdict().items():
        assert np.array(line[name], dtype=float).tobytes() == np.asarray(value).tobytes(), name


def test_a_clock_that_starts_anew_starts_a_new_part(tmp_path):
    def sample(t):
        return Sample(t, np.array([t]), np.zeros(1), np.ones(1))

    times = [7.0, 7.1, 7.2, 0.1, 0.2, 0.3, 0.1, 0.4]  # a restart, then one straggler
    with Recorder(tmp_path / "run.csv", 1) as recorder:
        for t in times:
            recorder.append(sample(t))
    assert [path.name for path in recorder.paths] == ["run.csv", "run.2.csv"]
    assert read_recording(tmp_path / "run.csv").t.tolist() == [7.0, 7.1, 7.2]
    assert read_recording(tmp_path / "run.2.csv").t.tolist() == [0.2, 0.3, 0.4]
    bad = [line["t"] for line in strict_json_lines(tmp_path / "run.bad.jsonl")]
    assert bad == [0.1, 0.1]


def test_a_record_is_never_written_over(tmp_path):
    (tmp_path / "run.csv").write_text("mine")
    with pytest.raises(RecordingError, match="choose another name"):
        Recorder(tmp_path / "run.csv", 7)
    assert (tmp_path / "run.csv").read_text() == "mine"
    with pytest.raises(RecordingError, match=r"ends in \.csv"):
        Recorder(tmp_path / "run.npz", 7)
    with pytest.raises(RecordingError, match="cannot be written"):
        Recorder(tmp_path / "nowhere" / "run.csv", 7)


@pytest.mark.parametrize("left", ["run.csv", "run.2.csv", "run.bad.jsonl"])
def test_the_next_free_name_is_one_under_which_a_record_can_begin_whatever_was_taken_away(tmp_path, left):
    (tmp_path / left).write_text("of the record before")
    name = next_free(tmp_path / "run.csv")
    Recorder(name, 7).close()
    assert Path(name).name == "run.again1.csv"
    assert next_free(tmp_path / "other.csv") == str(tmp_path / "other.csv")


@pytest.mark.parametrize("name", ["run.2.csv", "run.bad.jsonl"])
def test_what_an_earlier_record_left_is_told_before_the_first_sample_not_at_a_bad_one(tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(RecordingError, match=rf"{re.escape(name)} exists.*choose another name"):
        Recorder(tmp_path / "run.csv", 7)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_full_disk_leaves_whole_lines(tmp_path):
    """The file may not grow beyond 2000 bytes: the operating system's own limit, in a process of its own."""
    code = """
import resource, signal, sys
import numpy as np
from armload.errors import RecordingError
from armload.recording import Sample
from armload.devices import Recorder
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
recorder = Recorder(sys.argv[1], 7)
try:
    for k in range(1000):
        recorder.append(Sample(k * 1e-3, *np.random.default_rng(k).normal(size=(3, 7))))
except RecordingError as error:
    print(recorder.kept, error)
"""
    path = tmp_path / "run.csv"
    message = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True).stdout
    kept = int(message.split()[0])
    assert "full" in message or "cannot be written" in message
    assert len(read_recording(path)) == kept > 2
    assert path.read_bytes().endswith(b"\n")


def test_recorded_passes_on_what_it_keeps(tmp_path, log):
    with Recorded(Replay(log, speed=None), tmp_path / "run.csv") as source:
        np.testing.assert_array_equal(table(source), numbers(log))
    np.testing.assert_array_equal(numbers(read_recording(tmp_path / "run.csv")), numbers(log))


def test_kill_9_of_a_recording_process_loses_nothing_that_it_had_seen(tmp_path, log):
    code = """
import itertools, sys
from armload.devices import Recorded, Replay
with Recorded(Replay(sys.argv[1], speed=None, loop=True), sys.argv[2]) as source:
    for sample in source:
        print(repr(sample.t), flush=True)
"""
    write_recording(tmp_path / "log.csv", log)
    record = tmp_path / "run.csv"
    with subprocess.Popen(
        [sys.executable, "-c", code, tmp_path / "log.csv", record], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        seen = list(itertools.islice(process.stdout, 700))
        process.send_signal(signal.SIGKILL)
        seen += process.stdout.readlines()
    assert process.returncode == -signal.SIGKILL
    seen = [float(line) for line in seen if line.endswith("\n")]
    kept = read_recording(record)
    assert kept.t[: len(seen)].tolist() == seen
    # at most the sample in hand was kept and not handed on
    assert len(kept) - len(seen) <= 1
    laps = numbers(log)[np.arange(len(kept)) % len(log), 1:]
    np.testing.assert_array_equal(numbers(kept)[:, 1:], laps)


# ---------------------------------------------------------------- ring


def row(k, columns=4):
    return k + np.arange(columns) / 10.0


def test_a_reader_gets_every_sample_once_and_in_order():
    ring = Ring.create(4, 16)
    reader, late = RingReader(ring), RingReader(ring)
    got = []
    for k in range(100):
        ring.write(row(k))
        if k % 7 == 6:
            got += reader.read().tolist()
    got += reader.read().tolist()
    assert got == [row(k).tolist() for k in range(100)]
    assert reader.lost == 0
    assert not len(reader.read())
    # another reader has its own place
    rest = late.read()
    np.testing.assert_array_equal(rest, [row(k) for k in range(85, 100)])
    assert late.lost == 85
    ring.close()


def test_a_slot_that_is_being_written_is_not_believed():
    ring = Ring.create(4, 8)
    reader = RingReader(ring)
    for k in range(3):
        ring.write(row(k))
    for place in range(6):  # number, check, and every value
        kept = ring.slots[1, place].copy()
        ring.slots[1, place] += 1
        before = reader.next
        got = reader.read()
        reader.next = before
        assert got.tolist() == [row(0).tolist()], f"place {place}"
        ring.slots[1, place] = kept
    np.testing.assert_array_equal(reader.read(), [row(k) for k in range(3)])
    assert reader.lost == 0
    ring.close()


def test_what_was_overwritten_while_it_was_copied_is_lost_not_wrong():
    """A writer that goes round the ring between any two steps of the reader."""
    ring = Ring.create(4, 8)
    written = 0

    class Overtaken(RingReader):
        def _skip(self, oldest):
            nonlocal written
            super()._skip(oldest)
            for _ in range(5):
                ring.write(row(written))
                written += 1

    reader = Overtaken(ring)
    got = []
    for _ in range(200):
        got += reader.read().tolist()
    times = [int(values[0]) for values in got]
    assert got == [row(k).tolist() for k in times]
    assert times == sorted(set(times))
    assert reader.lost + len(got) == reader.next
    assert reader.lost > 0
    assert len(got) > 50
    ring.close()


def test_two_processes_share_a_ring_and_none_is_torn():
    code = """
import sys
import numpy as np
from armload.devices import Ring
ring = Ring(int(sys.argv[1]))
for k in range(60000):
    ring.write(k + np.arange(22) / 32.0)
print("done")
"""
    ring = Ring.create(22, 64)
    reader = RingReader(ring)
    with subprocess.Popen(
        [sys.executable, "-c", code, str(ring.descriptor)], pass_fds=[ring.descriptor], stdout=subprocess.PIPE
    ) as process:
        got, parts = 0, np.arange(22) / 32.0
        last = -1.0
        while reader.next < 60000:
            rows = reader.read()
            np.testing.assert_array_equal(rows - rows[:, :1], np.broadcast_to(parts, rows.shape))
            assert np.all(np.diff(np.concatenate([[last], rows[:, 0]])) > 0)
            last = rows[-1, 0] if len(rows) else last
            got += len(rows)
            assert len(rows) or process.poll() in (None, 0)
        process.communicate()  # or its last word would meet a closed pipe
    assert process.returncode == 0
    assert got + reader.lost == 60000
    assert got > 64
    ring.close()


def test_a_descriptor_that_is_no_ring_is_refused(tmp_path):
    (tmp_path / "file").write_bytes(bytes(4096))
    with open(tmp_path / "file", "r+b") as file, pytest.raises(SourceError, match="not a ring"):
        Ring(os.dup(file.fileno()))


# ---------------------------------------------------------------- a process of its own


@pytest.fixture
def path(tmp_path, log):
    write_recording(tmp_path / "log.csv", log)
    return tmp_path / "log.csv"


def gone(process):
    return process.poll() is not None


def test_a_detached_source_hands_on_every_sample_and_records_it(tmp_path, panda, path, log):
    with Detached(str(path), panda, record=tmp_path / "run.csv") as source:
        assert (source.n, source.name) == (7, str(path))
        assert source.rate == log.rate
        np.testing.assert_array_equal(table(source), numbers(log))
        assert source.lost == 0
    assert gone(source.process)
    np.testing.assert_array_equal(numbers(read_recording(tmp_path / "run.csv")), numbers(log))


def test_ctrl_c_is_not_for_the_reader_not_even_before_its_first_line(panda, path, log, monkeypatch, capfd):
    class Hit(subprocess.Popen):
        def __init__(self, *arguments, **settings):
            super().__init__(*arguments, **settings)
            self.send_signal(signal.SIGINT)

    monkeypatch.setattr(subprocess, "Popen", Hit)
    with Detached(str(path), panda) as source:
        source.process.send_signal(signal.SIGINT)
        np.testing.assert_array_equal(table(source), numbers(log))
    assert capfd.readouterr().err == ""
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])  # whoever started it still hears of it


def test_kill_9_of_the_reader_is_an_error_and_its_record_can_be_read(tmp_path, panda, path):
    with Detached(str(path), panda, loop=True, record=tmp_path / "run.csv") as source:
        samples = iter(source)
        seen = [next(samples) for _ in range(100)]
        source.process.kill()
        with pytest.raises(SourceError, match="killed by signal 9"):
            seen.extend(samples)
    kept = numbers(read_recording(tmp_path / "run.csv"))
    np.testing.assert_array_equal(kept[: len(seen)], table(seen))
    assert len(kept) - len(seen) <= 1


def has_ended(reader):
    """An orphan is handed on and collected by others: wait until its memory is gone."""
    for _ in range(500):
        if not Path(f"/proc/{reader}/fd").exists() or not os.listdir(f"/proc/{reader}/fd"):
            return
        threading.Event().wait(0.02)
    os.kill(reader, signal.SIGKILL)
    pytest.fail("the reader outlived whoever started it")


def test_kill_9_of_whoever_listens_ends_the_reader_and_loses_nothing(tmp_path, path):
    code = """
import sys
from armload.arms import arm
from armload.devices import Detached
source = Detached(sys.argv[1], arm("panda"), loop=True, record=sys.argv[2])
print(source.process.pid, flush=True)
for sample in source:
    print(repr(sample.t), flush=True)
"""
    record = tmp_path / "run.csv"
    with subprocess.Popen([sys.executable, "-c", code, path, record], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        reader = int(process.stdout.readline())
        seen = [float(line) for line in itertools.islice(process.stdout, 200)]
        process.kill()
    has_ended(reader)
    kept = read_recording(record)
    assert kept.t[:200].tolist() == seen


def test_a_slow_listener_loses_samples_knows_how_many_and_the_record_has_them(tmp_path, panda, path):
    with Detached(str(path), panda, loop=True, speed=4.0, capacity=32, record=tmp_path / "run.csv") as source:
        samples = iter(source)
        next(samples)
        while (tmp_path / "run.csv").read_bytes().count(b"\n") < 200:  # the reader goes on meanwhile
            threading.Event().wait(0.02)
        later = [next(samples) for _ in range(60)]
        assert source.lost > 0
        source.close()
    kept = numbers(read_recording(tmp_path / "run.csv"))
    rows = table(later)
    places = np.searchsorted(kept[:, 0], rows[:, 0])
    np.testing.assert_array_equal(kept[places], rows)


def test_nothing_is_left_of_a_detached_source(panda, path):
    before = set(os.listdir("/proc/self/fd"))
    shared = set(os.listdir("/dev/shm"))
    source = Detached(str(path), panda, loop=True)
    next(iter(source))
    source.close()
    source.close()
    assert gone(source.process)
    assert set(os.listdir("/proc/self/fd")) == before
    assert set(os.listdir("/dev/shm")) <= shared
    assert list(source) == []


def test_closing_from_another_thread_ends_an_iteration(tmp_path, panda):
    write_recording(tmp_path / "slow.csv", Recording(np.array([0.0, 3600.0]), *np.zeros((3, 2, 7))))
    source = Detached(str(tmp_path / "slow.csv"), panda)
    threading.Timer(0.3, source.close).start()
    assert len(list(source)) == 1


def test_closing_a_reader_that_hangs_ends_an_iteration_without_an_error(panda, path, monkeypatch):
    monkeypatch.setattr("armload.devices.detached._TO_END", 0.2)
    source = Detached(str(path), panda, loop=True)
    os.kill(source.process.pid, signal.SIGSTOP)
    threading.Timer(0.3, source.close).start()
    for sample in source:
        assert len(sample.q) == 7
    assert gone(source.process)


def test_whoever_closes_a_source_that_is_being_closed_waits_until_its_reader_has_ended(panda, path, monkeypatch):
    """Else its process may end first, and a reader that hangs would keep the robot's connection for ever."""
    monkeypatch.setattr("armload.devices.detached._TO_END", 1.0)
    source = Detached(str(path), panda, loop=True)
    os.kill(source.process.pid, signal.SIGSTOP)
    threading.Thread(target=source.close, daemon=True).start()
    while not source.process.stdin.closed:
        time.sleep(0.01)
    source.close()
    assert gone(source.process)


def test_a_late_answer_is_not_taken_for_that_of_the_next_call(panda, path, monkeypatch):
    """Else a robot that refused a load could seem to have taken it."""
    with Detached(str(path), panda, loop=True) as source:
        os.kill(source.process.pid, signal.SIGSTOP)
        with monkeypatch.context() as patch:
            patch.setattr("armload.devices.detached._TO_OBEY", 0.1)
            with pytest.raises(SourceError, match="did not answer"):
                source.set_load(1.0, np.zeros(3), np.eye(3))
        os.kill(source.process.pid, signal.SIGCONT)
        with pytest.raises(SourceError, match="no read_once"):
            source.read_once()


def test_the_reader_s_reason_is_the_listener_s(tmp_path, panda):
    with pytest.raises(SourceError, match="does not exist"):
        Detached(str(tmp_path / "none.csv"), panda)
    (tmp_path / "there.csv").write_text("mine")
    with pytest.raises(SourceError, match="choose another name"):
        Detached("sim", panda, record=tmp_path / "there.csv")
    with pytest.raises(SourceError, match="overrun"):
        Detached("sim", panda, speed=None)


def test_only_a_robot_can_be_told_its_load(panda, path):
    with Detached(str(path), panda, loop=True) as source, pytest.raises(SourceError, match="no set_load"):
        source.set_load(1.0, np.zeros(3), np.eye(3))


def test_a_detached_simulator_knows_the_truth(panda):
    payloads = [(0.05, heavy_payload()), (0.1, None)]
    with (
        open_source(
            "sim", panda, payloads=payloads, world="nominal", sensors=False, duration=0.2, detached=True
        ) as one,
        open_source("sim", panda, payloads=payloads, world="nominal", sensors=False, duration=0.2, speed=None) as other,
    ):
        np.testing.assert_array_equal(table(one), table(other))
        truth = one.truth(0.07)
        assert truth is not None
        np.testing.assert_array_equal(truth.phi, heavy_payload().parameters.phi)


# ---------------------------------------------------------------- a maker's client, stood in for


@pytest.fixture
def client(tmp_path, monkeypatch):
    """Makes `pylibfranka` a module of the code given, in whatever process imports it."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "client"), prepend=os.pathsep)

    def write(code):
        (tmp_path / "client").mkdir()
        kinds = "class RealtimeConfig:\n    kIgnore = None\n"
        (tmp_path / "client" / "pylibfranka.py").write_text(f"import os, time\n{kinds}{textwrap.dedent(code)}")

    return write


def test_a_robot_that_does_not_answer_is_an_error_and_its_client_is_ended(client, monkeypatch, tmp_path):
    client("""
        def Robot(*_):
            open(os.environ["ASKED"], "w").write(str(os.getpid()))
            while True:
                time.sleep(3600)
        """)
    monkeypatch.setenv("ASKED", str(tmp_path / "asked"))
    monkeypatch.setattr("armload.devices.detached._TO_CONNECT", 1.0)
    before = set(os.listdir("/proc/self/fd"))
    with pytest.raises(SourceError, match=r"the FR3 at 192\.0\.2\.9 cannot be reached \(it does not answer\): check"):
        open_source("fr3://192.0.2.9", arm("fr3"), record=tmp_path / "run.csv")
    assert not Path("/proc", (tmp_path / "asked").read_text()).exists()
    assert set(os.listdir("/proc/self/fd")) == before
    assert not (tmp_path / "run.csv").exists()


def test_kill_9_of_whoever_starts_a_reader_that_connects_ends_the_reader(client, monkeypatch, tmp_path):
    client("""
        def Robot(*_):
            with open(os.environ["ASKED"] + ".part", "w") as file:
                file.write(str(os.getpid()))
            os.rename(os.environ["ASKED"] + ".part", os.environ["ASKED"])
            while True:
                time.sleep(3600)
        """)
    asked = tmp_path / "asked"
    monkeypatch.setenv("ASKED", str(asked))
    code = "import armload, armload.devices as s; s.open_source('fr3://192.0.2.9', armload.arm('fr3'))"
    with subprocess.Popen([sys.executable, "-c", code]) as process:
        for _ in range(1500):
            if asked.exists():
                break
            threading.Event().wait(0.02)
        process.kill()
    has_ended(int(asked.read_text()))


@pytest.mark.full  # some seconds
def test_a_client_that_takes_long_to_load_is_not_a_robot_that_does_not_answer(client, monkeypatch):
    client("""
        time.sleep(3.5)
        def Robot(*_):
            raise RuntimeError("no robot here")
        """)
    monkeypatch.setattr("armload.devices.detached._TO_CONNECT", 3.0)
    with pytest.raises(SourceError, match="no robot here"):
        open_source("fr3://192.0.2.9", arm("fr3"))


@pytest.mark.parametrize("asked", [False, pytest.param(True, marks=pytest.mark.full)])
def test_what_a_client_prints_is_kept_apart_unless_asked_for(client, monkeypatch, capfd, asked):
    client("""
        def Robot(*_):
            os.write(1, b"from the client, out")
            os.write(2, b"from the client, err")
            raise RuntimeError("no robot here")
        """)
    monkeypatch.setenv("ARMLOAD_TRACEBACK", "1" if asked else "")
    with pytest.raises(SourceError, match="no robot here"):
        open_source("fr3://192.0.2.9", arm("fr3"))
    out, err = capfd.readouterr()
    assert out == ""
    assert err == ("from the client, outfrom the client, err" if asked else "")


def test_a_robot_s_sample_gets_old_while_nobody_takes_the_next(client, tmp_path):
    client("""
        from types import SimpleNamespace
        class Robot:
            n = 0
            def __init__(self, *_):
                pass
            def read_once(self):
                time.sleep(0.001)
                self.n += 1
                now = SimpleNamespace(to_sec=lambda: 0.001 * self.n)
                return SimpleNamespace(time=now, q=[0.0] * 7, dq=[0.0] * 7, tau_J=[0.0] * 7)
        """)
    record = tmp_path / "run.csv"
    with open_source("fr3://192.0.2.9", arm("fr3"), record=record) as source:
        first = next(iter(source))
        while record.read_bytes().count(b"\n") < 300:
            threading.Event().wait(0.02)
        assert source.lag() >= read_recording(record).t[-1] - first.t  # each state took a millisecond at least


def test_a_bug_in_the_reader_still_says_where_it_is(client, capfd):
    client("""
        def Robot(*_):
            return Robot
        Robot.read_once = lambda: "no state"
        """)
    with open_source("fr3://192.0.2.9", arm("fr3")) as source, pytest.raises(SourceError, match="exit code 1"):
        next(iter(source))
    out, err = capfd.readouterr()
    assert out == ""
    assert "AttributeError: 'str' object has no attribute 'time'" in err


# ---------------------------------------------------------------- by name


def test_an_arm_goes_to_another_process_as_it_is(every_arm):
    content = json.loads(json.dumps(arm_to_json(every_arm)))
    assert arm_from_json(content).fingerprint == every_arm.fingerprint
    assert arm_from_json(content).velocity_ends == every_arm.velocity_ends


def test_an_arm_with_a_tool_other_links_and_a_tilted_base_too(panda):
    odd = arm("panda", gravity=(0.0, 4.0, -9.0)).with_links(1.1 * panda.link_parameters)
    odd = odd.with_payload(franka_hand().parameters)
    again = arm_from_json(json.loads(json.dumps(arm_to_json(odd))))
    assert again.fingerprint == odd.fingerprint
    np.testing.assert_array_equal(again.limits.acceleration, odd.limits.acceleration)
    q = np.linspace(-1, 1, 7)
    np.testing.assert_array_equal(again.torque(q), odd.torque(q))


@pytest.mark.parametrize(
    ("spec", "text"),
    [
        ("http://robot", "unknown kind of source 'http'"),
        ("fr3://", "names no robot"),
        ("ur://", "names no robot: expected ur://ADDRESS, such as ur://172.16.0.2"),
        ("ros2://", "names no topic: expected ros2://TOPIC, such as ros2:///joint_states"),
        ("ros2:///", "names no topic"),
        ("ROS2://?compensated=nothing", "names no topic: expected ros2://TOPIC"),
        ("ur://127.0.0.1?torque_constant=1,2,3,4,5,6", "unknown option 'torque_constant'"),
        ("ur://127.0.0.1?compensated=nothing", r"unknown option 'compensated': .* \?torque_constants=…$"),
        ("ros2:///joint_states?steady=1", r"unknown option 'steady': .*\?torque_constants=… or \?compensated=… or"),
        ("ros2:///joint_states?torque_constants=1,2", "expected 7 positive numbers"),
        ("ros2:///joint_states?torque_constants=1,1,1,1,1,1,1&compensated=nothing", "leave one out"),
        ("ros2:///joint_states?compensated=no_such.json", "no_such.json"),
        ("panda://127.0.0.1?torque_constants=1,2,3,4,5,6,7", "unknown option 'torque_constants'"),
        ("fr3://172.16.0.2:1337", r"expected fr3://172\.16\.0\.2; its ports are fixed"),
        ("ur://robot:30004?torque_constants=1,1,1,1,1,1", "expected ur://robot; its ports are fixed"),
        ("panda://somebody@172.16.0.2", r"expected panda://172\.16\.0\.2;"),
        ("panda://172.16.0.2/desk", r"expected panda://172\.16\.0\.2;"),
        ("fr3://[::1", "is no address"),
        ("no/such/file.csv", "does not exist"),
        ("simulator", "unsupported suffix|does not exist"),
        ("ur://127.0.0.1", "a UR arm has 6"),
    ],
)
def test_a_source_that_cannot_be_opened_says_why(panda, spec, text):
    with pytest.raises(ArmloadError, match=text):
        open_source(spec, panda, detached=False)


def test_the_first_sample_is_due_at_once_whatever_its_time_and_others_are_as_much_later():
    pace = Pace(2.0)
    pace.stop()  # then nobody waits, and it says all the same when samples would be due
    before = time.monotonic()
    pace.wait(1.7e9)
    first = pace.due
    assert before <= first <= time.monotonic()
    pace.wait(1.7e9 + 5.0)
    assert pace.due - first == pytest.approx(2.5)


@pytest.mark.parametrize("spec", ["run.csv", "kuka://172.16.0.2"])
def test_what_cannot_be_moved_is_told_how_each_arm_that_can_is_written(panda, spec):
    with pytest.raises(
        ArmloadError, match=r"expected sim, fr3://ADDRESS, panda://ADDRESS, ur://ADDRESS, ros2://TOPIC$"
    ):
        open_mover(spec, panda)


@pytest.mark.parametrize("spec", ["ros2:///arm/joint_states", "ros2://arm/joint_states"])
def test_a_topic_may_be_written_with_two_slashes_or_three(panda, monkeypatch, spec):
    asked = []
    monkeypatch.setattr("armload.devices.opening.Ros2Source", lambda topic, *_, **__: asked.append(topic))
    open_source(spec, panda)
    assert [topic.lstrip("/") for topic in asked] == ["arm/joint_states"]


def test_a_ur_without_torque_constants_asks_for_them():
    unknown = arm("ur5e")
    with pytest.raises(SourceError, match="give six numbers"):
        open_source("ur://127.0.0.1", unknown, detached=False)
    with pytest.raises(SourceError, match="six"):
        open_source("ur://127.0.0.1?torque_constants=1,2", unknown, detached=False)
    with pytest.raises(SourceError, match="one in N·m/A for each joint"):
        open_source("ur://127.0.0.1?torque_constants=a,b", unknown, detached=False)


@pytest.mark.parametrize(
    ("spec", "robot", "module", "package"),
    [
        ("fr3://127.0.0.1", "panda", "pylibfranka", "pylibfranka"),
        ("panda://127.0.0.1", "panda", "panda_py", "panda-python"),
        ("ur://127.0.0.1", "ur10e", "rtde_receive", "ur-rtde"),
    ],
)
def test_a_missing_client_is_an_error_that_says_how_to_install_it(monkeypatch, spec, robot, module, package):
    for name in [name for name in sys.modules if name.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)  # what Python does for a module that cannot be imported
    with pytest.raises(SourceError, match=rf"pip install '?{package}"):
        open_source(spec, arm(robot), detached=False)


def test_the_simulator_s_payloads_are_in_the_arm_s_frame(panda):
    elsewhere = InertialParameters(heavy_payload().parameters.phi, "somewhere")
    assert Simulator(panda, payloads=[(1.0, elsewhere)]).truth(2.0).frame == panda.frame


def test_a_simulator_holds_a_payload_where_it_is_in_another_process_too(panda):
    at_7 = InertialParameters(heavy_payload().parameters.phi, "panda_link7")
    payloads = [(0.0, panda.in_frame(at_7)), (0.1, None), (0.15, at_7)]
    again = payloads_from_json(json.loads(json.dumps(payloads_to_json(payloads))))
    for given in (payloads, again):
        held = Simulator(panda, payloads=given)
        np.testing.assert_array_equal(held.truth(0.2).phi, held.truth(0.0).phi)
    payload = parameters_from_json(json.loads(json.dumps(parameters_to_json(at_7))))
    held = Simulator(panda)
    held.hold(payload, 0.0)
    np.testing.assert_array_equal(held.truth(0.1).phi, panda.in_frame(at_7).phi)


def test_clients_and_engines_are_loaded_only_by_the_source_that_needs_them():
    heavy = ["pylibfranka", "panda_py", "rtde_receive", "rclpy", "mujoco"]
    code = f"import sys, armload.devices; print([name for name in {heavy!r} if name in sys.modules])"
    message = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert message.strip() == "[]"

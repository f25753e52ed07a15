"""A process that goes on from a saved state: what was held then may have been exchanged since."""

import json
import math
import resource
import select
import time
from dataclasses import replace

import pytest

from armload.errors import RecordingError
from armload.online import OnlineIdentifier
from armload.payloads import test_payload, write_payload
from armload.payloads.uncertainty import Uncertainty
from armload.recording import write_recording
from armload.service import ArmSettings
from armload.service.arm_process import ArmProcess
from armload.service.spare import Spare, order

DAY = 86400.0  # [s]
PATIENCE = 120.0  # [s]


def restored(process):
    """What a process goes on from."""
    return process.state.restored(process.arm, process.settings.method, None, known=None, every=process.every)


def test_what_a_saved_state_holds_is_unconfirmed_until_a_second_has_told(panda, analytic_log, tmp_path):
    held, path = test_payload().parameters, tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, held, duration=4.0))
    settings = ArmSettings(name="left", source=str(path), robot="panda", method="map", loop=True, save=str(tmp_path))
    identifier = OnlineIdentifier(panda, method="map")
    for sample in analytic_log(panda, held, duration=4.0, start=1000.0):
        identifier.update(*sample)
    assert settings.state is not None
    identifier.save(settings.state)
    identifier.close()
    process, answers = Spare([]).take(), []
    assert process.stdout is not None
    try:
        # so that its first answer comes soon
        order(process, {"ready": [{"robot": "panda", "frame": None, "method": "map"}]})
        order(process, {"arm": settings.to_dict(), "every": 0.1})
        until = time.monotonic() + PATIENCE
        while not (answers and answers[-1]["known"]):
            assert select.select([process.stdout], [], [], max(0.0, until - time.monotonic()))[0]
            line = json.loads(process.stdout.readline())
            if line.get("mass") is not None:
                answers.append(line)
    finally:
        process.kill()
        process.communicate()
    assert answers[0]["mass"] == pytest.approx(held.mass, abs=0.05)  # it went on from there
    # the line is of a moment 1 s after the first sample, and an answer that is 0.5 s late is `behind`
    assert 0.5 <= answers[-1]["t"] < 1000.0
    assert {line["unknown"] for line in answers[:-1]} <= {"unconfirmed", "behind", "silent"}


@pytest.mark.parametrize(
    ("ago", "goes_on"), [(1800.0, True), (3 * 86400.0, False), (-3 * 86400.0, False), (math.nan, False)]
)
def test_a_state_is_gone_on_from_while_the_arm_is_that_of_the_same_session(
    ago, goes_on, panda, analytic_log, tmp_path, monkeypatch
):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, duration=2.0))
    settings = ArmSettings(name="left", source=str(path), robot="panda", method="map", save=str(tmp_path))
    identifier, now = OnlineIdentifier(panda, method="map"), time.time()
    for sample in analytic_log(panda, test_payload().parameters, duration=2.0):
        identifier.update(*sample)
    with monkeypatch.context() as earlier:
        earlier.setattr("time.time", lambda: now - ago)
        identifier.save(settings.state)
    identifier.close()
    process, notes = ArmProcess(settings, 0.1, ()), []
    monkeypatch.setattr(process, "note", notes.append)
    found = restored(process)
    process.source.close()
    assert (found is not None) == goes_on
    if found is None:
        no_time = "saved at nan, expected seconds since 1970"
        why = no_time if math.isnan(ago) else "saved 3d ago" if ago > 0.0 else "nobody knows how old it is"
        assert why in notes[0]
        assert notes[0].endswith("begun anew")
    else:
        assert found.conclude().phi[0] == pytest.approx(identifier.conclude().phi[0])
        found.close()


@pytest.mark.parametrize(("session", "anew"), [(0.6, True), (3600.0, False)])
def test_a_stream_begins_anew_when_its_robot_was_away_for_longer_than_a_session(
    session, anew, panda, analytic_log, tmp_path, monkeypatch
):
    """As from a state of that age: the arm may have been repaired or exchanged over night."""
    path, log = tmp_path / "run.csv", analytic_log(panda, test_payload().parameters, duration=3.0)
    away = log.t >= log.t[0] + 1.5
    write_recording(path, replace(log, t=log.t + 1.5 * away))  # a pause, during which it replays nothing
    monkeypatch.setattr("armload.service.absence.SESSION", session)
    settings = ArmSettings(name="left", source=str(path), robot="panda", method="map")
    process, notes, counts = ArmProcess(settings, 0.1), [], []
    monkeypatch.setattr(process, "note", notes.append)
    monkeypatch.setattr(process, "_say", lambda one, _: counts.append(0 if one is None else one.n_samples))
    process.run()
    assert any("no sample for" in note and note.endswith("begun anew") for note in notes) == anew

    assert (counts[-1] <= 0.6 * len(log)) == anew


def test_a_state_of_another_version_is_said_to_be_that_and_the_stream_begins_anew(
    panda, analytic_log, tmp_path, monkeypatch
):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, duration=1.0))
    settings = ArmSettings(name="left", source=str(path), robot="panda", method="map", save=str(tmp_path))
    identifier = OnlineIdentifier(panda, method="map")
    with monkeypatch.context() as earlier:
        earlier.setattr("armload.online.state.FORMAT", 1)
        identifier.save(settings.state)
    identifier.close()
    process, notes = ArmProcess(settings, 0.1, ()), []
    monkeypatch.setattr(process, "note", notes.append)
    assert restored(process) is None
    process.source.close()
    assert notes == [f"{settings.state} belongs to another version of armload: begun anew"]


def test_what_is_known_of_payloads_counts_in_a_stream_that_begins_and_in_one_that_goes_on(
    panda, analytic_log, tmp_path
):
    held = replace(test_payload(), uncertainty=Uncertainty(mass=0.01, com=0.002, inertia=0.05))
    run, part = tmp_path / "run.csv", tmp_path / "part.json"
    log = analytic_log(panda, held.parameters, duration=3.0)
    write_recording(run, log)
    write_payload(part, held)
    plain = ArmSettings(name="left", source=str(run), robot="panda", method="map", save=str(tmp_path))
    told = replace(plain, body=str(part))
    assert told.state != plain.state
    determined = {}
    for name, settings in {"plain": plain, "begins": told, "goes on": told}.items():
        process = ArmProcess(settings, 0.1, ())
        session = process._made_session()
        for sample in log.between(1.5 if name == "goes on" else 0.0, 3.0):
            estimate = session.identifier.update(*sample)
        determined[name] = estimate.determined.sum()
        session.identifier.save(settings.state)
        session.close()
        process.source.close()
        assert process.state.continued == (name == "goes on")
    assert determined["begins"] == determined["goes on"] == 10
    assert determined["plain"] < 10


def test_a_log_that_is_replayed_is_no_tare_of_itself(panda, analytic_log, tmp_path):
    run = tmp_path / "run.csv"
    write_recording(run, analytic_log(panda, test_payload().parameters, duration=2.0))
    settings = ArmSettings(name="left", source=str(run), robot="panda", method="map", tare=str(run))
    process = ArmProcess(settings, 0.1)
    with pytest.raises(RecordingError, match="share 400 measured samples"):
        process._made_session()
    process.source.close()


def test_a_state_is_of_the_tare_that_the_stream_goes_by_whatever_its_file_says_since(panda, analytic_log, tmp_path):
    run, tare = tmp_path / "run.csv", tmp_path / "tare.csv"
    write_recording(run, analytic_log(panda, test_payload().parameters, duration=2.0))
    write_recording(tare, analytic_log(panda, duration=3.0))
    named = {"name": "left", "source": str(run), "robot": "panda", "method": "map", "tare": str(tare)}
    settings = ArmSettings(**named, save=str(tmp_path / "state"))
    process, before = ArmProcess(settings, 0.1), settings.state
    session = process._made_session()
    for sample in analytic_log(panda, duration=1.0):
        session._take(sample)
    tare.unlink()
    write_recording(tare, analytic_log(panda, test_payload().parameters, duration=3.0))
    process.state.save(session)
    session.close()
    assert before is not None
    assert before.exists()
    assert settings.state != before
    assert restored(ArmProcess(settings, 0.1)) is None  # its state is none of the new tare's


def test_while_the_disk_is_full_the_last_state_stays_and_it_is_saved_again_once_there_is_room(
    panda, analytic_log, tmp_path, monkeypatch
):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, test_payload().parameters, duration=4.0))
    folder = tmp_path / "state"
    settings = ArmSettings(name="left", source=str(path), robot="panda", method="map", loop=True, save=str(folder))
    process, said, states = ArmProcess(settings, 0.1), [], []
    monkeypatch.setattr(process, "_write", lambda fields: said.append(fields.get("note")))
    monkeypatch.setattr("armload.service.arm_process.SAVE_EVERY", 0.3)
    save, before = process.state.save, resource.getrlimit(resource.RLIMIT_FSIZE)

    def saved(session):
        full = 2 <= len(states) < 4  # no file can grow beyond what a disk has left
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000 if full else before[0], before[1]))
        try:
            save(session)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        (state,) = folder.iterdir()  # and nothing half written beside it
        states.append(state.read_bytes())
        if len(states) == 6:
            process.source.close()

    monkeypatch.setattr(process.state, "save", saved)
    process.run()
    assert len(states) >= 6
    assert states[1] == states[2] == states[3]
    assert states[4] != states[3]
    about = [note for note in said if note is not None and "saved" in note]
    assert len(about) == 2
    assert "cannot be saved" in about[0]
    assert "File too large; the one saved before stays" in about[0]
    assert about[1] == "the state is saved again"


def test_how_long_ago_a_state_was_saved_does_not_change_with_the_clock(panda, analytic_log, tmp_path, monkeypatch):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, duration=1.0))
    settings = ArmSettings(name="left", source=str(path), robot="panda", method="map", save=str(tmp_path))
    said = []
    for _ in ("saved", "taken up"):
        process = ArmProcess(settings, 0.1)
        monkeypatch.setattr(process, "_write", said.append)
        process.run()
        process._say(None, None)
        now = time.time()
        with monkeypatch.context() as later:
            later.setattr("time.time", lambda now=now: now + 86400.0)
            process._say(None, None)
        before, after = (line["saved"] for line in said[-2:])
        assert 0.0 <= before <= after < before + 3600.0


@pytest.mark.parametrize(
    ("source", "said", "age"),
    [("sim", None, 20.0 * DAY), ("sim", 3.0 * DAY, 23.0 * DAY), ("run.csv", 3.0 * DAY, 3.0 * DAY)],
)
def test_a_process_that_begins_anew_after_weeks_has_a_tare_of_weeks(
    source, said, age, panda, analytic_log, tmp_path, monkeypatch
):
    """Of the service's session, or as old when that began; a replay begins its log anew."""
    monkeypatch.chdir(tmp_path)
    write_recording("run.csv", analytic_log(panda, test_payload().parameters, duration=2.0))
    write_recording("empty.csv", analytic_log(panda, duration=3.0))
    settings = ArmSettings(name="left", source=source, robot="panda", method="map", tare="empty.csv", tare_age=said)
    process = ArmProcess(settings, 0.1, since=20.0 * DAY)
    session = process._made_session()
    assert session.tare.age == pytest.approx(age)
    session.close()
    process.source.close()

"""What nothing can go on from any more goes away by itself, and nothing else does."""

import shutil
import time
from dataclasses import replace

import pytest

from armload.online import OnlineIdentifier
from armload.payloads import test_payload
from armload.recording import write_recording
from armload.runtime.atomic import kept_alone
from armload.service import ArmSettings
from armload.service.arm_process import ArmProcess
from armload.service.old_states import OldStates, not_saved

HOUR = 3600.0


@pytest.fixture
def saved(panda, analytic_log, tmp_path_factory):
    """A factory of states that were saved so long ago [s]."""
    folder, made = tmp_path_factory.mktemp("states"), {}
    identifier, now = OnlineIdentifier(panda, method="map"), time.time()
    for sample in analytic_log(panda, test_payload().parameters, duration=0.5):
        identifier.update(*sample)

    def save(path, ago):
        if ago not in made:
            with pytest.MonkeyPatch.context() as earlier:
                earlier.setattr("time.time", lambda: now - ago)
                made[ago] = identifier.save(folder / f"{ago}.npz")
        return shutil.copyfile(made[ago], path)

    yield save
    identifier.close()


@pytest.fixture
def settings(panda, analytic_log, tmp_path):
    path = tmp_path / "run.csv"
    write_recording(path, analytic_log(panda, duration=1.0))
    kept = tmp_path / "kept"
    kept.mkdir()
    return ArmSettings(name="left", source=str(path), robot="panda", method="map", save=str(kept))


def test_a_state_of_other_settings_goes_away_once_nothing_goes_on_from_it(settings, saved, monkeypatch):
    mine, before, today = (
        settings.state,
        replace(settings, mass="1.200±0.002").state,
        replace(settings, steady=True).state,
    )
    saved(mine, 2 * HOUR)
    saved(before, 2 * HOUR)
    saved(today, 0.5 * HOUR)  # whoever changes the settings back goes on from it
    process, notes = ArmProcess(settings, 0.1), []
    monkeypatch.setattr(process, "note", notes.append)
    process.run()
    assert sorted(mine.parent.iterdir()) == sorted([mine, today])
    assert notes[0] == f"{before}, a state of other settings, is too old to go on from: removed"


def test_a_state_that_becomes_too_old_while_the_arm_runs_goes_away(settings, saved):
    other, said = replace(settings, mass="1.200±0.002").state, []
    saved(other, 0.5 * HOUR)
    states, now = OldStates(settings.state, HOUR, said.append), time.monotonic()
    states.clear(now)
    saved(other, 1.5 * HOUR)
    states.clear(now + 0.9 * HOUR)  # it looks once in an hour
    assert other.exists()
    states.clear(now + 1.1 * HOUR)
    assert not other.exists()
    assert len(said) == 1


def test_nothing_but_an_old_state_of_the_arm_goes_away(settings, saved):
    mine, folder = settings.state, settings.state.parent
    kept = {
        "left-0123abcd.npz": "a text of somebody's",
        "left-0123abce.npz": None,  # saved in the time to come
        "left-0123abcf.npz": None,  # another process keeps it
    }
    for name in ("left2-0123abcd.npz", "left-0123abcd-0123abcd.npz", "right-0123abcd.npz", "left-0123abcd.copy.npz"):
        saved(folder / name, 2 * HOUR)
    saved(folder / "elsewhere.npz", 2 * HOUR)
    (folder / "left-0123abda.npz").symlink_to(folder / "elsewhere.npz")
    (folder / "left-0123abdb.npz").mkdir()
    (folder / "left-0123abcd.npz").write_text(kept["left-0123abcd.npz"])
    saved(folder / "left-0123abce.npz", -2 * HOUR)
    saved(folder / "left-0123abcf.npz", 2 * HOUR)
    before = sorted(folder.iterdir())
    with kept_alone(folder / "left-0123abcf.npz", 0.0):
        OldStates(mine, HOUR, lambda text: pytest.fail(text)).clear(0.0)
    assert sorted(folder.iterdir()) == before


def test_what_a_killed_process_left_of_other_settings_goes_away(settings):
    """Of a process that was killed while it saved, before the settings were changed."""
    other = replace(settings, mass="1.200±0.002").state
    (other.parent / f".{other.name}.lock").touch()
    (other.parent / f".{other.name}.part0.npz").write_bytes(b"half")
    OldStates(settings.state, HOUR, lambda text: pytest.fail(text)).clear(0.0)
    assert list(other.parent.iterdir()) == []


def test_a_state_that_cannot_be_saved_is_said_to_stay_only_where_one_was_saved_before(tmp_path):
    path, full = tmp_path / "left.npz", OSError(28, "No space left on device")
    assert not_saved(path, full) == (
        f"the state cannot be saved in {path}: No space left on device; none was saved there before"
    )
    path.write_bytes(b"")
    assert not_saved(path, full).endswith("No space left on device; the one saved before stays")

"""A survey's empty stretches teach a profile, which the next survey uses; what does not fit is left out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from armload.inertia import InertialParameters
from armload.motion import random_motion
from armload.posterior import load_profile
from armload.recording import write_recording
from armload.simulation import World, simulate_inverse
from armload.survey import Settings, learning, survey


@pytest.mark.full
def test_an_exchanged_arm_is_not_averaged_with_the_one_before(panda, tmp_path, monkeypatch):
    monkeypatch.setattr(learning, "FIRST", 2)  # fewer logs than a profile chooses its capacity from: quick
    world = World.real_like(panda, 3)
    other = replace(world, offset=world.offset + 20.0 * np.sign(world.offset))
    (tmp_path / "a").mkdir()
    for day in range(4):
        log = simulate_inverse(
            panda, random_motion(panda, day, duration=21.0), world=other if day == 2 else world, rate=50.0, seed=day
        )
        write_recording(tmp_path / "a" / f"{day}.npz", replace(log, t=log.t + 1.79e9 + 86400.0 * day))
    settings = Settings("panda", method="map")
    found = survey([str(tmp_path / "a")], settings, tmp_path / "s.json", jobs=1)
    rows = [row | {"held": False, "mass_low": -1.0, "mass_high": 1.0, "moves": False} for row in found.rows]
    said = learning.learn_profiles(rows, settings, tmp_path / "p")
    assert said == {"a": "learned from 3 stretches, 1 did not fit"}
    assert len(load_profile(tmp_path / "p" / "a.profile").sessions) == 3
    (left,) = json.loads((tmp_path / "p" / "a.json").read_text())["left_out"]
    assert left["log"].endswith("2.npz")
    before = (tmp_path / "p" / "a.profile").stat().st_mtime_ns
    assert learning.learn_profiles(rows, settings, tmp_path / "p") == {"a": "as before, of 3 stretches"}
    assert (tmp_path / "p" / "a.profile").stat().st_mtime_ns == before
    paths = [str(tmp_path / "a" / f"{day}.npz") for day in (2, 3)]
    using = replace(settings, method=None, profile=str(tmp_path / "p" / "{arm}.profile"))
    exchanged, sound = survey(paths, using, tmp_path / "t.json", jobs=1).rows
    assert exchanged["changed"]
    assert not sound["changed"]
    assert sound["relative_to"] == "profile"


@pytest.mark.parametrize("arm", ["a", "site/a", "{folder}/logs/a"])
def test_a_profile_is_written_where_the_next_survey_looks_for_it(arm, tmp_path, monkeypatch):
    """Also of an arm that --arm-of names by a whole path: never beside its logs."""
    arm = arm.format(folder=tmp_path)
    empty = {"arm": arm, "log": "a.csv", "part": 0, "date": None, "key": "k", "status": "answered", "determined": "m"}
    empty |= {"held": False, "moves": False, "mass_low": -0.1, "mass_high": 0.1, "t0": 0.0, "t1": 30.0}
    monkeypatch.setattr(learning, "_learned", lambda *_: (b"learned", [{}], []))
    monkeypatch.setattr(learning, "save_profile", lambda made, path: write_anywhere(path, made))
    learning.learn_profiles([empty], Settings("panda"), tmp_path / "p")
    found = Settings("panda", profile=f"{tmp_path}/p/{{arm}}.profile").of_arm("profile", arm)
    assert found is not None
    assert found.read_bytes() == b"learned"


def write_anywhere(path, content):
    """As `save_profile`, which makes the folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def test_a_stretch_that_holds_something_is_left_out_and_the_profile_made_of_the_others(panda):
    """Three days, one of them with half a kilogram that nobody saw: its number, and a profile of the other two."""
    world = World.real_like(panda, 3)
    held = InertialParameters.from_com(0.5, (0.0, 0.0, 0.06), 0.5 * np.diag([2e-3, 2e-3, 1e-3]))
    logs = [
        simulate_inverse(
            panda,
            random_motion(panda, day, duration=12.0),
            [(0.0, held if day == 1 else None)],
            world=world,
            rate=50.0,
            seed=day,
        )
        for day in range(3)
    ]
    profile, apart = learning._of_those_that_agree(panda, logs, None)
    assert list(apart) == [1]
    assert "beside what is mounted in the other logs" in apart[1]
    assert len(profile.sessions) == 2


def test_logs_in_an_object_store_teach_the_profile_that_those_on_disk_do(panda, tmp_path):
    """And a log that is no arm's teaches none."""
    fsspec = pytest.importorskip("fsspec")
    store, world, rows = fsspec.filesystem("memory"), World.real_like(panda, 3), {"disk": [], "store": []}
    bounds = {"t0": 0.0, "t1": 20.5, "held": False, "mass_low": -1.0, "mass_high": 1.0, "moves": False}
    try:
        for day in range(2):
            log = simulate_inverse(panda, random_motion(panda, day, duration=21.0), world=world, rate=50.0, seed=day)
            write_recording(file := tmp_path / f"{day}.npz", replace(log, t=log.t + 1.79e9 + 86400.0 * day))
            store.pipe(f"/cell/{day}.npz", file.read_bytes())
            about = {
                "arm": "a",
                "episode": None,
                "part": 0,
                "date": 86400.0 * day,
                "status": "answered",
                "key": str(day),
            }
            for place, name in (("disk", str(file)), ("store", f"memory://cell/{day}.npz")):
                rows[place].append(about | bounds | {"log": name, "determined": "m"})
        for place, some in rows.items():
            nobodys = some[0] | {"arm": "", "status": "unusable"}
            said = learning.learn_profiles([*some, nobodys], Settings("panda"), tmp_path / place)
            assert said == {"a": "learned from 2 stretches"}
        one, other = (load_profile(tmp_path / place / "a.profile") for place in rows)
        assert np.array_equal(one.b, other.b)
    finally:
        store.rm("/cell", recursive=True)


@pytest.mark.parametrize("damage", ["", "{", "[]", "3", '{"key": 3}', "\xff", "[" * 100_000])
def test_a_damaged_note_of_what_a_profile_was_learned_from_is_written_anew(tmp_path, monkeypatch, damage):
    made = []
    monkeypatch.setattr(learning, "save_profile", lambda _, path: made.append(path) or path.touch())
    monkeypatch.setattr(learning, "_learned", lambda chosen, _: (object(), list(range(len(chosen))), []))
    row = {"status": "answered", "held": False, "determined": "m", "mass_low": -1.0, "mass_high": 1.0, "moves": False}
    rows = [row | {"arm": "a", "log": "a/0.csv", "part": 0, "date": None, "t0": 0.0, "t1": 60.0, "key": "k"}]
    settings, folder = Settings("panda"), tmp_path / "p"
    for _ in range(2):
        said = learning.learn_profiles(rows, settings, folder)
    assert said == {"a": "as before, of 1 stretches"}
    (folder / "a.json").write_bytes(damage.encode("latin-1"))
    assert learning.learn_profiles(rows, settings, folder) == {"a": "learned from 1 stretches"}
    assert learning.learn_profiles(rows, settings, folder) == {"a": "as before, of 1 stretches"}
    assert len(made) == 2

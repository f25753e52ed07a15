"""`armload profile`, and `--profile` of the other commands."""

from __future__ import annotations

import json
import os
import re
import signal
import threading
import time
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np
import pytest

from armload.app.cli import main, outputs
from armload.app.cli.learning import learn_from
from armload.app.cli.outputs import contents_of, replacing_unchanged
from armload.app.cli.profile_text import next_steps, of_motors, print_profile
from armload.arms import arm
from armload.errors import UsageError
from armload.inertia import InertialParameters
from armload.lab.report.profile_figure import profile_figure
from armload.lab.report.style import look
from armload.motion import random_motion, save_motion, taie2024
from armload.online import OnlineIdentifier
from armload.payloads import hand_on
from armload.payloads import test_payload as make_payload
from armload.posterior import load_profile, save_profile
from armload.recording import write_recording
from armload.simulation import Run, World, simulate_many
from armload.simulation.resolution import COARSE

PANDA = ("--robot", "panda", "--profile")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Four empty logs, and one of a payload."""
    made, panda = tmp_path_factory.mktemp("profile"), arm("panda")
    world, motions = World.real_like(panda, 3), [random_motion(panda, seed, duration=6.0) for seed in range(5)]
    runs = [Run(motion, None, world, seed=k) for k, motion in enumerate(motions[:4])]
    runs.append(Run(motions[4], make_payload().parameters, world, seed=9))
    logs = simulate_many(panda, runs, rate=100.0, duration=6.0, workers=1, resolution=COARSE)
    for name, log in zip([*(f"day{k}.csv" for k in range(4)), "run.csv"], logs, strict=True):
        write_recording(made / name, log)
    return made


@pytest.fixture(scope="module")
def profile(folder):
    path = folder / "arm.profile"
    logs = [str(folder / f"day{k}.csv") for k in range(3)]
    assert main(["profile", *logs, "--robot", "panda", "--out", str(path)]) == 0
    return path


def test_logs_make_a_profile_that_identify_uses(folder, profile, capsys):
    assert main(["identify", str(folder / "run.csv"), "--robot", "panda", "--profile", str(profile), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["relative_to"] == "profile"
    truth = make_payload().parameters.mass
    assert found["phi_low"][0] <= truth <= found["phi_high"][0]
    assert found["phi_high"][0] - found["phi_low"][0] < 0.2


def test_a_log_that_its_profile_is_learned_from_is_not_called_calibrated(folder, profile, capsys):
    assert main(["identify", str(folder / "day1.csv"), "--robot", "panda", "--profile", str(profile), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["interval"] == "approximate"
    assert any("learned from these very measurements" in note for note in found["notes"])
    as_tare = ["--tare", str(folder / "day1.csv"), "--profile", str(profile), "--json"]
    assert main(["identify", str(folder / "run.csv"), "--robot", "panda", *as_tare]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["interval"] == "approximate"
    assert any("learned from these very measurements" in note for note in found["notes"])


def test_show_says_what_is_known_and_how_the_arm_drifted(profile, capsys, tmp_path):
    figure = tmp_path / "arm.png"
    assert main(["profile", "show", str(profile), "--figure", str(figure)]) == 0
    said = capsys.readouterr()
    assert "3 sessions, 18 s" in said.out
    assert "day2.csv" in said.out
    assert "learn a new profile of all these logs" in said.err  # of three
    assert figure.read_bytes()[:4] == b"\x89PNG"
    assert main(["profile", "show", str(profile), "--json"]) == 0
    fields = json.loads(capsys.readouterr().out)
    assert len(fields["sessions"]) == 3
    assert np.isfinite(fields["drift_offset"]).all()


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_what_a_misfit_tells_is_said_of_the_side_of_the_gears_on_which_torque_is_measured(name, profile, capsys):
    """Of motor currents the friction of gears hides whose arm it is: `check_fits` does not ask there."""
    known = replace(load_profile(profile), arm_name=name)
    print_profile(known, of_motors(known))
    said = capsys.readouterr().err
    assert ("above 60 it is another arm's" in said) == (not arm(name).motor_torque)
    assert ("another arm of the type stays below" in said) == arm(name).motor_torque


def test_what_was_done_to_the_logs_is_said_once_for_all_of_them(folder, tmp_path, capsys):
    for k in range(3):  # the last row is there twice
        lines = (folder / f"day{k}.csv").read_text().splitlines()
        (tmp_path / f"twice{k}.csv").write_text("\n".join([*lines, lines[-1]]) + "\n")
    logs = [str(tmp_path / f"twice{k}.csv") for k in range(3)]
    assert main(["profile", *logs, "--robot", "panda", "--out", str(tmp_path / "arm.profile")]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if "repeat" in line]
    assert len(said) == 1
    assert f"{logs[0]} and 2 other logs" in said[0]


def test_that_answers_with_a_profile_of_motor_currents_are_approximate_is_said_when_it_is_learned(profile, capsys):
    for motors in (True, False):
        print_profile(load_profile(profile), motors)
        assert ("are called approximate" in capsys.readouterr().err) == motors


def test_a_figure_is_of_the_profile_s_own_arm_in_the_form_that_its_name_says(profile, capsys, tmp_path):
    show = ["profile", "show", str(profile), "--figure"]
    for robot, frame in (("fr3", "fr3_link8"), ("ur5e", "tool0")):
        assert main([*show, str(tmp_path / "arm.png"), "--robot", robot]) == 2
        assert f"the profile is of panda to panda_link8: {robot} to {frame} is another arm" in capsys.readouterr().err
    assert main([*show, str(tmp_path / "arm.txt")]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "'txt' is not supported" in said.err
    assert list(tmp_path.iterdir()) == []
    assert main([*show, str(tmp_path / "arm.svg"), "--robot", "panda"]) == 0
    assert f"wrote {tmp_path / 'arm.svg'}" in capsys.readouterr().err
    assert b"<svg" in (tmp_path / "arm.svg").read_bytes()


def test_nothing_of_the_figure_is_cut_off_and_sessions_are_whole(profile):
    figure = profile_figure(load_profile(profile), arm("panda"))
    with look():
        figure.canvas.draw()
    written = figure.get_tightbbox()  # [in]
    assert min(written.x0, written.y0) >= 0.0
    assert written.x1 <= figure.get_figwidth()
    assert written.y1 <= figure.get_figheight()
    sessions = next(ax for part in figure.subfigs for ax in part.axes if ax.get_xlabel() == "session")
    ticks = sessions.get_xticks()
    assert np.array_equal(ticks, np.round(ticks))


def test_logs_are_added_about_the_profile_s_own_frame(folder, profile, capsys, tmp_path):
    path = tmp_path / "more.profile"
    path.write_bytes(profile.read_bytes())
    update = ["profile", str(folder / "day3.csv"), "--robot", "panda", "--out", str(path), "--update", "--frame"]
    assert main([*update, "panda_link7"]) == 2
    assert "--frame panda_link7 is not the profile's" in capsys.readouterr().err
    assert path.read_bytes() == profile.read_bytes()
    assert main([*update, "panda_link8"]) == 0


def test_sessions_are_shown_in_the_order_of_their_dates(profile, capsys, tmp_path):
    known, path = load_profile(profile), tmp_path / "dated.profile"
    dates = {"day0.csv": 1.8e9, "day1.csv": None, "day2.csv": 1.7e9}
    sessions = [replace(one, date=dates[one.name.rsplit("/", 1)[-1]]) for one in known.sessions]
    save_profile(replace(known, sessions=tuple(sessions)), path)
    assert main(["profile", "show", str(path)]) == 0
    assert re.findall(r"day\d\.csv", capsys.readouterr().out) == ["day2.csv", "day1.csv", "day0.csv"]


def test_a_session_of_several_logs_is_shown_with_all_their_names(folder, capsys, tmp_path):
    logs = [str(folder / f"day{k}.csv") for k in range(2)]
    words = ["profile", *logs, "--robot", "panda", "--out", str(tmp_path / "one.profile"), "--one-session"]
    assert main(words) == 0
    said = capsys.readouterr()
    assert "day0.csv, day1.csv" in said.out
    assert "one session does not tell how the arm drifts" in said.err


def test_the_offsets_of_an_arm_of_small_servos_are_shown_with_two_digits(profile, capsys):
    known = load_profile(profile)
    small = [replace(one, offset=(0.0042, *[-0.0006] * (known.n - 1))) for one in known.sessions]
    print_profile(replace(known, sessions=tuple(small)), motors=False)
    assert "+0.0042 -0.0006 -0.0006" in capsys.readouterr().out


def test_a_log_that_fits_less_well_than_an_arm_s_own_is_named(profile):
    known = load_profile(profile)
    assert not any("was it made by this arm?" in line for line in next_steps(known))
    odd = replace(known.sessions[1], statistic=48.0)
    said = [line for line in next_steps(replace(known, sessions=(known.sessions[0], odd))) if "misfit" in line]
    assert len(said) == 1
    assert said[0].startswith("day1.csv fits less well")


def test_of_a_hundred_profiles_of_many_sound_sessions_hardly_one_asks_about_any(profile):
    """Sessions of one arm, T as its definition has it: chi-squared of three for each joint."""
    known, rng, asked = load_profile(profile), np.random.default_rng(4), 0
    for _ in range(300):
        found = (replace(known.sessions[0], statistic=float(T)) for T in rng.chisquare(3 * known.n, size=40))
        asked += any("made by this arm" in line for line in next_steps(replace(known, sessions=tuple(found))))
    assert 0 < asked <= 9


def test_update_adds_a_session_and_refuses_a_payload(folder, profile, capsys, tmp_path):
    path = tmp_path / "more.profile"
    path.write_bytes(profile.read_bytes())
    log, out = str(folder / "day3.csv"), ["--robot", "panda", "--out", str(path), "--update"]
    assert main(["profile", log, *out]) == 0
    assert len(load_profile(path).sessions) == 4
    before = path.read_bytes()
    capsys.readouterr()
    assert main(["profile", str(folder / "run.csv"), *out]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "carries" in said.err
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("argv", "expected"),
    [
        (["profile", "show"], "takes one profile"),
        (["profile", "show", "arm.profile", "--out", "x", "--update"], "--out and --update are of learning"),
        (
            ["profile", "day3.csv", "--robot", "panda", "--out", "new.profile", "--figure", "x.png"],
            "--figure is of armload profile show",
        ),
        (["profile", "day3.csv", "--robot", "panda", "--out", "new.profile", "--tare-episode", "1"], "--tare-episode"),
        (
            [
                "profile",
                "day3.csv",
                "--robot",
                "panda",
                "--out",
                "arm.profile",
                "--update",
                "--mass",
                "2±0.1",
                "--one-session",
            ],
            "leave --one-session out",
        ),
        (["profile", "day0.csv"], "needs --robot"),
        (["profile", "day0.csv", "--robot", "panda", "--out", "none.profile", "--update"], "leave --update out"),
        (["profile", "day3.csv", "--robot", "panda", "--out", "arm.profile"], "arm.profile exists: give --update"),
        (["profile", "day1.csv", "--robot", "panda", "--out", "arm.profile", "--update"], "holds measurements of"),
        (["profile", "day3.csv", "day3.csv", "--robot", "panda", "--out", "new.profile"], "holds measurements of"),
        (["identify", "run.csv", "--robot", "panda", "--profile", "none.profile"], "no profile at"),
        (
            ["identify", "run.csv", "--robot", "panda", "--profile", "arm.profile", "--method", "wls"],
            "cannot use a profile",
        ),
        (["live", "run.csv", "--robot", "panda", "--learn", "--headless"], "there is no --profile"),
        (["live", "run.csv", "--robot", "panda", "--profile", "arm.profile", "--learn", "--loop"], "leave one of the"),
        (
            ["live", "run.csv", "--robot", "panda", "--profile", "arm.profile", "--tool", "franka-hand"],
            "give one of them",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(folder, profile, capsys, monkeypatch, argv, expected):
    assert profile.exists()
    monkeypatch.chdir(folder)
    assert main(argv) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert expected in said.err
    assert len(said.err.strip().splitlines()) == 1


def test_a_stream_uses_a_profile_and_leaves_it_as_it_was_where_nothing_was_learned(folder, profile, capsys):
    before = profile.read_bytes()
    argv = ["live", str(folder / "run.csv"), "--robot", "panda", "--profile", str(profile)]
    assert main([*argv, "--learn", "--headless", "--speed", "max", "--every", "1"]) == 0
    said = capsys.readouterr()
    last = json.loads(said.out.strip().splitlines()[-1])
    assert last["relative_to"] == "profile"
    assert "is as it was" in said.err
    assert profile.read_bytes() == before


@pytest.fixture(scope="module")
def long(folder):
    """A log of the empty arm that a stream may be learned from."""
    panda, motion = arm("panda"), random_motion(arm("panda"), 7, duration=22.0)
    run = Run(motion, None, World.real_like(panda, 3), seed=11)
    (log,) = simulate_many(panda, [run], rate=100.0, duration=22.0, workers=1, resolution=COARSE)
    write_recording(folder / "long.csv", log)
    return str(folder / "long.csv")


@pytest.mark.full  # some seconds
def test_measurements_that_a_stream_has_taught_are_learned_once(long, profile, tmp_path, capsys):
    path, record = tmp_path / "learning.profile", str(tmp_path / "record.csv")
    path.write_bytes(profile.read_bytes())
    learn = ["--robot", "panda", "--profile", str(path), "--learn", "--headless", "--speed", "max"]
    assert main(["live", long, *learn, "--record", record]) == 0
    assert "learned 22 s" in capsys.readouterr().err
    learned = path.read_bytes()
    assert main(["live", long, *learn]) == 0
    assert f"is as it was: {long} holds measurements of {long}" in capsys.readouterr().err
    for log in (long, record):
        assert main(["profile", log, "--robot", "panda", "--out", str(path), "--update"]) == 2
        assert f"{log} holds measurements of {long}" in capsys.readouterr().err
    assert path.read_bytes() == learned
    found = _said(["identify", record, "--robot", "panda", "--profile", str(path)], capsys)
    assert found["interval"] == "approximate"


@pytest.mark.full  # some seconds
def test_a_stream_adds_to_what_its_profile_s_file_holds_when_it_ends(folder, long, profile, tmp_path, monkeypatch):
    from armload.app.cli import headless

    path, begun = tmp_path / "shared.profile", profile.read_bytes()
    path.write_bytes(begun)
    streamed = headless.lines

    def meanwhile(*given):
        yield from streamed(*given)
        assert main(["profile", str(folder / "day3.csv"), "--robot", "panda", "--out", str(path), "--update"]) == 0

    monkeypatch.setattr(headless, "lines", meanwhile)
    argv = ["live", long, "--robot", "panda", "--profile", str(path), "--learn", "--headless", "--speed", "max"]
    assert main(argv) == 0
    names = [session.name.rsplit("/", 1)[-1] for session in load_profile(path).sessions]
    assert names == ["day0.csv", "day1.csv", "day2.csv", "day3.csv", "long.csv"]


@pytest.mark.full  # some seconds
def test_what_is_added_while_a_stream_s_own_is_learned_is_kept(folder, long, profile, tmp_path, monkeypatch):
    path, learned, added = tmp_path / "shared.profile", OnlineIdentifier.learned, []
    path.write_bytes(profile.read_bytes())

    def meanwhile(*given):
        made = learned(*given)
        if not added:
            added.append(
                main(["profile", str(folder / "day3.csv"), "--robot", "panda", "--out", str(path), "--update"])
            )
        return made

    monkeypatch.setattr(OnlineIdentifier, "learned", meanwhile)
    argv = ["live", long, "--robot", "panda", "--profile", str(path), "--learn", "--headless", "--speed", "max"]
    assert main(argv) == 0
    names = [session.name.rsplit("/", 1)[-1] for session in load_profile(path).sessions]
    assert names == ["day0.csv", "day1.csv", "day2.csv", "day3.csv", "long.csv"]


@pytest.mark.usefixtures("far_east")
def test_sessions_of_one_robot_s_streams_are_told_apart_by_when_they_were_in_utc(profile, tmp_path, capsys):
    path, known = tmp_path / "arm.profile", load_profile(profile)
    named = SimpleNamespace(learned=lambda name, now: replace(now, sessions=(replace(known.sessions[0], name=name),)))
    path.write_bytes(profile.read_bytes())
    began = datetime.now(UTC).replace(second=0, microsecond=0)
    learn_from(SimpleNamespace(source=SimpleNamespace(name="panda://10.0.0.2"), identifier=named), str(path))
    capsys.readouterr()
    assert main(["profile", "show", str(path)]) == 0
    found = re.search(r"10\.0\.0\.2 (20\d\d-\d\d-\d\d \d\d:\d\d) UTC", capsys.readouterr().out)
    assert found is not None
    assert began <= datetime.fromisoformat(found[1]).replace(tzinfo=UTC) <= datetime.now(UTC)


@pytest.mark.full  # some seconds
def test_a_stream_that_is_stopped_by_sigterm_has_taught_its_profile(long, profile, tmp_path, monkeypatch, capsys):
    from armload.app.cli import headless

    path, streamed = tmp_path / "stopped.profile", headless.lines
    path.write_bytes(profile.read_bytes())

    def stopped(*given):
        yield from streamed(*given)
        os.kill(os.getpid(), signal.SIGTERM)
        yield from ()

    def unheard(*_):
        raise AssertionError("SIGTERM was not heard")

    monkeypatch.setattr(headless, "lines", stopped)
    before = signal.signal(signal.SIGTERM, unheard)
    try:
        argv = ["live", long, "--robot", "panda", "--profile", str(path), "--learn", "--headless", "--speed", "max"]
        assert main(argv) == 130
        assert signal.getsignal(signal.SIGTERM) is unheard
    finally:
        signal.signal(signal.SIGTERM, before)
    assert "learned 22 s" in capsys.readouterr().err
    assert len(load_profile(path).sessions) == 4


def test_a_known_weight_below_a_known_tool_weighs_as_much_as_both(folder, profile, tmp_path):
    panda, hand = arm("panda"), hand_on(arm("panda")).parameters
    weight = InertialParameters.from_com(2.0, (0.0, 0.0, 0.1), 2e-3 * np.eye(3), hand.frame)
    motion = random_motion(panda, 8, duration=6.0)
    run = Run(motion, hand + weight, World.real_like(panda, 3), seed=12)
    (log,) = simulate_many(panda, [run], rate=100.0, duration=6.0, workers=1, resolution=COARSE)
    write_recording(folder / "hung.csv", log)
    both, gains = hand.mass + 2.0, []
    about = {"mass": hand.mass, "com": hand.com.tolist(), "inertia_com": hand.inertia_com.tolist(), "frame": hand.frame}
    (tmp_path / "hand.json").write_text(json.dumps({**about, "std": {"mass": 0.05}}))
    named, weighed = ["--tool", "franka-hand"], ["--tool", str(tmp_path / "hand.json")]
    cases = ((2.0, 0.002, named), (both, 0.002, []), (2.0, 0.002, weighed), (both, np.hypot(0.002, 0.05), []))
    for k, (mass, std, more) in enumerate(cases):
        path = tmp_path / f"{k}.profile"
        path.write_bytes(profile.read_bytes())
        words = ["profile", str(folder / "hung.csv"), "--robot", "panda", "--out", str(path), "--update"]
        assert main([*words, "--mass", f"{mass}±{std}", *more]) == 0
        gains.append(load_profile(path).gain)
    np.testing.assert_allclose(gains[0], gains[1], rtol=1e-12)
    np.testing.assert_allclose(gains[2], gains[3], rtol=0, atol=1e-9)
    assert np.abs(gains[0]).max() < 0.03
    assert np.abs(gains[2] - gains[0]).max() > 1e-4  # a tool that is not known so well tells less


def test_a_profile_that_another_program_changed_meanwhile_is_left_so(folder, profile, tmp_path, monkeypatch, capsys):
    import armload.posterior

    path, learn = tmp_path / "shared.profile", armload.posterior.learn_profile
    path.write_bytes(profile.read_bytes())

    def meanwhile(*given, **named):
        made = learn(*given, **named)
        path.write_bytes(b"of another program")
        return made

    monkeypatch.setattr(armload.posterior, "learn_profile", meanwhile)
    assert main(["profile", str(folder / "day3.csv"), "--robot", "panda", "--out", str(path), "--update"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "changed by another program" in said.err
    assert path.read_bytes() == b"of another program"


@pytest.mark.parametrize("by", ["update", "stream"])
def test_a_profile_is_written_while_nobody_else_may_write_it(by, folder, profile, tmp_path, monkeypatch):
    """Of two commands that end at once, the later one finds what the earlier one has written."""
    import armload.posterior

    path, known, alone = tmp_path / "shared.profile", load_profile(profile), []
    path.write_bytes(profile.read_bytes())

    def save(*given):
        second = replacing_unchanged("--out", str(path), contents_of(str(path)))
        with pytest.raises(UsageError, match=r"shared\.profile is being written by another program"), second:
            pass
        alone.append(save_profile(*given))

    monkeypatch.setattr(outputs, "_WRITES", 0.0)
    monkeypatch.setattr(armload.posterior, "save_profile", save)
    if by == "update":
        monkeypatch.setattr(armload.posterior, "learn_profile", lambda *_, **__: known)
        assert main(["profile", str(folder / "day3.csv"), "--robot", "panda", "--out", str(path), "--update"]) == 0
    else:
        named = SimpleNamespace(learned=lambda *_: known)
        learn_from(SimpleNamespace(source=SimpleNamespace(name="panda://10.0.0.2"), identifier=named), str(path))
    assert alone == [path]
    assert not list(tmp_path.glob(".*"))


def test_of_two_that_replace_a_file_at_once_the_second_is_told_that_it_has_changed(tmp_path):
    path, told = tmp_path / "shared", []
    path.write_text("before")
    before = contents_of(str(path))

    def other():
        try:
            with replacing_unchanged("--out", str(path), before):
                path.write_text("the other's")
        except UsageError as error:
            told.append(str(error))

    thread = threading.Thread(target=other)
    with replacing_unchanged("--out", str(path), before):
        thread.start()
        time.sleep(0.2)
        path.write_text("the first's")
    thread.join()
    assert told == [f"--out {path} was changed by another program meanwhile: it is left so; ask once more"]
    assert path.read_text() == "the first's"


def _said(words, capsys):
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.full
def test_a_design_with_a_profile_tells_more_than_one_without_a_tare(profile, tmp_path, capsys):
    pose = ["--from", "0,-0.5,0,-2,0,1.6,0.8", "--time", "0.5", "--joints", "6-7", "--payload", "1"]
    words = ["motion", "design", "--robot", "panda", *pose, "--tare", "none", "--out", str(tmp_path / "m.json")]
    alone, known = _said(words, capsys), _said([*words, "--profile", str(profile)], capsys)
    assert known["tare"] == f"without a tare, with the profile {profile}"
    # its determinant is what a design makes small: widths in the mean of their logarithms, as the motions differ
    assert np.log(np.array(known["half_width"]) / alone["half_width"]).mean() < -0.1
    assert main([*words[:3], "ur10e", *words[4:], "--profile", str(profile)]) == 2


def test_a_path_is_enriched_with_a_profile(profile, tmp_path, capsys):
    path = tmp_path / "path.csv"
    t = np.linspace(0.0, 1.0, 101)
    ramp = 10 * t**3 - 15 * t**4 + 6 * t**5
    q = np.array([0, -0.5, 0, -2, 0, 1.6, 0.8]) + 0.3 * ramp[:, None] * np.eye(7)[0]
    header = "t," + ",".join(f"q{k}" for k in range(1, 8))
    np.savetxt(path, np.column_stack([t, q]), delimiter=",", header=header, comments="")
    words = ["motion", "enrich", str(path), "--robot", "panda", "--tare", "none", "--payload", "1"]
    words += ["--out", str(tmp_path / "out.csv")]
    alone, known = _said(words, capsys), _said([*words, "--profile", str(profile)], capsys)
    assert np.all(np.array(known["half_width_before"]) < alone["half_width_before"])


@pytest.mark.full
def test_a_measurement_with_a_profile_is_relative_to_its_own_empty_run(profile, tmp_path, capsys):
    save_motion(tmp_path / "m.json", taie2024().scaled(0.25))
    words = ["measure", "sim", "--robot", "panda", "--speed", "max", "--method", "map-gp", "--world", "real-like:3"]
    words += ["--motion", str(tmp_path / "m.json"), "--move", "--dir", str(tmp_path / "logs")]
    said = _said([*words, "--profile", str(profile)], capsys)
    assert said["relative_to"] == "tare"
    assert said["mass"] == pytest.approx(make_payload().parameters.mass, abs=0.05)
    logs = [str(tmp_path / "logs" / name) for name in ("loaded.csv", "empty.csv")]
    words = ["identify", logs[0], "--robot", "panda", "--tare", logs[1], "--profile", str(profile)]
    again = _said([*words, "--method", "map-gp"], capsys)
    np.testing.assert_allclose(said["phi"], again["phi"], rtol=1e-9)


def test_a_profile_of_another_arm_is_refused_before_anything_moves(profile, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    start = ["--robot", "fr3", "--profile", str(profile)]
    for words in (
        ["motion", "design", *start, "--from", "0,-0.5,0,-2,0,1.6,0.8", "--out", "m.json"],
        ["measure", "sim", *start, "--at", "0,-0.5,0,-2,0,1.6,0.8", "--move", "--speed", "max"],
    ):
        assert main(words) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert "panda" in said.err.splitlines()[-1]
        assert list(tmp_path.iterdir()) == []


def test_the_command_that_a_profile_is_used_with_names_frame_and_gravity_as_it_was_learned(folder, tmp_path, capsys):
    from armload.arms.facts import description_of

    urdf = tmp_path / "cell.urdf"
    urdf.write_text(description_of("panda"))
    about = ("--robot", str(urdf), "--frame", "panda_link7")
    out = str(tmp_path / "cell.profile")
    assert main(["profile", str(folder / "day0.csv"), *about, "--gravity", "0,0,-9.8", "--out", out]) == 0
    (use,) = (line for line in capsys.readouterr().out.splitlines() if "use it with" in line)
    assert f"{' '.join(about)} --gravity 0,0,-9.8 --profile {out}" in use
    assert main(["profile", "show", out, "--robot", str(urdf)]) == 0  # about the profile's own frame
